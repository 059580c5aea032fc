//! The sliding-mode observer.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::SlidingObserver<f32>);
