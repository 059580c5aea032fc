//! Whether a gain does anything: one whose corrections do not change the estimate is the open loop, whatever its digits.

use car::Vehicle;
use nalgebra::DMatrix;
use observer::{CompliantGains, Phase, RigidGains, Schedule};

use crate::compliant::{PRESSURE_UNIT_PA, SHAFT_UNIT_N_M, SPEED_UNITS_RAD_S};
use crate::discrete::found::{WORTH_A_GAIN, open_loop_bound, slowest};
use crate::discrete::system::{Corner, ErrorSystem, outputs};
use crate::discrete::{Model, Quantity};

/// Steady-state bound on the error of the clutch torque in open loop, as a pressure, Pa, with every error of the budget.
pub fn open_loop_bound_pa(vehicle: &Vehicle, model: Model, phase: Phase, sample_time_s: f64) -> f64 {
    let system = ErrorSystem::of(vehicle, model, Quantity::ClutchTorque, phase, sample_time_s);
    PRESSURE_UNIT_PA * open_loop_bound(&system)
}

/// Whether a gain on the pressure, Pa per rad/s for each of `(w_t, dw, w_w)`, is in effect the open loop.
///
/// The largest correction of one sample, with every error of the budget at its bound and an estimate that is wrong by the bound
/// of the open loop, may add up for as long as the valve remembers it. If that sum is less than the fraction of the bound by which a
/// gain must beat the open loop, the estimate is that of the open loop.
pub fn is_open_loop(
    vehicle: &Vehicle,
    model: Model,
    phase: Phase,
    pressure_gain_pa_s_rad: &[f64],
    sample_time_s: f64,
) -> bool {
    let system = ErrorSystem::of(vehicle, model, Quantity::ClutchTorque, phase, sample_time_s);
    let outputs = outputs(model, phase);
    let entry = |output: usize| pressure_gain_pa_s_rad[output] * SPEED_UNITS_RAD_S[output] / PRESSURE_UNIT_PA;
    let gain = DMatrix::from_row_iterator(1, outputs.len(), outputs.iter().map(|&output| entry(output)));
    let bound = open_loop_bound(&system);
    // No error of the shaft torque is larger than the torque itself.
    let states = match model {
        Model::Rigid => vec![bound],
        Model::Compliant => vec![vehicle.error_bounds.shaft_torque_n_m / SHAFT_UNIT_N_M, bound],
    };
    let correction = |corner: &Corner| {
        let of_states = (&gain * &corner.g_psi).iter().zip(&states).map(|(g, error)| (g * error).abs()).sum::<f64>();
        let of_readings = 2.0 * (&gain * &system.readings).abs().sum();
        of_states + of_readings + (&gain * &corner.columns).abs().sum()
    };
    let largest = system.corners.iter().map(correction).fold(0.0, f64::max);
    largest / (1.0 - slowest(&system)) <= (1.0 - WORTH_A_GAIN) * bound
}

/// The phases of the shift in which these gains of the rigid observer are in effect the open loop.
pub fn rigid_open_loop_phases(
    vehicle: &Vehicle,
    gains: &Schedule<f64, RigidGains<f64>>,
    sample_time_s: f64,
) -> Vec<Phase> {
    phases(|phase| {
        gains.ends.iter().all(|gains| is_open_loop(vehicle, Model::Rigid, phase, &gains.of(phase), sample_time_s))
    })
}

/// The same of the pressure of the compliant observer.
pub fn compliant_open_loop_phases(
    vehicle: &Vehicle,
    gains: &Schedule<f64, CompliantGains<f64>>,
    sample_time_s: f64,
) -> Vec<Phase> {
    phases(|phase| {
        gains.ends.iter().all(|gains| {
            let [_, of_pressure] = if phase == Phase::TorquePhase { gains.torque_phase } else { gains.inertia_phase };
            is_open_loop(vehicle, Model::Compliant, phase, &of_pressure, sample_time_s)
        })
    })
}

fn phases(is_open_loop: impl Fn(Phase) -> bool) -> Vec<Phase> {
    [Phase::TorquePhase, Phase::InertiaPhase].into_iter().filter(|&phase| is_open_loop(phase)).collect()
}

#[cfg(test)]
mod tests {
    use config::VehicleFile;

    use super::*;

    /// What a gain does to the estimate decides, and not its size.
    #[test]
    fn a_gain_is_the_open_loop_by_its_effect_on_the_bound() {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let is_one =
            |vehicle: &Vehicle, gain: f64| is_open_loop(vehicle, Model::Rigid, Phase::InertiaPhase, &[gain, 0.0], 0.01);
        assert!(is_one(&vehicle, 0.0) && !is_one(&vehicle, -6323.0));
        // 0.1 % of 0.129 MPa over the valve's memory of 4.5 samples is 29 Pa in a sample; readings and torques give 10 rad/s.
        assert!(is_one(&vehicle, -1.0) && !is_one(&vehicle, -10.0));
        // With ten times the error of the turbine torque the small gain corrects by ten times as much.
        let mut disturbed = vehicle;
        disturbed.error_bounds.turbine_torque_n_m *= 10.0;
        assert!(!is_one(&disturbed, -1.0));
        let bound = |vehicle: &Vehicle| open_loop_bound_pa(vehicle, Model::Rigid, Phase::InertiaPhase, 0.01);
        assert!((bound(&disturbed) - 0.1294e6).abs() < 100.0);
    }
}
