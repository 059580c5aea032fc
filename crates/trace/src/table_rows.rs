//! Tables in memory that are read row by row.

use std::fmt::Debug;
use std::ops::Range;

use crate::Cell;

/// A table in memory, of which a log reads one cell after the other where it stands.
pub trait TableRows: Debug + Send + Sync {
    /// Names of the columns, which end in their units.
    fn names(&self) -> Vec<&str>;

    /// How many rows there are.
    fn rows(&self) -> usize;

    /// The cell of a row and a column, both from 0 and less than their numbers: a number, which is not a number where there is none, or a word.
    fn cell(&self, row: usize, column: usize) -> Cell<'_>;

    /// Appends the cells of a column in some rows to `numbers`, if that is quicker than one by one; false where it has words, or is read by
    /// cells alone.
    fn numbers(&self, rows: Range<usize>, column: usize, numbers: &mut Vec<f64>) -> bool {
        let _ = (rows, column, numbers);
        false
    }
}
