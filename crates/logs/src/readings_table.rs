//! Tables with a reading in each row, as the app Car Scanner exports them: `"SECONDS";"PID";"VALUE";"UNITS"`. Each name is a channel.

use std::collections::HashMap;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

use trace::Records;
use trace::csv_file::number;

use crate::columns::{Batch, Stream};
use crate::csv_dialect::cells;
use crate::csv_log::{read_row, text};
use crate::samples::{Quality, Sample};
use crate::{Channel, LogError, error};

/// Rows in a batch.
const BATCH: usize = 64;

/// Where the columns of a reading stand.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Places {
    delimiter: u8,
    time: usize,
    name: usize,
    value: usize,
    unit: Option<usize>,
}

impl Places {
    /// Those of a row of names; none if it is that of another table.
    fn of(names: &str) -> Option<Self> {
        [b';', b',', b'\t'].into_iter().find_map(|delimiter| {
            let names: Vec<String> = cells(names, delimiter).iter().map(|name| name.to_lowercase()).collect();
            let place = |wanted: &str| names.iter().position(|name| name == wanted);
            let (time, name, value) = (place("seconds")?, place("pid")?, place("value")?);
            Some(Self { delimiter, time, name, value, unit: place("units") })
        })
    }
}

/// Whether a table with this row of names has a reading in each row.
pub(crate) fn is_of_readings(names: &str) -> bool {
    Places::of(names).is_some()
}

/// An open table.
pub(crate) struct ReadingsTable {
    path: PathBuf,
    places: Places,
    records: Option<Records>,
    /// Channels by name.
    channels: HashMap<String, usize>,
    batch: usize,
}

impl ReadingsTable {
    /// Opens a table; its channels are those of the first bytes, `head`.
    pub(crate) fn open(
        path: &Path,
        head: Vec<u8>,
        rest: Box<dyn Read + Send>,
        is_followed: bool,
    ) -> Result<(Self, Vec<Channel>), LogError> {
        let beginning = text(&head);
        let names = beginning.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
        let places = Places::of(names).ok_or_else(|| {
            LogError::file(path, "there is no row of names\nhint: such a table begins with SECONDS;PID;VALUE;UNITS")
        })?;
        let (mut channels, mut by_name) = (Vec::new(), HashMap::new());
        // The last line of the head may be cut.
        let whole = beginning.lines().count().saturating_sub(usize::from(!beginning.ends_with('\n')));
        for line in beginning.lines().take(whole).skip_while(|line| line.trim().is_empty()).skip(1) {
            let row = cells(line, places.delimiter);
            let cell = |place: usize| row.get(place).map_or("", |cell| cell);
            let name = cell(places.name);
            if !name.is_empty() && number(cell(places.value).as_bytes()).is_some() && !by_name.contains_key(name) {
                by_name.insert(name.to_owned(), channels.len());
                let unit = places.unit.map_or("", cell).to_owned();
                channels.push(Channel { name: name.to_owned(), unit, group: String::new() });
            }
        }
        let mut records = Records::new(Box::new(Cursor::new(head).chain(rest)), places.delimiter);
        read_row(path, &mut records, 0)?;
        let batch = if is_followed { 1 } else { BATCH };
        let log = Self { path: path.to_owned(), places, records: Some(records), channels: by_name, batch };
        Ok((log, channels))
    }

    pub(crate) fn stream(&mut self, wanted: &[bool]) -> Result<Box<dyn Stream + '_>, LogError> {
        let Some(records) = self.records.take() else {
            return Err(LogError::file(&self.path, "the log was read already"));
        };
        let (wanted, late) = (wanted.to_vec(), HashMap::new());
        Ok(Box::new(Readings { log: self, records, wanted, rows: 0, unread: 0, first_unread: None, late }))
    }
}

/// The readings of a table.
struct Readings<'a> {
    log: &'a mut ReadingsTable,
    records: Records,
    wanted: Vec<bool>,
    rows: u64,
    /// Rows without time, name or value.
    unread: u64,
    first_unread: Option<String>,
    /// Readings of names that do not stand in the beginning.
    late: HashMap<String, u64>,
}

impl Readings<'_> {
    /// The reading of the row that was read; none if it has none that is wanted.
    fn take_row(&mut self) -> Option<Sample> {
        self.rows += 1;
        let places = self.log.places;
        let number_in = |place: usize| self.records.cell(place).and_then(number).filter(|value| value.is_finite());
        let name = text(self.records.cell(places.name).unwrap_or_default()).trim().to_owned();
        let (Some(time_s), Some(value), false) = (number_in(places.time), number_in(places.value), name.is_empty())
        else {
            self.unread += 1;
            self.first_unread.get_or_insert_with(|| {
                let row: Vec<String> = self.records.cells().map(text).collect();
                format!("line {}: `{}`", self.records.line(), error::shown(&row.join(" ")))
            });
            return None;
        };
        let Some(&channel) = self.log.channels.get(&name) else {
            *self.late.entry(name).or_default() += 1;
            return None;
        };
        self.wanted[channel].then_some(Sample { channel, time_s, value, quality: Quality::Good })
    }
}

impl Stream for Readings<'_> {
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
        for _ in 0..self.log.batch {
            if !read_row(&self.log.path, &mut self.records, 0)? {
                if 2 * self.unread > self.rows || self.rows == 0 {
                    let first = self
                        .first_unread
                        .as_deref()
                        .unwrap_or("there are no rows\nhint: check that the recorder has written samples");
                    let message = format!(
                        "{} of {} rows are no readings, {first}\nhint: a row has time, name, value and unit",
                        self.unread, self.rows
                    );
                    return Err(LogError::file(&self.log.path, message));
                }
                return Ok(false);
            }
            batch.samples.extend(self.take_row());
        }
        Ok(true)
    }

    fn notes(&self) -> Vec<String> {
        let unread = self.first_unread.iter().map(|first| {
            format!("{} of {} rows are no readings and are left out, the first is {first}", self.unread, self.rows)
        });
        let (readings, names) = (self.late.values().sum::<u64>(), self.late.len());
        let late = (names > 0).then(|| {
            format!("{readings} readings of {names} channels that are not in the first 64 KiB of the log are left out")
        });
        unread.chain(late).collect()
    }
}
