//! Estimates of a drive of a car with a gearbox, by the gearbox filter.

pub(crate) mod checks;
pub(crate) mod columns;
mod learnt;
mod passing;
pub mod source;

use std::path::Path;

use car::columns::element_commands;
use car::{Car, ErrorBudget};
use config::CarFile;
use evaluate::LogStep;
use evaluate::checks::RefusedCommand;
use evaluate::drive::ScoredDrive;
use evaluate::logged::{Filtered, LoggedDrive};
use evaluate::logged_shifts::LoggedShifts;
use observer::ShiftTables;
use report::drive_page::{DrivePage, MAX_DRAWN, findings, shift_words};
use study::gearbox::gear_numbers::GearNumbers;
use trace::signal::ACCELERATION_READING;
use trace::{Cell, ShownPath as _};

use self::checks::{HeardCommands, RowTimes, refused};
use self::columns::{Columns, Knows, Row, Same, before_readings};
pub use self::columns::{is_car_column, is_measured_column};
pub use self::learnt::LearntOfDrive;
use self::passing::Passing;
use self::source::{CarReading, CarSource};
use super::input::{EstimateOptions, LogInput, said_of_origin, say_end_of_followed, shown_from_s};
use super::log_checks::{WITHOUT_SENSORS, slow_log};
use super::one_shift::ratios::check_wheel;
use super::output::Destination;
use super::output::Output;
use super::selection::Selection;
use super::stages::{ReadAhead, WriteBehind, with_stages};
use crate::{Error, Notes, Table, grouped};

/// What is common to all logs of a car.
pub struct Setup<'a> {
    file: &'a CarFile,
    options: &'a EstimateOptions,
    tables: ShiftTables<f64>,
}

impl<'a> Setup<'a> {
    /// Prepares the filter of a car.
    ///
    /// # Errors
    /// An option has no effect with such a car, or its gearbox has more clutches than the filter has room for.
    pub fn new(file: &'a CarFile, options: &'a EstimateOptions) -> Result<Self, Error> {
        if options.observer.is_some() || options.method.is_some() {
            let option = if options.method.is_some() { "method" } else { "observer" };
            return Err(Error::Input(format!(
                "--{option} has no effect with the vehicle file of a car with a gearbox\n\
                 hint: leave it out; the gearbox filter also writes the estimate of the valve model alone"
            )));
        }
        let tables = LoggedDrive::tables(file, options.sensors.as_ref())?;
        Ok(Self { file, options, tables })
    }
}

/// Estimates of a drive.
#[derive(Debug, Clone)]
pub struct DriveEstimates {
    /// The rows, if they were to stay in memory.
    pub rows: Option<Table>,
    /// The drive with the shifts that were wanted.
    pub drive: ScoredDrive,
    /// Where the times of the drive count from, s of the log's clock.
    pub origin_s: f64,
    /// What was learnt of the car.
    pub learnt: LearntOfDrive,
    without_sensors: bool,
}

impl DriveEstimates {
    /// The same with the times of drive and shifts counted from the log's first row, where the log has a clock since 1970.
    #[must_use]
    pub fn with_times_from_origin(self) -> Self {
        let mut drive = self.drive.earlier_by(self.origin_s);
        drive.warnings.splice(0..0, said_of_origin(self.origin_s));
        Self { drive, ..self }
    }

    /// What was found in the drive.
    pub fn sentences(&self) -> Vec<String> {
        let mut said = findings(&self.drive);
        said.extend(self.said_of_sensors().map(str::to_owned));
        said
    }

