//! The records of channel groups that share a time, as a stream.

use std::path::Path;

use falcon_mdf::blocks::channel::ChannelType;
use falcon_mdf::{Channel as MdfChannel, Conversion, Mf4Error, Signal, SignalValues, SignalsChunks};

use super::conversion::keeps_numbers;
use super::field::{Field, Tile};
use super::limits::{BATCH, GroupAt, ON_TRUST};
use super::records::Records;
use super::{MdfLog, message};
use crate::LogError;
use crate::columns::{Batch, Block, Column, Memory, Stream};
use crate::samples::Quality;

/// Bytes of records that the library decodes at once, and the limits of their number. What is left of an unpacked block is moved each time:
/// with few records at once, that would take as long as to unpack it.
const DECODED_AT_ONCE: usize = 4 << 20;
const DECODED: std::ops::RangeInclusive<usize> = BATCH..=1 << 17;

/// The records of a channel group, and of others that have their time in it.
pub(super) struct Group<'a> {
    path: &'a Path,
    place: String,
    decoder: Decoding<'a>,
    /// The channels in the order of the decoder, by their places in the log.
    channels: Vec<usize>,
    /// The size of the unit of the time, s.
    unit_s: f64,
    read: u64,
    declared: u64,
    without_time: u64,
}

/// What decodes the records of a group.
pub(super) enum Decoding<'a> {
    /// Time and channels as fields of the records. The time is in the first part.
    Own { tile: Box<Tile>, time: Field<'a>, parts: Vec<Part<'a>> },
    /// By the library.
    Library(Box<SignalsChunks<'a>>),
}

/// The records of one channel group, and the channels in them.
pub(super) struct Part<'a> {
    records: Records<'a>,
    fields: Vec<Field<'a>>,
}

impl<'a> Part<'a> {
    /// None where the library must decode one of the channels.
    pub(super) fn of(log: &'a MdfLog, at: GroupAt, channels: impl Iterator<Item = &'a MdfChannel>) -> Option<Self> {
        let (data, group) = log.group(at);
        let id_bytes = Records::id_bytes(data);
        let fields = channels.map(|channel| Field::of(channel, group, id_bytes)).collect::<Option<_>>()?;
        Some(Self { records: Records::of(&log.blocks, &log.crew, data, group)?, fields })
    }
}

impl<'a> Group<'a> {
    pub(super) fn new(log: &'a MdfLog, time: GroupAt, decoder: Decoding<'a>, channels: Vec<usize>) -> Self {
        let declared = log.group(time).1.sample_count;
        Self {
            path: &log.path,
            place: log.place_of(time),
            decoder,
            channels,
            unit_s: log.time_units.size_s(time),
            read: 0,
            declared,
            without_time: 0,
        }
    }
}

impl<'a> Decoding<'a> {
    /// That of the library, of channels of one group; the first is the time.
    pub(super) fn by_library(log: &'a MdfLog, at: GroupAt, channels: &[&'a MdfChannel]) -> Result<Self, Mf4Error> {
        let records = (DECODED_AT_ONCE / log.group(at).1.record_size(0).max(1)).clamp(*DECODED.start(), *DECODED.end());
        log.file.signals_chunks(channels, records).map(|chunks| Self::Library(Box::new(chunks)))
    }

    /// Decodes the next records, behind those that the columns have; false at the end.
    fn next(&mut self, Batch { block, memory, .. }: &mut Batch) -> Result<bool, String> {
        match self {
            Self::Own { tile, time, parts } => next_of_parts(parts, time, tile, block, memory),
            Self::Library(chunks) => {
                let Some(signals) = chunks.next() else { return Ok(false) };
                signals.and_then(|signals| append(&signals, block)).map_err(|error| message(&error))?;
                Ok(true)
            }
        }
    }
}

/// Decodes as many records as all parts have ready.
fn next_of_parts(
    parts: &mut [Part<'_>],
    time: &Field<'_>,
    tile: &mut Tile,
    block: &mut Block,
    memory: &mut Vec<Memory>,
) -> Result<bool, String> {
    memory.resize_with(memory.len().max(parts.len()), Memory::default);
    let mut count = BATCH;
    for (part, memory) in parts.iter_mut().zip(memory.iter_mut()) {
        count = count.min(part.records.ready(memory)?);
    }
    if count == 0 {
        return Ok(false);
    }
    let mut columns = block.columns.iter_mut();
    for (i, (part, memory)) in parts.iter_mut().zip(memory).enumerate() {
        let window = part.records.take(count, memory);
        if i == 0 {
            time.decode(&window, tile, &mut block.times_s);
        }
        part.fields.iter().zip(&mut columns).for_each(|(field, column)| field.fill(&window, tile, column));
    }
    Ok(true)
}

/// Appends the numbers of signals, of which the first is the time.
fn append(signals: &[Signal], block: &mut Block) -> Result<(), Mf4Error> {
    let Some((master, signals)) = signals.split_first() else { return Ok(()) };
    block.times_s.extend(numbers(master)?);
    let rows = block.times_s.len();
    signals.iter().zip(&mut block.columns).try_for_each(|(signal, column)| fill(signal, column, rows))
}

/// Appends the numbers of a signal, so that the column has as many as there are rows.
fn fill(signal: &Signal, column: &mut Column, rows: usize) -> Result<(), Mf4Error> {
    let first = column.values.len();
    column.values.extend(numbers(signal)?);
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
    let qualities: Vec<_> = column.values[first..].iter().enumerate().map(quality).collect();
    column.qualities_from(first).extend(qualities);
    Ok(())
}

/// The values of a signal; where the conversion makes only text of them, the numbers before it.
pub(super) fn numbers(signal: &Signal) -> Result<Vec<f64>, Mf4Error> {
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
    let values = match signal.values()? {
        SignalValues::Str(_) => plain(signal.raw_values()?),
        values => return Ok(plain(values)),
    };
    if keeps_numbers(&channel.conversion) {
        return Ok(values);
    }
    Ok(values.into_iter().map(|number| channel.conversion.convert(number, channel.is_float())).collect())
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
        let first = batch.block.times_s.len();
        let read = self.decoder.next(batch);
        let block = &mut batch.block;
        match read {
            Err(message) => {
                block.truncate(first);
                let place = format!("{}, record {}", self.place, self.read + 1);
                Err(LogError::cut_or_damaged(self.path, place, message))
            }
            Ok(false) if self.read < self.declared => {
                let message = format!("the data end after {} of {} records", self.read, self.declared);
                // Said once: the next call ends the stream.
                self.declared = self.read;
                Err(LogError::cut_or_damaged(self.path, &self.place, message))
            }
            Ok(false) => Ok(false),
            Ok(true) => {
                if self.unit_s != 1.0 {
                    block.times_s[first..].iter_mut().for_each(|time_s| *time_s *= self.unit_s);
                }
                self.read += (block.times_s.len() - first) as u64;
                self.without_time += block.leave_out_without_time(first);
                Ok(true)
            }
        }
    }

    fn max_records(&self) -> usize {
        match &self.decoder {
            Decoding::Own { parts, .. } => parts.first().map_or(0, |part| part.records.maximum()),
            // What the library unpacks is not known before.
            Decoding::Library(_) => {
                usize::try_from(self.declared).unwrap_or(usize::MAX).min(ON_TRUST / size_of::<f64>())
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
