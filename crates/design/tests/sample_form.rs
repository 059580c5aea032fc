//! What the observers do to an error over one sample.

use crate::common::{ENGINE_RAD_S, input, observer, over_a_sample};
use config::VehicleFile;
use design::{compliant_observer, design_compliant};
use observer::{Discretisation, Phase, Sample, SampleEstimator};

/// At 30 ms a sample multiplies the error by 1 - 73 * 0.03 = -1.2 by Euler's rule and by -0.5 exactly, at
/// the strong vertex of the inertia phase.
#[test]
fn the_exact_form_is_stable_where_eulers_rule_is_not() {
    let errors = |discretisation| {
        let mut slow = observer();
        slow.tracker.discretisation = discretisation;
        slow.model.clutch.friction = drivetrain::Table1::constant(0.16);
        let model = slow.model;
        let (dt, command, mut speeds, mut pressure) = (0.03, 0.25, [340.0, 300.0], 0.25e6);
        let mut state = slow.start_sample();
        for first in [0.0, 10.0, 1e-9] {
            slow.step_sample(&mut state, &input(first, speeds[0], speeds[1], command));
        }
        // The truth starts elsewhere than the estimate; its speeds follow the frozen model exactly.
        pressure += 0.02e6;
        (0..12)
            .map(|_| {
                let m = model.speed_model(Phase::InertiaPhase, ENGINE_RAD_S, speeds[0], speeds[1]);
                let valve = model.valve.linear(command, pressure);
                let (phi, a) = ((valve.a22_per_s * dt).exp(), valve.a22_per_s);
                let psi = (phi - 1.0) / a;
                let integral = psi * pressure + (psi - dt) / a * valve.b2_pa_s;
                let moved = |i: usize| dt * m.free_rad_s2[i] + m.per_pressure_rad_s2_pa[i] * integral;
                speeds = [speeds[0] + moved(0), speeds[1] + moved(1)];
                pressure = phi * pressure + psi * valve.b2_pa_s;
                // The speeds are set back so that the phase goes on; the observer sees their change only.
                let estimate = slow.step_sample(&mut state, &input(dt, speeds[0], speeds[1], command));
                (pressure - estimate.pressure_pa).abs()
            })
            .collect::<Vec<f64>>()
    };
    let (exact, euler) = (errors(Discretisation::Exact), errors(Discretisation::Euler));
    assert!(exact.iter().all(|error| error.is_finite()), "{exact:?}");
    assert!(exact[5] < 0.05 * exact[0], "{exact:?}");
    assert!(euler[5] > euler[0], "{euler:?}");
}

/// A car whose coefficients stand still over each sample as the observer takes them: of Eq. (2.45) nothing is left but
/// `e+ = (Phi - L G Psi) e`.
#[test]
fn over_a_sample_the_error_is_multiplied_by_phi_less_l_g_psi() {
    const T: f64 = 0.01;
    for (phase, mut speeds) in [(Phase::TorquePhase, [360.0, 360.0]), (Phase::InertiaPhase, [340.0, 300.0])] {
        let (observer, command) = (observer(), 0.25);
        let (model, mut state) = (observer.model, observer.start_sample());
        for dt in [0.0, 10.0, 1e-9] {
            observer.step_sample(&mut state, &input(dt, speeds[0], speeds[1], command));
        }
        let start = observer.step_sample(&mut state, &input(1e-9, speeds[0], speeds[1], command));
        let valve = model.valve.linear(command, 0.0);
        let (phi, psi, gam2) = over_a_sample(valve.a22_per_s, T);
        let mut error = 0.02e6;
        let mut pressure = start.pressure_pa + error;
        for n in 0..8 {
            let m = model.speed_model(phase, ENGINE_RAD_S, speeds[0], speeds[1]);
            let integral = psi * pressure + gam2 * valve.b2_pa_s;
            for ((speed, free), per_pressure) in speeds.iter_mut().zip(m.free_rad_s2).zip(m.per_pressure_rad_s2_pa) {
                *speed += T * free + per_pressure * integral;
            }
            if phase == Phase::TorquePhase {
                speeds[1] = speeds[0];
            }
            pressure = phi * pressure + psi * valve.b2_pa_s;
            let estimate = observer.step_sample(&mut state, &input(T, speeds[0], speeds[1], command));
            assert_eq!(estimate.phase, phase, "{n}");
            let gain = observer.gains.at(m.friction).of(phase);
            error *= phi - (0..2).map(|i| gain[i] * m.per_pressure_rad_s2_pa[i] * psi).sum::<f64>();
            assert!((pressure - estimate.pressure_pa - error).abs() < 1e-3, "{phase:?} {n}: {error}");
        }
    }
}

