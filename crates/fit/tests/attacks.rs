//! Logs that a fit should not have to see: it says what is wrong, or its result stays one that can be used.
use std::ops::ControlFlow::Continue;

use crate::common::{FittedFile as _, Logs, TestCar, given};
use fit::{Collected, Driving, Fit, FitError, HeldOut, Map, MeanError, Parameter, Series, ShiftRecord, Verdict};

fn shifts(car: &mut TestCar, count: u64, logs: Logs) -> Vec<ShiftRecord> {
    (0..count).map(|number| car.shift(number, logs).record).collect()
}

fn fitted(car: &TestCar, shifts: &[ShiftRecord]) -> Result<Fit, FitError> {
    fit::fit(&given(&car.file), shifts, &[], car.ages(), &mut |_| Continue(()))
}

/// Error of the open loop's torque on two other shifts, N m: given file, fitted file.
fn errors(car: &mut TestCar, fit: &Fit) -> [f64; 2] {
    let vehicle = fit.vehicle_file(&car.file, "a simulation").unwrap();
    let others: Vec<_> = (100..102).map(|number| car.shift(number, Logs::SpeedsAndCurrent)).collect();
    let given = car.file.clone();
    [&given, &vehicle].map(|file| (others.iter().map(|shift| shift.errors(file)[0]).sum::<f64>() / 2.0).sqrt())
}

#[test]
fn a_shift_that_is_given_again_and_again_counts_once() {
    let mut car = TestCar::drawn(2);
    let one = shifts(&mut car, 1, Logs::SpeedsAndCurrent);
    let many: Vec<ShiftRecord> = std::iter::repeat_n(one[0].clone(), 6).collect();
    let fit = fitted(&car, &many).unwrap();
    assert_eq!((fit.shifts, fit.unusable.len()), (1, 5));
    assert!(fit.unusable[0].contains("the same readings as"), "{:?}", fit.unusable);
    assert!(fit.freed.is_empty() && fit.statements().iter().any(|line| line.starts_with("one shift only")));
    fit.vehicle_file(&car.file, "a simulation").unwrap();
}

#[test]
fn shifts_that_cannot_be_used_are_named_with_the_reason() {
    let mut car = TestCar::drawn(2);
    let mut without_turbine = shifts(&mut car, 2, Logs::SpeedsAndCurrent);
    without_turbine.iter_mut().for_each(|record| record.turbine = Series { time_s: Vec::new(), value: Vec::new() });
    let error = fitted(&car, &without_turbine).map(|_| ()).unwrap_err().to_string();
    assert!(error.starts_with("no shift can be used\n") && error.lines().count() == 3, "{error}");
}

#[test]
fn a_log_that_is_given_again_tells_nothing_new_and_checks_nothing() {
    let mut car = TestCar::drawn(2);
    let one = || Driving::default();
    let shifts = shifts(&mut car, 3, Logs::SpeedsAndCurrent);
    let mut again = shifts.clone();
    for record in &mut again {
        for series in [&mut record.engine, &mut record.turbine] {
            series.time_s.iter_mut().for_each(|time_s| *time_s += 100.0);
        }
    }
    let mut all = Collected { shifts: shifts.clone(), driving: vec![one()], ..Collected::default() };
    all.add(Collected { shifts: again, driving: vec![one()], ..Collected::default() });
    assert_eq!((all.shifts.len(), all.driving.len(), all.skipped.len()), (3, 1, 3));
    assert!(all.skipped.iter().all(|reason| reason.contains("the same readings as")), "{:?}", all.skipped);
    // A log without shifts has driving that is its own.
    all.add(Collected { driving: vec![one()], ..Collected::default() });
    assert_eq!(all.driving.len(), 2);
}

