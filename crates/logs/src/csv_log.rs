//! Comma-separated files of any dialect.
//!
//! Lines before the names are passed over. Units stand in the names (`N_Eng [rpm]`), in a row below them, or at their ends (`_rpm`). Times
//! are numbers, clock times or dates. Rows are read one by one.

use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};

use trace::csv_file::{LONGEST_ROW, number};
use trace::units::Scale;
use trace::{RecordError, Records, Unit};

use crate::columns::{Batch, Stream};
use crate::csv_dialect::{Dialect, cells};
use crate::gear_letters::number_of_letter;
use crate::row_order::RowOrder;
use crate::samples::{Quality, Sample};
use crate::stamp::{Midnight, StampForm};
use crate::time_column::{ClockParts, is_time_name, one_clock, time_column, time_unit};
use crate::{Channel, LogError, TimeColumn, error};

/// Rows in a batch; of many columns fewer, so that it has at most so many cells, or is one row.
const BATCH: usize = 64;
const CELLS: usize = 1 << 16;

/// An open comma-separated file.
pub(crate) struct CsvLog {
    path: PathBuf,
    dialect: Dialect,
    records: Option<Records>,
    /// Column of the time, and how it is written.
    time: (usize, TimeForm),
    /// Column of each channel.
    columns: Vec<usize>,
    width: usize,
    /// Rows in a batch: one where each is wanted as it comes.
    batch: usize,
    notes: Vec<String>,
}

/// How the times of a table are written.
#[derive(Debug, Clone, Copy, PartialEq)]
enum TimeForm {
    /// Numbers of a unit of this size, s.
    Numbers(Scale),
    Stamps(StampForm),
    /// A time of the day in several columns.
    Parts(ClockParts),
}

impl CsvLog {
    pub(crate) fn open(
        path: &Path,
        head: Vec<u8>,
        rest: Box<dyn Read + Send>,
        time: Option<&TimeColumn>,
        is_followed: bool,
    ) -> Result<(Self, Vec<Channel>), LogError> {
        let beginning = text(&head);
        let dialect = Dialect::of(path, &beginning)?;
        let first = cells(beginning.lines().nth(dialect.first).unwrap_or_default(), dialect.delimiter);
        let stamp = |column: usize| first.get(column).and_then(|cell| StampForm::of(cell));
        let mut input = Beginning(Cursor::new(head)).chain(rest);
        skip(&mut input, dialect.preamble).map_err(LogError::io(path))?;
        let mut records = Records::new(Box::new(input), dialect.delimiter);
        read_row(path, &mut records, dialect.preamble)?;
        let titles: Vec<String> = records.cells().map(|cell| text(cell).trim().to_owned()).collect();
        let mut units: Vec<String> = Vec::new();
        for at in 0..dialect.between {
            read_row(path, &mut records, dialect.preamble)?;
            if dialect.units == Some(at) {
                units = records.cells().map(|cell| unit_text(&text(cell))).collect();
            }
        }
        let names = names_and_units(&titles, &units);
        let mut notes = Vec::new();
        // A column of clock times or dates is the time where no name says so.
        let named = names.iter().any(|(name, _)| is_time_name(name));
        let stamps = || (0..names.len()).filter(|&i| stamp(i).is_some());
        // Of several the one with parts of seconds: GPS gives whole ones.
        let has_parts = |i: &usize| first[*i].rsplit(':').next().is_some_and(|seconds| seconds.contains(['.', ',']));
        let by_form = stamps().find(has_parts).or_else(|| stamps().next()).filter(|_| time.is_none() && !named);
        let by_form = by_form.map(|i| TimeColumn { name: names[i].0.clone(), unit: None });
        let parts = ClockParts::of(&names).filter(|_| time.is_none() && by_form.is_none());
        let time = time.or(by_form.as_ref());
        let column = parts.map_or_else(|| time_column(path, &names, &titles, time), |parts| Ok(parts.hour))?;
        if stamp(column).is_some_and(StampForm::is_ambiguous) {
            notes.push(format!(
                "the day and the month of `{}` cannot be distinguished: the time of the day counts\nhint: dates such as 2024-03-31 are clear",
                error::shown(&first[column])
            ));
        }
        let time = match (stamp(column), parts) {
            (_, Some(parts)) => (column, TimeForm::Parts(parts)),
            (Some(form), None) => (column, TimeForm::Stamps(form)),
            (None, None) => (column, TimeForm::Numbers(Scale::of(time_unit(path, &names[column], time, &mut notes)?))),
        };
        // The last line of the head may be cut.
        let whole = beginning.lines().count().saturating_sub(usize::from(!beginning.ends_with('\n')));
        let lines = beginning.lines().enumerate().take(whole).skip(dialect.first);
        let size_s = if let TimeForm::Numbers(scale) = time.1 { scale.size() } else { 1.0 };
        let rows = lines.map(|(line, text)| (line, cells(text, dialect.delimiter)));
        if parts.is_none() {
            one_clock(path, &names, (column, size_s), "line", rows)?;
        }
        let is_time = |i: usize| i == time.0 || parts.is_some_and(|parts| parts.contains(i));
        let named = |i: &usize| !is_time(*i) && !names[*i].0.is_empty();
        let columns: Vec<usize> = (0..titles.len()).filter(named).collect();
        let (path, width) = (path.to_owned(), titles.len());
        let batch = if is_followed { 1 } else { (CELLS / width.max(1)).clamp(1, BATCH) };
        // There may be very many.
        drop((titles, units));
        let named = |(i, (name, unit)): (usize, (String, String))| {
            let is_channel = !is_time(i) && !name.is_empty();
            is_channel.then(|| Channel { name, unit, group: String::new() })
        };
        let channels = names.into_iter().enumerate().filter_map(named).collect();
        let log = Self { path, dialect, records: Some(records), time, columns, width, batch, notes };
        Ok((log, channels))
    }

