//! The values that a factor of a study takes.

use super::RawFactor;
use crate::ConfigError;
use crate::check::{Check, Number, Numbers};

/// Levels of a range in a full factorial plan, if the file does not say.
const LEVELS: usize = 3;
/// The values that a factor takes.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// One of these, each as often as the others.
    List(Vec<f64>),
    /// Any in this range, all alike; the number of levels in a full factorial plan.
    Uniform(f64, f64, usize),
    /// Any in this range, all alike on a logarithmic scale; the number of levels.
    LogUniform(f64, f64, usize),
    /// Normally distributed with this mean and standard deviation, cut off at three deviations; the number of
    /// levels.
    Normal(f64, f64, usize),
    /// Any of other values in a fraction of the runs, and one value in the rest of them.
    Sometimes(Sometimes),
}

/// The values of a factor that is not in every run.
#[derive(Debug, Clone, PartialEq)]
pub struct Sometimes {
    /// Fraction of the runs with one of `values`, between 0 and 1.
    pub chance: f64,
    /// The value in the other runs.
    pub otherwise: f64,
    /// The values that it takes.
    pub values: Box<Values>,
}

impl Sometimes {
    /// Position in all values, from 0 to 1, of one of the values that it takes, given its position in these.
    pub fn place_within(&self, place: f64) -> f64 {
        1.0 - self.chance + self.chance * place
    }
}

impl Values {
    /// The values of the runs that have the factor.
    pub fn taken(&self) -> &Self {
        match self {
            Self::Sometimes(Sometimes { values, .. }) => values,
            Self::List(_) | Self::Uniform(..) | Self::LogUniform(..) | Self::Normal(..) => self,
        }
    }

    /// Smallest and largest value.
    pub fn ends(&self) -> [f64; 2] {
        match self {
            Self::List(values) => {
                values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], &v| [lo.min(v), hi.max(v)])
            }
            Self::Uniform(low, high, _) | Self::LogUniform(low, high, _) => [*low, *high],
            Self::Normal(mean, deviation, _) => [mean - 3.0 * deviation, mean + 3.0 * deviation],
            Self::Sometimes(Sometimes { otherwise, values, .. }) => {
                let [low, high] = values.ends();
                [low.min(*otherwise), high.max(*otherwise)]
            }
        }
    }

    /// Values that a factor must work with: all of a list that is not too long; of a range its ends and one between them,
    /// which is no whole number where the ends are.
    pub(super) fn trials(&self) -> Vec<f64> {
        const BETWEEN: f64 = 0.381_966;
        const MAXIMUM: usize = 100;
        match self {
            Self::List(values) if values.len() <= MAXIMUM => values.clone(),
            Self::List(_) => self.ends().to_vec(),
            Self::Uniform(..) | Self::LogUniform(..) | Self::Normal(..) => {
                let [low, high] = self.ends();
                vec![low, low + BETWEEN * (high - low), high]
            }
            Self::Sometimes(Sometimes { otherwise, values, .. }) => [vec![*otherwise], values.trials()].concat(),
        }
    }

    /// Number of levels in a full factorial plan.
    pub fn levels(&self) -> usize {
        match self {
            Self::List(values) => values.len(),
            Self::Uniform(.., levels) | Self::LogUniform(.., levels) | Self::Normal(.., levels) => *levels,
            Self::Sometimes(Sometimes { values, .. }) => 1 + values.levels(),
        }
    }
}

/// The values that a factor of the file takes.
pub(super) fn values(check: &Check<'_>, key: &str, place: usize, raw: &RawFactor) -> Result<Values, ConfigError> {
    let meaning =
        |message: &str, hint: Option<&str>| check.meaning(key, place, message.to_owned(), hint.map(str::to_owned));
    let levels = match &raw.levels {
        None => LEVELS,
        Some(levels) if (2..=1000).contains(levels.get_ref()) => *levels.get_ref() as usize,
        Some(_) => {
            return Err(meaning(
                "`levels` must be 2 to 1000",
                Some("the number of values that the range is divided into, such as 3"),
            ));
        }
    };
    let all = f64::MIN..=f64::MAX;
    let pair = |name: &str, numbers: &Numbers| -> Result<(f64, f64), ConfigError> {
        match *check.numbers(name, numbers, all.clone())? {
            [low, high] if low < high => Ok((low, high)),
            _ => Err(check.meaning(
                key,
                numbers.span().start,
                format!("`{name}` must be two numbers in increasing order"),
                Some("such as [0.8, 1.2]".to_owned()),
            )),
        }
    };
    let values = match (&raw.values, &raw.range, &raw.log_range, &raw.normal) {
        (Some(list), None, None, None) if !list.get_ref().is_empty() => {
            Values::List(check.numbers("values", list, all)?.to_vec())
        }
        (None, Some(range), None, None) => {
            pair("range", range).map(|(low, high)| Values::Uniform(low, high, levels))?
        }
        (None, None, Some(range), None) => match pair("log_range", range)? {
            (low, high) if low > 0.0 => Values::LogUniform(low, high, levels),
            _ => {
                return Err(meaning(
                    "`log_range` must be above 0",
                    Some("use `range` for values that may be zero or negative"),
                ));
            }
        },
        (None, None, None, Some(normal)) => {
            let mean = check.number("normal.mean", &normal.mean, all)?;
            match check.number("normal.deviation", &normal.deviation, 0.0..=f64::MAX)? {
                0.0 => {
                    return Err(meaning(
                        "`normal.deviation` must be above 0",
                        Some("it is the standard deviation; leave the factor out if the value does not vary"),
                    ));
                }
                deviation => Values::Normal(mean, deviation, levels),
            }
        }
        _ => {
            let message = "a factor must have exactly one of `values`, `range`, `log_range` and `normal`";
            return Err(meaning(message, Some("for example range = [0.8, 1.2]")));
        }
    };
    sometimes(check, key, raw, values)
}

/// The values with the chance of the factor, if it has one.
fn sometimes(check: &Check<'_>, key: &str, raw: &RawFactor, values: Values) -> Result<Values, ConfigError> {
    let wrong = |value: &Number, message: &str, hint: &str| {
        Err(check.meaning(key, value.span().start, message.to_owned(), Some(hint.to_owned())))
    };
    match (&raw.chance, &raw.otherwise) {
        (None, None) => Ok(values),
        (Some(chance), None) => {
            let hint = "add the value that changes nothing, such as otherwise = 1.0";
            wrong(chance, "a factor with a `chance` needs its value in the other runs, `otherwise`", hint)
        }
        (None, Some(otherwise)) => {
            let hint = "add the fraction of the runs with the factor, such as chance = 0.5";
            wrong(otherwise, "`otherwise` is for a factor with a `chance`", hint)
        }
        (Some(chance), Some(otherwise)) => {
            let fraction = check.number("chance", chance, 0.0..=1.0)?;
            if fraction <= 0.0 || fraction >= 1.0 {
                return wrong(chance, "`chance` must be between 0 and 1", "for example chance = 0.5");
            }
            let otherwise = check.number("otherwise", otherwise, f64::MIN..=f64::MAX)?;
            Ok(Values::Sometimes(Sometimes { chance: fraction, otherwise, values: Box::new(values) }))
        }
    }
}
