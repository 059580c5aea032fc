//! Two runs, or two files of cars, over each other.

mod curves;
pub mod files;
mod run;
pub mod runs;

use std::path::Path;

use trace::ShownPath as _;

pub use curves::{Curve, SIGNALS, Signal};
pub use files::{FileComparison, FileValue, KeyDifference};
pub use run::ShiftOfRun;
pub use runs::{Difference, Group, Matching, QuantityDifference, RunComparison, ShiftPair};

use crate::Error;

/// What was compared.
#[derive(Debug, Clone)]
pub enum Comparison {
    /// Two vehicle files or two gearbox files.
    Files(Box<FileComparison>),
    /// Two runs.
    Runs(Box<RunComparison>),
}

/// Compares two runs, or two files. A run is an output of `estimate`, `demo` or `simulate`: its folder, its table of shifts, or its signals. A
/// file is a vehicle file or a gearbox file.
///
/// # Errors
/// One of them cannot be read, or they have nothing in common.
pub fn compare(a: &Path, b: &Path) -> Result<Comparison, Error> {
    match [a, b].map(is_file_of_car) {
        [true, true] => Ok(Comparison::Files(Box::new(files::compare(a, b)?))),
        [false, false] => Ok(Comparison::Runs(Box::new(runs::compare(a, b)?))),
        [is_file, _] => {
            let (file, run) = if is_file { (a, b) } else { (b, a) };
            Err(Error::Input(format!(
                "{}: a file of a car is not compared with a run, {}\nhint: give two vehicle files, two gearbox files, or two runs",
                file.shown(),
                run.shown()
            )))
        }
    }
}

fn is_file_of_car(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}
