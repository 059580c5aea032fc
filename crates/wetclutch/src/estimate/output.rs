//! Where estimates are written: a file, standard output, or a table in memory.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use trace::{Cell, ColumnKind, CsvWriter, TableWriter};

use super::live::{LiveCell, LiveRows};
use crate::memory_writer::MemoryWriter;
use crate::{Error, Table};

/// Where estimates go.
#[derive(Debug, Clone, Copy)]
pub enum Destination<'p> {
    /// A file, in the format of its name: CSV, Parquet or MDF. It appears whole or not at all.
    File(&'p Path),
    /// Standard output, as CSV.
    Standard,
    /// A [`Table`].
    Memory,
    /// Those who look at the rows as they come.
    Live(&'p dyn LiveRows),
}

impl<'p> Destination<'p> {
    /// Whether measured channels are columns without being named.
    pub(crate) fn is_live(self) -> bool {
        matches!(self, Self::Live(_))
    }

    /// The file, if it is one.
    pub fn file(self) -> Option<&'p Path> {
        if let Self::File(path) = self { Some(path) } else { None }
    }
}

/// The table of the estimates.
pub(crate) enum Output<'p> {
    File(TableWriter, PathBuf),
    Standard(Box<CsvWriter<BufWriter<io::Stdout>>>),
    Memory(Box<MemoryWriter>),
    Live(&'p dyn LiveRows, Vec<LiveCell>),
}

impl<'p> Output<'p> {
    /// Begins a table with these columns.
    pub(crate) fn named<'a>(
        destination: Destination<'p>,
        named: impl Iterator<Item = (&'a str, ColumnKind)>,
    ) -> Result<Self, Error> {
        match destination {
            Destination::Live(rows) => {
                let names: Vec<&str> = named.map(|(name, _)| name).collect();
                rows.begin(&names);
                Ok(Self::Live(rows, vec![LiveCell::Number(f64::NAN); names.len()]))
            }
            Destination::Memory => Ok(Self::Memory(Box::new(MemoryWriter::new(named)))),
            Destination::File(path) => {
                let writer = TableWriter::create(path, named).map_err(|error| Error::writing(path, &error))?;
                Ok(Self::File(writer, path.to_owned()))
            }
            Destination::Standard => {
                let names = named.map(|(name, _)| name);
                Ok(Self::Standard(Box::new(CsvWriter::new(BufWriter::new(io::stdout()), names)?)))
            }
        }
    }

    /// Makes room for as many rows as are known to come, where they stay in memory.
    pub(crate) fn reserve(&mut self, rows: usize) {
        if let Self::Memory(writer) = self {
            writer.reserve(rows);
        }
    }

    pub(crate) fn cells<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) -> Result<(), Error> {
        match self {
            Self::File(writer, path) => writer.row(time_s, cells).map_err(|error| Error::writing(path, &error)),
            Self::Standard(writer) => Ok(writer.row(time_s, cells)?),
            Self::Memory(writer) => {
                writer.push(time_s, cells);
                Ok(())
            }
            Self::Live(rows, latest) => {
                latest.iter_mut().zip(cells).for_each(|(cell, new)| cell.set(new));
                rows.row(time_s, latest);
                Ok(())
            }
        }
    }

    /// Writes a row of numbers, and behind them the words of the row before.
    pub(crate) fn numbers(&mut self, time_s: f64, numbers: &[f64]) -> Result<(), Error> {
        match self {
            Self::File(writer, path) => writer.numbers(time_s, numbers).map_err(|error| Error::writing(path, &error)),
            Self::Standard(writer) => Ok(writer.numbers(time_s, numbers)?),
            Self::Memory(writer) => {
                writer.numbers(time_s, numbers.iter().copied());
                Ok(())
            }
            Self::Live(..) => self.cells(time_s, numbers.iter().map(|number| Cell::Number(*number))),
        }
    }

    /// Hands the rows so far to their reader.
    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        match self {
            Self::File(writer, path) => writer.flush().map_err(|error| Error::writing(path, &error)),
            Self::Standard(writer) => Ok(writer.flush()?),
            Self::Memory(_) | Self::Live(..) => Ok(()),
        }
    }

    /// Completes the table, and returns it if it is in memory.
    pub(crate) fn finish(self) -> Result<Option<Table>, Error> {
        match self {
            Self::File(writer, path) => {
                writer.finish().map_err(|error| Error::writing(&path, &error))?;
                Ok(None)
            }
            Self::Standard(writer) => {
                writer.finish()?.flush()?;
                Ok(None)
            }
            Self::Memory(writer) => Ok(Some(writer.finish())),
            Self::Live(..) => Ok(None),
        }
    }
}
