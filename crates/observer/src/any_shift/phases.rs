//! Which of the two shift clutches hold: measured slip decides, not the plan.
//!
//! | from | to | when |
//! |---|---|---|
//! | offgoing holds | both slip | its slip is above the threshold in either direction, or it would have to hold more than it does by the estimate |
//! | both slip | offgoing holds | its slip is small in two samples and it holds its load: a flare that was caught |
//! | both slip | oncoming holds | its slip is below the threshold, and it holds its load |
//! | oncoming holds | both slip | its slip is above the threshold by half, or it would have to hold more than it does |
//!
//! What a clutch holds by the estimate is compared as it is, without a margin: so the more likely of both phases is taken. The readings
//! are 5 to 10 ms old and show a slip some samples after it has begun.
//!
//! The turbine torque is not used but for what a clutch has to hold: the roles of the clutches follow from the equations,
//! also where the turbine torque changes its sign.

use drivetrain::Real;

/// Deviations of the slip in its threshold, and slip beside them, rad/s.
const THRESHOLD: (f64, f64) = (3.5, 0.3);
/// Deviations of the slip above which it may be one: then no reading of turbine and output is taken while a clutch holds.
const MAYBE: f64 = 2.0;
/// Share of the threshold below which a clutch has caught, and samples in a row.
const CAUGHT: (f64, u8) = (0.7, 2);
/// Share of a new slip in the mean of those of a clutch that holds \[chosen\]: some five samples.
const MEAN: f64 = 0.3;
/// Multiple of the threshold above which the oncoming clutch slips again.
const SLIPS_AGAIN: f64 = 1.5;

/// Which of the shift clutches hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ShiftPhase {
    /// No shift: all elements of the gear hold.
    InGear,
    /// A shift, and the offgoing clutch holds: the torque phase of a power-on upshift, or what is before a shift begins.
    OffgoingHolds,
    /// Neither holds: the inertia phase.
    BothSlip,
    /// The oncoming clutch holds: the end of a shift, or its torque phase at the end.
    OncomingHolds,
}

impl ShiftPhase {
    /// A word for logs and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::InGear => "in_gear",
            Self::OffgoingHolds => "offgoing_holds",
            Self::BothSlip => "both_slip",
            Self::OncomingHolds => "oncoming_holds",
        }
    }

    /// Which of offgoing and oncoming holds.
    pub(super) fn holding(self) -> Option<usize> {
        match self {
            Self::OffgoingHolds => Some(0),
            Self::OncomingHolds => Some(1),
            Self::InGear | Self::BothSlip => None,
        }
    }
}

/// A slip at the turbine, `w_t - i w_o`, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slip<T> {
    pub(super) value: T,
    /// Standard deviation of the reading.
    pub(super) deviation: T,
}

impl<T: Real> Slip<T> {
    pub(super) fn threshold(&self) -> T {
        T::of(THRESHOLD.0) * self.deviation + T::of(THRESHOLD.1)
    }

    pub(super) fn is_over(&self) -> bool {
        self.value.abs() > self.threshold()
    }

    /// Whether it may be a slip that is not yet seen.
    pub(super) fn may_be(&self) -> bool {
        self.value.abs() > T::of(MAYBE) * self.deviation
    }

    /// Its sign; less than one where the slip is below half its threshold.
    pub(super) fn direction(&self) -> T {
        let half = T::of(0.5) * self.threshold();
        (self.value / half).max(-T::one()).min(T::one())
    }
}

/// What decides about a clutch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contact<T> {
    pub(super) slip: Slip<T>,
    /// What it would have to hold at the turbine, N m.
    pub(super) needed_n_m: T,
    /// What it holds at most by the estimate, N m.
    pub(super) holds_n_m: T,
}

impl<T: Real> Contact<T> {
    /// Whether it slips by its load, more likely than not: both torques are means, and their errors have no preferred sign.
    fn is_overloaded(&self) -> bool {
        self.needed_n_m.abs() > self.holds_n_m
    }
}

