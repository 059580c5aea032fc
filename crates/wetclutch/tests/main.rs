//! The library as others use it.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod adaptation;
mod failed_sensors;
mod memory;
mod polled;
