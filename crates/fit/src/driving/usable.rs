//! Whether the driving of a log can say something, before it is fitted.

use super::DrivenCar;
use super::stretch::{Driving, STEP_S, means};

/// Minimum time of driving, s.
const TIME_S: f64 = 10.0;
/// Minimum change of a reported engine torque, N m: one that changes less is frozen, or says nothing.
const CHANGE_N_M: f64 = 3.0;
/// Rise of the torque that converter and engine take per reported torque, between which the signal is an engine torque at the flywheel
/// \[chosen: twice what is held possible\].
const SLOPE: [f64; 2] = [0.6, 1.6];
/// Delays at which the signal is compared, s.
const DELAYS_S: [f64; 4] = [-0.05, 0.0, 0.05, 0.1];

/// What can be used, and why not.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Usable {
    /// The balance of the car.
    pub(crate) car: Result<(), String>,
    /// The balance of the engine.
    pub(crate) engine: Result<(), String>,
}

/// Looks at the driving of a car.
pub(crate) fn usable(car: &DrivenCar, driving: &Driving) -> Usable {
    let enough = |time_s: f64, what: &str| match time_s {
        time_s if time_s >= TIME_S => Ok(()),
        time_s => {
            Err(format!("{time_s:.0} s of driving in a gear with the engine pulling {what}, {TIME_S:.0} s are needed"))
        }
    };
    let engine = match &car.converter {
        None => Err("there is no converter".to_owned()),
        Some(_) if driving.time_s() > 0.0 && driving.reported_s() == 0.0 => {
            Err("the logs have no reported engine torque".to_owned())
        }
        Some(_) => enough(driving.reported_s(), "and a reported engine torque").and_then(|()| follows(car, driving)),
    };
    Usable { car: enough(driving.time_s(), "outside of shifts"), engine }
}

/// Whether the reported torque follows that which converter and engine take.
fn follows(car: &DrivenCar, driving: &Driving) -> Result<(), String> {
    let slopes = DELAYS_S.map(|late_s| slope(car, driving, late_s));
    let (change_n_m, _) = slopes[0];
    if change_n_m < CHANGE_N_M {
        return Err(format!(
            "the reported engine torque changes by {change_n_m:.1} N m (standard deviation): it is frozen, or the driving is too steady"
        ));
    }
    let is_torque = |slope: f64| (SLOPE[0]..=SLOPE[1]).contains(&slope);
    if slopes.iter().any(|(_, slope)| is_torque(*slope)) {
        return Ok(());
    }
    let nearest = slopes.iter().map(|(_, slope)| *slope).min_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs()));
    Err(format!(
        "the reported engine torque does not follow the converter: for each N m of it, converter and engine take {:.2} N m more. Check sign and unit, and whether it contains the engine's friction",
        nearest.unwrap_or(f64::NAN)
    ))
}

/// Standard deviation of the reported torque, N m, and by how much the torque taken rises with it.
fn slope(car: &DrivenCar, driving: &Driving, late_s: f64) -> (f64, f64) {
    let (mut count, mut sums) = (0.0, [0.0; 4]);
    for stretch in driving.stretches.iter().filter(|stretch| stretch.has_reported()) {
        let engine = means(&stretch.halves, |half| half.engine_rad_s);
        let pump = means(&stretch.halves, |half| half.pump_n_m);
        let reported = means(&stretch.reported_n_m(&stretch.halves, STEP_S, late_s), |torque| *torque);
        for ((speeds, pump_n_m), reported) in engine.windows(3).zip(&pump[1..]).zip(&reported[1..]) {
            let taken = pump_n_m + car.engine_inertia_kg_m2 * (speeds[2] - speeds[0]) / (2.0 * STEP_S);
            count += 1.0;
            let more = [*reported, taken, reported * reported, reported * taken];
            sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        }
    }
    let [reported, taken, square, product] = sums.map(|sum| sum / count);
    let variance = (square - reported * reported).max(0.0);
    (variance.sqrt(), (product - reported * taken) / variance)
}
