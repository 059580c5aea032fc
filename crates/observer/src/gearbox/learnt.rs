//! What is learnt from shift to shift, and kept.
//!
//! | quantity | of each | meaning |
//! |---|---|---|
//! | `f` | element | factor of its torque: friction times the valve's gain |
//! | `k` | element | its kiss point |
//! | `m` | pair of gears | turbine-side inertia `M11` |
//! | `c` | car | torque at the gearbox input: the converter's capacity |
//! | `e` | car | stiffness of the drive shafts: it is in what is seen, and the filter has no state of it |
//! | `s` | car | scale of the wheel speed |
//! | `q` | car | torque that the engine's controller reports, beside an open converter |
//! | `l`, `d` | element | lag and delay of its valve: the valve model is changed by them, and the filter has no states of them |
//!
//! Together they are one Gaussian, each in units of the standard deviation that it has unlearnt. A shift begins with the ten of
//! them that act in it, `a = H theta + d`, where `d` is the part that is another in each shift. What it shows ([`InformationGain`])
//! are up to ten measurements of these, with noise of variance one, and one Kalman filter of all quantities takes them:
//!
//! ```text
//! y = R (a + s e) + noise          S = R ((H, s) P (H, s)' + D) R' + 1
//! ```
//!
//! **Stiffness.** The scale of all torques that the speeds show is that of the twist of the drive shafts. A shaft that is
//! softer by a fraction shows turbine torque, torque factors and inertia larger by that fraction, in each shift alike: the
//! direction `s`. Without `e` the shifts together would find the torque factors and inertias with a certainty that they do not have.
//!
//! **Another car, or a bad log.** What is learnt is one of two hypotheses; the other is that the car is any of the budget.
//! Each shift is held against both, and the logarithm of their odds is summed. Before a shift the filter is given the mean
//! and the covariance of both together, weighted by these odds. Where they speak for the budget by a hundred to one, what
//! was learnt before is forgotten. What comes from another drive begins with even odds. Some of what a bad log leaves is in
//! directions that no shift shows, turbine torque against stiffness: so it also begins with the covariance of both together.
//!
//! **Wheel speed.** Its scale shows in a gear, because the twist of the drive shafts is bounded. It acts in no shift's measurements:
//! the filter goes on with its own state of it from gear to gear, and what is kept here is where another run begins.
//!
//! **What many shifts have wrong alike** does not average out: [`super::systematic`].
//!
//! **Reported torque.** It acts in no shift either. In a gear it shows the sum of its error and that of the converter
//! ([`super::reported`]).
//!
//! Friction and gain are not told apart here: what the speeds show of both is `f` and `k`. A gain moves both, a
//! friction only `f`, and [`LearntElement`] has what follows of each from what the budget says of them.

#[cfg(feature = "serde")]
mod big_square;

use drivetrain::Real;

use super::elements::ValveTiming;
use super::information::{InformationGain, Matrix, around, cholesky, is_positive, lower_inverse};
use super::powertrain::dot;
use super::systematic::is_considered;
use super::tables::{MAX_ELEMENTS, ShiftElement};

/// Most pairs of gears whose inertia is learnt.
pub const MAX_PAIRS: usize = 16;
/// Places of the quantities, in the order of the table above.
pub(super) const KISS_AT: usize = MAX_ELEMENTS;
pub(super) const INERTIA_AT: usize = 2 * MAX_ELEMENTS;
pub(super) const TURBINE_AT: usize = INERTIA_AT + MAX_PAIRS;
pub(super) const STIFFNESS_AT: usize = TURBINE_AT + 1;
const WHEEL_AT: usize = STIFFNESS_AT + 1;
pub(super) const REPORTED_AT: usize = WHEEL_AT + 1;
pub(super) const LAG_AT: usize = REPORTED_AT + 1;
pub(super) const DELAY_AT: usize = LAG_AT + MAX_ELEMENTS;
/// How many quantities are learnt.
pub const LEARNT: usize = DELAY_AT + MAX_ELEMENTS;
/// How many of them act in a shift: so many states, and lag and delay of both valves.
pub(super) const ACTING: usize = STATES_ACTING + 4;
pub(super) const STATES_ACTING: usize = 6;

