//! The covariance of the states, and that of the speeds at an earlier time with them.

use drivetrain::Real;

use super::past::SPEEDS;
use super::powertrain::{COLUMNS, LAWS, Tangent};
use super::states::{DELAY, FRACTION, FRICTION, GAIN, N, OFFGOING, PRESSURE, SCALE, SKEW, WHEEL};

/// States of which a correction may take a fraction only: the last ones, from [`FRACTION`] on.
pub(super) const CONSIDERED: usize = N - FRACTION;

const _: () = assert!(SPEEDS <= LAWS, "the speeds are the first states");

/// Covariance of the states, and of the speeds at an earlier time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Covariance<T> {
    /// Of the states, kept up to date on and above the diagonal.
    upper: [[T; N]; N],
    /// Of each earlier speed with the states.
    earlier: [[T; N]; SPEEDS],
    /// Of the earlier speeds, kept up to date on and above the diagonal.
    among: [[T; SPEEDS]; SPEEDS],
}

/// A scalar measurement: the covariance of states and earlier speeds with it, and its variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured<T> {
    pub(super) with: [T; N],
    pub(super) earlier: [T; SPEEDS],
    pub(super) variance: T,
}

/// How states and earlier speeds move by a correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moves<T> {
    pub(super) states: [T; N],
    pub(super) earlier: [T; SPEEDS],
}

/// What a measurement of a speed depends on: factors on it, on the earlier one, and on scale, wheel delay and
/// skew.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row<T> {
    pub(super) now: T,
    pub(super) earlier: T,
    pub(super) learnt: [T; 3],
}

impl<T: Real> Covariance<T> {
    /// Independent states with these standard deviations, without a past.
    pub(super) fn of(std_devs: [T; N]) -> Self {
        let zero = T::zero();
        let mut upper = [[zero; N]; N];
        for (i, std_dev) in std_devs.into_iter().enumerate() {
            upper[i][i] = std_dev * std_dev;
        }
        Self { upper, earlier: [[zero; N]; SPEEDS], among: [[zero; SPEEDS]; SPEEDS] }
    }

    /// One entry.
    #[inline]
    pub(super) fn at(&self, i: usize, j: usize) -> T {
        self.upper[i.min(j).min(N - 1)][i.max(j).min(N - 1)]
    }

    /// Replaces one entry.
    #[inline]
    pub(super) fn set(&mut self, i: usize, j: usize, value: T) {
        self.upper[i.min(j).min(N - 1)][i.max(j).min(N - 1)] = value;
    }

    /// The covariance of all with a multiple of a state; the variance is still to be given.
    #[inline]
    pub(super) fn with_state<const ROW: usize>(&self, weight: T) -> Measured<T> {
        Measured {
            with: core::array::from_fn(|i| weight * self.entry::<ROW>(i)),
            earlier: core::array::from_fn(|k| weight * self.earlier[k][ROW]),
            variance: T::zero(),
        }
    }

    /// The covariance of all with the sum of multiples of two states; the variance is still to be given.
    #[inline(always)]
    pub(super) fn with_two<const A: usize, const B: usize>(&self, [a, b]: [T; 2]) -> Measured<T> {
        Measured {
            with: core::array::from_fn(|i| a * self.entry::<A>(i) + b * self.entry::<B>(i)),
            earlier: core::array::from_fn(|k| a * self.earlier[k][A] + b * self.earlier[k][B]),
            variance: T::zero(),
        }
    }

    /// A measurement of the speed `K` by this row.
    #[inline(always)]
    pub(super) fn measured<const K: usize>(&self, row: &Row<T>, noise: T) -> Measured<T> {
        let (zero, [scale, delay, skew], earlier) = (T::zero(), row.learnt, &self.earlier[K]);
        let mut measured = Measured {
            with: core::array::from_fn(|i| row.now * self.entry::<K>(i) + row.earlier * earlier[i]),
            earlier: core::array::from_fn(|k| {
                row.now * self.earlier[k][K] + row.earlier * self.among[k.min(K)][k.max(K)]
            }),
            variance: noise,
        };
        if K == WHEEL {
            self.add_state::<SCALE>(&mut measured, scale);
            self.add_state::<DELAY>(&mut measured, delay);
        }
        if skew != zero {
            self.add_state::<SKEW>(&mut measured, skew);
        }
        let with = &measured.with;
        let by_learnt = scale * with[SCALE] + delay * with[DELAY] + skew * with[SKEW];
        let own = row.now * with[K] + row.earlier * measured.earlier[K] + by_learnt;
        measured.variance = noise + own.at_least(zero);
        measured
    }

