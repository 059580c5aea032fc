//! Plain tables, through every observer.
#![no_main]

fuzz_targets::program!(Log);
