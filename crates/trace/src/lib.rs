//! Time series with names and units, and their files.
//!
//! A trace is a time axis and columns over it. Names carry their unit (`turbine_speed_rad_s`). A file may
//! use other common units (`_rpm`, `_bar`, `_ms`); they are converted when the file is read, so that all
//! other crates use SI units.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod atomic;
pub mod csv_file;
mod early_sync;
pub mod error;
mod folders;
pub mod follow;
#[cfg(not(target_family = "wasm"))]
pub mod mdf_file;
#[cfg(target_family = "wasm")]
mod not_in_browser;
#[cfg(not(target_family = "wasm"))]
pub mod parquet_file;
pub mod rows;
#[cfg(test)]
mod scratch;
pub mod shown;
pub mod shown_units;
pub mod signal;
#[cfg(test)]
mod slow;
pub mod table;
pub mod table_rows;
pub mod text;
pub mod text_file;
pub mod units;
pub mod watch;

use std::borrow::Cow;
use std::path::PathBuf;

pub use atomic::{WholeFile, check_writable, left_by_killed, remove_unfinished, write_whole};
pub use csv_file::{Cell, CsvRows, CsvWriter, RecordError, Records, csv_written, read_csv, write_csv};
pub use error::TraceError;
pub use follow::Following;
#[cfg(not(target_family = "wasm"))]
pub use mdf_file::MdfWriter;
#[cfg(target_family = "wasm")]
pub use not_in_browser::{MdfWriter, ParquetWriter};
#[cfg(not(target_family = "wasm"))]
pub use parquet_file::{ParquetWriter, write_parquet};
pub use rows::{Damage, FolderLock, GrowingTable, partial_path, read_rows};
pub use shown::{ShownPath, is_unprintable, plain_type, printable, rounded, toml_number, toml_string};
pub use shown_units::{ShownUnits, quantity};
pub use table::{ColumnKind, TableFormat, TableWriter};
pub use table_rows::TableRows;
pub use text_file::{read_small, read_text};
pub use units::{Quantity, Unit};
pub use watch::{FileUse, file_used, watch_files};

/// A word of a column; the program's own cost nothing to copy.
pub type Word = Cow<'static, str>;

/// The values of one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers; NaN where a sample was lost.
    Numbers(Vec<f64>),
    /// Words, such as phases.
    Words(Vec<Word>),
}

/// A named column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// The name, with its unit.
    pub name: String,
    /// One value for each time.
    pub values: Values,
}

/// Columns over a common time axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trace {
    /// The file it was read from, if any.
    pub path: Option<PathBuf>,
    /// Times, s, strictly rising.
    pub time_s: Vec<f64>,
    /// The other columns.
    pub columns: Vec<Column>,
}

impl Trace {
    /// An empty trace with these numeric columns.
    pub fn with_columns(names: &[&str]) -> Self {
        let column = |name: &&str| Column { name: (*name).to_owned(), values: Values::Numbers(Vec::new()) };
        Self { path: None, time_s: Vec::new(), columns: names.iter().map(column).collect() }
    }

    /// Appends a row of numbers in the order of the columns.
    ///
    /// # Panics
    /// If the row has not one value for each column, or a column holds words.
    pub fn push(&mut self, time_s: f64, row: &[f64]) {
        assert_eq!(row.len(), self.columns.len(), "one value for each column");
        self.time_s.push(time_s);
        for (column, &value) in self.columns.iter_mut().zip(row) {
            match &mut column.values {
                Values::Numbers(numbers) => numbers.push(value),
                Values::Words(_) => panic!("column {} holds words", column.name),
            }
        }
    }

    /// Keeps the first rows, at most this many.
    pub fn truncate(&mut self, rows: usize) {
        self.time_s.truncate(rows);
        for column in &mut self.columns {
            match &mut column.values {
                Values::Numbers(numbers) => numbers.truncate(rows),
                Values::Words(words) => words.truncate(rows),
            }
        }
    }

    /// Adds a column of numbers.
    ///
    /// # Panics
    /// If it has not one value for each time.
    pub fn add(&mut self, name: &str, values: Vec<f64>) {
        assert_eq!(values.len(), self.time_s.len(), "one value for each time");
        self.columns.push(Column { name: name.to_owned(), values: Values::Numbers(values) });
    }

    /// Adds a column of words.
    ///
    /// # Panics
    /// If it has not one value for each time.
    pub fn add_words(&mut self, name: &str, values: Vec<Word>) {
        assert_eq!(values.len(), self.time_s.len(), "one value for each time");
        self.columns.push(Column { name: name.to_owned(), values: Values::Words(values) });
    }

    /// The numbers of a column, if there is such a column and it holds numbers.
    pub fn get(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|column| column.name == name).and_then(|column| match &column.values {
            Values::Numbers(numbers) => Some(numbers.as_slice()),
            Values::Words(_) => None,
        })
    }

    /// The numbers of a column.
    ///
    /// # Errors
    /// There is no such column, or it holds words.
    pub fn require(&self, name: &str) -> Result<&[f64], TraceError> {
        let path = || self.path.clone().unwrap_or_default();
        match self.columns.iter().find(|column| column.name == name).map(|column| &column.values) {
            Some(Values::Numbers(numbers)) => Ok(numbers),
            Some(Values::Words(words)) => {
                let is_number = |word: &Word| word.is_empty() || word.parse::<f64>().is_ok();
                let first = words.iter().position(|word| !is_number(word)).unwrap_or(0);
                let text = words.get(first).cloned().unwrap_or_default().into_owned();
                Err(TraceError::NotNumbers { path: path(), column: name.to_owned(), row: first + 1, text })
            }
            None => Err(TraceError::MissingColumn {
                path: path(),
                wanted: name.to_owned(),
                present: self.columns.iter().map(|column| column.name.clone()).collect(),
            }),
        }
    }

    /// The same trace with only those columns that `keep` names.
    #[must_use]
    pub fn filtered(&self, keep: impl Fn(&str) -> bool) -> Self {
        Self { columns: self.columns.iter().filter(|column| keep(&column.name)).cloned().collect(), ..self.clone() }
    }

    /// Median time between two samples, s; 10 ms where there are fewer than two.
    pub fn median_step_s(&self) -> f64 {
        median_step_s(self.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect())
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }
}

/// Median of these times between two samples, s; 10 ms where there are none.
pub fn median_step_s(mut steps_s: Vec<f64>) -> f64 {
    steps_s.sort_by(f64::total_cmp);
    steps_s.get(steps_s.len() / 2).copied().unwrap_or(0.01)
}
