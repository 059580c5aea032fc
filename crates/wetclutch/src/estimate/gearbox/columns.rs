//! The columns of an estimate of a car with any gearbox.

use car::columns::element_column;
use car::{Car, Gear, ShiftCommand};
use evaluate::LogStep;
use evaluate::logged::Filtered;
use observer::gearbox::{ClutchEstimate, MAX_ELEMENTS, ShiftElement, ShiftEstimate, ShiftPhase};
use observer::{ChannelHealth, Channels, Health, ShiftTables};
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
    fn gear(&self, which: usize) -> &'a str {
        if self.of(which).is_neutral() { "" } else { self.car.gear_name(self.of(which)) }
    }

    /// The gear (0) or the target gear (1).
    fn of(&self, which: usize) -> Gear {
        if which == 0 { self.step.input.gear.from } else { self.step.input.gear.to }
    }

    /// What became of the reading of a channel, by its place in [`READINGS`]; of the command of a clutch of the shift nothing where there
    /// is none.
    fn reading(&self, at: usize) -> &'static str {
        let ShiftEstimate { channels, commands, clutches, .. } = &self.filtered.estimate;
        let of_command = |which: usize| clutches.and_then(|of| commands.get(of[which].element.place()?).copied());
        let health = match READINGS.get(at) {
            Some(&ONCOMING_COMMAND_READING) => of_command(1),
            Some(&OFFGOING_COMMAND_READING) => of_command(0),
            _ => channels.each().get(at).copied(),
        };
        health.map_or("", ChannelHealth::name)
    }

    fn element(&self, which: usize) -> &'a str {
        let Some(clutches) = &self.filtered.estimate.clutches else { return "" };
        match clutches[which].element {
            ShiftElement::OneWay => self.one_way(which),
            of => self.places.iter().find(|(at, _)| of.place() == Some(*at)).map_or("", |(_, name)| *name),
        }
    }

    /// The one-way clutch of the shift.
    fn one_way(&self, which: usize) -> &'a str {
        let gearbox = &self.car.gearbox;
        let single = self.car.single_shift(self.filtered.estimate.gear.unwrap_or(self.step.input.gear));
        let element = single.and_then(|elements| gearbox.elements.get(elements[which]));
        element.map_or("", |element| element.name.as_str())
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
/// The columns of an element, after its name: those of [`CLUTCH`] that its command alone gives.
const ELEMENT: [&str; 3] = [CLUTCH[6], CLUTCH[1], CLUTCH[2]];
const ROLES: [&str; 2] = ["offgoing", "oncoming"];