    pub(crate) fn format(&self) -> String {
        let delimiter = match self.dialect.delimiter {
            b'\t' => "tab".to_owned(),
            other => format!("`{}`", char::from(other)),
        };
        format!("CSV, delimiter {delimiter}, decimal {}", if self.dialect.decimal_comma { "comma" } else { "point" })
    }

    /// Adds a note.
    pub(crate) fn note(&mut self, note: &str) {
        self.notes.push(note.to_owned());
    }

    pub(crate) fn stream(&mut self, wanted: &[bool]) -> Result<Box<dyn Stream + '_>, LogError> {
        let Some(records) = self.records.take() else {
            return Err(LogError::file(&self.path, "the log was read already"));
        };
        let midnight = match self.time.1 {
            TimeForm::Stamps(form) => form.turns(),
            TimeForm::Numbers(_) | TimeForm::Parts(_) => Midnight::default(),
        };
        Ok(Box::new(Rows {
            channels: (0..self.columns.len()).filter(|channel| wanted[*channel]).collect(),
            log: self,
            records,
            text: Vec::new(),
            midnight,
            order: RowOrder::default(),
            rows: 0,
            without_time: 0,
            first_without_time: String::new(),
            short: 0,
            long: 0,
            no_numbers: 0,
            first_text: None,
            hint: "",
            cut: None,
        }))
    }
}

/// The first bytes of a table, which are long where its lines are: freed when they were read.
struct Beginning(Cursor<Vec<u8>>);

impl Read for Beginning {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.0.read(bytes)?;
        if read == 0 {
            self.0 = Cursor::default();
        }
        Ok(read)
    }
}

/// The rows of a table.
struct Rows<'a> {
    log: &'a mut CsvLog,
    records: Records,
    /// Those that are wanted.
    channels: Vec<usize>,
    /// A cell with a point in place of its comma.
    text: Vec<u8>,
    midnight: Midnight,
    order: RowOrder,
    rows: u64,
    without_time: u64,
    first_without_time: String,
    short: u64,
    long: u64,
    no_numbers: u64,
    first_text: Option<String>,
    /// What to do about it.
    hint: &'static str,
    /// What became of a last line without an end.
    cut: Option<&'static str>,
}

