//! `wetclutch fit` of a car with a whole gearbox.

use std::path::Path;

use car::Car;
use config::CarFile;
use fit::gearbox::{HeldOut, Recorded, Recorder, ShiftLog};
use fit::{FitError, ReadingAges};
use indicatif::ProgressBar;
use logs::ChannelMap;
use observer::ShiftTables;
use study::gearbox::logged::LoggedDrive;
use trace::ShownPath as _;
use wetclutch::estimate::LogInput;
use wetclutch::estimate::gearbox::check_ratios;
use wetclutch::estimate::gearbox::source::{CarReading, CarSource};
use wetclutch::read_sensors as sensors;

use super::{
    HELD_OUT_MIN, MIN_FOR_HELD_OUT, nothing_held_out, page, print_json, progress, reasons, said_of_file, table,
};
use crate::args::Fit;
use crate::commands::{channel_map_of_car, shell_quoted, write_text};
use crate::failure::Failure;
use crate::output;

/// Every so many shifts one is held out; of few more often.
const HELD_OUT_EVERY: usize = 5;
/// More shifts are thinned evenly.
const SHIFTS_MAX: usize = 400;
/// Steps between two signs of life.
const STEPS: u64 = 20_000;

pub(super) fn fit(options: &Fit) -> Result<(), Failure> {
    let car = CarFile::read(&options.vehicle)?;
    if car.gearbox.has_ratios_alone() {
        return Err(Failure::Input(format!(
            "{}: the ratios alone are known of its gearbox, and a fit finds values of clutches and valves\n\
             hint: describe its elements (level = \"stick-diagram\", or \"shares\"); `wetclutch inspect LOG --shifts -o PAGE.html` fits the \
             converter without them",
            options.vehicle.shown()
        )));
    }
    let sensors = options.sensors.as_deref().map(sensors).transpose()?;
    let tables = LoggedDrive::tables(&car, sensors.as_ref())?;
    let ages = sensors.as_ref().map(ReadingAges::of);
    let bar = progress();
    let recorded = record(options, &car, &tables, ages.unwrap_or_default(), &bar)?;
    bar.suspend(|| reasons("not used", &recorded.skipped));
    let Recorded { shifts, driving, .. } = recorded;
    let (fitted_shifts, held_out) = divided(shifts);
    if fitted_shifts.is_empty() {
        bar.finish_and_clear();
        return Err(no_shift(options));
    }
    let found = fit::gearbox::fit(&car, &tables, &fitted_shifts, &driving, &mut |progress| {
        bar.set_message(format!("{} shifts, iteration {}", progress.shifts, progress.iteration + 1));
        bar.tick();
    })?;
    let names: Vec<String> = options.logs.iter().map(|log| log.shown().to_string()).collect();
    let file = |checked: Option<&HeldOut>| found.vehicle_file(&car, &options.output, &names.join(", "), checked);
    let fitted = file(None)?;
    let checked =
        found.validate((&car, &tables), (&fitted, &LoggedDrive::tables(&fitted, sensors.as_ref())?), &held_out);
    let fitted = file(checked.as_ref())?;
    bar.finish_and_clear();
    let against = found.reason_against(checked.as_ref());
    let written = match &against {
        None => fitted,
        Some(reason) => found.kept_file(&car, &options.output, reason)?,
    };
    // Nobody has to read the report to its end.
    write_text(&options.output, &written.source.text)?;
    let [scale, gain] = found.scale_and_gain;
    let statements: Vec<String> = [format!("turbine speed: one-step error {scale:.3} rad/s, g {gain:.2}")]
        .into_iter()
        .chain(found.statements())
        .chain([checked.as_ref().map_or_else(nothing_held_out, said_of)])
        .collect();
    if options.json {
        print_json(options, &found.report(), &statements, found.shifts, against.as_deref())?;
    } else {
        table(&found.report())?;
        statements.iter().try_for_each(|statement| output::line(statement))?;
    }
    said_of_file(options, found.shifts, against.as_deref());
    let intervals = report::fit_page::gearbox_intervals(&found);
    page(options, &car.name, (intervals, statements), against, &[&car.source, &written.source])
}