/// Columns of numbers that come from one place.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    /// A clutch of the shift.
    Clutch(usize),
    /// Torques beside those of the clutches of a shift.
    Torques(Knows),
    /// An element by its place in the filter's tables, with its name.
    Element(usize, &'a str),
    /// Gear and target gear.
    Gears,
    /// Readings of speeds, engine torque and acceleration.
    Measured,
    /// The reading of the command of an element, by its place in the filter's tables, with the name of its column.
    MeasuredCommand(usize, &'a str),
}

impl Source<'_> {
    /// The names of its columns.
    fn names(self) -> Vec<String> {
        let all = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        match self {
            Self::Clutch(which) => CLUTCH.iter().map(|what| format!("{}_{what}", ROLES[which])).collect(),
            Self::Torques(knows) => {
                let clutch = if knows.converter { "lock_up" } else { "launch_clutch" };
                let of_clutch = ["estimate", "deviation"].map(|what| format!("{clutch}_torque_{what}_n_m"));
                let mut names = vec!["turbine_torque_estimate_n_m".to_owned()];
                if !knows.elements {
                    names.extend(["estimate", "deviation"].map(|what| format!("clutches_at_turbine_{what}_n_m")));
                }
                names.push(signal::SHAFT_ESTIMATE.to_owned());
                names.extend(of_clutch);
                names
            }
            Self::Element(_, name) => ELEMENT.iter().map(|what| format!("{}_{what}", element_column(name))).collect(),
            Self::Gears => all(&[signal::GEAR_NUMBER, signal::TARGET_GEAR_NUMBER]),
            Self::Measured => all(&MEASURED),
            Self::MeasuredCommand(_, column) => all(&[column]),
        }
    }

    /// Writes the numbers of its columns in a row, not a number where there is none, over those of the row before.
    fn write(self, row: &Row<'_>, numbers: &mut [f64]) {
        let or_none = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let estimate = &row.filtered.estimate;
        match self {
            Self::Clutch(which) => match &estimate.clutches {
                Some(clutches) => numbers.copy_from_slice(&of_clutch(&clutches[which])),
                None => numbers.fill(f64::NAN),
            },
            Self::Torques(knows) => {
                let clutch = estimate.input_clutch.as_ref();
                let clutch = [clutch.map(|clutch| clutch.torque_n_m), clutch.map(|clutch| clutch.std_dev_n_m)];
                let sum = estimate.at_turbine.as_ref();
                let sum = [sum.map(|sum| sum.torque_n_m + 0.0), sum.map(|sum| sum.std_dev_n_m)];
                let sum = if knows.elements { &sum[..0] } else { &sum[..] };
                let torques = [estimate.turbine_n_m].into_iter().chain(sum.iter().copied()).chain([estimate.shaft_n_m]);
                let torques = torques.chain(clutch).map(or_none);
                numbers.iter_mut().zip(torques).for_each(|(number, torque)| *number = torque);
            }
            Self::Element(place, _) => {
                let place = place.min(MAX_ELEMENTS - 1);
                let [least, greatest] = row.filtered.pressure_ranges_pa[place].unwrap_or([f64::NAN; 2]);
                numbers.copy_from_slice(&[estimate.valve_pa[place], least + 0.0, greatest + 0.0]);
            }
            Self::Gears => numbers.copy_from_slice(&[0, 1].map(|which| row.numbers.number(row.of(which)))),
            Self::Measured => {
                let input = &row.step.input;
                let readings = [
                    input.engine_rad_s,
                    input.turbine_rad_s,
                    input.output_rad_s,
                    input.wheel_rad_s,
                    row.step.reported_n_m,
                    input.acceleration_m_s2,
                ];
                numbers.copy_from_slice(&readings.map(|reading| or_none(reading.map(|reading| reading.value))));
            }
            Self::MeasuredCommand(place, _) => {
                let reading = row.step.input.commands[place.min(MAX_ELEMENTS - 1)];
                numbers.fill(or_none(reading.map(|reading| reading.value)));
            }
        }
    }
}

/// The numbers of a clutch of a shift, in the order of [`CLUTCH`], without the sign of a zero. A one-way clutch has a torque alone.
fn of_clutch(clutch: &ClutchEstimate<f64>) -> [f64; CLUTCH.len()] {
    let none = f64::NAN;
    let (torque_n_m, std_dev_n_m) = (clutch.torque_n_m, clutch.std_dev_n_m);
    if !clutch.element.has_pressure() {
        return [none, none, none, torque_n_m + 0.0, none, none, none, none, none, none, std_dev_n_m + 0.0];
    }
    let [pressure, torque] =
        [clutch.pressure_range_pa, clutch.torque_range_n_m].map(|range| range.unwrap_or([none; 2]));
    let hidden = f64::from(u8::from(clutch.hidden));
    [
        clutch.pressure_pa,
        pressure[0],
        pressure[1],
        torque_n_m,
        torque[0],
        torque[1],
        clutch.valve_pa,
        clutch.open_loop_n_m,
        hidden,
        clutch.pressure_std_dev_pa,
        std_dev_n_m,
    ]
    .map(|number| number + 0.0)
}

