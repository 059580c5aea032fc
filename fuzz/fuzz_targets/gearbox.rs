//! Gearbox files, and the diagrams of a gearbox.
#![no_main]

fuzz_targets::program!(Gearbox);
