//! Rows of an estimate as they come, for those who look at them.

use std::fmt::Debug;

use trace::Cell;

/// Takes the rows of an estimate as they come: all columns, also those of the speeds, the engine torque and the commands that were measured.
pub trait LiveRows: Sync + Debug {
    /// The names of the columns but for the time, before the first row.
    fn begin(&self, names: &[&str]);

    /// A row: its time, s, and a cell for each column.
    fn row(&self, time_s: f64, cells: &[LiveCell]);
}

/// A cell of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum LiveCell {
    /// A number; NaN where there is none.
    Number(f64),
    /// A word; empty where there is none.
    Word(String),
}

impl LiveCell {
    /// Takes the value of a cell of a table, unless it is that of the row before.
    pub(super) fn set(&mut self, cell: Cell<'_>) {
        match cell {
            Cell::Number(number) => *self = Self::Number(number),
            Cell::Whole(number) => *self = Self::Number(number as f64),
            Cell::Word(word) => match self {
                Self::Word(before) if before == word => {}
                _ => *self = Self::Word(word.to_owned()),
            },
            Cell::SameWord | Cell::SameWords => {}
        }
    }
}
