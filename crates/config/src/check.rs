//! Range checks with the place of the value in the file.

use std::fmt::{self, Display};
use std::ops::RangeInclusive;

use drivetrain::table::{MAX_POINTS, check_axis};
use drivetrain::{Table1, TableError};
use toml::Spanned;
use trace::printable;

use crate::error::Shown;
use crate::source::Layers;
use crate::{ConfigError, Source};

/// A number with its place in the file.
pub(crate) type Number = Spanned<f64>;
/// A list of numbers with its place in the file.
pub(crate) type Numbers = Spanned<Vec<f64>>;
/// A word with its place in the file.
pub(crate) type Word = Spanned<String>;

/// Units that people write by mistake: unit of the key, what was written, its size in the key's unit.
const MISTAKEN_UNITS: &[(&str, &str, f64)] = &[
    ("_m2", "cm2", 1e-4),
    ("_m2", "mm2", 1e-6),
    ("_m", "mm", 1e-3),
    ("_m", "cm", 1e-2),
    ("_pa", "MPa", 1e6),
    ("_pa", "bar", 1e5),
    ("_pa", "kPa", 1e3),
    ("_pa_a", "MPa/A", 1e6),
    ("_pa_a", "bar/A", 1e5),
    ("_rad_s", "rpm", std::f64::consts::PI / 30.0),
    ("_m_s", "km/h", 1.0 / 3.6),
    ("_pa_s_rad", "MPa s/rad", 1e6),
    ("_rad", "degrees", std::f64::consts::PI / 180.0),
    ("_s", "ms", 1e-3),
    ("_a", "mA", 1e-3),
    ("_kg", "t", 1e3),
    ("_n", "kN", 1e3),
    ("throttle", "%", 1e-2),
    ("share", "%", 1e-2),
    ("position", "%", 1e-2),
    ("coefficient", "%", 1e-2),
];

/// Longest name, bytes: with a run's number and an ending it is still a file name.
const LONGEST_NAME: usize = 80;

/// Breakpoints of an axis are apart by at least this fraction of the largest value that the axis allows: what is closer is
/// a slip of the pen, and too steep for a slope in single precision.
const BREAKPOINTS_APART: f64 = 1e-6;

/// A key in a table of the file. Every value has one, but only an error writes it out.
#[derive(Clone, Copy)]
pub(crate) struct Key<'a> {
    pub(crate) table: &'a str,
    pub(crate) name: &'a str,
}

impl Display for Key<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.table, self.name)
    }
}

/// Checks the values of a file, or of one with another laid over it.
pub(crate) struct Check<'a> {
    pub(crate) layers: Layers<'a>,
}

impl<'a> Check<'a> {
    /// Checks the values of one file.
    pub(crate) fn of(source: &'a Source) -> Self {
        Self { layers: Layers { source, over: None } }
    }

