//! Finds the phase of the shift from commands and measured speeds.

use drivetrain::Real;

/// Phase of a clutch-to-clutch shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phase {
    /// The oncoming clutch is open or filling.
    BeforeShift,
    /// Load moves from the offgoing to the oncoming clutch; the ratio has not changed.
    TorquePhase,
    /// Both clutches slip; the turbine changes to its new speed.
    InertiaPhase,
    /// The oncoming clutch is locked.
    AfterShift,
}

impl Phase {
    /// All phases in their order.
    pub const ALL: [Self; 4] = [Self::BeforeShift, Self::TorquePhase, Self::InertiaPhase, Self::AfterShift];

    /// A word for logs and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::BeforeShift => "before_shift",
            Self::TorquePhase => "torque_phase",
            Self::InertiaPhase => "inertia_phase",
            Self::AfterShift => "after_shift",
        }
    }
}

/// Thresholds of the phase supervisor.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Supervisor<T> {
    /// Pressure at which the oncoming clutch starts to carry torque, Pa.
    pub kiss_pressure_pa: T,
    /// Slip of the offgoing clutch above which it counts as released, rad/s.
    pub release_slip_rad_s: T,
    /// Slip of the oncoming clutch below which it may have locked, rad/s.
    pub lock_slip_rad_s: T,
    /// Time that the slip must stay below it, s.
    pub lock_hold_s: T,
}

/// The fraction by which a sum of steps may differ from the time that it is compared with: times of a log have few digits.
const ROUNDING: f64 = 1e-3;

/// Memory of the phase supervisor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupervisorState<T> {
    /// The phase now.
    pub phase: Phase,
    /// How long the oncoming slip has been small, s.
    small_slip_s: T,
}

impl<T: Real> SupervisorState<T> {
    /// Before a shift.
    pub fn new() -> Self {
        Self { phase: Phase::BeforeShift, small_slip_s: T::zero() }
    }
}

impl<T: Real> Default for SupervisorState<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Supervisor<T> {
    /// Updates the phase after `dt_s`. `valve_pressure_pa` is the pressure of the valve model alone. The
    /// phase must not depend on the estimate, because the estimate depends on the phase.
    #[inline]
    pub fn step(
        &self,
        state: &mut SupervisorState<T>,
        dt_s: T,
        valve_pressure_pa: T,
        offgoing_slip_rad_s: T,
        oncoming_slip_rad_s: T,
    ) -> Phase {
        let filled = valve_pressure_pa > self.kiss_pressure_pa;
        let released = valve_pressure_pa < T::of(0.5) * self.kiss_pressure_pa;
        let let_go = offgoing_slip_rad_s.abs() > self.release_slip_rad_s;
        let small = oncoming_slip_rad_s.abs() < self.lock_slip_rad_s;
        state.small_slip_s = if small { state.small_slip_s + dt_s } else { T::zero() };
        state.phase = match state.phase {
            Phase::BeforeShift if filled => Phase::TorquePhase,
            Phase::TorquePhase | Phase::InertiaPhase | Phase::AfterShift if released => Phase::BeforeShift,
            Phase::TorquePhase if let_go => Phase::InertiaPhase,
            // A single noisy reading is no release, and a clutch can grip again.
            Phase::InertiaPhase if !let_go && !small => Phase::TorquePhase,
            Phase::InertiaPhase if small && self.is_held(state.small_slip_s) => Phase::AfterShift,
            same => same,
        };
        state.phase
    }

    /// Whether something has lasted for [`Self::lock_hold_s`]: for as many steps at any time of a log, and in any precision.
    #[inline]
    fn is_held(&self, lasted_s: T) -> bool {
        lasted_s >= self.lock_hold_s * T::of(1.0 - ROUNDING)
    }

    /// Whether something has lasted for longer than [`Self::lock_hold_s`] and so much more, likewise.
    #[inline]
    pub(crate) fn is_held_longer(&self, lasted_s: T, more_s: T) -> bool {
        lasted_s > (self.lock_hold_s + more_s) * T::of(1.0 + ROUNDING)
    }

