//! `wetclutch check`.

use std::path::Path;

use car::{Experiment, GainMethod, Vehicle};
use config::{CarFile, DriveFile, ExperimentFile, GearboxFile, Kind, Source, Study, Values, VehicleFile};
use design::{longest_step_of, unstable_corners};
use report::tables::phase_name;
use trace::ShownPath as _;
use trace::quantity;
use wetclutch::checks::errors_of;

use super::car::{describe_car, describe_gearbox};
use super::check_defaults::{describe_car_values, describe_defaults};
use super::check_page;
use super::gearbox;
use super::matrix::sensors_or_bench;
use super::page::{check_page as page_is_free, write_page};
use super::simulate_drive::describe_drive;
use crate::args::Check;
use crate::failure::Failure;
use crate::output;

/// Checks the files one after the other: one with errors does not stop the others.
pub(crate) fn check(options: &Check) -> Result<(), Failure> {
    if options.json {
        return super::check_json::check(options);
    }
    let [file] = options.files.as_slice() else { return several(options) };
    page_is_free(&options.page, &options.files)?;
    check_file(options, file)
}

fn several(options: &Check) -> Result<(), Failure> {
    if options.page.page.is_some() {
        let message = "--page takes one file\nhint: check the files one by one";
        return Err(Failure::Input(message.to_owned()));
    }
    if options.output.is_some() {
        let message = "-o takes the diagrams of one gearbox\nhint: check the files of gearboxes one by one";
        return Err(Failure::Input(message.to_owned()));
    }
    let mut failed: Vec<(&Path, Failure)> = Vec::new();
    for file in &options.files {
        output::line(&format!("{}:", file.shown()))?;
        if let Err(failure) = check_file(options, file) {
            // Nobody reads on.
            if matches!(failure, Failure::BrokenPipe) {
                return Err(failure);
            }
            output::error(&failure.to_string());
            failed.push((file, failure));
        }
        output::line("")?;
    }
    if failed.is_empty() {
        return Ok(());
    }
    let names: Vec<String> = failed.iter().map(|(file, _)| file.shown().to_string()).collect();
    let message = format!("{} of {} files have errors: {}", failed.len(), options.files.len(), names.join(", "));
    Err(match failed.iter().any(|(_, failure)| matches!(failure, Failure::Input(_))) {
        true => Failure::Input(message),
        false => Failure::Work(message),
    })
}

fn check_file(options: &Check, file: &Path) -> Result<(), Failure> {
    let source = Source::read(file)?;
    let errors = errors_of(&source);
    if !errors.is_empty() {
        let messages = errors.iter().map(ToString::to_string);
        return Err(Failure::Input(messages.collect::<Vec<_>>().join("\nerror: ")));
    }
    let kind = source.kind()?;
    if options.output.is_some() && !matches!(kind, Kind::Gearbox | Kind::Car) {
        let what = "only a gearbox is drawn, of a gearbox file or of a vehicle file that names one";
        let message = format!("{}: {what}\nhint: leave -o out", file.shown());
        return Err(Failure::Input(message));
    }
    if options.page.page.is_some() && !matches!(kind, Kind::Gearbox | Kind::Car | Kind::Vehicle) {
        let message = format!("{}: only gearboxes and vehicles have a page\nhint: leave --page out", file.shown());
        return Err(Failure::Input(message));
    }
    if options.sensors.is_some() && kind != Kind::Car {
        super::warn_of_sensors();
    }
    if options.all && !matches!(kind, Kind::Car | Kind::Vehicle) {
        super::warn_without_effect(
            "--all",
            &format!("{} is {}, which has no defaults to show", file.shown(), kind.words()),
        );
    }
    describe_file(options, file, (source, kind))
}

/// Says what a file without errors describes.
fn describe_file(options: &Check, file: &Path, (source, kind): (Source, Kind)) -> Result<(), Failure> {
    match kind {
        Kind::Gearbox => {
            let gearbox = GearboxFile::from_source(source)?;
            gearbox::describe(&gearbox, options.output.as_deref())?;
            write_page(&options.page, || check_page::of_gearbox(&gearbox))
        }
        Kind::Car => describe_whole_car(options, &CarFile::from_source(source)?),
        Kind::CarStudy => super::study::describe_cars(file),
        Kind::Drive => describe_drive(&DriveFile::from_source(source)?, file),
        Kind::Vehicle => {
            let vehicle = VehicleFile::from_source(source)?;
            describe(&vehicle)?;
            warn(&vehicle.implausible());
            describe_defaults(&vehicle, options.all)?;
            write_page(&options.page, || check_page::of_vehicle(&vehicle))
        }
        Kind::Experiment => {
            let experiment = ExperimentFile::from_source(source)?;
            let vehicle = experiment.read_vehicle()?;
            describe_experiment(&experiment)?;
            describe(&vehicle)?;
            warn_of_gains(&experiment, &vehicle);
            warn_of_steps(&experiment, &vehicle);
            Ok(())
        }
        Kind::Overlay => {
            let what = "values for a vehicle file, such as the output of `wetclutch error-bound`; all keys are valid in a vehicle file";
            describe_use(what, "wetclutch design VEHICLE --bounds", file)
        }
        Kind::Sensors => {
            let command = "wetclutch estimate LOG --vehicle VEHICLE --sensors";
            describe_use("sensors of a car", command, file)
        }
        Kind::Study => {
            let study = Study::from_source(source)?;
            describe_study(&study)?;
            describe_experiment(&study.experiment)?;
            describe(&study.vehicle)
        }
        Kind::Learnt => {
            let what =
                "what the gearbox filter has learnt of a car; whether it is of this car is known with its vehicle file";
            describe_use(what, "wetclutch estimate LOG --vehicle VEHICLE --learnt", file)
        }
        Kind::ChannelMap => {
            let what = "a channel map; whether a log has its channels is known with the log";
            describe_use(what, "wetclutch inspect LOG --map", file)
        }
    }
}

