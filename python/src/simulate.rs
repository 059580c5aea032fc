//! Simulated drives.

use std::cell::Cell;
use std::path::PathBuf;

use pyo3::prelude::*;
use wetclutch::{Error, VehicleFile};

use crate::car::parsed;
use crate::error::exception;
use crate::table::Table;
use crate::work::{self, Report};

/// Drives a car through a drive file: every signal, what the car measures, and distance in m, shifts and maximum speed in m/s.
#[pyfunction]
#[pyo3(signature = (car, drive, seed, progress))]
pub(crate) fn simulate(
    py: Python<'_>,
    car: (String, String, Option<String>),
    drive: PathBuf,
    seed: Option<u64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<(Table, Table, (f64, usize, f64))> {
    let (name, text, gearbox) = car;
    let VehicleFile::Gearbox(file) = parsed(py, &name, &text, gearbox.as_deref())? else {
        let message = "car: a drive needs a car with a gearbox, and this is one of a single shift".to_owned();
        return Err(exception(py, &Error::Input(message)));
    };
    let run = work::done(py, progress.as_ref(), move |work| {
        let drive = wetclutch::read_drive(&drive, seed)?;
        let duration_s = drive.duration_s();
        let whole_s = Cell::new(-1.0);
        let is_stopped = |time_s: f64| {
            // A report for each second of the drive.
            if time_s.floor() != whole_s.replace(time_s.floor()) {
                let words = format!("{time_s:.0} of {duration_s:.0} s");
                work.report(Report { words, fraction: Some((time_s / duration_s).clamp(0.0, 1.0)) });
            }
            work.is_stopped()
        };
        wetclutch::simulate::simulate_until(&file.car, &drive, &is_stopped)
    })?;
    let summary = (run.summary.distance_m, run.summary.shifts, run.summary.fastest_m_s);
    Ok((run.truth.into(), run.measured.into(), summary))
}