/// Squared distance of what a shift says from what was known, in its standard deviations, beyond which it counts for less, and
/// beyond which it is refused \[chosen\]: ten quantities reach them by chance in one of 70 and in 2 of a million shifts.
const LIKELY: f64 = 22.0;
const GATE: f64 = 46.0;
/// Refused shifts in a row after which all is forgotten \[chosen\]: the car is another, as after a repair.
const REFUSED_MAX: u8 = 8;
/// Variance by which each quantity is another in the next shift, in that of the budget \[chosen\]: 9 % of its standard deviation in 30
/// shifts. What is well known stays open to what comes, also in single precision.
const PER_SHIFT: f64 = 2.5e-4;
/// Minimum variance of the scale of the wheel speed, in that of the budget \[chosen\]: the filter's own changes by a tenth of its standard
/// deviation with what the car does, as the timing of the readings shows as a scale.
const WHEEL_MIN: f64 = 0.01;
/// Bound of a quantity in its standard deviations: the edge of a uniform distribution, and of the sum of two.
pub(super) const EDGE: f64 = 1.732;
const EDGE_OF_TWO: f64 = 2.449;
/// The same of lag and delay, in standard deviations of the part that lasts, three quarters of the variance: all of it may last.
const EDGE_OF_TIMING: f64 = 2.0;
/// Correlation of the torque factors of two elements unlearnt \[chosen\]: half of the variance of the friction is that of the oil,
/// which all of them share, and friction is two thirds of that of the factor. Without it a friction that is wrong in all
/// elements alike would be taken for an error of the converter, of which there is one.
const COMMON: f64 = 0.33;
/// Logarithm of the odds of what is learnt against the budget \[chosen\]: at most, and with the other sign what is forgotten;
/// at most by one shift, which may be a bad one itself. A hundred to one, and ten to one: a car that is the one learnt loses what
/// is learnt once in ten thousand shifts at most (Wald); another car is found in two shifts of a new drive.
const ODDS_MAX: f64 = 4.6;
const ODDS_OF_SHIFT: f64 = 2.3;
/// The same of the inertia of two pairs of gears \[chosen\]: half of the variance is that of the turbine, of the oil in it and of
/// the input shaft, which are in all of them. Without it an inertia that is wrong in all pairs alike would be taken for an error
/// of the stiffness, of which there is one.
const COMMON_INERTIA: f64 = 0.5;
/// Variance above which a covariance was not made here, in that of the budget.
const VARIANCE_MAX: f64 = 2.0;
/// Time after which a quantity is another, s \[chosen\]: friction, gain, kiss point and converter with the
/// oil, and with the engine its reported torque; inertia, shafts and tyres with nothing but a repair and wear. Torque factor and kiss point have the gain in
/// common, and fade together: else their correlation could not last.
const WITH_OIL_S: f64 = 7200.0;
const INERTIA_S: f64 = 3.6e6;
/// Change of the oil's temperature in which as much is forgotten as in [`WITH_OIL_S`], K \[chosen\]; from this change on it counts, so that the noise
/// of a sensor makes nothing forgotten; and temperatures that an oil can have, degC.
const OIL_K: f64 = 40.0;
const OIL_STEP_K: f64 = 5.0;
const OIL_DEGC: [f64; 2] = [-60.0, 220.0];

/// What is learnt, as a Gaussian. It is plain data and can be written to a file and read again; what is read must pass
/// [`Learnt::checked`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Learnt<T> {
    /// Means, in units of the standard deviation that each quantity has unlearnt: torque factors and kiss points by element, inertias
    /// by pair of gears, torque at the gearbox input, stiffness of the drive shafts, scale of the wheel speed, reported engine torque,
    /// lags and delays of the valves by element.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    pub mean: [T; LEARNT],
    /// Their covariance, in the same units.
    #[cfg_attr(feature = "serde", serde(with = "big_square"))]
    pub covariance: [[T; LEARNT]; LEARNT],
    /// Shifts that were learnt from.
    pub shifts: u32,
    /// Shifts in a row that were refused.
    pub refused: u8,
    /// Logarithm of the odds that it is of this car, against any car of the budget.
    pub odds: T,
    /// Temperature of the oil that it is for, degC, where that was read.
    pub oil_degc: Option<T>,
}

