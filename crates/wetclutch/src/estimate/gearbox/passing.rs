//! Which rows of an estimate are written: all, or those of the shifts that are wanted.

use std::collections::VecDeque;

use car::{Car, ShiftCommand};
use evaluate::LogStep;
use evaluate::logged::Filtered;

use crate::Error;
use crate::estimate::selection::{AFTER_S, BEFORE_S, Selection};

/// The rows of a drive as they pass by.
pub(crate) struct Passing {
    selection: Selection,
    /// Rows that a shift which is wanted would begin with.
    recent: VecDeque<(LogStep, Filtered)>,
    gears: Option<ShiftCommand>,
    is_wanted: bool,
    /// Rows are written until this time, s.
    until_s: f64,
}

impl Passing {
    pub(crate) fn new(selection: Selection) -> Self {
        Self { selection, recent: VecDeque::new(), gears: None, is_wanted: false, until_s: f64::NEG_INFINITY }
    }

    /// Takes a row; `write` gets those that are to be written.
    pub(crate) fn push(
        &mut self,
        car: &Car,
        row: &(LogStep, Filtered),
        mut write: impl FnMut(&LogStep, &Filtered) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let (step, filtered) = row;
        let time_s = step.time_s;
        let gears = Some(step.input.gear).filter(|gears| !gears.is_steady());
        if gears != self.gears {
            if self.gears.is_some() && self.is_wanted {
                self.until_s = time_s + AFTER_S;
            }
            self.gears = gears;
            self.is_wanted = match gears {
                Some(pair) => self.selection.begins(&car.shift_name(pair)),
                None => false,
            };
        }
        if !self.selection.is_selective() {
            return write(step, filtered);
        }
        if self.is_wanted || time_s <= self.until_s {
            for (step, filtered) in self.recent.drain(..) {
                write(&step, &filtered)?;
            }
            return write(step, filtered);
        }
        self.recent.push_back(*row);
        while self.recent.front().is_some_and(|(first, _)| first.time_s < time_s - BEFORE_S) {
            self.recent.pop_front();
        }
        Ok(())
    }

    /// Whether a shift is wanted.
    pub(crate) fn wants(&self, number: usize, car: &Car, gears: ShiftCommand) -> bool {
        self.selection.wants(number, &car.shift_name(gears))
    }

    /// Refuses a selection that no shift is in.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.selection.check("`gear` and `target_gear` show a shift")
    }
}
