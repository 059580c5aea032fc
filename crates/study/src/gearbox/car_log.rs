//! A log of a drive of a car with any gearbox as a table: its columns, and what the filter is shown of a row.
//!
//! The columns have the names of `wetclutch simulate`. Time, turbine and output speed, gear and target gear are needed, without a converter the reported
//! engine torque too; an element without a command has the torque that the speeds show. With a converter the estimate is the open loop where there is no
//! engine speed. True values and measured
//! pressures are compared where the log has them.

use car::columns::{command_age, element_commands, element_pressures, pressure_command_column};
use car::{Car, Gear};
use logs::{LOOK_AHEAD_S, LookAhead};
use observer::Reading;
use observer::ShiftTables;
use observer::gearbox::{MAX_ELEMENTS, ShiftInput};
use trace::{CsvRows, TraceError, signal};

pub use evaluate::LogStep;

use super::gear_numbers::GearNumbers;
use super::gear_signal::Gears;
use super::pressure_command::command_for;
use crate::frozen_rows::{FrozenRows, SpeedReadings};
use crate::row_clock::{RowClock, RowTime};
use crate::row_samples::{RowSamples, refuse_misnamed_engine};
/// Places of a speed or a command in the log, and of the age of its readings.
#[derive(Debug, Clone, Copy)]
struct ReadingColumn {
    value: usize,
    age: Option<usize>,
}

impl ReadingColumn {
    fn find(rows: &CsvRows, name: &str) -> Option<Self> {
        let age = signal::age_of(name).and_then(|age| rows.find(age));
        rows.find(name).map(|value| Self { value, age })
    }

    fn require(rows: &CsvRows, name: &str) -> Result<Self, TraceError> {
        let value = rows.require(name)?;
        Ok(Self { value, age: signal::age_of(name).and_then(|age| rows.find(age)) })
    }

    fn read(self, rows: &CsvRows, samples: &RowSamples) -> Option<Reading<f64>> {
        let value = samples.number(rows, self.value);
        let age_s = self.age.map_or(0.0, |age| samples.number(rows, age));
        (!value.is_nan()).then_some(Reading { value, age_s: if age_s.is_nan() { 0.0 } else { age_s } })
    }
}

/// Where the columns are.
struct Columns {
    engine: Option<ReadingColumn>,
    turbine: ReadingColumn,
    output: ReadingColumn,
    wheel: Option<ReadingColumn>,
    engine_torque: Option<ReadingColumn>,
    acceleration: Option<ReadingColumn>,
    lock_up: Option<usize>,
    gear: usize,
    target: usize,
    /// Place in the filter's tables, column, and the element where the column has the pressure that is asked of it.
    commands: Vec<(usize, ReadingColumn, Option<usize>)>,
    /// Place and column of measured pressures.
    pressures: Vec<(usize, ReadingColumn)>,
    pedals: [Option<usize>; 2],
    vehicle: Option<usize>,
    oil: Option<usize>,
    /// Pressure, torque and slip of offgoing and oncoming clutch.
    truth: [[Option<usize>; 3]; 2],
}

impl Columns {
    fn of(rows: &CsvRows, car: &Car, tables: &ShiftTables<f64>) -> Result<Self, TraceError> {
        let find = |name: &str| ReadingColumn::find(rows, name);
        let require = |name: &str| ReadingColumn::require(rows, name);
        let commands = element_commands(car).into_iter().filter_map(|(element, name)| {
            let place = tables.place(element)?;
            let found = |name: &str, value| ReadingColumn { value, age: rows.find(&command_age(name)) };
            let pressure = pressure_command_column(&car.gearbox.elements[element].name);
            // Without a command the speeds alone tell its torque.
            match (rows.find(&name), rows.find(&pressure)) {
                (Some(value), _) => Some((place, found(&name, value), None)),
                (None, Some(value)) => Some((place, found(&pressure, value), Some(element))),
                (None, None) => None,
            }
        });
        let pressures = element_pressures(car).filter_map(|(element, name)| {
            let age = rows.find(&command_age(&name));
            Some((tables.place(element)?, ReadingColumn { value: rows.find(&name)?, age }))
        });
        let truth = |names: [&str; 3]| names.map(|name| rows.find(name));
        let offgoing = truth([signal::OFFGOING_PRESSURE, signal::OFFGOING_TORQUE, signal::OFFGOING_SLIP]);
        let oncoming = truth([signal::ONCOMING_PRESSURE, signal::ONCOMING_TORQUE, signal::ONCOMING_SLIP]);
        let has_converter = car.converter.is_some();
        Ok(Self {
            engine: find(signal::ENGINE_SPEED),
            turbine: require(signal::TURBINE_SPEED)?,
            output: require(signal::OUTPUT_SPEED)?,
            wheel: find(signal::WHEEL_SPEED),
            engine_torque: match has_converter {
                true => find(signal::REPORTED_ENGINE_TORQUE),
                false => Some(require(signal::REPORTED_ENGINE_TORQUE)?),
            },
            acceleration: find(signal::LONGITUDINAL_ACCELERATION),
            lock_up: rows.find(signal::LOCK_UP_APPLIED),
            gear: rows.require(signal::GEAR)?,
            target: rows.require(signal::TARGET_GEAR)?,
            commands: commands.collect(),
            pedals: [signal::THROTTLE, signal::BRAKE].map(|name| rows.find(name)),
            vehicle: rows.find(signal::VEHICLE_SPEED),
            oil: rows.find(signal::OIL_TEMPERATURE),
            pressures: pressures.collect(),
            truth: [offgoing, oncoming],
        })
    }
}

