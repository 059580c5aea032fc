//! Errors of the library as exceptions of the package.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use wetclutch::Error;

/// The exception of an error: `InputError` or `WorkError` of the package, with the parts of its message.
pub(crate) fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let class = match error {
        Error::Input(_) => "InputError",
        Error::Work(_) | Error::BrokenPipe => "WorkError",
    };
    made(py, class, error).unwrap_or_else(|failed| failed)
}

fn made(py: Python<'_>, class: &str, error: &Error) -> PyResult<PyErr> {
    let parts = PyDict::new(py);
    let place = error.place();
    parts.set_item("hint", error.hint())?;
    parts.set_item("file", place.as_ref().map(|(file, _)| file))?;
    parts.set_item("line", place.as_ref().and_then(|(_, line)| *line))?;
    parts.set_item("key", error.key())?;
    let class = py.import("wetclutch._errors")?.getattr(class)?;
    Ok(PyErr::from_value(class.call((error.message(),), Some(&parts))?))
}

/// A defect of the program.
pub(crate) fn defect(what: &str) -> PyErr {
    PyRuntimeError::new_err(format!("wetclutch: a defect of the program: {what}"))
}
