//! What the values of a car with a gearbox may do to an estimate of its shifts.
//!
//! The car makes every shift between neighbouring gears. What its sensors read is estimated with its file, and again with each value
//! changed by its stated uncertainty, one way and the other.

use config::{Car, Sensors, ShiftClutch};
use design::ShiftErrors;
use drivetrain::Table1;

use super::matrix::controlling;
use super::nominal::{NominalShift, nominal_shifts};
use super::{AnyShiftError, SquaredErrors, TruePhase};
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

/// What is changed of a car.
struct Value {
    /// Its key in the vehicle file or the gearbox file.
    key: &'static str,
    in_gearbox: bool,
    /// Factors on it.
    limits: [f64; 2],
    /// The car with the value times a factor.
    change: fn(&mut Car, f64),
}

impl Value {
    const fn of_car(key: &'static str, limits: [f64; 2], change: fn(&mut Car, f64)) -> Self {
        Self { key, in_gearbox: false, limits, change }
    }

    const fn of_gearbox(key: &'static str, limits: [f64; 2], change: fn(&mut Car, f64)) -> Self {
        Self { key, in_gearbox: true, limits, change }
    }

    fn from(&self, car: &Car) -> ValueFrom {
        match self.in_gearbox {
            true => ValueFrom::Gearbox,
            false if car.defaults_taken.iter().any(|taken| taken.key == self.key) => ValueFrom::Default,
            false => ValueFrom::File,
        }
    }
}

/// Limits of the errors of a car in series.
const ERRORS: ShiftErrors = ShiftErrors::STANDARD;

const fn around(share: f64) -> [f64; 2] {
    [1.0 - share, 1.0 + share]
}

/// What an estimate may depend on, with its uncertainty: that of [`ShiftErrors::STANDARD`], or what differs between cars of one size and
/// between data sheet and car \[chosen\].
const VALUES: [Value; 14] = [
    Value::of_gearbox("element.pack.friction_coefficient", around(ERRORS.friction), |car, factor| {
        each(car, |clutch| {
            clutch.clutch.friction = clutch.clutch.friction.scaled(factor);
            clutch.clutch.static_friction *= factor;
        });
    }),
    Value::of_gearbox("element.pack.piston_area_m2", around(0.2), |car, factor| {
        each(car, |clutch| clutch.clutch.piston_area_m2 *= factor);
    }),
    Value::of_gearbox("element.pack.mean_radius_m", around(0.1), |car, factor| {
        each(car, |clutch| clutch.clutch.mean_radius_m *= factor);
    }),
    Value::of_gearbox("element.pack.return_spring_n", around(0.3), |car, factor| {
        each(car, |clutch| clutch.clutch.return_spring_n *= factor);
    }),
    Value::of_gearbox("turbine_inertia_kg_m2", around(ERRORS.inertia), |car, factor| {
        for reduced in car.gearbox.shifts.iter_mut().filter_map(|shift| shift.reduced.as_mut()) {
            reduced.mass_kg_m2[0][0] *= factor;
        }
    }),
    Value::of_car("valve.gain.gain_pa_a", around(ERRORS.valve_gain), |car, factor| {
        each(car, |clutch| clutch.valve = clutch.valve.changed(1.0, factor, None));
    }),
    Value::of_car("valve.lag.time_constant_s", around(ERRORS.valve_lag), |car, factor| {
        each(car, |clutch| clutch.valve = clutch.valve.changed(factor, 1.0, None));
    }),
    Value::of_car("converter.capacity_n_m_s2", around(ERRORS.converter), |car, factor| {
        if let Some(converter) = &mut car.converter {
            converter.capacity_n_m_s2 = converter.capacity_n_m_s2.scaled(factor);
        }
    }),
    Value::of_car("converter.torque_ratio", around(0.1), |car, factor| {
        if let Some(converter) = &mut car.converter {
            // At the coupling point the torque ratio is 1.
            let given = converter.torque_ratio;
            let ratios: Vec<f64> = given.values().iter().map(|ratio| 1.0 + factor * (ratio - 1.0)).collect();
            converter.torque_ratio = Table1::new(given.axis(), &ratios).unwrap_or(given);
        }
    }),
    Value::of_car("engine.inertia_kg_m2", around(0.2), |car, factor| car.engine.inertia_kg_m2 *= factor),
    Value::of_car("driveline.shaft_stiffness_n_m_rad", around(ERRORS.stiffness), |car, factor| {
        car.driveline.shaft_stiffness_n_m_rad *= factor;
    }),
    Value::of_car("driveline.shaft_damping_n_m_s_rad", around(0.5), |car, factor| {
        car.driveline.shaft_damping_n_m_s_rad *= factor;
    }),
    Value::of_car("driveline.wheel_inertia_kg_m2", around(0.2), |car, factor| {
        car.driveline.wheel_inertia_kg_m2 *= factor;
    }),
    Value::of_car("vehicle.mass_kg", around(0.15), |car, factor| car.road.mass_kg *= factor),
];

