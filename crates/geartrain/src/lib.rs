//! Gearboxes as data.
//!
//! A [`Description`] says what a gearbox is, on one of three levels: its stick diagram, its ratios with the holding torques
//! of the elements, or its ratios alone. [`Gearbox::new`] checks it and derives what the rest of the program uses: the
//! ratio of each gear, the holding torque of each engaged element, every shift with its offgoing, oncoming and held
//! elements, and for each shift between two elements the [`drivetrain::ReducedShift`].
//!
//! Torques are static and per N m of turbine torque. Slip is input side minus output side; a positive torque drives the
//! output side; the input side of a brake is the housing.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod capacity;
pub mod description;
pub mod finding;
pub mod gearbox;
mod inertia;
mod linear;
mod resolve;
pub mod shift;
mod teeth;
pub mod train;
mod unusual;

pub use capacity::Capacity;
pub use description::{
    Description, Element, ElementKind, EngagedGear, GearPair, Given, HOUSING, PlanetarySet, Planets, Ratio, Ratios,
    Shaft, SharedGear, Shares, ShiftMass, StatedRatio, StickDiagram,
};
pub use finding::{Fault, Finding, Part};
pub use gearbox::{Gear, Gearbox, GearboxElement, Holding};
pub use shift::{Change, Shift};
pub use train::{Connection, GearTrain, Member, TrainElement};
