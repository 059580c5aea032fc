//! The time stamps of the rows of a table.

use logs::Clock;
use trace::{CsvRows, TraceError, signal};

/// Goes through the rows of a table by the rules of [`Clock`]: rows whose time is not after that of the row before are left out.
#[derive(Default)]
pub(crate) struct RowClock {
    clock: Clock,
    last_s: Option<f64>,
    rows: u64,
    repeated: u64,
    backward: u64,
}

/// The time of a row.
pub(crate) struct RowTime {
    /// Time, s.
    pub(crate) time_s: f64,
    /// Time since the row before, s; zero for the first.
    pub(crate) dt_s: f64,
}

impl RowClock {
    /// Goes on to the next row that counts; `None` at the end.
    #[inline]
    pub(crate) fn advance(&mut self, rows: &mut CsvRows) -> Result<Option<RowTime>, TraceError> {
        while rows.advance_in_any_order()? {
            self.rows += 1;
            let wrong_jumps = self.clock.wrong_jumps();
            let time_s = self.clock.time(rows.time_s());
            if self.clock.wrong_jumps() > wrong_jumps {
                // The row before was the one with the wrong time.
                self.last_s = None;
            }
            match time_s {
                Some(time_s) if self.last_s.is_none_or(|last_s| time_s > last_s) => {
                    let dt_s = self.last_s.replace(time_s).map_or(0.0, |last_s| time_s - last_s);
                    return Ok(Some(RowTime { time_s, dt_s }));
                }
                Some(time_s) if self.last_s == Some(time_s) => self.repeated += 1,
                _ => self.backward += 1,
            }
        }
        Ok(None)
    }

    /// How often the clock did not simply go on: resets, and stamps that were far too late.
    pub(crate) fn resets(&self) -> u32 {
        self.clock.resets() + self.clock.wrong_jumps()
    }

    /// What was met, in sentences.
    ///
    /// # Errors
    /// Most rows could not be used.
    pub(crate) fn notes(&self, rows: &CsvRows) -> Result<Vec<String>, TraceError> {
        let unused = self.repeated + self.backward;
        let count = |count: u64, what: &str| {
            (count > 0).then(|| format!("{count} of {} rows {what} and are not used", self.rows))
        };
        let notes = [
            count(self.repeated, "have the time of the row before"),
            count(self.backward, "have a time before that of the row before"),
        ];
        let notes: Vec<String> = notes.into_iter().flatten().collect();
        if 2 * unused > self.rows {
            let hint = if self.backward > self.repeated {
                "the rows are not in order of time: sort them by it".to_owned()
            } else {
                format!("the time has too few digits, or is not in `{}`", signal::TIME)
            };
            return Err(rows.refused(format!("{}\nhint: {hint}", notes.join(", "))));
        }
        Ok(notes.into_iter().chain(self.clock.notes()).chain(rows.cut().map(str::to_owned)).collect())
    }
}
