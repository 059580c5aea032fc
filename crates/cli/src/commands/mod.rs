//! One file for each subcommand.

mod bench;
mod check;
mod demo;
mod design;
mod error_bound;
mod estimate;
mod reproduce;
mod sensitivity;
mod simulate;
mod study;
mod worst_case;

pub(crate) use bench::bench;
pub(crate) use check::check;
pub(crate) use demo::demo;
pub(crate) use design::design;
pub(crate) use error_bound::error_bound;
pub(crate) use estimate::estimate;
pub(crate) use reproduce::reproduce;
pub(crate) use sensitivity::sensitivity;
pub(crate) use simulate::simulate;
pub(crate) use study::{merge, study};
pub(crate) use worst_case::worst_case;

use std::path::Path;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
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

/// A bar on standard error with rate and time left; nothing where that is no terminal.
fn progress(length: u64, done: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::stderr());
    // The template is a constant.
    if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} runs  {per_sec}  {eta} left") {
        bar.set_style(style);
    }
    bar.set_position(done);
    bar.reset_eta();
    bar
}
