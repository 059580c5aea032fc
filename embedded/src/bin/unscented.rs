//! The unscented Kalman filter.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::UnscentedFilter<f32>);
