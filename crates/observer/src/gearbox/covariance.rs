//! Mean and covariance of the states.

use drivetrain::Real;

use super::bias::Bias;
use super::elements::PressureError;
use super::powertrain::{CORE, dot};
use super::timing::{TIMINGS, Timing};
use super::{IN_GEAR, KISS, N, OUTPUT, PRESSURE, TURBINE};

/// Mean and covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Gaussian<T> {
    pub(super) mean: [T; N],
    pub(super) covariance: [[T; N]; N],
    /// How many states are not independent of all others; those behind them are left out.
    pub(super) active: usize,
    /// What the readings of a shift have shown of lag and delay of its valves.
    pub(super) timing: Timing<T>,
    /// The bias of the accelerometer, where there is one.
    pub(super) bias: Option<Bias<T>>,
}

/// A scalar measurement, as a row over the states.
pub(super) struct Measured<T> {
    pub(super) row: [T; N],
    /// Its value less what the states say.
    pub(super) innovation: T,
    /// Variance of its noise.
    pub(super) noise: T,
}

/// What a measurement differs by from the prediction of the states.
pub(super) struct Innovation<T> {
    pub(super) value: T,
    /// Its variance.
    pub(super) variance: T,
    /// Covariance of the states with it.
    pub(super) with: [T; N],
    /// By how much it is off per standard deviation of the timing.
    by_timing: [T; TIMINGS],
    /// Covariance of the bias with it.
    pub(super) with_bias: T,
}

impl<T: Real> Gaussian<T> {
    /// Independent states with these standard deviations.
    pub(super) fn of(mean: [T; N], std_devs: [T; N]) -> Self {
        let mut covariance = [[T::zero(); N]; N];
        for (k, std_dev) in std_devs.into_iter().enumerate() {
            covariance[k][k] = std_dev * std_dev;
        }
        Self { mean, covariance, active: N, timing: Timing::nothing([[T::zero(); 2]; 2]), bias: None }
    }

    /// Whether only the states of a gear are active. Loops over a number of states that the compiler knows are unrolled; so
    /// what is done most often is done by functions for the first `M` states.
    fn in_gear(&self) -> bool {
        self.active <= IN_GEAR
    }

    /// Carries the first states on by their rows; the others stay as they are.
    pub(super) fn pass(&mut self, rows: &[[T; N]; CORE], rest: &[T; CORE]) {
        if self.in_gear() {
            return self.pass_first::<IN_GEAR>(rows, rest);
        }
        self.timing.pass(rows);
        self.pass_first::<N>(rows, rest);
    }

    fn pass_first<const M: usize>(&mut self, rows: &[[T; N]; CORE], rest: &[T; CORE]) {
        if let Some(bias) = &mut self.bias {
            bias.pass(rows);
        }
        let mut mean = *rest;
        for (mean, row) in mean.iter_mut().zip(rows) {
            *mean = *mean + dot_first::<T, M>(row, &self.mean);
        }
        self.mean[..CORE].copy_from_slice(&mean);
        let p = &mut self.covariance;
        let mut carried = [[T::zero(); M]; CORE];
        for (carried, row) in carried.iter_mut().zip(rows) {
            for (weight, p) in row.iter().zip(p.iter()).take(M) {
                let Some(p) = p.first_chunk::<M>() else { continue };
                for (x, p) in carried.iter_mut().zip(p) {
                    *x = *x + *weight * *p;
                }
            }
        }
        for i in 0..CORE {
            for j in i..M {
                let value = if j < CORE {
                    carried[i].iter().zip(&rows[j]).fold(T::zero(), |sum, (p, weight)| sum + *p * *weight)
                } else {
                    carried[i][j]
                };
                p[i][j] = value;
                p[j][i] = value;
            }
        }
    }

    /// Lets a state fade by a factor.
    pub(super) fn fade(&mut self, state: usize, factor: T) {
        let (state, active) = (state.min(N - 1), self.active);
        self.mean[state] = factor * self.mean[state];
        self.timing.fade(state, factor);
        if let Some(bias) = &mut self.bias {
            bias.fade(state, factor);
        }
        for row in self.covariance.iter_mut().take(active) {
            row[state] = factor * row[state];
        }
        for p in self.covariance[state].iter_mut().take(active) {
            *p = factor * *p;
        }
    }

    /// Mean and variance of a state.
    pub(super) fn of_state(&self, state: usize) -> [T; 2] {
        let state = state.min(N - 1);
        [self.mean[state], self.covariance[state][state]]
    }

    /// Adds to the covariance of two states.
    pub(super) fn add(&mut self, i: usize, j: usize, covariance: T) {
        let (i, j) = (i.min(N - 1), j.min(N - 1));
        self.covariance[i][j] = self.covariance[i][j] + covariance;
        if i != j {
            self.covariance[j][i] = self.covariance[j][i] + covariance;
        }
    }

