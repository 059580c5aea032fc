//! The rigid observer with designed gains: its certificate in simulation, and its manners.

#![expect(clippy::unwrap_used, reason = "a test may")]

use config::{GainMethod, Vehicle};
use design::{
    Model, ValveErrors, bounded, compliant_observer, design_compliant, design_discrete, design_rigid, design_sliding,
    inversion, kalman_filter, rigid_observer, sliding_observer, super_twisting, unscented_filter,
};
use drivetrain::Valve;
use observer::{Discretisation, Estimator, Health, Input, Phase, RigidGains, RigidObserver, RigidState};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

const ENGINE_RAD_S: f64 = 370.0;
const DT_S: f64 = 1e-4;

fn observer() -> RigidObserver<f64> {
    let vehicle = Vehicle::two_speed_at().unwrap();
    rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains())
}

fn input(dt_s: f64, turbine_rad_s: f64, slip_rad_s: f64, command: f64) -> Input<f64> {
    Input { dt_s, engine_rad_s: ENGINE_RAD_S, turbine_rad_s, slip_rad_s, wheel_rad_s: f64::NAN, command }
}

/// A car that obeys the rigid model but for an error `w`, and the observer on it.
struct Car {
    observer: RigidObserver<f64>,
    state: RigidState<f64>,
    phase: Phase,
    speeds: [f64; 2],
    pressure_pa: f64,
    command: f64,
    /// Whether the last sample still lay in the phase: left alone the car locks clutch B, or A grips again.
    in_phase: bool,
}

impl Car {
    /// In this phase, with an estimate that is wrong by `error_pa`.
    fn start(phase: Phase, error_pa: f64) -> Self {
        let observer = observer();
        let command = 0.25;
        // In first gear the slip of B is the turbine speed; less of it means that A has let go.
        let speeds = if phase == Phase::TorquePhase { [360.0, 360.0] } else { [340.0, 300.0] };
        let mut state = observer.start();
        for dt in [0.0, 10.0, 1e-9] {
            observer.step(&mut state, &input(dt, speeds[0], speeds[1], command));
        }
        let estimate = observer.step(&mut state, &input(1e-9, speeds[0], speeds[1], command));
        assert_eq!(estimate.phase, phase);
        Self { observer, state, phase, speeds, pressure_pa: estimate.pressure_pa + error_pa, command, in_phase: true }
    }

    /// One sample later: the error of the estimate, Pa. The speeds go as in Eq. (2.24a), the pressure as
    /// in Eq. (2.24b), both exactly for coefficients that stand still over the sample.
    fn step(&mut self, w: [f64; 2]) -> f64 {
        let model = self.observer.model;
        let m = model.speed_model(self.phase, ENGINE_RAD_S, self.speeds[0], self.speeds[1]);
        let before = self.pressure_pa;
        self.pressure_pa = model.valve.linear(self.command).advance(before, DT_S);
        let mean = 0.5 * (before + self.pressure_pa);
        let rate = |i: usize| m.free_rad_s2[i] + m.per_pressure_rad_s2_pa[i] * mean + w[i];
        self.speeds = [self.speeds[0] + DT_S * rate(0), self.speeds[1] + DT_S * rate(1)];
        if self.phase == Phase::TorquePhase {
            self.speeds[1] = self.speeds[0];
        }
        let estimate = self.observer.step(&mut self.state, &input(DT_S, self.speeds[0], self.speeds[1], self.command));
        self.in_phase =
            estimate.phase == self.phase && self.speeds[1] > self.observer.tracker.supervisor.lock_slip_rad_s;
        self.pressure_pa - estimate.pressure_pa
    }
}

