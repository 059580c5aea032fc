//! Measured logs, from MDF 4 files.
#![no_main]

fuzz_targets::program!(Mdf);
