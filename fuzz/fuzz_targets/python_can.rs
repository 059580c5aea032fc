//! Measured logs, from tables of frames of python-can.
#![no_main]

fuzz_targets::program!(PythonCan);
