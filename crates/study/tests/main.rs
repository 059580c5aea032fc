//! The chapter, campaigns, and the gearbox filter.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod campaign;
mod car_sizes;
mod chapter;
mod demo_drive;
mod field;
mod gearbox;
mod one_filter;
