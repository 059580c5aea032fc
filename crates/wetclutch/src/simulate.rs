//! Simulated drives.

use car::columns::{command_age, element_commands};
use car::{Car, Drive, Sensors};
use drivetrain::CommandKind;
pub use evaluate::drive::SimulatedShifts;
use evaluate::measured::{FailedSensors, MeasuredRow, SensedDrive, has_ages};
use evaluate::recording::{input_clutch_n_m, lock_up_is_applied, reported_engine_n_m};
use plant::car::{
    CarCalibration, CarDriveSummary, CarModel, CarSample, ElementSample, ShiftStage, simulate_car_drive_while,
};
use report::drive_page::simulated_shift_cells;
use trace::{Cell, ColumnKind, signal};

use crate::memory_writer::MemoryWriter;
use crate::{Error, Table};

/// A simulated drive in memory.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// Every signal, true values included.
    pub truth: Table,
    /// What a car measures or commands, through the sensors of the drive if it has some: a log as [`crate::estimate()`] takes it.
    pub measured: Table,
    /// Distance, shifts and how well the speeds were followed.
    pub summary: CarDriveSummary,
}

/// Simulates a drive of a car. Equal drives with equal seeds of their sensors give equal tables.
///
/// # Errors
/// The car cannot be driven so, or the simulation fails.
pub fn simulate(car: &Car, drive: &Drive) -> Result<Simulation, Error> {
    simulate_until(car, drive, &|_| false)
}

/// As [`simulate()`], until the simulation is interrupted; `is_interrupted` gets the time of each row, s.
///
/// # Errors
/// It was, or as [`simulate()`].
pub fn simulate_until(car: &Car, drive: &Drive, is_interrupted: &dyn Fn(f64) -> bool) -> Result<Simulation, Error> {
    simulate_taking(car, drive, is_interrupted, |_| ())
}

/// As [`simulate_until`], with a table that has a row for each shift: how it went, what the occupants feel of it, friction work and temperature of the
/// plates, as `wetclutch simulate` writes them.
///
/// # Errors
/// See [`simulate_until`].
pub fn simulate_scored(
    car: &Car,
    drive: &Drive,
    is_interrupted: &dyn Fn(f64) -> bool,
) -> Result<(Simulation, Table), Error> {
    let model = CarModel::new(car.clone()).map_err(|error| Error::Input(error.to_string()))?;
    let mut shifts = SimulatedShifts::new(car, &model);
    let simulation = simulate_taking(car, drive, is_interrupted, |sample| shifts.push(sample))?;
    let shifts = shifts.finish();
    Ok((simulation, Table::of_rows(shifts.iter().map(|shift| simulated_shift_cells(shift, car)))))
}

fn simulate_taking(
    car: &Car,
    drive: &Drive,
    is_interrupted: &dyn Fn(f64) -> bool,
    mut take: impl FnMut(&CarSample),
) -> Result<Simulation, Error> {
    let (all, measured) = (drive_columns(car), measured_columns(car, sensors_of(drive)));
    let (mut truth, mut readings) = (Rows::new(all), Rows::new(measured));
    let summary = simulate_rows(car, drive, |row| {
        truth.push(car, &MeasuredRow::exact(&row.sample));
        readings.push(car, row);
        take(&row.sample);
        if is_interrupted(row.sample.time_s) { Err(Error::interrupted()) } else { Ok(()) }
    })?;
    Ok(Simulation { truth: truth.writer.finish(), measured: readings.writer.finish(), summary })
}

/// The sensors of a drive with the time between two rows, s.
pub fn sensors_of(drive: &Drive) -> Option<(&Sensors, f64)> {
    drive.sensors.as_ref().zip(Some(drive.sample_time_s))
}

