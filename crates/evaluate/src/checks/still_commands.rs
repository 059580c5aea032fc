//! Commands of a log that stand still in a shift that moves their clutch: channels that are frozen, or other signals.
//!
//! In a gear a command may rest for as long as it likes. A shift that the log completes applies one clutch and releases the other, so both
//! commands have to move between the last reading before it and its end.

use car::Car;
use observer::Reading;
use observer::ShiftTables;
use observer::gearbox::{MAX_ELEMENTS, ShiftElement};

/// Readings of a command in a shift that are needed to judge \[chosen\].
const ENOUGH: u32 = 3;

/// Counts the shifts in which a command stands still.
#[derive(Default)]
pub(crate) struct StillCommands {
    /// The newest command of each place in the filter's tables.
    newest: [Option<f64>; MAX_ELEMENTS],
    /// Of the shift that goes on, by place: readings, and whether one of them differs from the one before.
    readings: [u32; MAX_ELEMENTS],
    has_moved: [bool; MAX_ELEMENTS],
    /// Completed shifts that move the element, and those in which its command stood still, by place.
    shifts: [u64; MAX_ELEMENTS],
    still: [u64; MAX_ELEMENTS],
}

impl StillCommands {
    /// A shift begins with the next row.
    pub(crate) fn begin(&mut self) {
        (self.readings, self.has_moved) = ([0; MAX_ELEMENTS], [false; MAX_ELEMENTS]);
    }

    /// Takes the commands of a row.
    pub(crate) fn push(&mut self, commands: &[Option<Reading<f64>>; MAX_ELEMENTS]) {
        for (place, command) in commands.iter().enumerate() {
            let Some(Reading { value, .. }) = *command else { continue };
            self.readings[place] += 1;
            // The first reading of all tells of no move.
            self.has_moved[place] |= self.newest[place].is_some_and(|newest| newest != value);
            self.newest[place] = Some(value);
        }
    }

    /// The shift between these elements is completed.
    pub(crate) fn end(&mut self, elements: [ShiftElement; 2]) {
        for place in elements.into_iter().filter_map(ShiftElement::place) {
            if self.readings.get(place).is_some_and(|readings| *readings >= ENOUGH) {
                self.shifts[place] += 1;
                self.still[place] += u64::from(!self.has_moved[place]);
            }
        }
    }

    /// The elements whose command stood still in a shift that moves them, each in a sentence.
    pub(crate) fn warnings(&self, car: &Car, tables: &ShiftTables<f64>) -> Vec<String> {
        let elements = car.gearbox.elements.iter().enumerate();
        elements
            .filter_map(|(element, described)| {
                let place = tables.place(element).filter(|place| self.still[*place] > 0)?;
                Some(format!(
                    "warning: in {} of {} completed shifts that apply or release {}, its command does not change: the channel is frozen there, or \
                     is another signal, and the estimates of these shifts rest on it",
                    self.still[place], self.shifts[place], described.name
                ))
            })
            .collect()
    }
}