fn describe_whole_car(options: &Check, car: &CarFile) -> Result<(), Failure> {
    let sensors = sensors_or_bench(options.sensors.as_deref())?;
    describe_car(car)?;
    describe_gearbox(car)?;
    if let Some(folder) = &options.output {
        gearbox::draw(&car.gearbox, folder)?;
    }
    warn(&car.implausible());
    warn(car.why_not_driven().as_slice());
    if options.sensors.is_some() && (car.gearbox.has_ratios_alone() || (car.defaults_taken.is_empty() && !options.all))
    {
        let why = "no value of this file is varied in a simulated drive";
        super::warn_without_effect("--sensors", why);
    }
    describe_car_values(car, &sensors, options.all)?;
    write_page(&options.page, || check_page::of_car(car))
}

/// Says what a file holds that belongs to a command.
fn describe_use(what: &str, command: &str, file: &Path) -> Result<(), Failure> {
    output::line(&format!("{what}\nuse: {command} {}", file.shown()))?;
    Ok(())
}

/// Says what is unusual about a vehicle.
fn warn(unusual: &[String]) {
    unusual.iter().for_each(|what| output::note(&format!("warning: {what}")));
}

fn describe_study(study: &Study) -> Result<(), Failure> {
    output::line(&format!(
        "study {} \"{}\": {} runs ({}) over {} factors",
        study.name,
        study.title,
        study.runs,
        study.plan.name(),
        study.factors.len()
    ))?;
    for factor in &study.factors {
        let [low, high] = factor.values.taken().ends();
        let sometimes = match &factor.values {
            Values::Sometimes(s) => {
                format!(", in {} % of the runs, otherwise {}", 100.0 * s.chance, s.otherwise)
            }
            _ => String::new(),
        };
        output::line(&format!("  {} from {low} to {high}{sometimes} ({})", factor.name, factor.key))?;
    }
    Ok(())
}

fn describe_experiment(experiment: &Experiment) -> Result<(), Failure> {
    output::line(&format!(
        "experiment {} \"{}\": {} s, shift request at {} s, {} observers",
        experiment.name,
        experiment.title,
        experiment.duration_s,
        experiment.shift.request_s,
        experiment.observers.len()
    ))?;
    Ok(())
}

/// Warns of given gains with which an error grows. The chapter shows such gains, so this is not an error.
fn warn_of_gains(experiment: &Experiment, vehicle: &Vehicle) {
    for entry in &experiment.observers {
        for corner in unstable_corners(vehicle, entry) {
            output::note(&format!(
                "warning: observer \"{}\", {}, {}: the gains are unstable: they multiply an error by {:.2} in each sample of {} s",
                entry.name,
                phase_name(corner.phase),
                corner.label,
                corner.factor,
                entry.sample_time_s,
            ));
        }
    }
}

/// Warns of gains of continuous time that may not correct over the sample time of their observer. Gains for a sample time may
/// always, and a requirement that no gain meets is reported where gains are designed.
fn warn_of_steps(experiment: &Experiment, vehicle: &Vehicle) {
    for entry in experiment.observers.iter().filter(|entry| entry.method == GainMethod::Iss && entry.gains.is_none()) {
        let Ok(Some(longest_s)) = longest_step_of(vehicle, entry) else { continue };
        if entry.sample_time_s > longest_s {
            output::note(&format!(
                "warning: observer \"{}\": its gains are certified for steps of at most {:.1} ms, but its sample time is {:.1} ms: \
                 the observer is the open loop\nhint: use `method = \"peak-to-peak\"`, which designs gains for the sample time",
                entry.name,
                1e3 * longest_s,
                1e3 * entry.sample_time_s,
            ));
        }
    }
}

fn describe(vehicle: &Vehicle) -> Result<(), Failure> {
    output::line(&format!(
        "vehicle \"{}\": ratio {:.3} to {:.3}, {} kg, kiss point of the oncoming clutch {}",
        vehicle.name,
        vehicle.shift.ratio_offgoing(),
        vehicle.shift.ratio_oncoming(),
        vehicle.road.mass_kg,
        quantity(trace::units::mpa(vehicle.oncoming.clutch.kiss_pressure()), "MPa", 3),
    ))?;
    Ok(())
}