    /// A value as it is written.
    pub(crate) fn text(&self, span: std::ops::Range<usize>) -> &'a str {
        self.layers.source.text.get(span).unwrap_or_default()
    }

    /// The number, if it is in the range.
    pub(crate) fn number(
        &self,
        key: impl Display,
        value: &Number,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        self.in_range(&key, *value.get_ref(), value.span().start, &range)
    }

    /// The numbers, if all lie in the range.
    pub(crate) fn numbers<'n>(
        &self,
        key: impl Display,
        values: &'n Numbers,
        range: RangeInclusive<f64>,
    ) -> Result<&'n [f64], ConfigError> {
        for (i, &value) in values.get_ref().iter().enumerate() {
            self.in_range(&format_args!("{key}[{i}]"), value, values.span().start, &range)?;
        }
        Ok(values.get_ref())
    }

    /// A name that becomes part of tables, file names and pages. Spreadsheets take what begins with one of `=+-@` for a
    /// formula.
    pub(crate) fn name(&self, key: &str, name: &str, offset: usize) -> Result<String, ConfigError> {
        let hint = || Some("use letters, digits, spaces and underscores, such as \"town 1\"".to_owned());
        let wrong = |what: &str| Err(self.meaning(key, offset, format!("a name must not {what}"), hint()));
        match name {
            "" => wrong("be empty"),
            _ if name.len() > LONGEST_NAME => wrong(&format!("be longer than {LONGEST_NAME} bytes")),
            _ if name.chars().any(char::is_control) => wrong("contain a line break, tab or other control character"),
            _ if name.contains('"') => wrong("contain a double quote"),
            _ if name.starts_with(['=', '+', '-', '@']) => wrong("begin with one of = + - @"),
            _ if name.trim() != name => wrong("begin or end with a space"),
            _ => Ok(name.to_owned()),
        }
    }

    /// A title for people: one line of anything that can be printed.
    pub(crate) fn title(&self, key: &str, title: &Spanned<String>) -> Result<String, ConfigError> {
        if title.get_ref().chars().any(char::is_control) {
            let message = "a title must not contain a line break, tab or other control character".to_owned();
            let hint = Some("write the title in one line".to_owned());
            return Err(self.meaning(key, title.span().start, message, hint));
        }
        Ok(title.get_ref().clone())
    }

    /// The number, if it is a whole one in the range: a count of teeth, faces or periods.
    pub(crate) fn count(
        &self,
        key: impl Display,
        value: &Number,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        let number = self.number(&key, value, range)?;
        if number.fract() == 0.0 {
            return Ok(number);
        }
        Err(self.meaning(
            &key,
            value.span().start,
            format!("is {number}, expected an integer"),
            Some("write it without a fraction, such as 4".to_owned()),
        ))
    }

    /// Minimum and maximum, if both lie in the range.
    pub(crate) fn pair(
        &self,
        key: impl Display,
        values: &Numbers,
        range: RangeInclusive<f64>,
    ) -> Result<[f64; 2], ConfigError> {
        match *self.numbers(&key, values, range)? {
            [minimum, maximum] if minimum <= maximum => Ok([minimum, maximum]),
            _ => Err(self.meaning(
                &key,
                values.span().start,
                "expected [minimum, maximum]".to_owned(),
                Some("two numbers, the smaller one first, such as [0.85, 1.15]".to_owned()),
            )),
        }
    }

    /// As many numbers as that, if all lie in the range.
    pub(crate) fn array<const N: usize>(
        &self,
        key: impl Display,
        values: &Numbers,
        range: RangeInclusive<f64>,
    ) -> Result<[f64; N], ConfigError> {
        let numbers = self.numbers(&key, values, range)?;
        numbers.try_into().map_err(|_| {
            let message = format!("has {} numbers, expected {N}", numbers.len());
            self.meaning(&key, values.span().start, message, None)
        })
    }

    /// The breakpoints of an axis: between 2 and `maximum` of them, rising within the range.
    pub(crate) fn axis<'n>(
        &self,
        key: impl Display,
        values: &'n Numbers,
        range: RangeInclusive<f64>,
        maximum: usize,
    ) -> Result<&'n [f64], ConfigError> {
        let apart = BREAKPOINTS_APART * range.end();
        let points = self.numbers(&key, values, range)?;
        let wrong = |message: String| self.meaning(&key, values.span().start, message, None);
        check_axis(points, maximum).map_err(|error| wrong(error.to_string()))?;
        match points.windows(2).position(|pair| pair[1] - pair[0] < apart) {
            None => Ok(points),
            Some(at) => {
                let message =
                    format!("breakpoint {} is less than {} above the breakpoint before it", at + 2, significant(apart));
                let hint = Some("breakpoints rise: remove one of two that are equal, or sort them".to_owned());
                Err(self.meaning(&key, values.span().start, message, hint))
            }
        }
    }

    /// A table from two lists whose values lie in their ranges.
    pub(crate) fn table(
        &self,
        (axis_key, axis, axis_range): (impl Display, &Numbers, RangeInclusive<f64>),
        (key, values, range): (impl Display, &Numbers, RangeInclusive<f64>),
    ) -> Result<Table1<f64>, ConfigError> {
        let axis = self.axis(axis_key, axis, axis_range, MAX_POINTS)?;
        // What is left to be wrong is the number of values.
        let wrong = |error: TableError| self.meaning(&key, values.span().start, error.to_string(), None);
        Table1::new(axis, self.numbers(&key, values, range)?).map_err(wrong)
    }

    /// A number that must be there.
    pub(crate) fn required<'n, T>(
        &self,
        table: impl Display,
        at: usize,
        key: &str,
        value: Option<&'n T>,
    ) -> Result<&'n T, ConfigError> {
        value.ok_or_else(|| self.meaning(table, at, format!("missing `{key}`"), None))
    }

    /// Refuses names that appear twice.
    pub(crate) fn distinct<'n>(
        &self,
        key: &str,
        names: impl Iterator<Item = &'n Word> + Clone,
    ) -> Result<(), ConfigError> {
        let earlier = |at: usize, name: &Word| names.clone().take(at).any(|other| other.get_ref() == name.get_ref());
        match names.clone().enumerate().find(|(at, name)| earlier(*at, name)) {
            None => Ok(()),
            Some((_, name)) => Err(self.meaning(
                key,
                name.span().start,
                format!("two entries have the name \"{}\"", name.get_ref()),
                Some("give one of them another name".to_owned()),
            )),
        }
    }

    /// A name that becomes part of the name of a file: it must be valid on any system, and name a file in the folder.
    pub(crate) fn file_name(&self, key: &str, name: &Spanned<String>) -> Result<String, ConfigError> {
        const LONGEST: usize = 80;
        let text = name.get_ref();
        let fits = text.chars().all(|c| c.is_alphanumeric() || " _-.".contains(c)) && text.chars().count() <= LONGEST;
        if fits && !text.is_empty() && !text.starts_with(['.', ' ']) && !text.ends_with(['.', ' ']) {
            return Ok(text.clone());
        }
        let shown: String = text.chars().take(LONGEST).flat_map(char::escape_debug).collect();
        Err(self.meaning(
            key,
            name.span().start,
            format!("`{shown}` cannot be the name of a file"),
            Some(format!(
                "use letters, digits, `_` and `-`, and `.` or a space inside the name, at most {LONGEST} characters, such as E1"
            )),
        ))
    }

    /// An error about what a value means: message and hint of one line each, which may quote the file.
    pub(crate) fn meaning(
        &self,
        key: impl Display,
        offset: usize,
        message: String,
        hint: Option<String>,
    ) -> ConfigError {
        let (path, line) = self.layers.place(offset);
        let one_line = |text: String| printable(&text).into_owned();
        // A message of elsewhere may bring its hint.
        let (message, hint) = match message.split_once("\nhint: ") {
            Some((what, of_message)) if hint.is_none() => (what.to_owned(), Some(of_message.to_owned())),
            _ => (message, hint),
        };
        let (key, message) = (one_line(key.to_string()), one_line(message));
        ConfigError::Meaning { path, line, key, message, hint: hint.map(one_line) }
    }

    fn in_range(
        &self,
        key: &dyn Display,
        value: f64,
        offset: usize,
        range: &RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        if range.contains(&value) {
            return Ok(value);
        }
        let (path, line) = self.layers.place(offset);
        let key = printable(&key.to_string()).into_owned();
        Err(ConfigError::Range {
            path,
            line,
            value,
            allowed: format!("{} to {}", Shown(*range.start()), Shown(*range.end())),
            hint: unit_hint(&key, value, range),
            key,
        })
    }
}

