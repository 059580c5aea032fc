//! Tables in memory: columns of numbers and of words.

use std::io::Read as _;
use std::ops::Range;
use std::sync::Arc;

use trace::{Cell, TableRows, Unit};

use crate::table_text::TableText;
use crate::{Error, Words};

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

/// Units of what no log has, by the ending of a name.
const DERIVED: [(&str, &str); 8] = [
    ("_m_s3", "m/s^3"),
    ("_m_s1_75", "m/s^1.75"),
    ("_n_m_rad", "N m/rad"),
    ("_kg_m2", "kg m^2"),
    ("_kg", "kg"),
    ("_rad", "rad"),
    ("_j", "J"),
    ("_m", "m"),
];

impl Column {
    /// The unit of its values by its name, such as `Pa`; `None` without one.
    pub fn unit(&self) -> Option<&'static str> {
        match self.values {
            Values::Numbers(_) => {
                let derived = || DERIVED.iter().find(|(ending, _)| self.name.ends_with(ending)).map(|(_, unit)| *unit);
                Unit::of_name(&self.name).map(|unit| unit.name).or_else(derived)
            }
            Values::Words(_) => None,
        }
    }
}

impl Table {
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

impl TableRows for Table {
    fn names(&self) -> Vec<&str> {
        self.columns.iter().map(|column| column.name.as_str()).collect()
    }

    fn rows(&self) -> usize {
        self.len()
    }

    fn cell(&self, row: usize, column: usize) -> Cell<'_> {
        match &self.columns[column].values {
            Values::Numbers(numbers) => Cell::Number(numbers.get(row).copied().unwrap_or(f64::NAN)),
            Values::Words(words) => Cell::Word(words.get(row).unwrap_or_default()),
        }
    }

    fn numbers(&self, rows: Range<usize>, column: usize, numbers: &mut Vec<f64>) -> bool {
        let Values::Numbers(all) = &self.columns[column].values else { return false };
        all.get(rows).inspect(|some| numbers.extend_from_slice(some)).is_some()
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
            (Self::Words(words), Cell::SameWord | Cell::SameWords) => words.repeat(1),
            (Self::Words(words), Cell::Number(_) | Cell::Whole(_)) => words.push(""),
        }
    }
}
