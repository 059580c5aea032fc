//! The covariance of the states and of the speeds at earlier times.

use drivetrain::Real;

use super::past::{CLONES, PASTS, SPEEDS};
use super::powertrain::{COLUMNS, LAWS, Tangent};
use super::{FRICTION, GAIN, N, OFFGOING, PRESSURE, SHARE};

/// The states, and after them the speeds at earlier times.
pub(super) const ALL: usize = N + CLONES;

/// States of which a correction may take a share only: the last ones, from [`SHARE`] on.
pub(super) const CONSIDERED: usize = N - SHARE;

/// Covariance of the states and, after them, of the speeds at earlier times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Covariance<T> {
    /// Kept up to date on and above the diagonal.
    upper: [[T; ALL]; ALL],
}

/// A scalar measurement: the covariance of all with it, and its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured<'a, T> {
    pub(super) with: &'a [T; ALL],
    pub(super) variance: T,
}

/// The place of the speed `k` at a point in time, counted from 0 for now.
#[inline]
pub(super) fn speed_at(k: usize, point: usize) -> usize {
    match point.checked_sub(1) {
        None => k,
        Some(n) => (N + SPEEDS * n + k).min(ALL - 1),
    }
}

impl<T: Real> Covariance<T> {
    /// Independent states with these standard deviations, without a past.
    pub(super) fn of(deviations: [T; N]) -> Self {
        let mut covariance = Self { upper: [[T::zero(); ALL]; ALL] };
        for (i, deviation) in deviations.into_iter().enumerate() {
            covariance.upper[i][i] = deviation * deviation;
        }
        covariance
    }

    /// One entry.
    #[inline]
    pub(super) fn at(&self, i: usize, j: usize) -> T {
        self.upper[i.min(j).min(ALL - 1)][i.max(j).min(ALL - 1)]
    }

    /// Replaces one entry.
    #[inline]
    pub(super) fn set(&mut self, i: usize, j: usize, value: T) {
        self.upper[i.min(j).min(ALL - 1)][i.max(j).min(ALL - 1)] = value;
    }

    /// Adds a multiple of a row.
    #[inline]
    pub(super) fn add_row<const ROW: usize>(&self, sum: &mut [T; ALL], weight: T) {
        if weight == T::zero() {
            return;
        }
        for (i, sum) in sum.iter_mut().enumerate() {
            *sum = *sum + weight * self.entry::<ROW>(i);
        }
    }

    /// The sum of multiples of two rows.
    #[inline(always)]
    pub(super) fn sum_of<const A: usize, const B: usize>(&self, [a, b]: [T; 2]) -> [T; ALL] {
        core::array::from_fn(|i| a * self.entry::<A>(i) + b * self.entry::<B>(i))
    }

    /// The sum of multiples of four rows.
    #[inline(always)]
    pub(super) fn sum_of_four<const A: usize, const B: usize, const C: usize, const D: usize>(
        &self,
        [a, b, c, d]: [T; 4],
    ) -> [T; ALL] {
        core::array::from_fn(|i| {
            a * self.entry::<A>(i) + b * self.entry::<B>(i) + c * self.entry::<C>(i) + d * self.entry::<D>(i)
        })
    }

    /// An entry of a row that is known when this is compiled.
    #[inline(always)]
    fn entry<const ROW: usize>(&self, i: usize) -> T {
        if i < ROW { self.upper[i][ROW] } else { self.upper[ROW][i] }
    }

    /// A past of these ages: the speeds were as uncertain as now, and have changed by accelerations with these variances.
    pub(super) fn steady_past(&mut self, ages: [T; PASTS], acceleration_variances: [T; SPEEDS]) {
        for m in 0..CLONES {
            let (age_s, k) = (ages[m / SPEEDS], m % SPEEDS);
            for i in 0..N {
                self.set(i, N + m, self.at(i, k));
            }
            for l in 0..=m {
                let same = if l % SPEEDS == k { acceleration_variances[k] } else { T::zero() };
                self.set(N + l, N + m, self.at(k, l % SPEEDS) + same * age_s * ages[l / SPEEDS]);
            }
        }
    }

    /// The speeds of now become the newest of the past.
    #[inline]
    pub(super) fn remember(&mut self) {
        let p = &mut self.upper;
        for row in p.iter_mut().take(N) {
            for m in (N + SPEEDS..ALL).rev() {
                row[m] = row[m - SPEEDS];
            }
        }
        for m in (N + SPEEDS..ALL).rev() {
            for l in (m..ALL).rev() {
                p[m][l] = p[m - SPEEDS][l - SPEEDS];
            }
        }
        for k in 0..SPEEDS {
            for l in k..SPEEDS {
                p[N + k][N + l] = p[k][l];
            }
            for m in SPEEDS..CLONES {
                p[N + k][N + m] = p[k][N + m];
            }
            for i in 0..N {
                p[i][N + k] = p[i.min(k)][i.max(k)];
            }
        }
    }