/// The numbers of a row.
pub(crate) struct Numbers<'a> {
    /// With how many columns each has, and whether the table has one of them.
    sources: Vec<(Source<'a>, usize, bool)>,
    all: Vec<f64>,
    /// Whether the row before was of a shift, and its gears.
    before: Option<(bool, ShiftCommand)>,
    /// Those of the columns of numbers in a table, in their order.
    chosen: Vec<usize>,
}

impl Numbers<'_> {
    /// Takes those of the next row.
    pub(crate) fn take(&mut self, row: &Row<'_>) {
        let now = (row.filtered.estimate.clutches.is_some(), row.step.input.gear);
        let before = self.before.replace(now);
        let is_without_shift = before.is_some_and(|(had_clutches, _)| !had_clutches) && !now.0;
        let is_in_same_gears = before.is_some_and(|(_, gears)| gears == now.1);
        let mut rest = self.all.as_mut_slice();
        for (source, columns, is_used) in &self.sources {
            let Some((numbers, behind)) = rest.split_at_mut_checked(*columns) else { return };
            let is_same = match source {
                Source::Clutch(_) => is_without_shift,
                Source::Gears => is_in_same_gears,
                _ => false,
            };
            if *is_used && !is_same {
                source.write(row, numbers);
            }
            rest = behind;
        }
    }

    /// The number of a column.
    fn get(&self, at: usize) -> f64 {
        self.all.get(at).copied().unwrap_or(f64::NAN)
    }

    /// The numbers of the columns of the table.
    pub(crate) fn chosen(&self) -> impl Iterator<Item = f64> {
        self.chosen.iter().map(|at| self.get(*at))
    }
}

/// Where the cells of a column come from.
#[derive(Clone, Copy)]
pub(crate) enum Value {
    /// A word.
    Of(for<'a> fn(&Row<'a>) -> &'a str),
    /// A number, by its place among those of the row.
    Number(usize),
    /// What became of the reading of a channel, by its place in [`READINGS`]; after them that of [`ACCELERATION_READING`].
    Reading(usize),
    /// The same of the command of an element, by its place in the filter's tables.
    Command(usize),
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
    fn word(name: impl Into<String>, value: Value) -> Self {
        Self { name: name.into(), kind: ColumnKind::Word, value }
    }

