//! Range checks that know where in the file a value stands.

use std::ops::RangeInclusive;

use drivetrain::{Table1, TableError};
use toml::Spanned;

use crate::{ConfigError, Source};

/// A number with its place in the file.
pub(crate) type Number = Spanned<f64>;
/// A list of numbers with its place in the file.
pub(crate) type Numbers = Spanned<Vec<f64>>;

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
    ("_rad", "degrees", std::f64::consts::PI / 180.0),
    ("_s", "ms", 1e-3),
    ("_a", "mA", 1e-3),
    ("_kg", "t", 1e3),
    ("_n", "kN", 1e3),
    ("throttle", "%", 1e-2),
    ("position", "%", 1e-2),
    ("coefficient", "%", 1e-2),
];

/// Checks the values of one file.
pub(crate) struct Check<'a> {
    pub(crate) source: &'a Source,
}

impl Check<'_> {
    /// The number, if it lies in the range.
    pub(crate) fn number(&self, key: &str, value: &Number, range: RangeInclusive<f64>) -> Result<f64, ConfigError> {
        self.in_range(key, *value.get_ref(), value.span().start, &range)
    }

    /// The numbers, if all lie in the range.
    pub(crate) fn numbers<'n>(
        &self,
        key: &str,
        values: &'n Numbers,
        range: RangeInclusive<f64>,
    ) -> Result<&'n [f64], ConfigError> {
        for (i, &value) in values.get_ref().iter().enumerate() {
            self.in_range(&format!("{key}[{i}]"), value, values.span().start, &range)?;
        }
        Ok(values.get_ref())
    }

    /// A table from two lists whose values lie in their ranges.
    pub(crate) fn table(
        &self,
        (axis_key, axis, axis_range): (&str, &Numbers, RangeInclusive<f64>),
        (key, values, range): (&str, &Numbers, RangeInclusive<f64>),
    ) -> Result<Table1<f64>, ConfigError> {
        let axis_values = self.numbers(axis_key, axis, axis_range)?;
        let table = Table1::new(axis_values, self.numbers(key, values, range)?);
        table.map_err(|error| match error {
            TableError::LengthMismatch(..) => self.meaning(key, values.span().start, error.to_string(), None),
            _ => self.meaning(axis_key, axis.span().start, error.to_string(), None),
        })
    }

    /// An error about what a value means.
    pub(crate) fn meaning(&self, key: &str, offset: usize, message: String, hint: Option<String>) -> ConfigError {
        ConfigError::Meaning {
            path: self.source.path.clone(),
            line: self.source.line(offset),
            key: key.to_owned(),
            message,
            hint,
        }
    }

    fn in_range(&self, key: &str, value: f64, offset: usize, range: &RangeInclusive<f64>) -> Result<f64, ConfigError> {
        if range.contains(&value) {
            return Ok(value);
        }
        Err(ConfigError::Range {
            path: self.source.path.clone(),
            line: self.source.line(offset),
            key: key.to_owned(),
            value,
            allowed: format!("{} to {}", range.start(), range.end()),
            hint: unit_hint(key, value, range),
        })
    }
}

/// A value that misses its range by less than this factor is in the right unit, and just wrong.
const WRONG_UNIT_FACTOR: f64 = 3.0;

/// The unit in which the value would make sense.
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
                "throttle" | "position" | "coefficient" => "as a fraction".to_owned(),
                "pa" => "Pa".to_owned(),
                "a" => "A".to_owned(),
                "n" => "N".to_owned(),
                _ => right,
            };
            format!("{value} {wrong} is {} {right}", significant(value * size))
        },
    )
}

/// A number with at most six significant digits and no trailing zeros.
fn significant(value: f64) -> f64 {
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
