//! Formats that are not read in a browser: MDF and Parquet need a file in which a reader can seek, and unpackers in C; BLF, an unpacker that would
//! make the page a tenth larger.

use std::convert::Infallible;
use std::io::Read;
use std::path::Path;

use crate::LogError;
use crate::ahead::Crew;
use crate::can::{Database, Frame, Frames};
use crate::columns::Stream;
use crate::{Channel, TimeColumn};

/// What to do with a log of such a format.
const NOT_READ: &str = "MDF, Parquet and BLF logs are not read in a browser\nhint: save the channels as CSV with `wetclutch convert`, or use the program";

/// An MDF log: there is none.
pub(crate) struct MdfLog(Infallible);

/// A Parquet log: there is none.
pub(crate) struct ParquetLog(Infallible);

/// A BLF log: there is none.
pub(crate) struct Blf(Infallible);

type Opened<L> = Result<(L, Vec<Channel>), LogError>;

impl Blf {
    pub(crate) fn open(path: &Path, _: Box<dyn Read + Send>) -> Result<Self, LogError> {
        Err(LogError::file(path, NOT_READ))
    }
}

impl Frames for Blf {
    fn next_frame(&mut self) -> Result<Option<Frame>, LogError> {
        match self.0 {}
    }

    fn notes(&self) -> Vec<String> {
        match self.0 {}
    }
}

impl MdfLog {
    pub(crate) fn open(path: &Path, _: Option<Database>, _: Option<&TimeColumn>) -> Opened<Self> {
        Err(LogError::file(path, NOT_READ))
    }

    pub(crate) fn has_frames(&self) -> bool {
        match self.0 {}
    }

    pub(crate) fn lacks_dbc(&self) -> bool {
        match self.0 {}
    }

    pub(crate) fn note(&mut self, _: &str) {
        match self.0 {}
    }

    pub(crate) fn format(&self) -> String {
        match self.0 {}
    }

    pub(crate) fn crew(&self) -> &Crew {
        match self.0 {}
    }

    pub(crate) fn unpack_with(&mut self, _: Crew) {
        match self.0 {}
    }

    pub(crate) fn streams(&self, _: &[bool]) -> Result<Vec<Box<dyn Stream + '_>>, LogError> {
        match self.0 {}
    }
}

impl ParquetLog {
    pub(crate) fn open(path: &Path, _: Option<&TimeColumn>) -> Opened<Self> {
        Err(LogError::file(path, NOT_READ))
    }

    pub(crate) fn note(&mut self, _: &str) {
        match self.0 {}
    }

    pub(crate) fn stream(&mut self, _: &[bool]) -> Result<Box<dyn Stream + '_>, LogError> {
        match self.0 {}
    }
}
