//! Measured logs, from tables as text.
#![no_main]

fuzz_targets::program!(Csv);