    /// Its cell in a row with these numbers.
    pub(crate) fn cell<'a>(&self, row: &Row<'a>, numbers: &Numbers<'_>, same: Same) -> Cell<'a> {
        match self.value {
            Value::Number(at) => Cell::Number(numbers.get(at)),
            Value::Reading(_) | Value::Command(_) if same.readings => Cell::SameWord,
            Value::Of(_) if same.others => Cell::SameWord,
            Value::Of(word) => Cell::Word(word(row)),
            Value::Reading(at) => Cell::Word(row.reading(at)),
            Value::Command(place) => Cell::Word(row.filtered.estimate.commands[place.min(MAX_ELEMENTS - 1)].name()),
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

/// The columns of a table, and where its numbers come from.
#[derive(Default)]
pub(crate) struct Columns<'a> {
    pub(crate) all: Vec<Column>,
    sources: Vec<(Source<'a>, usize)>,
    numbers: usize,
}

impl<'a> Columns<'a> {
    /// The columns of a car whose elements have these places in the filter's tables.
    pub(crate) fn of(places: &[(usize, &'a str)], knows: Knows) -> Self {
        let mut columns = Self::default();
        let word = |name, word: for<'b> fn(&Row<'b>) -> &'b str| Column::word(name, Value::Of(word));
        columns.all.extend([
            word(signal::GEAR, |row| row.gear(0)),
            word(signal::TARGET_GEAR, |row| row.gear(1)),
            word(signal::PHASE, |row| row.filtered.estimate.phase.map_or("", |phase| phase.name())),
        ]);
        if knows.elements {
            columns.all.extend([word(ROLES[0], |row| row.element(0)), word(ROLES[1], |row| row.element(1))]);
            columns.push_numbers([0, 1].map(Source::Clutch));
        }
        columns.push_numbers([Source::Torques(knows)]);
        columns.push_numbers(places.iter().map(|&(place, name)| Source::Element(place, name)));
        columns.all.push(word(signal::HEALTH, |row| row.filtered.estimate.health.name()));
        columns.push_numbers([Source::Gears]);
        columns.all.extend(readings(places, knows));
        columns
    }

    /// With the columns of the readings of a car, whose elements' commands have these names.
    pub(crate) fn push_measured(&mut self, commands: &'a [(usize, String)], tables: &ShiftTables<f64>) {
        let command =
            |(at, name): &'a (usize, String)| Some(Source::MeasuredCommand(tables.place(*at)?, name.as_str()));
        self.push_numbers(std::iter::once(Source::Measured).chain(commands.iter().filter_map(command)));
    }

    fn push_numbers(&mut self, sources: impl IntoIterator<Item = Source<'a>>) {
        for source in sources {
            let names = source.names();
            self.sources.push((source, names.len()));
            for name in names {
                self.all.push(Column { name, kind: ColumnKind::Number, value: Value::Number(self.numbers) });
                self.numbers += 1;
            }
        }
    }

    /// Those of these names, in their order.
    ///
    /// # Errors
    /// There is no such column, or one is named twice.
    pub(crate) fn choose(&mut self, names: &[String]) -> Result<(), Error> {
        let mut chosen = Vec::new();
        for name in names.iter().map(|name| name.trim()).filter(|name| *name != signal::TIME) {
            let Some(at) = self.all.iter().position(|column| column.name == name) else {
                let known: Vec<&str> = self.all.iter().map(|column| column.name.as_str()).collect();
                return Err(no_column(name, &known, chosen.iter().any(|column: &Column| column.name == name)));
            };
            chosen.push(self.all.remove(at));
        }
        self.all = chosen;
        Ok(())
    }

    /// The columns, and the numbers of a row.
    pub(crate) fn split(self) -> (Vec<Column>, Numbers<'a>) {
        let place = |column: &Column| if let Value::Number(at) = column.value { Some(at) } else { None };
        let chosen: Vec<usize> = self.all.iter().filter_map(place).collect();
        let mut begin = 0;
        let sources = self.sources.into_iter().map(|(source, columns)| {
            let places = begin..begin + columns;
            begin = places.end;
            (source, columns, chosen.iter().any(|at| places.contains(at)))
        });
        let sources = sources.collect();
        (self.all, Numbers { sources, all: vec![f64::NAN; self.numbers], before: None, chosen })
    }
}

/// What became of the reading of each channel, and of the command of each element.
fn readings(places: &[(usize, &str)], knows: Knows) -> Vec<Column> {
    let is_command = |name: &str| [OFFGOING_COMMAND_READING, ONCOMING_COMMAND_READING].contains(&name);
    let channels = READINGS.iter().enumerate().filter(|(_, name)| knows.elements || !is_command(name));
    let channels = channels.map(|(at, name)| Column::word(*name, Value::Reading(at)));
    let command = |(place, name): &(usize, &str)| {
        Column::word(format!("{}_{COMMAND_READING}", element_column(name)), Value::Command(*place))
    };
    let acceleration = knows.acceleration.then(|| Column::word(ACCELERATION_READING, Value::Reading(READINGS.len())));
    channels.chain(acceleration).chain(places.iter().map(command)).collect()
}

/// The measured channels that an estimate may have too.
const MEASURED: [&str; 6] = [
    signal::ENGINE_SPEED,
    signal::TURBINE_SPEED,
    signal::OUTPUT_SPEED,
    signal::WHEEL_SPEED,
    signal::REPORTED_ENGINE_TORQUE,
    signal::LONGITUDINAL_ACCELERATION,
];

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
        Columns::of(&[], Knows { converter, elements, acceleration: true }).all.iter().any(|column| column.name == name)
    };
    [[true, true], [false, true], [true, false]].into_iter().any(is_one)
        || ELEMENT.into_iter().chain([COMMAND_READING]).any(of_element)
}
