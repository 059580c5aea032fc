//! Ranges of pressure and torque, the same for every observer.
//!
//! The range of the pressure follows from the command alone ([`crate::pressure_range`]), that of the clutch torque adds
//! the friction and the drag of the oil between the plates. Both are guaranteed for errors within the [`Budget`]. The range of the shaft torque
//! ([`crate::shaft_range`]) is an expected one: it also rests on the speeds between two readings. The only quantity
//! beside readings that they use is the phase, which is the same for all observers. Therefore one [`RangeEstimator`]
//! serves all observers of a run.

use drivetrain::clutch::{DRAG_PEAK_RAD_S, drag_torque};
use drivetrain::{Clutch, Real};

use crate::{
    Aligned, Alignment, AlignmentState, Bounds, Budget, ChannelHealth, Estimate, Estimator, Input, Phase,
    PressureRange, Reading, Sample, ShaftMemory, ShaftRange, Tracker, TrackerState,
};

/// Computes the ranges of a run, once for all observers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RangeEstimator<T> {
    /// What the ranges of pressure and clutch torque are made from.
    pub budget: Budget<T>,
    /// The oncoming clutch.
    pub clutch: Clutch<T>,
    /// Maximum age of a reading, s.
    pub age_s: T,
    /// The drive shafts' part; with none there is no range of their torque.
    pub shaft: Option<ShaftRange<T>>,
    /// Checks of the input, and the phase.
    pub tracker: Tracker<T>,
}

/// Memory of a [`RangeEstimator`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeState<T> {
    /// The range of the pressure.
    pub pressure: PressureRange<T>,
    alignment: AlignmentState<T>,
    /// For how long turbine and output speed have not been read, s.
    unread_s: [T; 2],
    tracker: TrackerState<T>,
    shaft: ShaftMemory<T>,
}

/// Any observer with the ranges around its estimates.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bounded<T, O> {
    /// The observer.
    pub observer: O,
    /// The ranges.
    pub range: RangeEstimator<T>,
}

/// What the ranges take of a step.
struct Seen<'a, T> {
    /// Time since the step before, s; none if it is unusable.
    dt_s: Option<T>,
    /// The command, if a usable one was read.
    command: Option<Reading<T>>,
    /// The phase, if the speeds are usable and the shaft torque has a range.
    phase: Option<Phase>,
    /// The signals at the time of the step.
    sample: &'a Sample<T>,
    /// Minimum and maximum slip of the oncoming clutch, rad/s, if it is known.
    slip_rad_s: Option<[T; 2]>,
    /// Whether turbine, output and wheel speed were read in this step.
    read: bool,
}

impl<T: Real> RangeEstimator<T> {
    /// The guaranteed ranges alone, without the expected one of the shaft torque.
    #[must_use]
    pub fn guaranteed(self) -> Self {
        Self { shaft: None, ..self }
    }

    /// Its memory before the first sample: everything is possible.
    pub fn start(&self) -> RangeState<T> {
        RangeState {
            pressure: PressureRange::unknown(&self.budget, self.tracker.limits.command_max),
            alignment: AlignmentState::new(),
            unread_s: [T::zero(); 2],
            tracker: TrackerState::new(),
            shaft: ShaftMemory::new(),
        }
    }

    /// Takes what came since the step before and returns the ranges for now. Never panics; allocates nothing.
    #[inline]
    pub fn step(&self, state: &mut RangeState<T>, input: &Input<T>) -> Bounds<T> {
        let aligned = self.align(state, input);
        self.step_aligned(state, input, &aligned)
    }

    /// The signals at the time of the step, the first part of [`Self::step`].
    #[inline]
    fn align(&self, state: &mut RangeState<T>, input: &Input<T>) -> Aligned<T> {
        Alignment { shift: &self.tracker.shift, limits: &self.tracker.limits }.step(&mut state.alignment, input)
    }

