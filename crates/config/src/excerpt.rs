//! The line of a file that an error is about, with the part of it that is wrong.

use std::ops::Range;

use toml::de::DeTable;

use crate::Source;
use crate::entries::{Entry, entries_of};

/// Most characters of a line that are shown.
const LONGEST_LINE: usize = 120;
/// Characters before what is wrong that are shown of a longer line.
const BEFORE: usize = 40;

/// A line of a file and what is wrong in it.
///
/// ```
/// use config::{Excerpt, Source};
///
/// let car = Source::built_in("car.toml", "[vehicle]\nmass_kg = -1\n");
/// let shown = Excerpt::of(&car, 2, "`vehicle.mass_kg` is -1, expected 200 to 60000").unwrap();
/// assert_eq!((shown.line, shown.column), (2, 11));
/// assert_eq!(shown.text, "mass_kg = -1");
/// assert_eq!(&shown.text[shown.marked], "-1");
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excerpt {
    /// The line, counted from 1.
    pub line: usize,
    /// The column of what is wrong, in characters, counted from 1.
    pub column: usize,
    /// The line, or a part of a long one; a character that is not printed is a blank or `\u{fffd}`.
    pub text: String,
    /// What is wrong, as a range of the bytes of `text`.
    pub marked: Range<usize>,
}

impl Excerpt {
    /// The excerpt for an error at a line, by its message: the value or the key that the message is about. A value in a list of several lines has
    /// a line of its own. None where the error is about the whole file.
    pub fn of(source: &Source, line: usize, message: &str) -> Option<Self> {
        let place = Text { text: &source.text, line }.part(message)?;
        Self::of_place(&source.text, place)
    }

    fn of_place(text: &str, place: Range<usize>) -> Option<Self> {
        let begin = text.get(..place.start)?.rfind('\n').map_or(0, |at| at + 1);
        let end = text.get(place.start..)?.find('\n').map_or(text.len(), |at| place.start + at);
        let line = 1 + text.get(..begin)?.matches('\n').count();
        let before: Vec<char> = text.get(begin..place.start)?.chars().collect();
        let wrong = text.get(place.start..place.end.min(end))?.trim_end();
        let rest = text.get(place.start + wrong.len()..end)?.trim_end();
        let column = before.len() + 1;
        // What does not fit of a long line: first what is before, then what is behind.
        let is_long = before.len() + wrong.chars().count() + rest.chars().count() > LONGEST_LINE;
        let skipped = if is_long { before.len().saturating_sub(BEFORE) } else { 0 };
        let mut shown: String = before[skipped..].iter().copied().map(printed).collect();
        let start = shown.len();
        shown.extend(wrong.chars().map(printed).take(LONGEST_LINE - BEFORE));
        let marked = start..shown.len();
        let room = LONGEST_LINE.saturating_sub(shown.chars().count());
        shown.extend(rest.chars().map(printed).take(room));
        Some(Self { line, column, text: shown, marked })
    }
}

/// A character as it is shown, which takes one column.
fn printed(c: char) -> char {
    match c {
        '\t' => ' ',
        c if trace::is_unprintable(c) => '\u{fffd}',
        c => c,
    }
}

/// A text and the line in it of an error.
struct Text<'t> {
    text: &'t str,
    line: usize,
}

