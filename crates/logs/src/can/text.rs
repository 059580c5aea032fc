//! CAN logs as text: candump and ASC; lines of [PCAN traces](super::trc), [SavvyCAN](super::savvy) and [python-can](super::python_can) have files of their
//! own.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::frame::{Frame, Frames, PAYLOAD};
use super::line::{Line, classic_length};
use super::python_can;
use super::savvy::Savvy;
use super::trc::Trc;
use crate::CanKind;
use crate::stamp::StampForm;
use crate::{LogError, error};

/// Longest line that is read, bytes.
const LONGEST_LINE: u64 = 4096;
/// The flag of a candump identifier that marks an error of the bus.
const ERROR_FRAME: u32 = 0x2000_0000;

/// The lines of a log. A line that is no frame and no known remark is counted.
pub(crate) struct Lines {
    path: PathBuf,
    kind: CanKind,
    input: BufReader<Box<dyn Read + Send>>,
    line: Vec<u8>,
    number: u64,
    frames: u64,
    unread: u64,
    first_unread: Option<String>,
    /// Whether a frame in a last line without an end was left out.
    is_cut: bool,
    /// ASC: identifiers and data are hexadecimal.
    hex: bool,
    /// ASC: times count from the frame before.
    relative: bool,
    time_s: f64,
    /// The last time stamp, s, and how many were above and below the one before.
    last_s: f64,
    rising: u64,
    falling: u64,
    /// Names of the interfaces (candump).
    interfaces: Vec<String>,
    /// Columns of a PCAN trace, and of SavvyCAN.
    trc: Trc,
    savvy: Savvy,
}

impl Lines {
    pub(crate) fn new(path: &Path, kind: CanKind, input: Box<dyn Read + Send>) -> Self {
        Self {
            path: path.to_owned(),
            kind,
            input: BufReader::new(input),
            line: Vec::new(),
            number: 0,
            frames: 0,
            unread: 0,
            first_unread: None,
            is_cut: false,
            hex: true,
            relative: false,
            time_s: 0.0,
            last_s: f64::NAN,
            rising: 0,
            falling: 0,
            interfaces: Vec::new(),
            trc: Trc::new(),
            savvy: Savvy::default(),
        }
    }

    /// Reads a line; false at the end.
    fn read(&mut self) -> Result<bool, LogError> {
        self.line.clear();
        let read =
            (&mut self.input).take(LONGEST_LINE).read_until(b'\n', &mut self.line).map_err(LogError::io(&self.path))?;
        // What goes on beyond is another line, which is no frame.
        self.number += 1;
        Ok(read > 0)
    }

    /// `(STAMP) INTERFACE ID#DATA`, or what candump prints without -l: `(STAMP) INTERFACE [RX FLAGS] ID [LENGTH] DATA...`
    fn candump(&mut self, text: &str) -> Line {
        let is_remark = text.trim().is_empty() || text.contains("#R") || text.contains("remote request");
        match self.candump_frame(text) {
            // The kernel gives errors of the bus as frames with this bit.
            Some((id, _)) if id & ERROR_FRAME != 0 => Line::Remark,
            Some((_, frame)) => Line::Frame(frame),
            None if is_remark => Line::Remark,
            None => Line::Unread,
        }
    }