/// What is learnt of an element: error and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearntElement<T> {
    /// Of the torque that it carries at a pressure well above its kiss point, as a fraction: friction times gain.
    pub torque_fraction: [T; 2],
    /// Of its kiss point, Pa.
    pub kiss_pa: [T; 2],
    /// Of the valve's gain, as a fraction. Speeds and commands do not tell it apart from a friction and a kiss point of the
    /// element: its standard deviation stays large.
    pub valve_gain: [T; 2],
}

/// Correlation of torque factor and kiss point of each element unlearnt: the valve's gain is in both.
pub(super) type Correlations<T> = [T; MAX_ELEMENTS];

/// Which quantities act in a shift, and how.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Acting<T> {
    /// Place of each, if it is learnt; else it is its own in this shift.
    places: [Option<usize>; ACTING],
    /// Part of the variance of torque factors, kiss points, lags and delays that lasts, of either clutch.
    slow_part: [T; 2],
    /// How an error of the stiffness shows in each, per standard deviation of it.
    by_stiffness: [T; ACTING],
    /// Whether they act in a shift, and not in a gear.
    in_shift: bool,
}

/// Means and covariance of the acting quantities, as the filter has them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Known<T> {
    pub(super) mean: [T; ACTING],
    pub(super) covariance: [[T; ACTING]; ACTING],
}

impl<T: Real> Acting<T> {
    /// In the order of the filter's states: torque factors, kiss points, inertia, torque at the gearbox input; then lag and delay of either clutch.
    pub(super) fn new(
        [off, on]: [ShiftElement; 2],
        pair: Option<usize>,
        slow_part: [T; 2],
        by_stiffness: [T; ACTING],
    ) -> Self {
        let element = |of: ShiftElement| of.place().filter(|&at| at < MAX_ELEMENTS);
        // A one-way clutch has no place among the elements.
        let [kiss, lag, delay] = [KISS_AT, LAG_AT, DELAY_AT].map(|first| move |of| element(of).map(|at| first + at));
        let inertia = pair.filter(|&pair| pair < MAX_PAIRS).map(|pair| INERTIA_AT + pair);
        let states = [element(off), element(on), kiss(off), kiss(on), inertia, Some(TURBINE_AT)];
        let timings = [lag(off), delay(off), lag(on), delay(on)];
        let places = core::array::from_fn(|a| states.iter().chain(&timings).nth(a).copied().flatten());
        Self { places, slow_part, by_stiffness, in_shift: true }
    }

    /// Only the torque at the gearbox input, as in a gear.
    pub(super) fn turbine(by_stiffness: [T; ACTING]) -> Self {
        let mut places = [None; ACTING];
        places[STATES_ACTING - 1] = Some(TURBINE_AT);
        Self { places, slow_part: [T::one(); 2], by_stiffness, in_shift: false }
    }

    /// Place of a quantity among all.
    pub(super) fn place(&self, a: usize) -> Option<usize> {
        self.places.get(a).copied().flatten().filter(|&place| place < LEARNT)
    }

    /// Each of the acting quantities as it shows, `(H, s) x`, from all of them.
    #[inline]
    fn seen(&self, all: impl Fn(usize) -> T) -> [T; ACTING] {
        let stiffness = all(STIFFNESS_AT);
        core::array::from_fn(|a| {
            let own = self.place(a).map_or(T::zero(), |place| self.per_unit(a).0 * all(place));
            own + self.by_stiffness[a] * stiffness
        })
    }

