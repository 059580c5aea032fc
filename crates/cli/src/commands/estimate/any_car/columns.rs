//! The columns of an estimate of a car with any gearbox.

use config::Car;
use observer::any_shift::{MAX_ELEMENTS, ONE_WAY, ShiftEstimate};
use study::any_shift::logged::element_column;
use trace::{Cell, ColumnKind};

use crate::failure::Failure;

/// What a row of the estimate is made from.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    pub(super) car: &'a Car,
    pub(super) places: &'a [(usize, &'a str)],
    pub(super) gears: [usize; 2],
    pub(super) estimate: ShiftEstimate<f64>,
    /// Guaranteed ranges of the pressures of the elements, Pa.
    pub(super) ranges_pa: [Option<[f64; 2]>; MAX_ELEMENTS],
}

impl<'a> Row<'a> {
    fn gear(&self, which: usize) -> Cell<'a> {
        Cell::Word(self.car.gearbox.gears.get(self.gears[which]).map_or("", |gear| gear.name.as_str()))
    }

    fn element(&self, which: usize) -> Cell<'a> {
        let place = self.estimate.clutches.map(|clutches| clutches[which].element);
        if place == Some(ONE_WAY) {
            return Cell::Word(self.one_way(which));
        }
        let named = self.places.iter().find(|(known, _)| Some(*known) == place);
        Cell::Word(named.map_or("", |(_, name)| *name))
    }

    /// The one-way clutch of the shift.
    fn one_way(&self, which: usize) -> &'a str {
        let gearbox = &self.car.gearbox;
        let [from, to] = self.estimate.gear.map_or(self.gears, |gear| [gear.from, gear.to]);
        let single = gearbox.shift(from, to).and_then(|shift| shift.change.single());
        let element = single.and_then(|elements| gearbox.elements.get(elements[which]));
        element.map_or("", |element| element.name.as_str())
    }

    /// Pressure, torque, their ranges, both by the valve model, and whether the speeds show nothing, in the order of [`CLUTCH`].
    fn clutch(&self, which: usize, what: usize) -> f64 {
        let Some(clutch) = self.estimate.clutches.map(|clutches| clutches[which]) else { return f64::NAN };
        if clutch.element == ONE_WAY && what != TORQUE {
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
            _ => f64::from(u8::from(clutch.hidden)),
        }
    }

    /// The same without the sign of a zero.
    fn clutch_cell(&self, which: usize, what: usize) -> Cell<'a> {
        Cell::Number(self.clutch(which, what) + 0.0)
    }
}

/// The columns of a clutch, after `offgoing_` or `oncoming_`.
const CLUTCH: [&str; 9] = [
    "pressure_estimate_pa",
    "pressure_least_pa",
    "pressure_greatest_pa",
    "torque_estimate_n_m",
    "torque_least_n_m",
    "torque_greatest_n_m",
    "valve_model_pressure_pa",
    "valve_model_torque_n_m",
    "hidden",
];
/// The place of the torque among them.
const TORQUE: usize = 3;
/// The columns of an element, after its name: those of [`CLUTCH`] that its command alone gives.
const ELEMENT: [&str; 3] = [CLUTCH[6], CLUTCH[1], CLUTCH[2]];
const ROLES: [&str; 2] = ["offgoing", "oncoming"];

/// Where the cells of a column come from.
#[derive(Clone, Copy)]
pub(super) enum Value {
    Of(for<'a> fn(&Row<'a>) -> Cell<'a>),
    Clutch(usize, usize),
    /// Pressure of an element by its valve model, by its place in the filter's tables.
    Valve(usize),
    /// An end of the range of that pressure.
    Range(usize, usize),
}

impl Value {
    pub(super) fn cell<'a>(self, row: &Row<'a>) -> Cell<'a> {
        match self {
            Self::Of(value) => value(row),
            Self::Clutch(which, what) => row.clutch_cell(which, what),
            Self::Valve(place) => Cell::Number(row.estimate.valve_pa[place.min(MAX_ELEMENTS - 1)]),
            Self::Range(place, end) => of(row.ranges_pa[place.min(MAX_ELEMENTS - 1)].map(|range| range[end] + 0.0)),
        }
    }
}

