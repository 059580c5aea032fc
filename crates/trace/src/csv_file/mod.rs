//! Comma-separated files: one row of names with units, then one row for each time.
//!
//! They are read and written row by row, so that a file of any length needs the memory of one row.

mod decimal;
mod records;
mod rows;
mod source;
#[cfg(test)]
mod tests;
mod writer;

use std::io;
use std::path::Path;

pub use records::{LONGEST_ROW, RecordError, Records};
pub use rows::{CsvRows, number};
pub use writer::{Cell, CsvWriter};

use crate::units::Scale;
use crate::{Column, Trace, TraceError, Values, WholeFile, Word};

/// Reads a whole comma-separated file, see [`CsvRows`]; a column with other text than numbers holds words.
///
/// # Errors
/// See [`CsvRows`].
pub fn read_csv(path: &Path) -> Result<Trace, TraceError> {
    let mut rows = CsvRows::open(path)?;
    let named = |&i: &usize| i != rows.time_at && !rows.columns[i].0.is_empty();
    let places: Vec<usize> = (0..rows.columns.len()).filter(named).collect();
    let mut cells: Vec<Cells> = places.iter().map(|_| Cells::default()).collect();
    let mut time_s = Vec::new();
    while rows.advance()? {
        time_s.push(rows.time_s());
        for (cells, &place) in cells.iter_mut().zip(&places) {
            cells.push(&rows.text(place));
        }
    }
    let column = |(&place, cells): (&usize, Cells)| {
        let (name, scale) = &rows.columns[place];
        Column { name: name.clone(), values: cells.into_values(*scale) }
    };
    Ok(Trace { path: Some(path.to_owned()), time_s, columns: places.iter().zip(cells).map(column).collect() })
}

/// Writes a trace as a comma-separated file, whole or not at all, see [`CsvWriter`].
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(path: &Path, trace: &Trace) -> io::Result<()> {
    csv_written(path, trace)?.finish()
}

/// The same in a file that still has to get its name.
///
/// # Errors
/// The file cannot be written.
pub fn csv_written(path: &Path, trace: &Trace) -> io::Result<WholeFile> {
    let names = trace.columns.iter().map(|column| column.name.as_str());
    let mut writer = CsvWriter::new(WholeFile::create(path)?, names)?;
    for (i, &time_s) in trace.time_s.iter().enumerate() {
        let cells = trace.columns.iter().map(|column| match &column.values {
            Values::Numbers(numbers) => Cell::Number(numbers[i]),
            Values::Words(words) => Cell::Word(&words[i]),
        });
        writer.row(time_s, cells)?;
    }
    writer.finish()
}

/// Cells of one column while it is read: numbers as long as every cell is one.
#[derive(Default)]
struct Cells {
    numbers: Vec<f64>,
    words: Option<Vec<String>>,
}

impl Cells {
    fn push(&mut self, text: &str) {
        if let Some(words) = &mut self.words {
            words.push(text.to_owned());
            return;
        }
        match text.parse() {
            _ if text.is_empty() => self.numbers.push(f64::NAN),
            Ok(number) => self.numbers.push(number),
            Err(_) => {
                let blank = |number: &f64| if number.is_nan() { String::new() } else { number.to_string() };
                let mut words: Vec<String> = self.numbers.iter().map(blank).collect();
                words.push(text.to_owned());
                self.words = Some(words);
            }
        }
    }

    fn into_values(self, scale: Scale) -> Values {
        match self.words {
            Some(words) => Values::Words(words.into_iter().map(Word::from).collect()),
            None => Values::Numbers(self.numbers.into_iter().map(|number| scale.of_value(number)).collect()),
        }
    }
}
