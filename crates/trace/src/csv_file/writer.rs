//! Comma-separated files, written row by row.

use std::io::{self, Write};
use std::ops::Range;

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
    /// The word that stands in this column in the row before.
    SameWord,
    /// The words that stand in this column and in all later ones in the row before; the last cell of its row.
    SameWords,
}

/// Writes a comma-separated file row by row. Numbers are written so that reading gives the very same ones, with as few digits as that
/// needs and without exponents.
pub struct CsvWriter<W: Write> {
    writer: W,
    /// The row before, and the rows that are not yet with the writer.
    rows: Text,
    /// Bytes of these that are with the writer, and where the row before begins.
    handed_on: usize,
    before: usize,
    /// The cells of the row before.
    written: Vec<Written>,
    columns: usize,
}

/// A cell as it stands in a row.
#[derive(Debug, Clone, Copy)]
struct Written {
    /// The bits of its number, or what else it is.
    bits: u64,
    /// Where its text ends in the row. It begins behind the comma at the end of the cell before.
    end: usize,
}

impl Written {
    const NONE: Self = Self { bits: NOT_YET, end: 0 };
}

/// What stands for the bits of a cell that has no number. No number has these bits: each is a NaN, and of those only the first is used.
const NO_NUMBER: u64 = u64::MAX;
const WORD: u64 = u64::MAX - 1;
const WHOLE: u64 = u64::MAX - 2;
const NOT_YET: u64 = u64::MAX - 3;

/// Bytes that are handed on at once.
const WRITTEN_AT_ONCE: usize = 256 << 10;

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
        let mut rows = Text::default();
        let mut columns = 0;
        for name in names {
            rows.push_all(if columns > 0 { b"," } else { b"" });
            rows.filled = put_word(&mut rows.bytes, rows.filled, name);
            columns += 1;
        }
        rows.push_all(b"\n");
        let (handed_on, before, written) = (0, 0, vec![Written::NONE; columns]);
        Ok(Self { writer, rows, handed_on, before, written, columns })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What the writer meets, a row that has not one cell for each name, or one that repeats cells where there is none before it.
    pub fn row<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        self.cells(std::iter::once(Cell::Number(time_s)).chain(cells))
    }

    /// Writes a row of a table without time.
    ///
    /// # Errors
    /// As [`Self::row`].
    pub fn cells<'a>(&mut self, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        let mut row = Row::behind(&mut self.rows, &mut self.written, self.before);
        // A chain of cells is faster from within.
        cells.into_iter().for_each(|cell| row.push(cell));
        let finished = row.finish();
        self.end_row(finished)
    }

    /// Writes a row that holds numbers, and behind them the words of the row before.
    ///
    /// # Errors
    /// As [`Self::row`].
    pub fn numbers(&mut self, time_s: f64, numbers: &[f64]) -> io::Result<()> {
        let mut row = Row::behind(&mut self.rows, &mut self.written, self.before);
        row.numbers(time_s, numbers);
        if row.count < self.columns {
            row.push(Cell::SameWords);
        }
        let finished = row.finish();
        self.end_row(finished)
    }

    /// Ends a row.
    fn end_row(&mut self, Finished { begin, end, count, is_whole }: Finished) -> io::Result<()> {
        self.rows.filled = end;
        if count != self.columns || !is_whole {
            self.rows.filled = begin;
            self.written.fill(Written::NONE);
            return Err(io::Error::other(match is_whole {
                true => format!("a row of {count} cells for {} columns", self.columns),
                false => "a cell repeats that of the row before, and there is none".to_owned(),
            }));
        }
        if self.rows.filled == begin {
            // A row of one empty cell is no empty line.
            self.rows.push_all(b"\"\"");
        }
        self.rows.push_all(b"\n");
        self.before = begin;
        if self.rows.filled >= WRITTEN_AT_ONCE { self.hand_on() } else { Ok(()) }
    }

    /// Hands on all rows. The last one stays, as long as the next one may repeat its cells.
    fn hand_on(&mut self) -> io::Result<()> {
        let Text { bytes, filled } = &mut self.rows;
        let handed = self.writer.write_all(&bytes[self.handed_on..*filled]);
        let before = std::mem::take(&mut self.before);
        bytes.copy_within(before..*filled, 0);
        *filled -= before;
        self.handed_on = *filled;
        handed
    }

    /// The writer below, to which the rows go that [`Self::flush`] hands on.
    pub fn inner(&mut self) -> &mut W {
        &mut self.writer
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

/// Text, and room behind it.
#[derive(Default)]
struct Text {
    bytes: Vec<u8>,
    filled: usize,
}

/// Room that each cell finds behind the text: of a comma, and of a number without an exponent that is not odd.
pub(super) const ROOM: usize = 32;

impl Text {
    fn push_all(&mut self, text: &[u8]) {
        self.filled = put(&mut self.bytes, self.filled, text);
    }
}

/// Puts a text at a place, and says where it ends. What it needs of room is made, and some behind it.
fn put(bytes: &mut Vec<u8>, at: usize, text: &[u8]) -> usize {
    let end = at + text.len();
    make_room(bytes, end);
    bytes[at..end].copy_from_slice(text);
    end
}

/// Makes room behind a place.
#[inline]
fn make_room(bytes: &mut Vec<u8>, at: usize) {
    if bytes.len() < at + ROOM {
        grow(bytes, at + ROOM);
    }
}

#[cold]
#[inline(never)]
fn grow(bytes: &mut Vec<u8>, minimum: usize) {
    bytes.resize(minimum.max(2 * bytes.len()).max(WRITTEN_AT_ONCE + 4096), 0);
}

/// A row while it is written. Cells one after the other that are those of the row before are copied together.
///
/// The place at which it is written stands here and not with the text: a loop over cells then holds it in a register.
struct Row<'a> {
    bytes: &'a mut Vec<u8>,
    written: &'a mut [Written],
    /// Where the row before begins, this one, and where this one is written on.
    before: usize,
    begin: usize,
    at: usize,
    /// Cells so far, and how many of them are in the row; the others wait to be copied.
    count: usize,
    done: usize,
    /// Where the last one that is in the row ended in the row before.
    done_before: usize,
    is_whole: bool,
}