    /// Makes a state independent of the others, with this mean and variance. Not inlined: many places call it.
    #[inline(never)]
    pub(super) fn renew(&mut self, state: usize, mean: T, variance: T) {
        let state = state.min(N - 1);
        for k in 0..N {
            self.covariance[k][state] = T::zero();
            self.covariance[state][k] = T::zero();
        }
        self.timing.fade(state, T::zero());
        if let Some(bias) = &mut self.bias {
            bias.fade(state, T::zero());
        }
        self.mean[state] = mean;
        self.covariance[state][state] = variance;
    }

    /// Gives a state another mean and variance. What it says of the others stays, and they follow.
    pub(super) fn replace(&mut self, state: usize, mean: T, variance: T) {
        let state = state.min(N - 1);
        let with = self.covariance[state];
        let own = with[state];
        if own <= T::epsilon() {
            return self.renew(state, mean, variance);
        }
        let by_mean = (mean - self.mean[state]) / own;
        let by_variance = (variance - own) / (own * own);
        if let Some(bias) = &mut self.bias {
            bias.replace(state, &with, [by_mean, by_variance]);
        }
        for ((row, x), own) in self.covariance.iter_mut().zip(&mut self.mean).zip(&with) {
            *x = *x + *own * by_mean;
            for (p, other) in row.iter_mut().zip(&with) {
                *p = *p + by_variance * *own * *other;
            }
        }
    }

    /// Exchanges two states.
    pub(super) fn swap(&mut self, a: usize, b: usize) {
        let (a, b) = (a.min(N - 1), b.min(N - 1));
        self.mean.swap(a, b);
        if let Some(bias) = &mut self.bias {
            bias.swap(a, b);
        }
        self.covariance.swap(a, b);
        for row in &mut self.covariance {
            row.swap(a, b);
        }
    }

    /// What is known of the errors of a shift clutch's pressure and kiss point.
    pub(super) fn pressure_error(&self, clutch: usize) -> PressureError<T> {
        let (x, k) = (PRESSURE[clutch.min(1)].min(N - 1), KISS[clutch.min(1)].min(N - 1));
        let p = &self.covariance;
        PressureError { pressure: self.mean[x], kiss: self.mean[k], variance: [p[x][x], p[k][k]], covariance: p[x][k] }
    }

    /// Makes the first state the second times a ratio; the second becomes the sum of both with these fractions.
    pub(super) fn tie(&mut self, ratio: T, fraction: [T; 2]) {
        let joined = |a: T, b: T| fraction[0] * a + fraction[1] * b;
        let output = joined(self.mean[TURBINE], self.mean[OUTPUT]);
        (self.mean[TURBINE], self.mean[OUTPUT]) = (ratio * output, output);
        self.timing.tie(ratio, fraction);
        if let Some(bias) = &mut self.bias {
            bias.tie(ratio, fraction);
        }
        let p = &mut self.covariance;
        for row in p.iter_mut() {
            let output = joined(row[TURBINE], row[OUTPUT]);
            (row[TURBINE], row[OUTPUT]) = (ratio * output, output);
        }
        let mut output = p[OUTPUT];
        for (output, turbine) in output.iter_mut().zip(&p[TURBINE]) {
            *output = joined(*turbine, *output);
        }
        (p[TURBINE], p[OUTPUT]) = (output.map(|x| ratio * x), output);
    }

    /// Variance of a combination of the states.
    pub(super) fn variance(&self, row: &[T; N]) -> T {
        let with = if self.in_gear() { self.with_first::<IN_GEAR>(row) } else { self.with_first::<N>(row) };
        dot(&with, row).at_least(T::zero())
    }

    /// Covariance of the first states with a combination of them. Some combinations are of few states.
    fn with_first<const M: usize>(&self, row: &[T; N]) -> [T; N] {
        let mut with = [T::zero(); N];
        let Some(first) = with.first_chunk_mut::<M>() else { return with };
        for (per, p) in row.iter().zip(&self.covariance).take(M) {
            let Some(p) = p.first_chunk::<M>().filter(|_| *per != T::zero()) else { continue };
            for (with, p) in first.iter_mut().zip(p) {
                *with = *with + *per * *p;
            }
        }
        with
    }

    /// The innovation of a measurement, with its variance.
    pub(super) fn innovation(&self, measured: &Measured<T>) -> Innovation<T> {
        if self.in_gear() {
            return self.innovation_of_first::<IN_GEAR>(measured);
        }
        Innovation { by_timing: self.timing.of(&measured.row), ..self.innovation_of_first::<N>(measured) }
    }

    fn innovation_of_first<const M: usize>(&self, measured: &Measured<T>) -> Innovation<T> {
        let with = self.with_first::<M>(&measured.row);
        let variance = dot_first::<T, M>(&with, &measured.row).at_least(T::zero()) + measured.noise;
        let with_bias = self.bias.as_ref().map_or(T::zero(), |bias| bias.with(&measured.row));
        Innovation { value: measured.innovation, variance, with, by_timing: [T::zero(); TIMINGS], with_bias }
    }

