//! All errors of a file, where its reader ends at the first one.
//!
//! The reader gets a draft of the text in which what it has refused is mended, again and again: an unknown key is taken out, a missing one is put
//! in, and a value of another type, outside its range or with a name of nothing is replaced. What is put in is never reported. What a value means
//! beside others is reported if it does not follow from what was put in.
//!
//! A key that is misspelt is corrected in the text itself, and all begins anew: a reader may take a file without this key for another one, and what
//! it then misses is no error of the file.

mod draft;
mod misspelt;
mod wrong;

use std::path::PathBuf;

use crate::{ConfigError, Source};
use draft::{Draft, Guess, Number};
use misspelt::Misspelt;
use wrong::Wrong;

/// Most times that a file is read.
const READINGS: usize = 100;
/// Most bytes that are read in all of these times: a large file with errors on every line would take minutes.
const BYTES: usize = 4 << 20;

/// Most times that a text is read.
fn readings(text: &str) -> usize {
    (BYTES / text.len().max(1)).clamp(2, READINGS)
}

/// Most times that one place is mended.
const MENDED_MAX: usize = 6;

/// Reads a file of a kind, or of any. Its errors, at least one, do not follow from each other; the first is one at which it would end.
type Reader<'r> = dyn Fn(Source) -> Result<(), Vec<ConfigError>> + 'r;

/// The errors of a file by its reader, and those of a file that it names and that the reader can read: unknown keys first, then in the order of
/// their lines; empty for a file without any.
///
/// A range may follow from another value. So the file is read with several guesses of what is wrong, and a value that is outside its range with one
/// of them alone is none of the errors. Where a guess is wrong beside other values, the reader does not come to the end, and errors behind are not
/// found with it.
pub fn all_errors(source: &Source, read: &Reader<'_>) -> Vec<ConfigError> {
    errors_of(source, read, &mut Vec::new())
}

/// The same, of none of the files that were read `before`.
fn errors_of(source: &Source, read: &Reader<'_>, before: &mut Vec<PathBuf>) -> Vec<ConfigError> {
    before.push(source.path.clone());
    let mut found = found_with(false, source, read);
    if !found.errors.is_empty() && !found.is_whole {
        let others = found_with(true, source, read);
        if others.is_whole {
            // The reader has come to the end with what a file has that leaves the keys out.
            let first = found.errors.first().map(ToString::to_string);
            found.errors.retain(|error| is_in_both(error, &others) || Some(error.to_string()) == first);
        }
        found.errors.extend(others.errors);
    }
    let mut errors = found.errors;
    errors.sort_by_key(|error| (!Wrong::of(error).is_unknown_key(), error.line().is_none(), error.line()));
    errors.dedup_by(|one, other| one.to_string() == other.to_string());
    errors.into_iter().flat_map(|error| with_others_of_its_file(error, source, read, before)).collect()
}

/// What the drafts of a file have shown.
struct Shown {
    errors: Vec<ConfigError>,
    /// Those of them that may follow from what was put in.
    unsure: Vec<String>,
    /// Whether the reader came to the end.
    is_whole: bool,
}

impl Shown {
    /// Adds an error at a line of a draft, unless it follows from what was put into it.
    fn add(&mut self, error: ConfigError, line: usize, wrong: &Wrong, draft: &Draft) {
        let (is_of_file, is_sure) = match wrong {
            _ if draft.is_unchanged() => (true, true),
            Wrong::Name { .. } => (draft.has_its_names(), true),
            Wrong::Length { .. } | Wrong::Meaning { .. } | Wrong::Other => (draft.differs_in_numbers(), false),
            _ => (true, true),
        };
        if is_of_file && !draft.is_guessed(line, wrong) {
            let error = error.with_line(draft.line_of_file(line));
            if !is_sure {
                self.unsure.push(error.to_string());
            }
            self.errors.push(error);
        }
    }
}