/// Simulates a drive of a car; `take` gets each row as it comes, and ends the simulation where it fails.
///
/// # Errors
/// The car cannot be driven so, the simulation fails, or `take` did.
pub fn simulate_rows(
    car: &Car,
    drive: &Drive,
    mut take: impl FnMut(&MeasuredRow) -> Result<(), Error>,
) -> Result<CarDriveSummary, Error> {
    let mut failed = FailedSensors::of(&drive.faults);
    let mut take = |row: &MeasuredRow| take(&failed.read(row));
    let model = CarModel::new(car.clone()).map_err(|error| Error::Input(error.to_string()))?;
    let mut sensed = drive.sensors.as_ref().map(|sensors| SensedDrive::new(car, sensors, drive.sample_time_s));
    let recorded_s = sensed.as_ref().map_or(drive.sample_time_s, SensedDrive::record_s);
    let recorded = Drive { sample_time_s: recorded_s, ..drive.clone() };
    let mut taken = Ok(());
    let summary = simulate_car_drive_while(&model, car, CarCalibration::of(drive.controller), &recorded, |sample| {
        // A step of the controller may have several samples.
        if taken.is_ok() {
            taken = match &mut sensed {
                Some(sensed) => sensed.push(sample, &mut take),
                None => take(&MeasuredRow::exact(sample)),
            };
        }
        taken.is_ok()
    })?;
    taken?;
    if let Some(sensed) = &mut sensed {
        sensed.finish(take)?;
    }
    Ok(summary)
}

/// Rows in memory.
struct Rows {
    columns: Vec<DriveColumn>,
    writer: MemoryWriter,
}

impl Rows {
    fn new(columns: Vec<DriveColumn>) -> Self {
        let writer = MemoryWriter::new(columns.iter().map(|column| (column.name.as_str(), column.kind())));
        Self { columns, writer }
    }

    fn push(&mut self, car: &Car, row: &MeasuredRow) {
        self.writer.push(row.sample.time_s, self.columns.iter().map(|column| column.cell(car, row)));
    }
}

/// A column of a simulated drive.
#[derive(Clone)]
pub struct DriveColumn {
    /// Its name.
    pub name: String,
    /// Whether a car measures or commands it.
    pub is_measured: bool,
    value: DriveValue,
}

/// The columns of a drive that have words.
const WORDS: [&str; 5] = [signal::GEAR, signal::TARGET_GEAR, "shift_stage", "offgoing", "oncoming"];

impl DriveColumn {
    fn kind(&self) -> ColumnKind {
        if WORDS.contains(&self.name.as_str()) { ColumnKind::Word } else { ColumnKind::Number }
    }

    /// Its cell in a row.
    pub fn cell<'c>(&self, car: &'c Car, row: &MeasuredRow) -> Cell<'c> {
        self.value.cell(car, row)
    }
}

/// Where the cells of a column come from.
#[derive(Clone, Copy)]
enum DriveValue {
    Of(for<'c> fn(&'c Car, &CarSample) -> Cell<'c>),
    /// A speed as it is read, or its age.
    Speed(usize, Reading),
    /// The command of an element's valve as it is read, or its age.
    Command(usize, Reading),
    /// The longitudinal acceleration as it is read, or its age.
    Acceleration(Reading),
    /// The command of the offgoing or oncoming clutch.
    OfShift(fn(&CarSample) -> Option<ElementSample>),
}

/// What of a reading.
#[derive(Clone, Copy)]
enum Reading {
    Value,
    Age,
}

impl DriveValue {
    fn cell<'c>(self, car: &'c Car, row: &MeasuredRow) -> Cell<'c> {
        let of = |reading: Option<&[f64; 2]>, what: Reading| reading.map_or(f64::NAN, |reading| reading[what as usize]);
        match self {
            Self::Of(value) => value(car, &row.sample),
            Self::Speed(speed, what) => Cell::Number(of(row.speeds.get(speed), what)),
            Self::Command(element, what) => Cell::Number(of(row.commands.get(element), what)),
            Self::Acceleration(what) => Cell::Number(of(Some(&row.acceleration), what)),
            Self::OfShift(which) => {
                let clutch = which(&row.sample);
                Cell::Number(of(clutch.and_then(|clutch| row.commands.get(clutch.element)), Reading::Value))
            }
        }
    }
}

