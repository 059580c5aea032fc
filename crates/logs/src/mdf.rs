//! ASAM MDF 4, through `falcon_mdf`: each channel group is a stream with its own clock.

use std::path::{Path, PathBuf};

use falcon_mdf::blocks::channel::ChannelType;
use falcon_mdf::{
    CanFrames, Channel as MdfChannel, Conversion, Mf4Error, Mf4File, OpenOptions, Signal, SignalValues, SignalsChunks,
};

use crate::can::{Database, Decoder, Frame};
use crate::samples::{Quality, Sample, Stream};
use crate::{Channel, LogError};

/// Records that are given at once.
const BATCH: usize = 4096;
/// Bytes of records that are decoded at once, and the limits of their number. What is left of an unpacked block is moved each time:
/// with few records at once, that would take as long as to unpack it.
const DECODED_AT_ONCE: usize = 4 << 20;
const DECODED: std::ops::RangeInclusive<usize> = BATCH..=1 << 17;
/// Largest block of data that is unpacked, bytes. Writers use up to 4 MiB.
const LARGEST_BLOCK: u64 = 256 << 20;
/// Memory that is taken on the word of the file, bytes.
const ON_TRUST: usize = 16 << 20;

/// An open MDF file.
pub(crate) struct MdfLog {
    path: PathBuf,
    file: Mf4File,
    places: Vec<Place>,
    /// Signals on a logged bus, behind the channels of the file.
    database: Option<Database>,
    notes: Vec<String>,
}

/// Where a channel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place {
    data_group: usize,
    group: usize,
    channel: usize,
}

impl MdfLog {
    pub(crate) fn open(path: &Path, database: Option<Database>) -> Result<(Self, Vec<Channel>), LogError> {
        let options = OpenOptions {
            build_channels_db: false,
            parallel_parsing: false,
            max_alloc: ON_TRUST,
            max_decompressed: LARGEST_BLOCK,
            ..OpenOptions::default()
        };
        let file = Mf4File::open_with_options(path, options).map_err(|error| damaged(path, "its structure", &error))?;
        let (mut places, mut channels, mut notes) = (Vec::new(), Vec::new(), Vec::new());
        let mut unreadable = 0;
        for (data_group, group, data) in groups(&file) {
            let name = group_name(&file, data, data_group);
            if data.master_channel().is_none_or(|master| !master.is_time_channel()) {
                let count = data.channels.iter().filter(|channel| !channel.is_master()).count();
                if count > 0 {
                    notes.push(format!("{count} channels of group `{name}` have no time and are left out"));
                }
                continue;
            }
            for (i, channel) in data.channels.iter().enumerate().filter(|(_, channel)| !channel.is_master()) {
                if channel.unreadable().is_some()
                    || !(channel.value_kind().is_numeric() || channel.raw_value_kind().is_numeric())
                    || channel.is_array()
                {
                    unreadable += 1;
                    continue;
                }
                places.push(Place { data_group, group, channel: i });
                channels.push(Channel { name: channel.name.clone(), unit: channel.unit.clone(), group: name.clone() });
            }
        }
        if unreadable > 0 {
            notes.push(format!("{unreadable} channels do not hold single numbers and are left out"));
        }
        if file.unfinalized().is_some() {
            notes.push("the file was not finished by its recorder: what stands in it is read".to_owned());
        }
        let log = Self { path: path.to_owned(), file, places, database, notes };
        if let Some(database) = log.database.as_ref().filter(|_| !log.file.can_frame_groups().is_empty()) {
            channels.extend_from_slice(database.channels());
        }
        Ok((log, channels))
    }

    pub(crate) fn format(&self) -> String {
        format!("MDF {}", self.file.version())
    }

