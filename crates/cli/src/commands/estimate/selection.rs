//! Which shifts of a log are wanted.

use crate::args::{Estimate, GearPair};
use crate::failure::Failure;

/// Time before and after a shift whose rows belong to it, s.
pub(super) const BEFORE_S: f64 = 0.6;
pub(super) const AFTER_S: f64 = 0.9;
/// Shifts that a message names.
const NAMED: usize = 20;

enum Wanted {
    All,
    Number(usize),
    Between(Vec<GearPair>),
}

/// The wanted shifts, and what was seen of all.
pub(super) struct Selection {
    wanted: Wanted,
    /// Shifts of the whole log.
    pub(super) seen: usize,
    /// Gears of the first ones.
    gears: Vec<String>,
    /// Whether the wanted number was seen, or each of the wanted pairs.
    found: Vec<bool>,
}

impl Selection {
    pub(super) fn of(options: &Estimate) -> Self {
        let wanted = match options.shift {
            Some(number) => Wanted::Number(number as usize),
            None if options.shifts.is_empty() => Wanted::All,
            None => Wanted::Between(options.shifts.clone()),
        };
        Self::new(wanted)
    }

    fn new(wanted: Wanted) -> Self {
        let count = if let Wanted::Between(pairs) = &wanted { pairs.len() } else { 1 };
        Self { wanted, seen: 0, gears: Vec::new(), found: vec![false; count] }
    }

    /// Whether only some shifts are wanted, and only their estimates.
    pub(super) fn is_selective(&self) -> bool {
        !matches!(self.wanted, Wanted::All)
    }

    /// Takes the next shift of the log, called by its gears, such as 1-2; whether it is wanted.
    pub(super) fn begins(&mut self, gears: &str) -> bool {
        self.seen += 1;
        if self.gears.len() < NAMED {
            self.gears.push(gears.to_owned());
        }
        let wants = self.wants(self.seen, gears);
        match &self.wanted {
            Wanted::Between(pairs) => {
                let fits = pairs.iter().map(|pair| pair.to_string() == gears);
                self.found.iter_mut().zip(fits).for_each(|(found, fits)| *found |= fits);
            }
            _ => self.found.iter_mut().for_each(|found| *found |= wants),
        }
        wants
    }

    /// Whether the shift with this number and these gears is wanted.
    pub(super) fn wants(&self, number: usize, gears: &str) -> bool {
        match &self.wanted {
            Wanted::All => true,
            Wanted::Number(wanted) => *wanted == number,
            Wanted::Between(pairs) => pairs.iter().any(|pair| pair.to_string() == gears),
        }
    }

    /// Refuses a selection of which a part fits no shift; `hint` says what tells a shift.
    pub(super) fn check(&self, hint: &str) -> Result<(), Failure> {
        let what = match &self.wanted {
            Wanted::All => return Ok(()),
            _ if self.found.iter().all(|found| *found) => return Ok(()),
            Wanted::Number(number) => format!("--shift {number}"),
            Wanted::Between(pairs) => {
                let missing = pairs.iter().zip(&self.found).filter(|(_, found)| !**found);
                let pairs: Vec<String> = missing.map(|(pair, _)| pair.to_string()).collect();
                format!("--shifts {}", pairs.join(","))
            }
        };
        let more = if self.seen > self.gears.len() { ", ..." } else { "" };
        Err(Failure::Input(match self.seen {
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
    use super::{Selection, Wanted};
    use crate::failure::Failure;

    fn chosen(pairs: &[&str], shifts: &[&str]) -> Result<(), String> {
        let pairs = pairs.iter().map(|pair| pair.parse().unwrap()).collect();
        let mut selection = Selection::new(Wanted::Between(pairs));
        shifts.iter().for_each(|gears| _ = selection.begins(gears));
        selection.check("").map_err(|failure| match failure {
            Failure::Input(message) => message,
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
