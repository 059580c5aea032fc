//! The backlash of a driveline from drives in which the accelerator is pressed and released.

use crate::common::{FittedFile as _, Logs, TestCar, column, fitted};
use fit::{BacklashFit, ShiftRecord, Verdict};
use trace::{Trace, signal};

const SEED: u64 = 3;

/// A car with a backlash of 0.06 rad, a shift, and a minute of its driving.
fn drawn() -> (TestCar, Vec<ShiftRecord>, Trace) {
    let mut car = TestCar::drawn(SEED).with_reversals();
    let shifts = vec![car.shift(0, Logs::SpeedsAndCurrent).record];
    let log = car.driven(1);
    (car, shifts, log)
}

#[test]
fn a_backlash_lies_in_its_interval_and_goes_into_the_file() {
    let (car, shifts, log) = drawn();
    let driving = car.collected(&log, "backlash").driving;
    let fit = fitted(&car, &shifts, &driving);
    let found = fit.backlash.clone().unwrap();
    let truth = car.car.backlash_rad;
    assert!(found.sd_rad < 0.006 && (found.rad - truth).abs() < 2.0 * found.sd_rad, "{found:?} {truth}");
    assert_eq!((found.reversals, found.verdict()), (4, Verdict::Measured));
    let said = fit.statements().join("\n");
    assert!(said.contains("backlash of the driveline: 0.0") && said.contains("from 4 reversals"), "{said}");
    let file = fit.vehicle_file(&car.file, "a simulation").unwrap();
    assert!((file.backlash_rad / found.rad - 1.0).abs() < 1e-3, "{}", file.backlash_rad);
    let maximum = found.rad + 4.0 * found.sd_rad;
    assert!((file.error_bounds.backlash_rad / maximum - 1.0).abs() < 1e-3, "{}", file.error_bounds.backlash_rad);
    // The same drive once more.
    let twice = [driving.clone(), driving].concat();
    assert_eq!(fitted(&car, &shifts, &twice).backlash, fit.backlash);
}

#[test]
fn a_backlash_is_not_identified_without_reversals_or_a_wheel_speed() {
    let (mut car, shifts, log) = drawn();
    let mut without = log.clone();
    without.columns.retain(|column| column.name != signal::WHEEL_SPEED);
    for log in [without, {
        car.releases = false;
        car.driven(1)
    }] {
        let fit = fitted(&car, &shifts, &car.collected(&log, "untold").driving);
        assert!(fit.backlash.as_ref().unwrap_err().contains("0 reversals"), "{:?}", fit.backlash);
        let said = fit.statements().join("\n");
        assert!(
            said.contains("backlash of the driveline: not identified") && said.contains("press and release"),
            "{said}"
        );
        let file = fit.vehicle_file(&car.file, "a simulation").unwrap();
        assert_eq!(file.backlash_rad, car.file.backlash_rad);
    }
}

/// Wheel speeds with another scale, of a slower bus, of one wheel in curves, and of a sensor that fails.
#[test]
fn a_wheel_speed_that_is_off_is_covered_by_the_interval_or_tells_nothing() {
    let (car, shifts, log) = drawn();
    let found = |name: &str, change: &dyn Fn(usize, f64) -> f64| {
        let mut log = log.clone();
        let speeds = column(&mut log, signal::WHEEL_SPEED);
        speeds.iter_mut().enumerate().for_each(|(at, speed)| *speed = change(at, *speed));
        fitted(&car, &shifts, &car.collected(&log, name).driving).backlash
    };
    let is_covered = |found: &BacklashFit| (found.rad - car.car.backlash_rad).abs() < 2.0 * found.sd_rad;
    let usual = found("usual", &|_, speed| speed).unwrap();
    let scaled = found("scaled", &|_, speed| 1.01 * speed).unwrap();
    assert!((scaled.rad - usual.rad).abs() < 0.2 * usual.sd_rad, "{scaled:?} {usual:?}");
    let slow = found("slow", &|at, speed| if at % 5 == 0 { speed } else { f64::NAN }).unwrap();
    assert!(is_covered(&slow) && slow.verdict() == Verdict::Measured, "{slow:?}");
    let curves = found("curves", &|at, speed| speed * (1.0 + 0.005 * (0.006 * at as f64).sin()));
    assert!(curves.as_ref().is_ok_and(is_covered), "{curves:?}");
    let failed = found("failed", &|at, speed| if at % 1000 < 300 { f64::NAN } else { speed });
    assert!(failed.as_ref().map_or(true, is_covered), "{failed:?}");
}

/// The slip of the tyres is in the speed of the car, and the scatter shows it.
#[test]
fn the_speed_of_the_car_in_place_of_that_of_the_wheels_tells_no_backlash() {
    let (car, shifts, mut log) = drawn();
    let speeds = log.get(signal::VEHICLE_SPEED).unwrap().to_vec();
    *column(&mut log, signal::WHEEL_SPEED) = speeds.iter().map(|speed| speed / car.file.road.wheel_radius_m).collect();
    let fit = fitted(&car, &shifts, &car.collected(&log, "car").driving);
    let found = fit.backlash.as_ref().unwrap();
    assert!((found.rad - car.car.backlash_rad).abs() < 2.0 * found.sd_rad, "{found:?}");
    assert_eq!(found.verdict(), Verdict::NotIdentifiable, "{found:?}");
    assert!(fit.statements().iter().any(|line| line.starts_with("backlash of the driveline: not identified, +- ")));
}
