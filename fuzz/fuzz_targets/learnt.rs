//! What was learnt of a car.
#![no_main]

fuzz_targets::program!(Learnt);
