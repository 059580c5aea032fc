//! One car of the many of `draws.rs`, with few shifts: what CI has time for.
#![expect(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{Logs, TestCar, TestShift};
use fit::{Fit, Parameter, Verdict};

/// A car fitted to shifts, and the error of its torque on other shifts over that with the given file.
fn fitted(seed: u64, logs: Logs, count: u64) -> (TestCar, Fit, f64) {
    let mut car = TestCar::drawn(seed);
    let shifts: Vec<_> = (0..count).map(|number| car.shift(number, logs).record).collect();
    let fit = fit::fit(&car.file, &shifts, &[], car.ages(), &mut |_| {}).unwrap();
    let vehicle = fit.vehicle_file(&car.file, "a simulation").unwrap();
    let others: Vec<TestShift> = (100..103).map(|number| car.shift(number, logs)).collect();
    let [before, after] =
        [&car.file, &vehicle].map(|vehicle| others.iter().map(|shift| shift.errors(vehicle)[0]).sum::<f64>());
    (car, fit, (after / before).sqrt())
}

/// How many of the parameters lie within their stated 95 %.
fn inside(car: &TestCar, fit: &Fit) -> (usize, usize) {
    let held = fit.priors.iter().enumerate().filter(|(i, prior)| {
        (fit.unknowns[*i] - car.true_value(prior.parameter)).abs() <= 1.96 * fit.precision.stated[(*i, *i)].sqrt()
    });
    (held.count(), fit.priors.len())
}

#[test]
fn speeds_and_current_give_the_torque_but_neither_valve_gain_nor_torque_scale() {
    let (car, fit, ratio) = fitted(2, Logs::SpeedsAndCurrent, 4);
    assert!(ratio < 0.35, "{ratio}");
    let (held, all) = inside(&car, &fit);
    assert!(held + 2 >= all, "{held} of {all}");
    assert_eq!(fit.verdict(Parameter::Gain), Verdict::NotTold);
    assert_eq!(fit.torque_scale_verdict(), Verdict::NotTold);
    assert_ne!(fit.verdict(Parameter::Lag), Verdict::NotTold);
    let [before, after] =
        fit.combination_sd(&[(Parameter::Friction, 1.0), (Parameter::Gain, 1.0), (Parameter::Capacity, -1.0)]);
    assert!(after < 0.3 * before, "{after} of {before}");
}

#[test]
fn an_engine_torque_signal_and_one_pressure_tell_both() {
    let (car, fit, ratio) = fitted(4, Logs::TorqueAndOnePressure, 4);
    assert!(ratio < 0.3, "{ratio}");
    let (held, all) = inside(&car, &fit);
    assert!(held + 2 >= all, "{held} of {all}");
    assert_eq!(fit.verdict(Parameter::Gain), Verdict::Measured);
    assert_ne!(fit.verdict(Parameter::Capacity), Verdict::NotTold);
}
