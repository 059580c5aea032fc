//! Formats that are not written in a browser, which has no files.

use std::convert::Infallible;
use std::io;
use std::marker::PhantomData;

use crate::{Cell, ColumnKind};

/// Writes MDF where there are files.
pub struct MdfWriter<W>(Infallible, PhantomData<W>);

/// Writes Parquet where there are files.
pub struct ParquetWriter<W>(Infallible, PhantomData<W>);

impl<W> MdfWriter<W> {
    /// Begins no file.
    ///
    /// # Errors
    /// Always.
    pub fn new<'a>(_: W, _: impl IntoIterator<Item = (&'a str, ColumnKind)>) -> io::Result<Self> {
        Err(io::Error::from(io::ErrorKind::Unsupported))
    }

    /// Writes a row.
    ///
    /// # Errors
    /// None: there is no file.
    pub fn row<'a>(&mut self, _: f64, _: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        match self.0 {}
    }

    /// Completes the file.
    ///
    /// # Errors
    /// None: there is no file.
    pub fn finish(self) -> io::Result<W> {
        match self.0 {}
    }
}

impl<W> ParquetWriter<W> {
    /// Begins no file.
    ///
    /// # Errors
    /// Always.
    pub fn new<'a>(_: W, _: impl IntoIterator<Item = (&'a str, ColumnKind)>) -> io::Result<Self> {
        Err(io::Error::from(io::ErrorKind::Unsupported))
    }

    /// Writes a row.
    ///
    /// # Errors
    /// None: there is no file.
    pub fn row<'a>(&mut self, _: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        match self.0 {}
    }

    /// Completes the file.
    ///
    /// # Errors
    /// None: there is no file.
    pub fn finish(self) -> io::Result<W> {
        match self.0 {}
    }
}
