//! A log of a drive of a car with any gearbox: its columns, what the filter is shown of it, and what it says.
//!
//! The columns have the names of `wetclutch simulate`. Time, turbine and output speed, gear, target gear and the command of every
//! element's valve are needed, with a converter the engine speed too, without one the reported engine torque. True values are
//! compared where the log has them.

use config::{Car, Sensors};
use design::{ShiftErrors, ShiftTables, any_shift_filter};
use drivetrain::CommandKind;
use observer::any_shift::{
    AnyShiftFilter, AnyShiftState, ClutchEstimate, GearCommand, Learnt, MAX_ELEMENTS, ONE_WAY, ShiftEstimate,
    ShiftInput, ShiftPhase,
};
use observer::{Health, Reading};
use plant::car::{BeyondGears, CarShiftQuality, NO_GEAR};
use trace::{CsvRows, TraceError, signal};

use super::command_delay::CommandDelay;
use super::contradictions::CommandCheck;
use super::converter_check::ConverterCheck;
use super::drive::{DriveState, NO_ELEMENT, PassingShifts, ScoredDrive, ScoredShift};
use super::gear_signal::Gears;
pub use super::in_gear::Unusable;
use super::in_gear::{InGear, InGearRow};
use super::learning_count::LearningCount;
use super::log_beside::{CarriedPressures, ShiftJerk};
use super::pressure_command::{command_for, pressure_command_column};
pub use super::ratio_scale::WrongScale;
use super::still_commands::StillCommands;
use super::{AnyShiftError, ClutchRow, DRAG_N_M, ROUNDING_PA, ShiftScoreRow, within};
use crate::frozen_rows::FrozenRows;
use crate::row_clock::{RowClock, RowTime};
use crate::row_samples::RowSamples;
use crate::shift_estimates::is_refused;

/// Slip below which a true clutch sticks, rad/s.
const STICKS_RAD_S: f64 = 0.05;

/// Rows further apart, and three times as far as usual, are a hole in the recording, s \[chosen\]: a phase of a shift may pass in it.
const HOLE_S: f64 = 0.5;

/// Names for neither a forward gear nor reverse.
const NEUTRAL: [&str; 2] = ["N", "P"];

/// The columns with the commands of the valves: element of the gearbox, and name.
pub fn element_commands(car: &Car) -> Vec<(usize, String)> {
    let elements = car.gearbox.elements.iter().zip(&car.clutches).enumerate();
    let columns = elements.filter_map(|(at, (element, clutch))| {
        let unit = match clutch.as_ref()?.valve.command_kind() {
            CommandKind::Current => "current_a",
            CommandKind::DutyCycle => "duty_percent",
        };
        Some((at, format!("{}_{unit}", element_column(&element.name))))
    });
    columns.collect()
}

/// The columns with the measured pressures of the elements: element of the gearbox, and name.
pub fn element_pressures(car: &Car) -> impl Iterator<Item = (usize, String)> + '_ {
    let elements = car.gearbox.elements.iter().zip(&car.clutches).enumerate();
    let pressed = elements.filter(|(_, (_, clutch))| clutch.is_some());
    pressed.map(|(at, (element, _))| (at, format!("{}_pressure_pa", element_column(&element.name))))
}

/// The column with the age of a command or a pressure: how long before its row it was read, s.
pub fn command_age(command: &str) -> String {
    let name = command.rsplit_once('_').map_or(command, |(name, _)| name);
    format!("{name}_age_s")
}

/// How the names of an element's columns begin.
pub fn element_column(element: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() { c } else { '_' };
    format!("element_{}", element.to_lowercase().chars().map(plain).collect::<String>())
}

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
            Some(match (rows.find(&name), rows.find(&pressure)) {
                (None, Some(value)) => Ok((place, found(&pressure, value), Some(element))),
                _ => rows.require(&name).map(|value| (place, found(&name, value), None)),
            })
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
            engine: if has_converter { Some(require(signal::ENGINE_SPEED)?) } else { find(signal::ENGINE_SPEED) },
            turbine: require(signal::TURBINE_SPEED)?,
            output: require(signal::OUTPUT_SPEED)?,
            wheel: find(signal::WHEEL_SPEED),
            engine_torque: match has_converter {
                true => find(signal::REPORTED_ENGINE_TORQUE),
                false => Some(require(signal::REPORTED_ENGINE_TORQUE)?),
            },
            lock_up: rows.find(signal::LOCK_UP_APPLIED),
            gear: rows.require(signal::GEAR)?,
            target: rows.require(signal::TARGET_GEAR)?,
            commands: commands.collect::<Result<_, _>>()?,
            pedals: [signal::THROTTLE, signal::BRAKE].map(|name| rows.find(name)),
            vehicle: rows.find(signal::VEHICLE_SPEED),
            oil: rows.find(signal::OIL_TEMPERATURE),
            pressures: pressures.collect(),
            truth: [offgoing, oncoming],
        })
    }
}

