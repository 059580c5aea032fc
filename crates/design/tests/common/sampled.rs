//! A car whose readings, torques and valve err within the error budget, with the rigid observer of a sample time on it.

use car::Vehicle;
use design::budget::{grade_n_m, mass_n_m};
use design::{ValveErrors, rigid_observer};
use observer::{Phase, RigidGains, SampleEstimator, Schedule};
use proptest::prelude::*;

use super::{ENGINE_RAD_S, input, over_a_sample};

/// Slip below which the inertia phase is taken to be over, rad/s.
const MIN_SLIP_RAD_S: f64 = 20.0;

/// What disturbs a sample, as fractions of the bounds of the budget.
#[derive(Debug, Clone)]
pub(crate) struct Disturbance {
    pub(crate) turbine: f64,
    pub(crate) output: f64,
    pub(crate) readings: [f64; 2],
    pub(crate) age: f64,
    pub(crate) valve: f64,
}

pub(crate) fn disturbance() -> impl Strategy<Value = Disturbance> {
    let fractions = prop::array::uniform6(-1.0..1.0_f64);
    // Now and then the worst case at once: everything at its limit.
    (fractions, any::<bool>()).prop_map(|(fractions, worst)| {
        let [turbine, output, first, second, age, valve] = fractions.map(|x| if worst { x.signum() } else { x });
        Disturbance { turbine, output, readings: [first, second], age, valve }
    })
}

/// The car in a phase of its shift.
pub(crate) struct SampledCar<'v> {
    pub(crate) vehicle: &'v Vehicle,
    pub(crate) gains: Schedule<f64, RigidGains<f64>>,
    pub(crate) phase: Phase,
    pub(crate) sample_time_s: f64,
    pub(crate) command: f64,
    /// Turbine speed and slip of the oncoming clutch at the start, rad/s.
    pub(crate) speeds: [f64; 2],
}

impl SampledCar<'_> {
    /// The sizes of the error of the pressure and of what is left of the first one, Pa, after each sample.
    pub(crate) fn errors(&self, initial_pa: f64, disturbances: &[Disturbance]) -> Vec<[f64; 2]> {
        let (vehicle, phase, t, command) = (self.vehicle, self.phase, self.sample_time_s, self.command);
        let bounds = vehicle.error_bounds;
        let inertia = phase == Phase::InertiaPhase;
        let observer = rigid_observer(vehicle, self.gains);
        let (model, mut speeds) = (observer.model, self.speeds);
        // While the offgoing clutch sticks the slip follows from the turbine speed.
        let slip_per_turbine = speeds[1] / speeds[0];
        let mut state = observer.start_sample();
        for dt in [0.0, 10.0, 1e-9] {
            observer.step_sample(&mut state, &input(dt, speeds[0], speeds[1], command));
        }
        let start = observer.step_sample(&mut state, &input(1e-9, speeds[0], speeds[1], command));
        assert_eq!(start.phase, phase);
        let mut pressure = start.pressure_pa + initial_pa;
        let valve = model.valve.linear(command, pressure);
        let (phi, psi, gam2) = over_a_sample(valve.a22_per_s, t);
        let friction = bounds.friction_factor.map(|factor| (factor - 1.0).abs()).into_iter().fold(0.0, f64::max);
        let valve_pa_s =
            ValveErrors::of(vehicle).largest_pa_s() - friction * bounds.shift_pressure_pa * valve.a22_per_s;
        // The budget bounds the error of a change; half of it bounds that of each reading.
        let reading_rad_s = [0.5 * bounds.turbine_quantum_rad_s, 0.5 * bounds.slip_quantum_rad_s];
        let load_n_m =
            bounds.output_torque_n_m + (grade_n_m(vehicle) + mass_n_m(vehicle)) / vehicle.driveline.final_ratio;
        let [turbine_n_m, offgoing_n_m] = match inertia {
            true => [bounds.turbine_torque_n_m + bounds.inertia_torque_n_m, bounds.offgoing_torque_n_m],
            false => [bounds.turbine_torque_n_m, 0.0],
        };
        let (mut measured, mut left, mut errors) = (speeds, initial_pa.abs(), Vec::new());
        for d in disturbances {
            let rows = model.coefficients(phase);
            let torques = drivetrain::ShiftTorques {
                turbine_n_m: d.turbine * turbine_n_m,
                output_n_m: d.output * load_n_m,
                offgoing_n_m: d.output * offgoing_n_m,
                ..Default::default()
            };
            let w = [rows.turbine.at(&torques), rows.slip_oncoming.at(&torques)];
            let m = model.speed_model(phase, ENGINE_RAD_S, measured[0], measured[1]);
            // The speeds tell what the pressure was a while ago.
            let old = d.age * bounds.sampling_delay_s * bounds.shift_ramp_pa_s;
            let integral = psi * (pressure + old) + gam2 * valve.b2_pa_s;
            let gain = observer.gains.at(m.friction).of(phase).map(|gain| m.direction * gain);
            let factor = phi - (0..2).map(|i| gain[i] * m.per_pressure_rad_s2_pa[i] * psi).sum::<f64>();
            for i in 0..2 {
                speeds[i] += t * (m.free_rad_s2[i] + w[i]) + m.per_pressure_rad_s2_pa[i] * integral;
                measured[i] = speeds[i] + d.readings[i] * reading_rad_s[i];
            }
            if !inertia {
                (speeds[1], measured[1]) = (slip_per_turbine * speeds[0], slip_per_turbine * measured[0]);
            }
            pressure = phi * pressure + psi * valve.b2_pa_s + d.valve * psi * valve_pa_s;
            let estimate = observer.step_sample(&mut state, &input(t, measured[0], measured[1], command));
            if estimate.phase != phase || measured[1].abs() < MIN_SLIP_RAD_S {
                break;
            }
            left *= factor.abs();
            errors.push([(pressure - estimate.pressure_pa).abs(), left]);
        }
        errors
    }
}
