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
    is_found: bool,
}

impl Selection {
    pub(super) fn of(options: &Estimate) -> Self {
        let wanted = match options.shift {
            Some(number) => Wanted::Number(number as usize),
            None if options.shifts.is_empty() => Wanted::All,
            None => Wanted::Between(options.shifts.clone()),
        };
        Self { wanted, seen: 0, gears: Vec::new(), is_found: false }
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
        self.is_found |= wants;
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

    /// Refuses a selection that no shift is in; `hint` says what tells a shift.
    pub(super) fn check(&self, hint: &str) -> Result<(), Failure> {
        let what = match &self.wanted {
            Wanted::All => return Ok(()),
            _ if self.is_found => return Ok(()),
            Wanted::Number(number) => format!("--shift {number}"),
            Wanted::Between(pairs) => {
                let pairs: Vec<String> = pairs.iter().map(GearPair::to_string).collect();
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
