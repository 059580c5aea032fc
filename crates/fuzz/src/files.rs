//! The readers of files, and what a command does next with a file that they take.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use car::{Car, ShiftCommand};
use config::{CarFile, ExperimentFile, GearboxFile, Source, Study, VehicleFile, read_learnt, write_learnt};
use design::{design_compliant, design_rigid};
use observer::Reading;
use observer::gearbox::{MAX_ELEMENTS, ShiftInput};
use plant::car::{CarCalibration, CarModel, CarShift, simulate_car_shift};
use report::gearbox_figure::{gear_figure, train_figure};
use study::campaign::{factor_values, run_seed};
use study::gearbox::car_log::LogStep;
use study::gearbox::logged::LoggedDrive;
use study::{Log, Row, RunColumns, simulate_shift};
use trace::{ColumnKind, CsvRows, GrowingTable, partial_path, read_csv, read_rows, write_csv, write_parquet};

use crate::{Depth, Fuzzer, samples};

/// Drives longer than this are not simulated, s.
const LONGEST_DRIVE_S: f64 = 20.0;

/// Writes the input under this name in the fuzzer's folder.
fn written(fuzzer: &Fuzzer, name: &str, input: &[u8]) -> PathBuf {
    let path = fuzzer.folder.join(name);
    fs::write(&path, input).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    path
}

pub(crate) fn vehicle(fuzzer: &Fuzzer, input: &[u8]) {
    car(input);
    let Ok(vehicle) = VehicleFile::read(&written(fuzzer, "vehicles/input", input)) else { return };
    samples::drive_all(&vehicle);
    if fuzzer.depth == Depth::Long {
        // Requirements that cannot be met are an error, which is well.
        let _ = (design_rigid(&vehicle), design_compliant(&vehicle));
    }
}

/// A vehicle file with a gearbox file, and an upshift of the car.
fn car(input: &[u8]) {
    let gearbox = Source::built_in("gearboxes/8hp.toml", include_str!("../../../gearboxes/8hp.toml"));
    let source = Source::built_in("vehicles/input", &String::from_utf8_lossy(input));
    let Ok(car) = CarFile::from_sources(source, gearbox) else { return };
    let Ok(model) = CarModel::new(car.car) else { return };
    let shift = CarShift { duration_s: 2.0, ..CarShift::usual(&model.car, 2, 3, 0.2) };
    // A car that cannot shift is an error, which is well.
    let _ = simulate_car_shift(&model, &model.car, CarCalibration::STANDARD, &shift, |_| {});
}

pub(crate) fn gearbox(fuzzer: &Fuzzer, input: &[u8]) {
    let Ok(file) = GearboxFile::read(&written(fuzzer, "gearboxes/input", input)) else { return };
    let _ = train_figure(&file.gearbox);
    for gear in 0..file.gearbox.gears.len() {
        let _ = gear_figure(&file.gearbox, gear);
    }
}

/// What was learnt of a car, in the filter of a drive.
pub(crate) fn learnt(car: &Car, input: &[u8]) {
    let source = Source::built_in("learnt.toml", &String::from_utf8_lossy(input));
    let Ok(learnt) = read_learnt(&car.gearbox, &source) else { return };
    let Ok(tables) = LoggedDrive::tables(car, None) else { return };
    let mut drive = LoggedDrive::new(car, &tables, None, Some(&learnt));
    let reading = |value: f64| Some(Reading { value, age_s: 0.0 });
    for row in 0..20_u32 {
        let (gear, fraction) = (ShiftCommand::between(2, 2 + usize::from(row > 9)), f64::from(row) / 20.0);
        let input = ShiftInput {
            dt_s: 0.01,
            engine_rad_s: reading(210.0),
            turbine_rad_s: reading(200.0 - 40.0 * fraction),
            output_rad_s: reading(200.0 / car.gearbox.gears[2].ratio),
            wheel_rad_s: None,
            engine_n_m: None,
            acceleration_m_s2: None,
            lock_up_applied: false,
            commands: [reading(fraction); MAX_ELEMENTS],
            gear,
        };
        let pressures = [reading(1e5 * fraction); MAX_ELEMENTS];
        let beside =
            LogStep { vehicle_m_s: 10.0, speed_m_s: reading(10.0), ..LogStep::of(0.01 * f64::from(row), input) };
        let estimate = drive.push(&LogStep { pressures, ..beside });
        assert!(estimate.valve_pa.iter().all(|pressure_pa| !pressure_pa.is_infinite()));
    }
    // What is written is read again.
    let text = write_learnt(&car.gearbox, drive.filter.learnt().1);
    read_learnt(&car.gearbox, &Source::built_in("learnt.toml", &text)).unwrap_or_else(|error| panic!("{error}"));
}

pub(crate) fn experiment(fuzzer: &Fuzzer, input: &[u8]) {
    let Ok(experiment) = ExperimentFile::read(&written(fuzzer, "experiments/input", input)) else { return };
    if fuzzer.depth == Depth::Long && experiment.duration_s <= LONGEST_DRIVE_S {
        let car = experiment.simulated_vehicle(&fuzzer.vehicle);
        let _ = simulate_shift(&car, &fuzzer.vehicle, &experiment, config::study::RECORD_BEFORE_S);
    }
}

pub(crate) fn study(fuzzer: &Fuzzer, input: &[u8]) {
    let Ok(study) = Study::read(&written(fuzzer, "experiments/input", input)) else { return };
    for run in [0, study.runs / 2, study.runs - 1] {
        let _ = (study.varied(&factor_values(&study, run)), run_seed(&study, run));
    }
}

pub(crate) fn log(fuzzer: &Fuzzer, input: &[u8]) {
    row_by_row(fuzzer, input);
    let Ok(trace) = read_csv(&written(fuzzer, "input", input)) else { return };
    let _ = trace.median_step_s();
    if let Ok(columns) = RunColumns::of(&trace, &fuzzer.vehicle) {
        for observer in &fuzzer.observers {
            observer.run(&fuzzer.vehicle, &columns);
        }
    }
    let _ = write_csv(&fuzzer.folder.join("output"), &trace);
}

/// Reads a log as `estimate` does.
fn row_by_row(fuzzer: &Fuzzer, input: &[u8]) {
    let input = Box::new(Cursor::new(input.to_vec()));
    let Ok(rows) = CsvRows::of_log(Path::new("input"), input) else { return };
    let Ok(mut log) = Log::of(rows, &fuzzer.vehicle, 10) else { return };
    for (input, row) in log.by_ref().map_while(Result::ok) {
        assert!(input.dt_s >= 0.0 && row.time_s.is_finite());
    }
    let _ = log.check_readings();
}

pub(crate) fn table(fuzzer: &Fuzzer, input: &[u8]) {
    let path = written(fuzzer, "input", input);
    let header = fuzzer.layout.header().join(",");
    let row = |line: &str| {
        Row::from_cells(line.split(','), &fuzzer.layout).map(drop).ok_or_else(|| "no row of a study".to_owned())
    };
    let _ = read_rows(&path, &header, row);
    let kind = |name: &str| match name {
        "run" | "seed" => ColumnKind::Whole,
        "status" => ColumnKind::Word,
        _ => ColumnKind::Number,
    };
    let _ = write_parquet(&path, &fuzzer.folder.join("output"), kind);
    let table = fuzzer.folder.join("growing");
    written(fuzzer, &partial_path(&table).to_string_lossy(), input);
    let _ = GrowingTable::resume(&table, &header, row);
}
