//! Lines of PCAN traces of versions 1.0 to 2.1.
//!
//! A version below 2 has fixed columns; from version 2 on `;$COLUMNS=N,O,T,I,d,l,D` names them. Times are in ms from the start of the trace.

use super::frame::{Frame, PAYLOAD};
use super::line::{FD_LENGTHS, Line, id_of, length_with, payload};

/// A column of a line, by its letter in `;$COLUMNS`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    /// `T`: the kind of the message, as DT, FD, RR.
    Kind,
    /// `O`: time, ms.
    Time,
    /// `B`: the bus.
    Bus,
    /// `I`: the identifier.
    Id,
    /// `l`: the number of bytes.
    Length,
    /// `L`: the length code.
    LengthCode,
    /// `N`, `d`, `R` and what else there may be.
    Other,
}

impl Column {
    fn of(letter: &str) -> Self {
        match letter.trim() {
            "O" => Self::Time,
            "T" => Self::Kind,
            "B" => Self::Bus,
            "I" => Self::Id,
            "l" => Self::Length,
            "L" => Self::LengthCode,
            _ => Self::Other,
        }
    }
}

/// The columns of a trace before its data, as its head says them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trc {
    columns: Vec<Column>,
}

impl Trc {
    /// Of a trace without a word about its version: 1.0.
    pub(super) fn new() -> Self {
        Self { columns: columns_of_version("1.0") }
    }

    /// What a line is.
    pub(super) fn line(&mut self, text: &str) -> Line {
        let text = text.trim();
        if let Some(remark) = text.strip_prefix(';') {
            self.remark(remark);
            return Line::Remark;
        }
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.is_empty() {
            return Line::Remark;
        }
        self.frame(&words)
    }

    fn remark(&mut self, remark: &str) {
        let value = |key: &str| remark.trim().strip_prefix(key)?.trim_start().strip_prefix('=').map(str::trim);
        if let Some(version) = value("$FILEVERSION") {
            self.columns = columns_of_version(version);
        }
        if let Some(letters) = value("$COLUMNS") {
            self.columns = letters.split(',').take_while(|letter| letter.trim() != "D").map(Column::of).collect();
        }
    }

    /// The frame of a line; a remark where it is none with data: of an error, a status, or a request for data.
    fn frame(&self, words: &[&str]) -> Line {
        let word = |column: Column| words.get(self.columns.iter().position(|one| *one == column)?).copied();
        let is_fd = match word(Column::Kind) {
            Some("DT" | "Rx" | "Tx") | None => false,
            Some("FD" | "FB" | "FE" | "BI") => true,
            Some("RR" | "ST" | "EC" | "ER" | "EV" | "Warng" | "Error") => return Line::Remark,
            Some(_) => return Line::Unread,
        };
        let data = words.get(self.columns.len()..).unwrap_or_default();
        if data.first() == Some(&"RTR") {
            return Line::Remark;
        }
        let length = || match (word(Column::Length), word(Column::LengthCode)) {
            (Some(length), _) => {
                length.parse().ok().filter(|length| *length <= PAYLOAD).map(|length| length_with(length, data.len()))
            }
            (None, Some(code)) if is_fd => FD_LENGTHS.get(code.parse::<usize>().ok()?).copied(),
            // In base 10, as all numbers of a trace but identifiers and data.
            (None, code) => Some(length_with(code?.parse().ok()?, data.len())),
        };
        let read = || {
            let time_s = 1e-3 * word(Column::Time)?.parse::<f64>().ok().filter(|time_ms| time_ms.is_finite())?;
            let id = word(Column::Id)?;
            let (bytes, length) = payload(data.get(..length()?)?)?;
            let frame = Frame::new(time_s, id_of(id)?, id.len() > 4, bytes.get(..length)?);
            Some(frame.on(word(Column::Bus).and_then(|bus| bus.parse().ok()).unwrap_or(0)))
        };
        read().map_or(Line::Unread, Line::Frame)
    }
}

/// The columns of a version before the data.
fn columns_of_version(version: &str) -> Vec<Column> {
    let letters = match version {
        "1.0" => "N,O,I,l",
        "1.1" => "N,O,T,I,l",
        "1.2" => "N,O,B,T,I,l",
        "1.3" => "N,O,B,T,I,R,l",
        "2.1" => "N,O,T,B,I,d,R,L",
        _ => "N,O,T,I,d,l",
    };
    letters.split(',').map(Column::of).collect()
}
