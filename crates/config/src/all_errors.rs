//! All errors of a file, where its reader ends at the first one.
//!
//! The reader gets a draft of the text in which what it has refused is mended, again and again: an unknown key is taken out, a missing one is put
//! in, and a value of another type or outside its range is replaced. What is put in is never reported. What a value means beside others is
//! reported as long as all of them are those of the file.

use std::collections::HashSet;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::{ConfigError, Source};

/// Most times that a file is read.
const READINGS: usize = 100;
/// Most times that one place is mended.
const MENDED_MAX: usize = 6;

/// What is put in place of what is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Guess {
    /// One, or the nearest number within the range.
    Near,
    /// Two, or the middle of the range.
    Middle,
}

/// The errors of a file by its reader, in the order of their lines; empty for a file without any.
///
/// A range may follow from another value. So the file is read with two guesses of what is wrong, and a value that is outside its range with one
/// of them alone is none of the errors.
pub fn all_errors(source: &Source, read: &dyn Fn(Source) -> Result<(), ConfigError>) -> Vec<ConfigError> {
    let (mut errors, _) = errors_with(Guess::Near, source, read);
    if errors.len() > 1 {
        let (others, is_whole) = errors_with(Guess::Middle, source, read);
        let is_in_both = |error: &ConfigError| {
            let ConfigError::Range { line, key, .. } = error else { return true };
            let is_same_place = |other: &&ConfigError| matches!(other, ConfigError::Range { line: at, key: of, .. } if (at, of) == (line, key));
            let other = others.iter().find(is_same_place);
            other.map_or(!is_whole, |other| other.to_string() == error.to_string())
        };
        errors.retain(is_in_both);
    }
    errors.sort_by_key(|error| error.line().unwrap_or(usize::MAX));
    errors.dedup_by(|one, other| one.to_string() == other.to_string());
    errors
}

/// The errors with one guess, and whether the reader came to the end.
fn errors_with(
    guess: Guess,
    source: &Source,
    read: &dyn Fn(Source) -> Result<(), ConfigError>,
) -> (Vec<ConfigError>, bool) {
    let mut draft = Draft { text: source.text.clone(), added: Vec::new(), guessed: HashSet::new(), guess };
    let mut found: Vec<ConfigError> = Vec::new();
    let mut mended: Vec<String> = Vec::new();
    for _ in 0..READINGS {
        let Err(error) = read(Source { path: source.path.clone(), text: draft.text.clone() }) else {
            return (found, true);
        };
        let place = error.line().filter(|_| error.path() == source.path);
        let Some(line) = place else {
            // The error of another file, which this one names.
            found.push(error);
            break;
        };
        let wrong = Wrong::of(&error);
        let is_own = !draft.is_guessed(line, &wrong);
        let is_sure = draft.added.is_empty() && draft.guessed.is_empty();
        let is_reported = is_own && (is_sure || !matches!(wrong, Wrong::Other));
        let meant = draft.meant(line, &wrong);
        if is_reported {
            found.extend(draft.reported(error, line, meant.as_ref()));
        }
        let attempt = format!("{line} {wrong:?}");
        let attempts = mended.iter().filter(|other| **other == attempt).count();
        let is_mended = attempts < MENDED_MAX
            && match &meant {
                Some(meant) => draft.rename(meant),
                None => draft.mend(line, &wrong),
            };
        if !is_mended {
            break;
        }
        mended.push(attempt);
    }
    (found, false)
}

/// A key that is there in place of one that is missing.
#[derive(Debug, Clone, PartialEq)]
struct Meant {
    /// Line of the key in the draft, and its place.
    line: usize,
    place: Range<usize>,
    written: String,
    missing: String,
}

/// What a reader refuses.
#[derive(Debug, Clone, PartialEq)]
enum Wrong {
    /// A key that does not exist, and those that do.
    Unknown { key: String, known: Vec<String> },
    /// A key that is missing, of the table with this name where it is known.
    Missing { table: Option<String>, key: String },
    /// A value of another type, or a word that is none of those that are possible: what is expected.
    Type(String),
    /// A number outside its range: its key, and the nearest number and the middle one within.
    Range { key: String, within: [f64; 2] },
    /// Anything else.
    Other,
}

