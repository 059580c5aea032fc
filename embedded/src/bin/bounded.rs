//! The guaranteed range, around an observer that has no panic of its own.
#![no_std]
#![no_main]

embedded::controller!(embedded::observer::Bounded<f32, embedded::observer::RigidObserver<f32>>);
