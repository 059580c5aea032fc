//! The covariance of the states and of the speeds at earlier times.

use drivetrain::Real;

use super::past::{CLONES, PASTS, SPEEDS};
use super::powertrain::{COLUMNS, LAWS, Tangent};
use super::{FRICTION, GAIN, N, OFFGOING, OUTPUT, PRESSURE, SHARE, TURBINE, WHEEL};

/// The states, and after them the speeds at earlier times.
pub(super) const ALL: usize = N + CLONES;

/// States of which a correction may take a share only: the last ones, from [`SHARE`] on.
pub(super) const CONSIDERED: usize = N - SHARE;

/// Covariance of the states and, after them, of the speeds at earlier times.
///
/// The oldest speeds of turbine and output may be left out: most readings are newer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Covariance<T> {
    /// Kept up to date on and above the diagonal.
    upper: [[T; ALL]; ALL],
    /// Whether the oldest speeds of turbine and output are kept up to date, too.
    whole: bool,
}

/// A scalar measurement: the covariance of all with it, and its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured<'a, T> {
    pub(super) with: &'a [T; ALL],
    pub(super) variance: T,
}

/// All but the oldest speeds of turbine and output.
const KEPT: usize = ALL - 2;

/// The place of the speed `k` at a point in time, counted from 0 for now.
#[inline(always)]
pub(super) const fn speed_at(k: usize, point: usize) -> usize {
    match (point, k) {
        (0, _) => k,
        (1, _) => N + 1 + k,
        (_, WHEEL) => N,
        (_, TURBINE) => KEPT,
        (_, _) => KEPT + 1,
    }
}
/// Place of the newest past of the first speed.
const NEWEST: usize = speed_at(0, 1);
const _: () = assert!(PASTS == 2 && SPEEDS == 3 && speed_at(OUTPUT, 2) == ALL - 1);

