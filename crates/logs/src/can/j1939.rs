//! Parameter groups of J1939: a message is known by its group, whatever its priority, source and destination are.

use std::collections::HashMap;

use can_dbc::{AttributeDefinition, AttributeValue, AttributeValueType, Dbc, MessageId};

/// Source address that a DBC writes where any is meant.
const ANY_SOURCE: u32 = 0xfe;
/// Highest byte of a value; above are indicators, errors and values that are not available.
const HIGHEST: u64 = 0xfa;

/// The number of the parameter group of an identifier. A format below 240 is sent to one destination, which is no part of it.
pub(super) fn parameter_group(id: u32) -> u32 {
    let (pages, format, specific) = (id >> 24 & 3, id >> 16 & 0xff, id >> 8 & 0xff);
    pages << 16 | format << 8 | if format < 240 { 0 } else { specific }
}

/// The source address of an identifier.
pub(super) fn source(id: u32) -> u32 {
    id & 0xff
}

/// The largest raw value of so many bits that is one.
pub(super) fn largest_raw(size: usize) -> Option<u64> {
    matches!(size, 8 | 16 | 24 | 32).then(|| ((HIGHEST + 1) << (size - 8)) - 1)
}

/// What a DBC says of its messages.
pub(super) struct Protocol<'d> {
    /// Whether the whole bus is one of J1939.
    is_of_all: bool,
    /// `VFrameFormat` of messages, and of all others.
    formats: HashMap<MessageId, &'d AttributeValue>,
    other_format: Option<&'d AttributeValue>,
    /// Its words, in the order of their numbers.
    words: &'d [String],
}

/// The attribute of a message that says its format.
const FORMAT: &str = "VFrameFormat";

impl<'d> Protocol<'d> {
    pub(super) fn of(dbc: &'d Dbc) -> Self {
        let given = dbc.attribute_values_database.iter().find(|given| given.name == "ProtocolType");
        let value = given.map(|given| &given.value).or_else(|| dbc.attribute_default("ProtocolType"));
        let is_of_all = matches!(value, Some(AttributeValue::String(text)) if text.contains("J1939"));
        let formats = dbc.attribute_values_message.iter().filter(|given| given.name == FORMAT);
        let words = dbc.attribute_definitions.iter().find_map(|definition| match definition {
            AttributeDefinition::Message(name, AttributeValueType::Enum(words)) if name == FORMAT => Some(&words[..]),
            _ => None,
        });
        Self {
            is_of_all,
            formats: formats.map(|given| (given.message_id, &given.value)).collect(),
            other_format: dbc.attribute_default(FORMAT),
            words: words.unwrap_or_default(),
        }
    }

    /// Whether a message is a parameter group.
    pub(super) fn is_group(&self, message: MessageId) -> bool {
        let MessageId::Extended(id) = message else { return false };
        self.is_of_all || source(id) == ANY_SOURCE || self.frame_format(message).is_some_and(|it| it == "J1939PG")
    }

    /// The format of a message: given as a word, or as its place in the list of words.
    fn frame_format(&self, message: MessageId) -> Option<&'d str> {
        let place = match self.formats.get(&message).copied().or(self.other_format)? {
            AttributeValue::String(text) => return Some(text),
            AttributeValue::Uint(place) => usize::try_from(*place).ok()?,
            AttributeValue::Int(place) => usize::try_from(*place).ok()?,
            AttributeValue::Double(_) => return None,
        };
        self.words.get(place).map(String::as_str)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_group_is_without_priority_source_and_destination() {
        // EEC1 of two sources and priorities; TSC1, which is sent to one destination; ETC1.
        assert_eq!([0x0cf0_0400, 0x18f0_0417].map(parameter_group), [61444; 2]);
        assert_eq!([0x0c00_0003, 0x0c00_ff27].map(parameter_group), [0; 2]);
        assert_eq!(parameter_group(0x0cf0_0203), 61442);
        assert_eq!(parameter_group(0x19fe_cafe), 0x1_feca);
    }

    #[test]
    fn values_above_the_highest_are_none() {
        assert_eq!([8, 16, 32, 12].map(largest_raw), [Some(0xfa), Some(0xfaff), Some(0xfaff_ffff), None]);
    }
}