    /// Adds the covariance of all with a multiple of a state.
    #[inline(always)]
    fn add_state<const ROW: usize>(&self, measured: &mut Measured<T>, weight: T) {
        for (i, with) in measured.with.iter_mut().enumerate() {
            *with = *with + weight * self.entry::<ROW>(i);
        }
        for (with, earlier) in measured.earlier.iter_mut().zip(&self.earlier) {
            *with = *with + weight * earlier[ROW];
        }
    }

    /// An entry of a row that is known when this is compiled.
    #[inline(always)]
    fn entry<const ROW: usize>(&self, i: usize) -> T {
        if i < ROW { self.upper[i][ROW] } else { self.upper[ROW][i] }
    }

    /// Variance of the change of the speed `k` since the earlier time.
    #[inline]
    pub(super) fn changed<const K: usize>(&self) -> T {
        (self.upper[K][K] - T::of(2.0) * self.earlier[K][K] + self.among[K][K]).at_least(T::zero())
    }

    /// An earlier time this long ago: the speeds were as uncertain as now, and have changed by accelerations with these variances.
    pub(super) fn steady_past(&mut self, age_s: T, acceleration_variances: [T; SPEEDS]) {
        for (k, variance) in acceleration_variances.into_iter().enumerate() {
            self.earlier[k] = core::array::from_fn(|i| self.at(i, k));
            for l in k..SPEEDS {
                self.among[k][l] = self.at(k, l);
            }
            self.among[k][k] = self.among[k][k] + variance * age_s * age_s;
        }
    }

    /// `P = F P F'` of a step: the first states have a law, four others fade, the rest stands. The earlier speeds become those
    /// at its start if these are to be `remembered`.
    #[inline]
    pub(super) fn spread(&mut self, step: &Tangent<T>, remembered: bool) {
        if remembered {
            for k in 0..SPEEDS {
                self.earlier[k][LAWS..].copy_from_slice(&self.upper[k][LAWS..]);
                self.among[k][k..].copy_from_slice(&self.upper[k][k..SPEEDS]);
            }
        } else {
            for earlier in &mut self.earlier {
                let next = step.of(&core::array::from_fn(|i| earlier[i]));
                earlier[..LAWS].copy_from_slice(&next);
            }
        }
        let p = &mut self.upper;
        // The step takes whole rows of the states that it depends on.
        for i in 1..COLUMNS {
            let (above, below) = p.split_at_mut(i);
            for (value, row) in below[0].iter_mut().zip(above) {
                *value = row[i];
            }
        }
        // `F P`; its columns of the speeds are the covariance with those at the start.
        for c in 0..N {
            let next = step.of(&core::array::from_fn(|i| p[i][c]));
            for (row, next) in p.iter_mut().zip(next) {
                row[c] = next;
            }
        }
        if remembered {
            for (k, earlier) in self.earlier.iter_mut().enumerate() {
                for (earlier, row) in earlier.iter_mut().zip(p.iter()).take(LAWS) {
                    *earlier = row[k];
                }
            }
        }
        // `(F P) F'`, whose columns are what the step makes of the rows of `F P`.
        for c in 0..PRESSURE {
            let next = step.of(&core::array::from_fn(|i| p[c][i]));
            for (row, next) in p.iter_mut().zip(next).take(c + 1) {
                row[c] = next;
            }
            p[c][PRESSURE] = next[PRESSURE];
        }
        p[PRESSURE][PRESSURE] = step.pressure(p[PRESSURE][PRESSURE], p[PRESSURE][GAIN]);
        self.fade::<OFFGOING>(step.keep);
        self.fade::<FRACTION>(step.stay);
        self.fade::<FRICTION>(step.last);
        self.fade::<GAIN>(step.last);
    }

