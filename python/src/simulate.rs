//! Simulated drives.

use std::path::PathBuf;

use pyo3::prelude::*;
use wetclutch::{Error, VehicleFile};

use crate::car::parsed;
use crate::error::exception;
use crate::table::Table;
use crate::work;

/// Drives a car through a drive file: every signal, what the car measures, and distance in m, shifts and maximum speed in m/s.
#[pyfunction]
pub(crate) fn simulate(
    py: Python<'_>,
    car: (String, String, Option<String>),
    drive: PathBuf,
    seed: Option<u64>,
) -> PyResult<(Table, Table, (f64, usize, f64))> {
    let (name, text, gearbox) = car;
    let VehicleFile::Gearbox(file) = parsed(py, &name, &text, gearbox.as_deref())? else {
        let message = "car: a drive needs a car with a gearbox, and this is one of a single shift".to_owned();
        return Err(exception(py, &Error::Input(message)));
    };
    let run = work::done(py, None, move |work| {
        let drive = wetclutch::read_drive(&drive, seed)?;
        let is_stopped = || work.is_stopped();
        wetclutch::simulate::simulate_until(&file.car, &drive, &is_stopped)
    })?;
    let summary = (run.summary.distance_m, run.summary.shifts, run.summary.fastest_m_s);
    Ok((run.truth.into(), run.measured.into(), summary))
}