impl Rows<'_> {
    /// The number in a cell: NaN where it is empty, none where it holds something else.
    fn number(&mut self, column: usize) -> Option<f64> {
        let cell = self.records.cell(column).unwrap_or_default();
        if !self.log.dialect.decimal_comma {
            return number(cell);
        }
        // A point is no second decimal sign: it may stand between thousands.
        if cell.contains(&b'.') {
            return None;
        }
        self.text.clear();
        self.text.extend(cell.iter().map(|&byte| if byte == b',' { b'.' } else { byte }));
        number(&self.text)
    }

    /// Most rows have no time.
    fn without_times(&self) -> LogError {
        let (without, rows) = (self.without_time, self.rows);
        let (first, decimal_comma) = (&self.first_without_time, self.log.dialect.decimal_comma);
        let of_number = Some(hint(first, decimal_comma)).filter(|hint| !hint.is_empty());
        let forms = "\nhint: times are numbers, `12:00:01.25`, `2024-03-31 12:00:01.25` or `31.03.2024 12:00:01.25`, all in one form";
        LogError::file(
            &self.log.path,
            format!(
                "{without} of {rows} rows have no time, the first is `{}`{}",
                error::shown(first),
                of_number.unwrap_or(forms)
            ),
        )
    }

    /// The time of the row, s; none where it has none.
    fn time_s(&mut self) -> Option<f64> {
        let (column, form) = self.log.time;
        match form {
            TimeForm::Numbers(scale) => {
                self.number(column).map(|time| scale.of_value(time)).filter(|time_s| time_s.is_finite())
            }
            TimeForm::Parts(parts) => {
                let time_s = parts.seconds(|column| self.number(column))?;
                Some(self.midnight.unwrap(time_s))
            }
            TimeForm::Stamps(form) => {
                let time_s = form.seconds(&text(self.records.cell(column)?))?;
                Some(if form.has_turns() { self.midnight.unwrap(time_s) } else { time_s })
            }
        }
    }

    /// Appends the samples of the row that was read.
    fn take_row(&mut self, batch: &mut Vec<Sample>) {
        self.rows += 1;
        let (is_cut, cells) = (self.records.has_no_end(), self.records.len());
        if is_cut && cells < self.log.width {
            self.cut = Some("is left out");
            return;
        }
        self.short += u64::from(cells < self.log.width);
        self.long += u64::from(self.records.cells().skip(self.log.width).any(|cell| !cell.trim_ascii().is_empty()));
        if is_cut && self.log.time.0 + 1 == cells {
            self.cut = Some("is left out");
            return;
        }
        let Some(time_s) = self.time_s() else {
            if self.without_time == 0 {
                self.first_without_time = text(self.records.cell(self.log.time.0).unwrap_or_default());
            }
            self.without_time += 1;
            return;
        };
        self.order.push(time_s);
        for i in 0..self.channels.len() {
            let channel = self.channels[i];
            let column = self.log.columns[channel];
            if is_cut && column + 1 == cells {
                self.cut = Some("counts without its last cell, of which digits may be missing");
                continue;
            }
            // An empty cell, or `nan`, is a reading that did not come: slow channels leave rows between theirs.
            let (value, quality) = match self.number(column) {
                Some(value) if value.is_nan() => continue,
                Some(value) if value.is_finite() => (value, Quality::Good),
                Some(value) => (value, Quality::Missing),
                // Of a gear it is used.
                None if let Some(number) = number_of_letter(self.records.cell(column).unwrap_or_default()) => {
                    (number, Quality::Missing)
                }
                None => {
                    self.no_numbers += 1;
                    if self.first_text.is_none() {
                        let line = self.records.line() + self.log.dialect.preamble as u64;
                        let cell = text(self.records.cell(column).unwrap_or_default());
                        self.hint = hint(&cell, self.log.dialect.decimal_comma);
                        self.first_text = Some(format!("line {line}: `{}`", error::shown(&cell)));
                    }
                    (f64::NAN, Quality::Missing)
                }
            };
            batch.push(Sample { channel, time_s, value, quality });
        }
    }
}

impl Stream for Rows<'_> {
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
        for _ in 0..self.log.batch {
            if !read_row(&self.log.path, &mut self.records, self.log.dialect.preamble)? {
                if self.rows == 0 {
                    return Err(LogError::file(
                        &self.log.path,
                        "there are no rows\nhint: the file has names of columns only; record again",
                    ));
                }
                if 2 * self.without_time > self.rows {
                    return Err(self.without_times());
                }
                self.order.check(&self.log.path)?;
                return Ok(false);
            }
            self.take_row(&mut batch.samples);
        }
        Ok(true)
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.log.notes.clone();
        let mut count = |count: u64, what: &str| {
            if count > 0 {
                notes.push(format!("{count} of {} rows {what}", self.rows));
            }
        };
        count(self.without_time, "have no time and are left out");
        count(self.short, "have fewer cells than there are columns");
        count(self.long, "have more cells than there are columns");
        if let Some(cut) = self.cut {
            notes.push(format!("the last line has no end and {cut}"));
        }
        if let Some(first) = &self.first_text {
            notes.push(format!(
                "{} cells are not numbers and count as missing, the first in {first}{}",
                self.no_numbers, self.hint
            ));
        }
        notes
    }
}

