//! Messages and signals of a bus, from a DBC.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use can_dbc::{
    AttributeValue, ByteOrder, Dbc, DbcError, ExtendedMultiplex, MessageId, MultiplexIndicator, NumericValue,
    SignalExtendedValueType, ValDescription, ValueDescription, ValueType,
};
use trace::text_file::LARGEST_LIST;
use trace::units::Scale;

use super::bits::{Bits, Number};
use super::frame::{Frame, PAYLOAD};
use super::j1939::{self, Protocol};
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
    /// The first message of each parameter group of J1939.
    groups: HashMap<u32, Key>,
    /// What is wrong with signals that are left out.
    left_out: Vec<String>,
}

/// An identifier, and whether it is an extended one.
type Key = (bool, u32);

/// The message of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// By its identifier.
    Message(Key),
    /// By its parameter group.
    Group(Key),
}

#[derive(Debug, Clone)]
struct Signal {
    channel: usize,
    bits: Bits,
    number: Number,
    factor: Scale,
    offset: f64,
    /// Raw values that the DBC names as none, in their order.
    missing: Vec<u64>,
    /// Whether a value with every bit set is none.
    can_saturate: bool,
    /// The largest raw value that is one, of a parameter group of J1939.
    largest_raw: Option<u64>,
    /// In force only while a multiplexor has one of these values.
    multiplexed: Option<Multiplexed>,
}

#[derive(Debug, Clone)]
struct Multiplexed {
    /// Place of the multiplexor among the signals of the message; none where the message has none.
    by: Option<usize>,
    values: Vec<(u64, u64)>,
}

