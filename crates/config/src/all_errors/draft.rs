//! The text of a file that is mended, so that its reader goes on.

use std::collections::HashSet;
use std::ops::Range;

use toml::de::DeTable;

use super::wrong::Wrong;
use crate::entries::{Entry, entries_of};

/// What is put in place of what is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Guess {
    /// One, or the nearest number within the range.
    Near,
    /// Two, or the middle of the range.
    Middle,
    /// What a file has that leaves the key out; the same as the nearest where it must have it.
    Default,
}

/// A text that is mended.
pub(super) struct Draft {
    pub(super) text: String,
    /// Lines that are not in the file, from the first to the last, counted from 1.
    added: Vec<usize>,
    /// Places with values that are not those of the file: lines, with the key of a number.
    guessed: HashSet<(usize, String)>,
    /// Keys that were taken out, as a reader names them.
    taken: HashSet<String>,
    guess: Guess,
}

impl Draft {
    pub(super) fn of(text: &str, guess: Guess) -> Self {
        Self { text: text.to_owned(), added: Vec::new(), guessed: HashSet::new(), taken: HashSet::new(), guess }
    }

    /// Whether all values are those of the file.
    pub(super) fn is_unchanged(&self) -> bool {
        self.added.is_empty() && self.guessed.is_empty() && self.taken.is_empty()
    }

    /// Whether a line is not in the file.
    pub(super) fn is_added(&self, line: usize) -> bool {
        self.added.contains(&line)
    }

    /// The line of the file that is this line of the draft.
    pub(super) fn line_of_file(&self, line: usize) -> usize {
        line - self.added.iter().filter(|added| **added < line).count()
    }

    /// Whether what is wrong was put in.
    pub(super) fn is_guessed(&self, line: usize, wrong: &Wrong) -> bool {
        let key = match wrong {
            Wrong::Range { key, .. } => key.as_str(),
            // A key that is missing in a table that was put in, or that was taken out.
            Wrong::Missing { key, .. } => return self.added.contains(&line) || self.taken.contains(key),
            Wrong::Unknown { .. } => return self.added.contains(&line),
            _ => "",
        };
        // A value of another type was replaced, whatever its key is called.
        self.added.contains(&line) || [key, ""].iter().any(|key| self.guessed.contains(&(line, (*key).to_owned())))
    }

    /// Mends what is wrong at a line, so that a reader goes on; whether it did.
    pub(super) fn mend(&mut self, line: usize, wrong: &Wrong) -> bool {
        match wrong {
            Wrong::Unknown { key, .. } => self.take_out(line, key),
            Wrong::Missing { table, key } => self.put_in(line, table.as_deref(), key),
            Wrong::Type(expected) => self.replace(line, expected),
            Wrong::Range { key, .. } if self.guess == Guess::Default && !self.is_guessed(line, wrong) => {
                self.leave_out(line, key)
            }
            Wrong::Range { key, within: [near, middle] } => {
                self.put_within(line, key, if self.guess == Guess::Middle { *middle } else { *near })
            }
            Wrong::Value { key } => self.leave_out(line, key),
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
        let name = key.rsplit('.').next().unwrap_or(key);
        let name = name.split('[').next().unwrap_or(name);
        self.taken.insert(name.to_owned());
        self.take_out(line, name)
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

/// A value for a key that is missing: most are numbers.
fn first_guess(key: &str, guess: Guess) -> &'static str {
    match (key, guess) {
        ("name" | "title", _) => "\"x\"",
        (_, Guess::Near | Guess::Default) => "1.0",
        (_, Guess::Middle) => "2.0",
    }
}

/// A value of the type that a reader expects; none if it is not known, or the same again.
fn guess(expected: &str, old: &str) -> Option<String> {
    let has = |word: &str| expected.contains(word);
    let new = match expected.split('`').nth(1).filter(|_| expected.starts_with("one of") || expected.starts_with('`')) {
        Some(word) => format!("\"{word}\""),
        None if has("text") || has("string") => "\"x\"".to_owned(),
        None if has("true or false") => "true".to_owned(),
        None if has("list") || has("array") || has("tuple") => "[1.0, 2.0]".to_owned(),
        None if has("table") || has("map") => "{}".to_owned(),
        None if has("whole number") => "1".to_owned(),
        None if has("number") => "1.0".to_owned(),
        None => return None,
    };
    (new != old).then_some(new)
}
