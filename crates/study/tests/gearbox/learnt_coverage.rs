//! What is learnt lies within its stated intervals, and does not make the torques worse with the hours.

use car::ErrorBudget;
use car::{Car, Drive};
use config::DriveFile;
use std::path::Path;
use study::gearbox::learnt_coverage::{Coverage, LearntDrive, Quantity, Sampled, SampledCar, learn};

use super::cars::{cars, sensors};

/// So many times three minutes in town by a sampled car.
fn town(car: &Car, what: Sampled, (repetitions, parts): (u32, usize), seed: u64) -> LearntDrive {
    let town = DriveFile::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../drives/city.toml")).unwrap().drive;
    let sampled = SampledCar::new(car, &ErrorBudget::of_car(car), what, seed);
    learn(car, &sampled, &Drive { repetitions, ..town }, &sensors(), (parts, seed)).unwrap()
}

/// More cars: `cargo run --release -p study --example learnt_coverage`.
#[test]
fn of_sampled_cars_the_truth_lies_in_the_stated_intervals_of_every_learnt_quantity() {
    let cars = cars();
    let cars: Vec<_> = [0, 1, 2, 3, 5].into_iter().map(|at| &cars[at]).collect();
    let drives: Vec<_> =
        cars.iter().flat_map(|car| [1, 2].map(|seed| town(car, Sampled::Budget, (3, 1), seed))).collect();
    // Two standard deviations of the fraction by chance. The values of one car are not independent.
    let by_chance = 2.0 * (0.95 * 0.05 / drives.len() as f64).sqrt();
    for quantity in Quantity::ALL {
        let of = Coverage::of(quantity, drives.iter().flat_map(|drive| &drive.learnt[0])).unwrap();
        let (name, per_unit) = quantity.name();
        let [mean, rms, stated] = [of.mean, of.rms, of.standard_deviation].map(|value| per_unit * value);
        println!(
            "{name}: {} values, mean error {mean:.2}, RMS {rms:.2}, stated {stated:.2}, inside {:.2}",
            of.count, of.inside
        );
        assert!(of.inside >= 0.95 - by_chance, "{name}: {of:?}");
    }
}

/// A car that is that of its file: no torque is learnt to be another, and the error of the torque of the clutches does not grow.
#[test]
fn an_hour_of_the_car_of_the_file_moves_no_torque_and_costs_nothing() {
    let cars = cars();
    for (car, parts) in [(&cars[0], 1), (&cars[1], 4)] {
        let drive = town(car, Sampled::Nothing, (20, parts), 1);
        let name = &car.gearbox.name;
        for error in drive.learnt.last().unwrap() {
            if matches!(error.quantity, Quantity::InputTorque | Quantity::EngineTorque) {
                println!("{name}, {:?}: {:.4}, stated {:.4}", error.quantity, error.error, error.standard_deviation);
                // Half of a standard deviation: nothing but the drag of open clutches, 1 N m of some 50 N m, is not in the filter's model.
                assert!(error.error.abs() < 0.5 * error.standard_deviation, "{name}: {error:?}");
            }
        }
        let rms: Vec<f64> = drive.torques.iter().map(|errors| errors.rms_n_m()).collect();
        println!("{name}: {} shifts, torque errors {rms:.2?} N m", drive.shifts);
        // The quarters have the same shifts through other noise of the sensors.
        assert!(rms.last().unwrap() < &(1.05 * rms[0]), "{name}: {rms:.2?}");
    }
}
