//! What is estimated, and how.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, LazyLock};

use car::{GainMethod, ObserverKind, Sensors};
use logs::{ChannelMap, Log, LogError};
use observer::gearbox::Learnt;
use trace::{CsvRows, Following, TableRows};

use super::log_checks::other_delimiter;
use super::selection::ShiftChoice;
use crate::table_text::TableText;
use crate::{Error, Notes, Table};

/// How a log is estimated. The default is the best observer, over the whole log, with all columns.
#[derive(Debug, Clone, Default)]
pub struct EstimateOptions {
    /// The observer, for a vehicle file of one shift; the best for the log if none is given. A car with a gearbox has the gearbox filter.
    pub observer: Option<ObserverKind>,
    /// The design method of its gains, of the rigid and the compliant observer.
    pub method: Option<GainMethod>,
    /// The sensors that the log was recorded with; without them a reading of a speed counts as one of the time of its row.
    pub sensors: Option<Sensors>,
    /// Names of the columns, in their order; all of them if empty. The time is always the first.
    pub columns: Vec<String>,
    /// The shifts that are wanted.
    pub shifts: ShiftChoice,
    /// What was learnt of a car with a gearbox in earlier logs.
    pub learnt: Option<Learnt<f64>>,
    /// Threads on which the log is read, estimated and written; none counts as one. The results are the same on any number.
    pub threads: usize,
    /// Shifts of which every row is kept, for a page.
    pub with_page: bool,
    /// Set when the estimate is to end with an error, before the end of the log.
    pub interrupt: Option<Arc<AtomicBool>>,
    /// Counts the rows of the log that are done.
    pub rows_done: Option<Arc<AtomicU64>>,
    /// For a log that is still being written: set when it is to end.
    pub follow: Option<Arc<AtomicBool>>,
}

impl EstimateOptions {
    pub(crate) fn is_followed(&self) -> bool {
        self.follow.is_some()
    }

    /// On how many threads a log is read, estimated and written: what comes by and by is done before more of it is waited for.
    pub(crate) fn threads_of(&self, log: &LogInput<'_>) -> usize {
        let is_there = log.memory.is_some() || log.path.is_file();
        if is_there && !self.is_followed() { self.threads } else { 1 }
    }

    /// Counts a row as done, and ends the estimate if it is to end.
    pub(crate) fn row_done(&self) -> Result<(), Error> {
        if let Some(rows) = &self.rows_done {
            rows.fetch_add(1, Ordering::Relaxed);
        }
        match &self.interrupt {
            Some(flag) if flag.load(Ordering::Relaxed) => Err(Error::interrupted()),
            _ => Ok(()),
        }
    }
}

