//! The rigid reduced-order observer; with zero gains, the open loop.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::RigidObserver<f32>);