/// A log, read row by row.
pub struct CarLog<'c> {
    car: &'c Car,
    rows: CsvRows,
    columns: Columns,
    clock: RowClock,
    frozen: FrozenRows,
    samples: RowSamples,
    numbers: GearNumbers,
    gears: Gears,
    /// Rows that may still be shown to have a wrong speed.
    ahead: LookAhead<LogStep, TraceError>,
}

impl<'c> CarLog<'c> {
    /// Finds the columns.
    ///
    /// # Errors
    /// One that is needed is missing.
    pub fn of(rows: CsvRows, car: &'c Car, tables: &ShiftTables<f64>) -> Result<Self, TraceError> {
        let rows = rows.with_wheel_radius(car.road.wheel_radius_m)?;
        refuse_misnamed_engine(&rows)?;
        let columns = Columns::of(&rows, car, tables)?;
        let (clock, frozen, samples) =
            (RowClock::default(), FrozenRows::of_gearbox(&car.gearbox.ratios()), RowSamples::new(&rows));
        let gears = Gears::new([signal::GEAR, signal::TARGET_GEAR]);
        let numbers = GearNumbers::of(car);
        Ok(Self { car, columns, rows, clock, frozen, samples, numbers, gears, ahead: LookAhead::new(LOOK_AHEAD_S) })
    }

    /// A log that is still being written: no row waits for those after it.
    #[must_use]
    pub fn following(self) -> Self {
        Self { ahead: LookAhead::new(0.0), ..self }
    }

    /// Refuses a log most of whose rows have no time of their own.
    ///
    /// # Errors
    /// It is one.
    pub fn check_times(&self) -> Result<(), TraceError> {
        self.clock.notes(&self.rows).map(drop)
    }

    /// What was met in the time stamps, the samples, the gears and of frozen speeds, in sentences.
    ///
    /// # Errors
    /// Most rows, or most samples of a column, could not be used, or no row has a gear.
    pub fn check_readings(&self) -> Result<Vec<String>, TraceError> {
        let mut notes = self.clock.notes(&self.rows)?;
        notes.extend(self.samples.notes(&self.rows)?);
        let gears = format!("its gears are {}", self.gear_names());
        if self.gears.is_without_gear() {
            return Err(self.rows.refused(format!("the gear is missing in all rows\nhint: {gears}")));
        }
        notes.extend(self.gears.notes(&gears).map_err(|message| self.rows.refused(message))?);
        notes.extend(self.frozen.notes());
        notes.extend(self.unread());
        Ok(notes)
    }

    /// Columns whose names begin as those of an element and are none that is read, in a sentence.
    fn unread(&self) -> Option<String> {
        // What an estimate writes of an element is not read again.
        const WRITTEN: [&str; 4] =
            ["_valve_model_pressure_pa", "_pressure_least_pa", "_pressure_greatest_pa", "_command_reading"];
        let is_used = |place: usize| {
            let commands = self.columns.commands.iter().map(|(_, column, _)| column);
            let mut columns = commands.chain(self.columns.pressures.iter().map(|(_, column)| column));
            columns.any(|column| column.value == place || column.age == Some(place))
        };
        let of_element = |name: &str| name.starts_with("element_") && !WRITTEN.iter().any(|end| name.ends_with(end));
        let names = self.rows.names().enumerate();
        let unread: Vec<String> = names
            .filter(|(place, name)| of_element(name) && !is_used(*place))
            .map(|(_, name)| format!("`{}`", name.escape_debug()))
            .collect();
        (!unread.is_empty()).then(|| {
            format!(
                "not read: {}. No element of this car has such a command or pressure, or the name does not end with its unit (docs/reference/logs.md)",
                unread.join(", ")
            )
        })
    }

    /// Whether the table has the pressure that is asked of an element in place of the command of its valve.
    pub fn has_pressure_command(&self, element: usize) -> bool {
        self.columns.commands.iter().any(|(.., of_pressure)| *of_pressure == Some(element))
    }

    /// Whether the table has a longitudinal acceleration.
    pub fn has_acceleration(&self) -> bool {
        self.columns.acceleration.is_some()
    }

