//! Measured logs, from Parquet files.
#![no_main]

fuzz_targets::program!(Parquet);