/// The mean of start and end stands for the integral of the pressure over a sample; that and rounding
/// leave less than this, Pa.
const DISCRETISATION_PA: f64 = 20.0;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Theorem 2.1 in simulation: from any initial error, under any error of the model within its bound.
    #[test]
    fn prop_the_certified_bound_holds_in_simulation(
        inertia in any::<bool>(),
        initial in -0.2e6..0.2e6_f64,
        errors in prop::collection::vec((0.0..1.0_f64, 0.0..6.3_f64), 15),
    ) {
        let vehicle = Vehicle::two_speed_at().unwrap();
        let design = design_rigid(&vehicle).unwrap();
        let phase = if inertia { Phase::InertiaPhase } else { Phase::TorquePhase };
        let certificate = design.of(phase).unwrap();
        let mut car = Car::start(phase, initial);
        for n in 0..1500_u32 {
            let (size, angle) = errors[n as usize / 100];
            let w = size * certificate.model_error_max_rad_s2;
            // In the torque phase only the turbine speed is an output.
            let w = if inertia { [w * angle.cos(), w * angle.sin()] } else { [w * angle.cos(), 0.0] };
            let error = car.step(w);
            if !car.in_phase {
                break;
            }
            let bound = certificate.error_bound_pa(initial, f64::from(n + 1) * DT_S);
            prop_assert!(error.abs() <= bound + DISCRETISATION_PA, "{n}: {error} Pa, bound {bound} Pa");
        }
    }

    /// Whatever the inputs, a step returns, and a usable sample afterwards gives a finite estimate again.
    #[test]
    fn prop_no_input_stops_an_observer(
        samples in prop::collection::vec((any::<f64>(), any::<f64>(), any::<f64>(), any::<f64>(), any::<f64>()), 1..40),
    ) {
        let vehicle = Vehicle::two_speed_at().unwrap();
        survives(&observer(), &samples)?;
        survives(&compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains()), &samples)?;
        survives(&sliding_observer(&vehicle, design_sliding(&vehicle)), &samples)?;
        survives(&kalman_filter(&vehicle, None), &samples)?;
        survives(&unscented_filter(&vehicle, None), &samples)?;
        survives(&super_twisting(&vehicle), &samples)?;
        survives(&inversion(&vehicle), &samples)?;
        survives(&bounded(&vehicle, observer()), &samples)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// The certificates for a sample time in simulation: whatever torques, readings and valve do within their bounds, the
    /// error stays below what is left of the first one and the certified bound.
    #[test]
    fn prop_the_sampled_bound_holds_in_simulation(
        inertia in any::<bool>(),
        method in prop::sample::select(GainMethod::ALL[1..].to_vec()),
        initial in -0.2e6..0.2e6_f64,
        errors in prop::collection::vec((prop::array::uniform6(-1.0..1.0_f64), any::<bool>()), 60),
    ) {
        const T: f64 = 0.01;
        let vehicle = Vehicle::two_speed_at().unwrap();
        let bounds = vehicle.error_bounds;
        let phase = if inertia { Phase::InertiaPhase } else { Phase::TorquePhase };
        let design = design_discrete(&vehicle, Model::Rigid, method, T).unwrap();
        let certificate = if inertia { &design.inertia_phase } else { &design.torque_phase };
        let observer = rigid_observer(&vehicle, design.rigid_gains());
        let model = observer.model;
        let (command, mut speeds) = (0.25, if inertia { [340.0, 300.0] } else { [360.0, 360.0] });
        let mut state = observer.start();
        for dt in [0.0, 10.0, 1e-9] {
            observer.step(&mut state, &input(dt, speeds[0], speeds[1], command));
        }
        let start = observer.step(&mut state, &input(1e-9, speeds[0], speeds[1], command));
        prop_assert_eq!(start.phase, phase);
        let mut pressure = start.pressure_pa + initial;
        let valve = model.valve.linear(command);
        let phi = (valve.a22_per_s * T).exp();
        let psi = (phi - 1.0) / valve.a22_per_s;
        let gam2 = (psi - T) / valve.a22_per_s;
        let valve_pa_s = ValveErrors::of(&vehicle).largest_pa_s()
            - 0.2 * bounds.shift_pressure_pa * valve.a22_per_s;
        let mut left = initial.abs();
        for ([turbine, output, readings, slip_reading, seen, v], pulsed) in errors {
            // Now and then the worst case at once: everything at its limit.
            let worst = |x: f64| if pulsed { x.signum() } else { x };
            let rows = model.coefficients(phase);
            let torques = drivetrain::ShiftTorques {
                turbine_n_m: worst(turbine) * bounds.turbine_torque_n_m,
                output_n_m: worst(output) * bounds.output_torque_n_m,
                offgoing_n_m: if inertia { worst(output) * bounds.offgoing_torque_n_m } else { 0.0 },
                ..Default::default()
            };
            let w = [rows.turbine.at(&torques), rows.slip_oncoming.at(&torques)];
            let n = [worst(readings) * bounds.turbine_quantum_rad_s, worst(slip_reading) * bounds.slip_quantum_rad_s];
            let m = model.speed_model(phase, ENGINE_RAD_S, speeds[0], speeds[1]);
            // The speeds tell what the pressure was a while ago.
            let old = worst(seen) * bounds.sampling_delay_s * bounds.shift_ramp_pa_s;
            let integral = psi * (pressure + old) + gam2 * valve.b2_pa_s;
            let gain = observer.gains.at(m.friction).of(phase);
            let factor = phi - (0..2).map(|i| gain[i] * m.per_pressure_rad_s2_pa[i] * psi).sum::<f64>();
            for i in 0..2 {
                speeds[i] += T * (m.free_rad_s2[i] + w[i]) + m.per_pressure_rad_s2_pa[i] * integral + n[i];
            }
            if !inertia {
                speeds[1] = speeds[0];
            }
            pressure = phi * pressure + psi * valve.b2_pa_s + worst(v) * psi * valve_pa_s;
            let estimate = observer.step(&mut state, &input(T, speeds[0], speeds[1], command));
            if estimate.phase != phase || speeds[1] < 20.0 {
                break;
            }
            left *= factor.abs();
            let error = (pressure - estimate.pressure_pa).abs();
            // One pascal for rounding.
            prop_assert!(error <= left + certificate.bound_pa + 1.0, "{error} > {left} + {}", certificate.bound_pa);
        }
    }
}