/// A row of a log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogStep {
    /// Time, s.
    pub time_s: f64,
    /// What the filter is shown.
    pub input: ShiftInput<f64>,
    /// Throttle and brake, 0 to 1; not a number where the log has none.
    pub pedals: [f64; 2],
    /// Vehicle speed, m/s; by the wheels where the log has none.
    pub vehicle_m_s: f64,
    /// Temperature of the oil in the gearbox, degC, where there is a reading of it.
    pub oil_degc: Option<f64>,
    /// Engine torque as the engine's controller reports it, N m, also where the filter is not shown it.
    pub reported_n_m: Option<Reading<f64>>,
    /// Speed of the car, m/s, where this row has a reading of it.
    pub speed_m_s: Option<Reading<f64>>,
    /// Measured pressures of elements, Pa, by their places in the filter's tables.
    pub pressures: [Option<Reading<f64>>; MAX_ELEMENTS],
    /// Pressure, Pa, torque, N m, and slip, rad/s, of offgoing and oncoming clutch; not a number where the log has none.
    pub truth: [[f64; 3]; 2],
}

impl LogStep {
    /// A row with nothing beside what the filter is shown.
    pub fn of(time_s: f64, input: ShiftInput<f64>) -> Self {
        Self {
            time_s,
            input,
            pedals: [f64::NAN; 2],
            vehicle_m_s: f64::NAN,
            oil_degc: None,
            reported_n_m: None,
            speed_m_s: None,
            pressures: [None; MAX_ELEMENTS],
            truth: [[f64::NAN; 3]; 2],
        }
    }

