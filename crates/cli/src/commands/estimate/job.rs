//! The estimate of one log.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::observer::Estimate;
use car::{ObserverKind, Vehicle};
use drivetrain::CommandKind;
use logs::{Log, Role, Shift};
use report::log_page::{LogPage, shift_rows};
use study::LogSample;
use study::shift_estimates::no_estimate;
use trace::ShownPath as _;

use super::findings::Findings;
use super::log_checks::{WITHOUT_SENSORS, check_span, old_commands, slow_log, warn_of_dbc};
use super::measured::{Measured, Step};
use super::observer::Chosen;
use super::outputs::{EstimateTable, beside, chosen, remove_old};
use super::shifts::{self, Shifts};
use super::{Messages, Setup, observer, say_end_of_followed};
use crate::commands::write_text;
use crate::failure::Failure;
use crate::output;

/// Estimates a log, and says what was found and where it is.
pub(super) fn estimate(
    setup: &Setup<'_>,
    path: &Path,
    output: Option<&Path>,
    say: &mut Messages,
) -> Result<(), Failure> {
    let Setup { options, vehicle, .. } = setup;
    let mut opened = None;
    let log = open(setup, path, &mut opened)?;
    let observer = observer::choose(options, vehicle, &log, say)?;
    let columns = chosen(observer.observer.columns(log.has_wheel_speed()), &options.columns)?;
    let rows = Rows {
        table: EstimateTable::create(output, columns)?,
        shifts: Shifts::new(options, vehicle, &log.ratios),
        findings: Findings::new(vehicle),
        written_s: f64::NEG_INFINITY,
        follow: options.follow,
    };
    let (log, mut rows) = pass(&observer, vehicle, log, rows)?;
    if output.is_none() {
        rows.table.flush()?;
    }
    log.finish(say)?;
    say_end_of_followed(options, &setup.stop, path, say);
    let Rows { table, shifts, findings, .. } = rows;
    let median_s = log.median_step_s();
    check_findings(path, &findings, vehicle, &log, observer.kind)?;
    let warnings = [slow_log(median_s), old_commands(median_s, vehicle.error_bounds.command_age_s)];
    warnings.into_iter().flatten().for_each(|warning| say.note(&warning));
    shifts.check()?;
    table.finish()?;
    let places = output.and_then(beside).filter(|_| !shifts.found.is_empty());
    if let Some([csv, json, _]) = &places {
        shifts::write(&shifts.found, csv, json)?;
    }
    let shifts = shifts.earlier_by(findings.origin_s());
    let sentences = findings.sentences();
    sentences.iter().for_each(|sentence| say.note(sentence));
    report_shifts(&shifts, output.is_some(), say)?;
    if options.sensors.is_none() {
        say.note(WITHOUT_SENSORS);
    }
    say.note(&format!("observer: {}", observer.name));
    if !vehicle.defaults_taken.is_empty() {
        say.note(
            "gear train: one with the two ratios of the short vehicle file, not that of the car. The clutch torque is that of its clutch; in the car's \
             train the torque of a clutch in another place differs by a constant factor",
        );
    }
    let Some(output) = output else {
        say.note("estimate: on standard output");
        return Ok(());
    };
    say.note(&format!("estimate: {}", output.shown()));
    let page = LogPage {
        log: path,
        vehicle,
        observer: &observer.name,
        overview: &shifts.overview,
        shifts: &shifts.found,
        shifts_of_log: shifts.seen(),
        findings: &sentences,
    };
    match places {
        Some(places) => write_page(&page, &places, say),
        None => beside(output).map_or(Ok(()), |old| remove_old(&old, |note| say.note(note))),
    }
}

/// Opens a log: a table with the names of the program, or channels by the map. `opened` keeps the latter.
fn open<'a>(setup: &Setup<'_>, path: &Path, opened: &'a mut Option<Log>) -> Result<Measured<'a>, Failure> {
    let Setup { options, vehicle, map, .. } = setup;
    let stop = options.follow.then(|| Arc::clone(&setup.stop));
    if map.channels.is_empty() {
        warn_of_dbc(map);
        return Measured::rows(path, vehicle, stop);
    }
    let is_followed = stop.is_some();
    let log = match stop {
        Some(stop) => Log::follow(path, &map.open, stop)?,
        None => Log::open(path, &map.open)?.on_threads(options.threads_of_log()),
    };
    Measured::channels(path, opened.insert(log), map, vehicle, is_followed)
}

