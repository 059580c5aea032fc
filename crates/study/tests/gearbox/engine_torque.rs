//! The torque that the engine's controller reports, beside the maps of an open converter.

use car::ErrorBudget;
use car::{Car, Drive};
use config::DriveFile;
use drivetrain::ShiftKind;
use observer::Reading;
use observer::gearbox::ShiftInput;
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, simulate_car_drive};
use std::path::Path;
use study::gearbox::drive::DriveScorer;
use study::gearbox::matrix::{Matrix, MatrixRow, Pooled};
use study::gearbox::recording::{Recording, lock_up_is_applied, reported_engine_n_m};
use study::gearbox::{RECORD_S, SAMPLE_S, ShiftDraw};

use super::PHASES;
use super::cars::{Random, cars, sensors};

/// Where the filter has the torque at the gearbox input from while the lock-up clutch is open.
#[derive(Debug, Clone, Copy, PartialEq)]
enum With {
    /// The converter's maps.
    Maps,
    /// These and the reported torque, which is another by this fraction beside its drawn error and so many samples late.
    Reported(f64, usize),
    /// The true converter, known within 5 %.
    Exact,
}

const ALL: [(With, &str); 5] = [
    (With::Maps, "maps"),
    (With::Reported(0.0, 0), "reported"),
    (With::Reported(0.0, 3), "late"),
    (With::Reported(0.4, 0), "40 % off"),
    (With::Exact, "exact"),
];

/// Six minutes of town by a car of the budget, a column for each source.
fn drive(known: &Car, seed: u64) -> [Vec<MatrixRow>; ALL.len()] {
    let (mut random, errors) = (Random(seed * 77), ErrorBudget::of_car(known));
    let truth = ShiftDraw::within(known, &errors, || random.uniform()).car(known);
    let factor = 1.0 + errors.engine * (2.0 * random.uniform() - 1.0);
    let town = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../drives/city.toml");
    let town = Drive { repetitions: 2, sample_time_s: RECORD_S, ..DriveFile::read(&town).unwrap().drive };
    let model = CarModel::new(truth.clone()).unwrap();
    let mut recording = Recording::default();
    simulate_car_drive(&model, known, CarCalibration::STANDARD, &town, |sample| recording.push(sample)).unwrap();
    ALL.map(|(with, _)| {
        let (mut car, mut errors) = (known.clone(), errors.clone());
        if with == With::Exact {
            errors.converter = 0.05;
            car.converter = truth.converter;
        }
        let tables = ShiftTables::of_car(&car, &errors).unwrap();
        let filter = gearbox_filter(&car, &tables, &errors, Some(&sensors()));
        let mut scorer = DriveScorer::new(&car, &model, &tables, &filter);
        for (at, input) in recording.inputs(known, &tables, &sensors(), seed).enumerate() {
            let engine_n_m = match with {
                With::Reported(more, late) if !lock_up_is_applied(known, &recording.samples[at]) => {
                    let reported_n_m = reported_engine_n_m(&truth, &recording.samples[at.saturating_sub(late)]);
                    Some(Reading::now((factor + more) * reported_n_m))
                }
                _ => input.engine_n_m,
            };
            scorer.push(&recording.samples[at], &ShiftInput { engine_n_m, ..input });
        }
        Matrix::of_drive(&scorer.finish(), &car).rows
    })
}

/// The numbers of the documentation: `LIMITS_DRAWS=40 cargo test --release -p study --test tests engine_torque -- --nocapture`.
#[test]
fn a_reported_engine_torque_tells_the_capacity_of_the_converter() {
    assert_eq!(SAMPLE_S, 0.01, "three samples are 30 ms");
    let draws = std::env::var("LIMITS_DRAWS").map_or(6_u64, |draws| draws.parse().unwrap());
    let car = cars().remove(0);
    let mut columns = ALL.map(|_| Vec::new());
    for seed in 1..=draws {
        columns.iter_mut().zip(drive(&car, seed)).for_each(|(column, rows)| column.extend(rows));
    }
    println!("{:20}{}", "", ALL.map(|(_, name)| format!("{name:>9}")).concat());
    let errors = |at: usize, phase: usize, kind: Option<ShiftKind>| {
        let pooled = Pooled::of(&columns[at], |shift| kind.is_none_or(|kind| shift.kind == kind));
        pooled.torque[phase][0].rms_n_m()[0]
    };
    for (p, phase) in PHASES.iter().enumerate() {
        for kind in ShiftKind::ALL.map(Some).into_iter().chain([None]) {
            let name = kind.map_or("all", ShiftKind::name);
            let cells: String = (0..ALL.len()).map(|at| format!("{:9.3}", errors(at, p, kind))).collect();
            println!("{:20}{cells}", format!("{name}, {phase}"));
        }
    }
    let [maps, reported, late, wrong, _] = [0, 1, 2, 3, 4].map(|at| errors(at, 1, None));
    assert!(reported < maps && late < maps, "{maps} {reported} {late}");
    // Beyond what both may err it teaches nothing.
    assert_eq!(wrong, maps);
}