#[test]
fn a_file_that_is_the_car_is_not_made_worse() {
    let mut car = TestCar::drawn(3).with_the_right_file();
    let shifts = shifts(&mut car, 4, Logs::SpeedsAndCurrent);
    let fit = fitted(&car, &shifts).unwrap();
    let [given, after] = errors(&mut car, &fit);
    // No more than the stated interval of the torque at a command, at the level of 100 N m.
    let [_, sd] = fit.combination_sd(&[(Parameter::Friction, 1.0), (Parameter::Gain, 1.0)]);
    assert!(after < given + 2.0 * sd * 100.0, "{given} {after} {sd}");
    let said = fit.statements();
    assert!(said.iter().any(|line| line.contains("these logs do not contradict the file")), "{:#?}", fit.report());
    assert!(said.iter().any(|line| line.contains("too little information to show")), "{said:#?}");
    assert!(fit.at_limit.is_empty() && fit.freed.is_empty(), "{:?} {:?}", fit.at_limit, fit.freed);
}

#[test]
fn a_file_that_is_worse_on_held_out_shifts_is_not_offered() {
    let mut car = TestCar::drawn(2);
    let shifts = shifts(&mut car, 2, Logs::SpeedsAndCurrent);
    let fit = fitted(&car, &shifts).unwrap();
    assert_eq!(fit.reason_against(None), None);
    let checked = |turbine_rad_s: [f64; 2]| HeldOut {
        shifts: 3,
        turbine_rad_s: turbine_rad_s.map(|value| MeanError { value, interval: Some([0.5 * value, 2.0 * value]) }),
        pressure_pa: None,
    };
    assert_eq!(fit.reason_against(Some(&checked([0.2, 0.1]))), None);
    assert!(fit.reason_against(Some(&checked([0.2, f64::NAN]))).is_some());
    let reason = fit.reason_against(Some(&checked([0.1, 0.2]))).unwrap();
    let kept = fit::kept_text(&car.file.source.text, &format!("{reason}\n[driveline]"));
    assert!(kept.parse::<toml::Table>().is_ok());
    let (head, rest) = kept.split_once('\n').unwrap();
    assert!(
        head.starts_with("# fit: all values are those of the given file")
            && head.contains("0.200 (95 % 0.100 to 0.400)"),
        "{head}"
    );
    assert_eq!(rest, car.file.source.text);
}

#[test]
fn a_misfit_that_stays_is_a_warning() {
    let mut car = TestCar::drawn(2).with_other_converter();
    let shifts = shifts(&mut car, 8, Logs::SpeedsAndCurrent);
    let fit = fitted(&car, &shifts).unwrap();
    let said = fit.statements();
    assert!(said.iter().any(|line| line.starts_with("warning: the ")), "{said:#?}");
}

#[test]
fn an_outlier_in_every_channel_changes_little() {
    let mut car = TestCar::drawn(4);
    let mut shifts = shifts(&mut car, 3, Logs::TorqueAndOnePressure);
    for record in &mut shifts {
        let bad = [
            (&mut record.turbine, -40.0),
            (&mut record.output, 30.0),
            (&mut record.wheel, 20.0),
            (&mut record.engine, 40.0),
            (&mut record.engine_torque, 300.0),
            (&mut record.pressure, 5e5),
        ];
        for (series, by) in bad {
            let at = series.time_s.partition_point(|time_s| *time_s < -0.5);
            if let Some(value) = series.value.get_mut(at) {
                *value += by;
            }
        }
    }
    let fit = fitted(&car, &shifts).unwrap();
    let [given, after] = errors(&mut car, &fit);
    assert!(after < 0.5 * given, "{given} {after}");
}

#[test]
fn the_log_of_another_car_is_named_as_such() {
    let mut car = TestCar::drawn(5);
    // A capacity far outside of the error budget.
    car.car.converter.capacity_n_m_s2 = car.car.converter.capacity_n_m_s2.scaled(1.7);
    let shifts = shifts(&mut car, 3, Logs::SpeedsAndCurrent);
    match fitted(&car, &shifts) {
        Ok(fit) => {
            let said = fit.statements();
            assert!(said.iter().any(|line| line.starts_with("warning: ")), "{said:#?}");
            assert!(fit.at_limit.is_empty() || fit.reason_against(None).is_some());
        }
        Err(error) => assert!(error.to_string().contains("hint"), "{error}"),
    }
}