    /// The acting quantities with this covariance of all, and the mean zero.
    fn known(&self, of_all: impl Fn(usize, usize) -> Option<T>) -> Known<T> {
        let per_unit: [(T, T); ACTING] = core::array::from_fn(|a| self.per_unit(a));
        let mut known = Known { mean: [T::zero(); ACTING], covariance: [[T::zero(); ACTING]; ACTING] };
        for (a, row) in known.covariance.iter_mut().enumerate() {
            row[a] = per_unit[a].1;
            let Some(place) = self.place(a) else { continue };
            for (b, value) in row.iter_mut().enumerate() {
                let covariance = self.place(b).and_then(|other| of_all(place, other));
                *value = *value + per_unit[a].0 * per_unit[b].0 * covariance.unwrap_or(T::zero());
            }
        }
        known
    }

    /// How an error of the stiffness shows in each, per standard deviation of it.
    pub(super) fn by_stiffness(&self) -> &[T; ACTING] {
        &self.by_stiffness
    }

    /// How a quantity acts per unit, `H`, and the variance beside it, `D`.
    pub(super) fn per_unit(&self, a: usize) -> (T, T) {
        match self.place(a) {
            None => (T::zero(), T::one()),
            Some(INERTIA_AT..LAG_AT) => (T::one(), T::zero()),
            Some(_) => {
                let of_oncoming = if a < STATES_ACTING { a % 2 == 1 } else { a >= STATES_ACTING + 2 };
                let slow_part = self.slow_part[usize::from(of_oncoming)];
                (slow_part.sqrt(), T::one() - slow_part)
            }
        }
    }
}

impl<T: Real> Learnt<T> {
    /// Nothing is learnt yet.
    pub(super) fn nothing(correlations: &Correlations<T>) -> Self {
        let zero = T::zero();
        let (mean, covariance) = ([zero; LEARNT], [[zero; LEARNT]; LEARNT]);
        let mut learnt = Self { mean, covariance, shifts: 0, refused: 0, odds: zero, oil_degc: None };
        learnt.forget(correlations);
        learnt
    }

