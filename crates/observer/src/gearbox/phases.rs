//! Which of the two shift clutches hold: measured slip decides, not the plan.
//!
//! | from | to | when |
//! |---|---|---|
//! | offgoing holds | both slip | its slip is believed ([`NewSlip`]), or it would have to hold more than it does by the estimate |
//! | both slip | offgoing holds | its slip is small in two samples and it holds its load: a flare that was caught |
//! | both slip | oncoming holds | its slip is below the threshold, and it holds its load |
//! | oncoming holds | both slip | the same with a threshold that is higher by half |
//!
//! One reading may be wrong by any amount, and two in a row by the same: until a slip is believed the clutch holds, and the filter goes on for the
//! other case too ([`super::doubt`]).
//!
//! What a clutch holds by the estimate is compared as it is, without a margin: so the more likely of both phases is taken. The readings
//! are 5 to 10 ms old and show a slip some samples after it has begun.
//!
//! The turbine torque is not used but for what a clutch has to hold: the roles of the clutches follow from the equations,
//! also where the turbine torque changes its sign.

use drivetrain::Real;

/// Standard deviations of the slip in its threshold, and slip beside them, rad/s.
const THRESHOLD: (f64, f64) = (3.5, 0.3);
/// Standard deviations of the slip above which it may be one: then no reading of turbine and output is taken while a clutch holds.
const MAYBE: f64 = 2.0;
/// Fraction of the threshold below which a clutch has caught, and samples in a row.
const CAUGHT: (f64, u8) = (0.7, 2);
/// Fraction of a new slip in the mean of those of a clutch that holds \[chosen\]: some five samples.
const MEAN: f64 = 0.3;
/// Readings in a row above the threshold after which a slip is believed.
const BELIEVED: u8 = 3;
/// Multiple of the threshold above which the oncoming clutch slips again, and for a clutch that holds far more than it has to \[chosen\]: teeth that have passed
/// some time ago show a slip of the second size where a car brakes hard.
const SLIPS_AGAIN: f64 = 1.5;
const SLIPS_THOUGH_STRONG: f64 = 3.0;
/// A clutch that could carry more than so many times the load is stronger than a slip that the readings show \[chosen\].
pub(super) const STRONGER_THAN_SHOWN: f64 = 3.0;
/// Part of its largest torque from which on the slip of a clutch may be doubted \[chosen\]: one that is filled for a shift carries less.
pub(super) const STRONG: f64 = 0.1;

/// Which of the shift clutches hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    pub(super) std_dev: T,
}

impl<T: Real> Slip<T> {
    pub(super) fn threshold(&self) -> T {
        T::of(THRESHOLD.0) * self.std_dev + T::of(THRESHOLD.1)
    }

    pub(super) fn is_over(&self) -> bool {
        self.value.abs() > self.threshold()
    }

    /// Whether it may be a slip that is not yet seen.
    pub(super) fn may_be(&self) -> bool {
        self.value.abs() > T::of(MAYBE) * self.std_dev
    }

    /// Its sign; less than one where the slip is below half its threshold.
    pub(super) fn direction(&self) -> T {
        let half = T::of(0.5) * self.threshold();
        (self.value / half).max(-T::one()).min(T::one())
    }
}

/// The slip of a clutch that holds, above its threshold, from reading to reading. It is believed at the second reading in the same direction if
/// it has grown by the threshold, as the slip of a clutch that is overloaded does, and else at the third.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct NewSlip<T> {
    /// At the reading before, rad/s.
    before: T,
    /// Readings in a row above the threshold, in one direction.
    count: u8,
}

impl<T: Real> NewSlip<T> {
    fn none() -> Self {
        Self { before: T::zero(), count: 0 }
    }

    /// Takes the slip by new readings. Whether it is believed.
    fn take(&mut self, slip: T, threshold: T) -> bool {
        // A comparison with NaN is false.
        if !(slip.abs() > threshold && slip.is_finite()) {
            *self = Self::none();
            return false;
        }
        let goes_on = self.before * slip > T::zero();
        let grown = goes_on && slip.abs() >= self.before.abs() + threshold;
        self.count = if goes_on { self.count.saturating_add(1) } else { 1 };
        self.before = slip;
        grown || self.count >= BELIEVED
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
    /// Whether it holds far more than it has to.
    pub(super) is_strong: bool,
}

/// Whether a clutch that holds so much holds far more than it needs, N m; the most that it can hold at all is the measure below which that is not known. One without
/// a command, which is known by the speeds alone, holds an infinite torque here.
pub(super) fn is_strong<T: Real>(holds_n_m: T, needed_n_m: T, most_n_m: T) -> bool {
    holds_n_m.is_finite()
        && holds_n_m > T::of(STRONGER_THAN_SHOWN) * needed_n_m.abs()
        && holds_n_m > T::of(STRONG) * most_n_m
}

impl<T: Real> Contact<T> {
    /// Whether it slips by its load, more likely than not: both torques are means, and their errors have no preferred sign.
    fn is_overloaded(&self) -> bool {
        self.needed_n_m.abs() > self.holds_n_m
    }
}

/// What remains between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct PhaseMemory<T> {
    pub(super) phase: ShiftPhase,
    /// Samples in a row in which the offgoing clutch has seemed to hold again.
    caught: u8,
    /// Direction of a clutch that was released by its load, until its slip is seen.
    pub(super) released: [Option<T>; 2],
    /// Slip of the clutch that holds, averaged.
    mean_rad_s: T,
    new_slip: NewSlip<T>,
    /// Whether turbine and output have been read since the slip was last judged.
    read: [bool; 2],
    /// Of a clutch that has gripped in this sample: the probability that it slips yet, with the sign of its torque then.
    pub(super) slips_yet: T,
}