impl Database {
    /// Reads a DBC. Text that is neither UTF-8 nor UTF-16 is read as Latin-1.
    ///
    /// # Errors
    /// The file cannot be read or is no DBC. A signal of an impossible size is left out, with a note.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let bytes = trace::read_small(path, LARGEST_LIST).map_err(LogError::io(path))?;
        Self::of_text(path, &bytes)
    }

    /// The same of the bytes of a file; `path` is what messages call it.
    ///
    /// # Errors
    /// It is no DBC, or larger than any.
    pub fn of_text(path: &Path, bytes: &[u8]) -> Result<Self, LogError> {
        if bytes.len() as u64 > LARGEST_LIST {
            return Err(LogError::file(
                path,
                "this is larger than any DBC\nhint: check that it is the database of the bus, not a log",
            ));
        }
        Self::parse(path, &trace::text::text_of(bytes))
    }

    fn parse(path: &Path, text: &str) -> Result<Self, LogError> {
        let dbc = Dbc::try_from(text).map_err(|error| no_dbc(path, &error))?;
        let entries = Entries::of(&dbc);
        let mut database = Self {
            messages: HashMap::new(),
            channels: Vec::new(),
            same_identifier: BTreeMap::new(),
            groups: HashMap::new(),
            left_out: Vec::new(),
        };
        let mut first_names: HashMap<Key, &str> = HashMap::new();
        for message in &dbc.messages {
            let key = match message.id {
                MessageId::Standard(id) => (false, u32::from(id)),
                MessageId::Extended(id) => (true, id),
            };
            let is_group = entries.protocol.is_group(message.id);
            if let (true, (_, id)) = (is_group, key) {
                database.groups.entry(j1939::parameter_group(id)).or_insert(key);
            }
            let numbers = message.signals.iter().map(|signal| (signal, entries.number(message, signal)));
            let (sound, faults): (Vec<_>, Vec<_>) = numbers.partition(|(_, number)| number.is_ok());
            database.left_out.extend(faults.into_iter().filter_map(|(_, number)| number.err()));
            let sound: Vec<(&can_dbc::Signal, Number)> =
                sound.into_iter().filter_map(|(signal, number)| Some((signal, number.ok()?))).collect();
            let multiplexors = Multiplexors::of(&entries, message.id, &sound);
            let mut signals = Vec::with_capacity(sound.len());
            for (signal, number) in &sound {
                let channel = database.channels.len();
                signals.push(Signal::of(&multiplexors, signal, *number, (channel, is_group)));
                database.channels.push(Channel {
                    name: entries.name(message.id, signal).to_owned(),
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

    /// The messages that have one identifier, and signals that are left out, in sentences.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> {
        let left_out = self.left_out.iter().map(|what| format!("{what}: it is left out"));
        let same = self.same_identifier.iter().map(|(key, names)| {
            let names: Vec<String> = names.iter().map(|name| format!("`{}`", error::shown(name))).collect();
            format!(
                "the messages {} have the same identifier {} in the DBC: each of its frames is read as all of them\n\
                 hint: delete those that are not on this bus",
                error::some(&names),
                super::shown(*key)
            )
        });
        same.chain(left_out)
    }

    /// The message of a frame, by its identifier or else by its parameter group.
    pub(super) fn find(&self, frame: &Frame) -> Option<Found> {
        let key = (frame.extended, frame.id);
        if self.messages.contains_key(&key) {
            return Some(Found::Message(key));
        }
        let group = || self.groups.get(&j1939::parameter_group(frame.id)).copied();
        frame.extended.then(group)?.map(Found::Group)
    }

    /// Appends the wanted signals of a frame with this message.
    pub(super) fn decode(&self, found: Found, frame: &Frame, wanted: &[bool], batch: &mut Vec<Sample>) {
        let (Found::Message(key) | Found::Group(key)) = found;
        for signals in self.messages.get(&key).into_iter().flatten() {
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
    }
}

impl Signal {
    /// That of a DBC, whose values are those of this channel; whether it is of a parameter group of J1939.
    fn of(
        multiplexors: &Multiplexors<'_>,
        signal: &can_dbc::Signal,
        number: Number,
        (channel, is_of_group): (usize, bool),
    ) -> Self {
        let [start, size] = place_of(signal);
        let (entries, place) = (multiplexors.entries, (multiplexors.message, signal.name.as_str()));
        let (factor, offset) = (signal.factor, signal.offset);
        let range = [bound(signal.min), bound(signal.max)];
        let named = Named { size, number, factor, offset, unit: &signal.unit, range };
        let names = entries.names.get(&place).copied().unwrap_or_default();
        Self {
            channel,
            bits: Bits { start, size, big_endian: signal.byte_order == ByteOrder::BigEndian },
            number,
            factor: Scale::of(factor),
            offset,
            missing: named.missing(names),
            can_saturate: number == Number::Unsigned && size >= 8 && !named.ends_at_all_bits(),
            largest_raw: j1939::largest_raw(size).filter(|_| is_of_group && number == Number::Unsigned),
            multiplexed: multiplexors.multiplexed(signal),
        }
    }

    fn value(&self, raw: u64) -> (f64, Quality) {
        if self.missing.binary_search(&raw).is_ok() || self.largest_raw.is_some_and(|largest| raw > largest) {
            return (f64::NAN, Quality::Missing);
        }
        let value = self.factor.of_value(self.number.of(raw, self.bits.size)) + self.offset;
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
    /// Names of signals that are longer than the 32 characters of a DBC.
    long_names: HashMap<(MessageId, &'d str), &'d str>,
    protocol: Protocol<'d>,
}

/// First bit and number of bits.
fn place_of(signal: &can_dbc::Signal) -> [usize; 2] {
    [signal.start_bit, signal.size].map(|number| usize::try_from(number).unwrap_or(usize::MAX))
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
        let mut long_names = HashMap::new();
        for given in dbc.attribute_values_signal.iter().filter(|given| given.name == "SystemSignalLongSymbol") {
            if let AttributeValue::String(name) = &given.value {
                long_names.entry((given.message_id, &*given.signal_name)).or_insert(&**name);
            }
        }
        Self { floats, ranges, names, long_names, protocol: Protocol::of(dbc) }
    }

    /// The name of a signal: the long one, where there is one.
    fn name(&self, message: MessageId, signal: &'d can_dbc::Signal) -> &'d str {
        self.long_names.get(&(message, &*signal.name)).copied().unwrap_or(&signal.name)
    }

    /// What the bits of a signal are; the error is what is wrong with it.
    fn number(&self, message: &can_dbc::Message, signal: &can_dbc::Signal) -> Result<Number, String> {
        let [start, size] = place_of(signal);
        let named = format!("signal `{}` of message `{}`", shown(&signal.name), shown(&message.name));
        if size == 0 || size > 64 || start >= 8 * PAYLOAD {
            return Err(format!("{named} has {size} bits from bit {start}, expected 1 to 64 within 64 bytes"));
        }
        match (self.floats.get(&(message.id, &*signal.name)), signal.value_type, size) {
            (Some(SignalExtendedValueType::IEEEfloat32Bit), _, 32) => Ok(Number::Float),
            (Some(SignalExtendedValueType::IEEEdouble64bit), _, 64) => Ok(Number::Double),
            (Some(SignalExtendedValueType::IEEEfloat32Bit | SignalExtendedValueType::IEEEdouble64bit), ..) => {
                Err(format!("{named} is a float of {size} bits, expected 32 or 64"))
            }
            (_, ValueType::Signed, _) => Ok(Number::Signed),
            (_, ValueType::Unsigned, _) => Ok(Number::Unsigned),
        }
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
    fn of(entries: &'d Entries<'d>, message: MessageId, signals: &[(&'d can_dbc::Signal, Number)]) -> Self {
        let mut places = HashMap::new();
        for (place, (signal, _)) in signals.iter().enumerate() {
            places.entry(&*signal.name).or_insert(place);
        }
        let main = signals.iter().position(|(signal, _)| {
            signal.multiplexer_indicator == MultiplexIndicator::Multiplexor
                && !entries.ranges.contains_key(&(message, &*signal.name))
        });
        Self { message, entries, places, main }
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
