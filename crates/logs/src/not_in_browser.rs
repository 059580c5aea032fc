//! Parquet logs are not read in a browser: they need a file in which a reader can seek, and unpackers in C.

use std::convert::Infallible;
use std::path::Path;

use crate::LogError;
use crate::columns::Stream;
use crate::{Channel, TimeColumn};

/// A Parquet log: there is none.
pub(crate) struct ParquetLog(Infallible);

impl ParquetLog {
    pub(crate) fn open(path: &Path, _: Option<&TimeColumn>) -> Result<(Self, Vec<Channel>), LogError> {
        Err(LogError::io(path)(std::io::ErrorKind::Unsupported.into()))
    }

    pub(crate) fn note(&mut self, _: &str) {
        match self.0 {}
    }

    pub(crate) fn stream(&mut self, _: &[bool]) -> Result<Box<dyn Stream + '_>, LogError> {
        match self.0 {}
    }
}
