//! Commands of a log that their valve cannot have: another unit or scale, or another signal.

use car::Car;
use observer::gearbox::MAX_ELEMENTS;
use observer::{Reading, ShiftTables};

use super::check::{Check, CheckedRow};

/// From fewer readings nothing is said of most of them \[chosen\]: one second at 100 Hz.
const ENOUGH: u64 = 100;

/// A command that was refused in most of its readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RefusedCommand<'c> {
    /// The element whose valve has it.
    pub element: &'c str,
    /// Readings that were refused, and all of them.
    pub readings: [u64; 2],
}

/// Counts the readings of each command that its valve cannot have.
pub(crate) struct RefusedCommands<'c> {
    car: &'c Car,
    tables: &'c ShiftTables<f64>,
    /// Refused ones and all, by place in the filter's tables.
    readings: [[u64; 2]; MAX_ELEMENTS],
}

impl<'c> RefusedCommands<'c> {
    pub(super) fn new(car: &'c Car, tables: &'c ShiftTables<f64>) -> Self {
        Self { car, tables, readings: [[0; 2]; MAX_ELEMENTS] }
    }

    /// The first command that was refused in more than half of its readings.
    pub(crate) fn mostly(&self) -> Option<RefusedCommand<'c>> {
        let elements = self.car.gearbox.elements.iter().enumerate();
        let mut found = elements.filter_map(|(at, element)| {
            let readings = *self.readings.get(self.tables.place(at)?)?;
            let [refused, all] = readings;
            (all >= ENOUGH && 2 * refused > all).then_some(RefusedCommand { element: &element.name, readings })
        });
        found.next()
    }
}

impl Check for RefusedCommands<'_> {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let elements = self.tables.tables().elements.iter().zip(&row.step.input.commands);
        for ((element, command), counts) in elements.zip(&mut self.readings) {
            // One without a value is of a channel that fails.
            let Some(Reading { value, .. }) = command.filter(|reading| reading.value.is_finite()) else { continue };
            counts[0] += u64::from(!element.limits.is_possible(value));
            counts[1] += 1;
        }
    }

    fn warnings(&self) -> Vec<String> {
        Vec::new()
    }
}
