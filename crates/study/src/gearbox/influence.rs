//! What the values of a car with a gearbox may do to an estimate of its shifts.
//!
//! The car makes every shift between neighbouring gears. What its sensors read is estimated with its file, and again with each value
//! changed by its stated uncertainty, one way and the other.

use car::{Car, ElementErrors, ErrorBudget, Sensors, ShiftClutch};
use config::CarFile;
use drivetrain::Table1;

use super::matrix::controlling_of;
use super::nominal::{NominalShift, nominal_shifts};
use super::{EvaluateError, SquaredErrors, TruePhase};
use crate::StudyError;

/// Where a value of a car stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ValueFrom {
    /// In the vehicle file, at least for one element.
    File,
    /// Nowhere: it is a default.
    Default,
    /// In the gearbox file.
    Gearbox,
}

/// By how much a value may be off, either way.
enum Off {
    /// By a fraction of it.
    Fraction(f64),
    /// By the fraction that the bounds of the car allow.
    Car(fn(&ErrorBudget) -> f64),
    /// Between the factors that the bounds of each element allow.
    Element(fn(&ElementErrors) -> [f64; 2]),
}

/// What a factor does.
enum Change {
    /// To the car.
    Car(fn(&mut Car, f64)),
    /// To each of its friction elements.
    Element(fn(&mut ShiftClutch, f64)),
}

/// What is changed of a car.
struct Value {
    /// Its key in the vehicle file or the gearbox file.
    key: &'static str,
    in_gearbox: bool,
    off: Off,
    change: Change,
}

impl Value {
    const fn of_car(key: &'static str, off: Off, change: Change) -> Self {
        Self { key, in_gearbox: false, off, change }
    }

    const fn of_gearbox(key: &'static str, off: Off, change: Change) -> Self {
        Self { key, in_gearbox: true, off, change }
    }

    fn from(&self, car: &CarFile) -> ValueFrom {
        match self.in_gearbox {
            true => ValueFrom::Gearbox,
            false if car.defaults_taken.iter().any(|taken| taken.key == self.key) => ValueFrom::Default,
            false => ValueFrom::File,
        }
    }

    /// Minimum and maximum factor on the value of an element, by its place in the gearbox. Those of a car do not depend on it.
    fn limits(&self, car: &Car, element: usize) -> [f64; 2] {
        match self.off {
            Off::Fraction(fraction) => around(fraction),
            Off::Car(relative) => around(relative(&ErrorBudget::of_car(car))),
            Off::Element(factors) => ErrorBudget::of_car(car).element(element).map_or([1.0; 2], factors),
        }
    }

    /// Minimum and maximum factor of all elements.
    fn widest_limits(&self, car: &Car) -> [f64; 2] {
        let elements = (0..car.clutches.len()).filter(|&element| car.clutches[element].is_some());
        let widest = |[low, high]: [f64; 2], [minimum, maximum]: [f64; 2]| [low.min(minimum), high.max(maximum)];
        elements.map(|element| self.limits(car, element)).reduce(widest).unwrap_or(self.limits(car, 0))
    }

    /// The car with the value at its minimum (`end` 0) or maximum limit (1).
    fn changed(&self, car: &Car, end: usize) -> Car {
        let mut changed = car.clone();
        match self.change {
            Change::Car(change) => change(&mut changed, self.limits(car, 0)[end]),
            Change::Element(change) => {
                for (element, clutch) in changed.clutches.iter_mut().enumerate() {
                    clutch.iter_mut().for_each(|clutch| change(clutch, self.limits(car, element)[end]));
                }
            }
        }
        changed
    }
}

const fn around(fraction: f64) -> [f64; 2] {
    [1.0 - fraction, 1.0 + fraction]
}

/// What an estimate may depend on, with its uncertainty: what the filter's bounds allow, which are those of the file where it has its
/// own, or what differs between cars of one size and between data sheet and car \[chosen\].
const VALUES: [Value; 14] = [
    Value::of_gearbox(
        "element.pack.friction_coefficient",
        Off::Element(|errors| errors.friction_factor),
        Change::Element(|element, factor| {
            element.clutch.friction = element.clutch.friction.scaled(factor);
            element.clutch.static_friction *= factor;
        }),
    ),
    Value::of_gearbox(
        "element.pack.piston_area_m2",
        Off::Fraction(0.2),
        Change::Element(|element, factor| element.clutch.piston_area_m2 *= factor),
    ),
    Value::of_gearbox(
        "element.pack.mean_radius_m",
        Off::Fraction(0.1),
        Change::Element(|element, factor| element.clutch.mean_radius_m *= factor),
    ),
    Value::of_gearbox(
        "element.pack.return_spring_n",
        Off::Fraction(0.3),
        Change::Element(|element, factor| element.clutch.return_spring_n *= factor),
    ),
    Value::of_gearbox("turbine_inertia_kg_m2", Off::Car(|errors| errors.inertia), Change::Car(scale_inertia)),
    Value::of_car(
        "valve.gain.gain_pa_a",
        Off::Element(|errors| errors.valve_gain_factor),
        Change::Element(|element, factor| element.valve = element.valve.changed(1.0, factor, None)),
    ),
    Value::of_car(
        "valve.lag.time_constant_s",
        Off::Element(|errors| errors.valve_lag_factor),
        Change::Element(|element, factor| element.valve = element.valve.changed(factor, 1.0, None)),
    ),
    Value::of_car("converter.capacity_n_m_s2", Off::Car(|errors| errors.converter), Change::Car(scale_capacity)),
    Value::of_car("converter.torque_ratio", Off::Fraction(0.1), Change::Car(scale_torque_ratio)),
    Value::of_car(
        "engine.inertia_kg_m2",
        Off::Fraction(0.2),
        Change::Car(|car, factor| car.engine.inertia_kg_m2 *= factor),
    ),
    Value::of_car(
        "driveline.shaft_stiffness_n_m_rad",
        Off::Car(|errors| errors.stiffness),
        Change::Car(|car, factor| car.driveline.shaft_stiffness_n_m_rad *= factor),
    ),
    Value::of_car(
        "driveline.shaft_damping_n_m_s_rad",
        Off::Fraction(0.5),
        Change::Car(|car, factor| car.driveline.shaft_damping_n_m_s_rad *= factor),
    ),
    Value::of_car(
        "driveline.wheel_inertia_kg_m2",
        Off::Fraction(0.2),
        Change::Car(|car, factor| car.driveline.wheel_inertia_kg_m2 *= factor),
    ),
    Value::of_car("vehicle.mass_kg", Off::Fraction(0.15), Change::Car(|car, factor| car.road.mass_kg *= factor)),
];