/// Passes all steps of a log through the observer to the rows. The observer gets the steps in the gears of its shift; the others
/// go by it.
fn pass<'log, 'rows>(
    observer: &Chosen,
    vehicle: &Vehicle,
    log: Measured<'log>,
    rows: Rows<'rows>,
) -> Result<(Measured<'log>, Rows<'rows>), Failure> {
    let (log, rows) = (RefCell::new(log), RefCell::new(rows));
    let in_gears = std::iter::from_fn(|| {
        let mut log = log.borrow_mut();
        loop {
            match log.advance() {
                Ok(false) => return None,
                Ok(true) if log.step.is_other_gear => {
                    if let Err(failure) = rows.borrow_mut().take(&mut log.step, None) {
                        return Some(Err(failure));
                    }
                }
                Ok(true) => return Some(Ok((log.step.input, ()))),
                Err(failure) => return Some(Err(failure)),
            }
        }
    });
    observer.observer.run_over(Some(vehicle), in_gears, |(), estimate| {
        let mut log = log.borrow_mut();
        log.take_back(&estimate.channels);
        rows.borrow_mut().take(&mut log.step, Some(&estimate))
    })?;
    let (mut log, mut rows) = (log.into_inner(), rows.into_inner());
    for shift in log.last_shifts() {
        rows.shift(shift)?;
    }
    Ok((log, rows))
}

/// Refuses a log that the observer cannot use, or that is of another car.
fn check_findings(
    path: &Path,
    findings: &Findings,
    vehicle: &Vehicle,
    log: &Measured<'_>,
    observer: ObserverKind,
) -> Result<(), Failure> {
    check_span(path, log.median_step_s(), findings.span_s())?;
    let commands = match vehicle.settings.valve.command_kind() {
        CommandKind::Current => [Role::OncomingCurrent, Role::OffgoingCurrent],
        CommandKind::DutyCycle => [Role::OncomingDuty, Role::OffgoingDuty],
    };
    findings.check(commands, log, observer)
}

/// Writes the page, beside the table of shifts.
fn write_page(page: &LogPage<'_>, [csv, json, html]: &[PathBuf; 3], say: &mut Messages) -> Result<(), Failure> {
    write_text(html, &page.html()?)?;
    say.note(&format!("table of shifts: {}, {}", csv.shown(), json.shown()));
    say.note(&format!("report: {}", html.shown()));
    Ok(())
}

/// What becomes of the steps of a log.
struct Rows<'a> {
    table: EstimateTable,
    shifts: Shifts<'a>,
    findings: Findings,
    /// Of shifts that lie close together, a row is written once: the last one that was, s.
    written_s: f64,
    follow: bool,
}

impl Rows<'_> {
    /// Takes a step with its estimate; none in a gear that the vehicle file does not describe.
    fn take(&mut self, step: &mut Step, estimate: Option<&Estimate<f64>>) -> Result<(), Failure> {
        match estimate {
            Some(estimate) => self.findings.push(step, estimate),
            None => self.findings.push_other_gear(step.time_s),
        }
        let Step { time_s, input, pressure_pa, torque_n_m, .. } = *step;
        let sample = LogSample::new(time_s, &input, estimate.copied().unwrap_or_else(no_estimate));
        self.shifts.push(LogSample { pressure_pa, torque_n_m, ..sample });
        for shift in std::mem::take(&mut step.shifts) {
            self.shift(shift)?;
        }
        if !self.shifts.is_selective() {
            match estimate {
                Some(estimate) => self.table.row(time_s, estimate)?,
                None => self.table.empty_row(time_s)?,
            }
            if self.follow {
                self.table.flush()?;
            }
        }
        Ok(())
    }

    /// Takes a shift that is known now.
    fn shift(&mut self, shift: Shift) -> Result<(), Failure> {
        let Self { table, written_s, follow, .. } = self;
        let is_selective = self.shifts.is_selective();
        self.shifts.take(shift, |samples| {
            for sample in samples.iter().filter(|_| is_selective) {
                if sample.time_s > *written_s {
                    *written_s = sample.time_s;
                    if sample.is_estimated() {
                        table.row(sample.time_s, &sample.estimate)?;
                    } else {
                        table.empty_row(sample.time_s)?;
                    }
                }
            }
            if *follow { table.flush() } else { Ok(()) }
        })
    }
}

/// The shifts as a table, if there are any; `has_file` says whether standard output is free for it.
fn report_shifts(shifts: &Shifts<'_>, has_file: bool, say: &mut Messages) -> Result<(), Failure> {
    if shifts.found.is_empty() {
        return Ok(());
    }
    /// Rows that a terminal shows.
    const SHOWN: usize = 40;
    let (titles, rows) = shift_rows(&shifts.found, SHOWN);
    let more = shifts.found.len() - rows.len();
    let mut lines = output::titled_lines(3, &titles, &rows);
    lines.extend((more > 0).then(|| format!("and {more} more shifts")));
    say.table(&lines, has_file)?;
    let others = || shifts.found.iter().filter(|shift| !shift.of_vehicle);
    if let Some(first) = others().next() {
        say.note(&format!(
            "{} shifts are not the one of the vehicle file, as {}-{}: of these no pressure is estimated",
            others().count(),
            first.shift.from,
            first.shift.to
        ));
    }
    match shifts.found.iter().filter(|shift| shift.of_vehicle && shift.estimated.is_none()).count() {
        0 => {}
        unseen => say.note(&format!(
            "warning: {unseen} shifts of the vehicle file are in the speeds and not in the estimate: the command of the valve stays below \
             the kiss point, or a speed is refused throughout the shift\nhint: check unit and scale of the command, and whether it is that of the \
             oncoming clutch"
        )),
    }
    Ok(())
}
