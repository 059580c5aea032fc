//! Files as Python gives them.

use std::path::PathBuf;

use pyo3::intern;
use pyo3::prelude::*;
use wetclutch::{Error, Sensors, Source};

/// A file: its path, or what messages call it and its text.
pub(crate) enum GivenFile {
    Path(PathBuf),
    Text(String, String),
}

impl<'a, 'py> FromPyObject<'a, 'py> for GivenFile {
    type Error = PyErr;

    fn extract(given: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        match given.getattr_opt(intern!(given.py(), "_source"))? {
            Some(source) => source.extract().map(|(name, text)| Self::Text(name, text)),
            None => given.extract().map(Self::Path),
        }
    }
}

impl GivenFile {
    /// Its text.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn source(self) -> Result<Source, Error> {
        Ok(match self {
            Self::Path(path) => Source::read(&path)?,
            Self::Text(name, text) => Source::built_in(&name, &text),
        })
    }

    /// The sensors that its table `sensors` describes.
    ///
    /// # Errors
    /// The file cannot be read, has no such table, or a value cannot be right.
    pub(crate) fn sensors(self) -> Result<Sensors, Error> {
        wetclutch::sensors_of(&self.source()?)
    }
}