    /// The second part.
    #[inline]
    fn step_aligned(&self, state: &mut RangeState<T>, input: &Input<T>, aligned: &Aligned<T>) -> Bounds<T> {
        let limits = &self.tracker.limits;
        let seen = self.seen(state, input, aligned);
        match seen.dt_s {
            Some(dt_s) => state.pressure.step(&self.budget, dt_s, seen.command, limits.command_max),
            None => state.pressure.forget(&self.budget, limits.command_max),
        }
        let (pressure_pa, clutch_torque_n_m) =
            pressure_and_torque(&self.clutch, &self.budget, &state.pressure, seen.slip_rad_s);
        let shaft_torque_n_m = match (&self.shaft, seen.phase) {
            (None, _) => None,
            (Some(shaft), Some(phase)) if seen.dt_s.is_some() && seen.read => {
                let range = shaft.step(&mut state.shaft, phase, seen.sample, clutch_torque_n_m);
                let limit = limits.shaft_torque_max_n_m;
                range.map(|range| range.map(|torque| torque.at_least(-limit).at_most(limit)))
            }
            (Some(_), _) => {
                state.shaft = ShaftMemory::new();
                None
            }
        };
        Bounds { pressure_pa, clutch_torque_n_m, shaft_torque_n_m }
    }

    /// Checks the input and follows the phase.
    #[inline]
    fn seen<'a>(&self, state: &mut RangeState<T>, input: &Input<T>, aligned: &'a Aligned<T>) -> Seen<'a, T> {
        let (limits, zero) = (&self.tracker.limits, T::zero());
        let Aligned { sample, channels } = aligned;
        let usable = limits.speeds_valid(sample);
        let (dt_s, phase) = if self.shaft.is_some() {
            let dt_s = self.tracker.begin(&mut state.tracker, sample).map(|interval| interval.dt_s);
            let phase = usable.then(|| match dt_s {
                Some(dt_s) => self.tracker.phase(&mut state.tracker, dt_s, sample).0,
                None => state.tracker.supervisor.phase,
            });
            (dt_s, phase)
        } else {
            // The guaranteed ranges do not depend on the phase.
            (state.tracker.time_step(sample), None)
        };
        let command = input.command.and_then(|reading| limits.read_command(&reading));
        for (unread_s, channel) in state.unread_s.iter_mut().zip([channels.turbine, channels.output]) {
            let is_read = channel == ChannelHealth::Good;
            *unread_s = if is_read { zero } else { *unread_s + dt_s.unwrap_or_else(T::infinity) };
        }
        let unread_s = state.unread_s[0].at_least(state.unread_s[1]);
        let fresh = unread_s <= zero;
        // A slip carried on by its rate may be wrong by what it changes at most, twice: once that it does, once that it did.
        let carried = T::one() + (unread_s + unread_s) / self.age_s;
        let error = self.budget.slip_rad_s * if fresh { T::one() } else { carried };
        let slip_rad_s = self
            .slips(&state.alignment, sample)
            .filter(|_| limits.slip_valid(sample))
            .map(|[low, high]| [low - error, high + error]);
        let read = fresh && channels.wheel == ChannelHealth::Good;
        Seen { dt_s, command, phase, sample, slip_rad_s, read }
    }

    /// Minimum and maximum slip by the newest readings, and by those with the one before in place of turbine or output speed. A single
    /// wrong reading would turn the sign of the torque around; so it makes the range wider.
    #[inline]
    fn slips(&self, alignment: &AlignmentState<T>, sample: &Sample<T>) -> Option<[T; 2]> {
        let (shift, zero, slip) = (&self.tracker.shift, T::zero(), sample.slip_rad_s);
        let [turbine, output] = alignment.since_the_one_before()?;
        let others = [slip - shift.oncoming_slip(turbine, zero), slip - shift.oncoming_slip(zero, output)];
        Some([slip.at_most(others[0]).at_most(others[1]), slip.at_least(others[0]).at_least(others[1])])
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> RangeEstimator<U> {
        RangeEstimator {
            budget: self.budget.cast(),
            clutch: self.clutch.cast(),
            age_s: U::of(self.age_s.to_f64_exact()),
            shaft: self.shaft.as_ref().map(ShaftRange::cast),
            tracker: self.tracker.cast(),
        }
    }
}

/// The ranges of pressure and clutch torque, with the minimum and maximum slip if it is known.
#[inline]
pub(crate) fn pressure_and_torque<T: Real>(
    clutch: &Clutch<T>,
    budget: &Budget<T>,
    pressure: &PressureRange<T>,
    slip_rad_s: Option<[T; 2]>,
) -> ([T; 2], [T; 2]) {
    let pressure_pa = pressure.pressure_pa(budget);
    // The sign of a slip that may be zero is not known, nor whether the clutch holds.
    let slip = slip_rad_s.filter(|[low, high]| *low > T::zero() || *high < T::zero());
    let [friction, drag] =
        [friction(clutch, budget, clamp_force(clutch, budget, pressure, pressure_pa), slip), drag(budget, slip)];
    (pressure_pa, [friction[0] + drag[0], friction[1] + drag[1]])
}

