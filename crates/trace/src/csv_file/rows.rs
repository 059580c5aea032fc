//! Comma-separated files and tables in memory, read row by row.

use std::borrow::Cow;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::decimal;
use super::records::{LONGEST_ROW, RecordError, Records};
use super::source::{Source, TableSource};
use crate::error::TIME_BY_MAP;
use crate::units::Scale;
use crate::{TableRows, TraceError, signal, text, units};

/// A comma-separated file, or a table in memory, that is read row by row. The first row of a file names the columns; `time_s` (or `time_ms`) must be among
/// them and rise. An empty cell, or `nan`, is a reading that did not come, and becomes NaN. A column without a name is passed over.
pub struct CsvRows {
    path: PathBuf,
    source: Source,
    /// Name in SI, and the factor that brings the cells there.
    pub(super) columns: Vec<(String, Scale)>,
    pub(super) time_at: usize,
    time_s: Option<f64>,
    /// Whether a last line without an end may have been cut, and what became of it.
    may_be_cut: bool,
    cut: Option<&'static str>,
}

impl CsvRows {
    /// Opens a file and reads the names of its columns.
    ///
    /// # Errors
    /// The file cannot be read, has no time, or two columns of the same signal.
    pub fn open(path: &Path) -> Result<Self, TraceError> {
        let file = File::open(path).map_err(|source| TraceError::Io { path: path.to_owned(), source })?;
        Self::of(path, Box::new(file))
    }

