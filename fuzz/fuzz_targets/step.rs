//! Samples for the step of every observer.
#![no_main]

fuzz_targets::program!(Step);