    /// The phase whose equations hold at this sample. Where the slip is too small to tell its sign, the
    /// clutch may have locked already: the equations of the inertia phase would take the missing friction
    /// for a missing pressure, long before the lock-up is confirmed.
    #[inline]
    pub fn acting_phase(&self, phase: Phase, oncoming_slip_rad_s: T) -> Phase {
        let small = oncoming_slip_rad_s.abs() < self.lock_slip_rad_s;
        if phase == Phase::InertiaPhase && small { Phase::AfterShift } else { phase }
    }

    /// The same thresholds in another precision.
    pub fn cast<U: Real>(&self) -> Supervisor<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Supervisor {
            kiss_pressure_pa: to(self.kiss_pressure_pa),
            release_slip_rad_s: to(self.release_slip_rad_s),
            lock_slip_rad_s: to(self.lock_slip_rad_s),
            lock_hold_s: to(self.lock_hold_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SUPERVISOR: Supervisor<f64> =
        Supervisor { kiss_pressure_pa: 60e3, release_slip_rad_s: 5.0, lock_slip_rad_s: 3.0, lock_hold_s: 0.02 };

    fn walk(samples: &[(f64, f64, f64)]) -> [Phase; 8] {
        let mut state = SupervisorState::new();
        let mut phases = [Phase::BeforeShift; 8];
        for (phase, &(pressure, offgoing, oncoming)) in phases.iter_mut().zip(samples) {
            *phase = SUPERVISOR.step(&mut state, 0.01, pressure, offgoing, oncoming);
        }
        phases
    }

    #[test]
    fn a_shift_passes_its_phases_in_order() {
        use Phase::{AfterShift, BeforeShift, InertiaPhase, TorquePhase};
        let phases = walk(&[
            (0.0, 0.0, 300.0),
            (70e3, 0.0, 300.0),
            (200e3, -6.0, 290.0),
            (300e3, -200.0, 2.0),
            (300e3, -240.0, 0.0),
            (900e3, -240.0, 0.0),
            (900e3, -240.0, 0.0),
            (10e3, -240.0, 0.0),
        ]);
        assert_eq!(
            phases,
            [BeforeShift, TorquePhase, InertiaPhase, InertiaPhase, AfterShift, AfterShift, AfterShift, BeforeShift]
        );
    }

    #[test]
    fn a_standing_car_is_not_taken_for_a_locked_clutch() {
        let phases = walk(&[(0.0, 0.0, 0.0); 8]);
        assert_eq!(phases, [Phase::BeforeShift; 8]);
    }

    #[test]
    fn a_release_that_was_none_is_taken_back() {
        let phases = walk(&[(70e3, 0.0, 300.0), (70e3, -6.0, 300.0), (70e3, 0.5, 300.0)]);
        assert_eq!(phases[..3], [Phase::TorquePhase, Phase::InertiaPhase, Phase::TorquePhase]);
    }

    #[test]
    fn a_single_small_slip_does_not_count_as_lock_up() {
        let phases = walk(&[(70e3, 0.0, 300.0), (200e3, -6.0, 290.0), (300e3, -99.0, 1.0), (300e3, -99.0, 30.0)]);
        assert_eq!(phases[3], Phase::InertiaPhase);
    }

    #[test]
    fn two_steps_are_two_steps_at_any_time_of_a_log_and_in_any_precision() {
        let single = SUPERVISOR.cast::<f32>();
        for row in 0..100_000 {
            let time_s = |row: i32| f64::from(row) / 100.0;
            let steps = [1, 2].map(|i| time_s(row + i) - time_s(row + i - 1));
            let (lasted_s, in_single) = (steps[0] + steps[1], steps[0] as f32 + steps[1] as f32);
            assert!(SUPERVISOR.is_held(lasted_s) && single.is_held(in_single), "{row}");
            assert!(!SUPERVISOR.is_held_longer(lasted_s, 0.0) && !single.is_held_longer(in_single, 0.0), "{row}");
        }
    }
}
