//! Messages and signals of a bus, from a DBC.

use std::collections::HashMap;
use std::path::Path;

use can_dbc::{
    ByteOrder, Dbc, DbcError, ExtendedMultiplex, MessageId, MultiplexIndicator, SignalExtendedValueType, ValueType,
};
use trace::text_file::LARGEST_LIST;

use super::Frame;
use crate::error::shown;
use crate::samples::{Quality, Sample};
use crate::{Channel, LogError};

/// The messages of a bus and the signals in them.
#[derive(Debug, Clone)]
pub struct Database {
    messages: HashMap<(bool, u32), Vec<Signal>>,
    channels: Vec<Channel>,
}

#[derive(Debug, Clone)]
struct Signal {
    channel: usize,
    bits: Bits,
    number: Number,
    factor: f64,
    offset: f64,
    /// In force only while a multiplexor has one of these values.
    multiplexed: Option<Multiplexed>,
}

#[derive(Debug, Clone)]
struct Multiplexed {
    /// Place of the multiplexor among the signals of the message.
    by: usize,
    values: Vec<(u64, u64)>,
}

#[derive(Debug, Clone, Copy)]
struct Bits {
    start: usize,
    size: usize,
    big_endian: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    Unsigned,
    Signed,
    Float,
    Double,
}

impl Bits {
    /// The raw value; none if the frame ends before.
    fn of(self, data: &[u8]) -> Option<u64> {
        let mut raw = 0_u64;
        let mut at = self.start;
        for i in 0..self.size {
            let bit = u64::from(data.get(at / 8)? >> (at % 8) & 1);
            if self.big_endian {
                raw = raw << 1 | bit;
                // To the next lower bit; from the lowest of a byte to the highest of the next byte.
                at = if at.is_multiple_of(8) { at + 15 } else { at - 1 };
            } else {
                raw |= bit << i;
                at += 1;
            }
        }
        Some(raw)
    }

    fn all_set(self, raw: u64) -> bool {
        raw == u64::MAX >> (64 - self.size)
    }
}

impl Database {
    /// Reads a DBC. Text that is not UTF-8 is read as Latin-1.
    ///
    /// # Errors
    /// The file cannot be read, is no DBC, or has a signal of an impossible size.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let bytes = trace::read_small(path, LARGEST_LIST).map_err(LogError::io(path))?;
        let text = String::from_utf8(bytes)
            .unwrap_or_else(|error| error.as_bytes().iter().map(|&byte| char::from(byte)).collect());
        Self::parse(path, &text)
    }

    fn parse(path: &Path, text: &str) -> Result<Self, LogError> {
        let dbc = Dbc::try_from(text).map_err(|error| no_dbc(path, &error))?;
        let entries = Entries::of(&dbc);
        let mut database = Self { messages: HashMap::new(), channels: Vec::new() };
        for message in &dbc.messages {
            let key = match message.id {
                MessageId::Standard(id) => (false, u32::from(id)),
                MessageId::Extended(id) => (true, id),
            };
            let multiplexors = Multiplexors::of(&entries, message);
            let mut signals = Vec::with_capacity(message.signals.len());
            for signal in &message.signals {
                let whole = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
                let (start, size) = (whole(signal.start_bit), whole(signal.size));
                if size == 0 || size > 64 || start >= 8 * super::PAYLOAD {
                    return Err(LogError::file(
                        path,
                        format!(
                            "signal `{}` of message `{}` has {size} bits from bit {start}, expected 1 to 64 within 64 bytes",
                            signal.name, message.name
                        ),
                    ));
                }
                let float = entries.floats.get(&(message.id, signal.name.as_str())).copied();
                let number = match (float, signal.value_type, size) {
                    (Some(SignalExtendedValueType::IEEEfloat32Bit), _, 32) => Number::Float,
                    (Some(SignalExtendedValueType::IEEEdouble64bit), _, 64) => Number::Double,
                    (Some(SignalExtendedValueType::IEEEfloat32Bit | SignalExtendedValueType::IEEEdouble64bit), ..) => {
                        return Err(LogError::file(
                            path,
                            format!(
                                "signal `{}` of message `{}` is a float of {size} bits, expected 32 or 64",
                                signal.name, message.name
                            ),
                        ));
                    }
                    (_, ValueType::Signed, _) => Number::Signed,
                    (_, ValueType::Unsigned, _) => Number::Unsigned,
                };
                signals.push(Signal {
                    channel: database.channels.len(),
                    bits: Bits { start, size, big_endian: signal.byte_order == ByteOrder::BigEndian },
                    number,
                    factor: signal.factor,
                    offset: signal.offset,
                    multiplexed: multiplexors.multiplexed(signal),
                });
                database.channels.push(Channel {
                    name: signal.name.clone(),
                    unit: signal.unit.clone(),
                    group: message.name.clone(),
                });
            }
            database.messages.insert(key, signals);
        }
        Ok(database)
    }

    /// The signals of all messages.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Appends the wanted signals of a frame; false if its message is not known.
    pub(crate) fn decode(&self, frame: &Frame, wanted: &[bool], batch: &mut Vec<Sample>) -> bool {
        let Some(signals) = self.messages.get(&(frame.extended, frame.id)) else { return false };
        for signal in signals.iter().filter(|signal| wanted.get(signal.channel) == Some(&true)) {
            if !in_force(signals, signal, frame.data(), 0) {
                continue;
            }
            let (value, quality) = match signal.bits.of(frame.data()) {
                None => (f64::NAN, Quality::Missing),
                Some(raw) => signal.value(raw),
            };
            batch.push(Sample { channel: signal.channel, time_s: frame.time_s, value, quality });
        }
        true
    }
}

