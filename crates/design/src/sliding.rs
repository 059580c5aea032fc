//! Gains of the sliding-mode observer from the sliding condition, Eq. (2.56).
//!
//! Sliding needs `ks1 > |df1 + C13 mu R N A dz|` and the like for every output, for the largest error `dT_t` of
//! the turbine torque and `dz` of the pressure. In sliding the pressure error then decays with
//! `1/tau + mu R N A (ks3 C13/ks1 + ks4 (C13-C23)/ks2)`; the pressure gains follow from the wanted decay, shared
//! between the outputs in the direction in which the pressure moves them.

use car::Vehicle;
use drivetrain::ShiftTorques;
use observer::{Phase, SlidingGains, SlidingObserver};

use crate::budget::turbine_n_m;
use crate::polytope::slowest_valve;
use crate::rigid::{requirement, rigid_model, tracker};

/// The sliding-mode observer of this vehicle with these gains.
pub fn sliding_observer(vehicle: &Vehicle, gains: SlidingGains<f64>) -> SlidingObserver<f64> {
    SlidingObserver { model: rigid_model(vehicle), gains, tracker: tracker(vehicle) }
}

/// Gains that satisfy the sliding condition (2.56) for the vehicle file's error bounds, with the decay of
/// its settling times.
pub fn design_sliding(vehicle: &Vehicle) -> SlidingGains<f64> {
    let (speed, pressure) = phase_gains(vehicle, Phase::InertiaPhase);
    let (torque_speed, torque_pressure) = phase_gains(vehicle, Phase::TorquePhase);
    SlidingGains {
        torque_speed_rad_s2: torque_speed[0],
        torque_pressure_pa_s: torque_pressure[0],
        inertia_speed_rad_s2: speed,
        inertia_pressure_pa_s: pressure,
    }
}

/// Speed gains, rad/s^2, and pressure gains, Pa/s, on `(w_t, dw)`.
fn phase_gains(vehicle: &Vehicle, phase: Phase) -> ([f64; 2], [f64; 2]) {
    let model = rigid_model(vehicle);
    let (weak, strong) = vehicle.settings.uncertainty.friction;
    let bounds = &vehicle.error_bounds;
    let error = ShiftTorques { turbine_n_m: turbine_n_m(vehicle, phase), ..ShiftTorques::default() };
    let rows = model.coefficients(phase);
    let outputs = if phase == Phase::InertiaPhase { 2 } else { 1 };
    let influence = model.influence(phase, strong);
    let torque_error = [rows.turbine.at(&error).abs(), rows.slip_oncoming.at(&error).abs()];
    let mut speed = [0.0; 2];
    for i in 0..outputs {
        speed[i] = torque_error[i] + influence[i].abs() * bounds.pressure_pa;
    }

    let a22 = slowest_valve(&model, &vehicle.settings.uncertainty);
    let kappa2 = 4.0 / requirement(vehicle, phase).settling_time_s;
    // Decay that the switching must add at the weakest friction; the valve gives its own.
    let added_per_s = (kappa2 + a22).max(0.0);
    let weakest = model.influence(phase, weak);
    // With ks3 = s G1 ks1 the decay added is s |G|^2, G at the weakest friction.
    let fraction = added_per_s / (weakest[0] * weakest[0] + weakest[1] * weakest[1]);
    let mut pressure = [0.0; 2];
    for i in 0..outputs {
        pressure[i] = fraction * weakest[i] * speed[i];
    }
    (speed, pressure)
}
