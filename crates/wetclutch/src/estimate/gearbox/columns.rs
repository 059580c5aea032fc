//! The columns of an estimate of a car with any gearbox.

use car::columns::{element_column, element_commands};
use car::{Car, Gear, ShiftCommand};
use evaluate::LogStep;
use evaluate::logged::Filtered;
use observer::gearbox::{MAX_ELEMENTS, ShiftElement, ShiftEstimate, ShiftPhase};
use observer::{ChannelHealth, Channels, Health, Reading, ShiftTables};
use study::gearbox::gear_numbers::GearNumbers;
use trace::signal::{self, ACCELERATION_READING, OFFGOING_COMMAND_READING, ONCOMING_COMMAND_READING, READINGS};
use trace::{Cell, ColumnKind};

use crate::Error;
use crate::estimate::no_column::no_column;

/// What a row of the estimate is made from.
#[derive(Clone, Copy)]
pub(crate) struct Row<'a> {
    pub(crate) car: &'a Car,
    pub(crate) numbers: &'a GearNumbers,
    pub(crate) places: &'a [(usize, &'a str)],
    /// The readings of the row.
    pub(crate) step: &'a LogStep,
    /// What the filter made of them.
    pub(crate) filtered: &'a Filtered,
}

/// What the columns of readings say of a row: of channels, of the commands of elements, and which of these are those of the shift.
type Said = (Channels<ChannelHealth>, [ChannelHealth; MAX_ELEMENTS], Option<[ShiftElement; 2]>);

/// What the other columns of words say of a row: gears, phase, clutches and health.
type Named = (ShiftCommand, Option<ShiftCommand>, Option<ShiftPhase>, Option<[ShiftElement; 2]>, Health);

/// Which words of a row are those of the row before.
#[derive(Clone, Copy)]
pub(crate) struct Same {
    /// Those of the columns of readings.
    pub(crate) readings: bool,
    /// All others.
    pub(crate) others: bool,
}

impl<'a> Row<'a> {
    /// What its columns of words say but for those of readings: mostly the same as in the row before.
    pub(crate) fn named(&self) -> Named {
        let ShiftEstimate { gear, phase, clutches, health, .. } = &self.filtered.estimate;
        (self.step.input.gear, *gear, *phase, clutches.map(|clutches| clutches.map(|clutch| clutch.element)), *health)
    }

    /// What its columns of readings say, which is mostly the same as in the row before.
    pub(crate) fn said(&self) -> Said {
        let ShiftEstimate { channels, commands, clutches, .. } = &self.filtered.estimate;
        (*channels, *commands, clutches.map(|clutches| clutches.map(|clutch| clutch.element)))
    }

    /// Its name; empty in neutral.
    fn gear(&self, which: usize) -> Cell<'a> {
        Cell::Word(if self.of(which).is_neutral() { "" } else { self.car.gear_name(self.of(which)) })
    }

    /// The gear (0) or the target gear (1).
    fn of(&self, which: usize) -> Gear {
        if which == 0 { self.step.input.gear.from } else { self.step.input.gear.to }
    }

    /// What became of the reading of a channel, by its place in [`READINGS`]; of the command of a clutch of the shift nothing where there
    /// is none.
    fn reading(&self, at: usize) -> Cell<'a> {
        let ShiftEstimate { channels, commands, clutches, .. } = &self.filtered.estimate;
        let of_command = |which: usize| clutches.and_then(|of| commands.get(of[which].element.place()?).copied());
        let health = match READINGS.get(at) {
            Some(&ONCOMING_COMMAND_READING) => of_command(1),
            Some(&OFFGOING_COMMAND_READING) => of_command(0),
            _ => channels.each().get(at).copied(),
        };
        Cell::Word(health.map_or("", ChannelHealth::name))
    }

    fn element(&self, which: usize) -> Cell<'a> {
        let Some(clutches) = self.filtered.estimate.clutches else { return Cell::Word("") };
        Cell::Word(match clutches[which].element {
            ShiftElement::OneWay => self.one_way(which),
            of => self.places.iter().find(|(at, _)| of.place() == Some(*at)).map_or("", |(_, name)| *name),
        })
    }

    /// The one-way clutch of the shift.
    fn one_way(&self, which: usize) -> &'a str {
        let gearbox = &self.car.gearbox;
        let single = self.car.single_shift(self.filtered.estimate.gear.unwrap_or(self.step.input.gear));
        let element = single.and_then(|elements| gearbox.elements.get(elements[which]));
        element.map_or("", |element| element.name.as_str())
    }

    /// Pressure, torque, their ranges, both by the valve model, whether the speeds show nothing, and the standard deviations, in the order
    /// of [`CLUTCH`].
    fn clutch(&self, which: usize, what: usize) -> f64 {
        let Some(clutch) = self.filtered.estimate.clutches.as_ref().map(|clutches| &clutches[which]) else {
            return f64::NAN;
        };
        if !clutch.element.has_pressure() && ![TORQUE, TORQUE_DEVIATION].contains(&what) {
            // It has a torque alone.
            return f64::NAN;
        }
        let end = |range: Option<[f64; 2]>, end: usize| range.map_or(f64::NAN, |range| range[end]);
        match what {
            0 => clutch.pressure_pa,
            1 => end(clutch.pressure_range_pa, 0),
            2 => end(clutch.pressure_range_pa, 1),
            TORQUE => clutch.torque_n_m,
            4 => end(clutch.torque_range_n_m, 0),
            5 => end(clutch.torque_range_n_m, 1),
            6 => clutch.valve_pa,
            7 => clutch.open_loop_n_m,
            9 => clutch.pressure_std_dev_pa,
            TORQUE_DEVIATION => clutch.std_dev_n_m,
            _ => f64::from(u8::from(clutch.hidden)),
        }
    }

    /// The same without the sign of a zero.
    fn clutch_cell(&self, which: usize, what: usize) -> Cell<'a> {
        Cell::Number(self.clutch(which, what) + 0.0)
    }
}

