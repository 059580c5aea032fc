//! Simulated drives.

use std::cell::Cell;

use pyo3::prelude::*;
use wetclutch::{Error, VehicleFile};

use crate::car::parsed;
use crate::error::exception;
use crate::file::GivenFile;
use crate::table::Table;
use crate::work::{self, Report};

/// Checks a drive file: its text, its name and its length, s.
#[pyfunction]
pub(crate) fn check_drive(py: Python<'_>, drive: GivenFile) -> PyResult<(String, String, f64)> {
    let checked = || -> Result<_, Error> {
        let source = drive.source()?;
        let text = source.text.clone();
        let drive = wetclutch::drive_of(source)?;
        let duration_s = drive.duration_s();
        Ok((text, drive.name, duration_s))
    };
    checked().map_err(|error| exception(py, &error))
}

/// Checks a file with the table of sensors: its text.
#[pyfunction]
pub(crate) fn check_sensors(py: Python<'_>, sensors: GivenFile) -> PyResult<String> {
    let checked = || -> Result<_, Error> {
        let source = sensors.source()?;
        wetclutch::sensors_of(&source)?;
        Ok(source.text)
    };
    checked().map_err(|error| exception(py, &error))
}

/// Every signal, what the car measures, its shifts, and distance in m, number of shifts and maximum speed in m/s.
type Driven = (Table, Table, Table, (f64, usize, f64));

/// Drives a car through a drive file, with these sensors in place of those of the file if they are given: every signal, what the car measures, its
/// shifts, and distance in m, shifts and maximum speed in m/s.
#[pyfunction]
#[pyo3(signature = (car, drive, sensors, seed, progress))]
pub(crate) fn simulate(
    py: Python<'_>,
    car: (String, String, Option<String>),
    drive: GivenFile,
    sensors: Option<GivenFile>,
    seed: Option<u64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Driven> {
    let (name, text, gearbox) = car;
    let VehicleFile::Gearbox(file) = parsed(py, &name, &text, gearbox.as_deref())? else {
        let message = "car: a drive needs a car with a gearbox, and this is one of a single shift".to_owned();
        return Err(exception(py, &Error::Input(message)));
    };
    let (run, shifts) = work::done(py, progress.as_ref(), move |work| {
        let mut drive = wetclutch::drive_of(drive.source()?)?;
        if let Some(sensors) = sensors {
            drive.sensors = Some(wetclutch::simulated_sensors_of(&sensors.source()?)?);
        }
        if let (Some(sensors), Some(seed)) = (&mut drive.sensors, seed) {
            sensors.seed = seed;
        }
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
        wetclutch::simulate::simulate_scored(&file.car, &drive, &is_stopped)
    })?;
    let summary = (run.summary.distance_m, run.summary.shifts, run.summary.fastest_m_s);
    Ok((run.truth.into(), run.measured.into(), shifts.into(), summary))
}