    /// What the ranges assume of the sensors where none were described.
    pub fn said_of_sensors(&self) -> Option<&'static str> {
        self.without_sensors.then_some(WITHOUT_SENSORS)
    }

    /// What words of the table of shifts mean, with their meaning.
    pub fn words(&self, car: &Car) -> Vec<(String, String)> {
        shift_words(&self.drive, car)
            .into_iter()
            .map(|(word, meaning)| (word.to_string(), meaning.to_string()))
            .collect()
    }

    /// The page of the drive, as HTML; `None` without a shift.
    ///
    /// # Errors
    /// The page cannot be made.
    pub fn page(&self, file: &CarFile, log: &Path) -> Result<Option<String>, Error> {
        if self.drive.shifts.is_empty() {
            return Ok(None);
        }
        let name = log.file_name().unwrap_or(log.as_os_str()).to_string_lossy();
        Ok(Some(DrivePage { name: &name, car: file, draw: None, drive: &self.drive, sources: &[&file.source] }.html()?))
    }
}

/// Estimates a log. Nothing is written where it fails.
///
/// # Errors
/// The log cannot be read, is not of this car, or the rows cannot be written.
pub fn estimate(
    setup: &Setup<'_>,
    log: LogInput<'_>,
    destination: Destination<'_>,
    say: Notes<'_>,
) -> Result<DriveEstimates, Error> {
    let Setup { file, options, tables } = setup;
    let (car, path) = (&file.car, log.path);
    let mut opened = None;
    let reading = CarReading { car, tables, log, stop: options.follow.as_ref(), threads: options.threads };
    let mut source = CarSource::open(reading, &mut opened, say)?;
    let drive =
        LoggedDrive::new(car, tables, options.sensors.as_ref(), options.learnt.as_ref()).with_delays(source.delays_s());
    let LoggedDrive { mut filter, mut shifts } = if options.with_page { drive } else { drive.without_states() };
    // Places of the elements in the filter's tables, by name.
    let elements = car.gearbox.elements.iter().enumerate();
    let places: Vec<(usize, &str)> =
        elements.filter_map(|(at, element)| Some((tables.place(at)?, element.name.as_str()))).collect();
    let numbers = GearNumbers::of(car);
    let is_named = options.columns.iter().any(|name| name.trim() == ACCELERATION_READING);
    let knows = Knows::of(car, is_named || source.has_acceleration());
    let commands = element_commands(car);
    let mut columns = Columns::of(&places, knows);
    if destination.is_live() || !options.columns.is_empty() {
        columns.push_measured(&commands, tables);
    }
    if !options.columns.is_empty() {
        columns.choose(&options.columns)?;
    }
    let (columns, mut row_numbers) = columns.split();
    let (before_readings, mut said, mut named_before) = (before_readings(&columns), None, None);
    let named = columns.iter().map(|column| (column.name.as_str(), column.kind));
    let mut table = Output::named(destination, named)?;
    table.reserve(log.known_rows(&options.shifts));
    let mut passing = Passing::new(Selection::of(&options.shifts));
    let mut checks = source.columns(car, tables);
    let mut times = RowTimes::default();
    let mut heard = HeardCommands::default();
    // Without a page no shift is drawn.
    let max_drawn = if options.with_page { MAX_DRAWN } else { 0 };
    let mut write = |step: &LogStep, filtered: &Filtered| {
        let (time_s, row) = (step.time_s, Row { car, numbers: &numbers, places: &places, step, filtered });
        let now = (row.said(), row.named());
        let same =
            Same { readings: said.replace(now.0) == Some(now.0), others: named_before.replace(now.1) == Some(now.1) };
        row_numbers.take(&row);
        // In memory words that stay the same are counted and not written.
        if let (Output::Memory(writer), true) = (&mut table, same.readings && same.others) {
            writer.numbers(time_s, row_numbers.chosen());
            return Ok(());
        }
        let new = if same.readings { &columns[..before_readings] } else { &columns[..] };
        let rest = (new.len() < columns.len()).then_some(Cell::SameWords);
        table.cells(time_s, new.iter().map(|column| column.cell(&row, &row_numbers, same)).chain(rest))?;
        if options.is_followed() { table.flush() } else { Ok(()) }
    };
    let read = || {
        let next = source.next_step();
        if let Ok(Some(step)) = &next {
            times.push(step);
            heard.push(step);
            if let Some(checks) = &mut checks {
                checks.push(step);
            }
        }
        next
    };
    let judge = |row: &mut (LogStep, Filtered)| {
        shifts.push(&row.0, &mut row.1);
        shifts.draw_at_most(max_drawn, |shift| passing.wants(shift.number, car, shift.gears));
        passing.push(car, row, &mut write)
    };
    with_stages(options.threads_of(&log), |stages| {
        let mut rows = WriteBehind::new(stages, judge);
        let filtered = ReadAhead::new(stages, read).try_for_each(|step| {
            let step = step?;
            options.row_done()?;
            rows.push((step, filter.step(&step)))
        });
        rows.finish()?;
        filtered
    })?;
    let drive = LoggedDrive { filter, shifts };
    let origin_s = shown_from_s(times.first_s());
    source.check_times()?;
    let median_s = times.check(path, !log.map.channels.is_empty())?;
    source.finish(say)?;
    if let Some(warning) = heard.warning(car, tables) {
        say(&warning);
    }
    say_end_of_followed(options, path, say);
    checks.map_or(Ok(()), |checks| checks.check())?;
    check_speeds(&drive.shifts, (setup, path), say)?;
    if let Some(warning) = slow_log(median_s) {
        say(&warning);
    }
    let learnt = LearntOfDrive::of(car, tables, &drive.filter);
    let mut drive = drive.finish();
    passing.check()?;
    drive.shifts.retain(|shift| passing.wants(shift.number, car, shift.gears));
    let rows = table.finish()?;
    let without_sensors = options.sensors.is_none() && !car.gearbox.has_ratios_alone();
    Ok(DriveEstimates { rows, drive, origin_s, learnt, without_sensors })
}