fn survives(observer: &impl Estimator<f64>, samples: &[(f64, f64, f64, f64, f64)]) -> Result<(), TestCaseError> {
    let mut state = observer.start();
    for &(dt_s, engine_rad_s, turbine_rad_s, slip_rad_s, command) in samples {
        let wheel_rad_s = slip_rad_s;
        let input = Input { dt_s, engine_rad_s, turbine_rad_s, slip_rad_s, wheel_rad_s, command };
        let estimate = observer.step(&mut state, &input);
        prop_assert!(estimate.pressure_pa.is_finite() && estimate.clutch_torque_n_m.is_finite());
        prop_assert!(estimate.shaft_torque_n_m.is_none_or(f64::is_finite));
    }
    let usable = Input { wheel_rad_s: 40.0, ..input(0.01, 300.0, 200.0, 0.3) };
    let estimate = observer.step(&mut state, &usable);
    prop_assert!(estimate.health == Health::Good && estimate.pressure_pa.is_finite());
    Ok(())
}

#[test]
fn without_model_error_the_estimate_decays_at_least_with_kappa2() {
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        let vehicle = Vehicle::two_speed_at().unwrap();
        let kappa2 = design_rigid(&vehicle).unwrap().of(phase).unwrap().kappa2_per_s;
        let mut car = Car::start(phase, 0.1e6);
        for n in 1..=1000 {
            let bound = 0.1e6 * (-kappa2 * f64::from(n) * DT_S).exp();
            let error = car.step([0.0; 2]);
            assert!(car.in_phase, "{n}");
            assert!(error.abs() <= bound + DISCRETISATION_PA, "{n}: {error} Pa, bound {bound} Pa");
        }
    }
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
        let estimate = car.observer.step(&mut car.state, &input(DT_S, car.speeds[0], car.speeds[1], car.command));
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
    let mut state = observer.start();
    let good = input(0.01, 300.0, 200.0, 0.3);
    observer.step(&mut state, &good);
    let health = |state: &mut RigidState<f64>, input: Input<f64>| observer.step(state, &input).health;
    assert_eq!(health(&mut state, Input { turbine_rad_s: f64::NAN, ..good }), Health::SpeedsRejected);
    assert_eq!(health(&mut state, Input { engine_rad_s: 1e9, ..good }), Health::SpeedsRejected);
    assert_eq!(health(&mut state, Input { command: -0.1, ..good }), Health::CommandRejected);
    assert_eq!(health(&mut state, Input { dt_s: f64::INFINITY, ..good }), Health::TimeRejected);
    assert_eq!(health(&mut state, good), Health::Good);
    // Without any speed the estimate is the open loop: after long, gain times current.
    let estimate = observer.step(&mut state, &Input { dt_s: 5.0, slip_rad_s: f64::NAN, ..good });
    assert!((estimate.pressure_pa - 0.3e6).abs() < 1.0);
}

