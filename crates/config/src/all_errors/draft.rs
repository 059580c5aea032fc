//! The text of a file that is mended, so that its reader goes on.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use toml::de::DeTable;

use super::wrong::Wrong;
use crate::entries::{Entry, entries_of};
use crate::near::is_near;

/// What is put in place of what is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Guess {
    pub(super) number: Number,
    /// Whether a key with a number out of its range is left out, so that the reader takes what a file has without it.
    pub(super) leaves_out: bool,
}

/// The number that is put in place of a wrong one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    /// One, or the nearest within the range.
    Near,
    /// Two, or the middle of the range.
    Middle,
}

impl Number {
    fn of(self, [near, middle]: [f64; 2]) -> f64 {
        match self {
            Self::Near => near,
            Self::Middle => middle,
        }
    }

    /// Another number within, of none of the guesses.
    fn another([near, middle]: [f64; 2]) -> f64 {
        let beyond = middle + 0.5 * (middle - near);
        if middle.fract() == 0.0 { beyond.floor() } else { beyond }
    }
}

/// Keys whose values make up what other keys name, and tables that do.
const NAMING: [&str; 5] = ["name", "kind", "level", "gearbox", "channel"];
const NAMING_TABLES: [&str; 3] = ["shaft", "element", "gear"];

/// A text that is mended.
pub(super) struct Draft {
    pub(super) text: String,
    /// Lines that are not in the file, from the first to the last, counted from 1.
    added: Vec<usize>,
    /// Places with values that are not those of the file: lines, with the key in its table, or none of a value of another type; and the nearest
    /// and the middle one of a number within its range.
    guessed: HashMap<(usize, String), Option<[f64; 2]>>,
    /// Keys that were taken out, as a reader names them.
    taken: HashSet<String>,
    /// Lines with an empty table that was put in: a key that is missing there is no error of the file.
    emptied: HashSet<usize>,
    guess: Guess,
}

impl Draft {
    pub(super) fn of(text: &str, guess: Guess) -> Self {
        Self {
            text: text.to_owned(),
            added: Vec::new(),
            guessed: HashMap::new(),
            taken: HashSet::new(),
            emptied: HashSet::new(),
            guess,
        }
    }

    /// Whether all values are those of the file.
    pub(super) fn is_unchanged(&self) -> bool {
        self.added.is_empty() && self.guessed.is_empty() && self.taken.is_empty()
    }

    /// Whether the values differ from those of the file in numbers alone.
    pub(super) fn differs_in_numbers(&self) -> bool {
        self.taken.is_empty() && self.guessed.values().all(Option::is_some)
    }

    /// Whether all that other keys name is that of the file.
    pub(super) fn has_its_names(&self) -> bool {
        let is_replaced = |key: &&str| self.guessed.keys().any(|(_, of)| of == key);
        let mut taken = NAMING.iter().chain(&NAMING_TABLES);
        !NAMING.iter().any(is_replaced) && taken.all(|key| !self.taken.contains(*key))
    }

    /// The line of the file that is this line of the draft.
    pub(super) fn line_of_file(&self, line: usize) -> usize {
        line - self.added.iter().filter(|added| **added < line).count()
    }

    /// Whether what is wrong was put in.
    pub(super) fn is_guessed(&self, line: usize, wrong: &Wrong) -> bool {
        let key = match wrong {
            Wrong::Range { key, .. }
            | Wrong::Value { key }
            | Wrong::Length { key, .. }
            | Wrong::Order { key }
            | Wrong::Name { key, .. }
            | Wrong::Meaning { key } => in_table(key),
            // A key that is missing in a table that was put in, or that was taken out.
            Wrong::Missing { key, .. } => {
                return self.added.contains(&line) || self.taken.contains(key) || self.emptied.contains(&line);
            }
            Wrong::Unknown { .. } => return self.added.contains(&line),
            _ => "",
        };
        // A value of another type was replaced, whatever its key is called.
        self.added.contains(&line) || [key, ""].iter().any(|key| self.guessed.contains_key(&(line, (*key).to_owned())))
    }

