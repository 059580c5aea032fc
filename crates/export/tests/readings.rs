//! Cars and what is read of them.

use std::path::{Path, PathBuf};

use car::{AccelerationSensor, Drive, Sensors};
use config::{CarFile, DriveFile, ExperimentFile};
use evaluate::measured::SensedDrive;
use export::{ExportOptions, ExportedFilter, shift_inputs};
use observer::gearbox::ShiftInput;
use plant::car::{CarCalibration, CarModel, simulate_car_drive};
use study::gearbox::matrix::drawn_car;

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

pub(crate) fn car_file(name: &str) -> CarFile {
    CarFile::read(&root().join("vehicles").join(name)).unwrap()
}

pub(crate) fn filter_of(name: &str) -> ExportedFilter {
    ExportedFilter::new(&car_file(name), &ExportOptions::default()).unwrap()
}

pub(crate) fn usual_sensors() -> Sensors {
    let sensors = ExperimentFile::bench().unwrap().experiment.sensors.unwrap();
    Sensors { acceleration: Some(AccelerationSensor::USUAL), ..sensors }
}

/// What is read of a drive through a city.
pub(crate) fn city(filter: &ExportedFilter) -> Vec<ShiftInput<f32>> {
    let drive = DriveFile::read(&root().join("drives/city.toml")).unwrap().drive;
    let sensors = usual_sensors();
    let mut sensed = SensedDrive::new(&filter.car, &sensors, 0.01);
    let recorded = Drive { sample_time_s: sensed.record_s(), ..drive };
    let mut inputs = Vec::new();
    let model = CarModel::new(filter.car.clone()).unwrap();
    let mut take = |row: &evaluate::measured::MeasuredRow| inputs.push(row.input(&filter.car, &filter.tables).cast());
    simulate_car_drive(&model, &filter.car, CarCalibration::STANDARD, &recorded, |sample| {
        sensed.each(sample, &mut take)
    })
    .unwrap();
    sensed.last(take);
    inputs
}

/// What is read of shifts of sampled cars, one after the other.
pub(crate) fn sampled_shifts(filter: &ExportedFilter, count: usize) -> Vec<ShiftInput<f32>> {
    let sensors = usual_sensors();
    let shifts: Vec<[usize; 2]> = filter.shifts().filter(|[from, to]| from.abs_diff(*to) == 1).collect();
    let sampled = shifts.iter().cycle().zip(0_u64..).filter_map(|(&[from, to], seed)| {
        let truth = drawn_car(&filter.car, from, to, seed);
        shift_inputs([&filter.car, &truth], &filter.tables, [from, to], (&sensors, seed)).ok()
    });
    sampled.take(count).flatten().collect()
}
