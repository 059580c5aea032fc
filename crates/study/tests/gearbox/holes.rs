//! Holes in the speeds of a drive.

use car::ErrorBudget;
use car::{Car, Drive};
use config::DriveFile;
use observer::gearbox::ShiftInput;
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarSample, simulate_car_drive};
use std::path::Path;
use study::gearbox::drive::DriveScorer;
use study::gearbox::recording::Recording;
use study::gearbox::{RECORD_S, ShiftDraw};

use super::cars::{Random, cars, sensors};

/// How long a speed is lost from the request of each shift on, s.
const HOLE_S: f64 = 0.2;

/// Three minutes of town by a car of the budget.
fn town(known: &Car) -> (CarModel, Recording) {
    let mut random = Random(5);
    let truth = ShiftDraw::within(known, &ErrorBudget::of_car(known), || random.uniform()).car(known);
    let town = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../drives/city.toml");
    let town = Drive { repetitions: 1, sample_time_s: RECORD_S, ..DriveFile::read(&town).unwrap().drive };
    let (model, mut recording) = (CarModel::new(truth).unwrap(), Recording::default());
    simulate_car_drive(&model, known, CarCalibration::STANDARD, &town, |sample| recording.push(sample)).unwrap();
    (model, recording)
}

/// RMS and largest error of the torque of the offgoing clutch in all shifts, N m, and how many shifts there are. `lose` is called with
/// each input and with whether it is within the hole.
fn errors(
    known: &Car,
    (model, recording): &(CarModel, Recording),
    lose: fn(&mut ShiftInput<f64>),
) -> ([f64; 2], usize) {
    let errors = ErrorBudget::of_car(known);
    let tables = ShiftTables::of_car(known, &errors).unwrap();
    let filter = gearbox_filter(known, &tables, &errors, Some(&sensors()));
    let mut scorer = DriveScorer::new(known, model, &tables, &filter);
    let is_shift = |sample: &CarSample| !sample.gears().is_steady();
    let mut requested_s = f64::NEG_INFINITY;
    let mut before = false;
    for (sample, mut input) in recording.samples.iter().zip(recording.inputs(known, &tables, &sensors(), 1)) {
        if is_shift(sample) && !before {
            requested_s = sample.time_s;
        }
        before = is_shift(sample);
        if sample.time_s < requested_s + HOLE_S {
            lose(&mut input);
        }
        scorer.push(sample, &input);
    }
    let shifts = scorer.finish().shifts;
    let rows = shifts.iter().flat_map(|shift| &shift.rows).filter(|row| row.clutches.iter().all(|it| it.in_range));
    let off: Vec<f64> = rows.map(|row| row.clutches[0].torque_n_m[1] - row.clutches[0].torque_n_m[0]).collect();
    let squares: f64 = off.iter().map(|off| off * off).sum();
    let maximum = off.iter().fold(0.0_f64, |maximum, off| maximum.max(off.abs()));
    let counted: usize = shifts.iter().map(|shift| shift.rows.len()).sum();
    assert_eq!(off.len(), counted, "no row is outside its range");
    ([(squares / off.len() as f64).sqrt(), maximum], shifts.len())
}

/// Speeds of different times show a slip wherever the car accelerates: what the model carries on shows none.
/// `cargo test --release -p study --test tests holes -- --nocapture`.
#[test]
fn a_hole_in_a_speed_at_the_request_of_a_shift_is_no_slip() {
    let car = cars().remove(0);
    let town = town(&car);
    let (clean, shifts) = errors(&car, &town, |_| ());
    let (turbine, _) = errors(&car, &town, |input| input.turbine_rad_s = None);
    let (output, _) = errors(&car, &town, |input| input.output_rad_s = None);
    println!(
        "{shifts} shifts, offgoing clutch, RMS and most: {clean:.2?} N m; without turbine speed {turbine:.2?}, without output speed {output:.2?}"
    );
    assert!(shifts > 12);
    for hole in [turbine, output] {
        assert!(hole[0] < 1.5 * clean[0] + 0.5, "{clean:?} {hole:?}");
    }
}
