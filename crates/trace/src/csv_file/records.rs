//! Records of comma-separated text.
//!
//! A line without quotation marks is cut where it stands: bytes are looked at by eights for the signs that can end a cell. All
//! other records go through the rules of `csv-core`.

use std::io::{self, ErrorKind, Read};

use csv_core::ReadRecordResult;

use crate::text::BYTE_ORDER_MARK;

/// Longest record that is read, bytes: a million columns fit in. A text without an end of line does not fill the memory.
pub const LONGEST_ROW: usize = 32 << 20;
/// Bytes that are read at once.
pub(super) const READ_AT_ONCE: usize = 64 << 10;

/// Why there is no next record.
#[derive(Debug)]
pub enum RecordError {
    /// The text cannot be read.
    Io(io::Error),
    /// The record is longer than [`LONGEST_ROW`].
    TooLong,
}

/// The records of a text, one at a time. Lines end with LF, CR LF or CR; empty lines are passed over, as is a byte order mark.
pub struct Records {
    input: Box<dyn Read + Send>,
    delimiter: u8,
    /// What was read: up to `filled`.
    bytes: Vec<u8>,
    filled: usize,
    has_ended: bool,
    has_begun: bool,
    /// Where the record begins that is looked for, and how far it was looked through.
    start: usize,
    scanned: usize,
    /// Line of `start`, from 1.
    next_line: u64,
    rules: csv_core::Reader,
    row: Row,
}

/// The record that was found.
#[derive(Default)]
struct Row {
    line: u64,
    start: usize,
    /// Where the cells end.
    ends: Vec<usize>,
    /// Whether the ends are those in `unquoted`: cells without their quotation marks, one after the other.
    is_unquoted: bool,
    unquoted: Vec<u8>,
    has_no_end: bool,
}

/// What a look through the bytes has found.
enum Found {
    Record,
    /// A record for the rules.
    Odd,
    /// The bytes end before the record does.
    Part,
}

impl Records {
    /// The records of a text whose cells are separated by this sign.
    pub fn new(input: Box<dyn Read + Send>, delimiter: u8) -> Self {
        Self {
            input,
            delimiter,
            bytes: Vec::new(),
            filled: 0,
            has_ended: false,
            has_begun: false,
            start: 0,
            scanned: 0,
            next_line: 1,
            rules: csv_core::ReaderBuilder::new().delimiter(delimiter).build(),
            row: Row::default(),
        }
    }

    /// Goes on to the next record; false at the end.
    ///
    /// # Errors
    /// The text cannot be read, or the record is too long.
    pub fn advance(&mut self) -> Result<bool, RecordError> {
        while !self.has_begun {
            if self.filled < BYTE_ORDER_MARK.len() && !self.has_ended {
                self.refill()?;
                continue;
            }
            self.has_begun = true;
            if self.bytes[..self.filled].starts_with(BYTE_ORDER_MARK) {
                (self.start, self.scanned) = (BYTE_ORDER_MARK.len(), BYTE_ORDER_MARK.len());
            }
        }
        self.row.ends.clear();
        self.row.is_unquoted = false;
        self.row.has_no_end = false;
        loop {
            match self.scan() {
                Found::Record => return Ok(true),
                Found::Odd => return self.by_rules(),
                Found::Part if self.has_ended => return Ok(self.rest()),
                Found::Part => {
                    let passed = self.start;
                    self.refill()?;
                    self.row.ends.iter_mut().for_each(|end| *end -= passed);
                }
            }
        }
    }

    /// Cells of the record.
    pub fn len(&self) -> usize {
        self.row.ends.len()
    }

    /// Whether there is no record.
    pub fn is_empty(&self) -> bool {
        self.row.ends.is_empty()
    }

    /// A cell of the record, if it has so many.
    #[inline]
    pub fn cell(&self, at: usize) -> Option<&[u8]> {
        let end = *self.row.ends.get(at)?;
        let before = at.checked_sub(1).map(|before| self.row.ends[before]);
        match self.row.is_unquoted {
            false => self.bytes.get(before.map_or(self.row.start, |before| before + 1)..end),
            true => self.row.unquoted.get(before.unwrap_or(0)..end),
        }
    }

