//! Small gearboxes: what is known of them otherwise, and descriptions that are wrong.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod chapter;
mod describe;
mod trains;
mod wrong_input;
