//! The fit of a car of one shift.

use std::ops::ControlFlow;

use car::Vehicle;
use config::{Source, VehicleFile as OneShiftFile};
use fit::{Collected, FitError, Given, HeldOut, LogSource, ReadingAges, SHIFTS_MAX, ShiftRecord};
use logs::{Log, LogError};
use report::sheet::Part;
use trace::ShownPath as _;

use super::{
    FitOptions, FitProgress, FitProgressTaker, Fitted, HELD_OUT_MIN, MIN_FOR_HELD_OUT, impossible, names,
    nothing_held_out, said_of_channel, say_reasons,
};
use crate::{Error, LogInput, Notes, VehicleFile, shell_quoted};

pub(super) fn fit(
    file: &OneShiftFile,
    logs: &[LogInput<'_>],
    options: &FitOptions,
    progress: FitProgressTaker<'_>,
    say: Notes<'_>,
) -> Result<(Fitted, Part), Error> {
    let ages = options.sensors.as_ref().map(ReadingAges::of).unwrap_or_default();
    let given = given(file)?;
    let collected = collect(&given, logs, options, progress)?;
    collected.notes.iter().for_each(|note| say(&format!("warning: {note}")));
    say_reasons("not used", &collected.skipped, say);
    let kinds = collected.kinds.statement();
    let (fitted_shifts, held_out) = divided(collected.shifts);
    if fitted_shifts.is_empty() {
        return Err(no_shift(file, logs, &kinds));
    }
    let found = fit::fit(&given, &fitted_shifts, &collected.driving, ages, &mut |at| {
        progress(FitProgress::Fitting { shifts: at.shifts, iteration: at.iteration + 1 });
        if options.is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    progress(FitProgress::Validating);
    say_reasons("not fitted", &found.unusable, say);
    let read = |text: String| {
        OneShiftFile::from_source(Source { text, ..file.source.clone() }).map_err(|error| impossible(&error))
    };
    let fitted = read(found.vehicle_text(&given, &names(logs))?)?;
    let checked = found.validate(&given, &self::given(&fitted)?, &held_out, ages)?;
    let kept = found.reason_against(checked.as_ref());
    let written = match &kept {
        None => fitted,
        Some(reason) => read(fit::kept_text(&given.text, reason))?,
    };
    let fitted = Fitted {
        vehicle: VehicleFile::OneShift(Box::new(written)),
        parameters: found.report(),
        map_changes: found.map_changes(),
        channels: found.channels.iter().map(|(channel, errors)| said_of_channel(*channel, errors)).collect(),
        statements: [found.statements(), vec![kinds, said_of(checked.as_ref())]].concat(),
        shifts: found.shifts,
        not_used: [collected.skipped, found.unusable.clone()].concat(),
        kept,
        adaptations: None,
        page: None,
    };
    Ok((fitted, report::fit_page::intervals(&found)))
}

/// The vehicle of a file as a fit takes it.
fn given(file: &OneShiftFile) -> Result<Given, Error> {
    Ok(Given { vehicle: file.vehicle.clone(), shafts: file.shafts()?, text: file.source.text.clone() })
}

/// The shifts of all logs.
fn collect(
    given: &Given,
    logs: &[LogInput<'_>],
    options: &FitOptions,
    progress: FitProgressTaker<'_>,
) -> Result<Collected, FitError> {
    let is_stopped = || options.is_interrupted();
    let mut all = Collected::default();
    for log in logs {
        progress(FitProgress::Reading { log: log.path, time_s: None });
        let open = || opened(*log);
        let source = LogSource { path: log.path, map: log.map, open: &open, is_stopped: &is_stopped };
        let mut one = fit::collect(source, given)?;
        one.notes.iter_mut().for_each(|note| *note = format!("{}: {note}", log.path.shown()));
        all.add(one);
    }
    Ok(all)
}

fn opened(log: LogInput<'_>) -> Result<Log, LogError> {
    let text = log.text().map_err(|source| LogError::Io { path: log.path.to_owned(), source })?;
    match text {
        Some(text) => Log::of_text(log.path, &log.map.open, text),
        None => Log::open(log.path, &log.map.open),
    }
}

/// Shifts to fit, and shifts that are held out: the last fifth. Of more than a fit can use, some are left out evenly.
fn divided(mut shifts: Vec<ShiftRecord>) -> (Vec<ShiftRecord>, Vec<ShiftRecord>) {
    let count = shifts.len();
    let held_out =
        if count < MIN_FOR_HELD_OUT { Vec::new() } else { shifts.split_off(count - HELD_OUT_MIN.max(count / 5)) };
    let some = SHIFTS_MAX.min(shifts.len());
    ((0..some).map(|i| shifts[i * shifts.len() / some].clone()).collect(), held_out)
}

fn no_shift(vehicle: &Vehicle, logs: &[LogInput<'_>], kinds: &str) -> Error {
    let [from, to] = [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()];
    FitError::Input(format!(
        "the logs have no power-on upshift from ratio {from:.3} to {to:.3} that can be fitted; {kinds}\n\
         hint: `wetclutch inspect {} --shifts --ratios {from:.3},{to:.3}` with the same map lists the shifts that it finds",
        logs.first().map(|log| shell_quoted(log.path)).unwrap_or_default()
    ))
    .into()
}

/// The result on held-out shifts, in words.
fn said_of(checked: Option<&HeldOut>) -> String {
    let Some(checked) = checked else { return nothing_held_out() };
    let [given, fitted] = checked.turbine_rad_s;
    let few = if given.interval.is_none() { ", too few for intervals" } else { "" };
    let mut text = format!(
        "{} shifts held out{few}: one-step error of the turbine speed {given:.3} rad/s with the given file, {fitted:.3} rad/s with the fitted one",
        checked.shifts
    );
    if let Some([given, fitted]) = checked.pressure_pa.map(|errors| errors.map(|error| error.map(|pa| 1e-3 * pa))) {
        text += &format!("; pressure of the valve maps against the measured one {given:.2} kPa, {fitted:.2} kPa");
        if fitted.value > given.value {
            text += " (worse with the fitted file: check scale, unit and place of the pressure sensor)";
        }
    }
    text
}