/// Minimum and maximum torque of the plates that the force presses together, N m, with the minimum and maximum slip if its sign is known.
#[inline]
fn friction<T: Real>(
    clutch: &Clutch<T>,
    budget: &Budget<T>,
    [lowest_force, highest_force]: [T; 2],
    slip_rad_s: Option<[T; 2]>,
) -> [T; 2] {
    let zero = T::zero();
    if highest_force <= zero {
        return [zero; 2];
    }
    let [minimum, maximum] = budget.friction_factor;
    let (lowest, highest) = match slip_rad_s {
        Some([low, high]) if low > zero => clutch.friction.range_within(low, high),
        Some([low, high]) => clutch.friction.range_within(-high, -low),
        None => {
            let (lowest, highest) = clutch.friction.range();
            (lowest.at_most(clutch.static_friction), highest.at_least(clutch.static_friction))
        }
    };
    let at_most = maximum * highest * clutch.lever() * highest_force;
    let at_least = minimum * lowest * clutch.lever() * lowest_force;
    match slip_rad_s {
        None => [-at_most, at_most],
        Some([low, _]) if low > zero => [at_least, at_most],
        Some(_) => [-at_most, -at_least],
    }
}

/// Minimum and maximum drag, N m: between none and the budget's at the slip, with its sign if that is known.
#[inline]
fn drag<T: Real>(budget: &Budget<T>, slip_rad_s: Option<[T; 2]>) -> [T; 2] {
    let (zero, peak_rad_s) = (T::zero(), T::of(DRAG_PEAK_RAD_S));
    // The drag grows with the slip up to its peak, and falls beyond it.
    let at_most = |low: T, high: T| drag_torque(budget.drag_n_m, peak_rad_s.at_least(low).at_most(high));
    match slip_rad_s {
        None => [-budget.drag_n_m, budget.drag_n_m],
        Some([low, high]) if low > zero => [zero, at_most(low, high)],
        Some([low, high]) => [-at_most(-high, -low), zero],
    }
}

/// Lower bound of the torque up to which the clutch holds, N m.
#[inline]
pub(crate) fn capacity_min_n_m<T: Real>(clutch: &Clutch<T>, budget: &Budget<T>, pressure: &PressureRange<T>) -> T {
    let [lowest_force, _] = clamp_force(clutch, budget, pressure, pressure.pressure_pa(budget));
    let friction = clutch.static_friction.at_least(clutch.friction.at(T::zero()));
    budget.friction_factor[0] * friction * clutch.lever() * lowest_force
}

/// Minimum and maximum force that presses the plates together, N: none before the piston has closed the clearance.
#[inline]
fn clamp_force<T: Real>(
    clutch: &Clutch<T>,
    budget: &Budget<T>,
    pressure: &PressureRange<T>,
    [lower_pa, upper_pa]: [T; 2],
) -> [T; 2] {
    let zero = T::zero();
    let Some((fill, piston)) = budget.fill.as_ref().zip(pressure.piston(budget)) else {
        return [lower_pa, upper_pa].map(|pressure_pa| clutch.clamp_force(pressure_pa));
    };
    let [kiss, kissed] = fill.kiss_pressure_pa;
    let force = |above_kiss: T| clutch.piston_area_m2 * above_kiss.at_least(zero);
    let maximum = if piston.stroke()[1] < T::one() { zero } else { force(upper_pa - kiss) };
    [force(lower_pa - kissed), maximum]
}

impl<T: Real, O: Estimator<T>> Estimator<T> for Bounded<T, O> {
    type State = (O::State, RangeState<T>);

    fn start(&self) -> Self::State {
        (self.observer.start(), self.range.start())
    }

    #[inline]
    fn step(&self, (state, range): &mut Self::State, input: &Input<T>) -> Estimate<T> {
        let aligned = self.range.align(range, input);
        let estimate = self.observer.step_aligned(state, input, &aligned);
        self.range.step_aligned(range, input, &aligned).clip(estimate)
    }
}

impl<T: Real, O> Bounded<T, O> {
    /// The same ranges in another precision, around an observer of that precision.
    pub fn cast<U: Real, P>(&self, observer: P) -> Bounded<U, P> {
        Bounded { observer, range: self.range.cast() }
    }
}
