//! Exported observers: their bits, their C, and wrong use.

#![expect(clippy::unwrap_used, reason = "tests")]

mod a2l;
mod c_program;
mod fmu;
mod image;
mod readings;
mod same_bits;
mod wrong_use;