/// Name and unit of each column; the unit stands below its title, in it, or at the end of the name.
fn names_and_units(titles: &[String], units: &[String]) -> Vec<(String, String)> {
    let name_and_unit = |(i, title): (usize, &String)| {
        let (name, own) = split_unit(title);
        let unit = match units.get(i).filter(|unit| !unit.is_empty()) {
            Some(unit) => unit.clone(),
            None if !own.is_empty() => own,
            None => Unit::of_name(&name).map_or(String::new(), |unit| unit.name.to_owned()),
        };
        (name, unit)
    };
    titles.iter().enumerate().map(name_and_unit).collect()
}

/// Reads a row; false at the end.
pub(crate) fn read_row(path: &Path, records: &mut Records, preamble: usize) -> Result<bool, LogError> {
    records.advance().map_err(|error| match error {
        RecordError::Io(source) => LogError::Io { path: path.to_owned(), source },
        RecordError::TooLong => too_long(path, records.line() + preamble as u64),
    })
}

/// The row that begins in this line is longer than any that is read.
pub(crate) fn too_long(path: &Path, line: u64) -> LogError {
    LogError::damaged(
        path,
        format!("line {line}"),
        format!(
            "the row that begins here is longer than {} MiB\nhint: the file has no line breaks, or a quotation mark is not closed",
            LONGEST_ROW >> 20
        ),
    )
}

/// What to do about a cell that is no number because of its decimal sign, or of signs between its thousands.
fn hint(cell: &str, decimal_comma: bool) -> &'static str {
    let cell = cell.trim();
    let is_comma =
        !decimal_comma && cell.matches(',').count() == 1 && number(cell.replace(',', ".").as_bytes()).is_some();
    match () {
        () if is_comma => "\nhint: write all numbers with one decimal sign, and without a sign between their thousands",
        () if has_groups(cell) => "\nhint: write numbers without a sign between their thousands",
        () if !cell.is_empty() && number(cell.as_bytes()).is_some() => {
            "\nhint: the decimal sign of the other numbers is a comma"
        }
        () => "",
    }
}

/// Text of a file: UTF-8, or else Latin-1, in which every byte is a letter.
pub(crate) fn text(bytes: &[u8]) -> String {
    std::str::from_utf8(bytes).map_or_else(|_| bytes.iter().map(|&byte| char::from(byte)).collect(), str::to_owned)
}

/// Whether a text is a number with thousands apart: `1,007.25`, `1.007,25`, `1 007,25`, `1'007.25`, `1’007.25`. Such a number is not read: `1,007` may
/// as well be a little more than one.
pub fn has_groups(text: &str) -> bool {
    let text = text.trim().trim_start_matches(['+', '-']);
    let groups: Vec<&str> = text.split(['.', ',', '\'', '\u{2019}', ' ', '\u{a0}', '\u{2009}', '\u{202f}']).collect();
    let are_digits = groups.iter().all(|group| !group.is_empty() && group.bytes().all(|byte| byte.is_ascii_digit()));
    // Behind the last sign may be decimals. A date has groups of two digits.
    let between = groups.get(1..groups.len().saturating_sub(1).max(2)).unwrap_or_default();
    are_digits && groups[0].len() <= 3 && !between.is_empty() && between.iter().all(|group| group.len() == 3)
}

/// Passes over some lines.
fn skip(input: &mut impl Read, lines: usize) -> io::Result<()> {
    let (mut byte, mut lines) = ([0], lines);
    while lines > 0 {
        input.read_exact(&mut byte)?;
        lines -= usize::from(byte[0] == b'\n');
    }
    Ok(())
}

/// A unit without its brackets.
fn unit_text(cell: &str) -> String {
    cell.trim().trim_start_matches(['[', '(']).trim_end_matches([']', ')']).trim().to_owned()
}

/// Name and unit of a title such as `N_Eng [rpm]`. Round brackets are a unit only if it is known.
pub(crate) fn split_unit(title: &str) -> (String, String) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        let Some(inner) = title.strip_suffix(close).and_then(|rest| rest.rsplit_once(open)) else { continue };
        if open == '[' || Unit::parse(inner.1).is_some() {
            return (inner.0.trim().to_owned(), inner.1.trim().to_owned());
        }
    }
    (title.to_owned(), String::new())
}