    /// Corrects by a measurement: `x + S e/V`, `P - S S'/V`. The product is made of two equal factors, so that `P` stays
    /// symmetric to the last digit.
    pub(super) fn correct(&mut self, innovation: &Innovation<T>) {
        if innovation.variance <= T::zero() {
            return;
        }
        if self.in_gear() {
            return self.correct_first::<IN_GEAR>(innovation);
        }
        let per = innovation.variance.sqrt().recip();
        self.timing.take(
            &innovation.by_timing.map(|by| per * by),
            per * innovation.value,
            &innovation.with.map(|with| per * with),
        );
        self.correct_first::<N>(innovation);
    }

    fn correct_first<const M: usize>(&mut self, innovation: &Innovation<T>) {
        let per = innovation.variance.sqrt().recip();
        let Some(with) = innovation.with.first_chunk::<M>() else { return };
        let factor = with.map(|with| per * with);
        for (i, (row, own)) in self.covariance.iter_mut().zip(&factor).enumerate() {
            let Some(row) = row.first_chunk_mut::<M>() else { continue };
            for (p, other) in row.iter_mut().zip(&factor) {
                *p = *p - *own * *other;
            }
            if let Some(variance) = row.get_mut(i) {
                *variance = variance.at_least(T::zero());
            }
        }
        let own = per * innovation.with_bias;
        let innovation = per * innovation.value;
        if let Some(bias) = &mut self.bias {
            bias.correct(&factor, own, innovation);
        }
        for (x, factor) in self.mean.iter_mut().zip(&factor) {
            *x = *x + *factor * innovation;
        }
    }

    /// The value of a row over the states, of which those that are not active are zero.
    #[inline]
    pub(super) fn value(&self, row: &[T; N]) -> T {
        if self.in_gear() { dot_first::<T, IN_GEAR>(row, &self.mean) } else { dot(row, &self.mean) }
    }

    /// Whether all are numbers, and no variance is negative.
    #[inline(never)]
    pub(super) fn is_sound(&self) -> bool {
        let states = self.covariance.iter().zip(&self.mean).enumerate().take(self.active);
        // What is no number, or infinite, makes a sum so.
        let (sound, sum) = states.fold((true, T::zero()), |(sound, sum), (k, (row, x))| {
            (sound & (row[k] >= T::zero()), sum + (row[k] + x.abs()))
        });
        sound && sum.is_finite() && self.bias.as_ref().is_none_or(Bias::is_sound)
    }
}

/// The sum of the products of the first of two rows.
#[inline]
fn dot_first<T: Real, const M: usize>(a: &[T; N], b: &[T; N]) -> T {
    a.iter().zip(b).take(M).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1 without order.
    fn number(seed: usize) -> f64 {
        (seed as f64 * 12.9898).sin() * 43758.5453 % 1.0
    }

    /// A covariance of the states of a gear; the others are independent of them.
    fn states(active: usize) -> Gaussian<f64> {
        let mut x = Gaussian::of([0.0; N], [1.0; N]);
        for i in 0..IN_GEAR {
            x.mean[i] = 10.0 * number(i);
            for j in 0..IN_GEAR {
                let product = |k: usize| number(7 * i + k) * number(7 * j + k);
                x.covariance[i][j] += (20..30).map(product).sum::<f64>();
            }
        }
        Gaussian { active, ..x }
    }

    #[test]
    fn the_states_of_a_gear_are_those_of_the_whole() {
        let row = |seed: usize| core::array::from_fn(|k| if k < IN_GEAR { number(seed + k) } else { 0.0 });
        let rows = [row(100), row(200), row(300), row(400)];
        let measured = Measured { row: row(500), innovation: 0.7, noise: 0.1 };
        let after = |active: usize| {
            let mut x = states(active);
            x.pass(&rows, &[1.0, 2.0, 3.0, 4.0]);
            x.fade(IN_GEAR - 1, 0.9);
            let innovation = x.innovation(&measured);
            x.correct(&innovation);
            (x, ([innovation.variance, x.variance(&measured.row), x.value(&measured.row)], x.is_sound()))
        };
        let (gear, found) = after(IN_GEAR);
        let (whole, all) = after(N);
        assert_eq!((gear.mean, gear.covariance, found), (whole.mean, whole.covariance, all));
        // The variance of what was measured is `1/(1/p + 1/r)`.
        let ([before, after, _], sound) = found;
        assert!(sound && (after - (before - measured.noise) * measured.noise / before).abs() < 1e-9);
        for i in 0..N {
            for j in 0..N {
                assert_eq!(gear.covariance[i][j], gear.covariance[j][i]);
            }
        }
    }

    #[test]
    fn what_is_no_number_is_not_sound() {
        for (k, wrong) in [(0, f64::NAN), (3, f64::INFINITY), (7, -1e-9)] {
            let mut x = states(IN_GEAR);
            assert!(x.is_sound());
            x.covariance[k][k] = wrong;
            assert!(!x.is_sound());
            let mut x = states(IN_GEAR);
            x.mean[k] = f64::NEG_INFINITY;
            assert!(!x.is_sound());
        }
    }
}
