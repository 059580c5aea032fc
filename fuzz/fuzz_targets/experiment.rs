//! Experiment files.
#![no_main]

fuzz_targets::program!(Experiment);
