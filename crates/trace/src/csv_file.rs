//! Comma-separated files: one row of names with units, then one row for each time.
//!
//! They are read and written row by row, so that a file of any length needs the memory of one row.

use std::borrow::Cow;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use crate::{Column, Trace, TraceError, Values, WholeFile, Word, signal, units};

/// Longest row that is read, bytes: a million columns fit in. A file without an end of line does not fill the memory.
const LONGEST_ROW: usize = 32 << 20;
/// Bytes that are read at once.
const READ_AT_ONCE: usize = 64 << 10;

/// A comma-separated file that is read row by row. The first row names the columns; `time_s` (or `time_ms`) must be among
/// them and rise. An empty cell, or `nan`, is a reading that did not come, and becomes NaN. A column without a name is passed over.
pub struct CsvRows {
    path: PathBuf,
    reader: csv::Reader<RowByRow>,
    /// Name in SI, and the factor that brings the cells there.
    columns: Vec<(String, f64)>,
    time_at: usize,
    row: csv::ByteRecord,
    time_s: Option<f64>,
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

    /// The same from anywhere; `path` is for messages.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn of(path: &Path, input: Box<dyn Read>) -> Result<Self, TraceError> {
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .buffer_capacity(READ_AT_ONCE)
            .from_reader(RowByRow { input, left: LONGEST_ROW });
        let row = csv::ByteRecord::new();
        let mut rows = Self { path: path.to_owned(), reader, columns: Vec::new(), time_at: 0, row, time_s: None };
        if !rows.read_row()? {
            return Err(TraceError::Table { path: rows.path, message: "the file is empty".to_owned() });
        }
        let names: Vec<String> = rows.row.iter().map(|name| String::from_utf8_lossy(name).trim().to_owned()).collect();
        rows.columns = names.iter().map(|name| units::to_si(name)).collect();
        rows.refuse_twins(&names)?;
        rows.time_at = rows.require(signal::TIME)?;
        Ok(rows)
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
            Some(before) => Err(self.wrong(format!("the time {time_s} s is not after the time before it, {before} s"))),
        }
    }

    /// The same of a table whose times may stand still or go back.
    ///
    /// # Errors
    /// See [`Self::advance`].
    pub fn advance_in_any_order(&mut self) -> Result<bool, TraceError> {
        if !self.read_row()? {
            return match self.time_s {
                Some(_) => Ok(false),
                None => Err(TraceError::Table { path: self.path.clone(), message: "there are no rows".to_owned() }),
            };
        }
        if self.row.len() != self.columns.len() {
            let (cells, names) = (self.row.len(), self.columns.len());
            return Err(self.wrong(format!("the row has {cells} cells, but the first line names {names} columns")));
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
        self.columns[column].1
    }

    /// The number in a column of this row, in SI; NaN where the cell is empty.
    ///
    /// # Errors
    /// The cell holds something else.
    pub fn number(&self, column: usize) -> Result<f64, TraceError> {
        let cell = self.row[column].trim_ascii();
        if cell.is_empty() {
            return Ok(f64::NAN);
        }
        let (name, factor) = &self.columns[column];
        let number = std::str::from_utf8(cell).ok().and_then(|text| text.parse::<f64>().ok());
        number.map(|number| number * factor).ok_or_else(|| {
            let (name, text) = (TraceError::shown(name), TraceError::shown(&self.text(column)));
            self.wrong(format!(
                "column `{name}` contains `{text}`, which is not a number\nhint: leave a lost sample empty"
            ))
        })
    }

    /// The text in a column of this row.
    pub fn text(&self, column: usize) -> Cow<'_, str> {
        String::from_utf8_lossy(self.row[column].trim_ascii())
    }

    fn read_row(&mut self) -> Result<bool, TraceError> {
        let line = self.reader.position().line();
        self.reader.get_mut().left = LONGEST_ROW;
        let read = self.reader.read_byte_record(&mut self.row);
        read.map_err(into_io).map_err(|source| match self.reader.get_ref().left {
            0 => TraceError::Row {
                path: self.path.clone(),
                line,
                message: format!(
                    "the row that begins here is longer than {} MiB\nhint: the file is not comma-separated, or a quotation \
                     mark is not closed",
                    LONGEST_ROW >> 20
                ),
            },
            _ => TraceError::Io { path: self.path.clone(), source },
        })
    }

    /// The table cannot be used.
    pub fn refused(&self, message: String) -> TraceError {
        TraceError::Table { path: self.path.clone(), message }
    }

    /// An error in this row.
    pub fn wrong(&self, message: String) -> TraceError {
        let line = self.row.position().map_or(0, csv::Position::line);
        TraceError::Row { path: self.path.clone(), line, message }
    }
}

