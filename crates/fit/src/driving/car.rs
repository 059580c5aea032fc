//! What driving in a gear needs of a car.

use car::Vehicle;
use drivetrain::{Converter, Driveline, RoadLoad, Tyre};
use observer::ShiftTables;
use observer::gearbox::MAX_ELEMENTS;

use super::Term;
use crate::shape::{Knots, Map};

/// Numbers of the shape of the converter's capacity that driving sees: the freed ones and the finer ones.
pub(crate) const CAPACITIES: usize = 4;

/// A car in its gears.
#[derive(Debug, Clone)]
pub(crate) struct DrivenCar {
    pub(crate) gears: Vec<DrivenGear>,
    pub(crate) converter: Option<Converter<f64>>,
    pub(crate) engine_inertia_kg_m2: f64,
    pub(crate) driveline: Driveline<f64>,
    pub(crate) road: RoadLoad<f64>,
    pub(crate) tyre: Tyre<f64>,
    /// Elements with a drag by their places in the gearbox and in the tables.
    pub(crate) elements: Vec<(usize, usize)>,
    /// Where the capacity of the converter can have another shape.
    knots: Option<Knots>,
}

/// A gear.
#[derive(Debug, Clone)]
pub(crate) struct DrivenGear {
    /// Turbine over output speed.
    pub(crate) ratio: f64,
    /// Inertia of the gearbox at its output, kg m^2; not a number where it is not known.
    pub(crate) inertia_kg_m2: f64,
    /// Parts of it that are terms, kg m^2.
    pub(crate) parts: Vec<(Term, f64)>,
    /// The elements that are open.
    pub(crate) open: Vec<OpenElement>,
}

/// An element that is open in a gear.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OpenElement {
    /// Its place in the gearbox.
    pub(crate) at: usize,
    /// Slip per turbine speed.
    pub(crate) slip: f64,
    /// Peak of the drag, N m.
    pub(crate) drag_n_m: f64,
}

impl DrivenGear {
    /// Whether a car can be seen driving in it.
    pub(crate) fn is_known(&self) -> bool {
        self.ratio > 0.0 && self.inertia_kg_m2.is_finite()
    }
}

impl DrivenCar {
    /// A car with a gearbox. The inertia of each gear has one part: that of the first shift to or from it, as the `M11` of a pair of gears
    /// whose place `pair` knows.
    pub(crate) fn with_gearbox(
        car: &car::Car,
        tables: &ShiftTables<f64>,
        pair: &dyn Fn(usize, usize) -> Option<usize>,
    ) -> Self {
        let elements = (0..car.clutches.len().min(MAX_ELEMENTS)).filter_map(|at| Some((at, tables.place(at)?)));
        let rows = tables.tables();
        let gears = rows.gears.iter().enumerate().map(|(at, gear)| {
            let row = rows.shifts.iter().find(|row| row.from == at || row.to == at);
            let part = row.and_then(|row| {
                Some((Term::Inertia(pair(row.from, row.to)?), gear.ratio * gear.ratio * row.mass_kg_m2[0][0]))
            });
            let open = open_elements(car, at);
            DrivenGear {
                ratio: car.gearbox.gears.get(at).map_or(gear.ratio, |gear| gear.ratio),
                inertia_kg_m2: if open.is_some() { gear.inertia_kg_m2 } else { f64::NAN },
                parts: part.into_iter().collect(),
                open: open.unwrap_or_default(),
            }
        });
        Self {
            gears: gears.collect(),
            converter: car.converter,
            engine_inertia_kg_m2: car.engine.inertia_kg_m2,
            driveline: car.driveline,
            road: car.road,
            tyre: car.tyre,
            elements: elements.collect(),
            knots: None,
        }
    }

    /// A car whose file has one shift: the gears before and after it. `shafts` are what the shafts of its gear train add to the mass matrix
    /// of the shift, in their order.
    pub(crate) fn of_shift(vehicle: &Vehicle, shafts: &[[[f64; 2]; 2]]) -> Self {
        let gear = |ratio: f64| {
            let at_output = |mass: &[[f64; 2]; 2]| ratio * (ratio * mass[0][0] + mass[0][1] + mass[1][0]) + mass[1][1];
            let parts = shafts.iter().enumerate().map(|(at, mass)| (Term::Inertia(at), at_output(mass)));
            let inertia_kg_m2 = at_output(&vehicle.shift.mass_kg_m2);
            DrivenGear { ratio, inertia_kg_m2, parts: parts.collect(), open: Vec::new() }
        };
        Self {
            gears: [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()].map(gear).into(),
            converter: Some(vehicle.converter),
            engine_inertia_kg_m2: vehicle.engine.inertia_kg_m2,
            driveline: vehicle.driveline,
            road: vehicle.road,
            tyre: vehicle.tyre,
            elements: Vec::new(),
            knots: Some(Knots::of(vehicle)),
        }
    }

    /// Relative change of the capacity at a speed ratio for each number of its shape that changes by 1.
    pub(crate) fn capacity_changes(&self, speed_ratio: f64) -> [f64; CAPACITIES] {
        std::array::from_fn(|number| {
            self.knots.map_or(0.0, |knots| knots.change_at(Map::Capacity, number, speed_ratio))
        })
    }
}

/// The elements that are open in a gear; none where the gear train is not known.
fn open_elements(car: &car::Car, gear: usize) -> Option<Vec<OpenElement>> {
    let train = car.gearbox.train.as_ref()?;
    let gear = car.gearbox.gears.get(gear)?;
    let is_held = |at: usize| gear.holding.iter().any(|holding| holding.element == at);
    let elements = car.clutches.iter().enumerate().take(MAX_ELEMENTS).filter(|(at, _)| !is_held(*at));
    let slipping = elements.filter_map(|(at, clutch)| {
        let row = train.slip_row(at);
        // An idle shaft turns as it likes, and nothing is known of its drag.
        let turned = row.iter().zip(&gear.shaft_speeds).filter(|(factor, _)| **factor != 0.0);
        let slip = turned.map(|(factor, speed)| speed.map(|speed| factor * speed)).sum::<Option<f64>>()?;
        Some(OpenElement { at, slip, drag_n_m: clutch.as_ref()?.drag_n_m })
    });
    Some(slipping.collect())
}