    /// Measured pressures of the offgoing and the oncoming clutch of the shift that is under way, Pa, where this row has readings of them.
    pub fn shift_pressures(&self, tables: &ShiftTables<f64>) -> [Option<Reading<f64>>; 2] {
        let GearCommand { from, to } = self.input.gear;
        let clutches = tables.tables().shift(from, to).map(|row| row.clutches);
        [0, 1].map(|c| {
            let of_shift = self.truth[c][0];
            if of_shift.is_finite() {
                return Some(Reading { value: of_shift, age_s: 0.0 });
            }
            *self.pressures.get(clutches?[c].element)?
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
    gears: Gears,
}

impl<'c> CarLog<'c> {
    /// Finds the columns.
    ///
    /// # Errors
    /// One that is needed is missing.
    pub fn of(rows: CsvRows, car: &'c Car, tables: &ShiftTables<f64>) -> Result<Self, TraceError> {
        let rows = rows.with_wheel_radius(car.road.wheel_radius_m)?;
        let columns = Columns::of(&rows, car, tables)?;
        let (clock, frozen, samples) = (RowClock::default(), FrozenRows::new(), RowSamples::new(&rows));
        let gears = Gears::new([signal::GEAR, signal::TARGET_GEAR]);
        Ok(Self { car, columns, rows, clock, frozen, samples, gears })
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
        notes.extend(self.frozen.notes().map_err(|message| self.rows.refused(message))?);
        Ok(notes)
    }

    /// Whether the table has the pressure that is asked of an element in place of the command of its valve.
    pub fn has_pressure_command(&self, element: usize) -> bool {
        self.columns.commands.iter().any(|(.., of_pressure)| *of_pressure == Some(element))
    }

    /// Whether the table has a signal, of this name in SI, in its SI unit.
    pub fn is_in_si(&self, name: &str) -> bool {
        self.rows.find(name).is_none_or(|column| self.rows.factor(column) == 1.0)
    }

    /// The next row; `None` at the end.
    ///
    /// # Errors
    /// The file cannot be read, or a time is no number.
    pub fn next_step(&mut self) -> Result<Option<LogStep>, TraceError> {
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
        // Beside the converter's maps the engine torque makes the inertia phase worse: the acceleration of the engine comes late.
        let mut input = ShiftInput {
            dt_s,
            engine_rad_s,
            turbine_rad_s,
            output_rad_s,
            wheel_rad_s,
            engine_n_m: reported_n_m.filter(|_| self.car.converter.is_none() || lock_up_applied),
            lock_up_applied,
            commands,
            gear: self.gears.row(self.car, [turbine_rad_s, output_rad_s]),
        };
        let pedals = columns.pedals.map(number);
        let oil_degc = Some(number(columns.oil)).filter(|degc| !degc.is_nan());
        let ShiftInput { engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s, .. } = &mut input;
        self.frozen.take_out([engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s], time_s);
        Ok(Some(LogStep { time_s, input, pedals, vehicle_m_s, oil_degc, reported_n_m, speed_m_s, pressures, truth }))
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
            let whole = text.parse::<f64>().ok().map(|number| format!("{number}"));
            let named = |name: &str| gears.iter().position(|gear| gear.name == name);
            let neutral = (NEUTRAL.contains(&&*text) && named(&text).is_none()).then_some(NO_GEAR);
            let found = named(&text).or(neutral).or_else(|| named(&whole?));
            self.gears.take(which, found, || text.escape_debug().to_string());
        }
    }

    fn gear_names(&self) -> String {
        self.car.gearbox.gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ")
    }
}

/// The filter of a car on its way through a log.
pub struct LoggedDrive<'c> {
    car: &'c Car,
    tables: &'c ShiftTables<f64>,
    filter: AnyShiftFilter<'c, f64>,
    state: AnyShiftState<f64>,
    learning: LearningCount,
    passing: PassingShifts,
    /// Newest speeds of engine, turbine and output, rad/s: as they came, and those that the filter did not refuse.
    came_rad_s: [f64; 3],
    speeds_rad_s: [f64; 3],
    begun_s: f64,
    /// Where the turbine is in it.
    beyond: BeyondGears,
    in_gear: InGear<'c>,
    /// The gear of the row before, and changes of the gear which no target gear announced.
    gear: Option<usize>,
    unannounced: u64,
    commands: CommandCheck<'c>,
    delay: CommandDelay<'c>,
    converter: ConverterCheck,
    still: StillCommands,
    holes: Holes,
    carried: CarriedPressures,
    jerk: ShiftJerk,
}

/// Holes of the recording within shifts.
struct Holes {
    count: u64,
    /// The shift that the last one cut, as long as the log goes on in it: the rest is no other shift.
    cut: Option<[usize; 2]>,
    /// The last times between rows, s; the oldest is at `at`.
    steps_s: [f64; 31],
    at: usize,
}

impl Default for Holes {
    fn default() -> Self {
        // What is not a number sorts behind the numbers: half of the times must be known.
        Self { count: 0, cut: None, steps_s: [f64::NAN; 31], at: 0 }
    }
}

impl Holes {
    /// Takes a time between two rows, s: whether it is a hole. In a log whose rows are always so far apart it is none.
    fn is_hole(&mut self, dt_s: f64) -> bool {
        const TIMES: f64 = 3.0;
        let mut before_s = self.steps_s;
        self.steps_s[self.at] = dt_s;
        self.at = (self.at + 1) % self.steps_s.len();
        if dt_s <= HOLE_S {
            return false;
        }
        before_s.sort_by(f64::total_cmp);
        dt_s > TIMES * before_s[before_s.len() / 2]
    }
}

impl<'c> LoggedDrive<'c> {
    /// The filter of a car with these tables, for readings of these sensors, and with what was learnt in an earlier log.
    pub fn new(
        car: &'c Car,
        tables: &'c ShiftTables<f64>,
        sensors: Option<&Sensors>,
        learnt: Option<&Learnt<f64>>,
    ) -> Self {
        let filter = any_shift_filter(car, tables, &ShiftErrors::LOGGED, sensors);
        let state = learnt.map_or_else(|| filter.start(), |learnt| filter.start_with(learnt));
        Self {
            car,
            tables,
            filter,
            state,
            learning: LearningCount::of(state.learnt()),
            passing: PassingShifts::default(),
            came_rad_s: [f64::NAN; 3],
            speeds_rad_s: [f64::NAN; 3],
            begun_s: f64::NAN,
            beyond: BeyondGears::new(&car.gearbox, [NO_GEAR; 2], [f64::NAN; 2]),
            in_gear: InGear::new(car),
            gear: None,
            unannounced: 0,
            commands: CommandCheck::new(car, tables, &ShiftErrors::STANDARD),
            delay: CommandDelay::new(tables),
            converter: ConverterCheck::default(),
            still: StillCommands::default(),
            holes: Holes::default(),
            carried: CarriedPressures::default(),
            jerk: ShiftJerk::default(),
        }
    }