/// An input of which no row may be longer than what is left.
struct RowByRow {
    input: Box<dyn Read>,
    left: usize,
}

impl Read for RowByRow {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(io::ErrorKind::InvalidData.into());
        }
        let most = buffer.len().min(self.left);
        let read = self.input.read(&mut buffer[..most])?;
        self.left -= read;
        Ok(read)
    }
}

/// Reads a whole comma-separated file, see [`CsvRows`]; a column with other text than numbers holds words.
///
/// # Errors
/// See [`CsvRows`].
pub fn read_csv(path: &Path) -> Result<Trace, TraceError> {
    let mut rows = CsvRows::open(path)?;
    let named = |&i: &usize| i != rows.time_at && !rows.columns[i].0.is_empty();
    let places: Vec<usize> = (0..rows.columns.len()).filter(named).collect();
    let mut cells: Vec<Cells> = places.iter().map(|_| Cells::default()).collect();
    let mut time_s = Vec::new();
    while rows.advance()? {
        time_s.push(rows.time_s());
        for (cells, &place) in cells.iter_mut().zip(&places) {
            cells.push(&rows.text(place));
        }
    }
    let column = |(&place, cells): (&usize, Cells)| {
        let (name, factor) = &rows.columns[place];
        Column { name: name.clone(), values: cells.into_values(*factor) }
    };
    Ok(Trace { path: Some(path.to_owned()), time_s, columns: places.iter().zip(cells).map(column).collect() })
}

/// Writes a trace as a comma-separated file, whole or not at all, see [`CsvWriter`].
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(path: &Path, trace: &Trace) -> io::Result<()> {
    csv_written(path, trace)?.finish()
}

/// The same in a file that still has to get its name.
///
/// # Errors
/// The file cannot be written.
pub fn csv_written(path: &Path, trace: &Trace) -> io::Result<WholeFile> {
    let names = trace.columns.iter().map(|column| column.name.as_str());
    let mut writer = CsvWriter::new(WholeFile::create(path)?, names)?;
    for (i, &time_s) in trace.time_s.iter().enumerate() {
        let cells = trace.columns.iter().map(|column| match &column.values {
            Values::Numbers(numbers) => Cell::Number(numbers[i]),
            Values::Words(words) => Cell::Word(&words[i]),
        });
        writer.row(time_s, cells)?;
    }
    writer.finish()
}

/// What stands in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell<'a> {
    /// A number; NaN becomes an empty cell.
    Number(f64),
    /// A whole number from 0.
    Whole(u64),
    /// A word.
    Word(&'a str),
}

/// Writes a comma-separated file row by row. Numbers are written so that reading gives the very same ones, with as few digits as that
/// needs and without exponents.
pub struct CsvWriter<W: Write> {
    writer: W,
    /// Rows that are not yet with the writer.
    rows: Vec<u8>,
    columns: usize,
}

/// Bytes that are handed on at once.
const WRITTEN_AT_ONCE: usize = 64 << 10;

