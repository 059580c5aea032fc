//! The extended filter.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::ExtendedFilter<f32>);
