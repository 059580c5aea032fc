//! Changes of values in the text of a vehicle file; everything else stays as it is.

use toml::de::{DeTable, DeValue};

pub(crate) use trace::toml_number as number;

use crate::FitError;

/// How the comment of a fitted value begins.
pub(crate) const FITTED: &str = "# fit: ";

/// How the first line of a file with the given values goes on.
const KEPT: &str = "all values are those of the given file. ";

/// The text of a file that a fit writes, with a line at its head. A line of an earlier fit that kept the given values goes.
pub(crate) fn headed(head: &str, text: &str) -> String {
    let mut rest = text;
    while let Some((_, below)) = rest.strip_prefix(FITTED).and_then(|line| line.strip_prefix(KEPT)?.split_once('\n')) {
        rest = below;
    }
    format!("{FITTED}{head}\n{rest}")
}

/// The text of a given file, with the reason why its values are kept in a line at its head.
pub fn kept_text(text: &str, reason: &str) -> String {
    headed(&format!("{KEPT}{}", reason.replace(char::is_control, " ")), text)
}

/// A step of the way to a value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Step {
    Key(String),
    Item(usize),
}

/// The way to a value by keys.
pub(crate) fn keys(keys: &[&str]) -> Vec<Step> {
    keys.iter().map(|key| Step::Key((*key).to_owned())).collect()
}

/// The inertia of a shaft by its place.
pub(crate) fn shaft_inertia(shaft: usize) -> Vec<Step> {
    let mut path = keys(&["gear_train", "shaft"]);
    path.extend([Step::Item(shaft), Step::Key("inertia_kg_m2".to_owned())]);
    path
}

/// The text of a vehicle file on its way to another.
pub(crate) struct VehicleText {
    text: String,
    /// Replacements and insertions by their places in the text.
    edits: Vec<(std::ops::Range<usize>, String)>,
}

impl VehicleText {
    pub(crate) fn new(text: &str) -> Result<Self, FitError> {
        DeTable::parse(text).map_err(|error| FitError::input(error.to_string()))?;
        Ok(Self { text: text.to_owned(), edits: Vec::new() })
    }

    /// Whether there is a value.
    pub(crate) fn has(&self, path: &[Step]) -> bool {
        self.place(path).is_ok()
    }

    /// The numbers of a value: one, or those of an array.
    pub(crate) fn numbers(&self, path: &[Step]) -> Result<Vec<f64>, FitError> {
        let (span, _) = self.place(path)?;
        let value: toml::Value = (format!("v = {}", &self.text[span]).parse::<toml::Table>().ok())
            .and_then(|mut table| table.remove("v"))
            .ok_or_else(|| missing(path))?;
        let number = |value: &toml::Value| value.as_float().or(value.as_integer().map(|i| i as f64));
        match &value {
            toml::Value::Array(items) => items.iter().map(|item| number(item).ok_or_else(|| missing(path))).collect(),
            other => Ok(vec![number(other).ok_or_else(|| missing(path))?]),
        }
    }

    /// Replaces a number, or every number of an array, and says why in a comment on the line above.
    pub(crate) fn map(
        &mut self,
        path: &[Step],
        change: impl Fn(f64) -> f64,
        comment: Option<&str>,
    ) -> Result<(), FitError> {
        let values: Vec<f64> = self.numbers(path)?.into_iter().map(change).collect();
        self.set(path, &values, comment)
    }