/// A row that was written.
struct Finished {
    /// Where it begins and ends.
    begin: usize,
    end: usize,
    /// Its cells.
    count: usize,
    /// Whether it has all that the row before should have given.
    is_whole: bool,
}

impl<'a> Row<'a> {
    fn behind(rows: &'a mut Text, written: &'a mut [Written], before: usize) -> Self {
        let (begin, is_whole) = (rows.filled, true);
        Self { bytes: &mut rows.bytes, written, before, begin, at: begin, count: 0, done: 0, done_before: 0, is_whole }
    }

    /// Takes a cell. Most are those of the row before, and wait: that part stands in the loop over the cells.
    #[inline(always)]
    fn push(&mut self, cell: Cell<'_>) {
        let at = self.count;
        self.count += 1;
        let Some(before) = self.written.get(at) else { return };
        match cell {
            Cell::Number(number) => {
                let bits = if number.is_nan() { NO_NUMBER } else { number.to_bits() };
                if before.bits != bits {
                    self.number(at, number, bits);
                }
            }
            Cell::SameWord => self.is_whole &= before.bits == WORD,
            Cell::SameWords => {
                self.is_whole &= self.written[at..].iter().all(|cell| cell.bits == WORD);
                self.count = self.written.len();
            }
            Cell::Word(word) => self.word(at, word, WORD),
            Cell::Whole(number) => self.word(at, &number.to_string(), WHOLE),
        }
    }

    /// Takes numbers. Those of the row before wait to be copied.
    #[inline]
    fn numbers(&mut self, first: f64, others: &[f64]) {
        for number in std::iter::once(first).chain(others.iter().copied()) {
            self.push(Cell::Number(number));
        }
    }

    /// Writes a number that is not the one of the row before.
    #[inline(always)]
    fn number(&mut self, cell: usize, number: f64, bits: u64) {
        self.begin_cell(cell);
        self.at = put_number(self.bytes, self.at, number);
        self.end_cell(cell, bits);
    }

    /// Writes a word, or a whole number.
    #[inline(always)]
    fn word(&mut self, cell: usize, word: &str, bits: u64) {
        self.begin_cell(cell);
        self.at = put_word(self.bytes, self.at, word);
        self.end_cell(cell, bits);
    }

    #[inline(always)]
    fn begin_cell(&mut self, cell: usize) {
        if self.done < cell {
            self.copy_until(cell);
        }
        make_room(self.bytes, self.at);
        self.bytes[self.at] = b',';
        self.at += usize::from(cell > 0);
    }

