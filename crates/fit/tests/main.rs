//! Fits of drawn vehicles, and logs that a fit should refuse.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod attacks;
mod backlash;
mod common;
mod drive;
mod fill;
mod gearbox;
mod one_car;
mod two_speed_driving;