    /// The identifier with its flags, and the frame.
    fn candump_frame(&mut self, text: &str) -> Option<(u32, Frame)> {
        let (stamp, rest) = text.trim().strip_prefix('(')?.split_once(')')?;
        let time_s = match stamp.trim().parse::<f64>() {
            Ok(time_s) => time_s,
            // -t A
            Err(_) => StampForm::of(stamp)?.seconds(stamp)?,
        };
        let mut words = rest.split_whitespace();
        let interface = words.next()?;
        let mut id = words.next()?;
        let (id, payload) = match id.split_once('#') {
            Some((id, data)) => {
                // `ID##F` is CAN FD with one digit of flags; `ID#R` asks for data; `_9` is a length beyond the eight bytes.
                let data = match data.strip_prefix('#') {
                    Some(fd) => fd.get(1..)?,
                    None => data,
                };
                (id, data.split_once('_').map_or(data, |(data, _)| data).to_owned())
            }
            None => {
                // Direction and flags (-x) stand before the identifier.
                let length = loop {
                    match words.next()? {
                        length if length.starts_with(['[', '{']) => break length,
                        word => id = word,
                    }
                };
                // A code of the length above eight (-8) stands in other brackets.
                let length: usize = match length.strip_prefix('{') {
                    Some(code) => classic_length(code.strip_suffix('}')?)?,
                    None => length.strip_prefix('[')?.strip_suffix(']')?.parse().ok()?,
                };
                // Behind the data may stand its letters (-a).
                (id, words.take(length).collect())
            }
        };
        if !id.bytes().all(|byte| byte.is_ascii_hexdigit()) || id.len() > 8 {
            return None;
        }
        let (mut data, length) = ([0; PAYLOAD], payload.len() / 2);
        if payload.len() % 2 != 0 || length > PAYLOAD || !payload.is_ascii() {
            return None;
        }
        for (i, byte) in data.iter_mut().take(length).enumerate() {
            *byte = u8::from_str_radix(&payload[2 * i..2 * i + 2], 16).ok()?;
        }
        let number = u32::from_str_radix(id, 16).ok()?;
        let frame = Frame::new(time_s, number & 0x1fff_ffff, id.len() > 3, &data[..length]);
        time_s.is_finite().then(|| (number, frame.on(self.bus(interface))))
    }

    /// The number of an interface: in the order in which they come, from zero.
    fn bus(&mut self, interface: &str) -> u32 {
        const MAXIMUM: usize = 256;
        let known = self.interfaces.iter().position(|known| known == interface);
        let at = known.unwrap_or_else(|| {
            if self.interfaces.len() < MAXIMUM {
                self.interfaces.push(interface.to_owned());
            }
            self.interfaces.len() - 1
        });
        u32::try_from(at).unwrap_or(u32::MAX)
    }

    /// Counts time stamps that rise and that fall.
    fn watch(&mut self, time_s: f64) {
        self.rising += u64::from(time_s > self.last_s);
        self.falling += u64::from(time_s < self.last_s);
        self.last_s = time_s;
    }

    fn asc(&mut self, text: &str) -> Line {
        let lower = text.trim().to_lowercase();
        if lower.starts_with("base ") {
            self.hex = !lower.starts_with("base dec");
            self.relative = lower.contains("timestamps relative");
            return Line::Remark;
        }
        let mut words = text.split_whitespace();
        let Some(stamp) = words.next().and_then(|word| word.parse::<f64>().ok()).filter(|stamp| stamp.is_finite())
        else {
            // Dates, comments, `Begin Triggerblock`.
            return Line::Remark;
        };
        self.time_s = if self.relative { self.time_s + stamp } else { stamp };
        let words: Vec<&str> = words.collect();
        let frame = match words[..] {
            // Times of triggers, `Start of measurement`, statistics and error frames.
            [] => return Line::Remark,
            ["CANFD", ..] => self.asc_fd(&words[1..]),
            [channel, _, direction, kind, ..]
                if channel.parse::<u32>().is_ok() && matches!(direction, "Rx" | "Tx" | "TxRq") && kind == "d" =>
            {
                self.asc_classic(&words)
            }
            _ => return Line::Remark,
        };
        frame.map_or(Line::Unread, Line::Frame)
    }

    fn radix(&self) -> u32 {
        if self.hex { 16 } else { 10 }
    }

    /// `CHANNEL ID Rx d LENGTH DATA...`
    fn asc_classic(&self, words: &[&str]) -> Option<Frame> {
        let (id, extended) = self.asc_id(words.get(1)?)?;
        let length = classic_length(words.get(4)?)?;
        let frame = self.asc_data(id, extended, words.get(5..5 + length)?)?;
        Some(frame.on(words.first()?.parse().ok()?))
    }

