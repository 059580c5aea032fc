//! The chapter, campaigns, and the filter for any shift.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod any_shift;
mod campaign;
mod car_sizes;
mod chapter;
mod demo_drive;
mod field;
