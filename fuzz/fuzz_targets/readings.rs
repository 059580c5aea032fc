//! Measured logs, from tables with a reading in each row.
#![no_main]

fuzz_targets::program!(Readings);