    /// The cells of the record.
    pub fn cells(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.len()).map_while(|at| self.cell(at))
    }

    /// The line on which the record begins, from 1; while none was found, that of the one that was looked for.
    pub fn line(&self) -> u64 {
        self.row.line
    }

    /// Whether the text ends within the record: digits of it may be missing.
    pub fn has_no_end(&self) -> bool {
        self.row.has_no_end
    }

    /// Empties the last cell of the record.
    pub(super) fn empty_last(&mut self) {
        let Row { start, ends, is_unquoted, .. } = &mut self.row;
        if let Some((last, others)) = ends.split_last_mut() {
            *last = match (others.last(), *is_unquoted) {
                (Some(before), is_unquoted) => before + usize::from(!is_unquoted),
                (None, false) => *start,
                (None, true) => 0,
            };
        }
    }

    /// Looks for the end of the record in the bytes that are there.
    fn scan(&mut self) -> Found {
        let text = &self.bytes[..self.filled];
        let delimiter = self.delimiter;
        let mut from = self.scanned;
        self.row.line = self.next_line;
        while from < text.len() {
            let mut signs = signs(eight(&text[from..]), delimiter);
            while signs != 0 {
                let at = from + (signs.trailing_zeros() / 8) as usize;
                signs &= signs - 1;
                let sign = text[at];
                if sign == delimiter {
                    self.row.ends.push(at);
                    continue;
                }
                match sign {
                    b'\n' => {
                        let end = if at > self.start && text[at - 1] == b'\r' { at - 1 } else { at };
                        let start = std::mem::replace(&mut self.start, at + 1);
                        self.next_line += 1;
                        if end > start {
                            self.row.start = start;
                            self.row.ends.push(end);
                            self.scanned = at + 1;
                            return Found::Record;
                        }
                        self.row.line = self.next_line;
                    }
                    b'\r' if text.get(at + 1) == Some(&b'\n') => {}
                    b'\r' if at + 1 == text.len() && !self.has_ended => {
                        self.scanned = at;
                        return Found::Part;
                    }
                    b'"' | b'\r' => return Found::Odd,
                    _ => {}
                }
            }
            from += 8;
        }
        self.scanned = text.len();
        Found::Part
    }

    /// The record that the end of the text ends; false if there is none.
    fn rest(&mut self) -> bool {
        if self.start == self.filled {
            return false;
        }
        self.row.start = std::mem::replace(&mut self.start, self.filled);
        self.row.ends.push(self.filled);
        self.row.has_no_end = true;
        true
    }

    /// Reads the record by the rules of the format.
    fn by_rules(&mut self) -> Result<bool, RecordError> {
        let (mut written, mut cells, mut taken) = (0, 0, 0);
        self.row.ends.resize(self.row.ends.len().max(16), 0);
        self.row.unquoted.resize(self.row.unquoted.len().max(1024), 0);
        loop {
            // To the rules, nothing is the end of the text.
            if self.start == self.filled && !self.has_ended {
                self.refill()?;
            }
            let Row { ends, unquoted, .. } = &mut self.row;
            let text = &self.bytes[self.start..self.filled];
            let is_end = text.is_empty();
            let (result, read, wrote, ended) =
                self.rules.read_record(text, &mut unquoted[written..], &mut ends[cells..]);
            self.next_line += text[..read].iter().filter(|byte| **byte == b'\n').count() as u64;
            self.start += read;
            self.scanned = self.start;
            (written, cells, taken) = (written + wrote, cells + ended, taken + read);
            if taken > LONGEST_ROW {
                return Err(RecordError::TooLong);
            }
            match result {
                ReadRecordResult::InputEmpty => {}
                ReadRecordResult::OutputFull => unquoted.resize(2 * unquoted.len(), 0),
                ReadRecordResult::OutputEndsFull => ends.resize(2 * ends.len(), 0),
                ReadRecordResult::Record | ReadRecordResult::End => {
                    ends.truncate(cells);
                    self.row.is_unquoted = true;
                    self.row.has_no_end = is_end;
                    return Ok(matches!(result, ReadRecordResult::Record));
                }
            }
        }
    }

    /// Reads more, behind what is left of the bytes.
    fn refill(&mut self) -> Result<(), RecordError> {
        let passed = std::mem::take(&mut self.start);
        self.bytes.copy_within(passed..self.filled, 0);
        self.filled -= passed;
        self.scanned -= passed;
        if self.filled > LONGEST_ROW {
            return Err(RecordError::TooLong);
        }
        if self.bytes.len() < self.filled + READ_AT_ONCE {
            self.bytes.resize(self.filled + READ_AT_ONCE, 0);
        }
        loop {
            match self.input.read(&mut self.bytes[self.filled..]) {
                Ok(read) => {
                    self.has_ended = read == 0;
                    self.filled += read;
                    return Ok(());
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(RecordError::Io(error)),
            }
        }
    }
}

