//! The compliant reduced-order observer.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::CompliantObserver<f32>);