impl Text<'_> {
    fn line_of(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|byte| *byte == b'\n').count()
    }

    fn is_here(&self, place: &Range<usize>) -> bool {
        self.line_of(place.start) == self.line
    }

    /// The part of the text that a message is about.
    fn part(&self, message: &str) -> Option<Range<usize>> {
        let first = message.lines().next().unwrap_or_default();
        if first.starts_with("this looks like a") {
            return None;
        }
        let entries = match DeTable::parse(self.text) {
            Ok(root) => entries_of(root.get_ref()),
            Err(error) => {
                let place = error.span().filter(|place| self.is_here(place));
                // An error at the end of a line has no character of its own.
                return place.map(|place| place.start..place.end.max(place.start + 1)).or_else(|| self.whole_line());
            }
        };
        let quoted = first.split('`').nth(1).unwrap_or_default();
        if ["unknown key `", "there is no signal `"].iter().any(|begin| first.starts_with(begin)) {
            let is_it = |entry: &&Entry| self.is_here(&entry.key) && entry.name(self.text) == quoted;
            return entries.iter().find(is_it).map(|entry| entry.key.clone()).or_else(|| self.whole_line());
        }
        let is_of_type = ["invalid ", "unknown variant `"].iter().any(|begin| first.starts_with(begin));
        let of_key = || first.starts_with('`').then(|| self.of_key(&entries, quoted)).flatten();
        let of_value = || is_of_type.then(|| self.of_value(&entries, first)).flatten();
        of_key().or_else(of_value).or_else(|| self.whole_line())
    }

    /// The value of a key with its tables, such as `clutch.b.slip_rad_s[2]`.
    fn of_key(&self, entries: &[Entry], key: &str) -> Option<Range<usize>> {
        let (name, item) = match key.strip_suffix(']').and_then(|key| key.rsplit_once('[')) {
            Some((name, item)) => (name, item.parse::<usize>().ok()),
            None => (key, None),
        };
        let own = name.rsplit('.').next().unwrap_or(name);
        let named = entries.iter().filter(|entry| entry.name(self.text) == own);
        let here = named.filter(|entry| self.is_here(&entry.key) || self.is_here(&entry.value));
        // Of several on one line, that with the tables of the key.
        let alike = |entry: &&Entry| {
            let path = format!("{}.{own}", entry.tables);
            path.bytes().rev().zip(name.bytes().rev()).take_while(|(one, other)| one == other).count()
        };
        let entry = here.max_by_key(alike)?;
        match item.and_then(|item| entry.items.get(item)) {
            Some(item) => Some(item.clone()),
            None if entry.is_table && !self.is_in_braces(&entry.value) => Some(entry.key.clone()),
            None => Some(entry.value.clone()),
        }
    }

    /// The value on the line that a message of the parser describes, such as `invalid type: the text "x", expected a number`.
    fn of_value(&self, entries: &[Entry], message: &str) -> Option<Range<usize>> {
        let values = entries.iter().filter(|entry| !entry.is_table).flat_map(|entry| {
            let items = entry.items.iter().filter(|item| !self.is_here(&entry.value) || self.begins(item, &['[', '{']));
            items.chain([&entry.value])
        });
        let here: Vec<&Range<usize>> = values.filter(|value| self.is_here(value)).collect();
        let described = |value: &&&Range<usize>| {
            let written = self.text.get((**value).clone()).unwrap_or_default();
            match message.split(['`', '"']).nth(1) {
                Some(quoted) if !message.starts_with("invalid length") => {
                    let is_number = |text: &str| text.parse::<f64>().ok();
                    written.trim_matches(['"', '\'']) == quoted
                        || is_number(written).is_some_and(|number| Some(number) == is_number(quoted))
                }
                _ => written.starts_with(['[', '{']),
            }
        };
        match here[..] {
            [] => None,
            [one] => Some(one.clone()),
            _ => here.iter().find(described).map(|value| (**value).clone()),
        }
    }

    fn is_in_braces(&self, value: &Range<usize>) -> bool {
        self.begins(value, &['{'])
    }

    fn begins(&self, value: &Range<usize>, with: &[char]) -> bool {
        self.text.get(value.clone()).is_some_and(|text| text.starts_with(with))
    }

    /// What is written on the line, but for a comment; none of the first line, where what is wrong is the whole file.
    fn whole_line(&self) -> Option<Range<usize>> {
        let begin = self.text.match_indices('\n').nth(self.line.checked_sub(2)?)?.0 + 1;
        let line = self.text.get(begin..)?.lines().next()?;
        let written = line.split(" #").next().unwrap_or(line).trim();
        let start = begin + (line.len() - line.trim_start().len());
        (!written.is_empty()).then(|| start..start + written.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Line, column and what is marked.
    fn marked(text: &str, line: usize, message: &str) -> Option<(usize, usize, String)> {
        let shown = Excerpt::of(&Source::built_in("x.toml", text), line, message)?;
        Some((shown.line, shown.column, shown.text[shown.marked].to_owned()))
    }

    #[test]
    fn the_value_or_key_of_a_message_is_marked() {
        let text =
            "name = \"x\"\n[clutch.a]\nfaces = 8 # of steel\nmap = [1, 2,\n  -3, 4]\n[clutch.b]\nfaces = \"8\"\n";
        for (line, message, place) in [
            (3, "`clutch.a.faces` is 8, expected 1 to 4", (3, 9, "8")),
            (4, "`clutch.a.map[1]` is 2, expected 3 to 4", (4, 11, "2")),
            (4, "`clutch.a.map[2]` is -3, expected 0 to 4", (5, 3, "-3")),
            (7, "invalid type: the text \"8\", expected a number", (7, 9, "\"8\"")),
            (7, "unknown key `faces`, expected `teeth`", (7, 1, "faces")),
            (6, "missing key `gain`", (6, 1, "[clutch.b]")),
            (6, "`clutch.b`: missing `gain`", (6, 9, "b")),
            (1, "`name`: a name must not be empty", (1, 8, "\"x\"")),
        ] {
            let (of, column, part) = place;
            assert_eq!(marked(text, line, message), Some((of, column, part.to_owned())), "{message}");
        }
    }

    #[test]
    fn of_several_values_on_a_line_the_one_that_is_described_is_marked() {
        let text = "list = [{ a = 1, b = 2.50 }, { a = 3, b = true }]\n";
        for (message, column, part) in [
            ("`list[1].a` is 3, expected 0 to 1", 36, "3"),
            ("invalid type: the number `2.5`, expected text in quotes", 22, "2.50"),
            ("invalid type: the word `true`, expected a number", 43, "true"),
        ] {
            assert_eq!(marked(text, 1, message), Some((1, column, part.to_owned())), "{message}");
        }
    }

    #[test]
    fn an_error_of_the_whole_file_has_no_excerpt() {
        assert_eq!(marked("a = 1\n", 1, "this looks like a study file, expected a vehicle file"), None);
        assert_eq!(marked("", 1, "missing key `name`"), None);
        assert_eq!(marked("a = 1\n", 9, "missing key `name`"), None);
        assert_eq!(marked("a = 1\n\n", 0, "missing key `name`"), None);
    }

    #[test]
    fn a_text_that_is_no_toml_is_marked_where_its_reader_ended() {
        assert_eq!(marked("a = 1\nb = = 2\n", 2, "invalid"), Some((2, 5, "=".to_owned())));
        let end = Excerpt::of(&Source::built_in("x.toml", "a = 1\nb ="), 2, "invalid").unwrap();
        assert_eq!((end.line, end.text.as_str()), (2, "b ="));
    }

    #[test]
    fn a_line_is_shown_without_what_controls_a_terminal_and_never_whole_if_it_is_long() {
        let text = format!("\ta = \"\u{1b}[2J\u{202e}\" # {}\n", "x".repeat(10_000_000));
        let shown = Excerpt::of(&Source::built_in("x.toml", &text), 1, "`a`: wrong").unwrap();
        assert!(shown.text.starts_with(" a = \"\u{fffd}[2J\u{fffd}\" # x"), "{}", &shown.text[..40]);
        assert_eq!(shown.text.chars().count(), LONGEST_LINE);
        let text = format!("list = [{} -1, 3]\n", "1.0, ".repeat(1000));
        let shown = Excerpt::of(&Source::built_in("x.toml", &text), 1, "`list[1000]` is -1, expected 0 to 2").unwrap();
        assert_eq!((shown.column, &shown.text[shown.marked.clone()]), (5010, "-1"));
        assert!(shown.text.ends_with("-1, 3]") && shown.text.chars().count() < LONGEST_LINE);
    }
}
