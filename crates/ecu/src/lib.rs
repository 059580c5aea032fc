//! The gearbox filter on a transmission controller, behind a C interface.
//!
//! The parameters of a car are an *image*: words of 32 bits with a header, a checksum and a fixed order ([`image`]). `init` checks
//! it and builds the filter in memory that the caller gives ([`memory`]); `step` takes an [`Input`] and gives an [`Estimate`]. Nothing is
//! allocated, nothing panics, and every wrong use gives a status word ([`status`]).
//!
//! `embedded/library` makes `libwetclutch.a` of it, `crates/export` writes image, header and tests of a car.
#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;

mod crc;
pub mod image;
mod interface;
mod layout;
mod learnt;
pub mod memory;
#[cfg(feature = "alloc")]
mod owned;
pub mod status;
mod words;

pub use crc::crc32;
pub use image::{FORMAT_VERSION, Header, MAGIC};
pub use interface::{
    CLUTCH_HIDDEN, CLUTCH_HOLDS, CLUTCH_RANGE, Clutch, ESTIMATE_WORDS, Estimate, INPUT_WORDS, Input, Reading, given,
};
pub use learnt::{LEARNT_WORDS, LearntWords};
pub use memory::Observer;
#[cfg(feature = "alloc")]
pub use owned::OwnedObserver;
pub use words::{Layout, Sink, Words};