impl Signal {
    fn value(&self, raw: u64) -> (f64, Quality) {
        let size = self.bits.size;
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_wrap,
            clippy::cast_possible_truncation,
            reason = "bit patterns; a double keeps 53 bits"
        )]
        let number = match self.number {
            Number::Unsigned => raw as f64,
            Number::Signed => ((raw << (64 - size)) as i64 >> (64 - size)) as f64,
            Number::Float => f64::from(f32::from_bits(raw as u32)),
            Number::Double => f64::from_bits(raw),
        };
        let value = number * self.factor + self.offset;
        let quality = match () {
            () if !value.is_finite() => Quality::Missing,
            () if self.number == Number::Unsigned && size >= 8 && self.bits.all_set(raw) => Quality::Saturated,
            () => Quality::Good,
        };
        (value, quality)
    }
}

/// Whether the multiplexors of a signal have its values.
fn in_force(signals: &[Signal], signal: &Signal, data: &[u8], depth: u32) -> bool {
    // A multiplexor may be multiplexed itself; a circle of them is never in force.
    const DEEPEST: u32 = 8;
    let Some(multiplexed) = &signal.multiplexed else { return true };
    let Some(by) = signals.get(multiplexed.by) else { return false };
    depth < DEEPEST
        && by
            .bits
            .of(data)
            .is_some_and(|raw| multiplexed.values.iter().any(|(least, most)| (*least..=*most).contains(&raw)))
        && in_force(signals, by, data, depth + 1)
}

/// The entries of a DBC about single signals, by message and name; the first one of each counts. They stand in lists after all messages:
/// to look through the lists for each signal would take a time of the square of the file's size.
struct Entries<'d> {
    floats: HashMap<(MessageId, &'d str), SignalExtendedValueType>,
    ranges: HashMap<(MessageId, &'d str), &'d ExtendedMultiplex>,
}

impl<'d> Entries<'d> {
    fn of(dbc: &'d Dbc) -> Self {
        let (mut floats, mut ranges) = (HashMap::new(), HashMap::new());
        for entry in &dbc.signal_extended_value_type_list {
            floats.entry((entry.message_id, &*entry.signal_name)).or_insert(entry.signal_extended_value_type);
        }
        for entry in &dbc.extended_multiplex {
            ranges.entry((entry.message_id, &*entry.signal_name)).or_insert(entry);
        }
        Self { floats, ranges }
    }
}

/// What the signals of a message may be multiplexed by.
struct Multiplexors<'d> {
    message: MessageId,
    entries: &'d Entries<'d>,
    /// The place of each signal, by its name.
    places: HashMap<&'d str, usize>,
    /// The multiplexor that is not multiplexed itself.
    main: Option<usize>,
}

impl<'d> Multiplexors<'d> {
    fn of(entries: &'d Entries<'d>, message: &'d can_dbc::Message) -> Self {
        let mut places = HashMap::new();
        for (place, signal) in message.signals.iter().enumerate() {
            places.entry(&*signal.name).or_insert(place);
        }
        let main = message.signals.iter().position(|signal| {
            signal.multiplexer_indicator == MultiplexIndicator::Multiplexor
                && !entries.ranges.contains_key(&(message.id, &*signal.name))
        });
        Self { message: message.id, entries, places, main }
    }

    /// When a signal is in force; none if always.
    fn multiplexed(&self, signal: &can_dbc::Signal) -> Option<Multiplexed> {
        // A multiplexor in another one is not marked as multiplexed by every writer: the ranges say it.
        if let Some(extended) = self.entries.ranges.get(&(self.message, &*signal.name)) {
            let by = self.places.get(&*extended.multiplexor_signal_name).copied();
            let values = extended.mappings.iter().map(|mapping| (mapping.min_value, mapping.max_value)).collect();
            return Some(Multiplexed { by: by.unwrap_or(usize::MAX), values });
        }
        let value = match signal.multiplexer_indicator {
            MultiplexIndicator::Plain | MultiplexIndicator::Multiplexor => return None,
            MultiplexIndicator::MultiplexedSignal(value)
            | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value) => value,
        };
        Some(Multiplexed { by: self.main.unwrap_or(usize::MAX), values: vec![(value, value)] })
    }
}

/// A text that is no DBC. The message of the parser has the whole line, which may be the whole file: only its place is taken.
fn no_dbc(path: &Path, error: &DbcError) -> LogError {
    const WHAT: &str = "this is no DBC that can be read";
    let DbcError::Pest(error) = error else {
        return LogError::file(path, format!("{WHAT}: {}", shown(&error.to_string())));
    };
    let text = error.to_string();
    let place = text.lines().next().and_then(|first| first.trim().strip_prefix("--> "));
    let line = place.and_then(|place| place.split(':').next()).unwrap_or("1");
    LogError::damaged(path, format!("line {line}"), format!("{WHAT}: {}", shown(&error.variant.message())))
}
