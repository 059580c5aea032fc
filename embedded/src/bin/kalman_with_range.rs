//! The Kalman filter with the guaranteed range around it.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::Bounded<f32, embedded::observer::KalmanFilter<f32>>);
