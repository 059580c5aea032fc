//! A virtual pressure sensor for the wet clutches of automatic transmissions.
//!
//! Everything that the command `wetclutch` does is a function here: [`estimate()`] pressures and torques from a log, [`fit()`] a car to logs.
//! Quantities are in SI units, and names end in their unit.
//!
//! **Architecture invariant:** nothing here prints or parses arguments. What is to be said to a user goes to a [`Notes`] as it comes.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod checks;
pub mod compare;
pub mod contents;
mod error;
pub mod estimate;
mod export;
pub mod fitted;
pub mod gains;
mod memory_writer;
mod score;
pub mod simulate;
pub mod studies;
mod table;
mod table_text;
mod text;
mod vehicle;
mod words;

pub use ::export::{CSource, ExportOptions, ExportedFile};
pub use car::{Car, Drive, ElementId, ErrorBudget, Gear, GearId, Reading, Sensors, ShiftCommand, ShiftId, Step};
pub use config::Source;
pub use error::Error;
pub use estimate::{Destination, EstimateOptions, Estimates, InMemory, LogInput, estimate};
pub use evaluate::Estimator;
pub use export::export;
pub use fitted::{FitOptions, FitProgress, Fitted, fit};
pub use gains::{DesignObserver, DesignOptions, Designed, design};
pub use observer::Health;
pub use observer::gearbox::{ClutchEstimate, ShiftElement, ShiftEstimate, ShiftPhase};
pub use score::{PhaseScore, Scores, score};
pub use simulate::{Simulation, simulate};
pub use studies::StudyRuns;
pub use table::{Column, Table, Values};
pub use text::{grouped, shell_quoted};
pub use trace::{Cell, TableRows};
pub use vehicle::{
    TemplateNumbers, VehicleFile, drive_of, gearboxes, method_named, observer_named, read_drive, read_sensors,
    sensors_of, simulated_sensors_of,
};
pub use words::{Codes, Words};

/// Takes a sentence for the user as it comes. It may have several lines; one that begins with `hint: ` says what to do.
pub type Notes<'a> = &'a mut dyn FnMut(&str);

/// As many threads as the processors that this process may use.
pub fn available_threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}
