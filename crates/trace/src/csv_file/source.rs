//! Where the rows of a log come from: a text, or a table in memory.

use std::borrow::Cow;
use std::cell;
use std::sync::Arc;

use super::records::{RecordError, Records};
use super::rows::number;
use super::writer::{ROOM, put_number};
use crate::{Cell, TableRows};

/// The rows of a log, one at a time.
pub(super) enum Source {
    Text(Box<Records>),
    Table(TableSource),
}

/// Rows of a table whose numbers are fetched at once \[chosen\].
const BLOCK: usize = 256;

/// A table in memory, and how many of its rows were passed.
pub(super) struct TableSource {
    table: Arc<dyn TableRows>,
    rows: usize,
    columns: Vec<Fetched>,
    /// The first row of which numbers are fetched.
    begin: usize,
    passed: usize,
}

/// The numbers of a column in the block of rows that is read; none of a column that was not read yet, or has words.
#[derive(Default)]
struct Fetched {
    is_read: cell::Cell<bool>,
    numbers: Vec<f64>,
}

impl TableSource {
    pub(super) fn new(table: Arc<dyn TableRows>) -> Self {
        let columns = table.names().iter().map(|_| Fetched::default()).collect();
        Self { columns, rows: table.rows(), table, begin: 0, passed: 0 }
    }

    /// Goes on to the next row; false where there is none.
    fn advance(&mut self) -> bool {
        if self.passed >= self.rows {
            return false;
        }
        if self.passed - self.begin == BLOCK {
            self.begin = self.passed;
            for (place, column) in self.columns.iter_mut().enumerate().filter(|(_, column)| column.is_read.get()) {
                column.numbers.clear();
                self.table.numbers(self.begin..self.rows.min(self.begin + BLOCK), place, &mut column.numbers);
            }
        }
        self.passed += 1;
        true
    }

    /// What stands in a column of the row; nothing before the first row.
    fn cell(&self, column: usize) -> Cell<'_> {
        match self.passed.checked_sub(1) {
            Some(row) if column < self.columns.len() => self.table.cell(row, column),
            _ => Cell::Word(""),
        }
    }

    /// The number in a column of the row, see [`Source::number`].
    #[inline]
    fn number(&self, column: usize) -> Option<f64> {
        if let Some(fetched) = self.columns.get(column) {
            if let Some(number) = fetched.numbers.get((self.passed - self.begin).wrapping_sub(1)) {
                return Some(*number);
            }
            fetched.is_read.set(true);
        }
        match self.cell(column) {
            Cell::Number(number) => Some(number),
            Cell::Whole(whole) => Some(whole as f64),
            Cell::Word(word) => number(word.as_bytes()),
            Cell::SameWord | Cell::SameWords => None,
        }
    }
}

impl Source {
    /// The names of the columns, from which a text begins; none if it is empty.
    pub(super) fn names(&mut self) -> Result<Vec<String>, RecordError> {
        let name = |name: Cow<'_, str>| name.trim().to_owned();
        Ok(match self {
            Self::Text(records) => match records.advance()? {
                true => records.cells().map(|cell| name(String::from_utf8_lossy(cell))).collect(),
                false => Vec::new(),
            },
            Self::Table(source) => source.table.names().into_iter().map(|of| name(Cow::Borrowed(of))).collect(),
        })
    }

    /// Goes on to the next row; false where there is none.
    pub(super) fn advance(&mut self) -> Result<bool, RecordError> {
        match self {
            Self::Text(records) => records.advance(),
            Self::Table(source) => Ok(source.advance()),
        }
    }

    /// Cells of the row.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Text(records) => records.len(),
            Self::Table(source) => source.columns.len(),
        }
    }

    /// The line of the row in its text, from 1; that which a row of a table would have, with the names in the first line.
    pub(super) fn line(&self) -> u64 {
        match self {
            Self::Text(records) => records.line(),
            Self::Table(source) => 1 + source.passed as u64,
        }
    }

    /// The text whose end may have cut the row; none where it did not.
    pub(super) fn cut(&mut self) -> Option<&mut Records> {
        match self {
            Self::Text(records) if records.has_no_end() => Some(records),
            _ => None,
        }
    }

    /// The number in a column of the row: not a number where the cell is empty, none where it holds something else.
    #[inline]
    pub(super) fn number(&self, column: usize) -> Option<f64> {
        match self {
            Self::Text(records) => number(records.cell(column).unwrap_or_default()),
            Self::Table(source) => source.number(column),
        }
    }

    /// The text in a column of the row; of a number that which is written of it.
    pub(super) fn text(&self, column: usize) -> Cow<'_, str> {
        match self {
            Self::Text(records) => String::from_utf8_lossy(records.cell(column).unwrap_or_default().trim_ascii()),
            Self::Table(source) => match source.cell(column) {
                Cell::Number(number) => Cow::Owned(written(number)),
                Cell::Whole(whole) => Cow::Owned(whole.to_string()),
                Cell::Word(word) => Cow::Borrowed(word.trim_ascii()),
                Cell::SameWord | Cell::SameWords => Cow::Borrowed(""),
            },
        }
    }
}

