//! `wetclutch simulate` of a drive file.

use std::path::{Path, PathBuf};

use car::columns::{command_age, element_commands};
use car::{Car, Drive, Sensors};
use config::DriveFile;
use drivetrain::CommandKind;
use plant::car::{CarCalibration, CarModel, CarSample, ElementSample, OverSpeed, ShiftStage, simulate_car_drive};
use study::any_shift::measured::{MeasuredRow, SensedDrive, has_ages};
use study::any_shift::recording::{input_clutch_n_m, lock_up_is_applied, reported_engine_n_m};
use trace::units::{km_h, rpm};
use trace::{Cell, CsvWriter, ShownPath as _, WholeFile, signal};

use super::car::{describe_car, read_car, warn_of_slipping};
use super::not_an_input;
use super::simulate::size_note;
use crate::args::Simulate;
use crate::failure::Failure;
use crate::output;

/// Bytes that a row takes in both files: those of the eight-speed car in `drives/city.toml`.
const ROW_BYTES: f64 = 500.0;

pub(super) fn simulate_drive(options: &Simulate) -> Result<(), Failure> {
    let file = DriveFile::read(&options.experiment)?;
    let car = match &options.vehicle {
        Some(vehicle) => read_car(vehicle)?,
        None => file.read_vehicle().inspect(warn_of_slipping)?,
    };
    if options.scenario.is_some() {
        let message = format!("{}: a drive has no scenarios\nhint: leave --scenario out", options.experiment.shown());
        return Err(Failure::Input(message));
    }
    let drive = &file.drive;
    if let Some(note) = size_note(drive.duration_s(), drive.sample_time_s, ROW_BYTES) {
        output::note(&note);
    }
    let name = drive.name.to_lowercase();
    let inputs = std::iter::once(&options.experiment).chain(&options.vehicle);
    keeps_inputs(&options.output, &name, inputs.chain(&file.speeds))?;
    let model = CarModel::new(car.car.clone()).map_err(|error| Failure::Input(error.to_string()))?;
    let mut tables =
        DriveTables::create(&options.output, &name, &car, drive.sensors.as_ref().zip(Some(drive.sample_time_s)))?;
    let mut sensed = drive.sensors.as_ref().map(|sensors| SensedDrive::new(&car, sensors, drive.sample_time_s));
    let recorded_s = sensed.as_ref().map_or(drive.sample_time_s, SensedDrive::record_s);
    let recorded = Drive { sample_time_s: recorded_s, ..drive.clone() };
    let mut written = Ok(());
    let summary = simulate_car_drive(&model, &car, CarCalibration::STANDARD, &recorded, |sample| {
        // After a write error the simulation continues to its end without writing: this takes seconds.
        if written.is_ok() {
            written = match &mut sensed {
                Some(sensed) => sensed.push(sample, |row| tables.write(&car, row)),
                None => tables.write(&car, &MeasuredRow::exact(sample)),
            };
        }
    })?;
    written?;
    if let Some(sensed) = &mut sensed {
        sensed.finish(|row| tables.write(&car, row))?;
    }
    let paths = tables.finish(&options.output)?;
    output::note(&format!(
        "drive: {:.0} s, {:.2} km{}, {} shifts, at most {:.0} km/h",
        summary.duration_s,
        1e-3 * summary.distance_m,
        backwards(1e-3 * summary.backwards_m),
        summary.shifts,
        km_h(summary.fastest_m_s),
    ));
    if let Some(error) = summary.speed_error {
        output::note(&format!(
            "speed: error {:.2} km/h (root mean square), at most {:.1} km/h; outside the tolerance of 2 km/h and 1 s for {:.2} % of the time",
            km_h(error.rms_m_s),
            km_h(error.largest_m_s),
            100.0 * error.beyond,
        ));
    }
    if let Some(over) = &summary.over_speed {
        output::note(&over_speed(over, &car));
    }
    for path in paths {
        output::line(&path.shown().to_string())?;
    }
    Ok(())
}

/// What of a distance was driven backwards, in words; nothing where it is too short to be shown.
fn backwards(km: f64) -> String {
    if km < 0.005 { String::new() } else { format!(" ({km:.2} km of it backwards)") }
}

/// What a drive asks of the engine that it cannot do.
fn over_speed(over: &OverSpeed, car: &Car) -> String {
    let OverSpeed { time_s, engine_rad_s, map_rad_s, gears } = *over;
    let [from, to] = gears.map(|gear| car.gearbox.gears.get(gear).map_or("N", |gear| gear.name.as_str()));
    let in_gear = if from == to { format!("in gear {from}") } else { format!("in the shift {from}-{to}") };
    format!(
        "warning: the engine turns at {:.0} rpm {in_gear} at {time_s:.2} s, and its torque map ends at {:.0} rpm: beyond, the last torque of the \
         map is used\nhint: a gearbox controller would refuse such a shift; check [[shift]], the schedule and the grade",
        rpm(engine_rad_s),
        rpm(map_rad_s)
    )
}

/// The two files of a drive: every signal, and those that a car measures or commands.
pub(super) struct DriveTables {
    whole: Table,
    measured: Table,
}

/// The files of a drive of this name.
fn paths(folder: &Path, name: &str) -> [PathBuf; 2] {
    [format!("{name}.csv"), format!("{name}_measured.csv")].map(|name| folder.join(name))
}

/// Refuses to write the files of a drive over what it is made from, such as its speed cycle.
pub(super) fn keeps_inputs<'a>(
    folder: &Path,
    name: &str,
    inputs: impl Iterator<Item = &'a PathBuf> + Clone,
) -> Result<(), Failure> {
    paths(folder, name).iter().try_for_each(|path| not_an_input(Some(path), inputs.clone()))
}