impl<T: Real> Covariance<T> {
    /// Independent states with these standard deviations, without a past.
    pub(super) fn of(deviations: [T; N]) -> Self {
        let mut covariance = Self { upper: [[T::zero(); ALL]; ALL], whole: true };
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
            let place = speed_at(k, m / SPEEDS + 1);
            for i in 0..N {
                self.set(i, place, self.at(i, k));
            }
            for l in 0..=m {
                let same = if l % SPEEDS == k { acceleration_variances[k] } else { T::zero() };
                let with = self.at(k, l % SPEEDS) + same * age_s * ages[l / SPEEDS];
                self.set(speed_at(l % SPEEDS, l / SPEEDS + 1), place, with);
            }
        }
    }

    /// The speeds of now become the newest of the past, and those of turbine and output the oldest only if it is to be `whole`.
    #[inline]
    pub(super) fn remember(&mut self, whole: bool) {
        if whole {
            self.repeat::<{ speed_at(TURBINE, 1) }, { speed_at(TURBINE, 2) }>();
            self.repeat::<{ speed_at(OUTPUT, 1) }, { speed_at(OUTPUT, 2) }>();
        }
        self.repeat::<{ speed_at(WHEEL, 1) }, { speed_at(WHEEL, 2) }>();
        self.repeat::<WHEEL, { speed_at(WHEEL, 1) }>();
        self.repeat::<OUTPUT, { speed_at(OUTPUT, 1) }>();
        self.repeat::<TURBINE, { speed_at(TURBINE, 1) }>();
        self.whole = whole;
    }

    /// Makes another the same as one.
    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "with an iterator over rows it takes four times the instructions")]
    fn repeat<const ONE: usize, const SAME: usize>(&mut self) {
        let p = &mut self.upper;
        for i in 0..ONE.min(SAME) {
            p[i][SAME] = p[i][ONE];
        }
        if ONE < SAME {
            for i in ONE..SAME {
                p[i][SAME] = p[ONE][i];
            }
        } else {
            for i in SAME + 1..=ONE {
                p[SAME][i] = p[i][ONE];
            }
        }
        p[SAME][SAME] = p[ONE][ONE];
        for i in ONE.max(SAME) + 1..ALL {
            p[SAME][i] = p[ONE][i];
        }
    }

    /// `P = F P F'` of a step: the first states have a law, four others fade, the rest stands. Whether the newest of the past
    /// are the speeds at its start is `remembered`.
    #[inline]
    pub(super) fn spread(&mut self, step: &Tangent<T>, remembered: bool) {
        let p = &mut self.upper;
        // The step takes whole rows of the states that it depends on.
        for i in 1..COLUMNS {
            let (above, below) = p.split_at_mut(i);
            for (value, row) in below[0].iter_mut().zip(above) {
                *value = row[i];
            }
        }
        // `F P`; the newest of the past are among its columns where they are the speeds at the start.
        if remembered {
            first_product::<T, 0, NEWEST>(p, step);
            for row in p.iter_mut().take(LAWS) {
                for k in 0..SPEEDS {
                    row[NEWEST + k] = row[k];
                }
            }
            if self.whole {
                first_product::<T, KEPT, ALL>(p, step);
            }
        } else {
            first_product::<T, 0, ALL>(p, step);
        }
        // `(F P) F'`.
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
    ///
    /// The oldest speeds of turbine and output stay, where they are left out.
    #[inline(always)]
    pub(super) fn correct(&mut self, measured: &Measured<'_, T>, shares: &[T; CONSIDERED]) -> [T; ALL] {
        let per_variance = measured.variance.recip();
        let mut gain = measured.with.map(|with| with * per_variance);
        // What of the considered states' best gain is not taken: `R/V`, and `R`.
        let left: [T; CONSIDERED] = core::array::from_fn(|a| T::one() - shares[a]);
        let back = [
            core::array::from_fn(|a| left[a] * gain[SHARE + a]),
            core::array::from_fn(|a| left[a] * measured.with[SHARE + a]),
        ];
        if self.whole {
            subtract_product::<T, ALL>(&mut self.upper, &gain, measured.with, &back);
        } else {
            subtract_product::<T, KEPT>(&mut self.upper, &gain, measured.with, &back);
            gain[KEPT..].fill(T::zero());
        }
        for (gain, back) in gain[SHARE..].iter_mut().zip(&back[0]) {
            *gain = *gain - *back;
        }
        gain
    }

    /// Whether the speed `k` at a point in time is kept up to date.
    #[inline]
    pub(super) fn keeps(&self, k: usize, point: usize) -> bool {
        self.whole || speed_at(k, point) < KEPT
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

/// Columns of `F P`.
#[inline(always)]
fn first_product<T: Real, const FIRST: usize, const END: usize>(p: &mut [[T; ALL]; ALL], step: &Tangent<T>) {
    for c in FIRST..END {
        let next = step.of(&core::array::from_fn(|i| p[i][c]));
        for (row, next) in p.iter_mut().zip(next) {
            row[c] = next;
        }
    }
}

/// Subtracts `x y'`, which is symmetric, on and above the diagonal of the first `END`, and between considered states gives
/// the product of `back` back.
///
/// Most of the filter's time is spent here. Each row has its own length, known at compile time, so that the compiler writes
/// it without a loop.
fn subtract_product<T: Real, const END: usize>(
    upper: &mut [[T; ALL]; ALL],
    x: &[T; ALL],
    y: &[T; ALL],
    back: &[[T; CONSIDERED]; 2],
) {
    #[inline(always)]
    fn row<T: Real, const I: usize, const END: usize>(
        row: &mut [T; ALL],
        x: &[T; ALL],
        y: &[T; ALL],
        [x_back, y_back]: &[[T; CONSIDERED]; 2],
    ) {
        // In gear the pressure, and what belongs to it, has to do with no reading.
        if matches!(I, PRESSURE | FRICTION | GAIN) && x[I] == T::zero() {
            return;
        }
        for j in I..END {
            let left = row[j] - x[I] * y[j];
            row[j] = if I >= SHARE && j < N { left + x_back[I - SHARE] * y_back[j - SHARE] } else { left };
        }
    }
    macro_rules! rows {
        ($($i:literal)*) => {
            const { assert!(ALL == [$($i),*].len(), "one row each") };
            $(row::<T, $i, END>(&mut upper[$i], x, y, back);)*
        };
    }
    rows!(0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18);
}

#[cfg(test)]
mod tests {
    use super::super::powertrain::tests::step;
    use super::super::{LOAD, SPRING};
    use super::*;

    /// A covariance of full rank with entries of any size.
    fn any() -> Covariance<f64> {
        let mut seed = 1_u32;
        let factors: [[f64; ALL]; ALL] = core::array::from_fn(|_| {
            core::array::from_fn(|_| {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(seed) / f64::from(u32::MAX) - 0.5
            })
        });
        let mut covariance = Covariance::of([0.0; N]);
        for i in 0..ALL {
            for j in i..ALL {
                covariance.upper[i][j] = (0..ALL).map(|k| factors[i][k] * factors[j][k]).sum();
            }
        }
        covariance
    }

    fn tangent() -> Tangent<f64> {
        let mut x = [0.0; N];
        (x[TURBINE], x[OUTPUT], x[WHEEL], x[SPRING], x[LOAD]) = (300.0, 120.0, 40.5, 900.0, 700.0);
        let step = step();
        step.tangent(&x, &step.propagate(&x))
    }

    fn assert_alike(one: &Covariance<f64>, other: &Covariance<f64>, end: usize) {
        for i in 0..end {
            for j in i..end {
                let (a, b) = (one.at(i, j), other.at(i, j));
                assert!((a - b).abs() <= 1e-9 * (a.abs() + b.abs()).max(1.0), "{i} {j}: {a} {b}");
            }
        }
    }

    #[test]
    fn the_newest_past_after_a_step_is_its_start() {
        let (mut covariance, step) = (any(), tangent());
        covariance.remember(true);
        assert!((0..ALL).all(|i| covariance.at(i, speed_at(OUTPUT, 1)) == covariance.at(i, OUTPUT)));
        let mut each = covariance;
        covariance.spread(&step, true);
        each.spread(&step, false);
        assert_alike(&covariance, &each, ALL);
    }

    #[test]
    fn what_is_left_out_changes_nothing_of_the_rest() {
        let (mut whole, step, shares) = (any(), tangent(), [0.0, 0.3, 0.0, 1.0, 0.05, 1.0]);
        let mut rest = whole;
        for k in [TURBINE, OUTPUT, WHEEL, TURBINE] {
            for (covariance, is_whole) in [(&mut whole, true), (&mut rest, false)] {
                covariance.remember(is_whole);
                covariance.spread(&step, true);
                let with = core::array::from_fn(|i| 0.7 * covariance.at(i, k) + 0.3 * covariance.at(i, speed_at(k, 1)));
                let variance = 0.7 * with[k] + 0.3 * with[speed_at(k, 1)] + 0.1;
                let gain = covariance.correct(&Measured { with: &with, variance }, &shares);
                assert_eq!(gain[speed_at(TURBINE, 2)] == 0.0, !is_whole);
            }
            assert_alike(&whole, &rest, KEPT);
        }
        // As soon as a reading needs them again, they are there.
        whole.remember(true);
        rest.remember(true);
        assert_alike(&whole, &rest, ALL);
    }
}
