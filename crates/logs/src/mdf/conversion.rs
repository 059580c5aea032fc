//! Conversions that make text of some or all numbers, or cannot be read.

use falcon_mdf::blocks::conversion::ConversionOutput;
use falcon_mdf::{Conversion, TableEntry};

/// Whether a conversion takes texts.
pub(super) fn is_by_text(conversion: &Conversion) -> bool {
    matches!(conversion, Conversion::TextToValue { .. } | Conversion::TextToText { .. })
}

/// Whether the numbers of a channel are those before the conversion: it makes texts of all of them, or of some and leaves the others as they
/// are. Where it scales the others, a number that becomes a text stands on another scale: it has no value.
pub(super) fn keeps_numbers(conversion: &Conversion) -> bool {
    conversion.output() == ConversionOutput::Text && !has_scale(conversion)
}

/// Whether a table of texts scales some numbers.
fn has_scale(table: &Conversion) -> bool {
    nested(table).any(|own| !own.is_identity() && (own.output() != ConversionOutput::Text || has_scale(own)))
}

/// Why a conversion, or one that it names for some numbers, cannot be read; none if it can.
pub(super) fn unreadable(conversion: &Conversion) -> Option<&str> {
    match conversion {
        Conversion::Unsupported { reason, .. } => Some(reason),
        other => nested(other).find_map(unreadable),
    }
}

/// The conversions that a table of texts names in place of texts.
fn nested(table: &Conversion) -> impl Iterator<Item = &Conversion> {
    let (entries, default) = match table {
        Conversion::ValueToText { entries, default, .. } | Conversion::RangeToText { entries, default, .. } => {
            (entries.as_slice(), default.as_ref())
        }
        _ => (&[][..], None),
    };
    entries.iter().chain(default).filter_map(|entry| match entry {
        TableEntry::Nested(own) => Some(&**own),
        _ => None,
    })
}
