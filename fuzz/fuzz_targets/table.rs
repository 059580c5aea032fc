//! Tables of a study.
#![no_main]

fuzz_targets::program!(Table);
