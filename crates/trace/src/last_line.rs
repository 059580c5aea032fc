//! A last line without an end may have been cut: within a number, nothing else shows it.
//!
//! With fewer cells than the first line, the line is left out; else its last cell is emptied.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes that are read at once.
const READ_AT_ONCE: usize = 64 << 10;
/// Longest line that is held back, bytes.
const LONGEST_LINE: usize = 32 << 20;

/// Gives the lines of a comma-separated text, without what may be cut of a last line without an end.
pub struct LastLine {
    input: Box<dyn Read>,
    /// Bytes that came, up to `filled`: those before `given` were given, those before `whole` are of whole lines.
    bytes: Vec<u8>,
    filled: usize,
    given: usize,
    whole: usize,
    ended: bool,
    /// Commas in the first line, which has the names of the columns; none before it has come.
    commas: Option<usize>,
    was_cut: Arc<AtomicBool>,
}

impl LastLine {
    /// The lines of a text. The flag is set when something was taken out.
    pub fn new(input: Box<dyn Read>) -> (Self, Arc<AtomicBool>) {
        let was_cut = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&was_cut);
        let (filled, given, whole) = (0, 0, 0);
        (Self { input, bytes: Vec::new(), filled, given, whole, ended: false, commas: None, was_cut: flag }, was_cut)
    }

    /// Reads more, until there is a whole line or the end.
    fn refill(&mut self) -> io::Result<()> {
        self.bytes.copy_within(self.given..self.filled, 0);
        self.filled -= self.given;
        (self.given, self.whole) = (0, 0);
        while self.whole == 0 && !self.ended {
            let before = self.filled;
            if self.bytes.len() < before + READ_AT_ONCE {
                self.bytes.resize(before + READ_AT_ONCE, 0);
            }
            let read = self.input.read(&mut self.bytes[before..])?;
            self.filled += read;
            let came = &self.bytes[..self.filled];
            if read == 0 {
                self.ended = true;
                if let Some(names) = self.commas {
                    self.take_back(names);
                }
                self.whole = self.filled;
            } else {
                let end = came[before..].iter().rposition(|byte| matches!(byte, b'\n' | b'\r'));
                self.whole = end.map_or(0, |end| before + end + 1);
                if self.commas.is_none() && self.whole > 0 {
                    let first = came.split(|byte| matches!(byte, b'\n' | b'\r')).next();
                    self.commas = first.map(commas);
                }
                if self.filled > LONGEST_LINE {
                    self.whole = self.filled;
                }
            }
        }
        Ok(())
    }

    /// Takes what may be cut out of a last line without an end.
    fn take_back(&mut self, names: usize) {
        let last_line = &mut self.bytes[..self.filled];
        if last_line.is_empty() {
            return;
        }
        self.was_cut.store(true, Ordering::Relaxed);
        let last = last_line.iter().rposition(|byte| *byte == b',');
        match last.filter(|_| commas(last_line) >= names) {
            None => self.filled = 0,
            Some(comma) => {
                // There is room for more than the line.
                self.bytes[comma + 1] = b'\n';
                self.filled = comma + 2;
            }
        }
    }
}

fn commas(line: &[u8]) -> usize {
    line.iter().filter(|byte| **byte == b',').count()
}

impl Read for LastLine {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.given == self.whole && !self.ended {
            self.refill()?;
        }
        let count = buffer.len().min(self.whole - self.given);
        buffer[..count].copy_from_slice(&self.bytes[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slow::Slow;

    fn lines(text: &str, at_once: usize) -> (String, bool) {
        let (mut lines, was_cut) = LastLine::new(Box::new(Slow(text.as_bytes().to_vec(), at_once)));
        let mut given = String::new();
        lines.read_to_string(&mut given).unwrap();
        (given, was_cut.load(Ordering::Relaxed))
    }

    #[test]
    fn only_a_last_line_without_an_end_loses_what_may_be_cut() {
        for at_once in [1, 3, 1000] {
            let cases = [
                ("a,b\n1,2\n3,4\n", "a,b\n1,2\n3,4\n", false),
                ("a,b\n1,2\n3,4", "a,b\n1,2\n3,\n", true),
                ("a,b\r\n1,2\r\n3,4\r", "a,b\r\n1,2\r\n3,4\r", false),
                ("a,b\n1,2\n3", "a,b\n1,2\n", true),
                ("a,b", "a,b", false),
                ("", "", false),
            ];
            for (text, expected, was_cut) in cases {
                assert_eq!(lines(text, at_once), (expected.to_owned(), was_cut), "{text:?} by {at_once}");
            }
        }
    }
}
