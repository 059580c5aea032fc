//! Comma-separated files, written row by row.

use std::io::{self, Write};

use crate::signal;

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
        let Self { rows, .. } = self;
        let begin = rows.len();
        let mut count = 0;
        // A chain of cells is faster from within.
        cells.into_iter().for_each(|cell| {
            if count > 0 {
                rows.push(b',');
            }
            count += 1;
            match cell {
                Cell::Number(number) => push_number(rows, number),
                Cell::Word(word) => push_word(rows, word),
                Cell::Whole(number) => rows.extend_from_slice(number.to_string().as_bytes()),
            }
        });
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
#[inline]
pub(super) fn push_number(row: &mut Vec<u8>, number: f64) {
    let size = number.abs();
    let mut digits = zmij::Buffer::new();
    if (1e-5..1e16).contains(&size) {
        // Of a number of this size the text has no exponent.
        let text = digits.format_finite(number).as_bytes();
        return row.extend_from_slice(text.strip_suffix(b".0").unwrap_or(text));
    }
    if size == 0.0 {
        return row.extend_from_slice(if number.is_sign_negative() { b"-0" } else { b"0" });
    }
    if number.is_nan() {
        return;
    }
    match digits.format(number).split_once('e') {
        None => row.extend_from_slice(digits.format(number).as_bytes()),
        Some((mantissa, exponent)) => push_expanded(row, mantissa, exponent.parse().unwrap_or(0)),
    }
}

/// A number without its exponent: `-1.25` and `-7` give `-0.000000125`.
fn push_expanded(row: &mut Vec<u8>, mantissa: &str, exponent: i32) {
    let (sign, size) = mantissa.strip_prefix('-').map_or(("", mantissa), |size| ("-", size));
    let (whole, fraction) = size.split_once('.').unwrap_or((size, ""));
    let mut push = |text: &str, zeros: usize| {
        row.extend_from_slice(text.as_bytes());
        row.resize(row.len() + zeros, b'0');
    };
    let places = exponent.unsigned_abs() as usize;
    push(sign, 0);
    if exponent < 0 {
        push("0.", places.saturating_sub(1));
        push(whole, 0);
        push(fraction, 0);
    } else {
        push(whole, 0);
        push(fraction, places.saturating_sub(fraction.len()));
    }
}

/// A word, in quotation marks where it needs them.
fn push_word(row: &mut Vec<u8>, word: &str) {
    // No letter is below the comma, as all signs are that need the marks.
    let is_plain =
        word.bytes().all(|byte| byte > b',') || !word.bytes().any(|byte| matches!(byte, b',' | b'"' | b'\n' | b'\r'));
    if is_plain {
        return row.extend_from_slice(word.as_bytes());
    }
    row.push(b'"');
    row.extend_from_slice(word.replace('"', "\"\"").as_bytes());
    row.push(b'"');
}
