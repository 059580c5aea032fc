//! Measured logs, in the files that engineers have.
//!
//! A log is a set of channels, each with its own clock. [`Log`] reads CSV, Parquet, ASAM MDF 4 and CAN logs with a DBC and
//! gives their samples merged in time order, or their channels in columns, in bounded memory. A [`ChannelMap`] says which channel is which signal;
//! [`Readings`] applies it, with stated rules for what cannot be a reading (see [`Quality`]). [`Steps`] makes the inputs of an
//! observer from readings; [`ShiftFinder`] finds the shifts of a drive.
//!
//! **Architecture invariant:** this is the only crate that reads the formats of recorders.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
// What only the reader of Parquet logs calls, and what needs threads.
#![cfg_attr(target_family = "wasm", allow(dead_code))]

mod ahead;
pub mod arrays;
pub mod can;
pub mod channel;
pub mod columns;
pub mod convert;
mod copies;
mod csv_dialect;
pub mod csv_log;
pub mod error;
pub mod format;
pub mod frozen;
mod gear_letters;
pub mod held;
mod in_order;
pub mod inspect;
pub mod log;
pub mod look_ahead;
pub mod map;
mod mdf;
#[cfg(target_family = "wasm")]
mod not_in_browser;
pub mod on_change;
#[cfg(not(target_family = "wasm"))]
mod parquet_log;
pub mod plausibility;
pub mod readings;
mod readings_table;
pub mod role;
mod row_order;
pub mod samples;
pub mod seen_gears;
pub mod shifts;
pub mod speed_faults;
pub mod speed_watch;
mod stamp;
pub mod steps;
pub mod suggest;
mod ties;
mod time_column;

pub use arrays::Arrays;
pub use channel::{Channel, TimeColumn};
pub use columns::{Block, Column, Columns};
pub use error::LogError;
pub use format::{CanKind, Format};
pub use frozen::{FrozenSpeed, NO_SPEEDS, Speeds};
pub use gear_letters::number_of_letter;
pub use held::HeldSpeed;
pub use inspect::{ChannelSummary, Inspection, inspect};
pub use log::{Log, OpenOptions, bytes_need_map, needs_map};
pub use look_ahead::{LOOK_AHEAD_S, LookAhead};
pub use map::{ChannelMap, Combine, Gearbox, Mapped};
pub use on_change::OnChange;
pub use readings::{Reading, Readings, RoleSummary};
pub use role::Role;
pub use samples::{Clock, Quality, QualityCounts, Sample, Samples};
pub use seen_gears::{SeenGear, SeenGears};
pub use shifts::{Direction, GearsOfShift, Load, Shift, ShiftFinder, ShiftPhase, ShiftQuality};
pub use speed_faults::SpeedFaults;
pub use speed_watch::{AllWithdrawn, SpeedReading, SpeedWatch, Withdrawn};
pub use steps::{Places, Step, Steps};
pub use suggest::suggest;