impl Wrong {
    fn of(error: &ConfigError) -> Self {
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
            ConfigError::Syntax { message, .. } => match message {
                // A channel map has roles as keys.
                message if ["unknown field `", "there is no role `"].iter().any(|begin| message.starts_with(begin)) => {
                    let mut names = all_quoted(message).into_iter();
                    names.next().map_or(Self::Other, |key| Self::Unknown { key, known: names.collect() })
                }
                message if message.ends_with(" must say the channel") => {
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

/// A text that is mended.
struct Draft {
    text: String,
    /// Lines that are not in the file, from the first to the last, counted from 1.
    added: Vec<usize>,
    /// Places with values that are not those of the file: lines, with the key of a number.
    guessed: HashSet<(usize, String)>,
    guess: Guess,
}

/// A key of a table with its value.
struct Entry {
    /// The tables that it is in.
    tables: String,
    key: Range<usize>,
    value: Range<usize>,
    /// Places of the values of a list.
    items: Vec<Range<usize>>,
    is_table: bool,
}

impl Draft {
    /// The line of the file that is this line of the draft.
    fn line_of_file(&self, line: usize) -> usize {
        line - self.added.iter().filter(|added| **added < line).count()
    }

    /// Whether what is wrong was put in.
    fn is_guessed(&self, line: usize, wrong: &Wrong) -> bool {
        let key = match wrong {
            Wrong::Range { key, .. } => key.as_str(),
            // A key that is missing in a table that was put in.
            Wrong::Missing { .. } | Wrong::Unknown { .. } => return self.added.contains(&line),
            _ => "",
        };
        self.added.contains(&line) || self.guessed.contains(&(line, key.to_owned()))
    }

    /// The key that is written in place of one that is missing: another by a letter or two.
    fn meant(&self, line: usize, wrong: &Wrong) -> Option<Meant> {
        let entries = self.entries();
        let name =
            |entry: &Entry| self.text.get(entry.key.clone()).unwrap_or_default().trim_matches(['"', '\'']).to_owned();
        let has = |tables: &str, key: &str| entries.iter().any(|entry| entry.tables == tables && name(entry) == key);
        let meant = |entry: &Entry, missing: &str| Meant {
            line: self.line(entry.key.start),
            place: entry.key.clone(),
            written: name(entry),
            missing: missing.to_owned(),
        };
        match wrong {
            Wrong::Unknown { key, known } => {
                let entry = self.entry(line, key)?;
                let near = known.iter().find(|other| is_near(key, other) && !has(&entry.tables, other))?;
                Some(meant(&entry, near))
            }
            Wrong::Missing { table, key } if !self.added.contains(&line) => {
                let tables = table.clone().unwrap_or_default();
                let is_meant = |entry: &&Entry| entry.tables == tables && is_near(&name(entry), key);
                // Of one of many tables with the same keys the reader says the line alone.
                if table.is_none() && line > 1 {
                    return None;
                }
                entries.iter().find(is_meant).map(|entry| meant(entry, key))
            }
            _ => None,
        }
    }

    /// An error at its line in the file, with the key that is meant or that is written.
    fn reported(&self, error: ConfigError, line: usize, meant: Option<&Meant>) -> Vec<ConfigError> {
        let path = error.path().to_owned();
        let error = error.with_line(self.line_of_file(line));
        let Some(Meant { line: at, written, missing, .. }) = meant else { return vec![error] };
        let hint = format!("did you mean `{missing}`, which is missing?");
        match &error {
            ConfigError::Syntax { message, .. } if message.starts_with("unknown field `") => {
                vec![error.with_hint(&hint)]
            }
            ConfigError::Syntax { message, .. } if message.starts_with("there is no role `") => vec![error],
            _ => {
                let message = format!("unknown field `{written}`\nhint: {hint}");
                vec![error, ConfigError::Syntax { path, line: self.line_of_file(*at), message }]
            }
        }
    }

    /// Gives a key the name that is meant.
    fn rename(&mut self, meant: &Meant) -> bool {
        let is_there = self.text.get(meant.place.clone()).is_some();
        if is_there {
            self.text.replace_range(meant.place.clone(), &meant.missing);
        }
        is_there
    }

    /// Mends what is wrong at a line, so that a reader goes on; whether it did.
    fn mend(&mut self, line: usize, wrong: &Wrong) -> bool {
        match wrong {
            Wrong::Unknown { key, .. } => self.take_out(line, key),
            Wrong::Missing { table, key } => self.put_in(line, table.as_deref(), key),
            Wrong::Type(expected) => self.replace(line, expected),
            Wrong::Range { key, within } => {
                let [near, middle] = *within;
                self.put_within(line, key, if self.guess == Guess::Near { near } else { middle })
            }
            Wrong::Other => false,
        }
    }

    fn line(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
    }

    /// Place of the first byte of a line.
    fn begin(&self, line: usize) -> usize {
        let mut begins = self.text.match_indices('\n').map(|(at, _)| at + 1);
        if line <= 1 { 0 } else { begins.nth(line - 2).unwrap_or(self.text.len()) }
    }

    /// All keys of the text; none if it is not TOML.
    fn entries(&self) -> Vec<Entry> {
        let mut entries = Vec::new();
        if let Ok(root) = DeTable::parse(&self.text) {
            each_entry("", root.get_ref(), &mut entries);
        }
        entries
    }

    /// The entry with this key whose key or value begins on a line.
    fn entry(&self, line: usize, name: &str) -> Option<Entry> {
        let is_named = |entry: &Entry| {
            let key = self.text.get(entry.key.clone()).unwrap_or_default();
            key.trim_matches(['"', '\'']) == name
        };
        let mut named: Vec<Entry> = self.entries().into_iter().filter(is_named).collect();
        let is_on = |entry: &Entry| [entry.key.start, entry.value.start].iter().any(|at| self.line(*at) == line);
        let at = named.iter().position(is_on)?;
        Some(named.swap_remove(at))
    }

    /// Whether a key stands in a table in braces.
    fn is_in_braces(&self, entry: &Entry) -> bool {
        let before = self.text.get(..entry.key.start).unwrap_or_default().trim_end();
        before.ends_with('{') || (before.ends_with(',') && !self.begins_line(entry.key.start))
    }

    fn begins_line(&self, at: usize) -> bool {
        self.text.get(self.begin(self.line(at))..at).is_some_and(|before| before.trim().is_empty())
    }

    /// Takes a key out, with its value.
    fn take_out(&mut self, line: usize, name: &str) -> bool {
        let Some(entry) = self.entry(line, name) else { return false };
        let first = self.begin(self.line(entry.key.start));
        if self.text.get(first..).is_some_and(|text| text.trim_start().starts_with('[')) {
            let last = self.end_of_table(first);
            return self.blank(first..last);
        }
        if !self.is_in_braces(&entry) {
            return self.blank(first..entry.value.end);
        }
        let after = self.text.get(entry.value.end..).unwrap_or_default();
        let comma = after.len() - after.trim_start().len();
        if after.trim_start().starts_with(',') {
            return self.blank(entry.key.start..entry.value.end + comma + 1);
        }
        let before = self.text.get(..entry.key.start).unwrap_or_default().trim_end();
        let from = if before.ends_with(',') { before.len() - 1 } else { entry.key.start };
        self.blank(from..entry.value.end)
    }

    /// The end of a table that begins with a line in brackets, with the tables in it.
    fn end_of_table(&self, begin: usize) -> usize {
        let header = |line: &str| {
            let name = line.trim_start().strip_prefix('[')?;
            let name = name.trim_start_matches('[').split(']').next()?.trim();
            (!name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || "._-\"' ".contains(c)))
                .then(|| name.to_owned())
        };
        let mut end = begin;
        let mut own: Option<String> = None;
        for line in self.text.get(begin..).unwrap_or_default().split_inclusive('\n') {
            match (header(line), &own) {
                (Some(name), None) => own = Some(name),
                (Some(name), Some(own)) if !name.starts_with(&format!("{own}.")) => return end,
                _ => {}
            }
            end += line.len();
        }
        end
    }

    /// Replaces a part of the text by blanks; lines stay.
    fn blank(&mut self, part: Range<usize>) -> bool {
        let Some(old) = self.text.get(part.clone()) else { return false };
        let new: String = old.chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
        self.text.replace_range(part, &new);
        true
    }

    /// Puts a key into a table: of a name, or that begins on this line.
    fn put_in(&mut self, line: usize, table: Option<&str>, key: &str) -> bool {
        let value = first_guess(key, self.guess);
        let line_text = |line: usize| self.text.lines().nth(line - 1).unwrap_or_default().trim_start();
        let is_header = line_text(line).starts_with('[') && !line_text(line).contains('=');
        let named = table.and_then(|table| {
            let header = format!("[{table}]");
            self.text.lines().position(|line| line.trim_start().starts_with(&header)).map(|at| at + 1)
        });
        let header = if is_header { Some(line) } else { named };
        if let Some(header) = header {
            return self.add_line(header + 1, &format!("{key} = {value}"));
        }
        let braces = self.entries().into_iter().filter(|entry| entry.is_table && self.line(entry.value.start) == line);
        let braces: Vec<usize> = braces.map(|entry| entry.value.start).collect();
        let is_brace = |at: &&usize| self.text.get(**at..).is_some_and(|text| text.starts_with('{'));
        if let Some(at) = braces.iter().find(is_brace).copied() {
            self.text.insert_str(at + 1, &format!(" {key} = {value},"));
            let is_empty =
                self.text.get(at + 1..).is_some_and(|text| text.trim_start_matches(|c| c != ',').starts_with(",}"));
            if is_empty {
                let comma = at + 1 + format!(" {key} = {value}").len();
                self.blank(comma..comma + 1);
            }
            self.guessed.insert((line, String::new()));
            return true;
        }
        if let Some(table) = table {
            let last = self.text.lines().count() + 1;
            return self.add_line(last, &format!("[{table}]")) && self.add_line(last + 1, &format!("{key} = {value}"));
        }
        // The table outside all others begins with the file.
        line == 1 && self.add_line(1, &format!("{key} = {value}"))
    }

    fn add_line(&mut self, line: usize, text: &str) -> bool {
        let at = self.begin(line);
        let newline =
            if at > 0 && !self.text.get(..at).is_some_and(|before| before.ends_with('\n')) { "\n" } else { "" };
        self.text.insert_str(at, &format!("{newline}{text}\n"));
        for added in self.added.iter_mut().filter(|added| **added >= line) {
            *added += 1;
        }
        let moved = |(at, key): (usize, String)| (if at >= line { at + 1 } else { at }, key);
        self.guessed = self.guessed.drain().map(moved).collect();
        self.added.push(line);
        true
    }

    /// Replaces the value on a line by one of the expected type.
    fn replace(&mut self, line: usize, expected: &str) -> bool {
        let on_line = self.entries().into_iter().filter(|entry| self.line(entry.value.start) == line);
        let leaves: Vec<Range<usize>> = on_line.filter(|entry| !entry.is_table).map(|entry| entry.value).collect();
        let [value] = leaves.as_slice() else { return false };
        let old = self.text.get(value.clone()).unwrap_or_default();
        let Some(new) = guess(expected, old) else { return false };
        self.put(value.clone(), &new, (line, String::new()))
    }

    /// Replaces a number by one within its range.
    fn put_within(&mut self, line: usize, key: &str, within: f64) -> bool {
        let last = key.rsplit('.').next().unwrap_or(key);
        let (name, item) = match last.strip_suffix(']').and_then(|last| last.split_once('[')) {
            Some((name, item)) => (name, item.parse::<usize>().ok()),
            None => (last, None),
        };
        let Some(entry) = self.entry(line, name) else { return false };
        let place = item.map_or(Some(&entry.value), |item| entry.items.get(item));
        let Some(place) = place.cloned() else { return false };
        self.put(place, &format!("{within:?}"), (line, key.to_owned()))
    }

    fn put(&mut self, place: Range<usize>, new: &str, guessed: (usize, String)) -> bool {
        let Some(old) = self.text.get(place.clone()) else { return false };
        // Lines stay where they are.
        let lines = "\n".repeat(old.matches('\n').count());
        let new = if lines.is_empty() { new.to_owned() } else { format!("{new} #{lines}") };
        self.text.replace_range(place, &new);
        self.guessed.insert(guessed);
        true
    }
}

fn each_entry(tables: &str, table: &DeTable<'_>, entries: &mut Vec<Entry>) {
    for (key, value) in table {
        let items = match value.get_ref() {
            DeValue::Array(items) => items.iter().map(Spanned::span).collect(),
            _ => Vec::new(),
        };
        let is_table = value.get_ref().is_table();
        entries.push(Entry { tables: tables.to_owned(), key: key.span(), value: value.span(), items, is_table });
        let inner = if tables.is_empty() { key.get_ref().to_string() } else { format!("{tables}.{}", key.get_ref()) };
        each_table(&inner, value, entries);
    }
}

fn each_table(tables: &str, value: &Spanned<DeValue<'_>>, entries: &mut Vec<Entry>) {
    match value.get_ref() {
        DeValue::Table(table) => each_entry(tables, table, entries),
        DeValue::Array(items) => {
            items.iter().enumerate().for_each(|(at, item)| each_table(&format!("{tables}[{at}]"), item, entries));
        }
        _ => {}
    }
}

/// Whether a key may be another one with one or two letters wrong, missing or too many: not where the digits alone differ.
pub(crate) fn is_near(written: &str, key: &str) -> bool {
    const LETTERS: usize = 2;
    let without_digits = |name: &str| name.chars().filter(|c| !c.is_ascii_digit()).collect::<String>();
    let (written_letters, key_letters) = (without_digits(written), without_digits(key));
    written_letters != key_letters && distance(written, key) <= LETTERS.min(key.chars().count() / 3)
}

/// How many letters have to be put in, taken out or replaced to make one name of the other.
fn distance(one: &str, other: &str) -> usize {
    let other: Vec<char> = other.chars().collect();
    let mut before: Vec<usize> = (0..=other.len()).collect();
    for (i, letter) in one.chars().enumerate() {
        let mut row = vec![i + 1];
        for (j, of_other) in other.iter().enumerate() {
            let replaced = before[j] + usize::from(letter != *of_other);
            row.push(replaced.min(before[j + 1] + 1).min(row[j] + 1));
        }
        before = row;
    }
    before.last().copied().unwrap_or(0)
}

/// A value for a key that is missing: most are numbers.
fn first_guess(key: &str, guess: Guess) -> &'static str {
    match (key, guess) {
        ("name" | "title", _) => "\"x\"",
        (_, Guess::Near) => "1.0",
        (_, Guess::Middle) => "2.0",
    }
}

/// A value of the type that a reader expects; none if it is not known, or the same again.
fn guess(expected: &str, old: &str) -> Option<String> {
    let has = |word: &str| expected.contains(word);
    let is_whole = ["u8", "u16", "u32", "u64", "usize", "i8", "i16", "i32", "i64", "integer"].into_iter().any(has);
    let new = match expected.split('`').nth(1).filter(|_| expected.starts_with("one of") || expected.starts_with('`')) {
        Some(word) => format!("\"{word}\""),
        None if has("string") || has("path") || has("character") => "\"x\"".to_owned(),
        None if has("boolean") => "true".to_owned(),
        None if has("sequence") || has("array") || has("tuple") => "[1.0, 2.0]".to_owned(),
        None if has("struct") || has("map") || has("table") => "{}".to_owned(),
        None if is_whole => "1".to_owned(),
        None if has("f64") || has("float") || has("number") => "1.0".to_owned(),
        None => return None,
    };
    (new != old).then_some(new)
}
