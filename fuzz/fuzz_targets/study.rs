//! Study files.
#![no_main]

fuzz_targets::program!(Study);
