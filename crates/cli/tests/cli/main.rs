//! The command as a user meets it: what it writes, prints, and exits with.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod any_car;
mod commands;
mod drives;
mod equations;
mod fit;
mod logs;
mod long_logs;
mod measured;
mod studies;
mod support;
