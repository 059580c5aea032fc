//! ASAM MDF 4: each channel group is a stream with its own clock.
//!
//! `falcon_mdf` reads the structure of a file. Plain numbers in deflated or unpacked blocks are decoded here, column by column;
//! what is rarer is decoded by the library.

mod field;
mod records;

use std::fs::File;
use std::path::{Path, PathBuf};

use falcon_mdf::blocks::channel::ChannelType;
use falcon_mdf::{
    CanFrames, Channel as MdfChannel, ChannelGroup, Conversion, Mf4Error, Mf4File, OpenOptions, Signal, SignalValues,
    SignalsChunks,
};

use crate::can::{Database, Decoder, Frame};
use crate::columns::{Batch, Block, Column, Stream};
use crate::samples::Quality;
use crate::{Channel, LogError, error};
use field::{Field, Tile};
use records::Records;

/// Records that are given at once: their columns stay in the second cache.
const BATCH: usize = 8192;
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
    /// The same, for blocks of data.
    blocks: File,
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
        let (mut left_out, mut without_time) = (Vec::new(), Vec::new());
        for (data_group, group, data) in groups(&file) {
            let name = group_name(&file, data, data_group);
            if data.master_channel().is_none_or(|master| !master.is_time_channel()) {
                let others = data.channels.iter().filter(|channel| !channel.is_master());
                without_time.extend(others.map(|channel| error::shown(&channel.name)));
                continue;
            }
            for (i, channel) in data.channels.iter().enumerate().filter(|(_, channel)| !channel.is_master()) {
                if let Some(kind) = not_numbers(channel) {
                    left_out.push(format!("{} ({kind})", error::shown(&channel.name)));
                    continue;
                }
                places.push(Place { data_group, group, channel: i });
                channels.push(Channel { name: channel.name.clone(), unit: channel.unit.clone(), group: name.clone() });
            }
        }
        if !without_time.is_empty() {
            notes.push(format!(
                "{} channels have no time in their group and are left out: {}\nhint: MDF 4.2 can keep the time in another group, which is not read; \
                 convert the file to 4.10, for example with asammdf (`MDF(path).convert(\"4.10\")`)",
                without_time.len(),
                error::some(&without_time)
            ));
        }
        if !left_out.is_empty() {
            notes.push(format!(
                "{} channels do not hold single numbers and are left out: {}",
                left_out.len(),
                error::some(&left_out)
            ));
        }
        if file.unfinalized().is_some() {
            notes.push("the file was not finished by its recorder: what stands in it is read".to_owned());
        }
        let blocks = File::open(path).map_err(LogError::io(path))?;
        let log = Self { path: path.to_owned(), file, blocks, places, database, notes };
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
            let place = format!("group `{}`", group_name(&self.file, data, data_group));
            let decoder =
                Decoding::of(self, data_group, data, &channels).map_err(|error| damaged(&self.path, &place, &error))?;
            let (path, declared) = (&self.path, data.sample_count);
            streams.push(Box::new(Group {
                path,
                place,
                decoder,
                channels: chosen,
                read: 0,
                declared,
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

/// What a channel holds in place of single numbers, in a word; none if it holds these.
fn not_numbers(channel: &MdfChannel) -> Option<&'static str> {
    match () {
        () if channel.is_array() => Some("an array"),
        () if channel.unreadable().is_some() => Some("cannot be read"),
        () if channel.value_kind().is_numeric() || channel.raw_value_kind().is_numeric() => None,
        () => Some("text or bytes"),
    }
}

/// Data group, channel group, and the group itself.
fn groups(file: &Mf4File) -> impl Iterator<Item = (usize, usize, &ChannelGroup)> {
    file.data_groups()
        .iter()
        .enumerate()
        .flat_map(|(i, data)| data.channel_groups.iter().enumerate().map(move |(j, group)| (i, j, group)))
}

/// A group by the name that its recorder gave it, or its number; by both where several have the name.
fn group_name(file: &Mf4File, group: &ChannelGroup, data_group: usize) -> String {
    let number = data_group + 1;
    let same = groups(file).filter(|(.., other)| other.acquisition_name == group.acquisition_name).count();
    match group.acquisition_name.trim() {
        "" => format!("{number}"),
        name if same > 1 => format!("{name} #{number}"),
        name => name.to_owned(),
    }
}

fn damaged(path: &Path, place: &str, error: &Mf4Error) -> LogError {
    let hint = match error {
        Mf4Error::UnsupportedVersion { .. } => "\nhint: versions 4.00 to 4.20 are read; save it as one of them",
        _ => "",
    };
    LogError::damaged(path, place, format!("{error}{hint}"))
}

/// The records of a channel group.
struct Group<'a> {
    path: &'a Path,
    place: String,
    decoder: Decoding<'a>,
    channels: Vec<usize>,
    read: u64,
    declared: u64,
    without_time: u64,
}

/// What decodes the records of a group.
enum Decoding<'a> {
    /// Time and channels as fields of the records.
    Own {
        records: Box<Records<'a>>,
        tile: Box<Tile>,
        time: Field<'a>,
        fields: Vec<Field<'a>>,
    },
    Library(Box<SignalsChunks<'a>>),
}

impl<'a> Decoding<'a> {
    fn of(log: &'a MdfLog, at: usize, group: &'a ChannelGroup, channels: &[&'a MdfChannel]) -> Result<Self, Mf4Error> {
        let data = &log.file.data_groups()[at];
        let id_bytes = Records::id_bytes(data);
        let fields: Option<Vec<Field<'_>>> =
            channels.iter().map(|channel| Field::of(channel, group, id_bytes)).collect();
        let mut fields = fields.unwrap_or_default().into_iter();
        if let (Some(time), Some(records)) = (fields.next(), Records::of(&log.blocks, data, group)) {
            return Ok(Self::Own { records: Box::new(records), tile: Tile::new(), time, fields: fields.collect() });
        }
        let records = (DECODED_AT_ONCE / group.record_size(0).max(1)).clamp(*DECODED.start(), *DECODED.end());
        log.file.signals_chunks(channels, records).map(|chunks| Self::Library(Box::new(chunks)))
    }

    /// Decodes the next records, in place of those that the columns have; false at the end.
    fn next(&mut self, Batch { block, memory, .. }: &mut Batch) -> Result<bool, String> {
        let Block { times_s, columns } = block;
        match self {
            Self::Own { records, tile, time, fields } => {
                let Some(window) = records.next(BATCH, memory)? else { return Ok(false) };
                time.decode(&window, tile, times_s);
                fields.iter().zip(columns).for_each(|(field, column)| field.fill(&window, tile, column));
                Ok(true)
            }
            Self::Library(chunks) => {
                let Some(signals) = chunks.next() else { return Ok(false) };
                let fill = |signals: Vec<Signal>| {
                    let Some((master, signals)) = signals.split_first() else { return Ok(()) };
                    *times_s = numbers(master)?;
                    signals.iter().zip(columns).try_for_each(|(signal, column)| fill(signal, column, times_s.len()))
                };
                signals.and_then(fill).map_err(|error: Mf4Error| error.to_string())?;
                Ok(true)
            }
        }
    }
}

/// The numbers of a signal, in place of those that the column has.
fn fill(signal: &Signal, column: &mut Column, rows: usize) -> Result<(), Mf4Error> {
    column.values = numbers(signal)?;
    column.values.resize(rows, f64::NAN);
    let valid = signal.validity();
    let quality = |(row, value): (usize, &f64)| {
        let is_valid = valid.as_ref().is_none_or(|valid| valid.get(row).copied().unwrap_or(true));
        Some(match value.is_finite() {
            _ if !is_valid => Quality::Invalid,
            true => Quality::Good,
            false => Quality::Missing,
        })
    };
    column.qualities = column.values.iter().enumerate().map(quality).collect();
    Ok(())
}

/// The values of a signal; where the conversion makes text of them, the numbers before it.
fn numbers(signal: &Signal) -> Result<Vec<f64>, Mf4Error> {
    let channel = signal.channel();
    if channel.is_float() && channel.bit_count == 16 {
        // `falcon_mdf` 0.7 takes them for other numbers: they count as missing.
        return Ok(Vec::new());
    }
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
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
        batch.block_of(&self.channels);
        let read = self.decoder.next(batch);
        let block = &mut batch.block;
        match read {
            Err(message) => {
                block.times_s.clear();
                let place = format!("{}, record {}", self.place, self.read + 1);
                Err(LogError::damaged(self.path, place, message))
            }
            Ok(false) if self.read < self.declared => {
                let message = format!("the data end after {} of {} records", self.read, self.declared);
                // Said once: the next call ends the stream.
                self.declared = self.read;
                Err(LogError::damaged(self.path, &self.place, message))
            }
            Ok(false) => Ok(false),
            Ok(true) => {
                self.read += block.times_s.len() as u64;
                self.without_time += block.leave_out_without_time();
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
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
        let batch = &mut batch.samples;
        let end = (self.at + BATCH).min(self.frames.len());
        if self.at == end {
            return Ok(false);
        }
        let before = batch.len();
        for i in self.at..end {
            let Some(frame) = self.frames.get(i).filter(|frame| frame.timestamp.is_finite()) else { continue };
            let extended = frame.extended.unwrap_or(frame.id > 0x7ff);
            let own = Frame::new(frame.timestamp, frame.id, extended, frame.data);
            self.decoder.decode(&own.on(u32::from(frame.bus_channel)), batch);
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
    fn next_batch(&mut self, _: &mut Batch) -> Result<bool, LogError> {
        Ok(false)
    }

    fn notes(&self) -> Vec<String> {
        self.0.to_vec()
    }
}