    /// Leaves a fraction of a state.
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
        for earlier in &mut self.earlier {
            earlier[STATE] = left * earlier[STATE];
        }
    }

    /// Adds to the variance of a state.
    #[inline]
    pub(super) fn add(&mut self, state: usize, variance: T) {
        self.upper[state][state] = self.upper[state][state] + variance;
    }

    /// Adds to the variance of the speed `K`, now and at the earlier time alike: both err by one unknown offset.
    #[inline]
    pub(super) fn offset<const K: usize>(&mut self, variance: T) {
        for own in [&mut self.upper[K][K], &mut self.earlier[K][K], &mut self.among[K][K]] {
            *own = *own + variance;
        }
    }

    /// Keeps the variance of a state from falling below a limit.
    #[inline]
    pub(super) fn hold_above(&mut self, state: usize, variance: T) {
        let own = &mut self.upper[state][state];
        *own = own.at_least(variance);
    }

    /// Makes a state independent of all others, with this standard deviation.
    pub(super) fn renew(&mut self, state: usize, std_dev: T) {
        let state = state.min(N - 1);
        for i in 0..N {
            self.set(i, state, T::zero());
        }
        for earlier in &mut self.earlier {
            earlier[state] = T::zero();
        }
        self.upper[state][state] = std_dev * std_dev;
    }

    /// Corrects for a measurement by Joseph's form `P - K S' - S K' + K V K'`, which holds for any gain, and returns how all
    /// moves by this innovation. Of the best gain each of the considered states gets a fraction; with none its uncertainty is
    /// accounted for and stays.
    ///
    /// With `K = a S/V`, each entry of `S` with its own fraction `a`, the form is `P - (S S' - R R')/V` with `R = (1 - a) S`.
    ///
    /// Of the earlier speeds only those from `kept` on are needed again. The others move as the speeds now.
    #[inline(always)]
    pub(super) fn correct(
        &mut self,
        measured: &Measured<T>,
        fractions: &[T; CONSIDERED],
        kept: usize,
        innovation: T,
    ) -> Moves<T> {
        let (with, per_variance) = (measured.with, measured.variance.recip());
        let left = core::array::from_fn(|a| (T::one() - fractions[a]) * with[FRACTION + a]);
        subtract_square(&mut self.upper, &with, &left, per_variance);
        let by = innovation * per_variance;
        let states = core::array::from_fn(|i| by * if i < FRACTION { with[i] } else { with[i] - left[i - FRACTION] });
        let mut moves = Moves { states, earlier: core::array::from_fn(|k| states[k]) };
        for k in kept..SPEEDS {
            let gain = measured.earlier[k] * per_variance;
            for (earlier, with) in self.earlier[k].iter_mut().zip(&with) {
                *earlier = *earlier - gain * *with;
            }
            for l in k..SPEEDS {
                self.among[k][l] = self.among[k][l] - gain * measured.earlier[l];
            }
            moves.earlier[k] = innovation * gain;
        }
        moves
    }

    /// The covariance of some states.
    pub(super) fn block<const K: usize>(&self, states: [usize; K]) -> [[T; K]; K] {
        states.map(|i| states.map(|j| self.at(i, j)))
    }

    /// Whether all variances are numbers and none is negative.
    #[inline]
    pub(super) fn is_sound(&self) -> bool {
        let (mut sum, mut sizes) = (T::zero(), T::zero());
        for (i, row) in self.upper.iter().enumerate() {
            sum = sum + row[i];
            sizes = sizes + row[i].abs();
        }
        // A sum with a number that is not finite is not finite, and the sizes add up to the same if none is negative.
        sum == sizes && sum.is_finite()
    }
}