impl<W: Write> CsvWriter<W> {
    /// Writes the names: time first, then these.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn new<'a>(writer: W, names: impl IntoIterator<Item = &'a str>) -> io::Result<Self> {
        Self::without_time(writer, std::iter::once(signal::TIME).chain(names))
    }

    /// Writes the names of a table that is not over time, whose rows are [`Self::cells`].
    ///
    /// # Errors
    /// What the writer meets.
    pub fn without_time<'a>(writer: W, names: impl IntoIterator<Item = &'a str>) -> io::Result<Self> {
        let mut rows = Vec::with_capacity(WRITTEN_AT_ONCE + 4096);
        let mut columns = 0;
        for name in names {
            if columns > 0 {
                rows.push(b',');
            }
            push_word(&mut rows, name);
            columns += 1;
        }
        rows.push(b'\n');
        Ok(Self { writer, rows, columns })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What the writer meets, or a row that has not one cell for each name.
    pub fn row<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        self.cells(std::iter::once(Cell::Number(time_s)).chain(cells))
    }

    /// Writes a row of a table without time.
    ///
    /// # Errors
    /// As [`Self::row`].
    pub fn cells<'a>(&mut self, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        let begin = self.rows.len();
        let mut count = 0;
        for cell in cells {
            if count > 0 {
                self.rows.push(b',');
            }
            count += 1;
            match cell {
                Cell::Word(word) => push_word(&mut self.rows, word),
                Cell::Whole(number) => write!(self.rows, "{number}")?,
                Cell::Number(number) => push_number(&mut self.rows, number)?,
            }
        }
        if count != self.columns {
            self.rows.truncate(begin);
            return Err(io::Error::other(format!("a row of {count} cells for {} columns", self.columns)));
        }
        if self.rows.len() == begin {
            // A row of one empty cell is no empty line.
            self.rows.extend_from_slice(b"\"\"");
        }
        self.rows.push(b'\n');
        if self.rows.len() >= WRITTEN_AT_ONCE { self.hand_on() } else { Ok(()) }
    }

    fn hand_on(&mut self) -> io::Result<()> {
        let written = self.writer.write_all(&self.rows);
        self.rows.clear();
        written
    }

    /// Hands the rows so far to the writer below, and flushes it.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn flush(&mut self) -> io::Result<()> {
        self.hand_on()?;
        self.writer.flush()
    }

    /// Hands back the writer, to which every row has gone.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn finish(mut self) -> io::Result<W> {
        self.hand_on()?;
        self.writer.flush()?;
        Ok(self.writer)
    }
}

/// A number; NaN leaves the cell empty.
fn push_number(row: &mut Vec<u8>, number: f64) -> io::Result<()> {
    if number.is_nan() {
        return Ok(());
    }
    let mut digits = zmij::Buffer::new();
    let text = digits.format(number).as_bytes();
    if text.contains(&b'e') {
        // Very small and very large numbers would have an exponent.
        return write!(row, "{number}");
    }
    row.extend_from_slice(text.strip_suffix(b".0").unwrap_or(text));
    Ok(())
}

/// A word, in quotation marks where it needs them.
fn push_word(row: &mut Vec<u8>, word: &str) {
    if !word.bytes().any(|byte| matches!(byte, b',' | b'"' | b'\n' | b'\r')) {
        row.extend_from_slice(word.as_bytes());
        return;
    }
    row.push(b'"');
    row.extend_from_slice(word.replace('"', "\"\"").as_bytes());
    row.push(b'"');
}

