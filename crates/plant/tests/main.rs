//! The simulated cars against closed forms, conservation laws and other integrators.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod analytic;
mod cars;
mod common;
mod energy_audit;
mod fill;
mod independent_method;
mod shift;
