//! What a fit changes of the clutch torque, and how much of that it leaves open.

use car::Shaft;
use nalgebra::DVector;

use crate::Parameter as P;
use crate::car::Car;
use crate::intervals::Precision;
use crate::parameters::Prior;
use crate::shape::Map;
use crate::shift_model::ShiftModel;

/// What a fit changes of the torque of the oncoming clutch at the commands and slips of its shifts.
///
/// `d` is the change of the torque at all readings of the turbine speed where the clutch carries any, `J` its derivative by the unknowns and `S` their covariance.
/// Along the change the standard deviation is `sqrt(d' J S J' d / (d' d))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueChange {
    /// RMS of the change, N m.
    pub rms_n_m: f64,
    /// Standard deviation of what the fit leaves open of it, as RMS, N m.
    pub open_n_m: f64,
}

impl TorqueChange {
    /// Of unknowns against the car of the file.
    pub(crate) fn of(
        file: &Car,
        shafts: &[Shaft],
        models: &[ShiftModel],
        priors: &[Prior],
        unknowns: &[f64],
        precision: &Precision,
    ) -> Self {
        const DIFFERENCE: f64 = 1e-3;
        let torque = |car: &Car| -> DVector<f64> {
            let shifts = models.iter().flat_map(|model| model.oncoming_torque(car));
            DVector::from_vec(shifts.collect())
        };
        let (given, fitted) = (torque(file), torque(&file.with(shafts, priors, unknowns)));
        let change = &fitted - &given;
        // Before the kiss point neither has a torque.
        let count = given.iter().zip(&fitted).filter(|(one, other)| **one != 0.0 || **other != 0.0).count() as f64;
        let square = change.norm_squared();
        if square == 0.0 {
            return Self { rms_n_m: 0.0, open_n_m: 0.0 };
        }
        let mut moved = unknowns.to_vec();
        let along = DVector::from_fn(priors.len(), |j, _| {
            if !acts_on_torque(priors[j].parameter) {
                return 0.0;
            }
            moved[j] += DIFFERENCE;
            let other = torque(&file.with(shafts, priors, &moved));
            moved[j] = unknowns[j];
            (other - &fitted).dot(&change) / DIFFERENCE
        });
        let variance = along.dot(&(&precision.stated * &along)).max(0.0);
        Self { rms_n_m: (square / count).sqrt(), open_n_m: (variance / (square * count)).sqrt() }
    }
}

/// Whether the torque of the oncoming clutch at a command and a slip depends on it.
fn acts_on_torque(parameter: P) -> bool {
    match parameter {
        P::Friction | P::FrictionAtRest | P::FrictionSlope | P::Spring | P::Gain | P::Lag => true,
        P::CommandDelay | P::Hysteresis => true,
        P::Shape(map, _) => map != Map::Capacity,
        _ => false,
    }
}