impl DriveTables {
    /// Begins `NAME.csv` and `NAME_measured.csv`; the latter goes through sensors where there are some, with this time between rows.
    pub(super) fn create(
        folder: &Path,
        name: &str,
        car: &Car,
        sensors: Option<(&Sensors, f64)>,
    ) -> Result<Self, Failure> {
        let columns = columns(car);
        let measured = columns.iter().filter(|column| column.is_measured).cloned();
        let measured: Vec<_> = measured.chain(sensors.iter().flat_map(|of| ages(car, *of))).collect();
        let [whole_path, measured_path] = paths(folder, name);
        Ok(Self { whole: Table::create(whole_path, columns)?, measured: Table::create(measured_path, measured)? })
    }

    pub(super) fn write(&mut self, car: &Car, row: &MeasuredRow) -> Result<(), Failure> {
        self.whole.write(car, &MeasuredRow::exact(&row.sample))?;
        self.measured.write(car, row)
    }

    /// Gives both files their names.
    pub(super) fn finish(self, folder: &Path) -> Result<[PathBuf; 2], Failure> {
        let ((whole_file, whole), (measured_file, measured)) = (self.whole.complete()?, self.measured.complete()?);
        WholeFile::finish_all([whole_file, measured_file]).map_err(|error| Failure::writing(folder, &error))?;
        Ok([whole, measured])
    }
}

/// A column of the results.
#[derive(Clone)]
struct DriveColumn {
    name: String,
    /// Whether a car measures or commands it.
    is_measured: bool,
    value: DriveValue,
}

/// Where the cells of a column come from.
#[derive(Clone, Copy)]
enum DriveValue {
    Of(for<'c> fn(&'c Car, &CarSample) -> Cell<'c>),
    /// A speed as it is read, or its age.
    Speed(usize, Reading),
    /// The command of an element's valve as it is read, or its age.
    Command(usize, Reading),
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
            Self::OfShift(which) => {
                let clutch = which(&row.sample);
                Cell::Number(of(clutch.and_then(|clutch| row.commands.get(clutch.element)), Reading::Value))
            }
        }
    }
}

/// The speeds of the rows, with their names, in the order of [`MeasuredRow::speeds`].
const SPEEDS: [&str; 4] = [signal::ENGINE_SPEED, signal::TURBINE_SPEED, signal::OUTPUT_SPEED, signal::WHEEL_SPEED];

/// The columns of the ages of readings that may be older than their rows.
fn ages(car: &Car, (sensors, row_s): (&Sensors, f64)) -> Vec<DriveColumn> {
    let measured = |name: String, value: DriveValue| DriveColumn { name, is_measured: true, value };
    let speeds = [&sensors.engine, &sensors.turbine, &sensors.output, &sensors.wheel];
    let speeds = speeds.into_iter().enumerate().filter(|(_, of)| has_ages(of.sample_time_s, of.offset_s, row_s));
    let named = speeds.filter_map(|(at, _)| Some((at, signal::age_of(SPEEDS[at])?)));
    let mut columns: Vec<_> =
        named.map(|(at, age)| measured(age.to_owned(), DriveValue::Speed(at, Reading::Age))).collect();
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

/// The columns in their order.
fn columns(car: &Car) -> Vec<DriveColumn> {
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
        measured(signal::GEAR, |car, s| gear_name(car, s.gears()[0])),
        measured(signal::TARGET_GEAR, |car, s| gear_name(car, s.gears()[1])),
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

/// The name of a gear, or of neutral.
fn gear_name(car: &Car, gear: Option<usize>) -> Cell<'_> {
    let Some(gear) = gear else { return Cell::Word("N") };
    Cell::Word(car.gearbox.gears.get(gear).map_or("", |gear| gear.name.as_str()))
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

/// Some columns of the drive, written as it is simulated.
struct Table {
    path: PathBuf,
    columns: Vec<DriveColumn>,
    writer: CsvWriter<WholeFile>,
}

impl Table {
    fn create(path: PathBuf, columns: Vec<DriveColumn>) -> Result<Self, Failure> {
        let names = columns.iter().map(|column| column.name.as_str());
        let writer = WholeFile::create(&path).and_then(|file| CsvWriter::new(file, names));
        let writer = writer.map_err(|error| Failure::writing(&path, &error))?;
        Ok(Self { path, columns, writer })
    }

    fn write(&mut self, car: &Car, row: &MeasuredRow) -> Result<(), Failure> {
        let cells = self.columns.iter().map(|column| column.value.cell(car, row));
        self.writer.row(row.sample.time_s, cells).map_err(|error| Failure::writing(&self.path, &error))
    }

    /// The file, which contains every row, and its path.
    fn complete(self) -> Result<(WholeFile, PathBuf), Failure> {
        match self.writer.finish() {
            Ok(file) => Ok((file, self.path)),
            Err(error) => Err(Failure::writing(&self.path, &error)),
        }
    }
}

/// Prints what a drive file describes.
pub(super) fn describe_drive(drive: &DriveFile, path: &Path) -> Result<(), Failure> {
    let given = match &drive.trace {
        Some(trace) => format!("by {} speeds", trace.points()),
        None => format!("in {} segments", drive.segments.len()),
    };
    output::line(&format!(
        "drive {}: {:.0} s {given}, driven {} times",
        drive.name,
        drive.duration_s(),
        drive.repetitions
    ))?;
    match drive.vehicle {
        Some(_) => {
            let car = drive.read_vehicle()?;
            describe_car(&car)?;
            warn_of_slipping(&car);
            Ok(())
        }
        None => {
            output::line(&format!("use: wetclutch simulate {} --vehicle VEHICLE -o DIR", path.shown()))?;
            Ok(())
        }
    }
}