/// What remains between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PhaseMemory<T> {
    pub(super) phase: ShiftPhase,
    /// Samples in a row in which the offgoing clutch has seemed to hold again.
    caught: u8,
    /// Direction of a clutch that was released by its load, until its slip is seen.
    pub(super) released: [Option<T>; 2],
    /// Slip of the clutch that holds, averaged.
    mean_rad_s: T,
    /// Of a clutch that has gripped in this sample: the probability that it slips yet, with the sign of its torque then.
    pub(super) slips_yet: T,
}

impl<T: Real> PhaseMemory<T> {
    pub(super) fn new(phase: ShiftPhase) -> Self {
        Self { phase, caught: 0, released: [None; 2], mean_rad_s: T::zero(), slips_yet: T::zero() }
    }

    /// Direction of the torque of a slipping clutch, or of one that may slip yet.
    pub(super) fn direction(&self, clutch: usize, slip: &Slip<T>) -> T {
        if self.phase.holding() == Some(clutch) && self.slips_yet != T::zero() {
            return self.slips_yet.signum();
        }
        match self.released.get(clutch).copied().flatten() {
            Some(direction) if !slip.is_over() => direction,
            _ => slip.direction(),
        }
    }

    /// The phase after this sample.
    pub(super) fn step(&mut self, contacts: &[Contact<T>; 2]) {
        let [off, on] = contacts;
        self.slips_yet = T::zero();
        for (released, contact) in self.released.iter_mut().zip(contacts) {
            if contact.slip.is_over() {
                *released = None;
            }
        }
        let lasts = self.phase.holding().is_some_and(|held| self.slip_lasts(&contacts[held.min(1)].slip));
        let next = match self.phase {
            ShiftPhase::OffgoingHolds if off.slip.is_over() || off.is_overloaded() || lasts => ShiftPhase::BothSlip,
            ShiftPhase::BothSlip => self.both_slip(off, on),
            ShiftPhase::OncomingHolds
                if on.slip.value.abs() > T::of(SLIPS_AGAIN) * on.slip.threshold() || on.is_overloaded() || lasts =>
            {
                ShiftPhase::BothSlip
            }
            stays => stays,
        };
        if let (Some(held), ShiftPhase::BothSlip) = (self.phase.holding(), next) {
            let contact = &contacts[held.min(1)];
            let direction = contact.needed_n_m.signum();
            self.released = [None; 2];
            self.released[held.min(1)] = (!contact.slip.is_over()).then_some(direction);
        }
        if next != ShiftPhase::BothSlip {
            self.released = [None; 2];
            self.caught = 0;
        }
        if next != self.phase {
            self.mean_rad_s = T::zero();
        }
        self.phase = next;
    }

    /// Whether the slip of the clutch that holds is small and lasts: the mean of it is over a threshold of its own.
    fn slip_lasts(&mut self, slip: &Slip<T>) -> bool {
        let share = T::of(MEAN);
        if slip.value.is_finite() {
            self.mean_rad_s = self.mean_rad_s + share * (slip.value - self.mean_rad_s);
        }
        let deviation = slip.deviation * (share / (T::of(2.0) - share)).sqrt();
        Slip { value: self.mean_rad_s, deviation }.is_over()
    }