/// The speeds of the rows, with their names, in the order of [`MeasuredRow::speeds`].
const SPEEDS: [&str; 4] = [signal::ENGINE_SPEED, signal::TURBINE_SPEED, signal::OUTPUT_SPEED, signal::WHEEL_SPEED];

/// The columns that a car measures or commands; `sensors` with the time between two rows, s, if the drive is read by some.
pub fn measured_columns(car: &Car, sensors: Option<(&Sensors, f64)>) -> Vec<DriveColumn> {
    let measured = drive_columns(car).into_iter().filter(|column| column.is_measured);
    let acceleration = sensors.filter(|(sensors, _)| sensors.acceleration.is_some()).map(|_| DriveColumn {
        name: signal::LONGITUDINAL_ACCELERATION.to_owned(),
        is_measured: true,
        value: DriveValue::Acceleration(Reading::Value),
    });
    measured.chain(acceleration).chain(sensors.into_iter().flat_map(|of| ages(car, of))).collect()
}

/// The columns of the ages of readings that may be older than their rows.
fn ages(car: &Car, (sensors, row_s): (&Sensors, f64)) -> Vec<DriveColumn> {
    let measured = |name: String, value: DriveValue| DriveColumn { name, is_measured: true, value };
    let speeds = [&sensors.engine, &sensors.turbine, &sensors.output, &sensors.wheel];
    let speeds = speeds.into_iter().enumerate().filter(|(_, of)| has_ages(of.sample_time_s, of.offset_s, row_s));
    let named = speeds.filter_map(|(at, _)| Some((at, signal::age_of(SPEEDS[at])?)));
    let mut columns: Vec<_> =
        named.map(|(at, age)| measured(age.to_owned(), DriveValue::Speed(at, Reading::Age))).collect();
    let acceleration = sensors.acceleration.filter(|of| has_ages(of.sample_time_s, of.offset_s, row_s));
    let named = acceleration.and_then(|_| signal::age_of(signal::LONGITUDINAL_ACCELERATION));
    columns.extend(named.map(|age| measured(age.to_owned(), DriveValue::Acceleration(Reading::Age))));
    let current = sensors.current.and_then(|of| Some(has_ages(of.sample_time_s?, of.offset_s, row_s)));
    if current.unwrap_or(false) {
        let commands = element_commands(car).into_iter();
        columns.extend(commands.map(|(at, name)| measured(command_age(&name), DriveValue::Command(at, Reading::Age))));
    }
    columns
}

/// A number of a shift clutch; an empty cell where no shift is under way.
macro_rules! of_shift {
    ($clutch:ident, $field:ident) => {
        |_, sample| Cell::Number($clutch(sample).map_or(f64::NAN, |clutch| clutch.$field))
    };
}

