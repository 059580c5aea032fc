//! Measured logs, from Vector's text.
#![no_main]

fuzz_targets::program!(Asc);
