//! A measured log of any format.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use trace::csv_file::LONGEST_ROW;
use trace::text::{BYTE_ORDER_MARK, Utf16, is_utf16};
use trace::{FileUse, Following, ShownPath as _};

use crate::ahead::Crew;
use crate::arrays::Arrays;
use crate::can::{CanLog, Database};
use crate::columns::{Columns, Stream};
use crate::csv_log::CsvLog;
use crate::mdf::MdfLog;
#[cfg(target_family = "wasm")]
use crate::not_in_browser::ParquetLog;
#[cfg(not(target_family = "wasm"))]
use crate::parquet_log::ParquetLog;
use crate::readings_table::ReadingsTable;
use crate::samples::Samples;
use crate::{CanKind, Channel, Format, LogError, TimeColumn, csv_log, error};

/// What must be known to open some logs.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct OpenOptions {
    /// The DBC with the messages and signals of a CAN log.
    pub dbc: Option<PathBuf>,
    /// Its text, if it is not in that file; then `dbc` is what messages call it.
    pub dbc_text: Option<Arc<[u8]>>,
    /// The time of a table; without it, a column with a usual name.
    pub time: Option<TimeColumn>,
}

impl OpenOptions {
    /// Reads the DBC.
    fn database(&self) -> Result<Option<Database>, LogError> {
        let name = || self.dbc.as_deref().unwrap_or(Path::new("the DBC"));
        match &self.dbc_text {
            Some(text) => Database::of_text(name(), text).map(Some),
            None => self.dbc.as_deref().map(Database::read).transpose(),
        }
    }
}

/// A log: channels, each with its own clock.
pub struct Log {
    path: PathBuf,
    channels: Vec<Channel>,
    source: Source,
    /// Threads that read, with the one that asks.
    threads: usize,
    is_followed: bool,
}

enum Source {
    Csv(Box<CsvLog>),
    Readings(Box<ReadingsTable>),
    Parquet(ParquetLog),
    Mdf(Box<MdfLog>),
    Can(CanLog),
}

/// Where a log is read from.
enum Kind {
    File,
    Pipe,
    Memory(Arc<[u8]>),
    /// A file or pipe that is still being written.
    Growing,
}

/// The warning of a DBC that is given for a log without frames.
pub const NO_FRAMES: &str = "the DBC has no effect: there are no frames of a CAN bus in this log\nhint: leave it out";

/// Bytes that tell the format of a file, and the lines that tell the form of a table.
const HEAD: usize = 64 << 10;

impl Log {
    /// Opens a log; `-` is standard input, which must be CSV or text of a CAN log. The format is told by the first bytes,
    /// not by the name.
    ///
    /// # Errors
    /// The file cannot be read, or is none of the known formats.
    pub fn open(path: &Path, options: &OpenOptions) -> Result<Self, LogError> {
        let (reader, kind): (Box<dyn Read + Send>, _) = match path.to_str() {
            Some("-") => (Box::new(io::stdin()), Kind::Pipe),
            _ => (Box::new(File::open(path).map_err(LogError::io(path))?), Kind::File),
        };
        trace::file_used(FileUse::Read, path);
        Self::of(path, options, reader, kind)
    }