#[test]
fn readings_that_are_no_numbers_are_named_and_channels_that_stand_still_are_not_believed() {
    let mut car = TestCar::drawn(6);
    let good = shifts(&mut car, 2, Logs::SpeedsAndCurrent);
    let signal = |record: &mut ShiftRecord, name: &str, value: f64| {
        let series: &mut Series = match name {
            "engine" => &mut record.engine,
            "turbine" => &mut record.turbine,
            "output" => &mut record.output,
            "wheel" => &mut record.wheel,
            "oncoming" => &mut record.oncoming,
            _ => &mut record.offgoing,
        };
        series.value.iter_mut().for_each(|x| *x = value);
    };
    let result = |name: &str, value: f64| {
        let mut shifts = good.clone();
        shifts.iter_mut().for_each(|record| signal(record, name, value));
        fitted(&car, &shifts)
    };
    for name in ["engine", "turbine", "output", "wheel", "oncoming", "offgoing"] {
        for value in [f64::NAN, f64::INFINITY] {
            let error = result(name, value).unwrap_err().to_string();
            assert!(error.contains("are not finite numbers"), "{name} {value}: {error}");
        }
    }
    for (name, value) in [("turbine", 300.0), ("output", 0.0), ("engine", 200.0), ("oncoming", 0.3)] {
        match result(name, value) {
            Err(error) => assert!(!error.to_string().is_empty()),
            Ok(fit) => {
                let said = fit.statements();
                assert!(said.iter().any(|line| line.starts_with("warning: ")), "{name} {value}: {said:#?}");
            }
        }
    }
}

#[test]
fn a_log_that_begins_in_the_shift_is_fitted_to_what_is_left() {
    let mut car = TestCar::drawn(7);
    let mut shifts = shifts(&mut car, 2, Logs::SpeedsAndCurrent);
    for record in &mut shifts {
        let begin_s = 0.5 * record.lock_s;
        for series in [
            &mut record.engine,
            &mut record.turbine,
            &mut record.output,
            &mut record.wheel,
            &mut record.oncoming,
            &mut record.offgoing,
        ] {
            let at = series.time_s.partition_point(|time_s| *time_s < begin_s);
            series.time_s.drain(..at);
            series.value.drain(..at);
        }
    }
    let Ok(fit) = fitted(&car, &shifts) else { return };
    assert!(fit.unknowns.iter().all(|x| x.is_finite()));
    // Half of an inertia phase says nothing of the clutch that held before.
    assert_eq!(fit.verdict(Parameter::OffgoingFriction), Verdict::NotIdentifiable);
    fit.vehicle_file(&car.file, "a simulation").unwrap();
}

#[test]
fn a_map_of_another_shape_is_freed_and_the_file_has_its_points() {
    let mut car = TestCar::drawn(4).with_other_maps();
    let shifts = shifts(&mut car, 8, Logs::SpeedsAndCurrent);
    let fit = fitted(&car, &shifts).unwrap();
    assert!(!fit.freed.is_empty());
    assert!(fit.statements().iter().any(|line| line.starts_with("shape fitted too, because")));
    let vehicle = fit.vehicle_file(&car.file, "a simulation").unwrap();
    let [before, after] = [&car.file, &vehicle].map(|file| {
        let maps = file.oncoming.valve.maps().unwrap();
        [maps.time_constant_s.axis().len(), maps.gain_pa_a.axis().len()]
    });
    for (i, map) in [Map::Lag, Map::Gain].into_iter().enumerate() {
        assert_eq!(after[i] > before[i], fit.freed.contains(&map), "{map:?}: {before:?} {after:?}");
    }
    let [given, after] = errors(&mut car, &fit);
    assert!(after < 0.5 * given, "{given} {after}");
}

/// With all shapes free from the beginning the first steps of this car went to another minimum, whose torque is worse than that of the given file.
#[test]
fn shapes_that_few_shifts_do_not_tell_lead_nowhere_else() {
    let mut car = TestCar::drawn(74);
    car.tolerance = 1e-8;
    let shifts = shifts(&mut car, 6, Logs::SpeedsAndCurrent);
    let fit = fitted(&car, &shifts).unwrap();
    let [given, after] = errors(&mut car, &fit);
    assert!(after < 0.7 * given, "{given} {after}");
}