/// The first eight bytes as a number; where there are fewer, letters stand behind them.
#[inline]
fn eight(bytes: &[u8]) -> u64 {
    u64::from_le_bytes(bytes.first_chunk().copied().unwrap_or_else(|| {
        let mut eight = [b'x'; 8];
        eight[..bytes.len()].copy_from_slice(bytes);
        eight
    }))
}

/// Marks, by its highest bit, each byte that is below `-` or the delimiter. In a table of numbers these are the ends of cells.
#[inline]
fn signs(eight: u64, delimiter: u8) -> u64 {
    const EACH: u64 = 0x0101_0101_0101_0101;
    const HIGHEST: u64 = 0x80 * EACH;
    // The highest bit of a sum is set where the lower seven bits are at least those of `-`. No sum carries into the next byte.
    let others = ((eight & !HIGHEST) + (0x80 - b'-' as u64) * EACH) | eight;
    if delimiter < b'-' {
        return !others & HIGHEST;
    }
    let differs = eight ^ (u64::from(delimiter) * EACH);
    let others_than_it = ((differs & !HIGHEST) + (0x80 - 1) * EACH) | differs;
    !(others & others_than_it) & HIGHEST
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::Rng as _;

    use super::*;
    use crate::slow::Slow;

    type Rows = Vec<Vec<Vec<u8>>>;

    fn rows(text: &[u8], delimiter: u8, at_once: usize) -> (Rows, Vec<u64>, bool) {
        let mut records = Records::new(Box::new(Slow(text.to_vec(), at_once)), delimiter);
        let (mut rows, mut lines, mut has_no_end) = (Vec::new(), Vec::new(), false);
        while records.advance().unwrap() {
            rows.push(records.cells().map(<[u8]>::to_vec).collect());
            lines.push(records.line());
            has_no_end = records.has_no_end();
        }
        (rows, lines, has_no_end)
    }

    /// The same by another reader of the format.
    fn expected(text: &[u8], delimiter: u8) -> Rows {
        let mut reader =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).delimiter(delimiter).from_reader(text);
        reader.byte_records().map(|row| row.unwrap().iter().map(<[u8]>::to_vec).collect()).collect()
    }

    #[test]
    fn any_text_has_the_records_of_another_reader_however_it_comes() {
        const LETTERS: &[u8] = b"12.-e+,,,;;\t\"\"\n\n\n\r\r x\xe4|";
        let mut bits = Pcg64Mcg::new(1);
        let mut random = |below: usize| (bits.next_u64() >> 33) as usize % below;
        for length in 0..800 {
            let text: Vec<u8> = (0..length % 97).map(|_| LETTERS[random(LETTERS.len())]).collect();
            for delimiter in [b',', b';', b'\t', b'|'] {
                let at_once = [1, 2, 7, 1000][random(4)];
                let expected = expected(&text, delimiter);
                let (found, ..) = rows(&text, delimiter, at_once);
                assert_eq!(found, expected, "{:?} by {at_once}", String::from_utf8_lossy(&text));
            }
        }
    }

    #[test]
    fn a_record_knows_its_line_and_whether_the_text_ends_in_it() {
        for at_once in [1, 5, 1000] {
            let text = b"a,b\r\n\r\n1,2\r\n\"x\ny\",3\n\n4,5\r6,7";
            let (_, lines, has_no_end) = rows(text, b',', at_once);
            assert_eq!((lines, has_no_end), (vec![1, 3, 4, 7, 7], true));
            assert!(!rows(b"1,2\n", b',', at_once).2 && !rows(b"1,2\r", b',', at_once).2);
            assert!(rows(b"1,\"2\"", b',', at_once).2 && !rows(b"1,\"2\"\r\n", b',', at_once).2);
        }
    }

    #[test]
    fn the_signs_of_any_bytes_are_those_of_each() {
        for delimiter in [b',', b';', b'|'] {
            for byte in 0..=u8::MAX {
                for at in 0..8 {
                    let mut eight = [b'7'; 8];
                    eight[at] = byte;
                    let is_sign = byte < b'-' || byte == delimiter;
                    let expected = if is_sign { 0x80 << (8 * at) } else { 0 };
                    assert_eq!(signs(u64::from_le_bytes(eight), delimiter), expected, "{byte} at {at}");
                }
            }
        }
    }
}
