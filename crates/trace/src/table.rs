//! Tables over time in the format that the name of their file says.

use std::io::{self, Write};
use std::path::Path;

use crate::{Cell, CsvWriter, MdfWriter, ParquetWriter, WholeFile, signal};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Whole numbers from 0, 64 bits.
    Whole,
    /// Numbers; an empty cell is none.
    Number,
    /// Words.
    Word,
}

/// Formats of tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated text.
    Csv,
    /// Parquet.
    Parquet,
    /// ASAM MDF 4.10.
    Mdf,
}

impl TableFormat {
    /// The format by the ending of a name: `.parquet`, `.mf4`, else CSV.
    pub fn of(path: &Path) -> Self {
        match path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).as_deref() {
            Some("parquet") => Self::Parquet,
            Some("mf4" | "mdf") => Self::Mdf,
            _ => Self::Csv,
        }
    }
}

/// Writes a table row by row into a file, whole or not at all.
pub enum TableWriter {
    /// Comma-separated text.
    Csv(Box<CsvWriter<WholeFile>>),
    /// Parquet.
    Parquet(Box<ParquetWriter<WholeFile>>),
    /// ASAM MDF 4.10.
    Mdf(Box<MdfWriter<WholeFile>>),
}

impl TableWriter {
    /// Begins a table with the time and these columns, in the format of the name of the file.
    ///
    /// # Errors
    /// The file cannot be written, or is a pipe and the format needs a file.
    pub fn create<'a>(path: &Path, columns: impl IntoIterator<Item = (&'a str, ColumnKind)>) -> io::Result<Self> {
        let file = WholeFile::create(path)?;
        Ok(match TableFormat::of(path) {
            TableFormat::Csv => Self::Csv(Box::new(CsvWriter::new(file, columns.into_iter().map(|(name, _)| name))?)),
            TableFormat::Parquet => {
                let time = std::iter::once((signal::TIME, ColumnKind::Number));
                Self::Parquet(Box::new(ParquetWriter::new(file, time.chain(columns))?))
            }
            TableFormat::Mdf if file.is_replacement() => Self::Mdf(Box::new(MdfWriter::new(file, columns)?)),
            TableFormat::Mdf => {
                let message = "MDF cannot be written to a pipe or device\nhint: name a file";
                return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
            }
        })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What the file meets.
    pub fn row<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        match self {
            Self::Csv(writer) => writer.row(time_s, cells),
            Self::Parquet(writer) => writer.row(std::iter::once(Cell::Number(time_s)).chain(cells)),
            Self::Mdf(writer) => writer.row(time_s, cells),
        }
    }

    /// Writes a row that holds numbers, and behind them the words of the row before.
    ///
    /// # Errors
    /// What the file meets, or there is no row before.
    pub fn numbers(&mut self, time_s: f64, numbers: &[f64]) -> io::Result<()> {
        match self {
            Self::Csv(writer) => writer.numbers(time_s, numbers),
            Self::Parquet(_) | Self::Mdf(_) => {
                self.row(time_s, numbers.iter().map(|number| Cell::Number(*number)).chain([Cell::SameWords]))
            }
        }
    }

    /// Hands the rows so far to the file, where the format allows it.
    ///
    /// # Errors
    /// What the file meets.
    pub fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Csv(writer) => writer.flush(),
            Self::Parquet(_) | Self::Mdf(_) => Ok(()),
        }
    }

    /// Completes the table and gives the file its name.
    ///
    /// # Errors
    /// What the file meets.
    pub fn finish(self) -> io::Result<()> {
        let mut file = match self {
            Self::Csv(writer) => writer.finish()?,
            Self::Parquet(writer) => writer.finish()?,
            Self::Mdf(writer) => writer.finish()?,
        };
        file.flush()?;
        file.finish()
    }
}
