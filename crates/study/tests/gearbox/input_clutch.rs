//! The clutch between engine and gearbox: the lock-up clutch of a converter, and the clutch that starts a car without one.

use car::ErrorBudget;
use car::{Car, LockUp};
use config::{DriveFile, Source};
use observer::gearbox::{ShiftEstimate, ShiftInput};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarSample, simulate_car_drive};
use study::gearbox::RECORD_S;
use study::gearbox::recording::{Recording, input_clutch_n_m, reported_engine_n_m};

use super::cars::{cars, sensors};

const DRIVE: &str = "name = \"d\"\nsample_time_s = 0.001\n[[segment]]\nduration_s = 3\nthrottle = 0.0\nbrake = 0.3\n\
    [[segment]]\nduration_s = 12\nthrottle = [0.05, 0.3]\n[[segment]]\nduration_s = 10\nthrottle = 0.15\n\
    [[segment]]\nduration_s = 6\nthrottle = 0.0\nbrake = 0.03\n[[segment]]\nduration_s = 8\nthrottle = [0.1, 0.4]\n";

/// What a car truly is in place of the known one.
struct Errors {
    converter: f64,
    reported: f64,
}

/// Squared errors of the torque, of the same over the stated standard deviation, and the torque's own squares.
#[derive(Default)]
struct Score {
    rows: f64,
    error: f64,
    standardised: f64,
    size: f64,
}

impl Score {
    fn take(&mut self, truth: f64, estimate: &ShiftEstimate<f64>) {
        let Some(clutch) = estimate.input_clutch.filter(|_| truth.is_finite()) else { return };
        let error = clutch.torque_n_m - truth;
        self.rows += 1.0;
        self.error += error * error;
        self.standardised += (error / clutch.std_dev_n_m).powi(2);
        self.size += truth * truth;
    }

    /// RMS error, N m, over the standard deviations, and RMS torque, N m.
    fn rms(&self) -> [f64; 3] {
        [self.error, self.standardised, self.size].map(|sum| (sum / self.rows).sqrt())
    }
}

fn score(car: &Car, errors: &Errors, is_scored: impl Fn(&CarSample) -> bool) -> Score {
    let mut truth = car.clone();
    truth.converter = truth.converter.map(|mut converter| {
        converter.capacity_n_m_s2 = converter.capacity_n_m_s2.scaled(errors.converter);
        converter
    });
    let model = CarModel::new(truth.clone()).unwrap();
    let drive = DriveFile::from_source(Source::built_in("drive.toml", DRIVE)).unwrap().drive;
    assert!((drive.sample_time_s - RECORD_S).abs() < 1e-12);
    let mut recording = Recording::default();
    simulate_car_drive(&model, car, CarCalibration::STANDARD, &drive, |sample| recording.push(sample)).unwrap();
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap();
    let filter = gearbox_filter(car, &tables, &ErrorBudget::of_car(car), Some(&sensors()));
    let mut state = filter.start();
    let mut score = Score::default();
    let inputs: Vec<ShiftInput<f64>> = recording.inputs(&truth, &tables, &sensors(), 7).collect();
    for (sample, mut input) in recording.samples.iter().zip(inputs) {
        if let Some(reported) = &mut input.engine_n_m {
            reported.value = errors.reported * reported_engine_n_m(&truth, sample);
        }
        let estimate = filter.step(&mut state, &input);
        if is_scored(sample) {
            score.take(input_clutch_n_m(&truth, sample), &estimate);
        }
    }
    score
}

const CASES: [(&str, Errors); 4] = [
    ("as known", Errors { converter: 1.0, reported: 1.0 }),
    ("converter +10 %", Errors { converter: 1.1, reported: 1.0 }),
    ("reported torque +8 %", Errors { converter: 1.0, reported: 1.08 }),
    ("reported torque -8 %", Errors { converter: 1.0, reported: 0.92 }),
];

#[test]
fn the_lock_up_clutch_has_its_torque_while_it_closes_slips_and_holds() {
    for (how, slip_rad_s) in [("locks", 0.0), ("slips", 4.0)] {
        let mut car = cars().remove(0);
        car.lock_up = Some(LockUp {
            capacity_n_m: 300.0,
            first_gear: car.gearbox.gear("3").unwrap(),
            on_rad_s: 140.0,
            off_rad_s: 110.0,
            ramp_s: 0.6,
            slip_rad_s,
        });
        for (name, errors) in CASES {
            let found = score(&car, &errors, |_| true);
            let [error, standardised, size] = found.rms();
            println!(
                "lock-up clutch {how}, {name}: {error:.1} of {size:.0} N m, {standardised:.2} deviations, {} rows",
                found.rows
            );
            assert!(found.rows > 500.0, "{how}, {name}: {} rows", found.rows);
            // An error at its bound, the edge of a uniform distribution, is 1.73 of its standard deviations.
            assert!(standardised < 1.74 && error < 0.2 * size, "{how}, {name}: {error} {standardised} {size}");
        }
    }
}

#[test]
fn the_clutch_that_starts_a_car_has_its_torque_from_standstill_on() {
    let car = cars().remove(5);
    assert!(car.converter.is_none());
    let first = car.gearbox.gear("1").unwrap();
    for (name, errors) in CASES.into_iter().filter(|(name, _)| !name.contains("converter")) {
        // In first gear it slips until it holds: the launch.
        let launch = score(&car, &errors, |sample| sample.gear == first && sample.time_s > 0.5);
        let all = score(&car, &errors, |sample| sample.time_s > 0.5);
        for (where_, found) in [("first gear", launch), ("all gears", all)] {
            let [error, standardised, size] = found.rms();
            println!(
                "launch clutch, {name}, {where_}: {error:.1} of {size:.0} N m, {standardised:.2} deviations, {} rows",
                found.rows
            );
            assert!(
                found.rows > 200.0 && standardised < 1.74 && error < 0.2 * size,
                "{name}: {error} {standardised} {size}"
            );
        }
    }
}
