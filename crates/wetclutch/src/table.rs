//! Tables in memory: columns of numbers and of words.

use std::collections::HashMap;
use std::io::Read as _;
use std::sync::Arc;

use trace::{Cell, ColumnKind, Unit, signal};

use crate::Error;
use crate::table_text::TableText;

/// Columns of the same length.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// The columns, the time first where there is one.
    pub columns: Vec<Column>,
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name, which ends in its unit.
    pub name: String,
    /// Its values.
    pub values: Values,
}

/// The values of a column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers; not a number where there is none.
    Numbers(Vec<f64>),
    /// Words, such as phases.
    Words(Words),
}

/// Words that repeat: each is stored once.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Words {
    /// Of each row, the place of its word in [`Self::words`].
    pub codes: Vec<u32>,
    /// The different words, in the order in which they came first.
    pub words: Vec<String>,
    places: HashMap<String, u32>,
}

impl Words {
    /// The word of a row.
    pub fn get(&self, row: usize) -> Option<&str> {
        let code = *self.codes.get(row)?;
        self.words.get(code as usize).map(String::as_str)
    }

    fn push(&mut self, word: &str) {
        // Mostly it is the word of the row before.
        if let Some(last) = self.codes.last().copied().filter(|last| self.words[*last as usize] == word) {
            return self.codes.push(last);
        }
        let code = match self.places.get(word) {
            Some(code) => *code,
            None => {
                let code = u32::try_from(self.words.len()).unwrap_or(u32::MAX);
                self.words.push(word.to_owned());
                self.places.insert(word.to_owned(), code);
                code
            }
        };
        self.codes.push(code);
    }

    fn repeat(&mut self) {
        match self.codes.last() {
            Some(last) => self.codes.push(*last),
            None => self.push(""),
        }
    }
}

impl<'a> FromIterator<&'a str> for Words {
    fn from_iter<I: IntoIterator<Item = &'a str>>(words: I) -> Self {
        let mut all = Self::default();
        words.into_iter().for_each(|word| all.push(word));
        all
    }
}

impl Column {
    /// The unit of its values by its name, such as `Pa`; `None` without one.
    pub fn unit(&self) -> Option<&'static str> {
        match self.values {
            Values::Numbers(_) => Unit::of_name(&self.name).map(|unit| unit.name),
            Values::Words(_) => None,
        }
    }
}

impl Table {
    /// An empty table with the time and these columns.
    pub(crate) fn with_columns<'a>(named: impl Iterator<Item = (&'a str, ColumnKind)>) -> Self {
        let column = |(name, kind): (&str, ColumnKind)| Column {
            name: name.to_owned(),
            values: match kind {
                ColumnKind::Word => Values::Words(Words::default()),
                ColumnKind::Number | ColumnKind::Whole => Values::Numbers(Vec::new()),
            },
        };
        Self { columns: std::iter::once((signal::TIME, ColumnKind::Number)).chain(named).map(column).collect() }
    }

    /// A table of rows of named cells, which all have the same names.
    pub(crate) fn of_rows<'a>(rows: impl IntoIterator<Item = Vec<(String, Cell<'a>)>>) -> Self {
        let mut table = Self::default();
        for row in rows {
            if table.columns.is_empty() {
                table.columns = row
                    .iter()
                    .map(|(name, cell)| Column {
                        name: name.clone(),
                        values: match cell {
                            Cell::Number(_) | Cell::Whole(_) => Values::Numbers(Vec::new()),
                            _ => Values::Words(Words::default()),
                        },
                    })
                    .collect();
            }
            table.columns.iter_mut().zip(row).for_each(|(column, (_, cell))| column.values.push(cell));
        }
        table
    }

    /// Appends a row.
    pub(crate) fn push<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) {
        let [time, columns @ ..] = self.columns.as_mut_slice() else { return };
        time.values.push(Cell::Number(time_s));
        let mut filled = 0;
        for (column, cell) in columns.iter_mut().zip(cells) {
            if matches!(cell, Cell::SameWords) {
                break;
            }
            column.values.push(cell);
            filled += 1;
        }
        columns[filled..].iter_mut().for_each(|column| column.values.push(Cell::SameWord));
    }

    /// Appends a row of numbers, and behind them the words of the row before.
    pub(crate) fn push_numbers(&mut self, time_s: f64, numbers: &[f64]) {
        self.push(time_s, numbers.iter().map(|number| Cell::Number(*number)).chain([Cell::SameWords]));
    }

    /// The table as CSV, in the form in which a command writes it.
    ///
    /// # Errors
    /// None in memory.
    pub fn csv(self) -> Result<Vec<u8>, Error> {
        let mut text = Vec::new();
        let read = TableText::new(Arc::new(self)).and_then(|mut table| table.read_to_end(&mut text));
        read.map_err(|error| Error::Work(error.to_string()))?;
        Ok(text)
    }

    /// How many rows it has.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// Whether it has no row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The numbers of a column of this name; `None` if there is none, or it has words.
    pub fn numbers(&self, name: &str) -> Option<&[f64]> {
        match &self.column(name)?.values {
            Values::Numbers(numbers) => Some(numbers),
            Values::Words(_) => None,
        }
    }

    /// The words of a column of this name; `None` if there is none, or it has numbers.
    pub fn words(&self, name: &str) -> Option<&Words> {
        match &self.column(name)?.values {
            Values::Words(words) => Some(words),
            Values::Numbers(_) => None,
        }
    }

    /// The column of this name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }
}

impl Values {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Words(words) => words.codes.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(crate) fn push(&mut self, cell: Cell<'_>) {
        match (self, cell) {
            (Self::Numbers(numbers), Cell::Number(number)) => numbers.push(number),
            (Self::Numbers(numbers), Cell::Whole(number)) => numbers.push(number as f64),
            (Self::Numbers(numbers), _) => numbers.push(f64::NAN),
            (Self::Words(words), Cell::Word(word)) => words.push(word),
            (Self::Words(words), Cell::SameWord | Cell::SameWords) => words.repeat(),
            (Self::Words(words), Cell::Number(_) | Cell::Whole(_)) => words.push(""),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_the_row_before_are_repeated() {
        let columns =
            [("turbine_speed_rad_s", ColumnKind::Number), ("phase", ColumnKind::Word), ("health", ColumnKind::Word)];
        let mut table = Table::with_columns(columns.into_iter());
        table.push(0.0, [Cell::Number(1.0), Cell::Word("fill"), Cell::Word("good")]);
        table.push(0.01, [Cell::Number(2.0), Cell::SameWords]);
        table.push(0.02, [Cell::Number(3.0), Cell::Word("torque phase"), Cell::SameWord]);
        table.push_numbers(0.03, &[4.0]);
        table.push(0.04, [Cell::Number(f64::NAN), Cell::Word("fill"), Cell::SameWord]);
        assert_eq!(table.len(), 5);
        assert_eq!(table.numbers("time_s"), Some([0.0, 0.01, 0.02, 0.03, 0.04].as_slice()));
        let phases = table.words("phase").unwrap();
        assert_eq!(
            (0..5).filter_map(|row| phases.get(row)).collect::<Vec<_>>(),
            ["fill", "fill", "torque phase", "torque phase", "fill"]
        );
        assert_eq!(phases.words.len(), 2);
        assert_eq!(table.words("health").unwrap().codes, [0; 5]);
        assert_eq!(table.column("turbine_speed_rad_s").and_then(Column::unit), Some("rad/s"));
        assert_eq!(table.column("phase").and_then(Column::unit), None);
    }
}
