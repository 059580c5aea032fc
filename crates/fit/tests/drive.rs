//! Converter and torques at the turbine from a drive whose converter is known.

use fit::Verdict;
use fit::drive::{ConverterFit, DriveRecord, Moment, fit_converter};
use logs::{Direction, Load, Reading, Role, Shift, ShiftQuality};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

const INERTIA_KG_M2: f64 = 0.25;
const DELAY_S: f64 = 0.08;

fn capacity(speed_ratio: f64) -> f64 {
    3.2e-3 * (1.0 - speed_ratio.powi(5))
}

/// Engine speed, its rate, and speed ratio.
fn motion(time_s: f64) -> [f64; 3] {
    let engine = 160.0 + 50.0 * (0.5 * time_s).sin() + 15.0 * (1.9 * time_s).sin();
    let rate = 25.0 * (0.5 * time_s).cos() + 28.5 * (1.9 * time_s).cos();
    [engine, rate, 0.58 + 0.37 * (0.31 * time_s).sin()]
}

fn torque(time_s: f64) -> f64 {
    let [engine, rate, speed_ratio] = motion(time_s);
    INERTIA_KG_M2 * rate + capacity(speed_ratio) * engine * engine
}

/// A minute at 100 Hz. The signal is ahead of the torque and has errors that last for a third of a second.
fn drive(seed: u64, error_n_m: f64) -> DriveRecord {
    let mut random = Pcg64Mcg::new(u128::from(seed) << 64 | 0xcafe_f00d_d15e_a5e5);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let mut record = DriveRecord::default();
    let mut error = 0.0;
    for i in 0..6000_u32 {
        let time_s = 0.01 * f64::from(i);
        let [engine, _, speed_ratio] = motion(time_s);
        error = 0.97 * error + (1.0_f64 - 0.97 * 0.97).sqrt() * error_n_m * normal.sample(&mut random);
        let mut push = |role: Role, value: f64| record.push(&Reading { role, time_s, stamp_s: time_s, value });
        push(Role::EngineSpeed, engine);
        push(Role::TurbineSpeed, speed_ratio * engine);
        push(Role::EngineTorque, torque(time_s + DELAY_S) + error);
    }
    record
}

fn fitted(record: &DriveRecord) -> (ConverterFit, Vec<Moment>) {
    let moments = record.moments();
    (fit_converter(record, &moments).unwrap(), moments)
}

#[test]
fn the_converter_of_a_clean_drive_is_found() {
    let (fit, _) = fitted(&drive(1, 0.0));
    assert!((fit.inertia_kg_m2 - INERTIA_KG_M2).abs() < 0.01, "{}", fit.inertia_kg_m2);
    assert!((fit.delay_s - DELAY_S).abs() < 0.011 && fit.delay_sd_s < 0.01, "{} {}", fit.delay_s, fit.delay_sd_s);
    assert_eq!([fit.inertia_verdict(), fit.delay_verdict()], [Verdict::Measured; 2]);
    for knot in &fit.knots {
        assert!((knot.capacity_n_m_s2 - capacity(knot.speed_ratio)).abs() < 0.1e-3, "{knot:?}");
    }
}

/// The stated standard deviations hold: two of them contain at least 90 % of the truths.
#[test]
fn intervals_of_the_converter_hold() {
    let (mut inside, mut all) = (0_u32, 0_u32);
    for seed in 0..8 {
        let (fit, _) = fitted(&drive(seed, 6.0));
        let mut count = |error: f64, sd: f64| {
            all += 1;
            inside += u32::from(error.abs() <= 2.0 * sd);
        };
        count(fit.delay_s - DELAY_S, fit.delay_sd_s);
        count(fit.inertia_kg_m2 - INERTIA_KG_M2, fit.inertia_sd_kg_m2);
        for knot in fit.knots.iter().filter(|knot| knot.speed_ratio < 1.0) {
            count(knot.capacity_n_m_s2 - capacity(knot.speed_ratio), knot.sd_n_m_s2);
        }
    }
    assert!(f64::from(inside) >= 0.9 * f64::from(all), "{inside} of {all}");
}

/// With a constant speed and torque the engine's inertia and the delay of its signal change nothing.
#[test]
fn a_drive_without_changes_of_speed_tells_neither_inertia_nor_delay() {
    let mut record = DriveRecord::default();
    for i in 0..6000_u32 {
        let time_s = 0.01 * f64::from(i);
        let speed_ratio = 0.58 + 0.37 * (0.01 * time_s).sin();
        let torque = capacity(speed_ratio) * 160.0 * 160.0 + 8.0 * f64::from(i * 7919 % 11) - 40.0;
        for (role, value) in
            [(Role::EngineSpeed, 160.0), (Role::TurbineSpeed, 160.0 * speed_ratio), (Role::EngineTorque, torque)]
        {
            record.push(&Reading { role, time_s, stamp_s: time_s, value });
        }
    }
    let (fit, _) = fitted(&record);
    assert_eq!([fit.inertia_verdict(), fit.delay_verdict()], [Verdict::NotIdentifiable; 2], "{fit:?}");
}

