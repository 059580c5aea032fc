//! Speeds that come late by a stated time.

use car::{Car, ErrorBudget};
use observer::gearbox::{GearboxState, ShiftInput};
use observer::{ShiftTables, gearbox_filter};
use plant::car::CarShift;
use study::gearbox::matrix::{drawn_car, neighbouring_shifts};
use study::gearbox::{inputs, simulated};

use super::cars::{cars, sensors};
use super::ratios::torque_ratios;

/// Torque errors over those of the open loop in torque and inertia phase, of a car whose speeds are late by these times, s: engine, turbine, output, wheel.
/// And values outside their guaranteed range.
fn ratios(known: &Car, delays_s: [f64; 4]) -> ([f64; 2], usize) {
    let mut sensors = sensors();
    let each = [&mut sensors.engine, &mut sensors.turbine, &mut sensors.output, &mut sensors.wheel];
    for (sensor, delay_s) in each.into_iter().zip(delays_s) {
        sensor.delay_s = delay_s;
    }
    torque_ratios(known, &sensors, &sensors)
}

#[test]
fn speeds_that_are_late_by_a_stated_time_cost_little() {
    // All of them, the turbine alone, the wheels alone.
    let delays_s: [&[[f64; 4]]; 3] =
        [&[[0.02; 4], [0.0, 0.01, 0.0, 0.0], [0.0, 0.0, 0.0, 0.03]], &[[0.03; 4]], &[[0.02; 4]]];
    for (known, delays_s) in cars().iter().zip(delays_s) {
        let (on_time, _) = ratios(known, [0.0; 4]);
        for &delays in delays_s {
            let (late, outside) = ratios(known, delays);
            println!("{}: {late:.3?} with delays of {delays:?} s, {on_time:.3?} without", known.gearbox.gears.len());
            assert!(late[1] < 1.4 * on_time[1] && late[0] < 1.1 * on_time[0], "{late:?} {on_time:?}");
            assert_eq!(outside, 0);
        }
    }
}

/// Two rows of 10 ms later every reading of the speeds.
#[test]
fn what_is_learnt_from_late_speeds_is_what_is_learnt_from_the_same_on_time() {
    let (known, sensors) = (&cars()[0], sensors());
    let budget = ErrorBudget::of_car(known).read_by(known, Some(&sensors));
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let on_time = gearbox_filter(known, &tables, &budget, Some(&sensors));
    let mut late = on_time;
    for sensor in late.readings.iter_mut().chain([&mut late.engine.0]) {
        sensor.delay_s = 0.02;
    }
    let shift = neighbouring_shifts(known, &tables).0[0];
    let truth = drawn_car(known, shift.from, shift.to, 0);
    let samples = simulated(known, &truth, &CarShift::usual(known, shift.from, shift.to, shift.throttle())).unwrap();
    let inputs: Vec<_> = inputs(known, &tables, &samples, &sensors, 0).into_iter().map(|(_, input)| input).collect();
    let mut of_on_time = on_time.start();
    for input in &inputs {
        on_time.step(&mut of_on_time, input);
    }
    let mut of_late = late.start();
    for row in 0..inputs.len() + 2 {
        let now = inputs[row.min(inputs.len() - 1)];
        let then = row.checked_sub(2).map(|row| inputs[row]);
        let input = ShiftInput {
            engine_rad_s: then.and_then(|of| of.engine_rad_s),
            turbine_rad_s: then.and_then(|of| of.turbine_rad_s),
            output_rad_s: then.and_then(|of| of.output_rad_s),
            wheel_rad_s: then.and_then(|of| of.wheel_rad_s),
            ..now
        };
        late.step(&mut of_late, &input);
    }
    let learnt = |state: &GearboxState<f64>| {
        let each = (0..known.clutches.len()).filter_map(|at| on_time.learnt_element(state.learnt(), at));
        each.flat_map(|of| [of.torque_fraction, of.kiss_pa.map(|pa| 1e-5 * pa)].concat()).collect::<Vec<f64>>()
    };
    let (found, right) = (learnt(&of_late), learnt(&of_on_time));
    assert!(
        right.iter().any(|value| value.abs() > 0.01) && found.len() == right.len(),
        "the shift has shown something"
    );
    // Within a hundredth of their standard deviations: the rows are not exactly 10 ms apart.
    assert!(found.iter().zip(&right).all(|(found, right)| (found - right).abs() < 1e-3), "{found:?} {right:?}");
}
