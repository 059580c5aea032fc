//! The super-twisting observer.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::SuperTwisting<f32>);
