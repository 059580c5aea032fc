//! Vehicle files of both kinds of car.
#![no_main]

fuzz_targets::program!(Vehicle);
