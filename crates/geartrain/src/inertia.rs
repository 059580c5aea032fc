//! Inertias of shafts that are seldom meant: most often a slip of the unit.
//!
//! What turns with a shaft is known from the stick diagram, so its inertia is compared with the sum of what such parts usually have
//! \[chosen\]: the table of the shipped gearbox files, whose parts are of the size of published ones (ring and carrier 0.002 kg m^2). It
//! grows with the torque, as in files that are sized for an engine: radii by the third root of it, inertia by `m r^2`.

use drivetrain::Real;

use crate::description::StickDiagram;
use crate::finding::{Fault, Finding, Part};
use crate::train::{Connection, GearTrain, Member};

/// Inertia of the parts of a gearbox for a turbine torque of [`TORQUE_N_M`], kg m^2.
const SUN: f64 = 0.0005;
const RING: f64 = 0.0020;
const CARRIER: f64 = 0.0025;
const CLUTCH_SIDE: f64 = 0.0030;
const GEAR: f64 = 0.0020;
const TURBINE: f64 = 0.06;
const OUTPUT: f64 = 0.05;
/// On top of the output where a gear pair drives it: the differential is inside.
const DIFFERENTIAL: f64 = 0.10;

/// Turbine torque of the parts above, N m, and the largest mean radius of their plates, m.
const TORQUE_N_M: f64 = 400.0;
const RADIUS_M: f64 = 0.095;

/// A part may have so many times its usual inertia, or that fraction of it \[chosen\]. Ten times is questioned wherever the true value is
/// within twice the usual one.
const FACTOR: f64 = 5.0;
/// The same where the file has neither torque nor plates: of gearboxes for 20 to 2000 N m.
const FACTOR_OF_ANY_SIZE: f64 = 50.0;

/// Units that inertias are given in, the likely ones first, and what one of them is, kg m^2.
const UNITS: [(&str, f64); 6] = [
    ("g m2", 1e-3),
    ("kg cm2", 1e-4),
    ("kg mm2", 1e-6),
    ("g cm2", 1e-7),
    ("lb ft2", 0.042_140),
    ("lb in2", 2.926_4e-4),
];

/// The shafts whose inertia is far from that of their parts.
pub(crate) fn check(diagram: &StickDiagram, train: &GearTrain) -> Vec<Finding> {
    let (size, factor) = size(diagram).map_or((1.0, FACTOR_OF_ANY_SIZE), |size| (size, FACTOR));
    let of_shaft = |(at, usual): (usize, f64)| {
        let (value, usual) = (train.shafts[at].inertia_kg_m2, size * usual);
        let range = [usual / factor, usual * factor];
        let fault = Fault::Inertia { value, range, unit: unit(value, range) };
        let is_usual = (range[0]..=range[1]).contains(&value);
        (!is_usual).then_some(Finding { part: Part::Shaft(at), key: "inertia_kg_m2", fault })
    };
    usual(train).into_iter().enumerate().filter_map(of_shaft).collect()
}

/// How much larger the gearbox is than that of the table, by its torque or its plates; `None` where the file has neither.
fn size(diagram: &StickDiagram) -> Option<f64> {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
    let by_torque = largest(&mut diagram.gears.iter().filter_map(|gear| gear.turbine_max_n_m));
    let by_radius = || largest(&mut diagram.elements.iter().filter_map(|element| Some(element.pack?.mean_radius_m)));
    by_torque.map(|torque| torque / TORQUE_N_M).or_else(|| by_radius().map(|radius| Real::powi(radius / RADIUS_M, 3)))
}

/// Usual inertia of each shaft, kg m^2.
fn usual(train: &GearTrain) -> Vec<f64> {
    let sets = train.sets.iter().flat_map(|set| [(set.sun, SUN), (set.ring, RING), (set.carrier, CARRIER)]);
    let gears =
        train.pairs.iter().flat_map(|pair| [pair.driver, pair.driven].map(|shaft| (Member::Shaft(shaft), GEAR)));
    let sides = train.elements.iter().flat_map(|element| match element.connection {
        Connection::Sides(input, output) => vec![(input, CLUTCH_SIDE), (output, CLUTCH_SIDE)],
        Connection::Pair(_) => Vec::new(),
    });
    let differential = if train.pairs.iter().any(|pair| pair.driven == train.output) { DIFFERENTIAL } else { 0.0 };
    let ends = [(train.input, TURBINE), (train.output, OUTPUT + differential)];
    let ends = ends.map(|(shaft, inertia)| (Member::Shaft(shaft), inertia));
    let mut usual = vec![0.0; train.shafts.len()];
    for (member, inertia) in sets.chain(gears).chain(sides).chain(ends) {
        if let Member::Shaft(shaft) = member {
            usual[shaft] += inertia;
        }
    }
    usual
}

/// The first unit in which the number is a usual inertia, with what it is in kg m^2; `None` where there is none.
fn unit(value: f64, [lower, upper]: [f64; 2]) -> Option<(&'static str, f64)> {
    let converted = UNITS.map(|(unit, kg_m2)| (unit, value * kg_m2));
    converted.into_iter().find(|(_, inertia)| (lower..=upper).contains(inertia))
}
