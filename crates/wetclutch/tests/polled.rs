//! A log whose speeds are read less often than they are measured.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use wetclutch::{EstimateOptions, LogInput, Table, Values, VehicleFile, estimate, simulate};

/// The readings of a log with a row every 10 ms, measured every `period` rows and read every `step` rows.
fn polled(log: &Table, period: usize, step: usize) -> Table {
    let mut polled = log.clone();
    let rows = (0..log.len()).step_by(step);
    for column in &mut polled.columns {
        let measured = |row: usize| if column.name.ends_with("_speed_rad_s") { row / period * period } else { row };
        column.values = match &column.values {
            Values::Numbers(numbers) => Values::Numbers(rows.clone().map(|row| numbers[measured(row)]).collect()),
            Values::Words(words) => Values::Words(rows.clone().filter_map(|row| words.get(row)).collect()),
        };
    }
    polled
}

#[test]
fn speeds_that_are_measured_every_20_ms_and_read_every_50_ms_are_said() {
    let root: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let vehicle = VehicleFile::read(&root.join("vehicles/eight_speed.toml")).unwrap();
    let mut drive = wetclutch::read_drive(&root.join("drives/city.toml"), None).unwrap();
    drive.repetitions = 3;
    let log = simulate(vehicle.car().unwrap(), &drive).unwrap().measured;
    let said = |period: usize, step: usize| -> Vec<String> {
        let log = Arc::new(polled(&log, period, step));
        let found = estimate(&vehicle, LogInput::of_table("a drive", &log), &EstimateOptions::default()).unwrap();
        found.notes.into_iter().filter(|note| note.contains("read every")).collect()
    };
    let [note] = &said(2, 5)[..] else { panic!("one note") };
    assert!(note.contains("measured every 20 ms and read every 50 ms") && note.contains("`delay_s = 0.01`"), "{note}");
    let [note] = &said(4, 5)[..] else { panic!("one note") };
    assert!(
        note.starts_with("warning: engine_speed, turbine_speed and output_speed are measured every 40 ms"),
        "{note}"
    );
    for (period, step) in [(1, 1), (1, 5), (5, 5), (1, 2)] {
        assert_eq!(said(period, step), [""; 0], "{period} {step}");
    }
}