#[test]
fn zero_gain_is_the_valve_model_alone() {
    let observer = RigidObserver { gains: RigidGains::open_loop().into(), ..observer() };
    let mut state = observer.start();
    let mut pressure = 0.0;
    for n in 0..300 {
        let command = 0.2 + 0.1 * (f64::from(n) * 0.05).sin();
        let estimate = observer.step(&mut state, &input(0.01, 300.0, 250.0 - f64::from(n), command));
        assert!((estimate.pressure_pa - pressure).abs() < 1e-6);
        pressure = observer.model.valve.linear(command).advance(pressure, 0.01);
    }
}

#[test]
fn single_precision_follows_double_precision() {
    let vehicle = Vehicle::two_speed_at().unwrap();
    let compliant = compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains());
    assert_single_follows_double(&observer(), &observer().cast::<f32>(), 1.0);
    assert_single_follows_double(&compliant, &compliant.cast::<f32>(), 1.0);
    // The certificates say how much rounding may cost.
    for method in &GainMethod::ALL[1..] {
        let design = design_discrete(&vehicle, Model::Rigid, *method, 0.01).unwrap();
        let observer = rigid_observer(&vehicle, design.rigid_gains());
        let rounding = design.inertia_phase.contributions.iter().find(|part| part.cause == "float32 rounding").unwrap();
        assert_single_follows_double(&observer, &observer.cast::<f32>(), rounding.bound_pa);
    }
    let (twisting, inverted) = (super_twisting(&vehicle), inversion(&vehicle));
    assert_single_follows_double(&twisting, &twisting.cast::<f32>(), 1.0);
    // These trust the speeds almost fully: a rounded speed, as an acceleration over 10 ms, is a torque of some 0.01 N m
    // and a pressure of some 20 Pa.
    let (filter, unscented) = (kalman_filter(&vehicle, None), unscented_filter(&vehicle, None));
    assert_single_follows_double(&inverted, &inverted.cast::<f32>(), 50.0);
    assert_single_follows_double(&filter, &filter.cast::<f32>(), 50.0);
    assert_single_follows_double(&unscented, &unscented.cast::<f32>(), 50.0);
}

/// A speed of 340 rad/s is rounded to 3e-5 rad/s, which a gain of 1527 Pa s/rad makes 0.05 Pa a sample;
/// pressures are rounded to 0.03 Pa.
fn assert_single_follows_double(double: &impl Estimator<f64>, single: &impl Estimator<f32>, tolerance_pa: f64) {
    let mut car = Car::start(Phase::InertiaPhase, 0.1e6);
    let (mut a, mut b) = (double.start(), single.start());
    for n in 0..500 {
        car.step([100.0, -200.0]);
        let dt = if n == 1 { 10.0 } else { 0.01 };
        let wheel_rad_s = (car.speeds[0] - 0.6 * car.speeds[1]) / 3.0;
        let x = Input { wheel_rad_s, ..input(dt, car.speeds[0], car.speeds[1], car.command) };
        #[expect(clippy::cast_possible_truncation, reason = "single precision is what is tested")]
        let y = Input {
            dt_s: x.dt_s as f32,
            engine_rad_s: x.engine_rad_s as f32,
            turbine_rad_s: x.turbine_rad_s as f32,
            slip_rad_s: x.slip_rad_s as f32,
            wheel_rad_s: x.wheel_rad_s as f32,
            command: x.command as f32,
        };
        let (x, y) = (double.step(&mut a, &x), single.step(&mut b, &y));
        assert_eq!(x.phase, y.phase);
        let difference = (x.pressure_pa - f64::from(y.pressure_pa)).abs();
        assert!(difference < tolerance_pa, "{n}: {} {}", x.pressure_pa, y.pressure_pa);
    }
}

