//! Two vehicle files, or two gearbox files, over each other.

use std::collections::BTreeMap;
use std::path::Path;

use config::{CarFile, DefaultTaken, GearboxFile, Kind, Source};
use trace::units::of_key;
use trace::{ShownPath as _, toml_string};

use crate::Error;

/// Values of two files.
#[derive(Debug, Clone)]
pub struct FileComparison {
    /// What the files are, such as `a gearbox file`.
    pub kind: &'static str,
    /// The files, each with the gearbox file that it names.
    pub sources: [Vec<Source>; 2],
    /// The keys whose values differ, the largest relative difference first.
    pub differences: Vec<KeyDifference>,
    /// How many keys have the same value in both.
    pub same: usize,
}

/// A key whose value differs.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyDifference {
    /// The key with its tables; one of the gearbox file of a car begins with `gearbox: `.
    pub key: String,
    /// Its values; none where a file does not have it.
    pub values: [Option<FileValue>; 2],
    /// The unit by its name.
    pub unit: Option<&'static str>,
    /// The second value less the first, over the size of the first; of lists that with the largest size, over the largest value of the
    /// first. None of words, and of lists of different lengths.
    pub relative: Option<f64>,
}

/// A value of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct FileValue {
    /// As TOML.
    pub text: String,
    /// As numbers: one, or those of a list; none of words.
    pub numbers: Vec<f64>,
    /// Whether it is not in the file, but a default.
    pub is_default: bool,
}

impl FileValue {
    fn of(text: String) -> Self {
        let numbers = serde_json::from_str(&text).map_or_else(|_| Vec::new(), |value| numbers_of(&value));
        Self { text, numbers, is_default: false }
    }

    fn of_default(taken: &DefaultTaken) -> Self {
        // A list in several lines, as it stands in the file of the defaults.
        let line = taken.value.split_whitespace().collect::<Vec<_>>().join(" ");
        Self { is_default: true, ..Self::of(line.replace("[ ", "[").replace(", ]", "]")) }
    }

    /// The value in a line.
    pub fn short(&self) -> String {
        /// Longest value that is shown as it stands in a file.
        const LONGEST: usize = 28;
        let text = match (self.text.chars().count(), self.numbers.len()) {
            (0..=LONGEST, _) => self.text.clone(),
            (_, 0) => self.text.chars().take(LONGEST).chain(['\u{2026}']).collect(),
            (_, count) => format!("{count} values"),
        };
        if self.is_default { format!("{text} (default)") } else { text }
    }
}

/// The numbers of a value or of a list of values; none where one is no number.
fn numbers_of(value: &serde_json::Value) -> Vec<f64> {
    match value {
        serde_json::Value::Number(number) => number.as_f64().into_iter().collect(),
        serde_json::Value::Array(list) => {
            let all: Vec<Vec<f64>> = list.iter().map(numbers_of).collect();
            if all.iter().any(Vec::is_empty) { Vec::new() } else { all.concat() }
        }
        _ => Vec::new(),
    }
}

type Values = BTreeMap<String, FileValue>;

/// Compares two files of one kind.
pub(super) fn compare(a: &Path, b: &Path) -> Result<FileComparison, Error> {
    let (kind, other) = (kind_of(a)?, kind_of(b)?);
    if kind != other {
        return Err(Error::Input(format!(
            "{} is {}, and {} is {}\nhint: compare two files of one kind",
            a.shown(),
            kind.words(),
            b.shown(),
            other.words()
        )));
    }
    let [(sources_a, ours), (sources_b, theirs)] = [read(a, kind)?, read(b, kind)?];
    let [ours, theirs] = [without_defaults(&ours, &theirs), without_defaults(&theirs, &ours)];
    let mut keys: Vec<&String> = ours.keys().chain(theirs.keys()).collect();
    keys.sort_unstable();
    keys.dedup();
    let all = keys.len();
    let mut differences: Vec<KeyDifference> =
        keys.into_iter().filter_map(|key| difference(key, [ours.get(key), theirs.get(key)])).collect();
    let size = |difference: &KeyDifference| difference.relative.map_or(f64::INFINITY, f64::abs);
    differences.sort_by(|a, b| size(b).total_cmp(&size(a)).then_with(|| a.key.cmp(&b.key)));
    let same = all - differences.len();
    Ok(FileComparison { kind: kind.words(), sources: [sources_a, sources_b], differences, same })
}

/// Values without the defaults that the other file does not have, or has as well.
fn without_defaults(values: &Values, others: &Values) -> Values {
    let differs = |(key, value): &(&String, &FileValue)| {
        !value.is_default || others.get(*key).is_some_and(|other| !other.is_default || other.text != value.text)
    };
    values.iter().filter(differs).map(|(key, value)| (key.clone(), value.clone())).collect()
}

fn kind_of(path: &Path) -> Result<Kind, Error> {
    let kind = Source::read(path)?.kind()?;
    match kind {
        Kind::Vehicle | Kind::Car | Kind::Gearbox => Ok(kind),
        other => Err(Error::Input(format!(
            "{}: this is {}, expected a vehicle file or a gearbox file\nhint: runs are compared by what `estimate` or `simulate` has written",
            path.shown(),
            other.words()
        ))),
    }
}

