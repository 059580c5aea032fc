//! Whether the command that comes for the offgoing clutch of a shift can be that of this clutch.
//!
//! A channel that has died or frozen gives a command for ever. It contradicts the speeds in one of two ways, and is then not used until its
//! value changes:
//!
//! - In the gear before the shift it asks for no pressure, while the clutch holds against the torque of the turbine.
//! - In the shift both clutches slip, and it still asks for the pressure with which the clutch held, or for one that has not changed for
//!   some time and with which it would hold the torque of the gear.

use drivetrain::Real;

use super::{FrictionElement, Reading};

/// Time for which a clutch has to hold against such a command, s \[chosen\]: longer than a valve needs.
const HOLDS_S: f64 = 0.1;
/// Time for which it has to slip, s: longer than wrong readings show it.
const SLIPS_S: f64 = 0.025;
/// Time for which a command of a clutch that is let go does not stand, s \[chosen\].
const STANDS_S: f64 = 0.1;
/// Part of the torque of the gear with which a clutch could slip by an error of its friction.
const HOLDS_PART: f64 = 0.8;
/// Torque of the turbine that a clutch without pressure does not bear, N m \[chosen\]: beyond drag and what errs of the converter near
/// equal speeds.
const BORNE_N_M: f64 = 20.0;

/// What the speeds show of the offgoing clutch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    /// It holds, in the gear before the shift.
    Holds,
    /// It slips in the shift, as the oncoming one does.
    Slips,
    /// Neither.
    Nothing,
}

/// Memory of the command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OffgoingCommand<T> {
    value: Option<T>,
    /// Whether it has changed since the shift began.
    has_changed: bool,
    /// Since when it has not changed, s.
    same_s: T,
    contradicts_s: T,
    is_wrong: bool,
}

impl<T: Real> OffgoingCommand<T> {
    pub(super) fn nothing() -> Self {
        Self { value: None, has_changed: true, same_s: T::zero(), contradicts_s: T::zero(), is_wrong: false }
    }

    /// The shift begins.
    pub(super) fn begin(&mut self) {
        self.has_changed = false;
    }

    /// The command as it is used.
    pub(super) fn take(&mut self, reading: Option<Reading<T>>) -> Option<Reading<T>> {
        if let Some(reading) = reading
            && self.value.replace(reading.value) != Some(reading.value)
        {
            let nothing = Self::nothing();
            *self = Self { value: self.value, ..nothing };
        }
        reading.filter(|_| !self.is_wrong)
    }

    /// Compares it with what is seen of the clutch, with the turbine torque and with the torque of the clutch in the gear, N m. Whether it has
    /// turned out to be wrong in this step.
    pub(super) fn judge(
        &mut self,
        element: &FrictionElement<T>,
        seen: Seen,
        [turbine_n_m, of_gear_n_m]: [T; 2],
        dt_s: T,
    ) -> bool {
        self.same_s = self.same_s + dt_s;
        let asked_pa = self.value.map(|value| element.valve.valve.settled_pressure(value));
        let contradicts = asked_pa.is_some_and(|asked_pa| {
            let asks = asked_pa > element.clutch.kiss_pressure();
            match seen {
                Seen::Holds => !asks && turbine_n_m > T::of(BORNE_N_M),
                Seen::Slips if !self.has_changed => asks,
                Seen::Slips => {
                    let holds_n_m = element.clutch.static_capacity(asked_pa);
                    self.same_s > T::of(STANDS_S) && holds_n_m > T::of(HOLDS_PART) * of_gear_n_m.abs()
                }
                Seen::Nothing => false,
            }
        });
        self.contradicts_s = if contradicts { self.contradicts_s + dt_s } else { T::zero() };
        let was_wrong = self.is_wrong;
        let longest_s = if seen == Seen::Slips { SLIPS_S } else { HOLDS_S };
        self.is_wrong |= self.contradicts_s > T::of(longest_s);
        self.is_wrong && !was_wrong
    }
}
