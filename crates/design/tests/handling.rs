//! What the observers with designed gains make of unusable input, gaps and changes of phase.

use crate::common::{Car, DT_S, input, observer};
use car::GainMethod;
use config::VehicleFile;
use design::{
    Model, compliant_observer, design_compliant, design_discrete, inversion, kalman_filter, rigid_observer,
    unscented_filter,
};
use observer::{
    Estimator, Health, Phase, RigidGains, RigidObserver, RigidState, Sample, SampleEstimator, one_shift_filter,
};

#[test]
fn a_reading_that_no_pressure_explains_is_rejected_and_nothing_possible_is_left() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let design = design_discrete(&vehicle, Model::Rigid, GainMethod::PeakToPeak, 0.01).unwrap();
    let observer = rigid_observer(&vehicle, design.rigid_gains());
    let mut car = Car::start_at(observer, Phase::InertiaPhase, [340.0, 300.0], 0.0);
    let [turbine, slip] = car.speeds;
    let mut step = |turbine: f64| observer.step_sample(&mut car.state, &input(0.01, turbine, slip, car.command));
    step(turbine);
    // 560 rad/s more are 3.5 MPa less by the gain of -6323 Pa s/rad.
    let wrong = step(900.0);
    assert_eq!(wrong.health, Health::SpeedsRejected);
    assert!((0.0..=vehicle.error_bounds.pressure_max_pa).contains(&wrong.pressure_pa));
    // The way back is no news either.
    assert_eq!(step(turbine).health, Health::Good);
    // 100 rad/s could be a pressure, but not one that there is.
    let wrong = step(turbine + 100.0);
    assert_eq!((wrong.health, wrong.pressure_pa), (Health::PressureLimited, 0.0));
}

#[test]
fn an_observer_that_starts_anew_says_so_once() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let compliant = compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains());
    says_so(&kalman_filter(&vehicle, None), "kalman");
    says_so(&one_shift_filter(&vehicle, None), "gearbox");
    says_so(&unscented_filter(&vehicle, None), "unscented");
    says_so(&compliant, "compliant");
    says_so(&inversion(&vehicle), "inversion");
}

fn says_so(observer: &impl Estimator<f64>, name: &str) {
    let usable = Sample { wheel_rad_s: 40.0, ..input(0.01, 300.0, 300.0, 0.0) };
    let mut state = observer.start();
    let mut health = |input: Sample<f64>| {
        observer.step(&mut state, &input.input(&VehicleFile::built_in().unwrap().vehicle.shift)).health
    };
    assert_eq!([(); 3].map(|()| health(usable)), [Health::Good; 3], "{name}: the first start is no new one");
    // The gap is longer than any gain is made for.
    assert_eq!(health(Sample { dt_s: 1.0, ..usable }), Health::Restarted, "{name}");
    assert_eq!([(); 3].map(|()| health(usable)), [Health::Good; 3], "{name}");
}

#[test]
fn the_estimate_does_not_jump_when_the_gain_changes() {
    let mut car = Car::start(Phase::TorquePhase, 0.05e6);
    for _ in 0..50 {
        car.step([0.0; 2]);
    }
    let mut last = car.pressure_pa - car.step([0.0; 2]);
    // The turbine leaves the speed of first gear: the phase changes and with it the gain.
    car.phase = Phase::InertiaPhase;
    let mut phases = Vec::new();
    for _ in 0..200 {
        car.speeds[1] -= 0.1;
        let estimate =
            car.observer.step_sample(&mut car.state, &input(DT_S, car.speeds[0], car.speeds[1], car.command));
        phases.push(estimate.phase);
        // In one sample of 0.1 ms the valve moves the pressure by less than 1 kPa and the correction, for
        // at most 0.2 rad/s of unpredicted speed, by 0.2 * 1527 Pa.
        assert!((estimate.pressure_pa - last).abs() < 1.3e3, "jump of {} Pa", estimate.pressure_pa - last);
        last = estimate.pressure_pa;
    }
    assert!(phases.contains(&Phase::TorquePhase) && phases.contains(&Phase::InertiaPhase));
}

#[test]
fn unusable_inputs_are_flagged_and_the_valve_model_goes_on() {
    let observer = observer();
    let mut state = observer.start_sample();
    let good = input(0.01, 300.0, 200.0, 0.3);
    observer.step_sample(&mut state, &good);
    let health = |state: &mut RigidState<f64>, input: Sample<f64>| observer.step_sample(state, &input).health;
    assert_eq!(health(&mut state, Sample { turbine_rad_s: f64::NAN, ..good }), Health::SpeedsRejected);
    assert_eq!(health(&mut state, Sample { engine_rad_s: 1e9, ..good }), Health::SpeedsRejected);
    assert_eq!(health(&mut state, Sample { command: -0.1, ..good }), Health::CommandRejected);
    assert_eq!(health(&mut state, Sample { dt_s: f64::INFINITY, ..good }), Health::TimeRejected);
    assert_eq!(health(&mut state, good), Health::Good);
    // Without any speed the estimate is the open loop: after long, gain times current.
    let estimate = observer.step_sample(&mut state, &Sample { dt_s: 5.0, slip_rad_s: f64::NAN, ..good });
    assert!((estimate.pressure_pa - 0.3e6).abs() < 1.0);
}

#[test]
fn zero_gain_is_the_valve_model_alone() {
    let observer = RigidObserver { gains: RigidGains::open_loop().into(), ..observer() };
    let mut state = observer.start_sample();
    let mut pressure = 0.0;
    for n in 0..300 {
        let command = 0.2 + 0.1 * (f64::from(n) * 0.05).sin();
        let estimate = observer.step_sample(&mut state, &input(0.01, 300.0, 250.0 - f64::from(n), command));
        assert!((estimate.pressure_pa - pressure).abs() < 1e-6);
        pressure = observer.model.valve.linear(command, pressure).advance(pressure, 0.01);
    }
}

#[test]
fn over_a_long_gap_the_valve_model_serves_alone() {
    let mut car = Car::start(Phase::InertiaPhase, 0.0);
    car.step([0.0; 2]);
    let before = car.observer.step_sample(&mut car.state, &input(0.0, 340.0, 300.0, 0.25)).pressure_pa;
    // Speeds that have nothing to do with those before the gap must not be taken for a pressure.
    let after = car.observer.step_sample(&mut car.state, &input(0.2, 250.0, 100.0, 0.25));
    let valve = car.observer.model.valve.linear(0.25, before).advance(before, 0.2);
    assert!((after.pressure_pa - valve).abs() < 1e-6 && after.health == Health::Good, "{}", after.pressure_pa);
    let unknown = car.observer.step_sample(&mut car.state, &input(f64::NAN, 250.0, 100.0, 0.25));
    assert_eq!((unknown.health, unknown.pressure_pa), (Health::TimeRejected, after.pressure_pa));
    // After a time step that was none there is no sample to correct by either.
    let next = car.observer.step_sample(&mut car.state, &input(0.01, 200.0, 50.0, 0.25));
    let valve = car.observer.model.valve.linear(0.25, 0.0).advance(unknown.pressure_pa, 0.01);
    assert!((next.pressure_pa - valve).abs() < 1e-6, "{}", next.pressure_pa);
}
