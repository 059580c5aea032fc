//! One file for each subcommand.

mod bench;
mod check;
mod demo;
mod design;
mod estimate;
mod reproduce;
mod simulate;
mod study;

pub(crate) use bench::bench;
pub(crate) use check::check;
pub(crate) use demo::demo;
pub(crate) use design::design;
pub(crate) use estimate::estimate;
pub(crate) use reproduce::reproduce;
pub(crate) use simulate::simulate;
pub(crate) use study::{merge, study};

use std::path::Path;

use trace::Trace;

use crate::failure::Failure;

/// Writes a trace as a comma-separated file, whole or not at all.
fn write_trace(path: &Path, trace: &Trace) -> Result<(), Failure> {
    // A file that cannot be written is no fault of the input.
    trace::write_csv(path, trace).map_err(|error| Failure::Work(error.to_string()))
}

/// Writes a text file, whole or not at all.
fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    trace::write_whole(path, |writer| writer.write_all(text.as_bytes())).map_err(|error| Failure::writing(path, &error))
}
