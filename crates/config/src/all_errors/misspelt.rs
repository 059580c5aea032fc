//! Keys that are another one by a letter or two.

use crate::ConfigError;

use super::draft::{Draft, Guess, Number};
use super::wrong::Wrong;
use crate::entries::Entry;
use crate::near::is_near;

/// A key that is there in place of another one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Misspelt {
    /// Line of the key in the file, counted from 1.
    line: usize,
    written: String,
    meant: String,
    /// Whether there is none of the name that is meant.
    is_missing: bool,
}

impl Misspelt {
    /// The key that is written in place of the one that a reader misses or proposes, of a draft at this line.
    pub(super) fn of(draft: &Draft, line: usize, wrong: &Wrong) -> Option<Self> {
        let entries = draft.entries();
        let misspelt = |entry: &Entry, meant: &str, is_missing| Self {
            line: draft.line_of_file(draft.line(entry.key.start)),
            written: draft.name(entry).to_owned(),
            meant: meant.to_owned(),
            is_missing,
        };
        match wrong {
            Wrong::Unknown { key, known } => {
                let entry = draft.entry(line, key)?;
                let meant =
                    known.iter().find(|other| is_near(key, other) && draft.has_room(&entries, &entry, other))?;
                let is_there = entries.iter().any(|other| other.tables == entry.tables && draft.name(other) == meant);
                Some(misspelt(&entry, meant, !is_there))
            }
            Wrong::Missing { .. } if draft.is_guessed(line, wrong) => None,
            Wrong::Missing { table, key } => {
                let tables = table.clone().map_or_else(|| draft.tables_at(&entries, line), |table| vec![table]);
                tables.iter().find_map(|tables| {
                    let in_place = |entry: &&Entry| entry.tables == *tables && is_near(draft.name(entry), key);
                    let found = entries.iter().find(in_place).map(|entry| misspelt(entry, key, true));
                    found.or_else(|| {
                        let (entry, meant) = misspelt_table(draft, &entries, tables, key)?;
                        Some(misspelt(entry, meant, true))
                    })
                })
            }
            _ => None,
        }
    }

    /// The error of a reader at the line of the key, as one that names the key.
    pub(super) fn named_by(&self, error: ConfigError) -> ConfigError {
        let Self { line, written, meant, is_missing } = self;
        let error = error.with_line(*line);
        let hint = format!("did you mean `{meant}`{}?", if *is_missing { ", which is missing" } else { "" });
        match &error {
            // These have their hint.
            ConfigError::Syntax { message, .. }
                if message.starts_with("there is no signal `") || message.contains("\nhint: did you mean ") =>
            {
                error
            }
            ConfigError::Syntax { message, .. } if message.starts_with("unknown key `") => error.with_hint(&hint),
            _ => {
                let message = format!("unknown key `{}`\nhint: {hint}", trace::printable(written));
                ConfigError::Syntax { path: error.path().to_owned(), line: *line, message }
            }
        }
    }

    /// The text with the key that is meant; none if the key is not there.
    pub(super) fn corrected(&self, text: &str) -> Option<String> {
        let place =
            Draft::of(text, Guess { number: Number::Near, leaves_out: false }).entry(self.line, &self.written)?.key;
        let mut text = text.to_owned();
        text.get(place.clone())?;
        text.replace_range(place, &self.meant);
        Some(text)
    }
}

/// The table that has the key which another one misses, and is that other one but for its name; with the name that is meant.
fn misspelt_table<'e, 't>(
    draft: &Draft,
    entries: &'e [Entry],
    tables: &'t str,
    key: &str,
) -> Option<(&'e Entry, &'t str)> {
    entries.iter().filter(|entry| draft.name(entry) == key).find_map(|entry| {
        let (above, written, meant) = differs_in_one(&entry.tables, tables)?;
        let is_it = |entry: &&Entry| entry.tables == above && draft.name(entry) == written;
        let table = entries.iter().find(is_it)?;
        draft.has_room(entries, table, meant).then_some((table, meant))
    })
}

/// The tables above the one in which two paths of tables differ, and its two names, which are near each other; none if they differ in more.
fn differs_in_one<'m>(written: &str, meant: &'m str) -> Option<(String, String, &'m str)> {
    let (written, meant): (Vec<&str>, Vec<&str>) = (written.split('.').collect(), meant.split('.').collect());
    let at = written.iter().zip(&meant).position(|(one, other)| one != other)?;
    let is_rest_same = written.len() == meant.len() && written[at + 1..] == meant[at + 1..];
    (is_rest_same && is_near(written[at], meant[at]))
        .then(|| (written[..at].join("."), written[at].to_owned(), meant[at]))
}
