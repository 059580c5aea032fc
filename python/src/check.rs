//! All errors of a file.

use std::path::PathBuf;

use pyo3::prelude::*;
use wetclutch::Error;

use crate::error::exception;

/// All errors of a file and of those that it names, as exceptions.
#[pyfunction]
pub(crate) fn errors_of_file(py: Python<'_>, path: PathBuf) -> PyResult<Vec<Py<PyAny>>> {
    let errors = py.detach(|| wetclutch::checks::check(&path)).map_err(|error| exception(py, &error))?;
    Ok(exceptions(py, &errors))
}

/// All errors of the text of a file, and of the text of its gearbox file where it is one of a car with a given gearbox, as exceptions.
#[pyfunction]
#[pyo3(signature = (name, text, gearbox=None))]
pub(crate) fn errors_of_texts(py: Python<'_>, name: &str, text: &str, gearbox: Option<&str>) -> Vec<Py<PyAny>> {
    let errors = py.detach(|| wetclutch::checks::errors_of_texts(name, text, gearbox));
    exceptions(py, &errors)
}

fn exceptions(py: Python<'_>, errors: &[Error]) -> Vec<Py<PyAny>> {
    errors.iter().map(|error| exception(py, error).into_value(py).into_any()).collect()
}