    /// Opens a log that is still being written: CSV or text of a CAN log. Its samples come as its lines do, until `stop` is
    /// set or its pipe ends.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn follow(path: &Path, options: &OpenOptions, stop: Arc<AtomicBool>) -> Result<Self, LogError> {
        let reader = Following::open(path, stop).map_err(LogError::io(path))?;
        Self::of(path, options, Box::new(reader), Kind::Growing)
    }

    /// Opens a log whose bytes are in memory; `path` is what messages call it.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn of_bytes(path: &Path, options: &OpenOptions, bytes: Arc<[u8]>) -> Result<Self, LogError> {
        let reader = Box::new(io::Cursor::new(Arc::clone(&bytes)));
        Self::of(path, options, reader, Kind::Memory(bytes))
    }

    /// Opens a log whose text comes from elsewhere, as from a pipe; `path` is what messages call it.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn of_text(path: &Path, options: &OpenOptions, text: Box<dyn Read + Send>) -> Result<Self, LogError> {
        Self::of(path, options, text, Kind::Pipe)
    }

    fn of(path: &Path, options: &OpenOptions, reader: Box<dyn Read + Send>, from: Kind) -> Result<Self, LogError> {
        let (head, reader) = beginning(path, reader)?;
        let database = options.database()?;
        let is_followed = matches!(from, Kind::Growing);
        let (source, channels) = match Format::of(&head) {
            Format::Mdf | Format::Parquet | Format::Can(CanKind::Blf) if is_followed => {
                return Err(LogError::file(
                    path,
                    "MDF, Parquet and BLF files cannot be followed while they are written\nhint: follow CSV or a bus log as text; read this file when it is complete",
                ));
            }
            Format::Mdf if !matches!(from, Kind::Pipe) => {
                let memory = if let Kind::Memory(bytes) = &from { Some(bytes) } else { None };
                let opened = MdfLog::open(path, memory, database, options.time.as_ref());
                opened.map(|(log, channels)| (Source::Mdf(Box::new(log)), channels))?
            }
            Format::Parquet if matches!(from, Kind::File) => {
                ParquetLog::open(path, options.time.as_ref()).map(|(log, channels)| (Source::Parquet(log), channels))?
            }
            Format::Parquet if matches!(from, Kind::Memory(_)) => {
                return Err(LogError::file(
                    path,
                    "Parquet logs are not read from memory, as in a browser\nhint: save the channels as CSV or MDF 4 with `wetclutch convert`, or give the file to the program",
                ));
            }
            Format::Mdf | Format::Parquet => {
                return Err(LogError::file(
                    path,
                    "MDF and Parquet files cannot be read from a pipe\nhint: give the file itself",
                ));
            }
            Format::NotRead(why) => return Err(LogError::file(path, why)),
            Format::Can(kind) => {
                let database = database.ok_or_else(|| {
                    LogError::file(
                        path,
                        "a CAN log has frames; a DBC defines the signals in them\nhint: give it with --dbc",
                    )
                })?;
                let channels = database.channels().to_vec();
                (Source::Can(CanLog::new(path, kind, head, reader, database, is_followed)), channels)
            }
            Format::Readings => ReadingsTable::open(path, head, reader, is_followed)
                .map(|(log, channels)| (Source::Readings(Box::new(log)), channels))?,
            Format::Csv => CsvLog::open(path, head, reader, options.time.as_ref(), is_followed)
                .map(|(log, channels)| (Source::Csv(Box::new(log)), channels))?,
        };
        let mut log = Self { path: path.to_owned(), channels, source, threads: 1, is_followed };
        if options.dbc.is_some() && !log.has_frames() {
            log.note(NO_FRAMES);
        }
        Ok(log)
    }

    /// Whether it is still being written.
    pub(crate) fn is_followed(&self) -> bool {
        self.is_followed
    }

    /// Whether its signals are those of a CAN bus, and no DBC says which they are.
    pub fn lacks_dbc(&self) -> bool {
        matches!(&self.source, Source::Mdf(log) if log.lacks_dbc())
    }

    /// Whether there are frames of a CAN bus in it.
    fn has_frames(&self) -> bool {
        match &self.source {
            Source::Csv(_) | Source::Readings(_) | Source::Parquet(_) => false,
            Source::Mdf(log) => log.has_frames(),
            Source::Can(_) => true,
        }
    }

    /// Adds a note.
    fn note(&mut self, note: &str) {
        match &mut self.source {
            Source::Csv(log) => log.note(note),
            Source::Parquet(log) => log.note(note),
            Source::Mdf(log) => log.note(note),
            Source::Can(_) | Source::Readings(_) => {}
        }
    }

    /// Lets so many threads read [`Self::samples`] and [`Self::columns`]: the one that asks, and others that unpack the blocks of an MDF
    /// file ahead, at most 32 MiB of them. They start with the second block of a clock, and end with the log. What is read is the same with
    /// any number; without this it is one.
    pub fn on_threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// Where it was read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its channels, the time itself left out.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Its format, in words.
    pub fn format(&self) -> String {
        match &self.source {
            Source::Csv(log) => log.format(),
            Source::Readings(_) => "CSV, a reading in each row".to_owned(),
            Source::Parquet(_) => "Parquet".to_owned(),
            Source::Mdf(log) => log.format(),
            Source::Can(log) => log.format().to_owned(),
        }
    }

    /// The samples of these channels, all in time order. Tables and bus logs are read once: a second call is an error.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn samples(&mut self, wanted: &[usize]) -> Result<Samples<'_>, LogError> {
        let count = self.channels.len();
        Samples::new(count, self.streams(wanted)?)
    }

    /// These channels in columns, as they stand in the file: not merged, and with its time stamps. Several times as fast as
    /// [`Self::samples`] where the file has columns (MDF, Parquet). Tables and bus logs are read once: a second call is an error.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn columns(&mut self, wanted: &[usize]) -> Result<Columns<'_>, LogError> {
        Ok(Columns::new(self.streams(wanted)?))
    }

    /// These channels as whole arrays, as they stand in the file: not merged, and with its time stamps. The clocks of an MDF file are read
    /// on at most `threads` threads, which unpack blocks for each other; other formats have one clock, and are read on this one. Tables and bus logs are read once: a
    /// second call is an error.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn arrays(&mut self, wanted: &[usize], threads: usize) -> Result<Arrays, LogError> {
        let mask = self.mask(wanted);
        match &mut self.source {
            Source::Mdf(log) => {
                log.unpack_with(Crew::of_readers(threads));
                Arrays::on_threads(log.streams(&mask)?, threads, log.crew())
            }
            _ => Arrays::of(self.streams(wanted)?),
        }
    }

    /// Which channels are wanted.
    fn mask(&self, wanted: &[usize]) -> Vec<bool> {
        let mut mask = vec![false; self.channels.len()];
        for &channel in wanted {
            mask[channel] = true;
        }
        mask
    }

    fn streams(&mut self, wanted: &[usize]) -> Result<Vec<Box<dyn Stream + '_>>, LogError> {
        let mask = self.mask(wanted);
        Ok(match &mut self.source {
            Source::Csv(log) => vec![log.stream(&mask)?],
            Source::Readings(log) => vec![log.stream(&mask)?],
            Source::Parquet(log) => vec![log.stream(&mask)?],
            Source::Mdf(log) => {
                log.unpack_with(Crew::of(self.threads));
                log.streams(&mask)?
            }
            Source::Can(log) => vec![log.stream(&mask)?],
        })
    }

    /// The place of the channel with this name. `group` chooses between several; a name may also be `group.name`.
    ///
    /// # Errors
    /// There is none, or several.
    pub fn find(&self, name: &str, group: Option<&str>) -> Result<usize, LogError> {
        let same = |channel: &Channel| match group {
            Some(group) => channel.name == name && channel.group == group,
            None => {
                channel.name == name
                    || name
                        .strip_prefix(&*channel.group)
                        .is_some_and(|rest| rest.strip_prefix('.') == Some(&channel.name))
            }
        };
        let found: Vec<usize> = (0..self.channels.len()).filter(|&i| same(&self.channels[i])).collect();
        match found[..] {
            [one] => Ok(one),
            [] => Err(LogError::map(format!(
                "{}: there is no channel `{}`{}\nhint: {}",
                self.path.shown(),
                error::shown(name),
                group.map_or(String::new(), |group| format!(" in group `{}`", error::shown(group))),
                self.nearest(name)
            ))),
            _ => Err(LogError::map(format!(
                "{}: there are {} channels `{}`\nhint: {}",
                self.path.shown(),
                found.len(),
                error::shown(name),
                self.distinguished(&found)
            ))),
        }
    }

    /// How channels with the same name are told apart.
    fn distinguished(&self, found: &[usize]) -> String {
        let group = |i: &usize| self.channels[*i].group.as_str();
        let is_alone = |i: &&usize| found.iter().filter(|other| group(other) == group(i)).count() == 1;
        let groups: Vec<String> =
            found.iter().filter(is_alone).take(8).map(|i| format!("group = \"{}\"", error::shown(group(i)))).collect();
        if groups.is_empty() {
            return "the log has nothing to distinguish them: rename one of them".to_owned();
        }
        format!("choose one by its group in the channel map: {}", groups.join(" or "))
    }

    /// Names a channel with a similar name, or some channels.
    fn nearest(&self, name: &str) -> String {
        // One letter of three may be wrong, or stand before its neighbour.
        const ALIKE: f64 = 2.0 / 3.0;
        if let Source::Mdf(log) = &self.source
            && log.lacks_dbc()
        {
            return "the signals of its CAN frames are known only with a DBC: give it with --dbc".to_owned();
        }
        let wanted = name.to_lowercase();
        let similar = |channel: &&Channel| {
            let name = channel.name.to_lowercase();
            name.contains(&wanted) || (!name.is_empty() && wanted.contains(&name))
        };
        // As an abbreviation, whose letters stand in the name in their order.
        let is_short_for = |channel: &&Channel| {
            let mut letters = channel.name.chars().flat_map(char::to_lowercase);
            wanted.chars().count() > 2 && wanted.chars().all(|wanted| letters.any(|letter| letter == wanted))
        };
        let alike = || {
            let likeness =
                |channel: &Channel| strsim::normalized_damerau_levenshtein(&channel.name.to_lowercase(), &wanted);
            let all = self.channels.iter().map(|channel| (likeness(channel), channel));
            all.filter(|(likeness, _)| *likeness >= ALIKE).max_by(|one, other| one.0.total_cmp(&other.0))
        };
        let all = || self.channels.iter();
        if let Some(channel) = all().find(similar).or_else(|| all().find(is_short_for)).or_else(|| Some(alike()?.1)) {
            return format!("`{}` has a similar name", error::shown(&channel.name));
        }
        const MAXIMUM: usize = 12;
        let names: Vec<String> =
            self.channels.iter().take(MAXIMUM).map(|channel| error::shown(&channel.name)).collect();
        match self.channels.len() {
            0 => "the log has no channels".to_owned(),
            more if more > MAXIMUM => format!("the channels are {} and {} more", names.join(", "), more - MAXIMUM),
            _ => format!("the channels are {}", names.join(", ")),
        }
    }
}

