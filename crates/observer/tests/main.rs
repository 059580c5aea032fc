//! Ranges and models against equations that are written down apart from them.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod fill_range;
mod models;