    pub(crate) fn streams(&mut self, wanted: &[bool]) -> Result<Vec<Box<dyn Stream + '_>>, LogError> {
        let mut streams: Vec<Box<dyn Stream + '_>> = Vec::new();
        for (data_group, group, data) in groups(&self.file) {
            let chosen: Vec<usize> = (0..self.places.len())
                .filter(|&i| wanted[i] && (self.places[i].data_group, self.places[i].group) == (data_group, group))
                .collect();
            let Some(master) = data.master_channel().filter(|_| !chosen.is_empty()) else { continue };
            let channels: Vec<&MdfChannel> =
                std::iter::once(master).chain(chosen.iter().map(|&i| &data.channels[self.places[i].channel])).collect();
            let name = group_name(&self.file, data, data_group);
            let place = format!("group `{name}`");
            let records = (DECODED_AT_ONCE / data.record_size(0).max(1)).clamp(*DECODED.start(), *DECODED.end());
            let chunks =
                self.file.signals_chunks(&channels, records).map_err(|error| damaged(&self.path, &place, &error))?;
            streams.push(Box::new(Group {
                path: &self.path,
                place,
                chunks,
                channels: chosen,
                times: Vec::new(),
                columns: Vec::new(),
                given: 0,
                read: 0,
                declared: data.sample_count,
                without_time: 0,
            }));
        }
        let own = self.places.len();
        if let Some(database) = self.database.as_ref().filter(|_| wanted.len() > own) {
            for group in self.file.can_frame_groups() {
                let frames = self
                    .file
                    .can_frames(group)
                    .map_err(|error| damaged(&self.path, "the frames of its bus", &error))?;
                streams.push(Box::new(Bus { frames, at: 0, decoder: Decoder::new(database, &wanted[own..]), own }));
            }
        }
        streams.push(Box::new(Remarks(&self.notes)));
        Ok(streams)
    }
}

/// Data group, channel group, and the group itself.
fn groups(file: &Mf4File) -> impl Iterator<Item = (usize, usize, &falcon_mdf::ChannelGroup)> {
    file.data_groups()
        .iter()
        .enumerate()
        .flat_map(|(i, data)| data.channel_groups.iter().enumerate().map(move |(j, group)| (i, j, group)))
}

/// A group by the name that its recorder gave it, or its number; by both where several have the name.
fn group_name(file: &Mf4File, group: &falcon_mdf::ChannelGroup, data_group: usize) -> String {
    let number = data_group + 1;
    let same = groups(file).filter(|(.., other)| other.acquisition_name == group.acquisition_name).count();
    match group.acquisition_name.trim() {
        "" => format!("{number}"),
        name if same > 1 => format!("{name} #{number}"),
        name => name.to_owned(),
    }
}

fn damaged(path: &Path, place: &str, error: &Mf4Error) -> LogError {
    LogError::damaged(path, place, error.to_string())
}

/// The records of a channel group.
struct Group<'a> {
    path: &'a Path,
    place: String,
    chunks: SignalsChunks<'a>,
    channels: Vec<usize>,
    /// Times of the records that were decoded, s, and of each channel the values and which of them are valid.
    times: Vec<f64>,
    columns: Vec<(Vec<f64>, Option<Vec<bool>>)>,
    /// How many of them were given.
    given: usize,
    read: u64,
    declared: u64,
    without_time: u64,
}

impl Group<'_> {
    /// Takes the next records.
    fn decode(&mut self, signals: &[Signal]) -> Result<(), Mf4Error> {
        (self.given, self.times) = (0, Vec::new());
        let Some((master, signals)) = signals.split_first() else { return Ok(()) };
        self.times = numbers(master)?;
        self.read += self.times.len() as u64;
        let column = |signal: &Signal| Ok((numbers(signal)?, signal.validity()));
        self.columns = signals.iter().map(column).collect::<Result<_, Mf4Error>>()?;
        Ok(())
    }

    /// Gives some of the records that were decoded.
    fn give(&mut self, batch: &mut Vec<Sample>) {
        let rows = self.given..(self.given + BATCH).min(self.times.len());
        self.given = rows.end;
        batch.reserve(rows.len() * self.columns.len());
        for row in rows {
            let time_s = self.times[row];
            if !time_s.is_finite() {
                self.without_time += 1;
                continue;
            }
            for ((values, valid), &channel) in self.columns.iter().zip(&self.channels) {
                let value = values.get(row).copied().unwrap_or(f64::NAN);
                let quality = match valid.as_ref().map(|valid| valid.get(row)) {
                    Some(Some(false)) => Quality::Invalid,
                    _ if value.is_finite() => Quality::Good,
                    _ => Quality::Missing,
                };
                batch.push(Sample { channel, time_s, value, quality });
            }
        }
    }
}

