//! Vehicle, experiment and study files.
//!
//! A file is read into raw types that mirror its keys, then checked into types that the code can use
//! without looking again. An error names file, line, key, value and allowed range, and gives a hint
//! where a likely mistake can be seen.

pub mod check;
pub mod error;
pub mod experiment;
pub mod source;
pub mod study;
pub mod vehicle;

pub use error::ConfigError;
pub use experiment::{
    CurrentSensor, Experiment, GainMethod, GivenGains, ObserverEntry, ObserverKind, OffNominal, Profile, Scenario,
    Sensors, ShiftCalibration, SpeedSensor,
};
pub use source::{Kind, Source};
pub use study::{Factor, Plan, Study, Target, Values, Varied};
pub use vehicle::{
    CompliantRequirement, DesignRequirement, ErrorBounds, FilterSettings, ShiftClutch, Uncertainty, Vehicle,
};
