//! Observers without a certificate, with the parameters that the vehicle file's error budget gives them.

use car::Vehicle;
use drivetrain::Real;
use observer::{Inversion, Phase, SuperTwisting};

use crate::budget::{ValveErrors, shift_time_constant};
use crate::compliant::compliant_model;
use crate::rigid::{rigid_model, tracker};

/// Low pass of the direct inversion, in valve time constants: it must not be slower than what it looks for.
const SMOOTHING_FRACTION: f64 = 0.5;

/// The super-twisting observer of this vehicle. Its gains dominate the rate of the valve error as it shows in the
/// acceleration, at the strongest friction.
pub fn super_twisting(vehicle: &Vehicle) -> SuperTwisting<f64> {
    let model = rigid_model(vehicle);
    let valve_rate_pa_s = ValveErrors::of(vehicle).largest_pa_s();
    let rate = |phase| {
        let [turbine, slip] = model.influence(phase, vehicle.settings.uncertainty.friction.1);
        Real::hypot(turbine, slip) * valve_rate_pa_s
    };
    let error_rate_rad_s3 = [rate(Phase::TorquePhase), rate(Phase::InertiaPhase)];
    SuperTwisting { model, error_rate_rad_s3, tracker: tracker(vehicle) }
}

/// The direct inversion of this vehicle.
pub fn inversion(vehicle: &Vehicle) -> Inversion<f64> {
    Inversion {
        model: compliant_model(vehicle),
        smoothing_s: SMOOTHING_FRACTION * shift_time_constant(vehicle),
        shaft_settling_s: vehicle.settings.shaft_settling_s,
        tracker: tracker(vehicle),
    }
}