/// The values of a signal; where the conversion makes text of them, the numbers before it.
fn numbers(signal: &Signal) -> Result<Vec<f64>, Mf4Error> {
    let channel = signal.channel();
    // `values` converts a scaled integer sample by sample, at several times the cost.
    if let (Conversion::Linear { offset, factor }, ChannelType::FixedLength | ChannelType::Master) =
        (&channel.conversion, channel.channel_type)
    {
        let mut values = plain(signal.raw_values()?);
        values.iter_mut().for_each(|value| *value = factor * *value + offset);
        return Ok(values);
    }
    match signal.values()? {
        SignalValues::Str(_) => Ok(plain(signal.raw_values()?)),
        values => Ok(plain(values)),
    }
}

fn plain(values: SignalValues) -> Vec<f64> {
    match values {
        SignalValues::F64(values) => values,
        other => other.to_f64(),
    }
}

impl Stream for Group<'_> {
    fn next_batch(&mut self, batch: &mut Vec<Sample>) -> Result<bool, LogError> {
        if self.given < self.times.len() {
            self.give(batch);
            return Ok(true);
        }
        match self.chunks.next() {
            None if self.read < self.declared => {
                let message = format!("the data end after {} of {} records", self.read, self.declared);
                // Said once: the next call ends the stream.
                self.declared = self.read;
                Err(LogError::damaged(self.path, &self.place, message))
            }
            None => Ok(false),
            Some(signals) => {
                let decoded = signals.and_then(|signals| self.decode(&signals));
                decoded.map_err(|error| {
                    damaged(self.path, &format!("{}, record {}", self.place, self.read + 1), &error)
                })?;
                self.give(batch);
                Ok(true)
            }
        }
    }

    fn notes(&self) -> Vec<String> {
        match self.without_time {
            0 => Vec::new(),
            count => vec![format!("{count} records of {} have no time and are left out", self.place)],
        }
    }
}

/// The frames of a bus that an MDF file holds.
struct Bus<'a> {
    frames: CanFrames,
    at: usize,
    decoder: Decoder<'a>,
    /// Channels before those of the database.
    own: usize,
}

impl Stream for Bus<'_> {
    fn next_batch(&mut self, batch: &mut Vec<Sample>) -> Result<bool, LogError> {
        let end = (self.at + BATCH).min(self.frames.len());
        if self.at == end {
            return Ok(false);
        }
        let before = batch.len();
        for i in self.at..end {
            let Some(frame) = self.frames.get(i).filter(|frame| frame.timestamp.is_finite()) else { continue };
            let extended = frame.extended.unwrap_or(frame.id > 0x7ff);
            self.decoder.decode(&Frame::new(frame.timestamp, frame.id, extended, frame.data), batch);
        }
        self.at = end;
        for sample in &mut batch[before..] {
            sample.channel += self.own;
        }
        Ok(true)
    }

    fn notes(&self) -> Vec<String> {
        self.decoder.notes()
    }
}

/// What was seen when the file was opened.
struct Remarks<'a>(&'a [String]);

impl Stream for Remarks<'_> {
    fn next_batch(&mut self, _: &mut Vec<Sample>) -> Result<bool, LogError> {
        Ok(false)
    }

    fn notes(&self) -> Vec<String> {
        self.0.to_vec()
    }
}
