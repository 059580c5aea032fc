//! Equations that the simulated powertrain and the observers share.
//!
//! Each equation exists once: the plant and every observer call the same converter, friction,
//! road-load and gear-train functions, with different parameters. Everything is `no_std`, allocates
//! nothing and is generic over `f32` and `f64`.
//!
//! Units are SI and part of each name (`_pa`, `_n_m`, `_rad_s`, `_kg_m2`, `_s`, `_a`, `_rad`).
//! Slip is input side minus output side; a positive clutch torque drives the output side; pressures
//! are gauge. `docs/reference/conventions.md` states the signs once for the whole project.
#![no_std]

pub mod clutch;
pub mod converter;
pub mod cylinder;
pub mod driveline;
pub mod engine;
pub mod jerk;
pub mod jerk_of_readings;
pub mod oil;
pub mod real;
pub mod road;
pub mod shift;
pub mod shift_kind;
pub mod table;
pub mod tyre;
pub mod valve;

pub use clutch::Clutch;
pub use converter::{Converter, ConverterTorques};
pub use cylinder::{Cylinder, Passage};
pub use driveline::Driveline;
pub use engine::Engine;
pub use jerk::PeakJerk;
pub use real::Real;
pub use road::RoadLoad;
pub use shift::{AccelerationRow, Engagement, ReducedShift, ShiftCoefficients, ShiftTorques};
pub use shift_kind::{PhaseOrder, ShiftKind};
pub use table::{ColumnPlace, Place, Table1, Table2, TableError};
pub use tyre::Tyre;
pub use valve::{ClutchValve, CommandKind, Lag, LinearValve, Play, PulseWidth, Valve, ValveMaps, ValveStep};