    /// Forgets all, in its place: on a controller the stack has no room for another one.
    #[inline(never)]
    fn forget(&mut self, correlations: &Correlations<T>) {
        self.mean = [T::zero(); LEARNT];
        for (k, row) in self.covariance.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = unlearnt(correlations, k, j);
            }
        }
        (self.shifts, self.refused, self.odds, self.oil_degc) = (0, 0, T::of(ODDS_MAX), None);
    }

    /// Mean and covariance of torque factor and kiss point of an element.
    pub(super) fn of_element(&self, at: usize) -> Option<([T; 2], [[T; 2]; 2])> {
        let places = [at, KISS_AT + at].map(|place| place.min(LEARNT - 1));
        let covariance = places.map(|a| places.map(|b| self.covariance_of(a, b)));
        (at < MAX_ELEMENTS).then_some((places.map(|place| self.mean_of(place)), covariance))
    }

    /// Mean and variance of lag and delay of the valve of an element.
    pub(super) fn of_timing(&self, at: usize) -> Option<([T; 2], [T; 2])> {
        let places = timing_places(at)?;
        Some((places.map(|k| self.mean_of(k)), places.map(|k| self.covariance_of(k, k))))
    }

    /// Lag and delay of the valve of an element in its next shift by what is learnt and the budget together. `slow_part` is the
    /// part of their variance that lasts.
    pub(super) fn known_timing(&self, at: usize, slow_part: T) -> ValveTiming<T> {
        let Some(places) = timing_places(at) else { return ValveTiming::unlearnt() };
        let (mean, variance) = (places.map(|k| self.mean[k]), places.map(|k| self.covariance[k][k]));
        let (car, one) = (self.probability(), T::one());
        let both = |k: usize| car * variance[k] + (one - car) * (one + car * mean[k] * mean[k]);
        ValveTiming {
            mean: mean.map(|mean| slow_part.sqrt() * car * mean),
            variance: [0, 1].map(|k| slow_part * both(k) + one - slow_part),
        }
    }

    /// Mean and standard deviation of the inertia of a pair of gears.
    pub(super) fn of_pair(&self, pair: usize) -> Option<[T; 2]> {
        let place = INERTIA_AT + pair.min(MAX_PAIRS - 1);
        (pair < MAX_PAIRS).then_some([self.mean_of(place), self.covariance_of(place, place).sqrt()])
    }

    /// Mean and standard deviation of the torque at the gearbox input, and of the reported engine torque.
    pub(super) fn of_sources(&self) -> [[T; 2]; 2] {
        [TURBINE_AT, REPORTED_AT].map(|at| [self.mean_of(at), self.covariance_of(at, at).sqrt()])
    }

    /// Mean and variance of the scale of the wheel speed.
    pub(super) fn of_wheel(&self) -> [T; 2] {
        [self.mean[WHEEL_AT], self.covariance[WHEEL_AT][WHEEL_AT]]
    }

    /// The same by what is learnt and the budget together.
    pub(super) fn known_wheel_scale(&self) -> [T; 2] {
        let ([mean, variance], car) = (self.of_wheel(), self.probability());
        let rest = T::one() - car;
        [car * mean, car * variance + rest * (T::one() + car * mean * mean)]
    }

    /// Takes mean and variance of the scale of the wheel speed, within the bounds.
    pub(super) fn keep_wheel(&mut self, mean: T, variance: T) {
        if mean.is_finite() && variance.is_finite() {
            let edge = T::of(EDGE);
            self.mean[WHEEL_AT] = mean.max(-edge).min(edge);
            self.covariance[WHEEL_AT][WHEEL_AT] = variance.max(T::of(WHEEL_MIN)).min(T::one());
        }
    }

    /// Takes a measurement of the sum of two errors, as a fraction: of the converter's capacity and of the reported engine torque, whose
    /// standard deviations unlearnt are these. Where it is further from what is known than both may be, at their bounds and with three
    /// standard deviations of the noise, one of them is not that of this car, and nothing follows.
    pub(super) fn take_capacity(&mut self, fraction: T, [capacity, reported]: [T; 2], noise: T) {
        let bound = T::of(EDGE) * (capacity + reported) + T::of(3.0) * noise.sqrt();
        let with = self.covariance.map(|row| capacity * row[TURBINE_AT] + reported * row[REPORTED_AT]);
        let variance = capacity * with[TURBINE_AT] + reported * with[REPORTED_AT] + noise;
        let expected = capacity * self.mean[TURBINE_AT] + reported * self.mean[REPORTED_AT];
        if !(fraction.abs() <= bound && variance > T::zero()) {
            return;
        }
        let per = variance.sqrt().recip();
        let with = with.map(|covariance| per * covariance);
        let innovation = per * (fraction - expected);
        for (k, (mean, with)) in self.mean.iter_mut().zip(&with).enumerate() {
            let edge = T::of(edge(k));
            *mean = (*mean + *with * innovation).max(-edge).min(edge);
        }
        for (row, of_row) in self.covariance.iter_mut().zip(&with) {
            for (p, other) in row.iter_mut().zip(&with) {
                *p = *p - *of_row * *other;
            }
        }
        for k in [TURBINE_AT, REPORTED_AT] {
            self.covariance[k][k] = (self.covariance[k][k] + T::of(PER_SHIFT)).min(T::one());
        }
    }

    /// What the acting quantities are before a shift, by what is learnt alone.
    fn of_car(&self, acting: &Acting<T>) -> Known<T> {
        let mut known = acting.known(|i, j| self.covariance.get(i)?.get(j).copied());
        known.mean = core::array::from_fn(|a| {
            let mean = acting.place(a).and_then(|place| self.mean.get(place).copied());
            acting.per_unit(a).0 * mean.unwrap_or(T::zero())
        });
        known
    }

    /// What the acting quantities are before a shift: mean and covariance of what is learnt and of the budget together.
    pub(super) fn known(&self, acting: &Acting<T>, correlations: &Correlations<T>) -> Known<T> {
        let (mut known, budget) = (self.of_car(acting), acting.known(|i, j| Some(unlearnt(correlations, i, j))));
        let car = self.probability();
        let rest = T::one() - car;
        let mean = known.mean;
        for (a, row) in known.covariance.iter_mut().enumerate() {
            for (b, value) in row.iter_mut().enumerate() {
                *value = car * *value + rest * (budget.covariance[a][b] + car * mean[a] * mean[b]);
            }
        }
        known.mean = mean.map(|mean| car * mean);
        known
    }

    /// The mean of [`Self::known`].
    pub(super) fn known_mean(&self, acting: &Acting<T>) -> [T; ACTING] {
        let car = self.probability();
        core::array::from_fn(|a| {
            let learnt = acting.places[a].and_then(|place| self.mean.get(place).copied());
            car * acting.per_unit(a).0 * learnt.unwrap_or(T::zero())
        })
    }

    /// Probability of what is learnt against any car of the budget.
    fn probability(&self) -> T {
        (T::one() + (-self.odds).exp()).recip()
    }

    /// What a new drive begins with. What was learnt may be of another car, or of a bad log: it is the mean and covariance of it
    /// and of the budget together, with even odds, and each shift of the drive is held against both anew.
    pub(super) fn doubted(&self, correlations: &Correlations<T>) -> Self {
        let half = T::of(0.5);
        let mut doubted = Self { mean: self.mean.map(|mean| half * mean), odds: T::zero(), ..*self };
        for (i, row) in doubted.covariance.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = half * (*value + unlearnt(correlations, i, j) + half * self.mean[i] * self.mean[j]);
            }
        }
        doubted
    }

    /// Takes what a shift has shown: the acting quantities as they were before it, and after it. Whether it was taken.
    pub(super) fn take(
        &mut self,
        acting: &Acting<T>,
        before: &Known<T>,
        after: &Known<T>,
        correlations: &Correlations<T>,
    ) -> bool {
        let shown = Shown::of(acting, before, after, correlations);
        shown.is_some_and(|shown| self.take_shown(acting, shown, correlations))
    }

    /// Takes what a shift has shown. Whether it was taken.
    pub(super) fn take_shown(&mut self, acting: &Acting<T>, shown: Shown<T>, correlations: &Correlations<T>) -> bool {
        let Shown { gain, by_budget } = shown;
        let by_car = Innovation::of(|k| self.mean[k], |i, j| self.covariance[i][j], acting, &gain);
        let Some(by_car) = by_car else { return false };
        let mut by = &by_car;
        // What no car of the budget shows speaks for none.
        if !by_budget.is_possible() {
            return false;
        }
        let (maximum, of_shift) = (T::of(ODDS_MAX), T::of(ODDS_OF_SHIFT));
        self.odds = self.odds + (by_car.likelihood - by_budget.likelihood).max(-of_shift).min(of_shift);
        self.odds = self.odds.min(maximum);
        if self.odds < -maximum {
            self.forget(correlations);
            by = &by_budget;
        }
        if !by.is_possible() {
            return false;
        }
        self.correct(by, acting.in_shift);
        true
    }

    /// Corrects all quantities: `theta + W e`, `P - w W W'`. The product is made of two equal factors, so that `P` stays
    /// symmetric to the last digit. A shift that says more than is likely counts for less, by `w`. What a shift does not correct keeps its
    /// mean and its covariance.
    fn correct(&mut self, by: &Innovation<T>, in_shift: bool) {
        let is_kept = |k: usize| in_shift && is_considered(k);
        let weight = (T::of(LIKELY) / by.distance.max(T::of(LIKELY))).sqrt();
        let root = weight.sqrt();
        for (k, (mean, with)) in self.mean.iter_mut().zip(&by.with).enumerate().filter(|(k, _)| !is_kept(*k)) {
            let edge = T::of(edge(k));
            *mean = (*mean + weight * dot(with, &by.innovation)).max(-edge).min(edge);
        }
        // In a gear one direction is seen, in a shift some.
        for direction in 0..ACTING {
            let with = by.with.each_ref().map(|row| root * row[direction]);
            for (i, (row, own)) in
                self.covariance.iter_mut().zip(&with).enumerate().filter(|(_, of)| *of.1 != T::zero())
            {
                for (j, (p, other)) in row.iter_mut().zip(&with).enumerate() {
                    if !(is_kept(i) && is_kept(j)) {
                        *p = *p - *own * *other;
                    }
                }
            }
        }
        let variances = self.covariance.iter_mut().enumerate().filter_map(|(k, row)| Some((k, row.get_mut(k)?)));
        for (_, variance) in variances.filter(|(k, variance)| **variance < T::one() && !is_kept(*k)) {
            *variance = *variance + T::of(PER_SHIFT);
        }
    }

    /// Counts a shift that was taken, or refused; after many refused ones in a row all is forgotten.
    pub(super) fn count(&mut self, taken: bool, correlations: &Correlations<T>) {
        if taken {
            (self.shifts, self.refused) = (self.shifts.saturating_add(1), 0);
        } else {
            self.refused = self.refused.saturating_add(1);
        }
        if self.refused >= REFUSED_MAX {
            self.forget(correlations);
        }
    }

    /// Lets time pass: what was learnt fades.
    pub(super) fn pass(&mut self, dt_s: T, correlations: &Correlations<T>) {
        let one = T::one();
        let [oil, inertia] = [WITH_OIL_S, INERTIA_S].map(|s| (-dt_s / T::of(s)).exp());
        let lasts = |k: usize| (INERTIA_AT..TURBINE_AT).contains(&k) || (STIFFNESS_AT..REPORTED_AT).contains(&k);
        let stay = |k: usize| if lasts(k) { inertia } else { oil };
        for i in 0..LEARNT {
            self.mean[i] = stay(i) * self.mean[i];
            for j in 0..=i {
                let both = stay(i) * stay(j);
                let passed = both * self.covariance[i][j] + (one - both) * unlearnt(correlations, i, j);
                (self.covariance[i][j], self.covariance[j][i]) = (passed, passed);
            }
        }
    }

    /// Takes a temperature of the oil, degC, and returns the time in which as much would be forgotten, s.
    pub(super) fn take_oil(&mut self, degc: T) -> T {
        if !is_oil(degc) {
            return T::zero();
        }
        let change = self.oil_degc.map_or(T::zero(), |before| (degc - before).abs());
        if self.oil_degc.is_none() || change >= T::of(OIL_STEP_K) {
            self.oil_degc = Some(degc);
            return change * T::of(WITH_OIL_S / OIL_K);
        }
        T::zero()
    }

    /// Whether all are numbers within their bounds, and the covariance is one.
    fn is_sound(&self) -> bool {
        let within = |value: T, maximum: f64| value.abs() <= T::of(maximum);
        let means = self.mean.iter().enumerate().all(|(k, &mean)| within(mean, edge(k)));
        let symmetric = (0..LEARNT).all(|i| (0..i).all(|j| self.covariance[i][j] == self.covariance[j][i]));
        let variances = (0..LEARNT).all(|i| within(self.covariance[i][i], VARIANCE_MAX));
        let oil = self.oil_degc.is_none_or(is_oil);
        means && symmetric && variances && oil && within(self.odds, ODDS_MAX) && is_positive(self.covariance)
    }

    /// What was read from a file, or `None` if it cannot be what a filter has learnt: not numbers, outside the bounds, or no
    /// covariance.
    pub fn checked(self) -> Option<Self> {
        self.is_sound().then_some(self)
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> Learnt<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Learnt {
            mean: self.mean.map(to),
            covariance: self.covariance.map(|row| row.map(to)),
            shifts: self.shifts,
            refused: self.refused,
            odds: to(self.odds),
            oil_degc: self.oil_degc.map(to),
        }
    }
}