/// A number as a table in a file has it.
fn written(number: f64) -> String {
    // Without room a number makes as much as a file needs.
    let mut text = vec![0; 2 * ROOM];
    let end = put_number(&mut text, 0, number);
    text.truncate(end);
    String::from_utf8(text).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::io;
    use std::ops::Range;
    use std::path::Path;

    use super::super::{CsvRows, CsvWriter};
    use super::*;

    /// Two columns of numbers and one of words.
    #[derive(Debug)]
    struct Known(Vec<(f64, f64, &'static str)>);

    impl TableRows for Known {
        fn names(&self) -> Vec<&str> {
            vec!["time_ms", " engine_speed_rpm", "gear"]
        }

        fn rows(&self) -> usize {
            self.0.len()
        }

        fn cell(&self, row: usize, column: usize) -> Cell<'_> {
            let (time_ms, speed_rpm, gear) = self.0[row];
            [Cell::Number(time_ms), Cell::Number(speed_rpm), Cell::Word(gear)][column]
        }
    }

    /// All that is read of each row, or the error of the first that cannot be read.
    fn read(mut rows: CsvRows) -> Result<Vec<String>, String> {
        let mut all = vec![format!("{:?}", rows.names().collect::<Vec<_>>())];
        while rows.advance().map_err(|error| error.to_string())? {
            let number = |at: usize| rows.number(at).map(f64::to_bits).map_err(|error| error.to_string());
            let cells = (0..3).map(|at| (rows.number_or_none(at).map(f64::to_bits), number(at), rows.text(at)));
            all.push(format!("{} {:?}", rows.time_s(), cells.collect::<Vec<_>>()));
        }
        Ok(all)
    }

    /// The same with numbers that are fetched at once.
    #[derive(Debug)]
    struct InBlocks(Known);

    impl TableRows for InBlocks {
        fn names(&self) -> Vec<&str> {
            self.0.names()
        }

        fn rows(&self) -> usize {
            self.0.rows()
        }

        fn cell(&self, row: usize, column: usize) -> Cell<'_> {
            self.0.cell(row, column)
        }

        fn numbers(&self, rows: Range<usize>, column: usize, numbers: &mut Vec<f64>) -> bool {
            let cells = rows.map(|row| self.0.cell(row, column));
            numbers.extend(cells.filter_map(|cell| if let Cell::Number(number) = cell { Some(number) } else { None }));
            column < 2
        }
    }

    #[test]
    fn numbers_that_are_fetched_at_once_are_those_of_each_row() {
        for count in [1, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 7] {
            let known = || Known((0..count).map(|row| (row as f64, (0.1 * row as f64).sin(), "1")).collect());
            let [mut one_by_one, mut at_once] = [Arc::new(known()) as Arc<dyn TableRows>, Arc::new(InBlocks(known()))]
                .map(|table| CsvRows::of_table(Path::new("log"), table).unwrap());
            for row in 0..count {
                assert!(one_by_one.advance().unwrap() && at_once.advance().unwrap());
                // The speed is read from the middle of a block on.
                for column in [0, 1, 2].into_iter().filter(|column| *column != 1 || row > BLOCK + 40) {
                    let numbers = [&one_by_one, &at_once].map(|rows| rows.number_or_none(column).map(f64::to_bits));
                    assert_eq!(numbers[0], numbers[1], "{row} {column}");
                }
            }
            assert!(!one_by_one.advance().unwrap() && !at_once.advance().unwrap());
        }
    }

    #[test]
    fn a_table_in_memory_is_read_as_its_text() {
        let good = vec![
            (0.0, 1.0 / 3.0, "1"),
            (10.0, f64::NAN, " 1.50 "),
            (20.0, f64::INFINITY, ""),
            (1e6 / 3.0, -0.0, "N"),
            (1e9, 1e-300, "\u{f6}, \"x\""),
        ];
        let late = vec![(0.0, 1.0, ""), (10.0, 1.0, ""), (10.0, 2.0, "")];
        let without_time = [f64::NAN, f64::INFINITY].map(|time_ms| vec![(0.0, 1.0, "1"), (time_ms, 1.0, "1")]);
        for rows in [good, late, vec![]].into_iter().chain(without_time) {
            let table = Arc::new(Known(rows));
            let mut writer = CsvWriter::without_time(Vec::new(), table.names()).unwrap();
            for row in 0..table.rows() {
                writer.cells((0..3).map(|column| table.cell(row, column))).unwrap();
            }
            let text = io::Cursor::new(writer.finish().unwrap());
            let of_text = read(CsvRows::of_log(Path::new("log"), Box::new(text)).unwrap());
            assert_eq!(read(CsvRows::of_table(Path::new("log"), table).unwrap()), of_text);
        }
    }
}
