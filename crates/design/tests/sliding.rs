//! The sliding-mode observer on a car that obeys its model.

use crate::common::{Car, DT_S, ENGINE_RAD_S, input};
use config::VehicleFile;
use design::{design_sliding, sliding_observer};
use observer::{Phase, SampleEstimator};

/// In sliding the pressure error decays by the pressure gains; what remains is their switching.
#[test]
fn the_sliding_observer_brings_a_wrong_pressure_down() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let mut car = Car::start(Phase::InertiaPhase, 0.08e6);
    let sliding = sliding_observer(&vehicle, design_sliding(&vehicle));
    let mut state = sliding.start_sample();
    for dt in [0.0, 10.0, 1e-9] {
        sliding.step_sample(&mut state, &input(dt, car.speeds[0], car.speeds[1], car.command));
    }
    let mut error = f64::NAN;
    for _ in 0..1200 {
        car.step([0.0; 2]);
        let estimate = sliding.step_sample(&mut state, &input(DT_S, car.speeds[0], car.speeds[1], car.command));
        error = car.pressure_pa - estimate.pressure_pa;
    }
    // Open loop would have e^-3 of the 0.08 MPa left.
    assert!(error.abs() < 0.5 * 0.08e6 * (-3.0_f64).exp(), "{error}");
}

/// Speeds a hair to either side of where Euler's step of Eq. (2.55) and (2.59) leads: the pressure shows which signs the
/// observer saw, and so that it went there too.
#[test]
fn the_sliding_observer_takes_eulers_step_of_its_equations() {
    const HAIR_RAD_S: f64 = 1e-6;
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let sliding = sliding_observer(&vehicle, design_sliding(&vehicle));
    let (model, gains, command) = (sliding.model, sliding.gains, 0.25);
    for (phase, start) in [(Phase::TorquePhase, [360.0, 360.0]), (Phase::InertiaPhase, [340.0, 300.0])] {
        let torque = phase == Phase::TorquePhase;
        let mut state = sliding.start_sample();
        // Without speeds it forgets the sample before, and its speeds begin at the measured ones.
        for (dt, slip) in [(0.0, start[1]), (10.0, start[1]), (1e-9, start[1]), (1e-9, f64::NAN)] {
            sliding.step_sample(&mut state, &input(dt, start[0], slip, command));
        }
        let mut before = sliding.step_sample(&mut state, &input(1e-9, start[0], start[1], command)).pressure_pa;
        let (mut measured, mut estimated, mut signs) = (start, start, [0.0; 2]);
        let (speed_gains, pressure_gains) = if torque {
            ([gains.torque_speed_rad_s2, 0.0], [gains.torque_pressure_pa_s, 0.0])
        } else {
            (gains.inertia_speed_rad_s2, gains.inertia_pressure_pa_s)
        };
        for (n, next) in [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [1.0, 1.0]].into_iter().enumerate() {
            let slip = if torque { measured[1] } else { estimated[1] };
            let m = model.speed_model(phase, ENGINE_RAD_S, measured[0], slip);
            for i in 0..2 {
                let rate = m.free_rad_s2[i] + m.per_pressure_rad_s2_pa[i] * before;
                estimated[i] += DT_S * (rate + speed_gains[i] * signs[i]);
                measured[i] = estimated[i] + HAIR_RAD_S * next[i];
            }
            if torque {
                measured[1] = measured[0];
            }
            let switched: f64 = pressure_gains.iter().zip(signs).map(|(gain, sign)| DT_S * gain * sign).sum();
            let expected = model.valve.linear(command, before).advance(before, DT_S) + switched;
            let estimate = sliding.step_sample(&mut state, &input(DT_S, measured[0], measured[1], command));
            assert_eq!(estimate.phase, phase);
            assert!((estimate.pressure_pa - expected).abs() < 1e-6, "{phase:?} {n}: {estimate:?} {expected}");
            (before, signs) = (estimate.pressure_pa, next);
        }
    }
}