/// Places of lag and delay of the valve of an element.
#[inline(always)]
fn timing_places(at: usize) -> Option<[usize; 2]> {
    (at < MAX_ELEMENTS).then(|| [LAG_AT, DELAY_AT].map(|first| (first + at).min(LEARNT - 1)))
}

/// Whether oil can have this temperature, degC.
fn is_oil<T: Real>(degc: T) -> bool {
    let [minimum, maximum] = OIL_DEGC.map(T::of);
    minimum <= degc && degc <= maximum
}

/// Bound of a quantity in its standard deviations.
pub(super) fn edge(k: usize) -> f64 {
    match k {
        0..INERTIA_AT => EDGE_OF_TWO,
        LAG_AT.. => EDGE_OF_TIMING,
        _ => EDGE,
    }
}

/// Covariance of two quantities unlearnt.
fn unlearnt<T: Real>(correlations: &Correlations<T>, i: usize, j: usize) -> T {
    match i.abs_diff(j) {
        0 => T::one(),
        _ if i.max(j) < KISS_AT => T::of(COMMON),
        _ if i.min(j) >= INERTIA_AT && i.max(j) < TURBINE_AT => T::of(COMMON_INERTIA),
        KISS_AT if i.max(j) < INERTIA_AT => correlations.get(i.min(j)).copied().unwrap_or(T::zero()),
        _ => T::zero(),
    }
}

