//! Tests of the valve models of the elements.

use super::*;
use crate::ValveModel;
use crate::gearbox::ShiftElement;
use crate::gearbox::{Piston, ValveLimits};
use drivetrain::{Clutch, ClutchValve, Cylinder, Table1, ValveMaps};

const LIMITS: ValveLimits<f64> = ValveLimits { command_max: 1.2, command_error: 0.01, pressure_max_pa: 1.1e6 };

const UNCERTAINTY: ElementUncertainty<f64> = ElementUncertainty {
    drag_n_m: 1.0,
    torque_fraction: 0.12,
    slow_part: 0.75,
    valve_gain: 0.06,
    kiss_point_pa: 7e3,
    valve_lag_fraction: 0.3,
    valve_delay_s: 9e-3,
    pressure_pa: 7e3,
    widths: [1.0; 3],
};

fn element() -> FrictionElement<f64> {
    let maps = ValveMaps {
        time_constant_s: Table1::new(&[0.0, 1e5, 1e6], &[0.1, 0.06, 0.03]).unwrap(),
        gain_pa_a: Table1::new(&[0.0, 0.5, 1.0], &[0.7e6, 1.0e6, 1.2e6]).unwrap(),
        delay_s: Table1::constant(0.015),
    };
    FrictionElement {
        clutch: Clutch {
            mean_radius_m: 0.13,
            friction_faces: 3.0,
            piston_area_m2: 0.01,
            return_spring_n: 600.0,
            friction: Table1::constant(0.13),
            static_friction: 0.14,
        },
        valve: ValveModel { valve: ClutchValve::Proportional(maps), delay_s: 0.015 },
        limits: LIMITS,
        piston: None,
        budget: None,
        uncertainty: UNCERTAINTY,
    }
}

fn with_stroke() -> FrictionElement<f64> {
    let element = element();
    let piston = Piston::new(Cylinder::of_clutch(&element.clutch), 0.16);
    FrictionElement { piston: Some(piston), ..element }
}

/// With late and missing readings, and commands above what the supply gives.
#[test]
fn a_valve_that_rests_goes_on_as_one_that_never_does() {
    [element(), with_stroke()].iter().for_each(rests_as_one_that_never_does);
}

fn rests_as_one_that_never_does(element: &FrictionElement<f64>) {
    let mut rests = ElementState::new(element);
    let (mut moves, mut rested) = (rests, 0);
    for k in 0..6000_usize {
        // Every new command is late, after two that were lost or out of order.
        let (held, at) = (k / 495, k % 11);
        let value = [0.3, 0.0, 1.0, 0.31, 0.9][held % 5];
        let age_s = if at == 0 { 0.025 } else { 0.0 };
        let command = (at < 9 || held % 2 == 0).then_some(Reading { value, age_s });
        let health = [&mut rests, &mut moves].map(|valve: &mut ElementState<f64>| valve.step(element, command, 0.01));
        assert_eq!(health[0], health[1]);
        [&mut rests, &mut moves].into_iter().for_each(|valve| valve.move_pistons(element, 0.01));
        // So it never begins to rest.
        moves.newest.iter_mut().for_each(|newest| newest.alike_s = 0.0);
        rested += usize::from(rests.rate_pa_s == 0.0);
        assert!((rests.valve_pa - moves.valve_pa).abs() <= RESTS_PA, "{k}: {} {}", rests.valve_pa, moves.valve_pa);
        let both = [rests, moves].map(|valve| valve.pressure_pa());
        assert!((both[0] - both[1]).abs() <= 5.0 * RESTS_PA, "{k}: {both:?}");
        assert!((rests.per_lag_pa - moves.per_lag_pa).abs() <= RESTS_PA, "{k}");
        assert!((rests.rate_pa_s - moves.rate_pa_s).abs() <= 100.0 * RESTS_PA, "{k}");
    }
    assert!(rested > 3000 && moves.newest.is_some_and(|newest| newest.rests_s.is_none()), "{rested}");
}

/// Near the kiss point and above it, with errors that are known.
#[test]
fn an_element_holds_what_it_carries_by_the_estimate() {
    let (element, shift) = (element(), ShiftClutch { element: ShiftElement::Friction(0), alpha: -1.4, ratio: 2.0 });
    let mut state = ElementState::new(&element);
    state.step(&element, Some(Reading::now(0.0)), 0.0);
    for (valve_pa, factor, pressure, kiss) in [
        (2e5, 0.0, 0.0, 0.0),
        (2e5, 0.8, 0.5, -0.7),
        (6e4, -1.0, 0.3, 0.4),
        (6.5e4, 0.5, -0.6, 0.9),
        (1e4, 0.5, 0.0, 0.0),
    ] {
        (state.valve_pa, state.rate_pa_s) = (valve_pa, 3e5);
        let wrong = PressureError { pressure, kiss, variance: [0.5, 0.7], covariance: -0.2 };
        let slips = state.torque(&element, &shift, [0.0, -1.0], &wrong);
        let carries = slips.base_n_m
            + factor * slips.per_friction_n_m
            + kiss * slips.per_kiss_n_m
            + pressure * slips.per_pressure_n_m;
        // Its static friction is larger.
        let holds = state.holds(&element, &shift, factor, &wrong);
        assert!((holds + carries * 0.14 / 0.13).abs() < 1e-9, "{valve_pa}: {holds} {carries}");
        assert!((holds > 0.0) == (valve_pa > 1.5e4), "{valve_pa}: {holds}");
    }
}