    fn both_slip(&mut self, off: &Contact<T>, on: &Contact<T>) -> ShiftPhase {
        let small = off.slip.value.abs() < T::of(CAUGHT.0) * off.slip.threshold();
        let caught = small && !off.is_overloaded();
        self.caught = if caught { self.caught.saturating_add(1) } else { 0 };
        if self.caught >= CAUGHT.1 {
            ShiftPhase::OffgoingHolds
        } else if !on.slip.is_over() && !on.is_overloaded() {
            ShiftPhase::OncomingHolds
        } else {
            ShiftPhase::BothSlip
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact(slip: f64, needed_n_m: f64) -> Contact<f64> {
        Contact { slip: Slip { value: slip, deviation: 0.1 }, needed_n_m, holds_n_m: 60.0 }
    }

    /// The phase after these samples of slip and torque needed, of offgoing and oncoming clutch.
    fn after(phase: ShiftPhase, samples: &[[(f64, f64); 2]]) -> (ShiftPhase, [Option<f64>; 2]) {
        let mut memory = PhaseMemory::new(phase);
        for sample in samples {
            memory.step(&sample.map(|(slip, needed)| contact(slip, needed)));
        }
        (memory.phase, memory.released)
    }

    #[test]
    fn slip_in_either_direction_or_too_much_torque_releases_a_clutch() {
        use ShiftPhase::{BothSlip, OffgoingHolds, OncomingHolds};
        // The threshold is 3.5 * 0.1 + 0.3 = 0.65 rad/s.
        assert_eq!(after(OffgoingHolds, &[[(0.6, 30.0), (100.0, 0.0)]]).0, OffgoingHolds);
        assert_eq!(after(OffgoingHolds, &[[(0.7, 30.0), (100.0, 0.0)]]), (BothSlip, [None; 2]));
        assert_eq!(after(OffgoingHolds, &[[(-0.7, 30.0), (100.0, 0.0)]]), (BothSlip, [None; 2]));
        // Released by its load it slips in the direction of that load.
        assert_eq!(after(OffgoingHolds, &[[(0.1, -61.0), (100.0, 0.0)]]), (BothSlip, [Some(-1.0), None]));
        assert_eq!(after(OncomingHolds, &[[(90.0, 0.0), (0.9, 30.0)]]).0, OncomingHolds);
        assert_eq!(after(OncomingHolds, &[[(90.0, 0.0), (1.0, 30.0)]]).0, BothSlip);
    }

    #[test]
    fn a_clutch_grips_where_its_slip_ends_and_it_can_hold() {
        use ShiftPhase::{BothSlip, OffgoingHolds, OncomingHolds};
        assert_eq!(after(BothSlip, &[[(90.0, 0.0), (0.6, 30.0)]]).0, OncomingHolds);
        assert_eq!(after(BothSlip, &[[(90.0, 0.0), (0.6, 70.0)]]).0, BothSlip);
        // A flare that was caught: two samples.
        let caught = [(0.4, 30.0), (100.0, 0.0)];
        assert_eq!(after(BothSlip, &[caught]).0, BothSlip);
        assert_eq!(after(BothSlip, &[caught, caught]).0, OffgoingHolds);
        assert_eq!(after(BothSlip, &[caught, [(0.6, 30.0), (100.0, 0.0)], caught]).0, BothSlip);
        let heavy = [(0.4, 61.0), (100.0, 0.0)];
        assert_eq!(after(BothSlip, &[heavy, heavy]).0, BothSlip);
    }

    #[test]
    fn a_clutch_that_may_slip_yet_has_its_direction_for_one_sample() {
        let mut memory = PhaseMemory::new(ShiftPhase::OncomingHolds);
        let slip = Slip { value: 0.2, deviation: 0.1 };
        memory.slips_yet = -0.3;
        assert_eq!([0, 1].map(|clutch| memory.direction(clutch, &slip)), [slip.direction(), -1.0]);
        memory.step(&[contact(90.0, 0.0), contact(0.2, 30.0)]);
        assert_eq!((memory.phase, memory.direction(1, &slip)), (ShiftPhase::OncomingHolds, slip.direction()));
    }

    #[test]
    fn nothing_that_is_not_a_number_changes_the_phase() {
        use ShiftPhase::{OffgoingHolds, OncomingHolds};
        let nan = [(f64::NAN, f64::NAN); 2];
        assert_eq!(after(OffgoingHolds, &[nan]).0, OffgoingHolds);
        assert_eq!(after(OncomingHolds, &[nan]).0, OncomingHolds);
    }
}
