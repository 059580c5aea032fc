//! What is in a log.

use std::path::PathBuf;

use pyo3::prelude::*;
use wetclutch::contents::{channels, log_shifts, suggested_map};
use wetclutch::{Error, InMemory, LogInput};

use crate::estimate::Mapping;
use crate::table::Table;
use crate::work;

/// A log as Python gives it: its name, its table if it is one in memory, and how its channels are mapped.
type Given = (PathBuf, Option<Py<Table>>, Mapping);

/// The channels of a log.
#[pyfunction]
pub(crate) fn log_channels(py: Python<'_>, log: Given) -> PyResult<Table> {
    Ok(of_log(py, log, Vec::new(), |log| channels(log, &mut |_| ()))?.into())
}

/// A first channel map of a log.
#[pyfunction]
pub(crate) fn log_map(py: Python<'_>, log: Given) -> PyResult<String> {
    of_log(py, log, Vec::new(), suggested_map)
}

/// The shifts that the speeds of a log show, with the ratios of these gears if some are given.
#[pyfunction]
pub(crate) fn shifts_of_log(py: Python<'_>, log: Given, ratios: Vec<f64>) -> PyResult<Table> {
    Ok(of_log(py, log, ratios, |log| log_shifts(log, &mut |_| ()))?.into())
}

fn of_log<T: Send + 'static>(
    py: Python<'_>,
    (path, table, mapping): Given,
    ratios: Vec<f64>,
    find: impl FnOnce(LogInput<'_>) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let rows = table.map(|table| table.get().rows());
    work::done(py, None, move |_| {
        let mut map = mapping.read(None)?;
        if !ratios.is_empty() {
            map.gearbox.ratios = ratios;
        }
        find(LogInput { path: &path, memory: rows.as_ref().map(InMemory::Rows), map: &map })
    })
}