    /// The tables of a car.
    ///
    /// # Errors
    /// The gearbox has more clutches than the filter has room for.
    pub fn tables(car: &Car) -> Result<ShiftTables<f64>, AnyShiftError> {
        ShiftTables::of_car(car, &ShiftErrors::LOGGED).map_err(AnyShiftError::TooManyElements)
    }

    /// Takes a row and returns the estimate for it.
    pub fn push(&mut self, step: &LogStep) -> ShiftEstimate<f64> {
        let input = &step.input;
        if let Some(degc) = step.oil_degc {
            self.state.take_oil_temperature(degc);
        }
        let mut estimate = self.filter.step(&mut self.state, input);
        if self.delay.is_found() {
            estimate.health = estimate.health.max(Health::CommandsMistimed);
        }
        self.learning.push(self.state.learnt());
        let readings = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s];
        let channels = [estimate.channels.engine, estimate.channels.turbine, estimate.channels.output];
        for (at, (reading, health)) in readings.into_iter().zip(channels).enumerate() {
            let Some(Reading { value, .. }) = reading else { continue };
            self.came_rad_s[at] = value;
            if !is_refused(health) {
                self.speeds_rad_s[at] = value;
            }
        }
        self.carried.push(input.dt_s, &estimate.valve_pa);
        self.jerk.push(step);
        let GearCommand { from, to } = input.gear;
        self.passing.state(DriveState {
            time_s: step.time_s,
            gear: from,
            pedals: step.pedals,
            vehicle_m_s: step.vehicle_m_s,
            speeds_rad_s: self.speeds_rad_s,
            health: estimate.health,
        });
        let gears = (from != to).then_some([from, to]);
        if gears != self.holes.cut {
            self.holes.cut = None;
        }
        let is_hole = self.holes.is_hole(input.dt_s);
        if let Some(open) = self.passing.open.as_ref().filter(|_| is_hole) {
            self.holes.count += 1;
            self.holes.cut = gears.filter(|gears| *gears == [open.from, open.to]);
            self.end(f64::NAN, usize::MAX);
        } else if self.passing.ends(gears) {
            self.end(step.time_s, from);
        }
        let is_same = self.gear.is_none_or(|before| before == from || before == NO_GEAR || from == NO_GEAR);
        match gears {
            Some(_) if self.holes.cut.is_some() => {}
            Some(_) => self.during(step, &estimate),
            None => {
                // Without a converter dogs change while the clutch is open: this is no shift.
                let is_open = matches!(estimate.health, Health::ClutchOpen | Health::TooSlow);
                let are_dogs = self.car.converter.is_none() && is_open;
                // What happens in a hole is not seen.
                self.unannounced += u64::from(!is_same && !is_hole && !are_dogs);
                self.in_gear.push(&InGearRow {
                    gear: from,
                    dt_s: input.dt_s,
                    came_rad_s: self.came_rad_s,
                    output: input.output_rad_s,
                    wheel: input.wheel_rad_s,
                    health: estimate.health,
                });
            }
        }
        // In a shift the gear may be the new one already.
        self.gear = gears.map_or(Some(from), |_| None);
        let [engine, turbine, output] = self.came_rad_s;
        if gears.is_none() {
            self.converter.push(self.car, step, [engine, turbine]);
        }
        self.commands.push(step.time_s, gears.is_none().then_some(from), [turbine, output], &estimate.valve_pa);
        self.still.push(&input.commands);
        self.take_jerk();
        let [_, turbine, output] = self.speeds_rad_s;
        self.delay.push(step, &estimate, [turbine, output]);
        estimate
    }

    /// Guaranteed range of the pressure of each element after the last row, Pa, by its place in the filter's tables.
    pub fn pressure_ranges_pa(&self) -> [Option<[f64; 2]>; MAX_ELEMENTS] {
        core::array::from_fn(|at| self.filter.pressure_range_pa(&self.state, at))
    }

    /// The filter, what it has learnt up to now, and from how many shifts of the log.
    pub fn learnt(&self) -> (&AnyShiftFilter<'c, f64>, &Learnt<f64>, LearningCount) {
        (&self.filter, self.state.learnt(), self.learning)
    }