#[test]
fn torque_and_work_of_a_shift_are_within_their_range() {
    let mut record = drive(3, 0.0);
    // The gear before has a ratio of 3, the one after of 2; the output turns so that both clutches slip.
    for i in 0..6000_u32 {
        let time_s = 0.01 * f64::from(i);
        let [engine, _, speed_ratio] = motion(time_s);
        record.push(&Reading { role: Role::OutputSpeed, time_s, stamp_s: time_s, value: speed_ratio * engine / 2.5 });
    }
    let (fit, moments) = fitted(&record);
    let shift = Shift {
        from: 1,
        to: 2,
        direction: Direction::Up,
        load: Load::PowerOn,
        command_s: Some(4.0),
        inertia_s: Some([4.5, 5.2]),
        gear_s: Some(5.5),
        quality: ShiftQuality::default(),
    };
    let found = fit.shift(&record, &moments, &shift, &[3.0, 2.0]);
    // With a torque ratio of 1.05 and an inertia of 0.1 kg m^2, which lie within what is allowed.
    let turbine = |t: f64| motion(t)[2] * motion(t)[0];
    let clutches = |t: f64| {
        let [engine, _, speed_ratio] = motion(t);
        let rate = (turbine(t + 1e-4) - turbine(t - 1e-4)) / 2e-4;
        1.05 * capacity(speed_ratio) * engine * engine - 0.1 * rate
    };
    let times: Vec<f64> = (0..70_u32).map(|i| 4.505 + 0.01 * f64::from(i)).collect();
    let mean = times.iter().map(|t| clutches(*t)).sum::<f64>() / 70.0;
    let work: f64 = times.iter().map(|t| 0.01 * clutches(*t) * turbine(*t) * (1.0 - 2.0 / 2.5)).sum();
    let ([low, _, high], [minimum, _, maximum]) = (found.mean_n_m.unwrap(), found.work_j.unwrap());
    assert!(low < mean && mean < high && high - low < 0.6 * mean, "{low} {mean} {high}");
    assert!(minimum < work && work < maximum, "{minimum} {work} {maximum}");
    assert_eq!((found.reduction, found.no_slip_fraction), (None, 0.0));
}

#[test]
fn a_drive_that_lacks_something_says_what() {
    let mut record = drive(1, 0.0);
    record.engine_torque = fit::Series::default();
    assert_eq!(fit_converter(&record, &record.moments()).unwrap_err(), "no engine torque is mapped");
    // A lock-up clutch that is closed all the time.
    let mut locked = DriveRecord::default();
    for i in 0..2000_u32 {
        let time_s = 0.01 * f64::from(i);
        for (role, value) in [(Role::EngineSpeed, 200.0), (Role::TurbineSpeed, 199.5), (Role::EngineTorque, 80.0)] {
            locked.push(&Reading { role, time_s, stamp_s: time_s, value });
        }
    }
    let moments = locked.moments();
    assert!(moments.iter().all(|moment| moment.no_slip));
    assert_eq!(fit_converter(&locked, &moments).unwrap_err(), "the converter hardly slips in this drive");
    for record in [DriveRecord::default(), {
        let mut one = DriveRecord::default();
        one.push(&Reading { role: Role::EngineSpeed, time_s: 0.0, stamp_s: 0.0, value: 200.0 });
        one.push(&Reading { role: Role::EngineTorque, time_s: 0.0, stamp_s: 0.0, value: 200.0 });
        one
    }] {
        assert!(fit_converter(&record, &record.moments()).is_err());
    }
}

/// A test of what is looked at: with every 20 ms between the first and the last reading, it would not end.
#[test]
fn a_clock_that_jumps_by_years_costs_nothing() {
    let whole = drive(1, 0.0);
    let mut jumped = DriveRecord::default();
    let later = |time_s: f64| if time_s < 30.0 { time_s } else { time_s + 1.7e9 };
    for (role, series) in [
        (Role::EngineSpeed, &whole.engine),
        (Role::TurbineSpeed, &whole.turbine),
        (Role::EngineTorque, &whole.engine_torque),
    ] {
        for (time_s, value) in series.between([0.0, f64::INFINITY]) {
            jumped.push(&Reading { role, time_s: later(time_s), stamp_s: later(time_s), value });
        }
    }
    let (all, found) = (whole.moments(), jumped.moments());
    // On each side of the jump, speeds are known up to 0.1 s from the last reading, which is five moments.
    assert!(found.len().abs_diff(all.len()) <= 10, "{} of {}", found.len(), all.len());
    let before = |moments: &[Moment]| moments.iter().filter(|moment| moment.time_s < 29.8).copied().collect::<Vec<_>>();
    assert_eq!(before(&found), before(&all));
}

#[test]
fn a_torque_with_which_the_converter_would_drive_the_engine_is_refused() {
    let mut record = drive(1, 3.0);
    // An engine torque in % that is taken as N m, and its friction in N m.
    record.engine_torque.value.iter_mut().for_each(|n_m| *n_m = *n_m / 4.5 - 60.0);
    let refused = |record: &DriveRecord| {
        let error = fit_converter(record, &record.moments()).unwrap_err();
        assert!(error.starts_with("engine_torque does not fit the speeds: ") && error.contains("unit"), "{error}");
    };
    refused(&record);
    // With errors so large that no single capacity is negative by more than its range.
    let mut record = drive(1, 200.0);
    record.engine_torque.value.iter_mut().for_each(|n_m| *n_m = *n_m / 4.5 - 35.0);
    refused(&record);
}
