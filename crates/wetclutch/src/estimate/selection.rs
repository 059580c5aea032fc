//! Which shifts of a log are wanted.

use std::fmt;
use std::str::FromStr;

use crate::Error;

/// Time before and after a shift whose rows belong to it, s.
pub(crate) const BEFORE_S: f64 = 0.6;
pub(crate) const AFTER_S: f64 = 0.9;
/// Shifts that a message names.
const NAMED: usize = 20;

/// The shifts that are wanted.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum ShiftChoice {
    /// All, and every row of the log.
    #[default]
    All,
    /// The one with this number, from 1.
    Number(usize),
    /// Those between these gears.
    Between(Vec<GearPair>),
}

/// The gears of a shift by their names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GearPair {
    /// The gear before.
    from: String,
    /// The gear after.
    to: String,
}

impl FromStr for GearPair {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        // A number is the gear with this number, also with zeros in front of it.
        let name = |text: &str| text.parse().map_or_else(|_| text.to_owned(), |number: u32| number.to_string());
        match text.trim().split_once('-').map(|(from, to)| [name(from), name(to)]) {
            Some([from, to]) if from != to && [&from, &to].iter().all(|name| !["", "0"].contains(&name.as_str())) => {
                Ok(Self { from, to })
            }
            _ => Err("expected two gears by their names, such as 1-2".to_owned()),
        }
    }
}

impl fmt::Display for GearPair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.from, self.to)
    }
}

/// The wanted shifts, and what was seen of all.
pub(crate) struct Selection {
    wanted: ShiftChoice,
    /// Shifts of the whole log.
    pub(crate) seen: usize,
    /// Gears of the first ones.
    gears: Vec<String>,
    /// Whether the wanted number was seen, or each of the wanted pairs.
    found: Vec<bool>,
}

impl Selection {
    pub(crate) fn of(wanted: &ShiftChoice) -> Self {
        let count = if let ShiftChoice::Between(pairs) = wanted { pairs.len() } else { 1 };
        Self { wanted: wanted.clone(), seen: 0, gears: Vec::new(), found: vec![false; count] }
    }

    /// Whether only some shifts are wanted, and only their estimates.
    pub(crate) fn is_selective(&self) -> bool {
        !matches!(self.wanted, ShiftChoice::All)
    }

    /// Takes the next shift of the log, called by its gears, such as 1-2; whether it is wanted.
    pub(crate) fn begins(&mut self, gears: &str) -> bool {
        self.seen += 1;
        if self.gears.len() < NAMED {
            self.gears.push(gears.to_owned());
        }
        let wants = self.wants(self.seen, gears);
        match &self.wanted {
            ShiftChoice::Between(pairs) => {
                let fits = pairs.iter().map(|pair| pair.to_string() == gears);
                self.found.iter_mut().zip(fits).for_each(|(found, fits)| *found |= fits);
            }
            _ => self.found.iter_mut().for_each(|found| *found |= wants),
        }
        wants
    }

    /// Whether the shift with this number and these gears is wanted.
    pub(crate) fn wants(&self, number: usize, gears: &str) -> bool {
        match &self.wanted {
            ShiftChoice::All => true,
            ShiftChoice::Number(wanted) => *wanted == number,
            ShiftChoice::Between(pairs) => pairs.iter().any(|pair| pair.to_string() == gears),
        }
    }

    /// Refuses a selection of which a part fits no shift; `hint` says what tells a shift.
    pub(crate) fn check(&self, hint: &str) -> Result<(), Error> {
        let what = match &self.wanted {
            ShiftChoice::All => return Ok(()),
            _ if self.found.iter().all(|found| *found) => return Ok(()),
            ShiftChoice::Number(number) => format!("--shift {number}"),
            ShiftChoice::Between(pairs) => {
                let missing = pairs.iter().zip(&self.found).filter(|(_, found)| !**found);
                let pairs: Vec<String> = missing.map(|(pair, _)| pair.to_string()).collect();
                format!("--shifts {}", pairs.join(","))
            }
        };
        let more = if self.seen > self.gears.len() { ", ..." } else { "" };
        Err(Error::Input(match self.seen {
            0 => format!("{what}: no shift was found in the log\nhint: {hint}"),
            seen => format!(
                "{what}: the log has no such shift\nhint: it has {seen}, in this order: {}{more}",
                self.gears.join(", ")
            ),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::{Selection, ShiftChoice};
    use crate::Error;

    fn chosen(pairs: &[&str], shifts: &[&str]) -> Result<(), String> {
        let pairs = pairs.iter().map(|pair| pair.parse().unwrap()).collect();
        let mut selection = Selection::of(&ShiftChoice::Between(pairs));
        shifts.iter().for_each(|gears| _ = selection.begins(gears));
        selection.check("").map_err(|failure| match failure {
            Error::Input(message) => message,
            _ => String::new(),
        })
    }

    #[test]
    fn each_pair_of_gears_has_to_fit_a_shift() {
        assert_eq!(chosen(&["2-3", "1-2"], &["1-2", "2-3", "1-2"]), Ok(()));
        let missing = chosen(&["2-3", "3-1", "4-3"], &["1-2", "2-3"]).unwrap_err();
        assert!(
            missing.starts_with("--shifts 3-1,4-3: the log has no such shift\nhint: it has 2, in this order: 1-2, 2-3"),
            "{missing}"
        );
    }

    #[test]
    fn gears_are_called_as_in_the_table_of_shifts() {
        assert_eq!(chosen(&["1st-2nd", "02-3"], &["1st-2nd", "2-3"]), Ok(()));
    }
}