impl<T: Real> PhaseMemory<T> {
    pub(super) fn new(phase: ShiftPhase) -> Self {
        Self {
            phase,
            caught: 0,
            released: [None; 2],
            mean_rad_s: T::zero(),
            new_slip: NewSlip::none(),
            read: [false; 2],
            slips_yet: T::zero(),
        }
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

    /// Whether a clutch holds whose slip is above the threshold and not yet believed.
    pub(super) fn is_in_doubt(&self) -> bool {
        self.new_slip.count > 0
    }

    /// The phase after this sample, in which turbine and output were read or not.
    pub(super) fn step(&mut self, contacts: &[Contact<T>; 2], read: [bool; 2]) {
        let [off, on] = contacts;
        self.slips_yet = T::zero();
        let is_new = self.is_new(read);
        for (released, contact) in self.released.iter_mut().zip(contacts) {
            if contact.slip.is_over() {
                *released = None;
            }
        }
        let lets_go = match self.phase {
            ShiftPhase::OffgoingHolds => self.lets_go(off, T::one(), is_new),
            ShiftPhase::OncomingHolds => self.lets_go(on, T::of(SLIPS_AGAIN), is_new),
            ShiftPhase::InGear | ShiftPhase::BothSlip => false,
        };
        let next = match self.phase {
            _ if lets_go => ShiftPhase::BothSlip,
            ShiftPhase::BothSlip => self.both_slip(off, on),
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
            (self.mean_rad_s, self.new_slip) = (T::zero(), NewSlip::none());
        }
        self.phase = next;
    }

    /// Whether both speeds have been read since the slip was last judged: one reading is judged once.
    fn is_new(&mut self, read: [bool; 2]) -> bool {
        for (since, now) in self.read.iter_mut().zip(read) {
            *since |= now;
        }
        let is_new = self.read == [true; 2];
        if is_new {
            self.read = [false; 2];
        }
        is_new
    }

    /// Whether the clutch that holds slips: by its slip, above this multiple of the threshold or small and lasting, or by its load.
    fn lets_go(&mut self, held: &Contact<T>, multiple: T, is_new: bool) -> bool {
        let times = if held.is_strong { T::of(SLIPS_THOUGH_STRONG) } else { T::one() };
        let threshold = times.at_least(multiple) * held.slip.threshold();
        let slips = is_new && {
            let grows = self.new_slip.take(held.slip.value, threshold);
            self.slip_lasts(&held.slip, times) || grows
        };
        slips || held.is_overloaded()
    }

    /// Whether the slip of the clutch that holds is small and lasts: the mean of it is over a threshold of its own, times a factor.
    fn slip_lasts(&mut self, slip: &Slip<T>, times: T) -> bool {
        let fraction = T::of(MEAN);
        if slip.value.is_finite() {
            // What is above the threshold is judged by itself.
            let limit = times * slip.threshold();
            let value = slip.value.at_least(-limit).at_most(limit);
            // Nor does what was below that of a strong clutch make one slip that is strong no more.
            let mean = self.mean_rad_s.at_least(-limit).at_most(limit);
            self.mean_rad_s = mean + fraction * (value - mean);
        }
        let std_dev = slip.std_dev * (fraction / (T::of(2.0) - fraction)).sqrt();
        Slip { value: self.mean_rad_s / times, std_dev }.is_over()
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
        Contact { slip: Slip { value: slip, std_dev: 0.1 }, needed_n_m, holds_n_m: 60.0, is_strong: false }
    }

    #[test]
    fn a_clutch_that_holds_far_more_than_it_has_to_slips_by_a_large_slip_alone() {
        let after = |slips: &[f64]| {
            let mut memory = PhaseMemory::new(ShiftPhase::OncomingHolds);
            for &slip in slips {
                let held = Contact { is_strong: true, ..contact(slip, 1.0) };
                memory.step(&[contact(90.0, 0.0), held], [true; 2]);
            }
            memory.phase
        };
        assert_eq!(after(&[1.0; 30]), ShiftPhase::OncomingHolds);
        assert_eq!(after(&[2.5, 5.0]), ShiftPhase::BothSlip);
        assert_eq!(after(&[2.0; 3]), ShiftPhase::BothSlip);
        assert!(is_strong(300.0, -60.0, 1000.0));
        assert!(!is_strong(300.0, 120.0, 1000.0) && !is_strong(90.0, 1.0, 1000.0));
        assert!(!is_strong(f64::INFINITY, 1.0, 1000.0) && !is_strong(f64::NAN, 1.0, 1000.0));
    }

    /// The phase after these samples of slip and torque needed, of offgoing and oncoming clutch.
    fn after(phase: ShiftPhase, samples: &[[(f64, f64); 2]]) -> (ShiftPhase, [Option<f64>; 2]) {
        let mut memory = PhaseMemory::new(phase);
        for sample in samples {
            memory.step(&sample.map(|(slip, needed)| contact(slip, needed)), [true; 2]);
        }
        (memory.phase, memory.released)
    }

    /// The phase after these slips of the clutch that holds, which bears its load.
    fn after_slips(phase: ShiftPhase, slips: &[f64]) -> ShiftPhase {
        let mut memory = PhaseMemory::new(phase);
        for &slip in slips {
            let (held, other) = (contact(slip, 30.0), contact(100.0, 0.0));
            let contacts = if phase == ShiftPhase::OffgoingHolds { [held, other] } else { [other, held] };
            memory.step(&contacts, [true; 2]);
        }
        memory.phase
    }

    #[test]
    fn slip_in_either_direction_or_too_much_torque_releases_a_clutch() {
        use ShiftPhase::{BothSlip, OffgoingHolds, OncomingHolds};
        // The threshold is 3.5 * 0.1 + 0.3 = 0.65 rad/s.
        for sign in [1.0, -1.0] {
            let [first, more, larger] = [0.7, 1.3, 1.4].map(|slip| sign * slip);
            assert_eq!(after_slips(OffgoingHolds, &[first, larger]), BothSlip, "it grows by the threshold");
            assert_eq!(after_slips(OffgoingHolds, &[first, more]), OffgoingHolds);
            assert_eq!(after_slips(OffgoingHolds, &[first, more, first]), BothSlip, "it lasts");
            // Of the oncoming clutch the threshold is higher by half.
            assert_eq!(after_slips(OncomingHolds, &[sign * 0.9, sign * 1.9]), OncomingHolds);
            assert_eq!(after_slips(OncomingHolds, &[sign, sign * 2.0]), BothSlip);
        }
        // Released by its load it slips in the direction of that load.
        assert_eq!(after(OffgoingHolds, &[[(0.1, -61.0), (100.0, 0.0)]]), (BothSlip, [Some(-1.0), None]));
    }

    #[test]
    fn one_or_two_wrong_readings_are_no_slip() {
        use ShiftPhase::{OffgoingHolds, OncomingHolds};
        for wrong in [0.7, 1.2, 5.0, 20.0, 1e3, f64::INFINITY] {
            for slips in
                [&[0.0, wrong, 0.0][..], &[wrong, wrong, 0.0], &[wrong, -wrong, wrong, 0.0], &[wrong, 0.0, wrong, 0.1]]
            {
                assert_eq!(after_slips(OffgoingHolds, slips), OffgoingHolds, "{slips:?}");
                assert_eq!(after_slips(OncomingHolds, slips), OncomingHolds, "{slips:?}");
            }
        }
    }

    #[test]
    fn a_reading_counts_once() {
        let mut memory = PhaseMemory::new(ShiftPhase::OffgoingHolds);
        for read in [[true, true], [false, false], [false, true], [false, true], [false, false]] {
            memory.step(&[contact(0.7, 30.0), contact(100.0, 0.0)], read);
            assert_eq!(memory.phase, ShiftPhase::OffgoingHolds, "{read:?}");
        }
        for read in [[true, false], [true, true]] {
            memory.step(&[contact(0.7, 30.0), contact(100.0, 0.0)], read);
        }
        assert_eq!(memory.phase, ShiftPhase::BothSlip);
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
        let slip = Slip { value: 0.2, std_dev: 0.1 };
        memory.slips_yet = -0.3;
        assert_eq!([0, 1].map(|clutch| memory.direction(clutch, &slip)), [slip.direction(), -1.0]);
        memory.step(&[contact(90.0, 0.0), contact(0.2, 30.0)], [true; 2]);
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
