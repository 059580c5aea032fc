//! The compliant observer on a car that obeys its model.

use crate::common::{DT_S, ENGINE_RAD_S, input};
use config::VehicleFile;
use design::{compliant_observer, design_compliant};
use observer::{Health, Phase, Sample, SampleEstimator};

/// A car that obeys the compliant model: both estimates converge from wrong starts.
#[test]
fn the_compliant_observer_finds_pressure_and_shaft_torque_of_its_own_model() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let design = design_compliant(&vehicle).unwrap();
    let observer = compliant_observer(&vehicle, design.gains());
    let model = observer.model;
    for (phase, mut speeds) in
        [(Phase::TorquePhase, [360.0, 360.0, 48.0]), (Phase::InertiaPhase, [340.0, 300.0, 160.0 / 3.0])]
    {
        let command = 0.25;
        let at = |dt: f64, y: [f64; 3]| Sample { wheel_rad_s: y[2], ..input(dt, y[0], y[1], command) };
        let mut state = observer.start_sample();
        for dt in [0.0, 10.0, 1e-9] {
            observer.step_sample(&mut state, &at(dt, speeds));
        }
        let start = observer.step_sample(&mut state, &at(1e-9, speeds));
        assert_eq!(start.phase, phase);
        let (mut shaft, mut pressure) = (start.shaft_torque_n_m.unwrap() + 100.0, start.pressure_pa + 0.05e6);
        let kappa2 = design.of(phase).unwrap().kappa2_per_s;
        // Normalised: 100 N m are 0.1 and 0.05 MPa are 0.5.
        let initial = 0.1_f64.hypot(0.5);
        for n in 1..=1500 {
            let m = model.speed_model(phase, ENGINE_RAD_S, speeds[0], speeds[1], speeds[2]);
            let shaft_rate = model.shaft_rate(speeds[0], speeds[1], speeds[2]);
            let next = model.rigid.valve.linear(command, pressure).advance(pressure, DT_S);
            let (mean_shaft, mean_pressure) = (shaft + 0.5 * DT_S * shaft_rate, 0.5 * (pressure + next));
            for (speed, (free, [per_shaft, per_pressure])) in
                speeds.iter_mut().zip(m.free_rad_s2.iter().zip(m.influence))
            {
                *speed += DT_S * (free + per_shaft * mean_shaft + per_pressure * mean_pressure);
            }
            if phase == Phase::TorquePhase {
                speeds[1] = speeds[0];
            }
            shaft += DT_S * shaft_rate;
            pressure = next;
            let estimate = observer.step_sample(&mut state, &at(DT_S, speeds));
            if estimate.phase != phase {
                // Left alone, the car passes through the speed at which clutch A would grip again.
                assert!(n > 400, "{phase:?} lasted {n} samples");
                break;
            }
            let errors = [(shaft - estimate.shaft_torque_n_m.unwrap()) / 1e3, (pressure - estimate.pressure_pa) / 1e5];
            let bound = initial * (-kappa2 * f64::from(n) * DT_S).exp();
            let error = errors[0].hypot(errors[1]);
            assert!(error <= bound + 1e-3, "{phase:?} {n}: {error} {bound} {:?}", estimate.phase);
        }
    }
}

#[test]
fn before_the_shift_the_shaft_torque_starts_at_its_steady_value() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let observer = compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains());
    let mut state = observer.start_sample();
    let sample = Sample { wheel_rad_s: 40.0, ..input(0.0, 300.0, 300.0, 0.0) };
    let shaft = observer.step_sample(&mut state, &sample).shaft_torque_n_m.unwrap();
    let turbine = vehicle.converter.torques(ENGINE_RAD_S, 300.0).turbine_n_m;
    // Turbine torque times both ratios, less what accelerates the gearbox.
    assert!((0.9..1.0).contains(&(shaft / (turbine * 2.5 * 3.0))), "{shaft}");
    let lost = observer.step_sample(&mut state, &Sample { wheel_rad_s: f64::NAN, dt_s: 0.01, ..sample });
    assert_eq!(lost.health, Health::SpeedsRejected);
    assert!((lost.shaft_torque_n_m.unwrap() / shaft - 1.0).abs() < 0.05);
}