/// A log in memory.
#[derive(Debug, Clone, Copy)]
pub enum InMemory<'a> {
    /// A table.
    Table(&'a Arc<Table>),
    /// A table of another kind, which is read where it stands.
    Rows(&'a Arc<dyn TableRows>),
    /// The bytes of a file, of any format but Parquet.
    Bytes(&'a Arc<[u8]>),
}

/// A log and how its channels are mapped to signals.
#[derive(Debug, Clone, Copy)]
pub struct LogInput<'a> {
    /// The file; `-` is standard input. For a log in memory, what messages call it.
    pub path: &'a Path,
    /// The log, if it is in memory.
    pub memory: Option<InMemory<'a>>,
    /// The channel map; an empty one for a table with the names of the program.
    pub map: &'a ChannelMap,
}

impl<'a> LogInput<'a> {
    /// A table in memory, with the names of the program; messages call it so.
    pub fn of_table(name: &'a str, table: &'a Arc<Table>) -> Self {
        static NO_MAP: LazyLock<ChannelMap> = LazyLock::new(ChannelMap::default);
        Self { path: Path::new(name), memory: Some(InMemory::Table(table)), map: &NO_MAP }
    }
}

impl LogInput<'_> {
    /// The table in memory, if it is one.
    pub(crate) fn table(&self) -> Option<Arc<dyn TableRows>> {
        match self.memory? {
            InMemory::Table(table) => Some(Arc::clone(table) as Arc<dyn TableRows>),
            InMemory::Rows(table) => Some(Arc::clone(table)),
            InMemory::Bytes(_) => None,
        }
    }

    /// How many rows an estimate of it has, as far as that is known before it is read.
    pub(crate) fn known_rows(&self, shifts: &ShiftChoice) -> usize {
        let rows = self.table().map_or(0, |table| table.rows());
        if *shifts == ShiftChoice::All { rows } else { 0 }
    }

    /// The text of the log in memory, if it is there.
    pub(crate) fn text(&self) -> io::Result<Option<Box<dyn Read + Send>>> {
        Ok(match (self.table(), self.memory) {
            (Some(table), _) => Some(Box::new(TableText::new(table)?)),
            (None, Some(InMemory::Bytes(text))) => Some(Box::new(Cursor::new(Arc::clone(text)))),
            _ => None,
        })
    }

    /// Its rows, where it is a table with the names of the program.
    pub(crate) fn rows(&self, stop: Option<&Arc<AtomicBool>>) -> Result<CsvRows, Error> {
        let rows = match self.table() {
            Some(table) => CsvRows::of_table(self.path, table),
            None => CsvRows::of_log(self.path, self.reader(stop)?),
        };
        rows.map_err(|error| other_delimiter(self.path, error))
    }

    /// Whether its text comes from a pipe or from memory, and not from a file.
    pub(crate) fn is_stream(&self) -> bool {
        self.memory.is_some() || self.path == Path::new("-")
    }

    /// Whether its channels need a map: those of a table with the names of the program need none.
    pub(crate) fn needs_map(&self) -> Result<bool, Error> {
        Ok(match self.memory {
            Some(InMemory::Bytes(bytes)) => logs::bytes_need_map(self.path, bytes)?,
            None if !self.is_stream() => logs::needs_map(self.path)?,
            _ => false,
        })
    }

    /// Opens its text.
    fn reader(&self, stop: Option<&Arc<AtomicBool>>) -> Result<Box<dyn Read + Send>, Error> {
        let opening = |source| LogError::Io { path: self.path.to_owned(), source };
        Ok(match (self.text().map_err(opening)?, stop) {
            (Some(text), _) => text,
            (None, Some(stop)) => Box::new(Following::open(self.path, Arc::clone(stop)).map_err(opening)?),
            (None, None) if self.is_stream() => Box::new(io::stdin()),
            (None, None) => Box::new(File::open(self.path).map_err(opening)?),
        })
    }

    /// Opens its channels.
    pub(crate) fn open(&self, stop: Option<&Arc<AtomicBool>>, threads: usize) -> Result<Log, Error> {
        let opening = |source| LogError::Io { path: self.path.to_owned(), source };
        if let Some(InMemory::Bytes(bytes)) = self.memory {
            return Ok(Log::of_bytes(self.path, &self.map.open, Arc::clone(bytes))?);
        }
        Ok(match (self.text().map_err(opening)?, stop) {
            (Some(text), _) => Log::of_text(self.path, &self.map.open, text)?,
            (None, Some(stop)) => Log::follow(self.path, &self.map.open, Arc::clone(stop))?,
            (None, None) => Log::open(self.path, &self.map.open)?.on_threads(threads.max(1)),
        })
    }
}

/// From which time on the times of a log are shown, s: times of a clock since 1970 from the first one on.
pub fn shown_from_s(first_s: f64) -> f64 {
    const LONGEST_S: f64 = 1e7;
    if first_s.abs() > LONGEST_S { first_s.floor() } else { 0.0 }
}

/// Says from where on the times in sentences and on the page count, if not from zero of the log's clock.
pub(crate) fn said_of_origin(origin_s: f64) -> Option<String> {
    (origin_s != 0.0)
        .then(|| format!("times from {origin_s:.0} s of the log's clock on; the tables in files keep that clock"))
}

/// Says that a log which is followed has ended by itself, where it is a file that may grow.
pub(crate) fn say_end_of_followed(options: &EstimateOptions, path: &Path, say: Notes<'_>) {
    if options.follow.as_ref().is_some_and(|stop| !stop.load(Ordering::Relaxed)) && path.is_file() {
        say(
            "warning: the log became shorter or was replaced by another file: the estimate ends there\nhint: begin again with the new file",
        );
    }
}