/// Whether a regular file is of a format that needs a channel map, by its first bytes.
///
/// # Errors
/// The file cannot be read, or is of a format that is known and not read.
pub fn needs_map(path: &Path) -> Result<bool, LogError> {
    let io = LogError::io(path);
    // A pipe is opened once.
    if !path.metadata().map_err(&io)?.is_file() {
        return Ok(false);
    }
    format_needs_map(path, Box::new(File::open(path).map_err(&io)?))
}

/// The same of a log whose bytes are in memory; `path` is what messages call it.
///
/// # Errors
/// See [`needs_map`].
pub fn bytes_need_map(path: &Path, bytes: &Arc<[u8]>) -> Result<bool, LogError> {
    format_needs_map(path, Box::new(io::Cursor::new(Arc::clone(bytes))))
}

fn format_needs_map(path: &Path, reader: Box<dyn Read + Send>) -> Result<bool, LogError> {
    match Format::of(&beginning(path, reader)?.0) {
        Format::NotRead(why) => Err(LogError::file(path, why)),
        format => Ok(format != Format::Csv),
    }
}

/// The first bytes of a log and what comes behind them, as UTF-8 without a mark where it is text.
fn beginning(path: &Path, mut reader: Box<dyn Read + Send>) -> Result<(Vec<u8>, Box<dyn Read + Send>), LogError> {
    let io = LogError::io(path);
    let mut head = first_bytes(&mut reader).map_err(&io)?;
    if is_utf16(&head) {
        reader = Box::new(Utf16::new(head, reader));
        head = first_bytes(&mut reader).map_err(&io)?;
    }
    if head.starts_with(BYTE_ORDER_MARK) {
        head.drain(..BYTE_ORDER_MARK.len());
    }
    if head.is_empty() {
        return Err(LogError::file(path, "the file is empty\nhint: copy it again from the recorder"));
    }
    if head.len() > LONGEST_ROW && !head.iter().any(|byte| matches!(byte, b'\n' | b'\r' | 0)) {
        return Err(csv_log::too_long(path, 1));
    }
    Ok((head, reader))
}

/// The first bytes of a file, or of a pipe as far as it has come: at least its first lines. Where lines are long, as many more as names,
/// units and a row take.
fn first_bytes(reader: &mut dyn Read) -> io::Result<Vec<u8>> {
    const LINES: usize = 50;
    const LONG_LINES: usize = 3;
    const MAXIMUM: usize = LONG_LINES * LONGEST_ROW;
    let (mut head, mut lines, mut long_lines, mut is_text) = (Vec::new(), 0, 0, true);
    let mut bytes = vec![0; HEAD];
    let maximum = |lines: usize, is_text: bool| match () {
        () if !is_text => HEAD,
        // One byte more shows that the first line is too long.
        () if lines == 0 => LONGEST_ROW + 1,
        () => MAXIMUM,
    };
    while lines < LINES && long_lines < LONG_LINES && head.len() < maximum(lines, is_text) {
        match reader.read(&mut bytes) {
            Ok(0) => break,
            Ok(read) => {
                let new = bytes[..read].iter().filter(|&&byte| byte == b'\n').count();
                lines += new;
                long_lines += if head.len() >= HEAD { new } else { 0 };
                is_text &= !bytes[..read].contains(&0);
                head.extend_from_slice(&bytes[..read]);
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(head)
}