    /// Rows in a gear at speed, and those whose turbine and output speed do not fit the ratio of that gear.
    pub fn rows_in_gear(&self) -> [u64; 2] {
        self.in_gear.rows()
    }

    /// The rows in a gear while the car moves, if there are enough of them and the filter could use the readings of none.
    pub fn unusable(&self) -> Option<Unusable> {
        self.in_gear.unusable()
    }

    /// Output over wheel speed in a gear at speed, in the middle; not a number where too few rows have both.
    pub fn output_over_wheel(&self) -> f64 {
        self.in_gear.output_over_wheel()
    }

    /// What contradicts the channels of engine and turbine speed, in a sentence.
    pub fn swapped_speeds(&self) -> Option<String> {
        self.in_gear.swapped_speeds()
    }

    /// A speed whose scale is wrong by the ratios in the gears.
    pub fn wrong_scale(&self) -> Option<WrongScale> {
        self.in_gear.wrong_scale()
    }

    fn during(&mut self, step: &LogStep, estimate: &ShiftEstimate<f64>) {
        let GearCommand { from, to } = step.input.gear;
        let elements = self.tables.tables().shift(from, to).map(|row| row.clutches.map(|clutch| clutch.element));
        if self.passing.open.is_none() {
            let single = || self.car.gearbox.shift(from, to).and_then(|shift| shift.change.single());
            let elements = elements.and_then(|_| single()).unwrap_or([NO_ELEMENT; 2]);
            let turbine_n_m = estimate.turbine_n_m.unwrap_or(f64::NAN);
            self.passing.begin(self.car, [from, to], elements, (step.time_s, turbine_n_m));
            self.begun_s = step.time_s;
            self.jerk.begin(step);
            self.still.begin();
            let ratios = [from, to].map(|gear| self.car.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio));
            self.beyond = BeyondGears::new(&self.car.gearbox, [from, to], ratios);
        }
        let Some(shift) = &mut self.passing.open else { return };
        shift.time_s[1] = step.time_s;
        let [_, turbine, output] = self.speeds_rad_s;
        self.beyond.push(&mut shift.quality, [turbine, output]);
        let found = estimate.clutches.filter(|found| Some(found.map(|clutch| clutch.element)) == elements);
        let at_turbine_n_m = estimate.at_turbine.map(|clutches| [clutches.torque_n_m, clutches.deviation_n_m]);
        let row = self.tables.tables().shift(from, to).copied();
        let clutches = match (found.zip(row), self.car.gearbox.has_ratios_alone()) {
            (Some((found, row)), _) => {
                let pressures_pa = self.carried.pressures_pa(step, self.tables);
                [0, 1].map(|c| {
                    let [_, torque_n_m, slip_rad_s] = step.truth[c];
                    let by_speeds = row.clutches[c].alpha * (turbine - row.clutches[c].ratio * output);
                    let slips = [slip_rad_s, by_speeds];
                    ClutchRow {
                        alpha: row.clutches[c].alpha,
                        ..clutch_row(&found[c], [pressures_pa[c], torque_n_m], slips)
                    }
                })
            }
            // A shift past a gear has no inertias.
            (None, true) if estimate.health == Health::ShiftNotModelled => return,
            (None, true) => {
                let holds = [ShiftPhase::OffgoingHolds, ShiftPhase::OncomingHolds];
                holds.map(|holds| ClutchRow::unknown(estimate.phase == Some(holds)))
            }
            (None, false) => return,
        };
        shift.rows.push(ShiftScoreRow {
            time_s: step.time_s,
            clutches,
            turbine_n_m: [f64::NAN, estimate.turbine_n_m.unwrap_or(f64::NAN)],
            at_turbine_n_m,
            speeds_rad_s: [self.speeds_rad_s[0], turbine, output, f64::NAN],
            phase: estimate.phase.map_or("-", |phase| phase.name()),
            health: estimate.health,
            flare_rad_s: estimate.flare_rad_s,
        });
    }

    /// Ends the open shift with the first row after it, which is in this gear.
    fn end(&mut self, time_s: f64, gear: usize) {
        let Some(shift) = &self.passing.open else { return };
        let complete_s = (gear == shift.to).then_some(time_s - self.begun_s);
        if let Some(row) = self.tables.tables().shift(shift.from, shift.to).filter(|_| complete_s.is_some()) {
            self.still.end(row.clutches.map(|clutch| clutch.element));
            self.delay.end([shift.from, shift.to], [self.begun_s, time_s]);
        }
        // A log has no slip of the held elements.
        let unknown =
            CarShiftQuality { jerk_m_s3: f64::NAN, held_slip_rad_s: f64::NAN, tie_up_n_m: f64::NAN, ..shift.quality };
        self.passing.end(CarShiftQuality { complete_s, ..unknown });
        self.jerk.end(time_s);
    }

    /// Gives the jerk to the shift that ended last, some tenths of a second after its end.
    fn take_jerk(&mut self) {
        if let Some((jerk_m_s3, shift)) = self.jerk.ended().zip(self.passing.drive.shifts.last_mut()) {
            shift.quality.jerk_m_s3 = jerk_m_s3;
        }
    }

    /// Keeps what figures need of at most so many of the shifts up to now that are wanted, those with the largest errors, or without truth those
    /// worth a look: called after each row, it bounds what is held of a long drive.
    pub fn draw_at_most(&mut self, most: usize, is_wanted: impl Fn(&ScoredShift) -> bool) {
        self.passing.draw_at_most(most, is_wanted);
    }

    /// The drive.
    pub fn finish(mut self) -> ScoredDrive {
        // A shift that the log cuts off is not complete.
        self.end(f64::NAN, usize::MAX);
        let swapped = self.in_gear.swapped_speeds().map(|swapped| format!("warning: {swapped}"));
        let mut warnings: Vec<String> = swapped.into_iter().chain(self.commands.warnings()).collect();
        warnings.extend(self.delay.warning());
        warnings.extend(self.converter.warning(self.car));
        warnings.extend(self.still.warnings(self.car, self.tables));
        if self.holes.count > 0 {
            warnings.push(format!(
                "warning: {} shifts have a hole of more than {HOLE_S} s in the recording: they end with it and count as not completed",
                self.holes.count
            ));
        }
        if self.unannounced > 0 {
            warnings.push(format!(
                "warning: gear changes without a target_gear that says so before (so often: {}): these shifts are not estimated. target_gear has to \
                 change when a shift is requested, gear when it is done",
                self.unannounced
            ));
        }
        let final_ratio = self.car.driveline.final_ratio;
        let (off, bound) =
            (self.output_over_wheel() / final_ratio - 1.0, ShiftErrors::LOGGED.of_car(self.car).wheel_scale);
        let wrong = self.wrong_scale();
        warnings.extend(wrong.iter().map(|wrong| format!("warning: {}", wrong.text)));
        if off.abs() > bound && wrong.is_none_or(|wrong| !wrong.is_output) {
            warnings.push(format!(
                "warning: output_speed over wheel_speed is {:.3} in the middle, {:+.1} % from the final ratio {final_ratio:.3}: the filter learns the \
                 scale of wheel_speed within {:.1} % and refuses what is further off. Correct the scale of wheel_speed or `driveline.final_ratio`, or \
                 give its bound as `error_bounds.wheel_scale_share`",
                self.output_over_wheel(),
                100.0 * off,
                100.0 * bound
            ));
        }
        ScoredDrive { warnings, ..self.passing.drive }
    }
}

/// The row of a clutch beside the pressure and torque that are known, with its true slip and that by the readings.
fn clutch_row(
    found: &ClutchEstimate<f64>,
    [pressure_pa, torque_n_m]: [f64; 2],
    [slip_rad_s, by_speeds]: [f64; 2],
) -> ClutchRow {
    ClutchRow {
        slip_rad_s: if slip_rad_s.is_nan() { by_speeds } else { slip_rad_s },
        alpha: f64::NAN,
        torque_n_m: [torque_n_m, found.torque_n_m, found.open_loop_n_m],
        pressure_pa: [pressure_pa, found.pressure_pa, found.valve_pa],
        sticks: if slip_rad_s.is_nan() { found.holds } else { slip_rad_s.abs() < STICKS_RAD_S },
        torque_range_n_m: found.torque_range_n_m,
        pressure_range_pa: found.pressure_range_pa,
        hidden: found.hidden,
        is_one_way: found.element == ONE_WAY,
        in_range: within(found.pressure_range_pa, pressure_pa, ROUNDING_PA)
            && within(found.torque_range_n_m, torque_n_m, DRAG_N_M),
    }
}
