//! The plant against solutions known in closed form.

use crate::common::{bare_gear_train, e1, samples, smooth_vehicle, vehicle};
use drivetrain::Engagement;
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::{Contact, Direction, HybridIntegrator, Inputs, Mode, Powertrain, State};

fn state(turbine_rad_s: f64, output_rad_s: f64) -> State {
    State { engine_rad_s: 100.0, turbine_rad_s, output_rad_s, ..State::ZERO }
}

/// Two inertias slip against a constant friction torque: the slip falls linearly, `dw/dt = -T k M^-1 k'`,
/// and at lock-up both turn with the momentum they had.
#[test]
fn two_inertias_lock_when_and_at_the_speed_they_should() {
    let vehicle = bare_gear_train();
    let pressure = 0.3e6;
    let torque = vehicle.oncoming.clutch.torque_capacity(pressure, 1.0);
    let shift = vehicle.shift;
    let start = State { oncoming_valve_pa: pressure, ..state(300.0, 90.0) };
    let slip = shift.oncoming_slip(start.turbine_rad_s, start.output_rad_s);
    let rate = shift.coefficients(Engagement::BothSlipping).slip_oncoming.per_oncoming_torque * torque;
    let lock_time = -slip / rate;
    let expected = shift.after_lock_up(shift.slip_oncoming, start.turbine_rad_s, start.output_rad_s);

    let powertrain = Powertrain::new(vehicle);
    let inputs = Inputs { throttle: 0.0, offgoing_settled_pa: 0.0, oncoming_settled_pa: pressure };
    let mut plant = HybridIntegrator::new(&powertrain, 0.0, start, &inputs).unwrap();
    let mut slipping_until = 0.0;
    plant
        .advance(&powertrain, &inputs, 2.0 * lock_time, &mut |step| {
            if step.mode.oncoming != Contact::Stuck {
                slipping_until = step.end_s;
            }
        })
        .unwrap();
    assert!((slipping_until - lock_time).abs() < 1e-10, "{slipping_until} {lock_time}");
    assert_eq!(plant.mode().oncoming, Contact::Stuck);
    assert!((plant.state().turbine_rad_s - expected.0).abs() < 1e-9);
    assert!((plant.state().output_rad_s - expected.1).abs() < 1e-9);
}

/// At rest neither clutch slips. Whatever their pressures and the torques, a clutch that sticks holds what it must, and one that does
/// not begins to slip in the direction of its torque.
#[test]
fn clutches_without_slip_are_decided_together() {
    let mut vehicle = bare_gear_train();
    vehicle.driveline.shaft_stiffness_n_m_rad = 13e3;
    let powertrain = Powertrain::new(vehicle);
    let pressures = [0.0, 0.06e6, 0.15e6, 0.3e6, 1e6];
    let mut met: Vec<[bool; 2]> = Vec::new();
    for (offgoing, oncoming) in pressures.iter().flat_map(|&a| pressures.map(|b| (a, b))) {
        for (engine_rad_s, twist_rad) in [(0.0, 0.0), (100.0, 0.0), (300.0, 0.05), (300.0, -0.05), (0.0, 0.1)] {
            let start = State {
                engine_rad_s,
                twist_rad,
                offgoing_valve_pa: offgoing,
                oncoming_valve_pa: oncoming,
                ..state(0.0, 0.0)
            };
            let inputs = Inputs { throttle: 0.0, offgoing_settled_pa: offgoing, oncoming_settled_pa: oncoming };
            let mut plant = HybridIntegrator::new(&powertrain, 0.0, start, &inputs).unwrap();
            let mode = plant.mode();
            let stuck = [mode.offgoing, mode.oncoming].map(|contact| contact == Contact::Stuck);
            let case = format!("{offgoing} {oncoming} {engine_rad_s} {twist_rad}: {mode:?}");
            let margins = powertrain.margins(mode, &start, &inputs);
            assert!(margins.iter().all(|&margin| margin > -1e-6), "{case}: {margins:?}");
            // A clutch in balance between two directions may go either way; any other slips as it was decided.
            plant.advance(&powertrain, &inputs, 1e-5, &mut |_| {}).unwrap();
            let margins = powertrain.margins(mode, plant.state(), &inputs);
            assert!(plant.mode() != mode || margins.iter().all(|&margin| margin > -1e-6), "{case}: {margins:?}");
            assert_eq!(plant.mode(), mode, "{case}");
            met.push(stuck);
        }
    }
    for combination in [[true, true], [true, false], [false, true], [false, false]] {
        assert!(met.contains(&combination), "{combination:?}");
    }
}

