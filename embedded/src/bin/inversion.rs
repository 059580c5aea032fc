//! The direct inversion.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::Inversion<f32>);
