//! Plain types of a car, its readings and their errors.
//!
//! Every crate that computes with a car takes it from here. Nothing here reads a file or parses a text: `config` makes these types
//! from files.
//!
//! What an observer takes ([`Step`], [`Reading`], [`Gear`]) is there without the feature `std`: it is `no_std`, allocates
//! nothing and is generic over `f32` and `f64`.
#![cfg_attr(not(feature = "std"), no_std)]

mod ids;
mod reading;
mod step;

pub use ids::{ElementId, Gear, GearId, MAX_ELEMENTS, ShiftId};
pub use reading::Reading;
pub use step::{Commands, ShiftCommand, Speeds, Step};