fn each(car: &mut Car, change: impl FnMut(&mut ShiftClutch)) {
    car.clutches.iter_mut().flatten().for_each(change);
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
    /// The factors on it.
    pub limits: [f64; 2],
    /// The errors at the limit with the greater error of the filter's torque.
    pub errors: ErrorOfEstimate,
}

/// The errors of a car's estimates, and what its values may do to them.
#[derive(Debug, Clone, PartialEq)]
pub struct CarInfluences {
    /// Number of shifts.
    pub shifts: usize,
    /// With all values as they are: of the sensors and of the filter itself.
    pub as_it_is: ErrorOfEstimate,
    /// By value, the greatest error of the filter's torque first.
    pub values: Vec<CarInfluence>,
}

/// What each value may do to the estimates of the shifts between neighbouring gears; `None` if the filter has tables for none of them.
///
/// # Errors
/// A shift of the car cannot be simulated, or the gearbox has more clutches than the filter has room for.
pub fn car_influences(car: &Car, sensors: &Sensors) -> Result<Option<CarInfluences>, StudyError> {
    let shifts = nominal_shifts(car, sensors)?;
    if shifts.is_empty() {
        return Ok(None);
    }
    let as_it_is = errors(car, sensors, &shifts)?;
    let mut values = Vec::new();
    for value in &VALUES {
        if value.key.starts_with("converter.") && car.converter.is_none() {
            continue;
        }
        let at = |factor: f64| {
            let mut changed = car.clone();
            (value.change)(&mut changed, factor);
            errors(&changed, sensors, &shifts)
        };
        let [low, high] = [at(value.limits[0])?, at(value.limits[1])?];
        let errors = if low.torque_n_m[0] > high.torque_n_m[0] { low } else { high };
        values.push(CarInfluence { key: value.key, from: value.from(car), limits: value.limits, errors });
    }
    values.sort_by(|one, other| other.errors.torque_n_m[0].total_cmp(&one.errors.torque_n_m[0]));
    Ok(Some(CarInfluences { shifts: shifts.len(), as_it_is, values }))
}

/// The errors of the estimates with this file over the shifts.
fn errors(file: &Car, sensors: &Sensors, shifts: &[NominalShift]) -> Result<ErrorOfEstimate, AnyShiftError> {
    let [mut torque, mut pressure] = [SquaredErrors::default(); 2];
    for nominal in shifts {
        let rows = nominal.estimated(file, sensors, ERRORS.valve_delay_s, &nominal.inputs)?;
        let clutch = controlling(nominal.shift.kind);
        for phase in [TruePhase::Torque, TruePhase::Inertia] {
            torque.add(&SquaredErrors::of(&rows, phase, clutch));
            pressure.add(&SquaredErrors::of_pressure(&rows, phase, clutch));
        }
    }
    Ok(ErrorOfEstimate { torque_n_m: torque.rms_n_m(), pressure_pa: pressure.rms_pa() })
}