    /// Mends what is wrong at a line, so that a reader goes on; whether it did. A place that is still wrong is mended in another way.
    pub(super) fn mend(&mut self, line: usize, wrong: &Wrong, attempts: usize) -> bool {
        match wrong {
            Wrong::Unknown { key, .. } => self.take_out(line, key),
            Wrong::Missing { table, key } => self.put_in(line, table.as_deref(), key),
            Wrong::Type { found, expected } => self.replace(line, found, expected),
            Wrong::Range { key, .. } if self.guess.leaves_out && !self.is_guessed(line, wrong) => {
                self.leave_out(line, key)
            }
            Wrong::Range { key, within } => self.put_number(line, key, self.guess.number.of(*within), *within),
            Wrong::Name { key, name, known } => {
                self.rename(line, key, name, known, attempts) || self.take_out(line, name) || self.leave_out(line, key)
            }
            Wrong::Length { key, wanted } => self.put_list(line, key, *wanted),
            Wrong::Order { key } if attempts == 0 => self.put_rising(line, key) || self.leave_out(line, key),
            Wrong::Order { key } => self.leave_out(line, key),
            Wrong::Value { key } | Wrong::Meaning { key } => {
                match self.guessed.get(&(line, in_table(key).to_owned())).copied().flatten() {
                    // Another number may go with what is beside it.
                    Some(within) if attempts == 0 => {
                        self.put_number(line, key, Number::another(within), within) || self.leave_out(line, key)
                    }
                    _ => self.leave_out(line, key),
                }
            }
            Wrong::Kind | Wrong::Other => false,
        }
    }

    pub(super) fn line(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
    }

    /// Place of the first byte of a line.
    fn begin(&self, line: usize) -> usize {
        let mut begins = self.text.match_indices('\n').map(|(at, _)| at + 1);
        if line <= 1 { 0 } else { begins.nth(line - 2).unwrap_or(self.text.len()) }
    }

    /// All keys of the text; none if it is not TOML.
    pub(super) fn entries(&self) -> Vec<Entry> {
        DeTable::parse(&self.text).map_or(Vec::new(), |root| entries_of(root.get_ref()))
    }

    /// The key of an entry, without quotation marks.
    pub(super) fn name(&self, entry: &Entry) -> &str {
        entry.name(&self.text)
    }

    /// The tables that begin on a line, of which a reader says no more.
    pub(super) fn tables_at(&self, entries: &[Entry], line: usize) -> Vec<String> {
        let begins = |entry: &&Entry| [entry.key.start, entry.value.start].iter().any(|at| self.line(*at) == line);
        let outermost = (line == 1).then(String::new);
        outermost
            .into_iter()
            .chain(entries.iter().filter(|entry| entry.is_table).filter(begins).map(|entry| self.path(entry)))
            .collect()
    }

    /// Whether an entry may have another name: there is none, or the two can be one table or one list of tables.
    pub(super) fn has_room(&self, entries: &[Entry], entry: &Entry, name: &str) -> bool {
        let in_tables =
            |tables: &str, name: &str| entries.iter().find(|other| other.tables == tables && self.name(other) == name);
        let Some(there) = in_tables(&entry.tables, name) else { return true };
        let are_lists = |one: &Entry, other: &Entry| [one, other].iter().all(|of| self.is_list_of_tables(of));
        let path = self.path(there);
        let own = self.path(entry);
        let mut inner = entries.iter().filter(|of| of.tables == own);
        let goes_in = |of: &Entry| in_tables(&path, self.name(of)).is_none_or(|other| are_lists(of, other));
        are_lists(entry, there) || (entry.is_table && there.is_table && inner.all(goes_in))
    }

    /// An entry with the tables that it is in.
    fn path(&self, entry: &Entry) -> String {
        match entry.tables.as_str() {
            "" => self.name(entry).to_owned(),
            above => format!("{above}.{}", self.name(entry)),
        }
    }

    /// Whether an entry is a list whose tables have lines of their own: `[[shaft]]`.
    fn is_list_of_tables(&self, entry: &Entry) -> bool {
        let line = self.text.get(self.begin(self.line(entry.key.start))..).unwrap_or_default();
        !entry.items.is_empty() && line.trim_start().starts_with("[[")
    }