/// Subtracts `x x'` times a factor on and above the diagonal, and between considered states gives `left left'` times it back.
///
/// Much of the filter's time is spent here. Each row has its own length, known at compile time, so that the compiler writes
/// it without a loop.
#[inline(always)]
fn subtract_square<T: Real>(upper: &mut [[T; N]; N], x: &[T; N], left: &[T; CONSIDERED], factor: T) {
    #[inline(always)]
    fn row<T: Real, const I: usize>(row: &mut [T; N], x: &[T; N], left: &[T; CONSIDERED], factor: T) {
        // In gear the pressure, and what belongs to it, has to do with no reading.
        if matches!(I, PRESSURE | FRICTION | GAIN) && x[I] == T::zero() {
            return;
        }
        let own = factor * x[I];
        for j in I..N {
            row[j] = row[j] - own * x[j];
        }
        if I >= FRACTION {
            let own = factor * left[I - FRACTION];
            for j in I..N {
                row[j] = row[j] + own * left[j - FRACTION];
            }
        }
    }
    macro_rules! rows {
        ($($i:literal)*) => {
            const { assert!(N == [$($i),*].len(), "one row each") };
            $(row::<T, $i>(&mut upper[$i], x, left, factor);)*
        };
    }
    rows!(0 1 2 3 4 5 6 7 8 9 10 11 12);
}

#[cfg(test)]
mod tests {
    use super::super::powertrain::tests::step;
    use super::super::states::{LOAD, OUTPUT, SPRING, TURBINE};
    use super::*;

    /// States, and after them the earlier speeds.
    const ALL: usize = N + SPEEDS;
    type Dense = [[f64; ALL]; ALL];

    fn dense(covariance: &Covariance<f64>) -> Dense {
        let entry = |i: usize, j: usize| match (i.checked_sub(N), j.checked_sub(N)) {
            (None, None) => covariance.at(i, j),
            (Some(k), None) => covariance.earlier[k][j],
            (None, Some(k)) => covariance.earlier[k][i],
            (Some(k), Some(l)) => covariance.among[k.min(l)][k.max(l)],
        };
        core::array::from_fn(|i| core::array::from_fn(|j| entry(i, j)))
    }

    fn product(a: &Dense, b: &Dense) -> Dense {
        core::array::from_fn(|i| core::array::from_fn(|j| (0..ALL).map(|k| a[i][k] * b[k][j]).sum()))
    }

    fn transposed(a: &Dense) -> Dense {
        core::array::from_fn(|i| core::array::from_fn(|j| a[j][i]))
    }

    /// A covariance of full rank with entries of any size.
    fn any() -> Covariance<f64> {
        let mut seed = 1_u32;
        let factors: Dense = core::array::from_fn(|_| {
            core::array::from_fn(|_| {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(seed) / f64::from(u32::MAX) - 0.5
            })
        });
        let p = product(&factors, &transposed(&factors));
        let mut covariance = Covariance::of([0.0; N]);
        for i in 0..N {
            covariance.upper[i][i..].copy_from_slice(&p[i][i..N]);
        }
        for k in 0..SPEEDS {
            covariance.earlier[k].copy_from_slice(&p[N + k][..N]);
            covariance.among[k][k..].copy_from_slice(&p[N + k][N + k..]);
        }
        covariance
    }

    fn tangent() -> Tangent<f64> {
        let mut x = [0.0; N];
        (x[TURBINE], x[OUTPUT], x[WHEEL], x[SPRING], x[LOAD]) = (300.0, 120.0, 40.5, 900.0, 700.0);
        let step = step();
        step.tangent(&x, &step.propagate(&x))
    }

    /// Asserts that all entries of states and of the earlier speeds from `kept` on are alike.
    fn assert_alike(one: &Dense, other: &Dense, kept: usize) {
        for i in (0..ALL).filter(|i| *i < N || *i >= N + kept) {
            for j in (0..ALL).filter(|j| *j < N || *j >= N + kept) {
                let (a, b) = (one[i][j], other[i][j]);
                assert!((a - b).abs() <= 1e-9 * (a.abs() + b.abs()).max(1.0), "{i} {j}: {a} {b}");
            }
        }
    }

    #[test]
    fn a_step_is_the_product_with_its_matrix() {
        let step = tangent();
        for remembered in [true, false] {
            let mut matrix = [[0.0; ALL]; ALL];
            matrix.iter_mut().enumerate().for_each(|(i, row)| row[i] = 1.0);
            for c in 0..COLUMNS {
                let next = step.of(&core::array::from_fn(|i| if i == c { 1.0 } else { 0.0 }));
                matrix.iter_mut().zip(next).for_each(|(row, next)| row[c] = next);
            }
            for (state, left) in
                [(OFFGOING, step.keep), (FRACTION, step.stay), (FRICTION, step.last), (GAIN, step.last)]
            {
                assert!(left < 1.0);
                matrix[state][state] = left;
            }
            if remembered {
                (0..SPEEDS).for_each(|k| (matrix[N + k][k], matrix[N + k][N + k]) = (1.0, 0.0));
            }
            let mut covariance = any();
            let expected = product(&product(&matrix, &dense(&covariance)), &transposed(&matrix));
            covariance.spread(&step, remembered);
            assert_alike(&dense(&covariance), &expected, 0);
        }
    }