/// A column of the estimate.
pub(super) struct Column {
    pub(super) name: String,
    pub(super) kind: ColumnKind,
    pub(super) value: Value,
}

/// The columns of a car whose elements have these places in the filter's tables, with a converter or without.
pub(super) fn columns(places: &[(usize, &str)], has_converter: bool) -> Vec<Column> {
    let word = |name: &str, value: for<'a> fn(&Row<'a>) -> Cell<'a>| Column {
        name: name.to_owned(),
        kind: ColumnKind::Word,
        value: Value::Of(value),
    };
    let number = |name: String, value: Value| Column { name, kind: ColumnKind::Number, value };
    let mut columns = vec![
        word(trace::signal::GEAR, |row| row.gear(0)),
        word(trace::signal::TARGET_GEAR, |row| row.gear(1)),
        word(trace::signal::PHASE, |row| Cell::Word(row.estimate.phase.map_or("", |phase| phase.name()))),
        word(ROLES[0], |row| row.element(0)),
        word(ROLES[1], |row| row.element(1)),
    ];
    for (which, role) in ROLES.iter().enumerate() {
        let named = CLUTCH.iter().enumerate();
        columns.extend(named.map(|(what, name)| number(format!("{role}_{name}"), Value::Clutch(which, what))));
    }
    columns.push(number("turbine_torque_estimate_n_m".to_owned(), Value::Of(|row| of(row.estimate.turbine_n_m))));
    columns.push(number(trace::signal::SHAFT_ESTIMATE.to_owned(), Value::Of(|row| of(row.estimate.shaft_n_m))));
    let clutch = if has_converter { "lock_up" } else { "launch_clutch" };
    columns.push(number(
        format!("{clutch}_torque_estimate_n_m"),
        Value::Of(|row| of(row.estimate.input_clutch.map(|clutch| clutch.torque_n_m))),
    ));
    columns.push(number(
        format!("{clutch}_torque_deviation_n_m"),
        Value::Of(|row| of(row.estimate.input_clutch.map(|clutch| clutch.deviation_n_m))),
    ));
    for (place, name) in places {
        let values = [Value::Valve(*place), Value::Range(*place, 0), Value::Range(*place, 1)];
        columns.extend(
            ELEMENT.iter().zip(values).map(|(what, value)| number(format!("{}_{what}", element_column(name)), value)),
        );
    }
    columns.push(word(trace::signal::HEALTH, |row| Cell::Word(row.estimate.health.name())));
    columns
}

/// Whether the estimate of some car may have a column of this name.
pub(in crate::commands::estimate) fn is_car_column(name: &str) -> bool {
    let of_element = |what: &str| {
        let rest = name.strip_suffix(what).and_then(|rest| rest.strip_suffix('_'));
        rest.is_some_and(|rest| rest.starts_with("element_"))
    };
    let is_one = |with: bool| columns(&[], with).iter().any(|column| column.name == name);
    is_one(true) || is_one(false) || ELEMENT.into_iter().any(of_element)
}

fn of(value: Option<f64>) -> Cell<'static> {
    Cell::Number(value.unwrap_or(f64::NAN))
}

/// The columns of these names in their order, or all.
pub(super) fn chosen(mut all: Vec<Column>, names: &[String]) -> Result<Vec<Column>, Failure> {
    if names.is_empty() {
        return Ok(all);
    }
    let mut chosen = Vec::new();
    for name in names.iter().map(|name| name.trim()).filter(|name| *name != trace::signal::TIME) {
        let Some(at) = all.iter().position(|column| column.name == name) else {
            let known: Vec<&str> = all.iter().map(|column| column.name.as_str()).collect();
            return Err(Failure::Input(format!(
                "--columns: there is no column `{}`, or it is there twice\nhint: the other columns are {}",
                name.escape_debug(),
                known.join(", ")
            )));
        };
        chosen.push(all.remove(at));
    }
    Ok(chosen)
}
