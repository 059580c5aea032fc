//! The Kalman filter.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::KalmanFilter<f32>);
