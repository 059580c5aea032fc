//! Tables in memory that are written row by row.

use trace::{Cell, ColumnKind, signal};

use crate::{Column, Table, Values, Words};

/// Rows whose numbers are moved into their columns at once: a table has so many columns that to write into all of them for each row takes longer.
const BLOCK: usize = 64;

/// Writes a table row by row into memory.
pub(crate) struct MemoryWriter {
    table: Table,
    /// Whether each column has words.
    is_words: Vec<bool>,
    /// How many columns have numbers: the time at least.
    width: usize,
    /// How often the last word of each column is to be repeated.
    repeats: Vec<usize>,
    /// How often the last words of all columns are to be repeated as well: the rows with numbers alone since the last row with words.
    all_repeats: usize,
    /// The numbers of the rows that are not in their columns yet, row after row.
    block: Vec<f64>,
}

impl MemoryWriter {
    /// Begins a table with the time and these columns.
    pub(crate) fn new<'a>(named: impl Iterator<Item = (&'a str, ColumnKind)>) -> Self {
        let column = |(name, kind): (&str, ColumnKind)| Column {
            name: name.to_owned(),
            values: match kind {
                ColumnKind::Word => Values::Words(Words::default()),
                ColumnKind::Number | ColumnKind::Whole => Values::Numbers(Vec::new()),
            },
        };
        let columns: Vec<Column> =
            std::iter::once((signal::TIME, ColumnKind::Number)).chain(named).map(column).collect();
        let is_words: Vec<bool> = columns.iter().map(|column| matches!(column.values, Values::Words(_))).collect();
        let width = is_words.iter().filter(|is_words| !**is_words).count();
        let repeats = vec![0; is_words.len()];
        Self { table: Table { columns }, repeats, all_repeats: 0, is_words, width, block: Vec::new() }
    }

    /// Makes room for rows that are known to come.
    pub(crate) fn reserve(&mut self, rows: usize) {
        self.table.columns.iter_mut().for_each(|column| match &mut column.values {
            Values::Numbers(numbers) => numbers.reserve_exact(rows),
            Values::Words(words) => words.codes.reserve(rows),
        });
    }

    /// Writes a row with the numbers of all columns that have numbers, in their order, and the words of the row before.
    pub(crate) fn numbers(&mut self, time_s: f64, numbers: impl IntoIterator<Item = f64>) {
        let begin = self.block.len();
        self.block.resize(begin + self.width, f64::NAN);
        let cells = std::iter::once(time_s).chain(numbers);
        self.block[begin..].iter_mut().zip(cells).for_each(|(cell, number)| *cell = number);
        self.all_repeats += 1;
        self.move_whole_block();
    }

    /// Writes a row.
    pub(crate) fn push<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) {
        self.repeat_all();
        self.block.push(time_s);
        let mut at = 1;
        cells.into_iter().take_while(|cell| !matches!(cell, Cell::SameWords)).for_each(|cell| {
            match (self.is_words.get(at), cell) {
                (Some(false), Cell::Number(number)) => self.block.push(number),
                (Some(false), Cell::Whole(number)) => self.block.push(number as f64),
                (Some(false), _) => self.block.push(f64::NAN),
                (Some(true), Cell::Word(word)) => self.word(at, word),
                (Some(true), Cell::SameWord) => self.repeats[at] += 1,
                (Some(true), _) => self.word(at, ""),
                (None, _) => {}
            }
            at += 1;
        });
        for (is_words, repeats) in self.is_words.iter().zip(&mut self.repeats).skip(at) {
            match is_words {
                true => *repeats += 1,
                false => self.block.push(f64::NAN),
            }
        }
        self.move_whole_block();
    }

    /// The table.
    pub(crate) fn finish(mut self) -> Table {
        self.move_block();
        self.repeat_all();
        (0..self.repeats.len()).for_each(|column| self.repeat(column));
        self.table
    }

    fn word(&mut self, column: usize, word: &str) {
        self.repeat(column);
        if let Values::Words(words) = &mut self.table.columns[column].values {
            words.push(word);
        }
    }

    /// Repeats the last word of a column as often as it was not yet.
    fn repeat(&mut self, column: usize) {
        let times = std::mem::take(&mut self.repeats[column]);
        if let Values::Words(words) = &mut self.table.columns[column].values {
            words.repeat(times);
        }
    }

    /// Counts for each column the rows whose words are all those before.
    fn repeat_all(&mut self) {
        let times = std::mem::take(&mut self.all_repeats);
        if times > 0 {
            self.repeats.iter_mut().for_each(|repeats| *repeats += times);
        }
    }

    fn move_whole_block(&mut self) {
        if self.block.len() >= BLOCK * self.width {
            self.move_block();
        }
    }

    fn move_block(&mut self) {
        let numbers = self.table.columns.iter_mut().filter_map(|column| match &mut column.values {
            Values::Numbers(numbers) => Some(numbers),
            Values::Words(_) => None,
        });
        for (at, numbers) in numbers.enumerate() {
            numbers.extend(self.block.chunks_exact(self.width).map(|row| row[at]));
        }
        self.block.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn writer() -> MemoryWriter {
        let columns =
            [("turbine_speed_rad_s", ColumnKind::Number), ("phase", ColumnKind::Word), ("health", ColumnKind::Word)];
        MemoryWriter::new(columns.into_iter())
    }

    #[test]
    fn words_of_the_row_before_are_repeated() {
        let mut writer = writer();
        writer.push(0.0, [Cell::Number(1.0), Cell::Word("fill"), Cell::Word("good")]);
        writer.push(0.01, [Cell::Number(2.0), Cell::SameWords]);
        writer.push(0.02, [Cell::Number(3.0), Cell::Word("torque phase"), Cell::SameWord]);
        writer.push(0.03, [Cell::Number(4.0), Cell::SameWords]);
        writer.push(0.04, [Cell::Number(f64::NAN), Cell::Word("fill"), Cell::SameWord]);
        let table = writer.finish();
        assert_eq!(table.len(), 5);
        assert_eq!(table.numbers("time_s"), Some([0.0, 0.01, 0.02, 0.03, 0.04].as_slice()));
        let phases = table.words("phase").unwrap();
        assert_eq!(
            (0..5).filter_map(|row| phases.get(row)).collect::<Vec<_>>(),
            ["fill", "fill", "torque phase", "torque phase", "fill"]
        );
        assert_eq!(phases.words.len(), 2);
        assert_eq!(table.words("health").unwrap().words, ["good"]);
        assert_eq!(table.column("turbine_speed_rad_s").and_then(Column::unit), Some("rad/s"));
        assert_eq!(table.column("phase").and_then(Column::unit), None);
    }

    #[test]
    fn a_row_of_numbers_has_the_words_of_the_row_before() {
        let columns = [("phase", ColumnKind::Word), ("a_pa", ColumnKind::Number), ("b_pa", ColumnKind::Number)];
        for rows in [1, BLOCK, 3 * BLOCK + 1] {
            let [mut writer, mut expected] = [(); 2].map(|()| MemoryWriter::new(columns.into_iter()));
            for row in 0..rows {
                let value = row as f64;
                let is_new = row % 5 == 0;
                let word = if is_new { Cell::Word(["fill", "torque phase"][row / 5 % 2]) } else { Cell::SameWord };
                expected.push(value, [word, Cell::Number(-value), Cell::Number(2.0 * value)]);
                if is_new {
                    writer.push(value, [word, Cell::Number(-value), Cell::Number(2.0 * value)]);
                } else {
                    writer.numbers(value, [-value, 2.0 * value]);
                }
            }
            assert_eq!(writer.finish(), expected.finish(), "{rows}");
        }
        // A missing number is empty.
        let mut writer = MemoryWriter::new(columns.into_iter());
        writer.numbers(0.0, [1.0]);
        let table = writer.finish();
        assert_eq!(table.numbers("a_pa"), Some([1.0].as_slice()));
        assert!(table.numbers("b_pa").unwrap()[0].is_nan() && table.words("phase").unwrap().codes.len() == 1);
    }

    #[test]
    fn rows_of_any_number_have_their_cells() {
        for rows in [0, 1, BLOCK - 1, BLOCK, BLOCK + 1, 5 * BLOCK] {
            let mut writer = writer();
            writer.reserve(rows);
            for row in 0..rows {
                let cells =
                    [Cell::Number(-(row as f64)), Cell::Word(if row % 3 == 0 { "a" } else { "b" }), Cell::SameWord];
                writer.push(row as f64, cells);
            }
            let table = writer.finish();
            assert!(table.columns.iter().all(|column| column.values.len() == rows), "{rows}");
            assert!((0..rows).all(|row| table.numbers("turbine_speed_rad_s").unwrap()[row] == -(row as f64)));
            assert_eq!(table.words("phase").unwrap().get(rows.saturating_sub(1)).is_some(), rows > 0);
        }
    }

    #[test]
    fn cells_of_another_kind_and_missing_ones_are_empty() {
        let mut writer = writer();
        writer.push(0.0, [Cell::Word("x"), Cell::Number(1.0), Cell::SameWord, Cell::Number(2.0)]);
        writer.push(1.0, [Cell::Whole(3)]);
        let table = writer.finish();
        let speeds = table.numbers("turbine_speed_rad_s").unwrap();
        assert!(speeds[0].is_nan() && speeds[1] == 3.0);
        assert_eq!(table.words("phase").unwrap().words, [""]);
        assert_eq!(table.words("health").unwrap().codes.len(), 2);
    }
}