    /// A log from anywhere, which may end within a line; `path` is for messages. Nothing else shows that a number was cut: of a last line
    /// without an end the last cell is empty, and without all cells, or without its time, the line is left out.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn of_log(path: &Path, input: Box<dyn Read + Send>) -> Result<Self, TraceError> {
        Ok(Self { may_be_cut: true, ..Self::of(path, input)? })
    }

    /// A table in memory, whose numbers are read where they stand; `path` is what messages call it.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn of_table(path: &Path, table: Arc<dyn TableRows>) -> Result<Self, TraceError> {
        Self::from_source(path, Source::Table(TableSource::new(table)))
    }

    fn of(path: &Path, input: Box<dyn Read + Send>) -> Result<Self, TraceError> {
        let input = text::as_utf8(input).map_err(|source| TraceError::Io { path: path.to_owned(), source })?;
        Self::from_source(path, Source::Text(Box::new(Records::new(input, b','))))
    }

    fn from_source(path: &Path, source: Source) -> Result<Self, TraceError> {
        let (path, columns) = (path.to_owned(), Vec::new());
        let mut rows = Self { path, source, columns, time_at: 0, time_s: None, may_be_cut: false, cut: None };
        let names = rows.source.names().map_err(|error| rows.unread(error))?;
        if names.is_empty() {
            return Err(TraceError::Table { path: rows.path, message: "the file is empty".to_owned() });
        }
        let in_si = |(name, size): (String, f64)| (name, Scale::of(size));
        rows.columns = names.iter().map(|name| in_si(units::to_si(name))).collect();
        rows.refuse_twins(&names)?;
        rows.time_at = rows.require(signal::TIME)?;
        Ok(rows)
    }

    /// Reads a wheel speed in m/s or km/h, that of the tread, as the rotation of a wheel with this rolling radius, m.
    ///
    /// # Errors
    /// There is a column in rad/s or rpm too.
    pub fn with_wheel_radius(mut self, wheel_radius_m: f64) -> Result<Self, TraceError> {
        if let Some(tread) = self.find(signal::WHEEL_TREAD_SPEED) {
            if self.find(signal::WHEEL_SPEED).is_some() {
                return Err(self.refused(format!(
                    "there are two columns of the wheel speed, in {} and in {}\nhint: remove one of them",
                    signal::WHEEL_SPEED,
                    signal::WHEEL_TREAD_SPEED
                )));
            }
            let (name, factor) = &mut self.columns[tread];
            signal::WHEEL_SPEED.clone_into(name);
            *factor = Scale::of(factor.size() / wheel_radius_m);
        }
        Ok(self)
    }

    fn refuse_twins(&self, names: &[String]) -> Result<(), TraceError> {
        let mut places: HashMap<&str, usize> = HashMap::with_capacity(names.len());
        for (i, (name, _)) in self.columns.iter().enumerate().filter(|(_, (name, _))| !name.is_empty()) {
            match places.entry(name) {
                Entry::Vacant(free) => drop(free.insert(i)),
                Entry::Occupied(earlier) => {
                    let (j, shown) = (*earlier.get(), |i: usize| TraceError::shown(&names[i]));
                    return Err(TraceError::Table {
                        path: self.path.clone(),
                        message: format!(
                            "columns {} `{}` and {} `{}` are the same signal\nhint: remove one of them",
                            j + 1,
                            shown(j),
                            i + 1,
                            shown(i)
                        ),
                    });
                }
            }
        }
        Ok(())
    }

    /// Goes on to the next row; false where there is none.
    ///
    /// # Errors
    /// The file cannot be read, a row has another length, a time does not come after the one before, or there are no
    /// rows at all.
    pub fn advance(&mut self) -> Result<bool, TraceError> {
        let before = self.time_s;
        if !self.advance_in_any_order()? {
            return Ok(false);
        }
        let time_s = self.time_s();
        match before.filter(|before| time_s <= *before) {
            None => Ok(true),
            Some(before) => Err(self.wrong(format!("the time {time_s} s is not after the time before it, {before} s\nhint: sort the rows by time, and remove repeated ones"))),
        }
    }

    /// The same of a table whose times may stand still or go back.
    ///
    /// # Errors
    /// See [`Self::advance`].
    pub fn advance_in_any_order(&mut self) -> Result<bool, TraceError> {
        let is_row = self.source.advance().map_err(|error| self.unread(error))?;
        if !is_row || self.source.cut().is_some() && self.is_left_out() {
            return match self.time_s {
                Some(_) => Ok(false),
                None => Err(TraceError::Table { path: self.path.clone(), message: "there are no rows".to_owned() }),
            };
        }
        if self.source.len() != self.columns.len() {
            let (cells, names) = (self.source.len(), self.columns.len());
            return Err(self.wrong(format!("the row has {cells} cells, but the first line names {names} columns\nhint: write an empty cell where there is no value")));
        }
        let time_s = self.number(self.time_at)?;
        if !time_s.is_finite() {
            let text = self.text(self.time_at);
            let message =
                if text.is_empty() { "the time is missing".to_owned() } else { format!("the time is {text}") };
            return Err(self.wrong(message));
        }
        self.time_s = Some(time_s);
        Ok(true)
    }

    /// Takes what may be cut out of a row without an end; whether nothing of it is left.
    #[cold]
    fn is_left_out(&mut self) -> bool {
        let (cells, names) = (self.source.len(), self.columns.len());
        if !self.may_be_cut || cells > names {
            return false;
        }
        if cells < names || self.time_at + 1 == names {
            self.cut = Some("the last line has no end and is left out");
            return true;
        }
        if let Some(records) = self.source.cut() {
            records.empty_last();
        }
        self.cut = Some("the last line has no end: its last cell, of which digits may be missing, is not used");
        false
    }

    /// What became of a last line without an end, in a sentence; none where there is no such line.
    pub fn cut(&self) -> Option<&'static str> {
        self.cut
    }

    /// Time of the row, s; NaN before the first.
    pub fn time_s(&self) -> f64 {
        self.time_s.unwrap_or(f64::NAN)
    }

    /// Place of a column, if there is one of this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|(column, _)| column == name)
    }

    /// Place of a column.
    ///
    /// # Errors
    /// There is none of this name.
    pub fn require(&self, name: &str) -> Result<usize, TraceError> {
        self.find(name).ok_or_else(|| TraceError::MissingColumn {
            path: self.path.clone(),
            wanted: name.to_owned(),
            present: self.columns.iter().map(|(name, _)| name.clone()).collect(),
        })
    }

    /// What the cells of a column are multiplied by: 1 where the name has its unit in SI.
    pub fn factor(&self, column: usize) -> f64 {
        self.columns[column].1.size()
    }

    /// The number in a column of this row, in SI; NaN where the cell is empty.
    ///
    /// # Errors
    /// The cell holds something else.
    #[inline]
    pub fn number(&self, column: usize) -> Result<f64, TraceError> {
        match self.source.number(column) {
            None => Err(self.not_a_number(column)),
            Some(number) => Ok(self.columns[column].1.of_value(number)),
        }
    }

    /// The same, and none where the cell holds something else.
    #[inline]
    pub fn number_or_none(&self, column: usize) -> Option<f64> {
        self.source.number(column).map(|number| self.columns[column].1.of_value(number))
    }

    /// Names of the columns, in SI.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| name.as_str())
    }

    #[cold]
    fn not_a_number(&self, column: usize) -> TraceError {
        let (name, text) = (TraceError::shown(&self.columns[column].0), TraceError::shown(&self.text(column)));
        let is_date = text.contains([':', '/'])
            || text.len() >= "31.3.24".len() && text.starts_with(|c: char| c.is_ascii_digit());
        let hint = if column == self.time_at && is_date { TIME_BY_MAP } else { "leave a lost sample empty" };
        self.wrong(format!("column `{name}` contains `{text}`, which is not a number\nhint: {hint}"))
    }

    /// The text in a column of this row.
    pub fn text(&self, column: usize) -> Cow<'_, str> {
        self.source.text(column)
    }

    #[cold]
    fn unread(&self, error: RecordError) -> TraceError {
        match error {
            RecordError::Io(source) => TraceError::Io { path: self.path.clone(), source },
            RecordError::TooLong => TraceError::Row {
                path: self.path.clone(),
                line: self.source.line(),
                message: format!(
                    "the row that begins here is longer than {} MiB\nhint: the file has no line breaks, or a quotation mark is not \
                     closed",
                    LONGEST_ROW >> 20
                ),
            },
        }
    }

    /// The table cannot be used.
    pub fn refused(&self, message: String) -> TraceError {
        TraceError::Table { path: self.path.clone(), message }
    }

    /// An error in this row.
    pub fn wrong(&self, message: String) -> TraceError {
        TraceError::Row { path: self.path.clone(), line: self.source.line(), message }
    }
}

/// The number in a cell: NaN where it is empty, none where it holds something else.
#[inline]
pub fn number(cell: &[u8]) -> Option<f64> {
    decimal::plain(cell).or_else(|| of_any_form(cell))
}

/// The same of a number with an exponent, one without a point, or one between spaces.
#[inline(never)]
fn of_any_form(cell: &[u8]) -> Option<f64> {
    let cell = cell.trim_ascii();
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    fast_float2::parse(cell).ok()
}