/// What a shift has shown, and the innovation of it in a car of the budget.
pub(super) struct Shown<T> {
    gain: InformationGain<T>,
    pub(super) by_budget: Innovation<T>,
}

impl<T: Real> Shown<T> {
    /// From the acting quantities as they were before the shift, and after it; `None` if these are not means and covariances.
    pub(super) fn of(
        acting: &Acting<T>,
        before: &Known<T>,
        after: &Known<T>,
        correlations: &Correlations<T>,
    ) -> Option<Self> {
        let gain = InformationGain::between(before, after)?;
        let by_budget = Innovation::of(|_| T::zero(), |i, j| unlearnt(correlations, i, j), acting, &gain)?;
        Some(Self { gain, by_budget })
    }

    /// The innovation by acting quantities of this size in a car of the budget.
    pub(super) fn per_quantity(&self, acting: &[T; ACTING]) -> [T; ACTING] {
        let values = self.gain.rows.each_ref().map(|row| dot(row, acting));
        self.by_budget.whitening.each_ref().map(|row| dot(row, &values))
    }
}

/// What a shift has shown beside what was known, in independent directions of variance one.
pub(super) struct Innovation<T> {
    pub(super) innovation: [T; ACTING],
    /// These directions, by those of the measurements.
    whitening: Matrix<T>,
    /// Covariance of all quantities with each of them.
    with: [[T; ACTING]; LEARNT],
    /// Squared distance from what was known.
    distance: T,
    /// Logarithm of the likelihood, but for what does not depend on what was known.
    likelihood: T,
}

