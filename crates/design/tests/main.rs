//! Gains and their certificates, and the observers that have them.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod budgets;
mod certified_bounds;
mod common;
mod compliant;
mod designs;
mod handling;
mod hostile_input;
mod longest_step;
mod mutations;
mod one_shift;
mod precision;
mod pulse_width;
mod ranges;
mod sample_form;
mod sliding;
mod slip_direction;
mod two_gears;
