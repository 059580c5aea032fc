//! Messages and signals of a bus, from a DBC.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use can_dbc::{
    ByteOrder, Dbc, DbcError, ExtendedMultiplex, MessageId, MultiplexIndicator, NumericValue, SignalExtendedValueType,
    ValDescription, ValueDescription, ValueType,
};
use trace::text_file::LARGEST_LIST;

use super::Frame;
use super::names::Named;
use crate::error::shown;
use crate::samples::{Quality, Sample};
use crate::{Channel, LogError, error};

/// The messages of a bus and the signals in them.
#[derive(Debug, Clone)]
pub struct Database {
    /// The signals of the messages with one identifier, of which a sound DBC has one.
    messages: HashMap<Key, Vec<Vec<Signal>>>,
    channels: Vec<Channel>,
    /// Names of messages whose identifier an earlier one has, behind the name of that one.
    same_identifier: BTreeMap<Key, Vec<String>>,
}

/// An identifier, and whether it is an extended one.
type Key = (bool, u32);

#[derive(Debug, Clone)]
struct Signal {
    channel: usize,
    bits: Bits,
    number: Number,
    factor: f64,
    offset: f64,
    /// Raw values that the DBC names as none, in their order.
    missing: Vec<u64>,
    /// Whether a value with every bit set is none.
    can_saturate: bool,
    /// In force only while a multiplexor has one of these values.
    multiplexed: Option<Multiplexed>,
}

#[derive(Debug, Clone)]
struct Multiplexed {
    /// Place of the multiplexor among the signals of the message; none where the message has none.
    by: Option<usize>,
    values: Vec<(u64, u64)>,
}

#[derive(Debug, Clone, Copy)]
struct Bits {
    start: usize,
    size: usize,
    big_endian: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    Unsigned,
    Signed,
    Float,
    Double,
}

impl Number {
    /// The number in so many bits.
    // A double keeps 53 bits; a float has 32.
    pub(super) fn of(self, raw: u64, size: usize) -> f64 {
        match self {
            Self::Unsigned => raw as f64,
            Self::Signed => ((raw << (64 - size)).cast_signed() >> (64 - size)) as f64,
            Self::Float => f64::from(f32::from_bits(raw as u32)),
            Self::Double => f64::from_bits(raw),
        }
    }
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
    /// Reads a DBC. Text that is neither UTF-8 nor UTF-16 is read as Latin-1.
    ///
    /// # Errors
    /// The file cannot be read, is no DBC, or has a signal of an impossible size.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let bytes = trace::read_small(path, LARGEST_LIST).map_err(LogError::io(path))?;
        Self::parse(path, &trace::text::text_of(&bytes))
    }

    fn parse(path: &Path, text: &str) -> Result<Self, LogError> {
        let dbc = Dbc::try_from(text).map_err(|error| no_dbc(path, &error))?;
        let entries = Entries::of(&dbc);
        let mut database = Self { messages: HashMap::new(), channels: Vec::new(), same_identifier: BTreeMap::new() };
        let mut first_names: HashMap<Key, &str> = HashMap::new();
        for message in &dbc.messages {
            let key = match message.id {
                MessageId::Standard(id) => (false, u32::from(id)),
                MessageId::Extended(id) => (true, id),
            };
            let multiplexors = Multiplexors::of(&entries, message);
            let mut signals = Vec::with_capacity(message.signals.len());
            for signal in &message.signals {
                let channel = database.channels.len();
                let read = Signal::of(&multiplexors, message, signal, channel);
                signals.push(read.map_err(|what| LogError::file(path, what))?);
                database.channels.push(Channel {
                    name: signal.name.clone(),
                    unit: signal.unit.clone(),
                    group: message.name.clone(),
                });
            }
            let first = *first_names.entry(key).or_insert(&message.name);
            let same = database.messages.entry(key).or_default();
            if !same.is_empty() {
                let names = database.same_identifier.entry(key).or_insert_with(|| vec![first.to_owned()]);
                names.push(message.name.clone());
            }
            same.push(signals);
        }
        Ok(database)
    }

    /// The signals of all messages.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The messages that have one identifier, in sentences.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> {
        self.same_identifier.iter().map(|(key, names)| {
            let names: Vec<String> = names.iter().map(|name| format!("`{}`", error::shown(name))).collect();
            format!(
                "the messages {} have the same identifier {} in the DBC: each of its frames is read as all of them\n\
                 hint: delete those that are not on this bus",
                error::some(&names),
                super::shown(*key)
            )
        })
    }

    /// Appends the wanted signals of a frame; false if its message is not known.
    pub(crate) fn decode(&self, frame: &Frame, wanted: &[bool], batch: &mut Vec<Sample>) -> bool {
        let Some(messages) = self.messages.get(&(frame.extended, frame.id)) else { return false };
        for signals in messages {
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
        }
        true
    }
}

