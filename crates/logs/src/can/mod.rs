//! CAN logs: frames from candump, ASC, BLF, PCAN, SavvyCAN and python-can files, and the signals that a DBC finds in them.

mod bits;
mod blf;
mod database;
mod frame;
mod j1939;
mod line;
mod names;
mod python_can;
mod savvy;
mod text;
mod trc;

use std::collections::{BTreeMap, HashMap};
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};

pub use database::Database;
pub(crate) use frame::{Frame, Frames};

use self::blf::Blf;
use self::database::Found;
use crate::CanKind;
use crate::LogError;
use crate::columns::{Batch, Stream};
use crate::samples::Sample;

/// A CAN log that has not been read yet.
pub(crate) struct CanLog {
    path: PathBuf,
    kind: CanKind,
    input: Option<Box<dyn Read + Send>>,
    database: Database,
    /// Frames in a batch: one where each is wanted as it comes.
    batch: usize,
}

impl CanLog {
    pub(crate) fn new(
        path: &Path,
        kind: CanKind,
        head: Vec<u8>,
        rest: Box<dyn Read + Send>,
        database: Database,
        is_followed: bool,
    ) -> Self {
        const FRAMES: usize = 64;
        let input: Box<dyn Read + Send> = Box::new(Cursor::new(head).chain(rest));
        let batch = if is_followed { 1 } else { FRAMES };
        Self { path: path.to_owned(), kind, input: Some(input), database, batch }
    }

    pub(crate) fn format(&self) -> &'static str {
        match self.kind {
            CanKind::Candump => "CAN log (candump)",
            CanKind::Asc => "CAN log (ASC)",
            CanKind::Blf => "CAN log (BLF)",
            CanKind::Trc => "CAN log (PCAN trace)",
            CanKind::Savvy => "CAN log (SavvyCAN)",
            CanKind::PythonCan => "CAN log (python-can)",
        }
    }

    pub(crate) fn stream(&mut self, wanted: &[bool]) -> Result<Box<dyn Stream + '_>, LogError> {
        let Some(input) = self.input.take() else {
            return Err(LogError::file(&self.path, "the log was read already"));
        };
        Ok(Box::new(Signals {
            frames: frames(&self.path, self.kind, input)?,
            decoder: Decoder::new(&self.database, wanted),
            batch: self.batch,
        }))
    }
}

fn frames(path: &Path, kind: CanKind, input: Box<dyn Read + Send>) -> Result<Box<dyn Frames>, LogError> {
    Ok(match kind {
        CanKind::Blf => Box::new(Blf::open(path, input)?),
        _ => Box::new(text::Lines::new(path, kind, input)),
    })
}

/// The signals of the frames of a log.
struct Signals<'a> {
    frames: Box<dyn Frames>,
    decoder: Decoder<'a>,
    batch: usize,
}

impl Stream for Signals<'_> {
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
        for _ in 0..self.batch {
            let Some(frame) = self.frames.next_frame()? else { return Ok(false) };
            self.decoder.decode(&frame, &mut batch.samples);
        }
        Ok(true)
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.frames.notes();
        notes.extend(self.decoder.notes());
        notes
    }
}

/// A database, the signals that are wanted, and what it did not know.
pub(crate) struct Decoder<'a> {
    database: &'a Database,
    wanted: Vec<bool>,
    frames: u64,
    /// Frames of each identifier that the database does not have.
    unknown: BTreeMap<(bool, u32), u64>,
    unknown_frames: u64,
    /// The bus of the first frame of each message, and the message that came on another one too.
    buses: HashMap<(bool, u32), u32>,
    on_two_buses: Option<(bool, u32)>,
    /// The control unit that sends each parameter group first, and the first group that another one sends too.
    sources: HashMap<u32, u32>,
    other_source: Option<(u32, [u32; 2])>,
}

impl<'a> Decoder<'a> {
    pub(crate) fn new(database: &'a Database, wanted: &[bool]) -> Self {
        Self {
            database,
            wanted: wanted.to_vec(),
            frames: 0,
            unknown: BTreeMap::new(),
            unknown_frames: 0,
            buses: HashMap::new(),
            on_two_buses: None,
            sources: HashMap::new(),
            other_source: None,
        }
    }

    pub(crate) fn decode(&mut self, frame: &Frame, batch: &mut Vec<Sample>) {
        const MAXIMUM: usize = 4096;
        self.frames += 1;
        let key = (frame.extended, frame.id);
        let Some(found) = self.database.find(frame) else {
            self.unknown_frames += 1;
            let known = self.unknown.len();
            if let Some(count) = self.unknown.get_mut(&key) {
                *count += 1;
            } else if known < MAXIMUM {
                self.unknown.insert(key, 1);
            }
            return;
        };
        if !self.is_first_source(found, frame) {
            return;
        }
        self.database.decode(found, frame, &self.wanted, batch);
        if self.on_two_buses.is_none() {
            self.on_two_buses = Some(key).filter(|_| *self.buses.entry(key).or_insert(frame.bus) != frame.bus);
        }
    }

    /// Whether a frame is of the control unit that sends its parameter group first, where it is known by that.
    fn is_first_source(&mut self, found: Found, frame: &Frame) -> bool {
        let Found::Group(_) = found else { return true };
        let (group, source) = (j1939::parameter_group(frame.id), j1939::source(frame.id));
        let first = *self.sources.entry(group).or_insert(source);
        if first != source && self.other_source.is_none() {
            self.other_source = Some((group, [first, source]));
        }
        first == source
    }

    pub(crate) fn notes(&self) -> Vec<String> {
        const SHOWN: usize = 8;
        let mixed = |key| {
            format!(
                "message {} comes on two buses, whose values are mixed\nhint: write the frames of one bus to a file of their own",
                shown(key)
            )
        };
        let of_others = |(group, [first, other]): (u32, [u32; 2])| {
            format!(
                "parameter group {group} comes from several control units: that of the first one, 0x{first:02X}, is read, and not that of 0x{other:02X}\n\
                 hint: for another one give the message the identifier of its frames in the DBC"
            )
        };
        let mut notes: Vec<String> = self.database.notes().chain(self.on_two_buses.map(mixed)).collect();
        notes.extend(self.other_source.map(of_others));
        if self.unknown_frames == 0 {
            return notes;
        }
        let mut maximum: Vec<_> = self.unknown.iter().collect();
        maximum.sort_by_key(|(id, count)| (std::cmp::Reverse(**count), **id));
        let ids = maximum.iter().take(SHOWN).map(|(key, _)| shown(**key));
        notes.push(format!(
            "{} of {} frames, of {} identifiers, {NOT_IN_DBC}: {}{}",
            self.unknown_frames,
            self.frames,
            self.unknown.len(),
            ids.collect::<Vec<_>>().join(", "),
            if self.unknown.len() > SHOWN { ", ..." } else { "" }
        ));
        notes
    }
}

/// Words of the note about frames that no message of the DBC describes.
pub const NOT_IN_DBC: &str = "are not in the DBC";

/// An identifier as messages show it, and whether it is an extended one.
fn shown((extended, id): (bool, u32)) -> String {
    if extended { format!("0x{id:08X}") } else { format!("0x{id:03X}") }
}