    /// Puts numbers in place of a number or of an array of as many.
    pub(crate) fn set(&mut self, path: &[Step], values: &[f64], comment: Option<&str>) -> Result<(), FitError> {
        let (span, key_at) = self.place(path)?;
        let text = if self.text[span.clone()].starts_with('[') {
            format!("[{}]", values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", "))
        } else {
            values.first().map_or_else(String::new, |value| number(*value))
        };
        self.replace(span, key_at, text, comment);
        Ok(())
    }

    /// Puts a number in place of another, or into its table where that does not have it.
    pub(crate) fn put(&mut self, table: &[&str], key: &str, value: f64, comment: &str) -> Result<(), FitError> {
        let path = keys(&[table, &[key]].concat());
        if self.has(&path) {
            return self.set(&path, &[value], Some(comment));
        }
        let line = format!("{FITTED}{comment}; the file had none\n{key} = {}\n", number(value));
        if !self.add_to_table(&keys(table), &line)? {
            self.add_table(&keys(table), &line);
        }
        Ok(())
    }

    /// Puts any value, as it is written in TOML, in place of another.
    pub(crate) fn set_text(&mut self, path: &[Step], value: &str, comment: &str) -> Result<(), FitError> {
        let (span, key_at) = self.place(path)?;
        self.replace(span, key_at, value.to_owned(), Some(comment));
        Ok(())
    }

    fn replace(&mut self, span: std::ops::Range<usize>, key_at: usize, text: String, comment: Option<&str>) {
        if let Some(comment) = comment {
            let before = &self.text[span.clone()];
            let was = if before.starts_with('[') { String::new() } else { format!("; before: {before}") };
            let line_at = self.text[..key_at].rfind('\n').map_or(0, |end| end + 1);
            // The comment of a fit before says nothing of the new value.
            let above_at = self.text[..line_at.saturating_sub(1)].rfind('\n').map_or(0, |end| end + 1);
            let stale = self.text[above_at..line_at].starts_with(FITTED);
            let at = if stale { above_at..line_at } else { line_at..line_at };
            self.edits.push((at, format!("{FITTED}{comment}{was}\n")));
        }
        self.edits.push((span, text));
    }

    /// Adds lines to a table of the file, above its first key that begins a line, or below the line of a table without keys; false if
    /// there is no such table.
    pub(crate) fn add_to_table(&mut self, table: &[Step], lines: &str) -> Result<bool, FitError> {
        let root = DeTable::parse(&self.text).map_err(|error| FitError::input(error.to_string()))?;
        let mut found = root.get_ref();
        for step in table {
            let Step::Key(key) = step else { return Ok(false) };
            let value = found.iter().find(|(name, _)| name.get_ref().as_ref() == key.as_str());
            let Some(DeValue::Table(inner)) = value.map(|(_, value)| value.get_ref()) else { return Ok(false) };
            found = inner;
        }
        let line_of = |at: usize| self.text[..at].rfind('\n').map_or(0, |end| end + 1);
        let begins_line = |at: &usize| self.text[line_of(*at)..*at].trim().is_empty();
        let first = found.keys().map(|key| key.span().start).filter(begins_line).min().map(line_of);
        let Some(at) = first.or_else(|| self.end_of_header(table)) else { return Ok(false) };
        self.edits.push((at..at, lines.to_owned()));
        Ok(true)
    }

    /// Adds a table that the file does not have, at its end.
    pub(crate) fn add_table(&mut self, table: &[Step], lines: &str) {
        let end = self.text.len();
        let line_end = if self.text.ends_with('\n') { "" } else { "\n" };
        self.edits.push((end..end, format!("{line_end}\n[{}]\n{lines}", name_of(table))));
    }

    /// The end of the line with the name of a table.
    fn end_of_header(&self, table: &[Step]) -> Option<usize> {
        let header = format!("[{}]", name_of(table));
        let mut at = 0;
        for line in self.text.split_inclusive('\n') {
            at += line.len();
            let is_header = line.trim_start().strip_prefix(&header).is_some_and(|rest| {
                let rest = rest.trim();
                rest.is_empty() || rest.starts_with('#')
            });
            if is_header && line.ends_with('\n') {
                return Some(at);
            }
        }
        None
    }

    /// Adds a number to the table of another value: on the line above it, or behind it in a table that is written in one line.
    pub(crate) fn add_beside(&mut self, path: &[Step], key: &str, value: f64, comment: &str) -> Result<(), FitError> {
        let (span, key_at) = self.place(path)?;
        let line_at = self.text[..key_at].rfind('\n').map_or(0, |end| end + 1);
        let (before, value) = (self.text[line_at..key_at].trim(), number(value));
        let is_in_line = before.contains(['{', '=']) || !(before.is_empty() || before.ends_with('.'));
        let line = if is_in_line { String::new() } else { format!("{before}{key} = {value}\n") };
        if is_in_line {
            self.edits.push((span.end..span.end, format!(", {key} = {value}")));
        }
        self.edits.push((line_at..line_at, format!("{FITTED}{comment}; the file had none\n{line}")));
        Ok(())
    }

    /// The text with all changes.
    pub(crate) fn finish(mut self) -> String {
        // From the end on, so that the places before stay right; a comment goes before a value on its line.
        self.edits.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
        for (span, text) in self.edits {
            self.text.replace_range(span, &text);
        }
        self.text
    }

    /// Where a value is, and where its key begins.
    fn place(&self, path: &[Step]) -> Result<(std::ops::Range<usize>, usize), FitError> {
        let table = DeTable::parse(&self.text).map_err(|error| FitError::input(error.to_string()))?;
        let mut span = table.span();
        let mut key_at = 0;
        let root = DeValue::Table(table.into_inner());
        let mut value = &root;
        for step in path {
            let next = match (step, value) {
                (Step::Key(key), DeValue::Table(table)) => {
                    let found = table.iter().find(|(name, _)| name.get_ref().as_ref() == key.as_str());
                    found.map(|(name, value)| {
                        key_at = name.span().start;
                        value
                    })
                }
                (Step::Item(i), DeValue::Array(items)) => items.get(*i),
                _ => None,
            };
            let next = next.ok_or_else(|| missing(path))?;
            span = next.span();
            value = next.get_ref();
        }
        Ok((span, key_at))
    }
}

