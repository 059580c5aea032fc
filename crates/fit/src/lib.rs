//! Parameters of a vehicle from measured shifts.
//!
//! A shift is cut into segments in which it is known which clutches stick ([`ShiftRecord`]). In each of them the equations of
//! [`drivetrain`] run with the measured engine speed and the commands of the valves, and their speeds are compared with the
//! readings. [`fit`] finds the parameters of the car that are the same in all shifts, with intervals
//! ([`Precision`]); what the readings cannot tell keeps what was known before, and the report says so.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod budget;
mod car;
pub mod collect;
mod correlated;
pub mod drive;
mod drives;
mod driving;
pub mod error;
mod fill;
mod fitted_file;
pub mod fitting;
mod freeing;
pub mod gearbox;
mod given;
mod hotelling;
pub mod intervals;
mod kinds;
mod least_squares;
mod map_change;
mod mean_error;
mod motion;
mod moved;
pub mod open_loop;
pub mod parameters;
mod pressure;
pub mod record;
pub mod report;
mod report_row;
pub mod series;
mod shape;
pub mod shift_model;
mod shift_weights;
mod solver;
pub mod torque_change;
pub mod validation;
mod vehicle_text;
pub mod verdict;
mod weights;

pub use collect::{Collected, LogSource, collect, own_names};
pub use driving::{BacklashFit, Driving, Known, SkewFit, WheelFit};
pub use error::FitError;
pub use fill::FillFit;
pub use fitting::{Fit, Progress, SHIFTS_MAX, available, fit};
pub use given::Given;
pub use intervals::Precision;
pub use kinds::ShiftKinds;
pub use map_change::{ChangedChannel, ChangedMap, MapChange, MapKey, changed_map};
pub use mean_error::MeanError;
pub use open_loop::{OpenLoop, open_loop};
pub use parameters::{Available, Parameter, Prior};
pub use record::{ReadingAges, Segment, SegmentKind, ShiftRecord};
pub use report_row::{Measure, ReportRow};
pub use series::Series;
pub use shape::Map;
pub use shift_model::Channel;
pub use torque_change::TorqueChange;
pub use validation::HeldOut;
pub use vehicle_text::kept_text;
pub use verdict::Verdict;
pub use weights::OneStep;