/// A value outside its range by less than this factor has the right unit.
const WRONG_UNIT_FACTOR: f64 = 3.0;

/// A hint at the unit in which the value would be in its range.
fn unit_hint(key: &str, value: f64, range: &RangeInclusive<f64>) -> Option<String> {
    if value <= WRONG_UNIT_FACTOR * range.end() && value >= range.start() / WRONG_UNIT_FACTOR {
        return None;
    }
    let name = key.split('[').next().unwrap_or(key);
    // The longest suffix that fits is the key's unit: `_rad_s` is not `_s`.
    let unit =
        MISTAKEN_UNITS.iter().map(|(unit, ..)| *unit).filter(|unit| name.ends_with(unit)).max_by_key(|u| u.len())?;
    MISTAKEN_UNITS.iter().find(|(of, _, size)| *of == unit && range.contains(&(value * size))).map(
        |(_, wrong, size)| {
            let right =
                unit.trim_start_matches('_').replace("rad_s", "rad/s").replace("m_s", "m/s").replace("pa_a", "Pa/A");
            let right = match right.as_str() {
                "throttle" | "share" | "position" | "coefficient" => "as a fraction".to_owned(),
                "pa_s_rad" => "Pa s/rad".to_owned(),
                "pa" => "Pa".to_owned(),
                "a" => "A".to_owned(),
                "n" => "N".to_owned(),
                _ => right,
            };
            format!("{value} {wrong} is {} {right}", significant(value * size))
        },
    )
}

/// The nearest number with at most six significant digits: 0.89 for 0.8900000000000001.
pub fn significant(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_in_a_usual_wrong_unit_gets_the_right_one_as_hint() {
        let hint = |key, value, range| unit_hint(key, value, &range).unwrap_or_default();
        assert_eq!(hint("clutch.b.piston_area_m2", 117.0, 0.001..=0.05), "117 cm2 is 0.0117 m2");
        assert_eq!(hint("initial.engine_rad_s", 6000.0, 0.0..=800.0), "6000 rpm is 628.319 rad/s");
        assert_eq!(hint("vehicle.grade_rad", 5.0, -0.4..=0.4), "5 degrees is 0.0872665 rad");
        assert_eq!(hint("design.offset_max_pa", 0.05, 1e3..=1e6), "0.05 MPa is 50000 Pa");
        assert_eq!(hint("throttle.position[2]", 22.0, 0.0..=1.0), "22 % is 0.22 as a fraction");
        assert_eq!(hint("clutch.b.friction_faces", 300.0, 1.0..=20.0), "");
        assert_eq!(hint("shift.request_s", 7.4, 0.0..=5.0), "");
        assert_eq!(hint("shift.request_s", 7400.0, 0.0..=9.5), "7400 ms is 7.4 s");
    }
}