fn scale_inertia(car: &mut Car, factor: f64) {
    for reduced in car.gearbox.shifts.iter_mut().filter_map(|shift| shift.reduced.as_mut()) {
        reduced.mass_kg_m2[0][0] *= factor;
    }
}

fn scale_capacity(car: &mut Car, factor: f64) {
    if let Some(converter) = &mut car.converter {
        converter.capacity_n_m_s2 = converter.capacity_n_m_s2.scaled(factor);
    }
}

/// At the coupling point the torque ratio is 1.
fn scale_torque_ratio(car: &mut Car, factor: f64) {
    if let Some(converter) = &mut car.converter {
        let given = converter.torque_ratio;
        let ratios: Vec<f64> = given.values().iter().map(|ratio| 1.0 + factor * (ratio - 1.0)).collect();
        converter.torque_ratio = Table1::new(given.axis(), &ratios).unwrap_or(given);
    }
}

/// Root mean square errors of the clutch that drives the inertia phase, while it slips in torque and inertia phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorOfEstimate {
    /// Of the torque by the filter and by the valve model alone, N m.
    pub torque_n_m: [f64; 2],
    /// Of the pressure by the filter and by the valve model alone, Pa.
    pub pressure_pa: [f64; 2],
}

/// What a value may do to the estimates.
#[derive(Debug, Clone, PartialEq)]
pub struct CarInfluence {
    /// Its key.
    pub key: &'static str,
    /// Where it stands.
    pub from: ValueFrom,
    /// Minimum and maximum factor on it; where each element has its own, those of all of them.
    pub limits: [f64; 2],
    /// The errors at the limit with the greater error of the filter's torque.
    pub errors: ErrorOfEstimate,
}

/// The errors of a car's estimates, and what its values may do to them.
#[derive(Debug, Clone, PartialEq)]
pub struct CarInfluences {
    /// Number of shifts in which the clutch slips.
    pub shifts: usize,
    /// With all values as they are: of the sensors and of the filter itself.
    pub as_it_is: ErrorOfEstimate,
    /// By value, the largest error of the filter's torque first.
    pub values: Vec<CarInfluence>,
}

/// What each value may do to the estimates of the shifts between neighbouring gears; `None` if the filter has tables for none of them.
///
/// # Errors
/// A shift of the car cannot be simulated, or the gearbox has more clutches than the filter has room for.
pub fn car_influences(car: &CarFile, sensors: &Sensors) -> Result<Option<CarInfluences>, StudyError> {
    let shifts = nominal_shifts(car, sensors)?;
    if shifts.is_empty() {
        return Ok(None);
    }
    let (count, as_it_is) = errors(car, sensors, &shifts)?;
    let mut values = Vec::new();
    for value in &VALUES {
        if value.key.starts_with("converter.") && car.converter.is_none() {
            continue;
        }
        let at = |end: usize| errors(&value.changed(car, end), sensors, &shifts);
        let [(_, low), (_, high)] = [at(0)?, at(1)?];
        let errors = if low.torque_n_m[0] > high.torque_n_m[0] { low } else { high };
        values.push(CarInfluence { key: value.key, from: value.from(car), limits: value.widest_limits(car), errors });
    }
    values.sort_by(|one, other| other.errors.torque_n_m[0].total_cmp(&one.errors.torque_n_m[0]));
    Ok(Some(CarInfluences { shifts: count, as_it_is, values }))
}

/// The errors of the estimates with this file over the shifts, and in how many of them the clutch slips.
fn errors(file: &Car, sensors: &Sensors, shifts: &[NominalShift]) -> Result<(usize, ErrorOfEstimate), EvaluateError> {
    let [mut torque, mut pressure] = [SquaredErrors::default(); 2];
    let mut slipping = 0;
    let budget = ErrorBudget::of_car(file).read_by(file, Some(sensors));
    for nominal in shifts {
        let rows = nominal.estimated(file, sensors, &budget, &nominal.inputs)?;
        let clutch = controlling_of(&rows, nominal.shift.kind);
        let before = torque.rows;
        for phase in [TruePhase::Torque, TruePhase::Inertia] {
            torque.add(&SquaredErrors::of(&rows, phase, clutch));
            pressure.add(&SquaredErrors::of_pressure(&rows, phase, clutch));
        }
        slipping += usize::from(torque.rows > before);
    }
    Ok((slipping, ErrorOfEstimate { torque_n_m: torque.rms_n_m(), pressure_pa: pressure.rms_pa() }))
}
