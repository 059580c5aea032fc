//! Measured logs: the readers of every format, channel maps, readings, steps and shifts.

use std::fs;
use std::path::{Path, PathBuf};

use logs::can::Database;
use logs::{ChannelMap, Gearbox, Log, OpenOptions, Readings, ShiftFinder, Steps, inspect, suggest};

use crate::{Fuzzer, project, text};

/// The folder of logs that other programs wrote.
pub(crate) fn data() -> PathBuf {
    project().join("crates/logs/tests/data")
}

/// The files in it that are logs, not their maker and its notes.
pub(crate) fn logs() -> Vec<Vec<u8>> {
    let Ok(entries) = fs::read_dir(data()) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    let is_log = |path: &PathBuf| {
        let ending = path.extension().and_then(|ending| ending.to_str());
        ending.is_some_and(|ending| ["mf4", "parquet", "log", "asc", "blf"].contains(&ending))
    };
    paths.retain(is_log);
    paths.sort();
    paths.iter().map(|path| text(path)).collect()
}

/// The messages of the bus logs among them.
pub(crate) fn bus() -> PathBuf {
    data().join("bus.dbc")
}

/// Writes the input under this name in the fuzzer's folder.
fn written(fuzzer: &Fuzzer, name: &str, input: &[u8]) -> PathBuf {
    let path = fuzzer.folder.join(name);
    fs::write(&path, input).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    path
}

pub(crate) fn log(fuzzer: &Fuzzer, input: &[u8]) {
    let path = written(fuzzer, "measured", input);
    let options = OpenOptions { dbc: Some(bus()), ..OpenOptions::default() };
    let open = || Log::open(&path, &options).ok();
    let Some(mut log) = open() else { return };
    let map = written(fuzzer, "suggested.toml", suggest(log.channels(), &[], None).as_bytes());
    let inspected = inspect(&mut log).ok();
    // In columns, and on several threads, a log has the same samples.
    let on_threads = open().map(|log| log.on_threads(3));
    if let (Some(inspection), Some(count)) = (inspected, on_threads.and_then(in_columns)) {
        let total: u64 = inspection.channels.iter().map(|channel| channel.counts.total()).sum();
        assert_eq!(count, total);
    }
    // A suggestion is a map that can be read.
    let map = ChannelMap::read(&map).unwrap_or_else(|error| panic!("{error}"));
    replay(open(), &map);
}

/// How many values a log has in columns; none where it cannot be read.
fn in_columns(mut log: Log) -> Option<u64> {
    let all: Vec<usize> = (0..log.channels().len()).collect();
    let mut columns = log.columns(&all).ok()?;
    let mut count = 0;
    while let Some(block) = columns.next_block().ok()? {
        assert!(block.times_s.iter().all(|time_s| time_s.is_finite()));
        for column in &block.columns {
            assert_eq!(column.values.len(), block.times_s.len());
            count += (0..column.values.len()).filter(|record| column.quality(*record).is_some()).count() as u64;
        }
    }
    Some(count)
}

/// Uses a map as `inspect --shifts` and `estimate` do.
fn replay(log: Option<Log>, map: &ChannelMap) {
    let Some(mut log) = log else { return };
    let gearbox = Gearbox { ratios: vec![4.0, 2.5, 1.6, 1.0], output_rad_per_m: Some(12.0), wheel_radius_m: None };
    let mut finder = ShiftFinder::new(&gearbox, |role| map.has(role)).ok();
    if let Ok(mut readings) = Readings::new(&mut log, map) {
        for reading in readings.by_ref().map_while(Result::ok) {
            assert!(reading.value.is_finite() && reading.time_s.is_finite());
            if let Some(finder) = &mut finder {
                finder.push(&reading);
            }
        }
        let _ = readings.check();
    }
    if let Some(finder) = finder {
        let _ = finder.finish();
    }
}

pub(crate) fn map(fuzzer: &Fuzzer, input: &[u8]) {
    let Ok(map) = ChannelMap::read(&written(fuzzer, "map.toml", input)) else { return };
    let options = OpenOptions { dbc: Some(project().join("maps/genesis_at8.dbc")), ..OpenOptions::default() };
    let frames = "(1.0) can0 316#353EAC173E0E1B72\n(1.0) can0 43F#834480FF77901700\n(1.0) can0 440#FFB31B00FF9C1753\n";
    let log = Log::open(&written(fuzzer, "frames.log", frames.as_bytes()), &options);
    let Ok(mut log) = log else { return };
    if let Ok(readings) = Readings::new(&mut log, &map) {
        for step in Steps::new(readings).map_while(Result::ok) {
            assert!(step.time_s.is_finite() && step.input.dt_s >= 0.0);
        }
    }
}

pub(crate) fn dbc(fuzzer: &Fuzzer, input: &[u8]) {
    let dbc = written(fuzzer, "input.dbc", input);
    if Database::read(&dbc).is_err() {
        return;
    }
    let options = OpenOptions { dbc: Some(dbc), ..OpenOptions::default() };
    let path: &Path = &data().join("bus.log");
    if let Ok(mut log) = Log::open(path, &options) {
        let _ = inspect(&mut log);
    }
}
