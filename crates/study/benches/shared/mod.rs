//! What both benchmarks work on.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use car::Vehicle;
use config::{ExperimentFile, Study, VehicleFile};
use observer::Input;
use study::sampling::through_sensors;
use study::{Campaign, RunColumns, simulate_shift};
use trace::{Cell, CsvWriter, Trace};

/// Sample time of the observers, s.
pub(crate) const SAMPLE_TIME_S: f64 = 0.01;

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

pub(crate) fn vehicle() -> Vehicle {
    VehicleFile::built_in().unwrap().vehicle
}

/// A shift of the bench as its observers see it: through sensors, from a second before its request.
fn seen() -> Trace {
    let (vehicle, bench) = (vehicle(), ExperimentFile::bench().unwrap().experiment);
    let shift = simulate_shift(&vehicle, &vehicle, &bench, config::study::RECORD_BEFORE_S).unwrap();
    through_sensors(&shift, SAMPLE_TIME_S, &bench.sensors.unwrap(), &vehicle)
}

/// The samples of that shift.
pub(crate) fn samples() -> Vec<Input<f64>> {
    let seen = seen();
    let columns = RunColumns::of(&seen, &vehicle()).unwrap();
    columns.samples().map(|sample| sample.unwrap().0).collect()
}

/// Writes a log as CSV: the readings of that shift again and again.
pub(crate) fn write_log<W: io::Write>(writer: W, rows: u32) -> W {
    let measured = seen().filtered(|name| {
        let is_speed = name.ends_with("_speed_rad_s") && !name.starts_with("vehicle");
        is_speed || name == trace::signal::ONCOMING_CURRENT
    });
    let names: Vec<&str> = measured.columns.iter().map(|column| column.name.as_str()).collect();
    let mut writer = CsvWriter::new(writer, names.iter().copied()).unwrap();
    for row in 0..rows {
        let at = row as usize % measured.len();
        let cells = names.iter().map(|name| Cell::Number(measured.get(name).map_or(f64::NAN, |values| values[at])));
        writer.row(f64::from(row) * SAMPLE_TIME_S, cells).unwrap();
    }
    writer.finish().unwrap()
}

/// Three of the observers of the shipped study.
pub(crate) const THREE: [&str; 3] = ["Kalman", "peak-to-peak", "open loop"];

/// The shipped study with this number of runs, and of its observers those named.
pub(crate) fn campaign(runs: u64, wanted: impl Fn(&str) -> bool) -> Campaign {
    let mut study = Study::read(&root().join("experiments/settings.toml")).unwrap();
    study.runs = runs;
    Arc::make_mut(&mut study.experiment).observers.retain(|entry| wanted(&entry.name));
    Campaign::new(study).unwrap()
}