/// While its piston strokes it carries what one without a stroke would, times the probability that there is none to make, whatever the
/// pressure at the valve; then it is as one without a stroke.
#[test]
fn an_element_whose_plates_do_not_touch_carries_little() {
    let (with, without) = (with_stroke(), element());
    let shift = ShiftClutch { element: ShiftElement::Friction(0), alpha: 1.0, ratio: 2.0 };
    let wrong = PressureError { pressure: 0.4, kiss: 0.3, variance: [0.8, 0.9], covariance: 0.0 };
    let mut states = [with, without].map(|element| (element, ElementState::new(&element)));
    let mut carried = [0.0; 300];
    for (k, carried) in carried.iter_mut().enumerate() {
        let command = Some(Reading::now(if k < 5 { 0.0 } else { 0.25 }));
        let [stroke, none] = states.each_mut().map(|(element, state)| {
            state.step(element, command, 0.01);
            state.move_pistons(element, 0.01);
            let torque = state.torque(element, &shift, [50.0, 1.0], &wrong);
            let all = torque.base_n_m + 0.3 * torque.per_kiss_n_m + 0.4 * torque.per_pressure_n_m;
            // The static friction is larger.
            let holds = state.holds(element, &shift, 0.0, &wrong);
            assert!((holds - all * 0.14 / 0.13).abs() < 1e-9 || all < 0.0, "{k}: {holds} {all}");
            (all, torque.open_loop_n_m, state.pressure_pa())
        });
        *carried = stroke.0;
        if k < 20 {
            // The probability, and 0.4 of the standard deviation that comes with it.
            assert!((0.0..=(0.1 + 0.4 * 0.3) * none.0 + 1e-9).contains(&stroke.0), "{k}: {stroke:?} {none:?}");
            assert_eq!(stroke.1, 0.0, "{k}");
        }
        if k > 200 {
            assert!((stroke.0 - none.0).abs() < 0.01 * none.0, "{k}: {stroke:?} {none:?}");
            assert!((stroke.2 - none.2).abs() < 1e3, "{k}: the leak takes little");
        }
    }
    assert!(carried.windows(2).all(|pair| pair[1] > pair[0] - 0.5) && carried[250] > 30.0);
    // Both rest then.
    assert!(states.iter().all(|(_, state)| state.newest.is_some_and(|newest| newest.rests_s.is_some())));
}

/// A valve model with what is learnt is that of a valve with this lag and delay, which are so far off by the change per standard deviation.
#[test]
fn a_learnt_lag_and_delay_are_those_of_the_valve() {
    let known = element();
    let truth = ValveModel { valve: known.valve.valve.changed(1.0 + 0.8 * 0.3, 1.0, None), delay_s: 0.006 };
    let truth = FrictionElement { valve: truth, ..known };
    let [mut learnt, mut slow, mut late, mut unlearnt] = [ElementState::new(&known); 4];
    let mut true_state = ElementState::new(&truth);
    for (state, mean) in [(&mut learnt, [0.8, -1.0]), (&mut slow, [0.01, 0.0]), (&mut late, [0.0, 0.01])] {
        state.take_timing(&known, &ValveTiming { mean, variance: [0.3; 2] });
        assert_eq!(state.taken_off(), mean);
    }
    let (mut max_pa, mut found, mut expected) = (0.0_f64, [0.0; 2], [0.0; 2]);
    for k in 0..150 {
        let command = Some(Reading::now(if k < 20 { 0.1 } else { 0.25 + 0.002 * f64::from(k) }));
        true_state.step(&truth, command, 0.01);
        for state in [&mut learnt, &mut slow, &mut late, &mut unlearnt] {
            state.step(&known, command, 0.01);
        }
        assert!((learnt.valve_pa - true_state.valve_pa).abs() < 1.0, "{k}");
        max_pa = max_pa.max((unlearnt.valve_pa - true_state.valve_pa).abs());
        let by_pa = unlearnt.by_timing_pa(&UNCERTAINTY);
        for (k, state) in [&slow, &late].into_iter().enumerate() {
            found[k] += (state.valve_pa - unlearnt.valve_pa) / 0.01;
            expected[k] += by_pa[k];
        }
    }
    assert!(max_pa > 5e3, "{max_pa}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(expected < -1e5 && (found / expected - 1.0).abs() < 0.1, "{found} {expected}");
    }
    // No length of the lag and no command before it was sent.
    learnt.take_timing(&known, &ValveTiming { mean: [-9.0, -9.0], variance: [1.0; 2] });
    assert_eq!((learnt.lag, learnt.delay_s), (LAG_MIN, 0.0));
}

#[test]
fn a_command_that_is_lost_while_the_valve_rests_is_said_to_be() {
    let element = element();
    let mut state = ElementState::new(&element);
    (0..500).for_each(|_| {
        state.step(&element, Some(Reading::now(0.3)), 0.01);
    });
    assert!(state.newest.is_some_and(|newest| newest.rests_s.is_some()));
    let health: [ChannelHealth; 200] = core::array::from_fn(|_| state.step(&element, None, 0.01));
    assert_eq!((health[0], health[199]), (ChannelHealth::Absent, ChannelHealth::Lost));
}