/// The valve of Remark 2.1: held against its own nonlinear law, near the point of its linearisation.
#[test]
fn a_pulse_width_valve_is_followed_near_its_operating_point() {
    let mut vehicle = Vehicle::two_speed_at().unwrap();
    let (flow, line, operating) = (6000.0, 1e6, 0.3e6);
    vehicle.observer_valve =
        Valve::PulseWidth { flow_sqrt_pa_s: flow, line_pressure_pa: line, operating_pressure_pa: operating };
    vehicle.limits.command_max = 100.0;
    vehicle.uncertainty.command = Some((40.0, 60.0));
    // This valve is slower than the one that the file's requirements were written for.
    vehicle.torque_phase.offset_max_pa = 1e6;
    vehicle.inertia_phase.offset_max_pa = 1e6;
    let certificates = design_rigid(&vehicle).unwrap();
    assert_eq!(certificates.inertia_phase.vertices.len(), 4);

    let observer = rigid_observer(&vehicle, RigidGains::open_loop());
    let mut state = observer.start();
    let mut truth = 0.0_f64;
    for n in 0..2000 {
        let duty = 31.0 + 0.5 * (f64::from(n) * 0.002).sin();
        let estimate = observer.step(&mut state, &input(1e-3, 300.0, 300.0, duty));
        if n > 1000 {
            // The settled pressures agree within the linearisation's reach.
            assert!((truth - estimate.pressure_pa).abs() < 0.02e6, "{n}: {truth} {}", estimate.pressure_pa);
        }
        let drop = 0.01 * line * duty - truth;
        truth += 1e-3 * flow * drop.signum() * drop.abs().sqrt();
    }
}

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
        let mut state = slow.start();
        for first in [0.0, 10.0, 1e-9] {
            slow.step(&mut state, &input(first, speeds[0], speeds[1], command));
        }
        // The truth starts elsewhere than the estimate; its speeds follow the frozen model exactly.
        pressure += 0.02e6;
        (0..12)
            .map(|_| {
                let m = model.speed_model(Phase::InertiaPhase, ENGINE_RAD_S, speeds[0], speeds[1]);
                let valve = model.valve.linear(command);
                let (phi, a) = ((valve.a22_per_s * dt).exp(), valve.a22_per_s);
                let psi = (phi - 1.0) / a;
                let integral = psi * pressure + (psi - dt) / a * valve.b2_pa_s;
                let moved = |i: usize| dt * m.free_rad_s2[i] + m.per_pressure_rad_s2_pa[i] * integral;
                speeds = [speeds[0] + moved(0), speeds[1] + moved(1)];
                pressure = phi * pressure + psi * valve.b2_pa_s;
                // The speeds are set back so that the phase goes on; the observer sees their change only.
                let estimate = slow.step(&mut state, &input(dt, speeds[0], speeds[1], command));
                (pressure - estimate.pressure_pa).abs()
            })
            .take_while(|error| error.is_finite())
            .collect::<Vec<f64>>()
    };
    let (exact, euler) = (errors(Discretisation::Exact), errors(Discretisation::Euler));
    assert!(exact[5] < 0.05 * exact[0], "{exact:?}");
    assert!(euler[5] > euler[0], "{euler:?}");
}

