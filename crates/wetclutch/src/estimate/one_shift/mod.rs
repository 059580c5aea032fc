//! Estimates of the shift of a vehicle file of one shift, by any of the observers.

mod findings;
mod measured;
pub mod observer;
pub(crate) mod ratios;
mod shifts;
mod table;

use std::cell::RefCell;
use std::path::Path;

use ::observer::Estimate;
use car::{ObserverKind, Vehicle};
use drivetrain::CommandKind;
use logs::{Log, Role, Shift};
use report::log_page::LogPage;
use study::shift_estimates::{self, no_estimate};
use study::{LogSample, Overview, ShiftEstimate};
use trace::{Cell, signal};

use self::findings::Findings;
use self::measured::{Measured, Step};
use self::observer::Chosen;
use self::shifts::Shifts;
use self::table::{EstimateTable, chosen};
use super::input::{EstimateOptions, LogInput, say_end_of_followed};
use super::log_checks::{check_span, old_commands, slow_log, warn_of_dbc};
use super::output::Destination;
use super::stages::{WriteBehind, with_stages};
use crate::{Error, Notes, Table};

/// What is common to all logs of a car.
pub struct Setup<'a> {
    vehicle: config::VehicleFile,
    options: &'a EstimateOptions,
}

impl<'a> Setup<'a> {
    /// Prepares estimates with a vehicle file.
    ///
    /// # Errors
    /// Options have no effect with each other, or with such a file.
    pub fn new(file: &config::VehicleFile, options: &'a EstimateOptions) -> Result<Self, Error> {
        observer::check_options(options)?;
        let mut vehicle = file.clone();
        if let Some(sensors) = &options.sensors {
            let kind = vehicle.oncoming.valve.command_kind();
            vehicle.vehicle.error_bounds = vehicle.error_bounds.read_by(kind, sensors);
        }
        Ok(Self { vehicle, options })
    }
}

/// Estimates of the shifts of a log.
#[derive(Debug, Clone)]
pub struct ShiftEstimates {
    /// The rows, if they were to stay in memory.
    pub rows: Option<Table>,
    /// The shifts that were wanted.
    pub shifts: Vec<ShiftEstimate>,
    /// The drive as a whole.
    pub overview: Overview,
    /// How many shifts the log has.
    pub shifts_of_log: usize,
    /// What was found, in sentences.
    pub findings: Vec<String>,
    /// The observer, and how its gains were found.
    pub observer: String,
    /// Where the times of shifts and overview are to be counted from, s of the log's clock.
    pub origin_s: f64,
}

impl ShiftEstimates {
    /// The same with the times of overview and shifts counted from the log's first row, where the log has a clock since 1970.
    #[must_use]
    pub fn with_times_from_origin(self) -> Self {
        let shifts = self.shifts.into_iter().map(|shift| shift.earlier_by(self.origin_s)).collect();
        Self { shifts, overview: self.overview.earlier_by(self.origin_s), ..self }
    }

    /// The shifts as named cells in SI units.
    pub fn shift_cells(&self) -> Vec<Vec<(String, Cell<'_>)>> {
        self.shifts.iter().map(shift_cells).collect()
    }

    /// The page of the log, as HTML; `None` without a shift.
    ///
    /// # Errors
    /// The page cannot be made.
    pub fn page(&self, vehicle: &config::VehicleFile, log: &Path) -> Result<Option<String>, Error> {
        if self.shifts.is_empty() {
            return Ok(None);
        }
        let Self { overview, shifts, shifts_of_log, findings, observer, .. } = self;
        let page = LogPage { log, vehicle, observer, overview, shifts, shifts_of_log: *shifts_of_log, findings };
        Ok(Some(page.html()?))
    }
}

fn shift_cells(shift: &ShiftEstimate) -> Vec<(String, Cell<'_>)> {
    let time = std::iter::once((signal::TIME.to_owned(), Cell::Number(shift.begin_s())));
    time.chain(shift_estimates::COLUMNS.iter().map(|(name, cell)| ((*name).to_owned(), cell(shift)))).collect()
}

/// Estimates a log. Nothing is written where it fails.
///
/// # Errors
/// The log cannot be read, is not of this car, has not what the observer needs, or the rows cannot be written.
pub fn estimate(
    setup: &Setup<'_>,
    input: LogInput<'_>,
    destination: Destination<'_>,
    say: Notes<'_>,
) -> Result<ShiftEstimates, Error> {
    let Setup { options, vehicle } = setup;
    let mut opened = None;
    let log = open((setup, input), &mut opened, say)?;
    let observer = observer::choose(options, vehicle, &log, say)?;
    let columns = observer.observer.columns(log.has_wheel_speed());
    let names = (&options.columns[..], destination.is_live());
    let columns = chosen(columns, vehicle.settings.valve.command_kind(), names)?;
    let rows = Rows {
        table: EstimateTable::create(destination, columns)?,
        shifts: Shifts::new(&options.shifts, vehicle, &log.ratios),
        findings: Findings::new(vehicle),
        written_s: f64::NEG_INFINITY,
        is_followed: options.is_followed(),
    };
    let threads = options.threads_of(&input);
    let (log, mut rows) = pass((&observer, options), (vehicle, threads), log, rows)?;
    if matches!(destination, Destination::Standard) {
        rows.table.flush()?;
    }
    log.finish(say)?;
    say_end_of_followed(options, input.path, say);
    let Rows { table, shifts, findings, .. } = rows;
    let median_s = log.median_step_s();
    check_findings(input.path, &findings, vehicle, &log, observer.kind)?;
    let warnings = [slow_log(median_s), old_commands(median_s, vehicle.error_bounds.command_age_s)];
    let warnings = warnings.into_iter().flatten().chain(findings.warnings_of_commands());
    warnings.for_each(|warning| say(&warning));
    shifts.check()?;
    let rows = table.finish()?;
    let shifts_of_log = shifts.seen();
    let Shifts { found, overview, .. } = shifts;
    Ok(ShiftEstimates {
        rows,
        shifts: found,
        overview,
        shifts_of_log,
        findings: findings.sentences(),
        observer: observer.name,
        origin_s: findings.origin_s(),
    })
}