/// The same with elastic shafts: two errors, `Phi = diag(1, e^(A22 T))`, `Psi = diag(T, psi)`.
#[test]
fn over_a_sample_both_errors_of_the_compliant_observer_are_multiplied_by_phi_less_l_g_psi() {
    const T: f64 = 0.01;
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let observer = compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains());
    let (model, command) = (observer.model, 0.25);
    for (phase, mut speeds) in
        [(Phase::TorquePhase, [360.0, 360.0, 48.0]), (Phase::InertiaPhase, [340.0, 300.0, 160.0 / 3.0])]
    {
        let at = |dt: f64, y: [f64; 3]| Sample { wheel_rad_s: y[2], ..input(dt, y[0], y[1], command) };
        let mut state = observer.start_sample();
        for dt in [0.0, 10.0, 1e-9] {
            observer.step_sample(&mut state, &at(dt, speeds));
        }
        let start = observer.step_sample(&mut state, &at(1e-9, speeds));
        let valve = model.rigid.valve.linear(command, 0.0);
        let (phi, psi, gam2) = over_a_sample(valve.a22_per_s, T);
        let mut errors = [50.0, 0.02e6];
        let (mut shaft, mut pressure) = (start.shaft_torque_n_m.unwrap() + errors[0], start.pressure_pa + errors[1]);
        for n in 0..8 {
            let m = model.speed_model(phase, ENGINE_RAD_S, speeds[0], speeds[1], speeds[2]);
            let rate = model.shaft_rate(speeds[0], speeds[1], speeds[2]);
            let integrals = [T * shaft + 0.5 * T * T * rate, psi * pressure + gam2 * valve.b2_pa_s];
            for ((speed, free), g) in speeds.iter_mut().zip(m.free_rad_s2).zip(m.influence) {
                *speed += T * free + g[0] * integrals[0] + g[1] * integrals[1];
            }
            if phase == Phase::TorquePhase {
                speeds[1] = speeds[0];
            }
            shaft += T * rate;
            pressure = phi * pressure + psi * valve.b2_pa_s;
            let estimate = observer.step_sample(&mut state, &at(T, speeds));
            assert_eq!(estimate.phase, phase, "{n}");
            let gains = observer.gains.at(m.friction);
            let gain = if phase == Phase::TorquePhase { gains.torque_phase } else { gains.inertia_phase };
            let seen = m.influence.map(|g| g[0] * T * errors[0] + g[1] * psi * errors[1]);
            let corrected = |row: [f64; 3]| row.iter().zip(seen).map(|(l, seen)| l * seen).sum::<f64>();
            errors = [errors[0] - corrected(gain[0]), phi * errors[1] - corrected(gain[1])];
            let found = [shaft - estimate.shaft_torque_n_m.unwrap(), pressure - estimate.pressure_pa];
            assert!((found[0] - errors[0]).abs() < 1e-6, "{phase:?} {n}: {found:?} {errors:?}");
            assert!((found[1] - errors[1]).abs() < 1e-3, "{phase:?} {n}: {found:?} {errors:?}");
        }
    }
}