/// Gear train in first gear, shaft and wheel without tyre: two inertias on a spring,
/// `w^2 = K (1/J_gearbox + 1/J_wheel)`.
#[test]
fn the_drive_shaft_swings_at_its_natural_frequency() {
    let mut vehicle = bare_gear_train();
    vehicle.driveline.shaft_stiffness_n_m_rad = 13e3;
    let (ratio, final_ratio) = (vehicle.shift.ratio_offgoing(), vehicle.driveline.final_ratio);
    // Kinetic energy at unit output speed gives the inertia seen there, and the final drive squares its ratio.
    let gearbox = 2.0 * vehicle.shift.kinetic_energy(ratio, 1.0) * final_ratio * final_ratio;
    let expected = (13e3 * (1.0 / gearbox + 1.0 / vehicle.driveline.wheel_inertia_kg_m2)).sqrt();

    let powertrain = Powertrain::new(vehicle);
    let inputs = Inputs { throttle: 0.0, offgoing_settled_pa: 1e6, oncoming_settled_pa: 0.0 };
    let start = State { twist_rad: 0.01, offgoing_valve_pa: 1e6, ..state(0.0, 0.0) };
    let mut plant = HybridIntegrator::with_tolerance(&powertrain, 0.0, start, &inputs, 1e-9).unwrap();
    assert_eq!(plant.mode().offgoing, Contact::Stuck);
    // The twist is a cosine; follow it over ten periods.
    let period = std::f64::consts::TAU / expected;
    for n in 1..=40 {
        plant.advance(&powertrain, &inputs, f64::from(n) * period / 4.0, &mut |_| {}).unwrap();
        let expected_twist = [0.0, -0.01, 0.0, 0.01][(n as usize - 1) % 4];
        assert!((plant.state().twist_rad - expected_twist).abs() < 1e-6, "{n}: {}", plant.state().twist_rad);
    }
}

#[test]
fn gear_ratios_are_exact_before_and_after_the_shift() {
    let samples = samples(&e1(), RELATIVE_TOLERANCE);
    let ratio = |time: f64| {
        let sample = samples.iter().find(|sample| sample.time_s >= time).unwrap();
        sample.state.turbine_rad_s / sample.state.output_rad_s
    };
    assert!((ratio(6.0) - 2.5).abs() < 1e-12 && (ratio(9.0) - 1.0).abs() < 1e-12);
}

/// Steady climb in first gear: what the turbine gives arrives at the wheels times both ratios.
#[test]
fn shaft_torque_in_steady_gear_is_turbine_torque_times_the_ratios() {
    let samples = samples(&e1(), RELATIVE_TOLERANCE);
    let sample = samples.iter().find(|sample| sample.time_s >= 7.0).unwrap();
    let v = vehicle();
    let acceleration = sample.vehicle_m_s2 / v.road.wheel_radius_m * v.driveline.final_ratio;
    let inertia = 2.0 * v.shift.kinetic_energy(2.5, 1.0);
    let expected = (2.5 * sample.torques.shift.turbine_n_m - inertia * acceleration) * v.driveline.final_ratio;
    assert!((sample.torques.shaft_n_m / expected - 1.0).abs() < 2e-3, "{} {expected}", sample.torques.shaft_n_m);
}

#[test]
fn halving_the_step_shows_order_3_on_a_smooth_phase() {
    let powertrain = Powertrain::new(smooth_vehicle());
    let slipping = Contact::Slipping(Direction::Forward);
    let mode = Mode { offgoing: Contact::Slipping(Direction::Backward), oncoming: slipping };
    let inputs = Inputs { throttle: 0.5, offgoing_settled_pa: 0.0, oncoming_settled_pa: 0.3e6 };
    let start = State {
        engine_rad_s: 380.0,
        twist_rad: 0.03,
        wheel_rad_s: 48.0,
        vehicle_m_s: 14.3,
        oncoming_valve_pa: 0.25e6,
        ..state(360.0, 144.5)
    };
    let tolerance = plant::rosenbrock::Tolerance { relative: 1.0, scale: State::SCALE.to_array() };
    let end = |steps: u32| {
        let f = |x: &[f64; plant::state::STATES]| powertrain.derivative(mode, x, &inputs);
        (0..steps).fold(start.to_array(), |x, _| {
            let state = State::from_array(x);
            let row = powertrain.stiff_row(&state, powertrain.torques(mode, &state, &inputs).tyre_n);
            plant::rosenbrock::step(&f, &|x| (f(x), ()), &x, &f(&x), &[row], 0.08 / f64::from(steps), &tolerance).end
        })
    };
    let reference = end(8192);
    let error = |steps: u32| {
        let scaled = |(i, x): (usize, &f64)| ((x - reference[i]) / tolerance.scale[i]).powi(2);
        end(steps).iter().enumerate().map(scaled).sum::<f64>().sqrt()
    };
    let order = (error(128) / error(256)).log2();
    assert!((order - 3.0).abs() < 0.2, "order {order}");
}
