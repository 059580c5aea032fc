//! What a reader refuses, by its error.

use crate::ConfigError;

/// What a reader refuses.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Wrong {
    /// A key that does not exist, and those that do.
    Unknown { key: String, known: Vec<String> },
    /// A key that is missing, of the table with this name where it is known.
    Missing { table: Option<String>, key: String },
    /// A value of another type, or a word that is none of those that are possible: what is expected.
    Type(String),
    /// A number outside its range: its key, and the nearest number and the middle one within.
    Range { key: String, within: [f64; 2] },
    /// A value that is wrong by itself, as an interval that does not contain what it must: its key.
    Value { key: String },
    /// The whole file, which is of another kind.
    Kind,
    /// Anything else.
    Other,
}

impl Wrong {
    /// Whether a key is one that does not exist.
    pub(super) fn is_unknown_key(&self) -> bool {
        matches!(self, Self::Unknown { .. })
    }

    pub(super) fn of(error: &ConfigError) -> Self {
        let all_quoted = |text: &str| text.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
        let quoted = |text: &str| all_quoted(text).into_iter().next();
        match error {
            ConfigError::Range { key, value, allowed, .. } => {
                let ends: Vec<f64> = allowed.split(" to ").filter_map(|end| end.parse().ok()).collect();
                match ends[..] {
                    [low, high] if low <= high => {
                        let near = if value.is_nan() { low } else { value.clamp(low, high) };
                        Self::Range { key: key.clone(), within: [near, low + 0.5 * (high - low)] }
                    }
                    _ => Self::Other,
                }
            }
            ConfigError::Meaning { key, message, .. } if message.starts_with("missing `") => match quoted(message) {
                // A key outside all tables is named alone.
                Some(missing) if missing == *key => Self::Missing { table: None, key: missing },
                Some(missing) => Self::Missing { table: Some(key.clone()), key: missing },
                None => Self::Other,
            },
            ConfigError::Meaning { key, message, .. } if message == "is missing" => match key.rsplit_once('.') {
                Some((table, key)) => Self::Missing { table: Some(table.to_owned()), key: key.to_owned() },
                None => Self::Missing { table: None, key: key.clone() },
            },
            ConfigError::Meaning { key, message, .. } if is_of_value_alone(message) => Self::Value { key: key.clone() },
            ConfigError::Syntax { message, .. } => match message {
                // A channel map has roles as keys.
                message
                    if ["unknown field `", "unknown key `", "there is no role `"]
                        .iter()
                        .any(|begin| message.starts_with(begin)) =>
                {
                    let mut names = all_quoted(message).into_iter();
                    names.next().map_or(Self::Other, |key| Self::Unknown { key, known: names.collect() })
                }
                message if message.starts_with("this looks like a") => Self::Kind,
                message if message.ends_with(" must name the channel") => {
                    let table = quoted(message).and_then(|key| Some(key.rsplit_once('.')?.0.to_owned()));
                    Self::Missing { table, key: "name".to_owned() }
                }
                message if message.starts_with('`') && message.contains("` is ") => {
                    quoted(message).map_or(Self::Other, |key| Self::Range { key, within: [1.0, 2.0] })
                }
                message if message.starts_with("missing field `") => {
                    quoted(message).map_or(Self::Other, |key| Self::Missing { table: None, key })
                }
                message => {
                    let is_type = ["invalid type", "invalid length", "unknown variant", "invalid value"];
                    let expected = message.lines().next().and_then(|first| first.split_once("expected "));
                    match expected.filter(|_| is_type.iter().any(|begin| message.starts_with(begin))) {
                        Some((_, expected)) => Self::Type(expected.to_owned()),
                        None => Self::Other,
                    }
                }
            },
            _ => Self::Other,
        }
    }
}

/// Whether an error follows from the value alone, whatever others are.
fn is_of_value_alone(message: &str) -> bool {
    let parts = [" does not contain ", "has no such command", " must be two numbers"];
    message.starts_with("expected [") || parts.iter().any(|part| message.contains(part))
}