/// Opens a log: a table with the names of the program, or channels by the map. `opened` keeps the latter.
fn open<'a>(
    (setup, log): (&Setup<'_>, LogInput<'_>),
    opened: &'a mut Option<Log>,
    say: Notes<'_>,
) -> Result<Measured<'a>, Error> {
    let Setup { options, vehicle, .. } = setup;
    let LogInput { path, map, .. } = log;
    let stop = options.follow.as_ref();
    if map.channels.is_empty() {
        warn_of_dbc(map, say);
        return Measured::rows(log, vehicle, stop);
    }
    let channels = log.open(stop, options.threads)?;
    Measured::channels(path, opened.insert(channels), map, vehicle, stop.is_some())
}

/// Passes all steps of a log through the observer to the rows. The observer gets the steps in the gears of its shift; the others
/// go by it.
fn pass<'log, 'rows>(
    (observer, options): (&Chosen, &EstimateOptions),
    (vehicle, threads): (&Vehicle, usize),
    log: Measured<'log>,
    mut rows: Rows<'rows>,
) -> Result<(Measured<'log>, Rows<'rows>), Error> {
    let log = RefCell::new(log);
    with_stages(threads, |stages| {
        let write = |(step, estimate): &mut (Step, Option<Estimate<f64>>)| rows.take(step, estimate.as_ref());
        let passed = RefCell::new(WriteBehind::new(stages, write));
        let in_gears = std::iter::from_fn(|| {
            let mut log = log.borrow_mut();
            loop {
                if let Err(interrupted) = options.row_done() {
                    return Some(Err(interrupted));
                }
                match log.advance() {
                    Ok(false) => return None,
                    Ok(true) if log.step.is_other_gear => {
                        if let Err(failure) = passed.borrow_mut().push((log.take_step(), None)) {
                            return Some(Err(failure));
                        }
                    }
                    Ok(true) => return Some(Ok((log.step.input, ()))),
                    Err(failure) => return Some(Err(failure)),
                }
            }
        });
        let all = observer.observer.run_over(Some(vehicle), in_gears, |(), estimate| {
            let mut log = log.borrow_mut();
            log.take_back(&estimate.channels);
            passed.borrow_mut().push((log.take_step(), Some(estimate)))
        });
        passed.into_inner().finish()?;
        all
    })?;
    let mut log = log.into_inner();
    for shift in log.last_shifts() {
        rows.shift(shift)?;
    }
    if let Some(shift) = rows.shifts.of_observer_alone() {
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
) -> Result<(), Error> {
    check_span(path, log.median_step_s(), findings.span_s())?;
    let commands = match vehicle.settings.valve.command_kind() {
        CommandKind::Current => [Role::OncomingCurrent, Role::OffgoingCurrent],
        CommandKind::DutyCycle => [Role::OncomingDuty, Role::OffgoingDuty],
    };
    findings.check(commands, log, observer)
}

/// What becomes of the steps of a log.
struct Rows<'a> {
    table: EstimateTable<'a>,
    shifts: Shifts<'a>,
    findings: Findings,
    /// Of shifts that lie close together, a row is written once: the last one that was, s.
    written_s: f64,
    is_followed: bool,
}

impl Rows<'_> {
    /// Takes a step with its estimate; none in a gear that the vehicle file does not describe.
    fn take(&mut self, step: &mut Step, estimate: Option<&Estimate<f64>>) -> Result<(), Error> {
        match estimate {
            Some(estimate) => self.findings.push(step, estimate),
            None => self.findings.push_other_gear(step.time_s),
        }
        let Step { time_s, input, pressure_pa, torque_n_m, .. } = *step;
        let sample = LogSample::new(time_s, &input, estimate.copied().unwrap_or_else(no_estimate));
        let sample = LogSample { pressure_pa, torque_n_m, ..sample };
        self.shifts.push(sample);
        for shift in std::mem::take(&mut step.shifts) {
            self.shift(shift)?;
        }
        if !self.shifts.is_selective() {
            self.table.row(&sample)?;
            if self.is_followed {
                self.table.flush()?;
            }
        }
        Ok(())
    }

    /// Takes a shift that is known now.
    fn shift(&mut self, shift: Shift) -> Result<(), Error> {
        let Self { table, written_s, is_followed, .. } = self;
        let is_selective = self.shifts.is_selective();
        self.shifts.take(shift, |samples| {
            for sample in samples.iter().filter(|_| is_selective) {
                if sample.time_s > *written_s {
                    *written_s = sample.time_s;
                    table.row(sample)?;
                }
            }
            if *is_followed { table.flush() } else { Ok(()) }
        })
    }
}
