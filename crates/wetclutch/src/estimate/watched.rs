//! The values of a table's columns while it is read: wrong units, signs and columns are refused.

use logs::plausibility::{Extremes, Finding, Likely, Seen, findings};
use logs::{QualityCounts, Role, RoleSummary};

use crate::{Error, grouped};

/// Later rows of which one is looked at.
const EVERY: u64 = 32;

/// Whether a row, from 1, is looked at whether it can be right: all of the first, and later one of [`EVERY`].
pub(crate) fn is_looked_at(row: u64, first: usize) -> bool {
    row <= first as u64 || row.is_multiple_of(EVERY)
}

/// Endings of column names that say a unit.
const ENDINGS: [(&str, &str); 5] = [("rpm", "rpm"), ("rad/s", "rad_s"), ("mA", "ma"), ("A", "a"), ("%", "percent")];

/// A column that is watched.
pub(crate) struct WatchedColumn {
    /// What it is.
    pub(crate) role: Role,
    /// Its name without a unit.
    pub(crate) name: String,
    /// Whether its name says the SI unit.
    pub(crate) is_in_si: bool,
    /// Whether an estimate without a value of it is refused here.
    pub(crate) is_needed: bool,
}

/// The columns of a table that are watched.
pub(crate) struct WatchedColumns {
    /// Rows at the beginning of which all are looked at.
    first: usize,
    rows: u64,
    summaries: Vec<RoleSummary>,
    /// Whether each is needed, how many values it has, and the row of the last one.
    needs: Vec<(bool, u64, u64)>,
}

impl WatchedColumns {
    /// Looks at all of the `first` rows, and later at one of [`EVERY`].
    pub(crate) fn new(first: usize, columns: impl IntoIterator<Item = WatchedColumn>) -> Self {
        let (mut summaries, mut needs) = (Vec::new(), Vec::new());
        for WatchedColumn { role, name, is_in_si, is_needed } in columns {
            let unit_name = match role {
                _ if is_in_si => role.unit(),
                Role::OncomingCurrent | Role::ElementCurrent => "mA",
                Role::ElementPressureCommand | Role::ElementPressure => "the unit of its name",
                _ => "rpm",
            };
            let (counts, extremes) = (QualityCounts::default(), Extremes::default());
            summaries.push(RoleSummary { role, name, counts, extremes, unit_name: unit_name.to_owned(), until: 1.0 });
            needs.push((is_needed, 0, 0));
        }
        Self { first, rows: 0, summaries, needs }
    }

    /// Takes a row; the values are those of the columns, in their order.
    pub(crate) fn push(&mut self, values: impl IntoIterator<Item = Option<f64>>) {
        self.rows += 1;
        let is_looked_at = is_looked_at(self.rows, self.first);
        for ((entry, (_, count, last)), value) in self.summaries.iter_mut().zip(&mut self.needs).zip(values) {
            if let Some(value) = value.filter(|value| value.is_finite()) {
                *count += 1;
                *last = self.rows;
                if is_looked_at {
                    entry.extremes.push(value);
                }
            }
        }
    }

    /// Rows so far.
    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    /// Refuses a table in which a column that is needed has no value, or whose values cannot be right.
    pub(crate) fn check(&self, seen: Seen) -> Result<(), Error> {
        let mut with_needs = self.summaries.iter().zip(&self.needs);
        if let Some((entry, _)) =
            with_needs.find(|(_, (is_needed, count, _))| *is_needed && *count == 0).filter(|_| self.rows > 0)
        {
            return Err(Error::Input(format!(
                "{} has no value in any of {} rows\nhint: an estimate of this car needs it; check the log with `wetclutch inspect`",
                entry.name,
                grouped(self.rows)
            )));
        }
        let until = |(_, _, last): &(bool, u64, u64)| *last as f64 / self.rows as f64;
        let with_needs = self.summaries.iter().zip(&self.needs);
        let summaries: Vec<_> =
            with_needs.map(|(entry, need)| RoleSummary { until: until(need), ..entry.clone() }).collect();
        let Some(Finding { name, message, likely, .. }) = findings(&summaries, seen).into_iter().next() else {
            return Ok(());
        };
        let hint = match likely {
            Likely::Unit(unit) => match ENDINGS.iter().find(|(name, _)| *name == unit) {
                Some((_, ending)) => format!("the end of the column's name gives the unit: call it `{name}_{ending}`"),
                None => "give the unit and the scale in a channel map, see `wetclutch inspect --suggest`".to_owned(),
            },
            Likely::OtherChannel => "its column may have another signal, or its sensor has failed".to_owned(),
            Likely::OtherSign => {
                format!(
                    "`wetclutch inspect --suggest` writes a channel map; add `scale = -1` below `[channel.{name}]` in it"
                )
            }
        };
        Err(Error::Input(format!("{message}\nhint: {hint}")))
    }
}