/// Refuses a log whose speeds are not those of the car, or of which no estimate can be used.
fn check_speeds(drive: &LoggedShifts<'_>, (setup, path): (&Setup<'_>, &Path), say: Notes<'_>) -> Result<(), Error> {
    if let Some(swapped) = drive.swapped_speeds().filter(|_| does_not_fit(drive.rows_in_gear())) {
        say(&format!("warning: {swapped}"));
    }
    if let Some(RefusedCommand { element, readings: [refused, all] }) = drive.refused_command() {
        return Err(Error::Input(format!(
            "{}: {} of {} readings of the command of {element} were refused: its valve cannot have them\nhint: check unit, scale and sign of the channel, and \
             whether the vehicle file is of this car; `wetclutch inspect` shows minimum and maximum values",
            path.shown(),
            grouped(refused),
            grouped(all)
        )));
    }
    let wrong_scale = drive.wrong_scale().map(|wrong| wrong.text);
    if drive.has_slipping_element() && wrong_scale.is_none() {
        return Ok(());
    }
    check_ratios(drive.rows_in_gear(), wrong_scale.as_deref(), Path::new(&setup.file.source.path), path)?;
    let wheel_scale = ErrorBudget::of_car(&setup.file.car).wheel_scale;
    check_wheel(drive.output_over_wheel(), setup.file.driveline.final_ratio, wheel_scale)?;
    drive.unusable().map_or(Ok(()), |unusable| Err(refused(unusable, path)))
}

/// Whether the speeds of most rows in a gear are not those of that gear.
fn does_not_fit([all, unfit]: [u64; 2]) -> bool {
    2 * unfit > all
}

/// Refuses a log whose speeds are not those of the gearbox in most rows; `wrong_scale` says which speed has a wrong scale, if it is known.
///
/// # Errors
/// They are not.
pub fn check_ratios(rows: [u64; 2], wrong_scale: Option<&str>, vehicle: &Path, log: &Path) -> Result<(), Error> {
    if !does_not_fit(rows) {
        return Ok(());
    }
    let [all, unfit] = rows;
    Err(Error::Input(format!(
        "{}: in {unfit} of {all} rows in a gear the turbine speed is not the output speed times the ratio of that gear in {}\nhint: {}",
        log.shown(),
        vehicle.shown(),
        wrong_scale
            .unwrap_or("check the units of both speeds, the gear, and whether this is the vehicle file of the car")
    )))
}
