//! Channel maps.
#![no_main]

fuzz_targets::program!(Map);