/// The columns of a clutch, after `offgoing_` or `oncoming_`.
pub(crate) const CLUTCH: [&str; 11] = [
    "pressure_estimate_pa",
    "pressure_least_pa",
    "pressure_greatest_pa",
    "torque_estimate_n_m",
    "torque_least_n_m",
    "torque_greatest_n_m",
    "valve_model_pressure_pa",
    "valve_model_torque_n_m",
    "hidden",
    "pressure_deviation_pa",
    "torque_deviation_n_m",
];
/// The column of an element, after its name, that says what became of the reading of its command.
const COMMAND_READING: &str = "command_reading";
/// The places of the torque and of its standard deviation among them.
const TORQUE: usize = 3;
const TORQUE_DEVIATION: usize = 10;
/// The columns of an element, after its name: those of [`CLUTCH`] that its command alone gives.
const ELEMENT: [&str; 3] = [CLUTCH[6], CLUTCH[1], CLUTCH[2]];
const ROLES: [&str; 2] = ["offgoing", "oncoming"];

/// Where the cells of a column come from.
#[derive(Clone, Copy)]
pub(crate) enum Value {
    Of(for<'a> fn(&Row<'a>) -> Cell<'a>),
    Clutch(usize, usize),
    /// The number of the gear (0) or the target gear (1).
    GearNumber(usize),
    /// Pressure of an element by its valve model, by its place in the filter's tables.
    Valve(usize),
    /// An end of the range of that pressure.
    Range(usize, usize),
    /// What became of the reading of a channel, by its place in [`READINGS`]; after them that of [`ACCELERATION_READING`].
    Reading(usize),
    /// The same of the command of an element, by its place in the filter's tables.
    Command(usize),
    /// The reading itself.
    Measured(fn(&Row<'_>) -> Option<Reading<f64>>),
    /// That of the command of an element, by its place in the filter's tables.
    MeasuredCommand(usize),
}

impl Value {
    pub(crate) fn cell<'a>(self, row: &Row<'a>) -> Cell<'a> {
        match self {
            Self::Of(value) => value(row),
            Self::Clutch(which, what) => row.clutch_cell(which, what),
            Self::Valve(place) => Cell::Number(row.filtered.estimate.valve_pa[place.min(MAX_ELEMENTS - 1)]),
            Self::Range(place, end) => {
                of(row.filtered.pressure_ranges_pa[place.min(MAX_ELEMENTS - 1)].map(|range| range[end] + 0.0))
            }
            Self::GearNumber(which) => Cell::Number(row.numbers.number(row.of(which))),
            Self::Reading(at) => row.reading(at),
            Self::Command(place) => Cell::Word(row.filtered.estimate.commands[place.min(MAX_ELEMENTS - 1)].name()),
            Self::Measured(reading) => of(reading(row).map(|reading| reading.value)),
            Self::MeasuredCommand(place) => {
                of(row.step.input.commands[place.min(MAX_ELEMENTS - 1)].map(|reading| reading.value))
            }
        }
    }