    /// Whether the table has a signal, of this name in SI, in its SI unit.
    pub fn is_in_si(&self, name: &str) -> bool {
        self.rows.find(name).is_none_or(|column| self.rows.factor(column) == 1.0)
    }

    /// The next row, without the readings that rows after it show to be wrong; `None` at the end.
    ///
    /// # Errors
    /// The file cannot be read, or a time is no number.
    pub fn next_step(&mut self) -> Result<Option<LogStep>, TraceError> {
        loop {
            if let Some(next) = self.ahead.ready() {
                return next;
            }
            match self.read_step() {
                Ok(Some(step)) => {
                    self.ahead.push(step.time_s, step);
                    for withdrawn in self.frozen.withdrawn() {
                        for step in self.ahead.waiting() {
                            self.frozen.withdraw(withdrawn, speeds(&mut step.input), step.time_s);
                        }
                    }
                }
                Ok(None) => self.ahead.end(None),
                Err(error) => self.ahead.end(Some(error)),
            }
        }
    }

    /// The next row of the file; `None` at its end.
    fn read_step(&mut self) -> Result<Option<LogStep>, TraceError> {
        let Some(RowTime { time_s, dt_s }) = self.clock.advance(&mut self.rows)? else { return Ok(None) };
        self.take_gears();
        let (rows, columns, samples) = (&self.rows, &self.columns, &self.samples);
        let mut commands = [None; MAX_ELEMENTS];
        for &(place, column, of_pressure) in &columns.commands {
            let read = column.read(rows, samples);
            let command = |value: f64| of_pressure.map_or(value, |element| command_for(self.car, element, value));
            commands[place] = read.map(|Reading { value, age_s }| Reading { value: command(value), age_s });
        }
        let mut pressures = [None; MAX_ELEMENTS];
        for &(place, column) in &columns.pressures {
            pressures[place] = column.read(rows, samples);
        }
        let reading = |column: Option<ReadingColumn>| column.and_then(|column| column.read(rows, samples));
        let [engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s, reported_n_m] =
            [columns.engine, Some(columns.turbine), Some(columns.output), columns.wheel, columns.engine_torque]
                .map(reading);
        let number = |column: Option<usize>| column.map_or(f64::NAN, |column| samples.number(rows, column));
        let by_wheels = wheel_rad_s.map_or(f64::NAN, |wheel| wheel.value * self.car.road.wheel_radius_m);
        let of_car = number(columns.vehicle);
        let vehicle_m_s = if columns.vehicle.is_some() { of_car } else { by_wheels };
        let speed_m_s = Some(Reading { value: of_car, age_s: 0.0 }).filter(|speed| !speed.value.is_nan());
        let truth = columns.truth.map(|clutch| clutch.map(number));
        let lock_up_applied = number(columns.lock_up) > 0.5;
        let mut input = ShiftInput {
            dt_s,
            engine_rad_s,
            turbine_rad_s,
            output_rad_s,
            wheel_rad_s,
            engine_n_m: reported_n_m,
            acceleration_m_s2: reading(columns.acceleration),
            lock_up_applied,
            commands,
            gear: self.gears.row(self.car, [turbine_rad_s, output_rad_s]),
        };
        let pedals = columns.pedals.map(number);
        let oil_degc = Some(number(columns.oil)).filter(|degc| !degc.is_nan());
        self.frozen.take_out(speeds(&mut input), time_s);
        let step = LogStep { time_s, input, pedals, vehicle_m_s, oil_degc, reported_n_m, speed_m_s, pressures, truth };
        Ok(Some(step))
    }

    /// Takes the cells of `gear` and `target_gear`; an empty one says nothing new.
    fn take_gears(&mut self) {
        for (which, column) in [self.columns.gear, self.columns.target].into_iter().enumerate() {
            let text = self.rows.text(column);
            if text.is_empty() {
                continue;
            }
            let gears = &self.car.gearbox.gears;
            // A logger may write the gear as a number with decimals.
            let number = || text.parse::<f64>().ok();
            let whole = || number().map(|number| format!("{number}"));
            let named = |name: &str| gears.iter().position(|gear| gear.name == name).map(Gear::at);
            // As in a channel map, zero is no gear and less than it reverse.
            let not_forward = || {
                let number = logs::number_of_letter(text.as_bytes()).or_else(number)?;
                self.numbers.gear(number).filter(|_| number <= 0.0)
            };
            let found = named(&text).or_else(|| named(&whole()?)).or_else(not_forward);
            self.gears.take(which, found, || text.escape_debug().to_string());
        }
    }

    fn gear_names(&self) -> String {
        self.car.gearbox.gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ")
    }
}

fn speeds(input: &mut ShiftInput<f64>) -> SpeedReadings<'_> {
    let ShiftInput { engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s, .. } = input;
    [engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s]
}
