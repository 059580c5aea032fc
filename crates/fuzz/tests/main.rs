//! The first cases of every target, and every input that is kept.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::fs;
use std::path::{Path, PathBuf};

use config::{CarFile, Source, read_learnt};
use fuzz::{Depth, Fuzzer, Target};
use logs::can::Database;
use logs::{ChannelMap, Format, Log, OpenOptions, inspect};

fn first_cases(target: Target, cases: u64) {
    let fuzzer = Fuzzer::new(Depth::Short).unwrap();
    for input in Fuzzer::corpus(target) {
        fuzzer.run(target, &input);
    }
    for case in 0..cases {
        let input = fuzzer.input(target, case);
        let text = String::from_utf8_lossy(&input);
        assert!(fuzzer.survives(target, &input), "{} panics in case {case}:\n{text}", target.name());
    }
}

#[test]
fn no_vehicle_file_panics() {
    first_cases(Target::Vehicle, 300);
}

#[test]
fn no_gearbox_file_panics() {
    first_cases(Target::Gearbox, 300);
}

#[test]
fn no_experiment_file_panics() {
    first_cases(Target::Experiment, 300);
}

#[test]
fn no_study_file_panics() {
    first_cases(Target::Study, 100);
}

#[test]
fn no_log_panics() {
    first_cases(Target::Log, 300);
}

#[test]
fn no_table_of_runs_panics() {
    first_cases(Target::Table, 300);
}

#[test]
fn no_sample_panics_an_observer() {
    first_cases(Target::Step, 100);
}

#[test]
fn no_measured_log_panics() {
    for target in Target::ALL.into_iter().filter(|target| target.format().is_some()) {
        first_cases(target, 60);
    }
}

#[test]
fn nothing_learnt_panics() {
    first_cases(Target::Learnt, 200);
}

#[test]
fn no_channel_map_panics() {
    first_cases(Target::Map, 300);
}

#[test]
fn no_dbc_panics() {
    first_cases(Target::Dbc, 300);
}

/// The files of a corpus that its reader takes: those with an ending.
fn seeds(target: Target) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name());
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.extension().is_some()).collect()
}

#[test]
fn each_seed_is_one_that_its_reader_takes_and_a_corpus_is_small() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/tests/data");
    let options = OpenOptions { dbc: Some(data.join("bus.dbc")), ..OpenOptions::default() };
    for target in Target::ALL.into_iter().filter(|target| target.format().is_some()) {
        let seeds = seeds(target);
        assert!(!seeds.is_empty(), "{}", target.name());
        for path in seeds {
            assert_eq!(target.format(), Some(Format::of(&fs::read(&path).unwrap())), "{}", path.display());
            let mut log = Log::open(&path, &options).unwrap();
            let samples: u64 = inspect(&mut log).unwrap().channels.iter().map(|channel| channel.counts.total()).sum();
            assert!(samples > 0, "{}", path.display());
        }
    }
    let text = |path: &PathBuf| Source::built_in("seed", &fs::read_to_string(path).unwrap());
    seeds(Target::Dbc).iter().for_each(|path| assert!(!Database::read(path).unwrap().channels().is_empty()));
    seeds(Target::Map).iter().for_each(|path| assert!(!ChannelMap::read(path).unwrap().channels.is_empty()));
    let gearbox = CarFile::eight_speed().unwrap().car.gearbox;
    seeds(Target::Learnt).iter().for_each(|path| assert!(read_learnt(&gearbox, &text(path)).is_ok()));
    for target in Target::ALL {
        let bytes: usize = Fuzzer::corpus(target).iter().map(Vec::len).sum();
        assert!(bytes < 20_000, "{}: {bytes} bytes", target.name());
    }
}

#[test]
fn a_case_is_the_same_again_and_unlike_the_next() {
    let [one, other] = [(); 2].map(|()| Fuzzer::new(Depth::Short).unwrap());
    for target in Target::ALL {
        assert_eq!(one.input(target, 7), other.input(target, 7));
        assert_ne!(one.input(target, 7), one.input(target, 8));
    }
}
