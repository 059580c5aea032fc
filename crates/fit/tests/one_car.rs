//! One car of the many of `draws.rs`, with few shifts: what CI has time for.
use std::ops::ControlFlow::Continue;

use crate::common::{FittedFile as _, Logs, TestCar, TestShift, given};
use fit::{Fit, Parameter, Series, Verdict};

/// A car fitted to shifts, and the error of its torque on other shifts over that with the given file.
fn fitted(seed: u64, logs: Logs, count: u64) -> (TestCar, Fit, f64) {
    let mut car = TestCar::drawn(seed);
    let shifts: Vec<_> = (0..count).map(|number| car.shift(number, logs).record).collect();
    let fit = fit::fit(&given(&car.file), &shifts, &[], car.ages(), &mut |_| Continue(())).unwrap();
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
    assert_eq!(fit.verdict(Parameter::Gain), Verdict::NotIdentifiable);
    assert_eq!(fit.torque_scale_verdict(), Verdict::NotIdentifiable);
    assert_ne!(fit.verdict(Parameter::Lag), Verdict::NotIdentifiable);
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
    assert_ne!(fit.verdict(Parameter::Capacity), Verdict::NotIdentifiable);
}

/// Shifts of a car with an engine torque signal, whose pressure sensor in the first shift reads this much too high, from `from_s` before the
/// inertia phase on.
fn with_offset(car: &mut TestCar, offset_pa: f64, from_s: f64) -> Vec<fit::ShiftRecord> {
    car.truth.retain(|(parameter, _)| *parameter != Parameter::PressureOffset);
    car.truth.push((Parameter::PressureOffset, offset_pa / 1e4));
    let mut shifts: Vec<_> = (0..4).map(|number| car.shift(number, Logs::TorqueAndOnePressure).record).collect();
    for record in &mut shifts {
        let read = record.pressure.between([-from_s, f64::INFINITY]).collect::<Vec<_>>();
        record.pressure = Series::default();
        read.into_iter().for_each(|(time_s, pressure_pa)| record.pressure.push(time_s, pressure_pa + offset_pa));
    }
    shifts
}

#[test]
fn the_zero_offset_of_a_pressure_sensor_is_not_taken_for_valve_gain() {
    // With readings of the clutch at rest, and from the inertia phase on.
    for from_s in [2.0, 0.0] {
        let fit_with = |offset_pa: f64| {
            let mut car = TestCar::drawn(4);
            let shifts = with_offset(&mut car, offset_pa, from_s);
            (fit::fit(&given(&car.file), &shifts, &[], car.ages(), &mut |_| Continue(())).unwrap(), car)
        };
        let (right, car) = fit_with(0.0);
        let [gain, offset] = [Parameter::Gain, Parameter::PressureOffset].map(|p| right.place(p).unwrap());
        let sd = right.precision.stated[(gain, gain)].sqrt();
        assert!((right.unknowns[gain] - car.true_value(Parameter::Gain)).abs() < 2.0 * sd);
        // What is known of the gain with the offset that is known: that it is not known costs less than a twentieth of it with readings at rest.
        let with_offset = right.precision.stated[(gain, offset)].powi(2) / right.precision.stated[(offset, offset)];
        let cost = sd / (sd * sd - with_offset).sqrt();
        assert!(from_s == 0.0 || cost < 1.05, "{cost}");
        for offset_pa in [-20e3, 10e3, 30e3] {
            let (fit, car) = fit_with(offset_pa);
            let moved = (fit.unknowns[gain] - right.unknowns[gain]) / sd;
            assert!(moved.abs() < 0.05, "{from_s} {offset_pa}: {moved}");
            let error = (fit.unknowns[offset] - car.true_value(Parameter::PressureOffset))
                / fit.precision.stated[(offset, offset)].sqrt();
            assert!(error.abs() < 2.0, "{from_s} {offset_pa}: {error}");
            let row = fit.report().into_iter().find(|row| row.name == "pressure sensor, zero offset").unwrap();
            assert!(row.value_text().ends_with(" kPa") && row.interval_text().contains(" to "), "{row:?}");
            let said = fit.statements().join("\n");
            let is_zero = row.interval[0] < 0.0 && row.interval[1] > 0.0;
            assert!(is_zero != said.contains("oncoming_pressure reads "), "{row:?} {said}");
        }
    }
}