/// The columns of a drive of a car in their order, true values included.
pub fn drive_columns(car: &Car) -> Vec<DriveColumn> {
    let kinds = || car.clutches.iter().flatten().map(|clutch| clutch.valve.command_kind());
    let [offgoing_command, oncoming_command] = if kinds().all(|kind| kind == CommandKind::Current) {
        [signal::OFFGOING_CURRENT, signal::ONCOMING_CURRENT]
    } else if kinds().all(|kind| kind == CommandKind::DutyCycle) {
        [signal::OFFGOING_DUTY, signal::ONCOMING_DUTY]
    } else {
        ["offgoing_command", "oncoming_command"]
    };
    type Value = for<'c> fn(&'c Car, &CarSample) -> Cell<'c>;
    let column = |is_measured: bool| {
        move |name: &str, value: Value| DriveColumn { name: name.to_owned(), is_measured, value: DriveValue::Of(value) }
    };
    let (measured, truth) = (column(true), column(false));
    let read = |name: &str, value: DriveValue| DriveColumn { name: name.to_owned(), is_measured: true, value };
    let speeds = SPEEDS.iter().enumerate().map(|(at, name)| read(name, DriveValue::Speed(at, Reading::Value)));
    let mut columns: Vec<_> = speeds.collect();
    columns.extend([
        measured(signal::THROTTLE, |_, s| Cell::Number(s.driver.throttle)),
        measured(signal::BRAKE, |_, s| Cell::Number(s.driver.brake)),
        measured("engine_share", |_, s| Cell::Number(s.engine_share)),
        measured(signal::REPORTED_ENGINE_TORQUE, |car, s| Cell::Number(reported_engine_n_m(car, s))),
        measured(signal::LOCK_UP_APPLIED, |car, s| Cell::Whole(u64::from(lock_up_is_applied(car, s)))),
        measured(signal::GEAR, |car, s| Cell::Word(car.gear_name(s.gears().from))),
        measured(signal::TARGET_GEAR, |car, s| Cell::Word(car.gear_name(s.gears().to))),
        measured("shift_stage", |_, s| Cell::Word(s.shift.map_or("", |shift| stage_name(shift.stage)))),
        measured("offgoing", |car, s| element_name(car, offgoing(s))),
        measured("oncoming", |car, s| element_name(car, oncoming(s))),
        read(offgoing_command, DriveValue::OfShift(offgoing)),
        read(oncoming_command, DriveValue::OfShift(oncoming)),
        truth(signal::OFFGOING_PRESSURE, of_shift!(offgoing, pressure_pa)),
        truth(signal::ONCOMING_PRESSURE, of_shift!(oncoming, pressure_pa)),
        truth(signal::OFFGOING_TORQUE, of_shift!(offgoing, torque_n_m)),
        truth(signal::ONCOMING_TORQUE, of_shift!(oncoming, torque_n_m)),
        truth(signal::OFFGOING_SLIP, of_shift!(offgoing, slip_rad_s)),
        truth(signal::ONCOMING_SLIP, of_shift!(oncoming, slip_rad_s)),
        truth(signal::ENGINE_TORQUE, |_, s| Cell::Number(s.torques.engine_n_m)),
        truth(signal::TURBINE_TORQUE, |_, s| Cell::Number(s.turbine_n_m)),
        truth(signal::SHAFT_TORQUE, |_, s| Cell::Number(s.torques.shaft_n_m)),
        truth(input_clutch_signal(car), |car, s| Cell::Number(input_clutch_n_m(car, s))),
        truth("grade_rad", |_, s| Cell::Number(s.driver.grade_rad)),
        truth(signal::VEHICLE_SPEED, |_, s| Cell::Number(s.vehicle_m_s)),
        truth(signal::VEHICLE_ACCELERATION, |_, s| Cell::Number(s.vehicle_m_s2)),
    ]);
    let commands = element_commands(car).into_iter();
    columns.extend(commands.map(|(element, name)| read(&name, DriveValue::Command(element, Reading::Value))));
    columns
}

/// The torque of the clutch between engine and gearbox.
fn input_clutch_signal(car: &Car) -> &'static str {
    if car.converter.is_some() { signal::LOCK_UP_TORQUE } else { signal::LAUNCH_CLUTCH_TORQUE }
}

/// The clutch that opens in a shift; from neutral none does.
fn offgoing(sample: &CarSample) -> Option<ElementSample> {
    sample.shift.filter(|shift| !shift.is_from_neutral).map(|shift| shift.offgoing)
}

/// The clutch that closes in a shift.
fn oncoming(sample: &CarSample) -> Option<ElementSample> {
    sample.shift.map(|shift| shift.oncoming)
}

fn element_name(car: &Car, clutch: Option<ElementSample>) -> Cell<'_> {
    let element = clutch.and_then(|clutch| car.gearbox.elements.get(clutch.element));
    Cell::Word(element.map_or("", |element| element.name.as_str()))
}

fn stage_name(stage: ShiftStage) -> &'static str {
    match stage {
        ShiftStage::Fill => "fill",
        ShiftStage::TorquePhase => "torque phase",
        ShiftStage::InertiaPhase => "inertia phase",
        ShiftStage::HandOver => "hand-over",
        ShiftStage::Lock => "lock",
        ShiftStage::Done => "done",
    }
}
