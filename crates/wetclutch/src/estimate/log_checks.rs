//! What is said of a log as a whole: its format, its times, its channels.

use std::path::Path;

use logs::plausibility::{likely_time_unit, too_fast_a_time};
use logs::{ChannelMap, Log, Quality, Readings, Role};
use trace::{ShownPath as _, TraceError, signal};

use crate::{Error, Notes, grouped};

/// A table with another delimiter than the comma is one of a single column; a channel map reads it.
pub(crate) fn other_delimiter(path: &Path, error: TraceError) -> Error {
    let delimiter = match &error {
        TraceError::MissingColumn { present, .. } => match present.as_slice() {
            [only] => [';', '\t', '|'].into_iter().find(|delimiter| only.contains(*delimiter)),
            _ => None,
        },
        _ => None,
    };
    let Some(delimiter) = delimiter else { return error.into() };
    let given = path.shown();
    Error::Input(format!(
        "{}: the columns are separated by `{}`, which is read by a channel map only\n\
         hint: `wetclutch inspect {given} --suggest > map.toml` writes one; check it, then add --map map.toml",
        path.shown(),
        delimiter.escape_debug()
    ))
}

/// Refuses a log of frames of a CAN bus that no DBC is given for.
pub(crate) fn check_dbc(path: &Path, log: &Log) -> Result<(), Error> {
    if log.lacks_dbc() {
        return Err(Error::Input(format!(
            "{}: there are frames of a CAN bus, whose signals are not read\n\
             hint: a DBC defines the signals in them: give it with --dbc, and a channel map with --map",
            path.shown()
        )));
    }
    Ok(())
}

/// Refuses a log with so much time between its rows that it has no shifts: the time is in another unit by all appearances.
pub(crate) fn check_step(path: &Path, median_s: f64, is_mapped: bool) -> Result<(), Error> {
    const LONGEST_S: f64 = 1.0;
    if median_s < LONGEST_S || median_s.is_nan() {
        return Ok(());
    }
    let unit = likely_time_unit(median_s).unwrap_or("ms");
    let hint = match (is_mapped, unit) {
        (true, unit) => format!("set `unit = \"{unit}\"` under [time] in the channel map"),
        (false, "ms") => format!("call its column `time_ms` in place of `{}`", signal::TIME),
        (false, _) => format!("convert it to s, or let a channel map read it, with `unit = \"{unit}\"` under [time]"),
    };
    Err(Error::Input(format!(
        "{}: the middle time between two rows is {median_s} s, longer than a phase of a shift\n\
         hint: if the time is in {unit}, {hint}",
        path.shown()
    )))
}

/// Refuses a log whose time passes too fast, once its last row is known.
pub(crate) fn check_span(path: &Path, median_s: f64, span_s: f64) -> Result<(), Error> {
    let wrong = too_fast_a_time(median_s, span_s);
    wrong.map_or(Ok(()), |wrong| Err(Error::Input(format!("{}: {wrong}", path.shown()))))
}

/// Says that commands, by their names, are sent on change.
pub(crate) fn sent_on_change(names: &str) -> String {
    format!(
        "the commands of {names} are sent on change, as their samples show: each is valid until the next one (`sent_on_change = true` in a channel map)"
    )
}

/// Says that a log has too few rows for its shifts.
pub(crate) fn slow_log(median_s: f64) -> Option<String> {
    /// Five rows in an inertia phase of half a second \[chosen\].
    const LONGEST_S: f64 = 0.1;
    (median_s > LONGEST_S * (1.0 + ROUNDING)).then(|| {
        format!(
            "warning: the middle time between two rows is {median_s:.3} s, too long for the estimate of a shift: an inertia phase takes 0.3 to 1 s, \
             and {} s without a reading count as a lost channel\nhint: record speeds and commands every {LONGEST_S} s or more often",
            car::LOST_S
        )
    })
}

/// What the ranges assume of the sensors where no file describes them.
pub const WITHOUT_SENSORS: &str = "ranges: no sensor file was given (--sensors). Each speed counts as measured at the time of its row, and each command as correct \
     within the error bounds of the vehicle file. The ranges are guaranteed only if this is true; with a [sensors] table they contain the errors of the sensors";

/// Warns of a DBC that is given for a table with the names of the program.
pub(crate) fn warn_of_dbc(map: &ChannelMap, say: Notes<'_>) {
    if map.open.dbc.is_some() {
        say(&format!("warning: {}", logs::log::NO_FRAMES));
    }
}

/// Says that commands may be older than the bounds of the vehicle file allow: a row shows a command that was sent since the row before.
pub(crate) fn old_commands(median_s: f64, bound_s: f64) -> Option<String> {
    (median_s > bound_s * (1.0 + ROUNDING)).then(|| {
        format!(
            "warning: the middle time between two rows is {median_s:.3} s, and by `command_age_s` of the vehicle file a command is at most {bound_s} s \
             older than the row that shows it first. The guaranteed range does not hold for commands that change at any time between two rows\n\
             hint: set `command_age_s = {median_s:.3}` under [design.error_bounds], or record the commands more often"
        )
    })
}

/// Fraction by which times of rows are rounded.
const ROUNDING: f64 = 1e-3;

/// Says what was met in mapped channels, after their last step; those of some roles may be empty.
///
/// # Errors
/// Most samples of a channel could not be used, or a unit is wrong by all appearances.
pub(crate) fn report_readings(readings: &Readings<'_>, may_be_empty: &[Role], say: Notes<'_>) -> Result<(), Error> {
    for role in readings.summary() {
        let (good, total) = (role.counts.of(Quality::Good), role.counts.total());
        if total == 0 && may_be_empty.contains(&role.role) {
            say(&format!("warning: the channel of {} has no samples", role.name));
        }
        if good < total {
            say(&format!(
                "{} of {} samples of {} are not used: {}",
                grouped(total - good),
                grouped(total),
                role.name,
                role.counts.faults()
            ));
        }
    }
    for note in readings.notes() {
        say(&format!("warning: {note}"));
    }
    Ok(readings.check_without(may_be_empty)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_further_apart_than_commands_may_be_old_are_told() {
        assert_eq!(
            [0.01, 0.05, 0.050_000_001, f64::NAN].map(|median_s| old_commands(median_s, 0.05)),
            [const { None }; 4]
        );
        let told = old_commands(0.06, 0.05).unwrap_or_default();
        assert!(told.contains("at most 0.05 s") && told.contains("`command_age_s = 0.060`"), "{told}");
        assert_eq!(slow_log(0.1 + 1e-9), None);
        assert!(slow_log(0.11).is_some());
    }
}
