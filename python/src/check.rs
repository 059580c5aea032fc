//! All errors of a file.

use std::path::PathBuf;

use pyo3::prelude::*;

use crate::error::exception;

/// All errors of a file and of those that it names, as exceptions.
#[pyfunction]
pub(crate) fn errors_of_file(py: Python<'_>, path: PathBuf) -> PyResult<Vec<Py<PyAny>>> {
    let errors = py.detach(|| wetclutch::checks::check(&path)).map_err(|error| exception(py, &error))?;
    Ok(errors.iter().map(|error| exception(py, error).into_value(py).into_any()).collect())
}