impl Signal {
    /// That of a DBC, whose values are those of this channel; the error is what is wrong with it.
    fn of(
        multiplexors: &Multiplexors<'_>,
        message: &can_dbc::Message,
        signal: &can_dbc::Signal,
        channel: usize,
    ) -> Result<Self, String> {
        let whole = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
        let (start, size) = (whole(signal.start_bit), whole(signal.size));
        if size == 0 || size > 64 || start >= 8 * super::PAYLOAD {
            return Err(format!(
                "signal `{}` of message `{}` has {size} bits from bit {start}, expected 1 to 64 within 64 bytes",
                signal.name, message.name
            ));
        }
        let (entries, place) = (multiplexors.entries, (message.id, signal.name.as_str()));
        let number = match (entries.floats.get(&place), signal.value_type, size) {
            (Some(SignalExtendedValueType::IEEEfloat32Bit), _, 32) => Number::Float,
            (Some(SignalExtendedValueType::IEEEdouble64bit), _, 64) => Number::Double,
            (Some(SignalExtendedValueType::IEEEfloat32Bit | SignalExtendedValueType::IEEEdouble64bit), ..) => {
                return Err(format!(
                    "signal `{}` of message `{}` is a float of {size} bits, expected 32 or 64",
                    signal.name, message.name
                ));
            }
            (_, ValueType::Signed, _) => Number::Signed,
            (_, ValueType::Unsigned, _) => Number::Unsigned,
        };
        let (factor, offset) = (signal.factor, signal.offset);
        let range = [bound(signal.min), bound(signal.max)];
        let named = Named { size, number, factor, offset, unit: &signal.unit, range };
        let names = entries.names.get(&place).copied().unwrap_or_default();
        Ok(Self {
            channel,
            bits: Bits { start, size, big_endian: signal.byte_order == ByteOrder::BigEndian },
            number,
            factor,
            offset,
            missing: named.missing(names),
            can_saturate: number == Number::Unsigned && size >= 8 && !named.ends_at_all_bits(),
            multiplexed: multiplexors.multiplexed(signal),
        })
    }

    fn value(&self, raw: u64) -> (f64, Quality) {
        if self.missing.binary_search(&raw).is_ok() {
            return (f64::NAN, Quality::Missing);
        }
        let value = self.number.of(raw, self.bits.size) * self.factor + self.offset;
        let quality = match () {
            () if !value.is_finite() => Quality::Missing,
            () if self.can_saturate && self.bits.all_set(raw) => Quality::Saturated,
            () => Quality::Good,
        };
        (value, quality)
    }
}

/// A bound of the range that the DBC states.
fn bound(value: NumericValue) -> f64 {
    match value {
        NumericValue::Uint(value) => value as f64,
        NumericValue::Int(value) => value as f64,
        NumericValue::Double(value) => value,
    }
}

/// Whether the multiplexors of a signal have its values.
fn in_force(signals: &[Signal], signal: &Signal, data: &[u8], depth: u32) -> bool {
    // A multiplexor may be multiplexed itself; a circle of them is never in force.
    const DEEPEST: u32 = 8;
    let Some(multiplexed) = &signal.multiplexed else { return true };
    let Some(by) = multiplexed.by.and_then(|by| signals.get(by)) else { return false };
    depth < DEEPEST
        && by
            .bits
            .of(data)
            .is_some_and(|raw| multiplexed.values.iter().any(|(minimum, maximum)| (*minimum..=*maximum).contains(&raw)))
        && in_force(signals, by, data, depth + 1)
}

/// The entries of a DBC about single signals, by message and name; the first one of each counts. They stand in lists after all messages:
/// to look through the lists for each signal would take a time of the square of the file's size.
struct Entries<'d> {
    floats: HashMap<(MessageId, &'d str), SignalExtendedValueType>,
    ranges: HashMap<(MessageId, &'d str), &'d ExtendedMultiplex>,
    names: HashMap<(MessageId, &'d str), &'d [ValDescription]>,
}

impl<'d> Entries<'d> {
    fn of(dbc: &'d Dbc) -> Self {
        let (mut floats, mut ranges, mut names) = (HashMap::new(), HashMap::new(), HashMap::new());
        for entry in &dbc.signal_extended_value_type_list {
            floats.entry((entry.message_id, &*entry.signal_name)).or_insert(entry.signal_extended_value_type);
        }
        for entry in &dbc.extended_multiplex {
            ranges.entry((entry.message_id, &*entry.signal_name)).or_insert(entry);
        }
        for entry in &dbc.value_descriptions {
            if let ValueDescription::Signal { message_id, name, value_descriptions } = entry {
                names.entry((*message_id, &**name)).or_insert(&**value_descriptions);
            }
        }
        Self { floats, ranges, names }
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
            return Some(Multiplexed { by, values });
        }
        let value = match signal.multiplexer_indicator {
            MultiplexIndicator::Plain | MultiplexIndicator::Multiplexor => return None,
            MultiplexIndicator::MultiplexedSignal(value)
            | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value) => value,
        };
        Some(Multiplexed { by: self.main, values: vec![(value, value)] })
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
