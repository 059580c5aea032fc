//! Measured logs, from candump's text.
#![no_main]

fuzz_targets::program!(Candump);
