//! Measured logs, from Vector's binary files.
#![no_main]

fuzz_targets::program!(Blf);