/// What is found with both guesses of a number.
fn found_with(leaves_out: bool, source: &Source, read: &Reader<'_>) -> Shown {
    let mut near = errors_with(Guess { number: Number::Near, leaves_out }, source, read);
    if near.errors.len() > 1 {
        let middle = errors_with(Guess { number: Number::Middle, leaves_out }, source, read);
        let is_of_middle = |error: &String| middle.errors.iter().any(|other| other.to_string() == *error);
        let Shown { errors, unsure, .. } = &mut near;
        errors.retain(|error| {
            let text = error.to_string();
            is_in_both(error, &middle) && (!unsure.contains(&text) || is_of_middle(&text))
        });
    }
    near
}

/// Whether an error with one guess is one with another.
fn is_in_both(error: &ConfigError, others: &Shown) -> bool {
    let ConfigError::Range { line, key, .. } = error else { return true };
    let is_same_place =
        |other: &&ConfigError| matches!(other, ConfigError::Range { line: at, key: of, .. } if (at, of) == (line, key));
    let other = others.errors.iter().find(is_same_place);
    other.map_or(!others.is_whole, |other| other.to_string() == error.to_string())
}

/// The errors of the file that an error is of, where another file names it.
fn with_others_of_its_file(
    error: ConfigError,
    source: &Source,
    read: &Reader<'_>,
    before: &mut Vec<PathBuf>,
) -> Vec<ConfigError> {
    if error.path() == source.path || before.iter().any(|path| path == error.path()) {
        return vec![error];
    }
    let Ok(named) = Source::read(error.path()) else { return vec![error] };
    // A list of speeds is no TOML, and what is expected to be of another kind has no error by itself.
    if named.table().is_err() || matches!(Wrong::of(&error), Wrong::Kind) {
        return vec![error];
    }
    let errors = errors_of(&named, read, before);
    // The reader may be one of files of this kind alone.
    let is_other_kind = errors.iter().any(|error| matches!(Wrong::of(error), Wrong::Kind));
    if errors.is_empty() || is_other_kind { vec![error] } else { errors }
}

/// The errors with one guess.
fn errors_with(guess: Guess, source: &Source, read: &Reader<'_>) -> Shown {
    let mut source = source.clone();
    let mut errors = Vec::new();
    for _ in 0..readings(&source.text) {
        match search(guess, &source, read) {
            Found::Errors(shown) => {
                errors.extend(shown.errors);
                return Shown { errors, ..shown };
            }
            Found::Misspelt { key, error } => {
                errors.push(error);
                let Some(text) = key.corrected(&source.text) else { break };
                source.text = text;
            }
        }
    }
    Shown { errors, unsure: Vec::new(), is_whole: false }
}

/// What is found in a text.
enum Found {
    /// A key that is to be corrected before all else, with the error that names it.
    Misspelt { key: Misspelt, error: ConfigError },
    /// The errors of a text without such a key.
    Errors(Shown),
}

/// Reads the drafts of a text.
fn search(guess: Guess, source: &Source, read: &Reader<'_>) -> Found {
    let mut draft = Draft::of(&source.text, guess);
    let mut shown = Shown { errors: Vec::new(), unsure: Vec::new(), is_whole: false };
    let mut mended: Vec<String> = Vec::new();
    for _ in 0..readings(&source.text) {
        let Err(errors) = read(Source { path: source.path.clone(), text: draft.text.clone() }) else {
            shown.is_whole = true;
            break;
        };
        let place = |error: &ConfigError| error.line().filter(|_| error.path() == source.path);
        let mut first = None;
        for error in errors {
            let Some(line) = place(&error) else {
                // The error of another file, which this one names.
                shown.errors.push(error);
                continue;
            };
            let wrong = Wrong::of(&error);
            if first.is_none() {
                if let Some(key) = Misspelt::of(&draft, line, &wrong) {
                    let error = key.named_by(error);
                    return Found::Misspelt { key, error };
                }
                first = Some((line, wrong.clone()));
            }
            shown.add(error, line, &wrong, &draft);
        }
        let Some((line, wrong)) = first else { break };
        let attempt = format!("{line} {wrong:?}");
        let attempts = mended.iter().filter(|other| **other == attempt).count();
        if attempts >= MENDED_MAX || !draft.mend(line, &wrong, attempts) {
            break;
        }
        mended.push(attempt);
    }
    Found::Errors(shown)
}
