//! Modules of a few instructions, and the C of them.

#![expect(clippy::unwrap_used, reason = "tests")]

mod arithmetic;
mod module;
mod refused;
