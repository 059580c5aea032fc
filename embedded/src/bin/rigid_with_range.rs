//! The rigid reduced-order observer with the guaranteed range around it.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::Bounded<f32, embedded::observer::RigidObserver<f32>>);