    #[inline(always)]
    fn end_cell(&mut self, cell: usize, bits: u64) {
        let end = self.at - self.begin;
        if let Some(written) = self.written.get_mut(cell) {
            self.done_before = std::mem::replace(written, Written { bits, end }).end;
        }
        self.done = cell + 1;
    }

    /// Copies the cells that wait, all before this one.
    #[inline(always)]
    fn copy_until(&mut self, end: usize) {
        let Some(cells) = self.written.get_mut(self.done..end) else { return };
        let Some(last) = cells.last() else { return };
        // With the comma before them.
        let (from, to) = (self.done_before, last.end);
        let moved = (self.at - self.begin).wrapping_sub(from);
        self.at = put_again(self.bytes, self.at, self.before + from..self.before + to);
        for cell in cells {
            cell.end = cell.end.wrapping_add(moved);
        }
        (self.done, self.done_before) = (end, to);
    }

    fn finish(mut self) -> Finished {
        self.copy_until(self.count.min(self.written.len()));
        Finished { begin: self.begin, end: self.at, count: self.count, is_whole: self.is_whole }
    }
}

/// Puts a part of the text before a place there, and says where it ends.
#[inline(never)]
fn put_again(bytes: &mut Vec<u8>, at: usize, part: Range<usize>) -> usize {
    let end = at + part.len();
    make_room(bytes, end);
    bytes.copy_within(part, at);
    end
}

/// Puts a number at a place, and says where it ends; NaN leaves the cell empty.
#[inline(never)]
pub(super) fn put_number(bytes: &mut Vec<u8>, at: usize, number: f64) -> usize {
    let size = number.abs();
    let mut digits = zmij::Buffer::new();
    if (1e-5..1e16).contains(&size) {
        // Of a number of this size the text has no exponent, and that of a whole one ends with `.0`. To look for it would wait for the text.
        let text = digits.format_finite(number).as_bytes();
        // Exact if it is whole.
        let is_whole = number as i64 as f64 == number;
        return put_digits(bytes, at, &text[..text.len() - if is_whole { 2 } else { 0 }]);
    }
    put_odd_number(bytes, at, number)
}

/// The text of a number. Two copies of 16 bytes, which may overlap, take less time than one copy of any length.
#[inline(always)]
fn put_digits(bytes: &mut Vec<u8>, at: usize, text: &[u8]) -> usize {
    let end = at + text.len();
    if let (Some(first), Some(last)) = (text.first_chunk::<16>(), text.last_chunk::<16>())
        && text.len() <= 32
        && let Some(room) = bytes.get_mut(at..end)
        && let Some(begin) = room.first_chunk_mut()
    {
        *begin = *first;
        if let Some(end) = room.last_chunk_mut() {
            *end = *last;
        }
        return end;
    }
    put(bytes, at, text)
}

/// A number with a smaller exponent is written with it.
const MOST_ZEROS: i32 = -15;

/// A number that is zero, none, or of a size whose text may have an exponent.
#[inline(never)]
fn put_odd_number(bytes: &mut Vec<u8>, at: usize, number: f64) -> usize {
    if number == 0.0 {
        return put(bytes, at, if number.is_sign_negative() { b"-0" } else { b"0" });
    }
    if number.is_nan() {
        return at;
    }
    let mut digits = zmij::Buffer::new();
    match digits.format(number).split_once('e') {
        None => put(bytes, at, digits.format(number).as_bytes()),
        Some((mantissa, exponent)) => match exponent.parse().unwrap_or(0) {
            // Zeros that nobody reads.
            ..MOST_ZEROS => put(bytes, at, digits.format(number).as_bytes()),
            exponent => put(bytes, at, &expanded(mantissa, exponent)),
        },
    }
}

/// A number without its exponent: `-1.25` and `-7` give `-0.000000125`.
fn expanded(mantissa: &str, exponent: i32) -> Vec<u8> {
    let mut row = Vec::new();
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
    row
}

/// Puts a word at a place, in quotation marks where it needs them, and says where it ends.
#[inline(never)]
fn put_word(bytes: &mut Vec<u8>, at: usize, word: &str) -> usize {
    // No letter is below the comma, as all signs are that need the marks.
    let is_plain =
        word.bytes().all(|byte| byte > b',') || !word.bytes().any(|byte| matches!(byte, b',' | b'"' | b'\n' | b'\r'));
    if is_plain {
        return put(bytes, at, word.as_bytes());
    }
    put(bytes, at, format!("\"{}\"", word.replace('"', "\"\"")).as_bytes())
}
