//! Commands of a log that stand still in a shift that moves their clutch: channels that are frozen, or other signals.
//!
//! In a gear a command may rest for as long as it likes. A shift that the log completes applies one clutch and releases the other, so both
//! commands have to move between the last reading before it and its end.

use car::Car;
use observer::gearbox::{MAX_ELEMENTS, ShiftElement};
use observer::{Reading, ShiftTables};

use super::check::{Check, CheckedRow, EndedShift};

/// Readings of a command in a shift that are needed to judge \[chosen\].
const ENOUGH: u32 = 3;

/// Counts the shifts in which a command stands still.
pub(crate) struct StillCommands<'c> {
    car: &'c Car,
    tables: &'c ShiftTables<f64>,
    /// The newest command of each place in the filter's tables.
    newest: [Option<f64>; MAX_ELEMENTS],
    /// Of the shift that goes on, by place: readings, and whether one of them differs from the one before.
    readings: [u32; MAX_ELEMENTS],
    has_moved: [bool; MAX_ELEMENTS],
    /// Completed shifts that move the element, and those in which its command stood still, by place.
    shifts: [u64; MAX_ELEMENTS],
    still: [u64; MAX_ELEMENTS],
}

impl<'c> StillCommands<'c> {
    pub(super) fn new(car: &'c Car, tables: &'c ShiftTables<f64>) -> Self {
        Self {
            car,
            tables,
            newest: [None; MAX_ELEMENTS],
            readings: [0; MAX_ELEMENTS],
            has_moved: [false; MAX_ELEMENTS],
            shifts: [0; MAX_ELEMENTS],
            still: [0; MAX_ELEMENTS],
        }
    }
}

impl Check for StillCommands<'_> {
    fn begin(&mut self) {
        (self.readings, self.has_moved) = ([0; MAX_ELEMENTS], [false; MAX_ELEMENTS]);
    }

    fn row(&mut self, row: &CheckedRow<'_>) {
        for (place, command) in row.step.input.commands.iter().enumerate() {
            let Some(Reading { value, .. }) = *command else { continue };
            self.readings[place] += 1;
            // The first reading of all tells of no move.
            self.has_moved[place] |= self.newest[place].is_some_and(|newest| newest != value);
            self.newest[place] = Some(value);
        }
    }

    fn end(&mut self, ended: &EndedShift<'_>) {
        let elements = ended.completed.map(|(elements, _)| elements);
        for place in elements.into_iter().flatten().filter_map(ShiftElement::place) {
            if self.readings.get(place).is_some_and(|readings| *readings >= ENOUGH) {
                self.shifts[place] += 1;
                self.still[place] += u64::from(!self.has_moved[place]);
            }
        }
    }

    fn warnings(&self) -> Vec<String> {
        let elements = self.car.gearbox.elements.iter().enumerate();
        elements
            .filter_map(|(element, described)| {
                let place = self.tables.place(element).filter(|place| self.still[*place] > 0)?;
                Some(format!(
                    "warning: in {} of {} completed shifts that apply or release {}, its command does not change: the channel is frozen there, or \
                     is another signal, and the estimates of these shifts rest on it",
                    self.still[place], self.shifts[place], described.name
                ))
            })
            .collect()
    }
}