/// A car that obeys the compliant model: both estimates converge from wrong starts.
#[test]
fn the_compliant_observer_finds_pressure_and_shaft_torque_of_its_own_model() {
    let vehicle = Vehicle::two_speed_at().unwrap();
    let design = design_compliant(&vehicle).unwrap();
    let observer = compliant_observer(&vehicle, design.gains());
    let model = observer.model;
    for (phase, mut speeds) in
        [(Phase::TorquePhase, [360.0, 360.0, 48.0]), (Phase::InertiaPhase, [340.0, 300.0, 160.0 / 3.0])]
    {
        let command = 0.25;
        let at = |dt: f64, y: [f64; 3]| Input { wheel_rad_s: y[2], ..input(dt, y[0], y[1], command) };
        let mut state = observer.start();
        for dt in [0.0, 10.0, 1e-9] {
            observer.step(&mut state, &at(dt, speeds));
        }
        let start = observer.step(&mut state, &at(1e-9, speeds));
        assert_eq!(start.phase, phase);
        let (mut shaft, mut pressure) = (start.shaft_torque_n_m.unwrap() + 100.0, start.pressure_pa + 0.05e6);
        let kappa2 = design.of(phase).unwrap().kappa2_per_s;
        // Normalised: 100 N m are 0.1 and 0.05 MPa are 0.5.
        let initial = 0.1_f64.hypot(0.5);
        for n in 1..=1500 {
            let m = model.speed_model(phase, ENGINE_RAD_S, speeds[0], speeds[1], speeds[2]);
            let shaft_rate = model.shaft_rate(speeds[0], speeds[1], speeds[2]);
            let next = model.rigid.valve.linear(command).advance(pressure, DT_S);
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
            let estimate = observer.step(&mut state, &at(DT_S, speeds));
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
    let vehicle = Vehicle::two_speed_at().unwrap();
    let observer = compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains());
    let mut state = observer.start();
    let sample = Input { wheel_rad_s: 40.0, ..input(0.0, 300.0, 300.0, 0.0) };
    let shaft = observer.step(&mut state, &sample).shaft_torque_n_m.unwrap();
    let turbine = vehicle.converter.torques(ENGINE_RAD_S, 300.0).turbine_n_m;
    // Turbine torque times both ratios, less what accelerates the gearbox.
    assert!((0.9..1.0).contains(&(shaft / (turbine * 2.5 * 3.0))), "{shaft}");
    let lost = observer.step(&mut state, &Input { wheel_rad_s: f64::NAN, dt_s: 0.01, ..sample });
    assert_eq!(lost.health, Health::SpeedsRejected);
    assert!((lost.shaft_torque_n_m.unwrap() / shaft - 1.0).abs() < 0.05);
}

/// In sliding the pressure error decays by the pressure gains; what remains is their switching.
#[test]
fn the_sliding_observer_brings_a_wrong_pressure_down() {
    let vehicle = Vehicle::two_speed_at().unwrap();
    let mut car = Car::start(Phase::InertiaPhase, 0.08e6);
    let sliding = sliding_observer(&vehicle, design_sliding(&vehicle));
    let mut state = sliding.start();
    for dt in [0.0, 10.0, 1e-9] {
        sliding.step(&mut state, &input(dt, car.speeds[0], car.speeds[1], car.command));
    }
    let mut error = f64::NAN;
    for _ in 0..1200 {
        car.step([0.0; 2]);
        let estimate = sliding.step(&mut state, &input(DT_S, car.speeds[0], car.speeds[1], car.command));
        error = car.pressure_pa - estimate.pressure_pa;
    }
    // Open loop would have e^-3 of the 0.08 MPa left.
    assert!(error.abs() < 0.5 * 0.08e6 * (-3.0_f64).exp(), "{error}");
}

#[test]
fn over_a_long_gap_the_valve_model_serves_alone() {
    let mut car = Car::start(Phase::InertiaPhase, 0.0);
    car.step([0.0; 2]);
    let before = car.observer.step(&mut car.state, &input(0.0, 340.0, 300.0, 0.25)).pressure_pa;
    // Speeds that have nothing to do with those before the gap must not be taken for a pressure.
    let after = car.observer.step(&mut car.state, &input(0.2, 250.0, 100.0, 0.25));
    let valve = car.observer.model.valve.linear(0.25).advance(before, 0.2);
    assert!((after.pressure_pa - valve).abs() < 1e-6 && after.health == Health::Good, "{}", after.pressure_pa);
    let unknown = car.observer.step(&mut car.state, &input(f64::NAN, 250.0, 100.0, 0.25));
    assert_eq!((unknown.health, unknown.pressure_pa), (Health::TimeRejected, after.pressure_pa));
    // After a time step that was none there is no sample to correct by either.
    let next = car.observer.step(&mut car.state, &input(0.01, 200.0, 50.0, 0.25));
    let valve = car.observer.model.valve.linear(0.25).advance(unknown.pressure_pa, 0.01);
    assert!((next.pressure_pa - valve).abs() < 1e-6, "{}", next.pressure_pa);
}