    /// `P = F P F'` of a step: the first states have a law, four others fade, the rest stands.
    #[inline]
    pub(super) fn spread(&mut self, step: &Tangent<T>) {
        let p = &mut self.upper;
        // The step takes whole rows of the states that it depends on.
        for i in 1..COLUMNS {
            let (above, below) = p.split_at_mut(i);
            for (value, row) in below[0].iter_mut().zip(above) {
                *value = row[i];
            }
        }
        for c in 0..ALL {
            let next = step.of(&core::array::from_fn(|i| p[i][c]));
            for (row, next) in p.iter_mut().zip(next) {
                row[c] = next;
            }
        }
        for c in 0..LAWS {
            let next = step.of(&core::array::from_fn(|i| p[c][i]));
            for (row, next) in p.iter_mut().zip(next).take(c + 1) {
                row[c] = next;
            }
        }
        self.fade::<OFFGOING>(step.keep);
        self.fade::<SHARE>(step.stay);
        self.fade::<FRICTION>(step.last);
        self.fade::<GAIN>(step.last);
    }

    /// Leaves a share of a state.
    #[inline]
    fn fade<const STATE: usize>(&mut self, left: T) {
        if left == T::one() {
            return;
        }
        for row in self.upper.iter_mut().take(STATE + 1) {
            row[STATE] = left * row[STATE];
        }
        for value in &mut self.upper[STATE][STATE..] {
            *value = left * *value;
        }
    }

    /// Adds to the variance of a state.
    #[inline]
    pub(super) fn add(&mut self, state: usize, variance: T) {
        self.upper[state][state] = self.upper[state][state] + variance;
    }

    /// Keeps the variance of a state from falling below a limit.
    #[inline]
    pub(super) fn hold_above(&mut self, state: usize, variance: T) {
        let own = &mut self.upper[state][state];
        *own = own.at_least(variance);
    }

    /// Makes a state independent of all others, with this standard deviation.
    pub(super) fn renew(&mut self, state: usize, deviation: T) {
        for i in 0..ALL {
            self.set(i, state, T::zero());
        }
        self.upper[state][state] = deviation * deviation;
    }

    /// Corrects for a measurement by Joseph's form `P - K S' - S K' + K V K'`, which holds for any gain, and returns the gain.
    /// Of the best gain each of the considered states gets a share; with none its uncertainty is accounted for and stays.
    ///
    /// With `K = a S/V`, each entry of `S` with its own share `a`, the form is `P - (S S' - R R')/V` with `R = (1 - a) S`.
    #[inline(always)]
    pub(super) fn correct(&mut self, measured: &Measured<'_, T>, shares: &[T; CONSIDERED]) -> [T; ALL] {
        let per_variance = measured.variance.recip();
        let mut gain = measured.with.map(|with| with * per_variance);
        // What of the considered states' best gain is not taken.
        let left: [T; CONSIDERED] = core::array::from_fn(|a| T::one() - shares[a]);
        subtract_product(&mut self.upper, &gain, measured.with, &left);
        for (gain, share) in gain[SHARE..].iter_mut().zip(shares) {
            *gain = *share * *gain;
        }
        gain
    }

    /// The covariance of some states.
    pub(super) fn block<const K: usize>(&self, states: [usize; K]) -> [[T; K]; K] {
        states.map(|i| states.map(|j| self.at(i, j)))
    }

    /// Whether all variances are numbers and none is negative.
    #[inline]
    pub(super) fn is_sound(&self) -> bool {
        let (mut sum, mut least) = (T::zero(), T::zero());
        for i in 0..N {
            let own = self.upper[i][i];
            sum = sum + own;
            least = least.at_most(own);
        }
        // A sum with a number that is not finite is not finite.
        least >= T::zero() && sum.is_finite()
    }
}

/// Subtracts `x y'`, which is symmetric, on and above the diagonal; between two considered states less, as `left` says.
///
/// Most of the filter's time is spent here. Each row has its own length, known at compile time, so that the compiler writes
/// it without a loop.
fn subtract_product<T: Real>(upper: &mut [[T; ALL]; ALL], x: &[T; ALL], y: &[T; ALL], left: &[T; CONSIDERED]) {
    #[inline(always)]
    fn row<T: Real, const I: usize>(row: &mut [T; ALL], x: &[T; ALL], y: &[T; ALL], left: &[T; CONSIDERED]) {
        // In gear the pressure, and what belongs to it, has to do with no reading.
        if matches!(I, PRESSURE | FRICTION | GAIN) && x[I] == T::zero() {
            return;
        }
        for j in I..ALL {
            row[j] = row[j] - x[I] * y[j];
        }
        if (SHARE..N).contains(&I) && left[I - SHARE] != T::zero() {
            let back = left[I - SHARE] * x[I];
            for j in I..N {
                row[j] = row[j] + back * left[j - SHARE] * y[j];
            }
        }
    }
    macro_rules! rows {
        ($($i:literal)*) => {
            const { assert!(ALL == [$($i),*].len(), "one row each") };
            $(row::<T, $i>(&mut upper[$i], x, y, left);)*
        };
    }
    rows!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18);
}