/// The name of a table as it stands in its line.
fn name_of(table: &[Step]) -> String {
    let names = table.iter().filter_map(|step| if let Step::Key(key) = step { Some(&**key) } else { None });
    names.collect::<Vec<&str>>().join(".")
}

fn missing(path: &[Step]) -> FitError {
    let steps = path.iter().map(|step| match step {
        Step::Key(key) => key.clone(),
        Step::Item(i) => i.to_string(),
    });
    FitError::input(format!("the vehicle file has no numbers at `{}`", steps.collect::<Vec<_>>().join(".")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_go_below_the_name_of_a_table_that_has_only_comments() {
        let text = "[engine]\ninertia_kg_m2 = 0.2\n\n[converter] # all defaults\n# capacity = 1\n\n[a.b]\n";
        let mut changed = VehicleText::new(text).unwrap();
        for table in [&["converter"][..], &["a", "b"]] {
            assert!(changed.add_to_table(&keys(table), "x = 1\n").unwrap());
        }
        assert!(!changed.add_to_table(&keys(&["friction"]), "x = 1\n").unwrap());
        let changed = changed.finish();
        assert_eq!(
            changed,
            "[engine]\ninertia_kg_m2 = 0.2\n\n[converter] # all defaults\nx = 1\n# capacity = 1\n\n[a.b]\nx = 1\n"
        );
        assert!(changed.parse::<toml::Table>().is_ok());
    }

    #[test]
    fn a_value_is_replaced_and_everything_else_stays() {
        let text =
            "# head\n[a.b]\nx = 2 # [chapter]\ny = { p = [1.0, 2.0], q = [3.0,\n  4.0] }\n[[s]]\nz = 5\n[[s]]\nz = 6\n";
        let mut edited = VehicleText::new(text).unwrap();
        edited.map(&keys(&["a", "b", "x"]), |x| 1.5 * x, Some("x 1.5")).unwrap();
        edited.map(&keys(&["a", "b", "y", "q"]), |value| 2.0 * value, None).unwrap();
        edited.map(&[Step::Key("s".into()), Step::Item(1), Step::Key("z".into())], |value| 0.5 * value, None).unwrap();
        let expected = "# head\n[a.b]\n# fit: x 1.5; before: 2\nx = 3.0 # [chapter]\ny = { p = [1.0, 2.0], q = [6.0, 8.0] }\n[[s]]\nz = 5\n[[s]]\nz = 3.0\n";
        assert_eq!(edited.finish(), expected);
        let mut again = VehicleText::new(expected).unwrap();
        again.map(&keys(&["a", "b", "x"]), |x| 2.0 * x, Some("x 2")).unwrap();
        assert_eq!(
            again.finish(),
            expected.replace("# fit: x 1.5; before: 2\nx = 3.0", "# fit: x 2; before: 3.0\nx = 6.0")
        );
        assert!(VehicleText::new(text).unwrap().map(&keys(&["a", "c"]), |value| value, None).is_err());
    }
}
