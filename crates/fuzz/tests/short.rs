//! The first cases of every target, and every input that is kept.

#![expect(clippy::unwrap_used, reason = "a test may")]

use fuzz::{Depth, Fuzzer, Target};

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
    first_cases(Target::Measured, 300);
}

#[test]
fn no_channel_map_panics() {
    first_cases(Target::Map, 300);
}

#[test]
fn no_dbc_panics() {
    first_cases(Target::Dbc, 300);
}

#[test]
fn a_case_is_the_same_again_and_unlike_the_next() {
    let [one, other] = [(); 2].map(|()| Fuzzer::new(Depth::Short).unwrap());
    for target in Target::ALL {
        assert_eq!(one.input(target, 7), other.input(target, 7));
        assert_ne!(one.input(target, 7), one.input(target, 8));
    }
}
