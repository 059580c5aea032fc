//! Vehicle, experiment and study files.
//!
//! A file is read into raw types that mirror its keys, then checked and converted to types that need
//! no further checks. An error names file, line, key, value and allowed range, and gives a hint for a
//! likely mistake.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod all_errors;
mod car_study;
pub mod check;
pub mod drive;
pub mod error;
pub mod experiment;
pub mod gearbox;
pub mod learnt;
pub mod source;
mod speed_trace;
pub mod study;
mod tree;
pub mod vehicle;

pub use all_errors::all_errors;
pub use car_study::{CarStudy, CarStudyRuns, SampledErrors};
pub use drive::{Drive, DriveSegment, ShiftPlan, ShiftSchedule};
pub use error::ConfigError;
pub use experiment::{
    CurrentSensor, Experiment, FastFill, GainMethod, GivenGains, ObserverEntry, ObserverKind, OffNominal, Profile,
    ReadingErrors, SAMPLE_TIMES_S, Scenario, Sensors, ShiftCalibration, SpeedSensor,
};
pub use gearbox::GearboxFile;
pub use learnt::{check_learnt, read_learnt, write_learnt};
pub use source::{Kind, Source, toml_number};
pub use speed_trace::SpeedTrace;
pub use study::{Change, Factor, Plan, Sometimes, Study, Target, Values, Varied};
pub use trace::toml_string;
pub use vehicle::{
    Car, CarErrorBounds, CompliantRequirement, DefaultTaken, DesignRequirement, ElementErrorBounds, ElementErrors,
    ErrorBounds, ErrorBudget, FilterSettings, LockUp, OneShiftError, ShiftClutch, TURBINE_SIDE_INERTIA_KG_M2,
    Uncertainty, ValveUncertainty, Vehicle,
};