/// The values of a file, defaults included.
fn read(path: &Path, kind: Kind) -> Result<(Vec<Source>, Values), Error> {
    Ok(match kind {
        Kind::Gearbox => {
            let file = GearboxFile::read(path)?;
            let values = values(&file.source, &[], "");
            (vec![file.source], values)
        }
        Kind::Car => {
            let file = CarFile::read(path)?;
            let mut all = values(&file.source, &file.defaults_taken, "");
            // What is in it is compared, and not where it is.
            if let (Some(named), Some(file)) = (all.get_mut("gearbox"), file.gearbox_source.path.file_name()) {
                *named = FileValue::of(toml_string(&file.to_string_lossy()));
            }
            all.extend(values(&file.gearbox_source, &[], "gearbox: "));
            (vec![file.source, file.gearbox_source], all)
        }
        _ => {
            let file = config::VehicleFile::read(path)?;
            let values = values(&file.source, &file.defaults_taken, "");
            (vec![file.source], values)
        }
    })
}

fn values(source: &Source, defaults: &[DefaultTaken], begin: &str) -> Values {
    let defaults = defaults.iter().map(|taken| (taken.key.clone(), FileValue::of_default(taken)));
    let given = named(source.values()).into_iter().map(|(key, text)| (key, FileValue::of(text)));
    defaults.chain(given).map(|(key, value)| (format!("{begin}{key}"), value)).collect()
}

/// Entries of lists by their names in place of their numbers: `gear.0.ratio` is `gear.1st.ratio`.
fn named(values: BTreeMap<String, String>) -> BTreeMap<String, String> {
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let names: Vec<(String, String)> = values
        .iter()
        .filter_map(|(key, text)| {
            let entry = key.strip_suffix(".name")?;
            let (list, place) = entry.rsplit_once('.')?;
            is_number(place).then(|| (format!("{entry}."), format!("{list}.{}.", text.trim_matches(['"', '\'']))))
        })
        .collect();
    let renamed = |key: String| {
        let entry = names.iter().find(|(entry, _)| key.starts_with(entry));
        entry.map_or(key.clone(), |(entry, name)| format!("{name}{}", &key[entry.len()..]))
    };
    values.into_iter().map(|(key, text)| (renamed(key), text)).collect()
}

/// The difference of a key; none where both values are the same.
fn difference(key: &str, values: [Option<&FileValue>; 2]) -> Option<KeyDifference> {
    let relative = match values {
        [Some(a), Some(b)] if a.text == b.text || !a.numbers.is_empty() && a.numbers == b.numbers => return None,
        [Some(a), Some(b)] => relative(&a.numbers, &b.numbers),
        _ => None,
    };
    let values = values.map(|value| value.cloned());
    Some(KeyDifference { key: key.to_owned(), values, unit: of_key(key), relative })
}

fn relative(a: &[f64], b: &[f64]) -> Option<f64> {
    let size = a.iter().fold(0.0, |size: f64, value| size.max(value.abs()));
    let largest = a.iter().zip(b).map(|(a, b)| b - a).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    (a.len() == b.len() && size > 0.0).then(|| largest / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> FileValue {
        FileValue::of(text.to_owned())
    }

    #[test]
    fn numbers_and_lists_have_a_relative_difference_and_words_have_none() {
        let relative = |a: &str, b: &str| difference("k", [Some(&of(a)), Some(&of(b))]).unwrap().relative;
        assert_eq!(relative("2.0", "3.0"), Some(0.5));
        assert_eq!(relative("[1.0, -4.0]", "[1.0, -2.0]"), Some(0.5));
        assert_eq!(relative("[[1.0, 2.0], [3.0, 4.0]]", "[[1.0, 2.0], [3.0, 3.0]]"), Some(-0.25));
        assert_eq!(relative("[1.0, 2.0]", "[1.0]"), None);
        assert_eq!(relative("\"a\"", "\"b\""), None);
        assert_eq!(relative("0.0", "1.0"), None);
        // 2 and 2.0 are the same number.
        assert_eq!(difference("k", [Some(&of("2")), Some(&of("2.0"))]), None);
    }

    #[test]
    fn entries_of_lists_go_by_their_names() {
        let values = [("gear.0.name", "\"R\""), ("gear.0.ratio", "3"), ("gear.10.ratio", "1"), ("name", "\"x\"")];
        let values = named(values.map(|(key, text)| (key.to_owned(), text.to_owned())).into());
        let keys: Vec<&str> = values.keys().map(String::as_str).collect();
        assert_eq!(keys, ["gear.10.ratio", "gear.R.name", "gear.R.ratio", "name"]);
    }

    #[test]
    fn a_long_value_is_counted() {
        assert_eq!(of("[100.0, 200.0, 300.0, 400.0, 500.0]").short(), "5 values");
        assert_eq!(of("0.5").short(), "0.5");
    }
}
