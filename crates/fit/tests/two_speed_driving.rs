//! Driving between the shifts of a car whose file has one shift.
use crate::common::{FittedFile as _, Logs, TestCar, column, fitted};
use fit::{Driving, Fit, Parameter, Verdict};
use trace::{Column, Trace, Values, signal};

/// Of the logarithm of mass over capacity of the converter: error, and stated standard deviation.
fn mass(car: &TestCar, fit: &Fit) -> [f64; 2] {
    let error = |parameter| fit.unknowns[fit.place(parameter).unwrap()] - car.true_value(parameter);
    let of = [(Parameter::Mass, 1.0), (Parameter::Capacity, -1.0)];
    [error(Parameter::Mass) - error(Parameter::Capacity), fit.combination_sd(&of)[1]]
}

fn driving_s(car: &TestCar, log: &Trace, name: &str) -> f64 {
    car.collected(log, name).driving[0].time_s()
}

#[test]
fn driving_tells_of_the_mass_where_there_are_few_shifts() {
    let mut car = TestCar::drawn(3).on_another_road();
    let shifts: Vec<_> = (0..2).map(|number| car.shift(number, Logs::SpeedsAndCurrent).record).collect();
    let driving = car.collected(&car.driven(4), "mass").driving;
    assert!(driving[0].time_s() > 100.0, "{}", driving[0].time_s());
    let (without, with) = (fitted(&car, &shifts, &[]), fitted(&car, &shifts, &driving));
    assert_eq!((without.driving_s, without.place(Parameter::Rolling)), (0.0, None));
    assert!(with.driving_s > 100.0 && with.is_converged);
    let [without, found] = [&without, &with].map(|fit| mass(&car, fit));
    assert!(found[1] < 0.9 * without[1], "{found:?} {without:?}");
    assert!(found[0].abs() < 2.0 * found[1], "{found:?}");
    let said = with.statements().join("\n");
    assert!(said.contains("driving between shifts: ") && said.contains("Mass over converter capacity"), "{said}");
    // What is not identified stays as it is in the text.
    let file = with.vehicle_file(&car.file, "a simulation").unwrap();
    for (parameter, key) in [(Parameter::Rolling, "rolling_moment_n_m"), (Parameter::Air, "drag_coefficient")] {
        assert_eq!(with.verdict(parameter), Verdict::NotIdentifiable);
        let line = |text: &str| text.lines().find(|line| line.starts_with(key)).unwrap().to_owned();
        assert_eq!(line(&file.source.text), line(&car.file.source.text));
    }
}

/// What belongs to a shift is not used twice.
#[test]
fn a_log_of_a_shift_alone_has_no_driving_and_changes_nothing() {
    let mut car = TestCar::drawn(4);
    let logs: Vec<_> = (0..2).map(|number| car.logs(number, Logs::SpeedsAndCurrent)).collect();
    let collected: Vec<_> = logs.iter().map(|[log, _]| car.collected(log, "cut")).collect();
    let shifts: Vec<_> = collected.iter().flat_map(|one| one.shifts.clone()).collect();
    let driving: Vec<_> = collected.into_iter().flat_map(|one| one.driving).collect();
    assert_eq!((shifts.len(), driving.iter().map(Driving::time_s).sum::<f64>()), (2, 0.0));
    let (without, with) = (fitted(&car, &shifts, &[]), fitted(&car, &shifts, &driving));
    assert_eq!(without.unknowns, with.unknowns);
    assert!(with.statements().iter().any(|line| line.starts_with("driving between shifts is not fitted")));
}

#[test]
fn driving_is_where_the_engine_pulls_and_one_clutch_holds() {
    let car = TestCar::drawn(5);
    let log = car.driven(1);
    let usual_s = driving_s(&car, &log, "usual");
    assert!(usual_s > 20.0, "{usual_s}");
    let changed_s = |name: &str, change: &dyn Fn(&mut Trace)| {
        let mut log = log.clone();
        change(&mut log);
        driving_s(&car, &log, name)
    };
    // Neither the speed of the wheels nor a gear signal that is late is used.
    let wheel = |log: &mut Trace| column(log, signal::WHEEL_SPEED).iter_mut().for_each(|speed| *speed *= 1.01);
    assert_eq!(changed_s("wheel", &wheel), usual_s);
    let gear = |log: &mut Trace| {
        let ratio = |at: usize, log: &Trace| {
            log.get(signal::TURBINE_SPEED).unwrap()[at] / log.get(signal::OUTPUT_SPEED).unwrap()[at]
        };
        let at = |at: usize| if ratio(at.saturating_sub(30), log) > 1.5 { 1.0 } else { 2.0 };
        let values = (0..log.time_s.len()).map(at).collect();
        log.columns.push(Column { name: "gear".to_owned(), values: Values::Numbers(values) });
    };
    let late_s = changed_s("gear", &gear);
    assert!((late_s - usual_s).abs() <= 2.0, "{late_s} {usual_s}");
    // A clutch that slips nowhere, but carries torque.
    let both = |log: &mut Trace| column(log, signal::OFFGOING_CURRENT).iter_mut().for_each(|current| *current = 0.8);
    assert!(changed_s("both", &both) < 0.3 * usual_s);
    let overrun = |log: &mut Trace| {
        let turbine = log.get(signal::TURBINE_SPEED).unwrap().to_vec();
        *column(log, signal::ENGINE_SPEED) = turbine.iter().map(|speed| 0.9 * speed).collect();
    };
    assert_eq!(changed_s("overrun", &overrun), 0.0);
    let standing = |log: &mut Trace| {
        for name in [signal::TURBINE_SPEED, signal::OUTPUT_SPEED] {
            column(log, name).iter_mut().for_each(|speed| *speed *= 1e-3);
        }
    };
    assert_eq!(changed_s("standing", &standing), 0.0);
}

/// A car with another road load than the file's, a brake that drags, and three times the mass.
#[test]
fn driving_that_is_not_of_the_car_is_left_out_or_covered() {
    let mut car = TestCar::drawn(6).on_another_road();
    let shifts: Vec<_> = (0..2).map(|number| car.shift(number, Logs::SpeedsAndCurrent).record).collect();
    let without = mass(&car, &fitted(&car, &shifts, &[]));
    let log = car.driven_with(2, |part, car| car.road.rolling_moment_n_m += if part == 1 { 200.0 } else { 0.0 });
    let braked = mass(&car, &fitted(&car, &shifts, &car.collected(&log, "brake").driving));
    assert!(braked[0].abs() < 2.0 * braked[1], "{braked:?}, without {without:?}");
    let log = car.driven_with(2, |_, car| car.road.mass_kg *= 3.0);
    let heavy = fitted(&car, &shifts, &car.collected(&log, "heavy").driving);
    assert_eq!(heavy.driving_s, 0.0);
    assert!(heavy.statements().iter().any(|line| line.contains("times the mass of that of the shifts")));
    assert_eq!(mass(&car, &heavy), without);
}

#[test]
fn a_drive_that_is_given_twice_counts_once() {
    let mut car = TestCar::drawn(7);
    let shifts = vec![car.shift(0, Logs::SpeedsAndCurrent).record];
    let once = car.collected(&car.driven(1), "twice").driving;
    let twice = [once.clone(), once.clone()].concat();
    assert_eq!(fitted(&car, &shifts, &twice).unknowns, fitted(&car, &shifts, &once).unknowns);
}