    /// A reading of the speed `K`, by the matrices of the form.
    fn assert_corrects<const K: usize>(row: &Row<f64>, kept: usize) {
        let (noise, fractions, innovation) = (0.1, [0.0, 0.3, 0.0, 1.0, 0.05, 1.0], 0.7);
        let mut covariance = any();
        let p = dense(&covariance);
        let mut h = [0.0; ALL];
        (h[K], h[N + K]) = (row.now, row.earlier);
        (h[SCALE], h[DELAY], h[SKEW]) = (row.learnt[0], row.learnt[1], row.learnt[2]);
        let with: [f64; ALL] = core::array::from_fn(|i| (0..ALL).map(|j| p[i][j] * h[j]).sum());
        let variance = noise + (0..ALL).map(|i| h[i] * with[i]).sum::<f64>();
        let fraction = |i: usize| if (FRACTION..N).contains(&i) { fractions[i - FRACTION] } else { 1.0 };
        let gain: [f64; ALL] = core::array::from_fn(|i| fraction(i) * with[i] / variance);
        let left: Dense =
            core::array::from_fn(|i| core::array::from_fn(|j| f64::from(u8::from(i == j)) - gain[i] * h[j]));
        let mut expected = product(&product(&left, &p), &transposed(&left));
        for i in 0..ALL {
            (0..ALL).for_each(|j| expected[i][j] += gain[i] * noise * gain[j]);
        }
        let measured = covariance.measured::<K>(row, noise);
        assert!((measured.variance - variance).abs() < 1e-9 * variance);
        let moves = covariance.correct(&measured, &fractions, kept, innovation);
        assert_alike(&dense(&covariance), &expected, kept);
        for (moved, gain) in moves.states.iter().zip(gain) {
            assert!((moved - gain * innovation).abs() < 1e-9);
        }
        for (k, moved) in moves.earlier.iter().enumerate() {
            let expected = if k < kept { gain[k] } else { gain[N + k] };
            assert!((moved - expected * innovation).abs() < 1e-9);
        }
    }

    #[test]
    fn a_correction_is_josephs_form_of_the_states_and_of_the_earlier_speeds_that_are_kept() {
        for kept in 0..=SPEEDS {
            let wheel = Row { now: -0.4, earlier: 1.4, learnt: [0.6, -0.3, 0.2] };
            assert_corrects::<WHEEL>(&wheel, kept);
            let gearbox = Row { learnt: [0.0, 0.0, 0.2], ..wheel };
            assert_corrects::<TURBINE>(&gearbox, kept);
            assert_corrects::<OUTPUT>(&Row { learnt: [0.0; 3], ..gearbox }, kept);
        }
    }

    #[test]
    fn a_speed_that_has_jumped_follows_its_reading_wherever_on_the_line_that_is() {
        for [now, earlier] in [[1.0, 0.0], [0.4, 0.6], [0.0, 1.0], [-1.5, 2.5]] {
            let mut covariance = any();
            covariance.offset::<OUTPUT>(1e6);
            let measured = covariance.measured::<OUTPUT>(&Row { now, earlier, learnt: [0.0; 3] }, 0.1);
            let moves = covariance.correct(&measured, &[1.0; CONSIDERED], 0, 100.0);
            for moved in [moves.states[OUTPUT], moves.earlier[OUTPUT]] {
                assert!((moved - 100.0).abs() < 0.1, "{now} {earlier}: {moved}");
            }
        }
    }

    #[test]
    fn a_covariance_that_is_none_is_not_sound() {
        let sound = any();
        assert!(sound.is_sound());
        for wrong in [-1e-9, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for state in 0..N {
                let mut covariance = sound;
                covariance.set(state, state, wrong);
                assert!(!covariance.is_sound(), "{state} {wrong}");
            }
        }
    }
}