    /// The number of its cell in a row, of a column that has numbers.
    #[inline]
    pub(crate) fn number(self, row: &Row<'_>) -> f64 {
        let cell = match self {
            // Most columns are those of the clutches of a shift, and most rows are of no shift.
            Self::Clutch(..) if row.filtered.estimate.clutches.is_none() => return f64::NAN,
            _ => self.cell(row),
        };
        match cell {
            Cell::Number(number) => number,
            Cell::Whole(number) => number as f64,
            Cell::Word(_) | Cell::SameWord | Cell::SameWords => f64::NAN,
        }
    }
}

/// How many columns stand before the columns of readings that end a table.
pub(crate) fn before_readings(columns: &[Column]) -> usize {
    let is_other = |column: &Column| !matches!(column.value, Value::Reading(_) | Value::Command(_));
    columns.iter().rposition(is_other).map_or(0, |last| last + 1)
}

/// A column of the estimate.
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) kind: ColumnKind,
    pub(crate) value: Value,
}

impl Column {
    /// Its cell in a row.
    pub(crate) fn cell<'a>(&self, row: &Row<'a>, same: Same) -> Cell<'a> {
        match (self.kind, self.value) {
            (ColumnKind::Word, Value::Reading(_) | Value::Command(_)) if same.readings => Cell::SameWord,
            (ColumnKind::Word, Value::Of(_)) if same.others => Cell::SameWord,
            (_, value) => value.cell(row),
        }
    }
}

/// What decides which columns a car has.
#[derive(Clone, Copy)]
pub(crate) struct Knows {
    converter: bool,
    elements: bool,
    acceleration: bool,
}

impl Knows {
    pub(crate) fn of(car: &Car, acceleration: bool) -> Self {
        Self { converter: car.converter.is_some(), elements: !car.gearbox.has_ratios_alone(), acceleration }
    }
}

fn word(name: &str, value: for<'a> fn(&Row<'a>) -> Cell<'a>) -> Column {
    Column { name: name.to_owned(), kind: ColumnKind::Word, value: Value::Of(value) }
}

fn number(name: impl Into<String>, value: Value) -> Column {
    Column { name: name.into(), kind: ColumnKind::Number, value }
}

/// The columns of a car whose elements have these places in the filter's tables.
pub(crate) fn columns(places: &[(usize, &str)], knows: Knows) -> Vec<Column> {
    let mut columns = vec![
        word(signal::GEAR, |row| row.gear(0)),
        word(signal::TARGET_GEAR, |row| row.gear(1)),
        word(signal::PHASE, |row| Cell::Word(row.filtered.estimate.phase.map_or("", |phase| phase.name()))),
    ];
    if knows.elements {
        columns.extend([word(ROLES[0], |row| row.element(0)), word(ROLES[1], |row| row.element(1))]);
        for (which, role) in ROLES.iter().enumerate() {
            let named = CLUTCH.iter().enumerate();
            columns.extend(named.map(|(what, name)| number(format!("{role}_{name}"), Value::Clutch(which, what))));
        }
    }
    columns.extend(torques(knows));
    for (place, name) in places {
        let values = [Value::Valve(*place), Value::Range(*place, 0), Value::Range(*place, 1)];
        columns.extend(
            ELEMENT.iter().zip(values).map(|(what, value)| number(format!("{}_{what}", element_column(name)), value)),
        );
    }
    columns.push(word(signal::HEALTH, |row| Cell::Word(row.filtered.estimate.health.name())));
    let gears = [(signal::GEAR_NUMBER, 0), (signal::TARGET_GEAR_NUMBER, 1)];
    columns.extend(gears.map(|(name, which)| number(name, Value::GearNumber(which))));
    columns.extend(readings(places, knows));
    columns
}

/// Torques beside those of the clutches of a shift.
fn torques(knows: Knows) -> Vec<Column> {
    let mut columns =
        vec![number("turbine_torque_estimate_n_m", Value::Of(|row| of(row.filtered.estimate.turbine_n_m)))];
    if !knows.elements {
        columns.push(number(
            "clutches_at_turbine_estimate_n_m",
            Value::Of(|row| of(row.filtered.estimate.at_turbine.map(|sum| sum.torque_n_m + 0.0))),
        ));
        columns.push(number(
            "clutches_at_turbine_deviation_n_m",
            Value::Of(|row| of(row.filtered.estimate.at_turbine.map(|sum| sum.std_dev_n_m))),
        ));
    }
    columns.push(number(signal::SHAFT_ESTIMATE, Value::Of(|row| of(row.filtered.estimate.shaft_n_m))));
    let clutch = if knows.converter { "lock_up" } else { "launch_clutch" };
    columns.push(number(
        format!("{clutch}_torque_estimate_n_m"),
        Value::Of(|row| of(row.filtered.estimate.input_clutch.map(|clutch| clutch.torque_n_m))),
    ));
    columns.push(number(
        format!("{clutch}_torque_deviation_n_m"),
        Value::Of(|row| of(row.filtered.estimate.input_clutch.map(|clutch| clutch.std_dev_n_m))),
    ));
    columns
}