    /// `CHANNEL Rx ID [NAME] BRS ESI DLC LENGTH DATA...`
    fn asc_fd(&self, words: &[&str]) -> Option<Frame> {
        let (id, extended) = self.asc_id(words.get(2)?)?;
        // A name of the message may stand between; the first 0 or 1 is the bit-rate switch.
        let switch = (3..words.len().min(5)).find(|&i| matches!(words[i], "0" | "1"))?;
        let length: usize = words.get(switch + 3)?.parse().ok().filter(|length| *length <= PAYLOAD)?;
        let frame = self.asc_data(id, extended, words.get(switch + 4..switch + 4 + length)?)?;
        Some(frame.on(words.first()?.parse().ok()?))
    }

    fn asc_id(&self, word: &str) -> Option<(u32, bool)> {
        let (digits, extended) = match word.strip_suffix(['x', 'X']) {
            Some(digits) => (digits, true),
            None => (word, false),
        };
        u32::from_str_radix(digits, self.radix()).ok().filter(|id| *id <= 0x1fff_ffff).map(|id| (id, extended))
    }

    fn asc_data(&self, id: u32, extended: bool, words: &[&str]) -> Option<Frame> {
        let mut data = [0; PAYLOAD];
        for (byte, word) in data.iter_mut().zip(words) {
            *byte = u8::from_str_radix(word, self.radix()).ok()?;
        }
        Some(Frame::new(self.time_s, id, extended, data.get(..words.len())?))
    }
}

impl Frames for Lines {
    fn next_frame(&mut self) -> Result<Option<Frame>, LogError> {
        while self.read()? {
            let text = String::from_utf8_lossy(&self.line).into_owned();
            let line = match self.kind {
                CanKind::Asc => self.asc(&text),
                CanKind::Trc => self.trc.line(&text),
                CanKind::Savvy => self.savvy.line(&text),
                CanKind::PythonCan => python_can::line(&text),
                _ => self.candump(&text),
            };
            // Of a last line without an end digits or bytes may be missing.
            let has_no_end = !self.line.ends_with(b"\n") && (self.line.len() as u64) < LONGEST_LINE;
            match line {
                Line::Frame(_) | Line::Unread if has_no_end => self.is_cut = true,
                Line::Frame(frame) => {
                    self.frames += 1;
                    self.watch(frame.time_s);
                    return Ok(Some(frame));
                }
                Line::Remark => {}
                Line::Unread => {
                    self.unread += 1;
                    if self.first_unread.is_none() {
                        self.first_unread = Some(format!("line {}: `{}`", self.number, error::shown(text.trim())));
                    }
                }
            }
        }
        match &self.first_unread {
            Some(first) if self.unread > self.frames => Err(LogError::file(
                &self.path,
                format!(
                    "{} lines are no frames and {} are, the first that is none is {first}\nhint: record the trace with candump -L, or as ASC, BLF or PCAN trace",
                    self.unread, self.frames
                ),
            )),
            _ if self.frames == 0 && self.is_cut => Err(LogError::file(
                &self.path,
                "the only data frame is in a last line without an end\nhint: the recording was cut; record again",
            )),
            _ if self.frames == 0 => Err(LogError::file(
                &self.path,
                "there are no data frames\nhint: check that the bus was active and the recorder connected",
            )),
            _ => Ok(None),
        }
    }

    fn notes(&self) -> Vec<String> {
        let note =
            |first: &String| format!("{} lines are no frames and are left out, the first is {first}", self.unread);
        let mut notes: Vec<String> = self.first_unread.iter().map(note).collect();
        if self.is_cut {
            notes.push("the last line has no end and is left out".to_owned());
        }
        // Of times between frames nearly half are less than the one before, or all are the same; of stamps in two orders, few are.
        if 4 * self.falling > self.frames || self.rising == 0 && self.frames > 1 {
            notes.push(
                "the time stamps do not rise: they may be the times between frames (candump -t d)\nhint: log with `candump -L` or `-t a`"
                    .to_owned(),
            );
        }
        notes
    }
}
