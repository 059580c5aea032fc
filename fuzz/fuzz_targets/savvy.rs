//! Measured logs, from tables of frames of SavvyCAN.
#![no_main]

fuzz_targets::program!(Savvy);