/// The error of the file below, with its kind: a broken pipe must stay one.
fn into_io(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// Cells of one column while it is read: numbers as long as every cell is one.
#[derive(Default)]
struct Cells {
    numbers: Vec<f64>,
    words: Option<Vec<String>>,
}

impl Cells {
    fn push(&mut self, text: &str) {
        if let Some(words) = &mut self.words {
            words.push(text.to_owned());
            return;
        }
        match text.parse() {
            _ if text.is_empty() => self.numbers.push(f64::NAN),
            Ok(number) => self.numbers.push(number),
            Err(_) => {
                let blank = |number: &f64| if number.is_nan() { String::new() } else { number.to_string() };
                let mut words: Vec<String> = self.numbers.iter().map(blank).collect();
                words.push(text.to_owned());
                self.words = Some(words);
            }
        }
    }

    fn into_values(self, factor: f64) -> Values {
        match self.words {
            Some(words) => Values::Words(words.into_iter().map(Word::from).collect()),
            None => Values::Numbers(self.numbers.into_iter().map(|number| number * factor).collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn file(name: &str, text: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("wetclutch-csv-{}-{name}.csv", std::process::id()));
        std::fs::write(&path, text).unwrap();
        path
    }

    fn error(name: &str, text: &str) -> String {
        let path = file(name, text);
        let message = read_csv(&path).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        message.replace(path.to_str().unwrap(), "FILE")
    }

    #[test]
    fn numbers_survive_a_round_trip_to_the_last_bit() {
        let mut trace = Trace::with_columns(&["a_pa", "b_rad_s"]);
        trace.push(0.1, &[1.0 / 3.0, f64::NAN]);
        trace.push(0.2, &[-1e-300, 6.02e23]);
        trace.add_words("phase", vec!["torque_phase".into(), "inertia_phase".into()]);
        let path = file("round", "");
        write_csv(&path, &trace).unwrap();
        let back = read_csv(&path).unwrap();
        assert_eq!(back.get("a_pa").unwrap(), trace.get("a_pa").unwrap());
        assert!(back.get("b_rad_s").unwrap()[0].is_nan());
        assert_eq!(back.columns[2], trace.columns[2]);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn numbers_are_as_short_as_those_of_display_and_read_back_the_same() {
        let written = |number: f64| {
            let mut row = Vec::new();
            push_number(&mut row, number).unwrap();
            String::from_utf8(row).unwrap()
        };
        let some = [0.0, -0.0, 1.0, -1.5, 1e-5, 1.2e-5, 9e15, 1e16, 1.5e300, -5e-324, f64::INFINITY, f64::MIN_POSITIVE];
        // All sizes, by a generator that needs no crate.
        let mut bits = 0x9e37_79b9_7f4a_7c15_u64;
        let random = std::iter::repeat_with(|| {
            bits ^= bits << 13;
            bits ^= bits >> 7;
            bits ^= bits << 17;
            [f64::from_bits(bits), f64::from_bits(bits >> 12 | 0x3ff0_0000_0000_0000) * 1000.0]
        });
        for number in some.into_iter().chain(random.take(100_000).flatten()).filter(|number| !number.is_nan()) {
            let text = written(number);
            // Where two shortest numbers are equally near, the last digit may be the other one.
            assert_eq!(text.len(), number.to_string().len(), "{text} {number}");
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), number.to_bits(), "{text} {number}");
        }
        assert_eq!(written(f64::NAN), "");
    }

    #[test]
    fn words_with_signs_of_the_format_are_quoted_and_a_row_has_a_cell_for_each_name() {
        let mut writer = CsvWriter::new(Vec::new(), ["a, b", "c"]).unwrap();
        writer.row(0.5, [Cell::Word("say \"x\"\n"), Cell::Whole(7)]).unwrap();
        assert!(writer.row(1.0, [Cell::Number(1.0)]).is_err());
        writer.row(2.0, [Cell::Number(f64::NAN), Cell::Word("")]).unwrap();
        let text = String::from_utf8(writer.finish().unwrap()).unwrap();
        assert_eq!(text, "time_s,\"a, b\",c\n0.5,\"say \"\"x\"\"\n\",7\n2,,\n");
    }

    #[test]
    fn other_units_are_converted_to_si() {
        let path = file("units", "time_ms, Turbine_Speed_rpm\n0, 300\n10, 600\n");
        let trace = read_csv(&path).unwrap();
        assert_eq!(trace.time_s, [0.0, 0.01]);
        assert!((trace.get("turbine_speed_rad_s").unwrap()[1] - 62.831_853).abs() < 1e-6);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn an_empty_cell_and_nan_are_readings_that_did_not_come() {
        let text = "time_ms,wheel_speed_rpm,wheel_speed_age_ms\n0,60,0\n10,,\n20, NaN ,nan\n30,-nan,\n40,120,7\n";
        let path = file("holes", text);
        let (whole, mut rows) = (read_csv(&path).unwrap(), CsvRows::open(&path).unwrap());
        for name in [signal::WHEEL_SPEED, signal::age_of(signal::WHEEL_SPEED).unwrap()] {
            let came: Vec<bool> = whole.get(name).unwrap().iter().map(|value| !value.is_nan()).collect();
            assert_eq!(came, [true, false, false, false, true], "{name}");
        }
        assert!((whole.get("wheel_speed_age_s").unwrap()[4] - 0.007).abs() < 1e-12);
        let column = rows.require(signal::WHEEL_SPEED).unwrap();
        for &expected in whole.get(signal::WHEEL_SPEED).unwrap() {
            assert!(rows.advance().unwrap());
            let number = rows.number(column).unwrap();
            assert!(number == expected || number.is_nan() && expected.is_nan());
        }
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_broken_file_says_where_it_is_broken() {
        assert_eq!(
            error("back", "time_s,a\n0,1\n0.2,1\n0.1,1\n"),
            "FILE:4: the time 0.1 s is not after the time before it, 0.2 s"
        );
        assert_eq!(error("blank", "time_s,a\n0,1\n,1\n"), "FILE:3: the time is missing");
        assert_eq!(error("none", "time_s,a\n"), "FILE: there are no rows");
        assert_eq!(error("untimed", "t,a\n0,1\n"), "FILE: there is no column `time_s`\nhint: the columns are t, a");
        assert_eq!(
            error("ragged", "time_s,a\n0,1\n1\n"),
            "FILE:3: the row has 1 cells, but the first line names 2 columns"
        );
        assert_eq!(
            error("comma", "time_s,a\n0,1,\n"),
            "FILE:2: the row has 3 cells, but the first line names 2 columns"
        );
        assert_eq!(error("empty", ""), "FILE: the file is empty");
        assert_eq!(error("endless", "time_s,a\n0,1\n1e400,1\n"), "FILE:3: the time is 1e400");
        assert_eq!(error("nan", "time_s,a\nNaN,1\n"), "FILE:2: the time is NaN");
        assert_eq!(
            error("time", "time_s,a\n0,1\nnoon,1\n"),
            "FILE:3: column `time_s` contains `noon`, which is not a number\nhint: leave a lost sample empty"
        );
    }

    #[test]
    fn one_signal_in_two_columns_is_refused_by_their_places() {
        assert_eq!(
            error("twins", "time_s,turbine_speed_rpm,a,turbine_speed_rad_s\n0,1,1,1\n"),
            "FILE: columns 2 `turbine_speed_rpm` and 4 `turbine_speed_rad_s` are the same signal\nhint: remove one of them"
        );
    }

    #[test]
    fn a_million_columns_are_read_and_the_hint_names_a_few() {
        let names: Vec<String> = (0..1_000_000).map(|i| format!("c{i}")).collect();
        let message = error("wide", &format!("{}\n0\n", names.join(",")));
        assert!(message.contains("there is no column `time_s`") && message.len() < 1000, "{message}");
        assert!(message.contains("c19 and 999980 more"), "{message}");
    }

    #[test]
    fn what_spreadsheets_write_is_read() {
        let path = file("spreadsheet", "\u{feff}\"time_s\",a,,\r\n\"0\", 1 ,,\r\n\r\n0.5,\"2\",x,\r\n");
        let trace = read_csv(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        assert_eq!((trace.time_s.as_slice(), trace.columns.len()), (&[0.0, 0.5][..], 1));
        assert_eq!(trace.get("a").unwrap(), [1.0, 2.0]);
    }

    #[test]
    fn a_row_without_an_end_does_not_fill_the_memory() {
        // An open quotation mark takes in every line that follows. What the reader holds of the row before is not
        // counted.
        let text = format!("time_s\n0\n\"{}", "x\n".repeat((LONGEST_ROW + READ_AT_ONCE) / 2));
        assert!(error("quote", &text).starts_with("FILE:3: the row that begins here is longer than 32 MiB\nhint: "));
    }

    #[test]
    fn what_is_no_text_is_named_without_harm_to_the_terminal() {
        let path = file("binary", "");
        std::fs::write(&path, [0x1b, b'[', b'2', b'J', 0xff, 0x00, b',', 0xfe, b'\n', 1, b',', 2]).unwrap();
        let message = read_csv(&path).unwrap_err().to_string();
        std::fs::remove_file(path).unwrap();
        assert!(message.contains("there is no column `time_s`"), "{message}");
        assert!(message.chars().all(|c| c == '\n' || !c.is_control()), "{message:?}");
    }

    #[test]
    fn a_folder_is_no_file() {
        assert!(matches!(read_csv(&std::env::temp_dir()), Err(TraceError::Io { .. })));
    }

    #[test]
    fn a_word_among_numbers_is_named_with_its_row() {
        let path = file("word", "time_s,turbine_speed_rad_s\n0,1\n1,\n2,n/a\n");
        let message = read_csv(&path).unwrap().require("turbine_speed_rad_s").unwrap_err().to_string();
        assert!(
            message.contains("column `turbine_speed_rad_s` contains `n/a` (row 3), which is not a number"),
            "{message}"
        );
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_missing_signal_names_the_one_that_looks_near() {
        let path = file("near", "time_s,turbine_speed\n0,1\n");
        let message = read_csv(&path).unwrap().require("turbine_speed_rad_s").unwrap_err().to_string();
        assert!(message.contains("`turbine_speed` has a similar name"), "{message}");
        std::fs::remove_file(path).unwrap();
    }
}
