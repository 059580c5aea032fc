//! Samples of a table with the names of the program: those that are no numbers count as missing.

use std::cell::Cell;

use trace::{CsvRows, TraceError, signal};

/// Refuses a table without an engine speed that has a column with a similar name: it is meant, and an estimate without it is another.
///
/// # Errors
/// It has such a column.
pub(crate) fn refuse_misnamed_engine(rows: &CsvRows) -> Result<(), TraceError> {
    let age = signal::age_of(signal::ENGINE_SPEED);
    let is_similar = |name: &str| name.starts_with("engine_speed") && Some(name) != age;
    let is_misnamed = rows.find(signal::ENGINE_SPEED).is_none() && rows.names().any(is_similar);
    if is_misnamed { rows.require(signal::ENGINE_SPEED).map(drop) } else { Ok(()) }
}

/// What came of the cells of each column.
pub(crate) struct RowSamples {
    columns: Vec<Counts>,
}

#[derive(Clone, Default)]
struct Counts {
    good: Cell<u64>,
    /// Text and infinite numbers.
    missing: Cell<u64>,
    /// Those of them with a sign between their thousands.
    grouped: Cell<u64>,
}

impl RowSamples {
    /// Of the columns of a table.
    pub(crate) fn new(rows: &CsvRows) -> Self {
        Self { columns: vec![Counts::default(); rows.names().count()] }
    }

    /// The number in a column of this row, in SI; not a number where the cell is empty, or holds text or an infinite number, which is counted.
    #[inline]
    pub(crate) fn number(&self, rows: &CsvRows, column: usize) -> f64 {
        let counts = &self.columns[column];
        match rows.number_or_none(column) {
            Some(number) if number.is_finite() => {
                counts.good.update(|count| count + 1);
                number
            }
            Some(number) if number.is_nan() => f64::NAN,
            _ => {
                counts.missing.update(|count| count + 1);
                counts.grouped.update(|count| count + u64::from(logs::csv_log::has_groups(&rows.text(column))));
                f64::NAN
            }
        }
    }

    /// What was met, in sentences.
    ///
    /// # Errors
    /// Most samples of a column are missing.
    pub(crate) fn notes(&self, rows: &CsvRows) -> Result<Vec<String>, TraceError> {
        let mut notes = Vec::new();
        for (name, counts) in rows.names().zip(&self.columns) {
            let (good, missing) = (counts.good.get(), counts.missing.get());
            if missing == 0 {
                continue;
            }
            let note =
                format!("{missing} of {} samples of {name} are text or infinite, and are not used", good + missing);
            if missing > good {
                let hint = match 2 * counts.grouped.get() > missing {
                    true => "write numbers without a sign between their thousands",
                    false => "check this column with `wetclutch inspect`; leave a lost sample empty",
                };
                return Err(rows.refused(format!("{note}\nhint: {hint}")));
            }
            notes.push(note);
        }
        Ok(notes)
    }
}