    /// The entry with this key whose key or value begins on a line.
    pub(super) fn entry(&self, line: usize, name: &str) -> Option<Entry> {
        let is_named = |entry: &Entry| self.name(entry) == name;
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

    /// Takes out a key whose value is wrong, or the list with such a value.
    fn leave_out(&mut self, line: usize, key: &str) -> bool {
        let name = in_table(key);
        self.taken.insert(name.to_owned());
        self.take_out(line, name) || self.take_out_table(line)
    }

    /// Takes out the table with a header of its own that a line is in.
    fn take_out_table(&mut self, line: usize) -> bool {
        let lines: Vec<&str> = self.text.lines().take(line).collect();
        let Some(at) = lines.iter().rposition(|line| header(line).is_some()) else { return false };
        let name = header(lines[at]).and_then(|name| name.rsplit('.').next().map(str::to_owned)).unwrap_or_default();
        self.taken.insert(name);
        let first = self.begin(at + 1);
        self.blank(first..self.end_of_table(first))
    }

    /// The key on a line whose value, or one in whose list, a reader finds to be of another type.
    fn of_type(&self, line: usize, found: &str) -> Option<(Entry, Range<usize>)> {
        let text = |place: &Range<usize>| self.text.get(place.clone()).unwrap_or_default();
        let is_found = |place: &Range<usize>| match found {
            "a table" => text(place).starts_with('{'),
            "a list" => text(place).starts_with('['),
            found => {
                let bare = |text: &str| text.trim_matches(['"', '\'', '`']).to_owned();
                let found = bare(found.split_once('`').or(found.split_once('"')).map_or(found, |(_, value)| value));
                let number = |text: &str| text.parse::<f64>().ok();
                bare(text(place)) == found || number(&found).is_some_and(|found| number(text(place)) == Some(found))
            }
        };
        let on_line: Vec<Entry> =
            self.entries().into_iter().filter(|entry| self.line(entry.value.start) == line).collect();
        let mut places = on_line
            .iter()
            .flat_map(|entry| [&entry.value].into_iter().chain(&entry.items).map(move |place| (entry, place.clone())));
        let mut leaves = on_line.iter().filter(|entry| !entry.is_table);
        let only = match (leaves.next(), leaves.next()) {
            (None, _) => on_line.first(),
            (leaf, None) => leaf,
            _ => None,
        };
        let named = places.find(|(_, place)| is_found(place));
        named.or(only.map(|entry| (entry, entry.value.clone()))).map(|(entry, place)| (entry.clone(), place))
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
            self.guessed.insert((line, String::new()), None);
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
        self.emptied = self.emptied.drain().map(|at| if at >= line { at + 1 } else { at }).collect();
        let moved = |((at, key), within)| ((if at >= line { at + 1 } else { at }, key), within);
        self.guessed = self.guessed.drain().map(moved).collect();
        self.added.push(line);
        true
    }

    /// Replaces the value on a line by one of the expected type.
    fn replace(&mut self, line: usize, found: &str, expected: &str) -> bool {
        let Some((entry, place)) = self.of_type(line, found) else { return false };
        let old = self.text.get(place.clone()).unwrap_or_default();
        match guess(expected, old, self.guess.number) {
            Some(new) => {
                let within = new.parse::<f64>().ok().map(|_| [1.0, 2.0]);
                if new == "{}" {
                    self.emptied.insert(line);
                }
                self.put(place, &new, (line, String::new()), within)
            }
            None => {
                let name = self.name(&entry).to_owned();
                self.leave_out(line, &name)
            }
        }
    }

    /// Replaces a name of what does not exist by one of those that do.
    fn rename(&mut self, line: usize, key: &str, name: &str, known: &[String], attempts: usize) -> bool {
        let from = match self.guess.number {
            Number::Near => 0,
            Number::Middle => 1,
        };
        let Some(new) = known.get((from + attempts) % known.len().max(1)) else { return false };
        let Some(entry) = self.entry(line, in_table(key)) else { return false };
        let is_name = |place: &&Range<usize>| {
            let text = self.text.get((*place).clone()).unwrap_or_default();
            text.trim_matches(['"', '\'']) == name
        };
        let Some(place) = entry.items.iter().chain([&entry.value]).find(is_name).cloned() else { return false };
        self.put(place, &format!("\"{new}\""), (line, in_table(key).to_owned()), None)
    }

    /// Replaces a number by one within its range.
    fn put_number(&mut self, line: usize, key: &str, number: f64, within: [f64; 2]) -> bool {
        let last = key.rsplit('.').next().unwrap_or(key);
        let (name, item) = match last.strip_suffix(']').and_then(|last| last.split_once('[')) {
            Some((name, item)) => (name, item.parse::<usize>().ok()),
            None => (last, None),
        };
        let Some(entry) = self.entry(line, name) else { return false };
        let place = match item {
            Some(item) => entry.items.get(item),
            None => Some(&entry.value).filter(|_| entry.items.is_empty()),
        };
        let Some(place) = place.cloned() else { return false };
        self.put(place, &format!("{number:?}"), (line, name.to_owned()), Some(within))
    }

    /// Replaces a list of numbers by one of this length.
    fn put_list(&mut self, line: usize, key: &str, length: usize) -> bool {
        let Some(entry) = self.entry(line, in_table(key)) else { return false };
        let number = self.guess.number.of([1.0, 2.0]);
        let list = format!("[{}]", vec![format!("{number:?}"); length].join(", "));
        self.put(entry.value, &list, (line, in_table(key).to_owned()), Some([1.0, 2.0]))
    }

    /// Puts a list that rises in place of one that does not, of the same length and between its smallest and its largest number.
    fn put_rising(&mut self, line: usize, key: &str) -> bool {
        let Some(entry) = self.entry(line, in_table(key)) else { return false };
        let number = |place: &Range<usize>| self.text.get(place.clone()).and_then(|text| text.parse::<f64>().ok());
        let Some(old) = entry.items.iter().map(number).collect::<Option<Vec<f64>>>() else { return false };
        let low = old.iter().copied().fold(f64::INFINITY, f64::min);
        let high = old.iter().copied().fold(low, f64::max);
        let high = if high > low { high } else { low + 1.0 };
        let steps = (old.len().max(2) - 1) as f64;
        let rising = (0..old.len()).map(|at| format!("{:?}", low + (high - low) * at as f64 / steps));
        let list = format!("[{}]", rising.collect::<Vec<_>>().join(", "));
        // How long it is may be what is wrong with it.
        self.put(entry.value, &list, (line, in_table(key).to_owned()), None)
    }

    fn put(&mut self, place: Range<usize>, new: &str, guessed: (usize, String), within: Option<[f64; 2]>) -> bool {
        let Some(old) = self.text.get(place.clone()) else { return false };
        // Lines stay where they are.
        let lines = "\n".repeat(old.matches('\n').count());
        let new = if lines.is_empty() { new.to_owned() } else { format!("{new} #{lines}") };
        self.text.replace_range(place, &new);
        self.guessed.insert(guessed, within);
        true
    }
}

/// The name of the table whose header a line is.
fn header(line: &str) -> Option<String> {
    let name = line.trim_start().strip_prefix('[')?;
    let name = name.trim_start_matches('[').split(']').next()?.trim();
    (!name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || "._-\"' ".contains(c))).then(|| name.to_owned())
}