impl<T: Real> Innovation<T> {
    /// Whether it is near enough to what was known to be of the same car.
    fn is_possible(&self) -> bool {
        self.distance <= T::of(GATE)
    }

    /// By this mean and covariance of all.
    fn of(
        mean: impl Fn(usize) -> T,
        covariance_of_all: impl Fn(usize, usize) -> T,
        acting: &Acting<T>,
        gain: &InformationGain<T>,
    ) -> Option<Self> {
        let seen: [[T; ACTING]; LEARNT] = core::array::from_fn(|k| acting.seen(|place| covariance_of_all(k, place)));
        // `(H, s) P (H, s)' + D`, by its rows: `seen` is `P (H, s)'`.
        let mut covariance: Matrix<T> = core::array::from_fn(|b| acting.seen(|place| seen[place][b]));
        for (a, row) in covariance.iter_mut().enumerate() {
            row[a] = row[a] + acting.per_unit(a).1;
        }
        let mut noisy = around(&gain.rows, &covariance);
        for (k, row) in noisy.iter_mut().enumerate() {
            row[k] = row[k] + T::one();
        }
        let lower = cholesky(&noisy)?;
        let inverse = lower_inverse(&lower);
        let expected = acting.seen(mean);
        let beside: [T; ACTING] = core::array::from_fn(|i| gain.values[i] - dot(&gain.rows[i], &expected));
        let innovation = inverse.map(|row| dot(&row, &beside));
        let with = seen.map(|row| {
            let by_value = gain.rows.map(|of| dot(&of, &row));
            inverse.map(|row| dot(&row, &by_value))
        });
        let distance = dot(&innovation, &innovation);
        let spread = (0..ACTING).fold(T::zero(), |sum, k| sum + lower[k][k].ln());
        Some(Self { innovation, whitening: inverse, with, distance, likelihood: -T::of(0.5) * distance - spread })
    }
}

#[cfg(test)]
mod tests;