/// The shifts of all logs.
fn record(
    options: &Fit,
    car: &Car,
    tables: &ShiftTables<f64>,
    ages: ReadingAges,
    bar: &ProgressBar,
) -> Result<Recorded, Failure> {
    let map = channel_map_of_car(&options.mapping, car.road.wheel_radius_m)?;
    let mut all = Recorded::default();
    for log in &options.logs {
        bar.set_message(format!("reading {}", log.shown()));
        bar.tick();
        let one = record_one(log, &map, Recorder::new(car, tables, ages), (car, tables), bar)?;
        check_ratios(one.in_gear, None, &options.vehicle, log)?;
        all.add(one);
    }
    Ok(all)
}

fn record_one(
    log: &Path,
    map: &ChannelMap,
    mut recorder: Recorder<'_>,
    (car, tables): (&Car, &ShiftTables<f64>),
    bar: &ProgressBar,
) -> Result<Recorded, Failure> {
    let mut opened = None;
    let mut steps = CarSource::open(
        CarReading { car, tables, log: LogInput { path: log, table: None, map }, stop: None, threads: 1 },
        &mut opened,
        &mut |note| output::note(note),
    )?;
    let mut count = 0_u64;
    while let Some(step) = steps.next_step()? {
        recorder.push_reported(step.reported_n_m);
        recorder.push(step.time_s, &step.input);
        recorder.push_pressure(step.time_s, step.shift_pressures(tables));
        recorder.push_element_pressures(step.time_s, &step.pressures);
        count += 1;
        if count.is_multiple_of(STEPS) {
            bar.set_message(format!("reading {}, {:.0} s", log.shown(), step.time_s));
            bar.tick();
        }
    }
    bar.suspend(|| steps.finish(&mut |note| output::note(note)))?;
    Ok(recorder.finish())
}

/// Shifts to fit, and shifts that are held out: every fifth, and at least [`HELD_OUT_MIN`]. Of more than a fit can use, some are left out evenly.
fn divided(shifts: Vec<ShiftLog>) -> (Vec<ShiftLog>, Vec<ShiftLog>) {
    let count = shifts.len();
    let every = HELD_OUT_EVERY.min(count / HELD_OUT_MIN);
    let is_held_out = |at: usize| count >= MIN_FOR_HELD_OUT && at % every == every - 1;
    let some = SHIFTS_MAX.min(count);
    let chosen = (0..some).map(|i| shifts[i * count / some.max(1)].clone()).enumerate();
    let (held_out, fitted): (Vec<_>, Vec<_>) = chosen.partition(|(at, _)| is_held_out(*at));
    let logs = |shifts: Vec<(usize, ShiftLog)>| shifts.into_iter().map(|(_, log)| log).collect();
    (logs(fitted), logs(held_out))
}

fn no_shift(options: &Fit) -> Failure {
    let log = options.logs.first().map(|log| shell_quoted(log)).unwrap_or_default();
    FitError::Input(format!(
        "the logs have no shift between two gears that can be fitted\n\
         hint: `wetclutch inspect {log} --shifts` with the same map and the ratios of {} lists the shifts that it finds; a fit needs \
         `gear` and `target_gear`, which differ during a shift",
        options.vehicle.shown()
    ))
    .into()
}

/// The result on held-out shifts, in words.
fn said_of(checked: &HeldOut) -> String {
    /// Scale of the valves' errors below which the speeds may add nothing to what the valves say, as simulated cars show.
    const GOOD_VALVES: f64 = 0.7;
    let [given, fitted] = checked.turbine_rad_s;
    let scale = checked.valve_error_scale;
    let [low, high] = checked.valve_error_interval();
    let mut text = format!(
        "{} shifts held out: turbine speed while both clutches slip, by the torques of the given file off by {given:.2} rad/s, of the fitted one \
         by {fitted:.2} rad/s; the fitted file is the better one in {}\n\
         with this file the torques of these shifts by the valves alone err by {scale:.2} (95 % {low:.2} to {high:.2}) of what its error bounds say of friction and valves; `estimate` \
         trusts the valves by as much (`error_bounds.valve_error_scale`)",
        checked.shifts, checked.better
    );
    if scale < GOOD_VALVES {
        text += ". With valves as good as these the speeds add little: in simulated cars the torques of `estimate` were 0.6 to 1.8 times as far off as \
                 those of the valve model alone, which stand beside them";
    }
    text
}
