//! Whether the rows of a table are in order of time.

use std::path::Path;

use crate::LogError;

/// Counts the rows of a table whose time is before that of the row before.
#[derive(Debug, Default)]
pub(crate) struct RowOrder {
    last_s: Option<f64>,
    rows: u64,
    falling: u64,
}

impl RowOrder {
    /// Takes the time of the next row, s.
    pub(crate) fn push(&mut self, time_s: f64) {
        self.rows += 1;
        self.falling += u64::from(self.last_s.replace(time_s).is_some_and(|last_s| time_s < last_s));
    }

    /// Refuses a table of which most rows are before the one before: of a clock that was reset, or of single rows in another place, few are.
    ///
    /// # Errors
    /// Its rows are not in order of time.
    pub(crate) fn check(&self, path: &Path) -> Result<(), LogError> {
        if 2 * self.falling <= self.rows {
            return Ok(());
        }
        Err(LogError::file(
            path,
            format!(
                "the rows are not in order of time: {} of {} have a time before that of the row before\nhint: sort them by the time",
                self.falling, self.rows
            ),
        ))
    }
}
