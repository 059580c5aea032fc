//! What a reader refuses, by its error.

use crate::ConfigError;

/// What a reader refuses.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Wrong {
    /// A key that does not exist, and those that do.
    Unknown { key: String, known: Vec<String> },
    /// A key that is missing, of the table with this name where it is known.
    Missing { table: Option<String>, key: String },
    /// A value of another type, or a word that is none of those that are possible, and what is expected.
    Type { found: String, expected: String },
    /// A number outside its range: its key, and the nearest number and the middle one within.
    Range { key: String, within: [f64; 2] },
    /// A value that is wrong by itself, as an interval that does not contain what it must: its key.
    Value { key: String },
    /// A name in quotes of something that does not exist, and the names of what does.
    Name { key: String, name: String, known: Vec<String> },
    /// The whole file, which is of another kind.
    Kind,
    /// A list that is not as long as another one.
    Length { key: String, wanted: usize },
    /// A list that does not rise.
    Order { key: String },
    /// What this key means beside others.
    Meaning { key: String },
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
                        let middle = low + 0.5 * (high - low);
                        let are_whole = high - low >= 4.0 && low.fract() == 0.0 && high.fract() == 0.0;
                        let middle = if are_whole { middle.floor() } else { middle };
                        Self::Range { key: key.clone(), within: [near, middle] }
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
            ConfigError::Meaning { key, message, .. } if message.contains("above the breakpoint before it") => {
                Self::Order { key: key.clone() }
            }
            ConfigError::Meaning { key, message, .. } if is_of_value_alone(message) => Self::Value { key: key.clone() },
            ConfigError::Meaning { key, message, hint, .. } => {
                let key = key.clone();
                match (of_name(message, hint.as_deref()), length(message)) {
                    (Some((name, known)), _) => Self::Name { key, name, known },
                    (_, Some(wanted)) => Self::Length { key, wanted },
                    _ => Self::Meaning { key },
                }
            }
            ConfigError::Syntax { message, .. } => match message {
                // A channel map has roles as keys.
                message if ["unknown key `", "there is no signal `"].iter().any(|begin| message.starts_with(begin)) => {
                    let mut names = all_quoted(message).into_iter();
                    names.next().map_or(Self::Other, |key| Self::Unknown { key, known: names.collect() })
                }
                message if message.starts_with("this looks like a") => Self::Kind,
                message if message.starts_with("channel `") => Self::Value { key: "unit".to_owned() },
                // A value of a channel map.
                message if message.starts_with('`') => quoted(message).map_or(Self::Other, |key| {
                    let value = message.split_once("` is ").and_then(|(_, rest)| rest.split([',', '\n']).next());
                    match value.and_then(|value| value.trim().parse::<f64>().ok()) {
                        Some(_) => Self::Range { key, within: [1.0, 2.0] },
                        None => Self::Value { key },
                    }
                }),
                message if message.starts_with("missing key `") => {
                    quoted(message).map_or(Self::Other, |key| Self::Missing { table: None, key })
                }
                message => {
                    let is_type = ["invalid type", "invalid length", "unknown variant", "invalid value"];
                    let expected = message.lines().next().and_then(|first| first.split_once("expected "));
                    match expected.filter(|_| is_type.iter().any(|begin| message.starts_with(begin))) {
                        Some((found, expected)) => {
                            let found = found.split_once(": ").map_or("", |(_, found)| found).trim_end_matches(", ");
                            Self::Type { found: found.to_owned(), expected: expected.to_owned() }
                        }
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
    let parts = [
        " does not contain ",
        "has no such command",
        " must be two numbers",
        "` must be above 0",
        "`levels` must be",
        "`chance` must be",
        "expected an integer",
        "a table needs at least",
        "must begin with `car.`",
        "is not between",
        "No such file",
        " of the factor is refused",
        "a name must not",
        "a title must not",
        "cannot be the name of a file",
    ];
    message.starts_with("expected [") || parts.iter().any(|part| message.contains(part))
}

/// How long a list must be that is not as long as its axis.
fn length(message: &str) -> Option<usize> {
    let (axis, _) = message.split_once(" breakpoints, but the table has ")?;
    axis.rsplit(' ').next()?.parse().ok()
}

/// The name of what does not exist, and those that the hint lists.
fn of_name(message: &str, hint: Option<&str>) -> Option<(String, Vec<String>)> {
    let of_table = || message.split_once("[clutch.")?.1.split(']').next();
    let name = message.split('"').nth(1).or_else(of_table)?;
    let (_, known) = hint?.split_once("s are ")?;
    (message.starts_with("there is no ") || message.contains(" has no "))
        .then(|| (name.to_owned(), known.split(", ").map(str::to_owned).collect()))
}
