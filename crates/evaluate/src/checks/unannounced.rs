//! Changes of the gear that no target gear announces.

use car::{Car, Gear};
use observer::Health;

use super::check::{Check, CheckedRow};

/// How often the gear changed without a shift.
pub(crate) struct UnannouncedShifts {
    has_converter: bool,
    /// The gear of the row before; `None` in a shift, in which it may be the new one already.
    gear: Option<Gear>,
    count: u64,
}

impl UnannouncedShifts {
    pub(super) fn new(car: &Car) -> Self {
        Self { has_converter: car.converter.is_some(), gear: None, count: 0 }
    }
}

impl Check for UnannouncedShifts {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let gear = Some(row.step.input.gear).filter(|gear| gear.is_steady()).map(|gear| gear.from);
        if let (Some(before), Some(gear)) = (self.gear, gear) {
            let changes = before != gear && !before.is_neutral() && !gear.is_neutral();
            // Without a converter dogs change while the clutch is open: this is no shift.
            let is_open = matches!(row.estimate.health, Health::ClutchOpen | Health::TooSlow);
            let are_dogs = !self.has_converter && is_open;
            // What happens in a hole is not seen.
            self.count += u64::from(changes && !row.is_hole && !are_dogs);
        }
        self.gear = gear;
    }

    fn warnings(&self) -> Vec<String> {
        let warning = (self.count > 0).then(|| {
            format!(
                "warning: gear changes {} times without a change of target_gear before: these shifts are not estimated\nhint: target_gear must \
                 change when a shift is requested, gear when it is complete; check both channels",
                self.count
            )
        });
        warning.into_iter().collect()
    }
}
