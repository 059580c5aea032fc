//! Measured logs, from PCAN traces.
#![no_main]

fuzz_targets::program!(Trc);