/// What became of the reading of each channel, and of the command of each element.
fn readings(places: &[(usize, &str)], knows: Knows) -> Vec<Column> {
    let words = |name: String, value: Value| Column { name, kind: ColumnKind::Word, value };
    let is_command = |name: &str| [OFFGOING_COMMAND_READING, ONCOMING_COMMAND_READING].contains(&name);
    let channels = READINGS.iter().enumerate().filter(|(_, name)| knows.elements || !is_command(name));
    let channels = channels.map(|(at, name)| words((*name).to_owned(), Value::Reading(at)));
    let command = |(place, name): &(usize, &str)| {
        words(format!("{}_{COMMAND_READING}", element_column(name)), Value::Command(*place))
    };
    let acceleration =
        knows.acceleration.then(|| words(ACCELERATION_READING.to_owned(), Value::Reading(READINGS.len())));
    channels.chain(acceleration).chain(places.iter().map(command)).collect()
}

/// A measured channel: its column, and its reading in a row.
type Channel = (&'static str, fn(&Row<'_>) -> Option<Reading<f64>>);

/// The measured channels that an estimate may have too.
const MEASURED: [Channel; 6] = [
    (signal::ENGINE_SPEED, |row| row.step.input.engine_rad_s),
    (signal::TURBINE_SPEED, |row| row.step.input.turbine_rad_s),
    (signal::OUTPUT_SPEED, |row| row.step.input.output_rad_s),
    (signal::WHEEL_SPEED, |row| row.step.input.wheel_rad_s),
    (signal::REPORTED_ENGINE_TORQUE, |row| row.step.reported_n_m),
    (signal::LONGITUDINAL_ACCELERATION, |row| row.step.input.acceleration_m_s2),
];

/// The columns of the readings of a car, which an estimate has where they are asked for.
pub(crate) fn measured(car: &Car, tables: &ShiftTables<f64>) -> Vec<Column> {
    let channels = MEASURED.iter().map(|(name, reading)| number(*name, Value::Measured(*reading)));
    let command = |(at, name)| Some(number(name, Value::MeasuredCommand(tables.place(at)?)));
    channels.chain(element_commands(car).into_iter().filter_map(command)).collect()
}

/// Whether a table of estimates, of any kind of car, may have a column of this name that logs have too.
pub fn is_measured_column(name: &str) -> bool {
    let of_element = |what: &str| name.starts_with("element_") && name.ends_with(what);
    signal::MEASURABLE.contains(&name) || of_element("_current_a") || of_element("_duty_percent")
}

/// Whether the estimate of some car may have a column of this name.
pub fn is_car_column(name: &str) -> bool {
    let of_element = |what: &str| {
        let rest = name.strip_suffix(what).and_then(|rest| rest.strip_suffix('_'));
        rest.is_some_and(|rest| rest.starts_with("element_"))
    };
    let is_one = |[converter, elements]: [bool; 2]| {
        columns(&[], Knows { converter, elements, acceleration: true }).iter().any(|column| column.name == name)
    };
    [[true, true], [false, true], [true, false]].into_iter().any(is_one)
        || ELEMENT.into_iter().chain([COMMAND_READING]).any(of_element)
}

fn of(value: Option<f64>) -> Cell<'static> {
    Cell::Number(value.unwrap_or(f64::NAN))
}

/// The columns of these names in their order, also those of readings. Without names all, those of readings only with `with_measured`.
pub(crate) fn chosen(
    mut all: Vec<Column>,
    measured: Vec<Column>,
    (names, with_measured): (&[String], bool),
) -> Result<Vec<Column>, Error> {
    if names.is_empty() && !with_measured {
        return Ok(all);
    }
    all.extend(measured);
    if names.is_empty() {
        return Ok(all);
    }
    let mut chosen = Vec::new();
    for name in names.iter().map(|name| name.trim()).filter(|name| *name != signal::TIME) {
        let Some(at) = all.iter().position(|column| column.name == name) else {
            let known: Vec<&str> = all.iter().map(|column| column.name.as_str()).collect();
            return Err(no_column(name, &known, chosen.iter().any(|column: &Column| column.name == name)));
        };
        chosen.push(all.remove(at));
    }
    Ok(chosen)
}
