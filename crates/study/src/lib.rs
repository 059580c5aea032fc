//! From a source of samples through observers to scores.
//!
//! A simulated drive and a measured log give the same kind of samples. [`run()`] runs an observer over them, in memory or
//! read row by row; [`score()`] compares the estimates with the true values, if there are any.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod bench;
pub mod campaign;
pub mod comparison;
pub mod consistency;
pub mod default_influence;
pub mod drive;
pub mod error_bound;
pub mod estimates;
mod frozen_rows;
pub mod gearbox;
pub mod log;
pub mod observers;
pub mod overview;
pub mod passages;
mod row_clock;
mod row_samples;
pub mod run;
pub mod sampling;
pub mod score;
pub mod sensitivity;
pub mod shift_estimates;
pub mod shift_learning;
pub mod statements;
#[cfg(not(target_family = "wasm"))]
pub mod worst_case;

pub use bench::{Bench, bench};
pub use campaign::{Campaign, Row, Status, Summary, execute};
pub use comparison::{Comparison, ObserverRun, StudyError, compare};
pub use consistency::Consistency;
pub use default_influence::{Influence, default_influences};
pub use drive::{DriveColumns, DriveRow, simulate_drive, simulate_shift, simulate_shift_within, true_phases};
pub use error_bound::{ErrorBound, error_bound};
pub use estimates::{EstimateColumns, OutputColumn, estimates_trace};
pub use log::{Log, LogRow};
pub use observers::AnyObserver;
pub use overview::Overview;
pub use passages::Passages;
pub use run::{RunColumns, Signals, run};
pub use score::{ErrorScore, PhaseScore, RangeScore, ShiftQuality, ShiftRating, ShiftSample, score};
pub use sensitivity::{PhaseSensitivity, sensitivity};
pub use shift_estimates::{LogSample, RecentSamples, ShiftEstimate};
pub use statements::{Chapter, Statement, reproduce};
#[cfg(not(target_family = "wasm"))]
pub use worst_case::{Target, WorstCase, worst_case};
