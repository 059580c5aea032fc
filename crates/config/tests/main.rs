//! Vehicle, experiment, gearbox and drive files: those that ship, and those that are wrong.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod cars;
mod common;
mod dogs;
mod files;
mod gearbox_errors;
mod gearboxes;
mod mutations;
mod one_shift;
mod provoked;
mod ratios_alone;
