//! The fit of a car with a whole gearbox.

use std::ops::ControlFlow;
use std::path::Path;

use car::Car;
use config::{CarFile, Source};
use fit::gearbox::{GivenFile, HeldOut, Recorded, Recorder, ShiftLog, adaptations};
use fit::{Channel, FitError, ReadingAges};
use observer::ShiftTables;
use report::sheet::Part;
use study::gearbox::logged::LoggedDrive;
use trace::ShownPath as _;

use super::{
    FitOptions, FitProgress, FitProgressTaker, Fitted, HELD_OUT_MIN, MIN_FOR_HELD_OUT, impossible, names,
    nothing_held_out, said_of_channel, say_reasons,
};
use crate::estimate::gearbox::check_ratios;
use crate::estimate::gearbox::checks::RowTimes;
use crate::estimate::gearbox::source::{CarReading, CarSource};
use crate::{Error, LogInput, Notes, VehicleFile, shell_quoted};

/// Every so many shifts one is held out; of few more often.
const HELD_OUT_EVERY: usize = 5;
/// More shifts are thinned evenly.
const SHIFTS_MAX: usize = 400;
/// Steps between two reports of progress.
const STEPS: u64 = 20_000;

pub(super) fn fit(
    file: &CarFile,
    logs: &[LogInput<'_>],
    options: &FitOptions,
    progress: FitProgressTaker<'_>,
    say: Notes<'_>,
) -> Result<(Fitted, Part), Error> {
    if file.gearbox.has_ratios_alone() {
        return Err(Error::Input(format!(
            "{}: the ratios alone are known of its gearbox, and a fit finds values of clutches and valves\n\
             hint: describe its elements (level = \"stick-diagram\", or \"shares\"); `wetclutch inspect LOG --shifts -o PAGE.html` fits the \
             converter without them",
            file.source.path.shown()
        )));
    }
    let sensors = options.sensors.as_ref();
    let tables = LoggedDrive::tables(file, sensors)?;
    let recorded = record((file, &tables), logs, options, progress, say)?;
    say_reasons("not used", &recorded.skipped, say);
    let Recorded { shifts, driving, skipped: not_used, .. } = recorded;
    let (fitted_shifts, held_out) = divided(&shifts);
    if fitted_shifts.is_empty() {
        return Err(no_shift(file, logs, &not_used));
    }
    let go_on = || if options.is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let found = fit::gearbox::fit(file, &tables, &fitted_shifts, &driving, &mut |at| {
        progress(FitProgress::Fitting { shifts: at.shifts, iteration: at.iteration + 1 });
        go_on()
    })?;
    let all = fit::gearbox::Fitted { car: file, tables: &tables, driving: &driving, fit: &found };
    let mut adapting = |at: fit::gearbox::Progress| {
        progress(FitProgress::Adapting { shifts: at.shifts, iteration: at.iteration + 1 });
        go_on()
    };
    let adapted = options.oil_step_k.map(|step_k| adaptations(all, &shifts, step_k, &mut adapting)).transpose()?;
    adapted.iter().flat_map(|adapted| &adapted.warnings).for_each(|warning| say(warning));
    progress(FitProgress::Validating);
    let output = options.output.as_deref().unwrap_or(&file.source.path);
    let given = GivenFile { path: &file.source.path, text: &file.source.text, gearbox: &file.gearbox_source.path };
    let read = |text: String| {
        let source = Source { path: output.to_owned(), text };
        CarFile::from_sources(source, file.gearbox_source.clone()).map_err(|error| impossible(&error))
    };
    let fitted_file =
        |checked: Option<&HeldOut>| read(found.vehicle_text(file, given, output, &names(logs), checked)?);
    let fitted = fitted_file(None)?;
    let checked = found.validate((file, &tables), (&fitted, &LoggedDrive::tables(&fitted, sensors)?), &held_out);
    let fitted = fitted_file(checked.as_ref())?;
    let kept = found.reason_against(checked.as_ref());
    let written = match &kept {
        None => fitted,
        Some(reason) => read(fit::gearbox::kept_text(given, output, reason)?)?,
    };
    let statements = [said_of_channel(Channel::Turbine, &found.one_step)].into_iter();
    let statements = statements.chain(found.statements());
    let fitted = Fitted {
        vehicle: VehicleFile::Gearbox(Box::new(written)),
        parameters: found.report(),
        channels: Vec::new(),
        map_changes: found.map_changes(),
        statements: statements.chain([checked.as_ref().map_or_else(nothing_held_out, said_of)]).collect(),
        shifts: found.shifts,
        not_used,
        kept,
        adaptations: adapted,
        page: None,
    };
    Ok((fitted, report::fit_page::gearbox_intervals(&found)))
}

/// The shifts of all logs.
fn record(
    (car, tables): (&CarFile, &ShiftTables<f64>),
    logs: &[LogInput<'_>],
    options: &FitOptions,
    progress: FitProgressTaker<'_>,
    say: Notes<'_>,
) -> Result<Recorded, Error> {
    let ages = options.sensors.as_ref().map(ReadingAges::of).unwrap_or_default();
    let mut all = Recorded::default();
    for log in logs {
        progress(FitProgress::Reading { log: log.path, time_s: None });
        let recorder = Recorder::new(car, tables, ages);
        let one = record_one(*log, (car, tables), recorder, options, progress, say)?;
        check_ratios(one.in_gear, None, Path::new(&car.source.path), log.path)?;
        all.add(one);
    }
    Ok(all)
}

fn record_one(
    log: LogInput<'_>,
    (car, tables): (&Car, &ShiftTables<f64>),
    mut recorder: Recorder<'_>,
    options: &FitOptions,
    progress: FitProgressTaker<'_>,
    say: Notes<'_>,
) -> Result<Recorded, Error> {
    let mut opened = None;
    let mut steps = CarSource::open(CarReading { car, tables, log, stop: None, threads: 1 }, &mut opened, say)?;
    let (mut count, mut times) = (0_u64, RowTimes::default());
    while let Some(step) = steps.next_step()? {
        times.push(&step);
        if options.is_interrupted() {
            return Err(Error::interrupted());
        }
        recorder.push_reported(step.reported_n_m);
        recorder.push_oil_temperature(step.oil_degc);
        recorder.push(step.time_s, &step.input);
        recorder.push_pressure(step.time_s, step.shift_pressures(tables));
        recorder.push_element_pressures(step.time_s, &step.pressures);
        count += 1;
        if count.is_multiple_of(STEPS) {
            progress(FitProgress::Reading { log: log.path, time_s: Some(step.time_s) });
        }
    }
    steps.check_times()?;
    times.check(log.path, !log.map.channels.is_empty())?;
    steps.finish(say)?;
    Ok(recorder.finish())
}

/// Shifts to fit, and shifts that are held out: every fifth, and at least [`HELD_OUT_MIN`]. Of more than a fit can use, some are left out evenly.
fn divided(shifts: &[ShiftLog]) -> (Vec<ShiftLog>, Vec<ShiftLog>) {
    let count = shifts.len();
    let every = HELD_OUT_EVERY.min(count / HELD_OUT_MIN);
    let is_held_out = |at: usize| count >= MIN_FOR_HELD_OUT && at % every == every - 1;
    let some = SHIFTS_MAX.min(count);
    let chosen = (0..some).map(|i| shifts[i * count / some.max(1)].clone()).enumerate();
    let (held_out, fitted): (Vec<_>, Vec<_>) = chosen.partition(|(at, _)| is_held_out(*at));
    let logs = |shifts: Vec<(usize, ShiftLog)>| shifts.into_iter().map(|(_, log)| log).collect();
    (logs(fitted), logs(held_out))
}

fn no_shift(car: &CarFile, logs: &[LogInput<'_>], not_used: &[String]) -> Error {
    if !not_used.is_empty() {
        let message = format!(
            "none of the {} shifts of the logs can be fitted\n\
             hint: the lines `not used` have the reasons; a fit needs shifts from one clutch or brake to another, with their commands",
            not_used.len()
        );
        return FitError::Input(message).into();
    }
    let log = logs.first().map(|log| shell_quoted(log.path)).unwrap_or_default();
    FitError::Input(format!(
        "the logs have no shift between two gears that can be fitted\n\
         hint: `wetclutch inspect {log} --shifts` with the same map and the ratios of {} lists the shifts that it finds; a fit needs \
         `gear` and `target_gear`, which differ during a shift",
        car.source.path.shown()
    ))
    .into()
}

/// The result on held-out shifts, in words.
fn said_of(checked: &HeldOut) -> String {
    /// Scale of the valves' errors below which the speeds may add nothing to what the valves say, as simulated cars show.
    const GOOD_VALVES: f64 = 0.7;
    let [given, fitted] = checked.turbine_rad_s;
    let few = if given.interval.is_none() { ", too few for intervals" } else { "" };
    let scale = checked.valve_error_scale;
    let [low, high] = checked.valve_error_interval();
    let mut text = format!(
        "{} shifts held out{few}: error of the turbine speed while both clutches slip {given:.2} rad/s with the given file, \
         {fitted:.2} rad/s with the fitted one, which is better in {}\n\
         with this file the torques of these shifts by the valve models have {scale:.2} (95 % {low:.2} to {high:.2}) of the error that its bounds of friction and valves allow; `estimate` \
         uses this factor (`error_bounds.valve_error_scale`)",
        checked.shifts, checked.better
    );
    if scale < GOOD_VALVES {
        text += ". With valves as good as these the speeds add little: over a drive cycle of simulated cars the torque error of `estimate` was 0.7 to 1.0 \
                 times that of the valve model alone, which is in the same table";
    }
    text
}
