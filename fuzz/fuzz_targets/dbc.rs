//! Messages and signals of a bus.
#![no_main]

fuzz_targets::program!(Dbc);
