//! The filter of a car with a gearbox on its way through a drive, simulated or measured, and how good its estimates are.
//!
//! No files, no clock, no threads. A simulated drive ([`recording`], [`measured`]) and a measured log give the same rows ([`LogStep`]);
//! [`logged::LoggedDrive`] takes them one by one, gives an estimate for each, collects the shifts ([`drive`]) and checks
//! whether the log is one of this car ([`checks`]). Where the truth is known, [`score`] compares the estimates with it.
//!
//! Errors are counted by what the true clutches do: in the *torque phase* one of them holds and the other
//! carries torque while it slips; in the *inertia phase* both slip.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod car_beyond_bounds;
mod carried_pressures;
pub mod checks;
pub mod drive;
pub mod errors;
mod estimator;
mod felt_shift;
mod late_speeds;
pub mod learning_count;
pub mod logged;
pub mod logged_shifts;
pub mod measured;
mod plate_temperature;
mod ratio_errors;
pub mod recording;
pub mod score;
mod scored_shift;
pub mod shift_comfort;
mod shift_jerk;
pub mod shift_summary;
mod step;
mod thinned;
mod weighting;
pub mod worth_a_look;

pub use estimator::Estimator;
pub use score::{ClutchRow, ShiftScoreRow, SquaredErrors, TruePhase};
pub use step::LogStep;

use observer::gearbox::MAX_ELEMENTS;
use plant::TrainError;
use plant::car::CarError;
use thiserror::Error;

/// Sample time of the records that toothed wheels are read from, s.
pub const RECORD_S: f64 = 0.001;
/// Sample time of the filter, s.
pub const SAMPLE_S: f64 = 0.01;
/// Torque below which a clutch carries nothing but drag, N m.
pub(crate) const CARRIES_N_M: f64 = 2.0;
/// Pressure that counts as outside its range only beyond rounding, Pa.
pub const ROUNDING_PA: f64 = 1.0;
/// Torque that counts as outside its range only beyond rounding, N m.
pub const ROUNDING_N_M: f64 = 0.01;

/// Why a shift could not be scored.
#[derive(Debug, Error)]
pub enum EvaluateError {
    /// The simulation failed.
    #[error("the shift cannot be simulated: {0}")]
    Car(#[from] CarError),
    /// The car cannot be prepared.
    #[error("the car cannot be simulated: {0}")]
    Train(#[from] TrainError),
    /// There are more clutches than the filter has room for.
    #[error(
        "the gearbox has {0} clutches and brakes, and the filter has room for {MAX_ELEMENTS}\nhint: leave out those that no gear engages"
    )]
    TooManyElements(usize),
    /// A shift is none from one clutch with plates and valve to another.
    #[error("the filter has no tables for {0}\nhint: `wetclutch check` lists the shifts from one clutch to another")]
    NoTables(String),
    /// Bytes are no memory of an estimator of this version and car.
    #[error(
        "this memory of an observer {0}\nhint: make a new observer with what was learnt of the car, and save that: it is valid for all versions"
    )]
    Memory(String),
}

/// A number that belongs to two others: the mixing function of G. Steele, D. Lea, C. Flood, Fast splittable
/// pseudorandom number generators, OOPSLA 2014.
pub fn mixed(seed: u64, of: u64) -> u64 {
    let z = seed.wrapping_add(of.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
