//! `wetclutch check`.

use std::path::Path;

use config::{Car, Drive, Experiment, GainMethod, GearboxFile, Kind, Sensors, Source, Study, Values, Vehicle};
use design::{longest_step_of, unstable_corners};
use trace::ShownPath as _;

use report::tables::phase_name;

use super::car::{describe_car, describe_gearbox};
use super::check_defaults::{describe_car_values, describe_defaults};
use super::gearbox;
use super::matrix::sensors_or_bench;
use super::simulate_drive::describe_drive;
use crate::args::Check;
use crate::failure::Failure;
use crate::output;

pub(crate) fn check(options: &Check) -> Result<(), Failure> {
    let source = Source::read(&options.file)?;
    let kind = source.kind()?;
    if options.output.is_some() && !matches!(kind, Kind::Gearbox | Kind::Car) {
        let what = "only a gearbox is drawn, of a gearbox file or of a vehicle file that names one";
        let message = format!("{}: {what}\nhint: leave -o out", options.file.shown());
        return Err(Failure::Input(message));
    }
    if options.sensors.is_some() && kind != Kind::Car {
        return Err(super::sensors_without_effect());
    }
    match kind {
        Kind::Gearbox => gearbox::describe(&GearboxFile::from_source(source)?, options.output.as_deref()),
        Kind::Car => {
            let car = Car::read(&options.file)?;
            let sensors = sensors_or_bench(options.sensors.as_deref())?;
            describe_car(&car)?;
            describe_gearbox(&car)?;
            if let Some(folder) = &options.output {
                gearbox::draw(&car.gearbox, folder)?;
            }
            warn(&car.implausible());
            warn(car.why_not_driven().as_slice());
            describe_car_values(&car, &sensors, options.all)
        }
        Kind::CarStudy => super::study::describe_cars(&options.file),
        Kind::Drive => describe_drive(&Drive::from_source(source)?, &options.file),
        Kind::Vehicle => {
            let vehicle = Vehicle::from_source(source)?;
            describe(&vehicle)?;
            warn(&vehicle.implausible());
            describe_defaults(&vehicle, options.all)
        }
        Kind::Experiment => {
            let experiment = Experiment::from_source(source)?;
            let vehicle = experiment.read_vehicle()?;
            describe_experiment(&experiment)?;
            describe(&vehicle)?;
            warn_of_gains(&experiment, &vehicle);
            warn_of_steps(&experiment, &vehicle);
            Ok(())
        }
        Kind::Overlay => {
            Vehicle::check_overlay(&source)?;
            let what = "values for a vehicle file, such as the output of `wetclutch error-bound`; all keys are valid in a vehicle file";
            describe_use(what, "wetclutch design VEHICLE --bounds", &options.file)
        }
        Kind::Sensors => {
            Sensors::read(&options.file)?;
            let command = "wetclutch estimate LOG --vehicle VEHICLE --observer kalman --sensors";
            describe_use("sensors of a car", command, &options.file)
        }
        Kind::Learnt => describe_use(
            "what the filter for any shift has learnt of a car",
            "wetclutch estimate LOG --vehicle CAR --learnt",
            &options.file,
        ),
        Kind::Study => {
            let study = Study::read(&options.file)?;
            describe_study(&study)?;
            describe_experiment(&study.experiment)?;
            describe(&study.vehicle)
        }
    }
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
        "vehicle \"{}\": ratio {:.3} to {:.3}, {} kg, kiss point of the oncoming clutch {:.3} MPa",
        vehicle.name,
        vehicle.shift.ratio_offgoing(),
        vehicle.shift.ratio_oncoming(),
        vehicle.road.mass_kg,
        trace::units::mpa(vehicle.oncoming.clutch.kiss_pressure()),
    ))?;
    Ok(())
}
