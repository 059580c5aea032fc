//! The ranges of one time, and an estimate in them.

use drivetrain::Real;

use crate::{Estimate, Health};

/// Ranges of pressure and torque at the time of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds<T> {
    /// Lowest and highest pressure, Pa.
    pub pressure_pa: [T; 2],
    /// Lowest and highest clutch torque while the clutch slips, N m; a locked one carries any torque up to the larger.
    pub clutch_torque_n_m: [T; 2],
    /// Lowest and highest expected drive-shaft torque, N m, where the wheel speed is measured.
    pub shaft_torque_n_m: Option<[T; 2]>,
}

impl<T: Real> Bounds<T> {
    /// Whether an estimate is in all of them.
    pub fn hold(&self, estimate: &Estimate<T>) -> bool {
        let within = |[low, high]: [T; 2], value: T| low <= value && value <= high;
        let shaft = self.shaft_torque_n_m.zip(estimate.shaft_torque_n_m);
        within(self.pressure_pa, estimate.pressure_pa)
            && within(self.clutch_torque_n_m, estimate.clutch_torque_n_m)
            && shaft.is_none_or(|(range, torque)| within(range, torque))
    }

    /// The estimate as it is, with these ranges. Its health is [`Health::OutsideRange`] if it is outside one of them, unless
    /// it was worse before.
    #[inline]
    pub fn around(&self, estimate: Estimate<T>) -> Estimate<T> {
        let found = if self.hold(&estimate) { Health::Good } else { Health::OutsideRange };
        Estimate { bounds: Some(*self), health: estimate.health.max(found), ..estimate }
    }

    /// The estimate with its pressure and clutch torque brought into the guaranteed ranges, and with these ranges. Its
    /// health is [`Health::LimitedToRange`] if that changed it, and [`Health::OutsideRange`] if its shaft torque, which is left
    /// as it is, is outside the expected range; unless it was worse before.
    #[inline]
    pub fn clip(&self, estimate: Estimate<T>) -> Estimate<T> {
        let nearest = |[low, high]: [T; 2], value: T| value.at_least(low).at_most(high);
        let limited = Estimate {
            pressure_pa: nearest(self.pressure_pa, estimate.pressure_pa),
            clutch_torque_n_m: nearest(self.clutch_torque_n_m, estimate.clutch_torque_n_m),
            bounds: Some(*self),
            ..estimate
        };
        let changed =
            limited.pressure_pa != estimate.pressure_pa || limited.clutch_torque_n_m != estimate.clutch_torque_n_m;
        let found = match (changed, self.hold(&limited)) {
            (true, _) => Health::LimitedToRange,
            (false, false) => Health::OutsideRange,
            (false, true) => Health::Good,
        };
        Estimate { health: limited.health.max(found), ..limited }
    }
}