/// A key without the tables that it is in, and without the place in its list.
fn in_table(key: &str) -> &str {
    let name = key.rsplit('.').next().unwrap_or(key);
    name.split('[').next().unwrap_or(name)
}

/// A value for a key that is missing: most are numbers.
fn first_guess(key: &str, guess: Guess) -> &'static str {
    match (key, guess.number) {
        ("name" | "title", _) => "\"x\"",
        (_, Number::Near) => "1.0",
        (_, Number::Middle) => "2.0",
    }
}

/// A value of the type that a reader expects; none if it is not known, or the same again.
fn guess(expected: &str, old: &str, number: Number) -> Option<String> {
    let has = |word: &str| expected.contains(word);
    if let Some(word) = expected.strip_prefix('"').and_then(|word| word.split('"').next()) {
        return Some(format!("\"{word}\"")).filter(|new| new != old);
    }
    let words = || expected.split('`').skip(1).step_by(2);
    // What is spelt nearly as a word is that word.
    let near = words().find(|word| is_near(old.trim_matches(['"', '\'']), word));
    let first = words().next();
    let word = near.or(if number == Number::Near { first } else { words().nth(1).or(first) });
    let new = match word.filter(|_| expected.starts_with("one of") || expected.starts_with('`')) {
        Some(word) => format!("\"{word}\""),
        None if has("text") || has("string") => "\"x\"".to_owned(),
        None if has("true or false") => "true".to_owned(),
        None if has("list") || has("array") || has("tuple") => "[1.0, 2.0]".to_owned(),
        None if has("table") || has("map") => "{}".to_owned(),
        None if has("whole number") => format!("{}", number.of([1.0, 2.0])),
        None if has("number") => format!("{:?}", number.of([1.0, 2.0])),
        None => return None,
    };
    (new != old).then_some(new)
}
