//! The bias of a sensor: one more state, that moves by a random walk alone.

use drivetrain::Real;

use super::covariance::{Gaussian, Innovation, Measured};
use super::powertrain::{CORE, dot};
use super::{N, OUTPUT, TURBINE};

/// Mean and variance of a bias, and the covariances of the states with it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Bias<T> {
    mean: T,
    variance: T,
    with: [T; N],
}

impl<T: Real> Bias<T> {
    /// One that is independent of the states.
    pub(super) fn independent(variance: T) -> Self {
        Self { mean: T::zero(), variance, with: [T::zero(); N] }
    }

    pub(super) fn mean(&self) -> T {
        self.mean
    }

    /// Adds to its variance.
    pub(super) fn walk(&mut self, variance: T) {
        self.variance = self.variance + variance;
    }

    /// Follows the first states.
    pub(super) fn pass(&mut self, rows: &[[T; N]; CORE]) {
        let carried = rows.each_ref().map(|row| dot(row, &self.with));
        self.with[..CORE].copy_from_slice(&carried);
    }

    /// Follows a state that fades by a factor; by zero, one that is made independent.
    pub(super) fn fade(&mut self, state: usize, factor: T) {
        let state = state.min(N - 1);
        self.with[state] = factor * self.with[state];
    }

    /// Gives a state, which is independent of the bias, a fraction of another one.
    pub(super) fn take_fraction(&mut self, state: usize, fraction: T, of: usize) {
        self.with[state.min(N - 1)] = fraction * self.with[of.min(N - 1)];
    }

    /// Follows a state with another mean and variance. The changes are over the variance and its square before.
    pub(super) fn replace(&mut self, state: usize, with: &[T; N], [by_mean, by_variance]: [T; 2]) {
        let own = self.with[state.min(N - 1)];
        self.mean = self.mean + own * by_mean;
        self.variance = self.variance + by_variance * own * own;
        for (p, other) in self.with.iter_mut().zip(with) {
            *p = *p + by_variance * own * *other;
        }
    }

    /// Follows two states that are exchanged.
    pub(super) fn swap(&mut self, a: usize, b: usize) {
        self.with.swap(a.min(N - 1), b.min(N - 1));
    }

    /// Follows [`Gaussian::tie`].
    pub(super) fn tie(&mut self, ratio: T, fraction: [T; 2]) {
        let output = fraction[0] * self.with[TURBINE] + fraction[1] * self.with[OUTPUT];
        (self.with[TURBINE], self.with[OUTPUT]) = (ratio * output, output);
    }

    /// Its covariance with a combination of the states.
    pub(super) fn with(&self, row: &[T; N]) -> T {
        dot(row, &self.with)
    }

    /// Follows a correction of the states: their gains times the standard deviation of the innovation, its own, and the innovation over
    /// its standard deviation.
    pub(super) fn correct(&mut self, factor: &[T], own: T, innovation: T) {
        self.mean = self.mean + own * innovation;
        self.variance = (self.variance - own * own).at_least(T::zero());
        for (p, other) in self.with.iter_mut().zip(factor) {
            *p = *p - own * *other;
        }
    }

    pub(super) fn is_sound(&self) -> bool {
        self.variance >= T::zero() && self.variance.is_finite() && self.mean.is_finite()
    }
}

impl<T: Real> Gaussian<T> {
    /// The innovation of a measurement that the bias adds to.
    pub(super) fn innovation_with_bias(&self, measured: &Measured<T>) -> Innovation<T> {
        let mut innovation = self.innovation(measured);
        let Some(bias) = &self.bias else { return innovation };
        let by_states = innovation.with_bias;
        innovation.variance = (innovation.variance + by_states + by_states + bias.variance).at_least(measured.noise);
        innovation.with_bias = by_states + bias.variance;
        for (with, bias) in innovation.with.iter_mut().zip(&bias.with) {
            *with = *with + *bias;
        }
        innovation
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FRACTION, SLOW_FRACTION, SPRING};
    use super::*;

    /// A bias is what a state would be: here the last one, which nothing else moves.
    #[test]
    fn a_bias_is_one_state_more() {
        const LAST: usize = N - 1;
        let number = |seed: usize| (seed as f64 * 12.9898).sin();
        let mut whole = Gaussian::of([0.0; N], core::array::from_fn(|k| 1.0 + 0.1 * k as f64));
        let mut apart = whole;
        apart.bias = Some(Bias::independent(whole.covariance[LAST][LAST]));
        let row = |seed: usize| core::array::from_fn(|k| if k < LAST { number(seed + k) } else { 0.0 });
        let rows = [row(100), row(200), row(300), row(400)];
        for step in 0..5 {
            for x in [&mut whole, &mut apart] {
                x.pass(&rows, &[0.1; CORE]);
                x.fade(FRACTION, 0.9);
                x.tie(1.7, [0.3, 0.7]);
            }
            let innovation = 0.3 * number(step);
            let mut with_last = Measured { row: row(50 * step), innovation, noise: 0.2 };
            let of_states = Measured { ..with_last };
            with_last.row[LAST] = 1.0;
            let (one, other) = (whole.innovation(&with_last), apart.innovation_with_bias(&of_states));
            assert!((one.variance - other.variance).abs() < 1e-12);
            whole.correct(&one);
            apart.correct(&other);
            let plain = Measured { row: row(70 * step), innovation: 0.1, noise: 0.5 };
            for x in [&mut whole, &mut apart] {
                let innovation = x.innovation(&plain);
                x.correct(&innovation);
                x.swap(FRACTION, SLOW_FRACTION);
            }
            whole.replace(SPRING, 0.2, 0.7);
            apart.replace(SPRING, 0.2, 0.7);
            whole.add(LAST, LAST, 0.05);
            apart.bias.as_mut().unwrap().walk(0.05);
        }
        let bias = apart.bias.unwrap();
        assert!((bias.mean - whole.mean[LAST]).abs() < 1e-12 && bias.mean.abs() > 1e-3);
        assert!((bias.variance - whole.covariance[LAST][LAST]).abs() < 1e-12);
        for k in 0..LAST {
            assert!((apart.mean[k] - whole.mean[k]).abs() < 1e-12, "{k}");
            assert!((bias.with[k] - whole.covariance[k][LAST]).abs() < 1e-12, "{k}");
            for other in 0..LAST {
                assert!((apart.covariance[k][other] - whole.covariance[k][other]).abs() < 1e-12);
            }
        }
        apart.renew(SPRING, 0.0, 1.0);
        assert_eq!(apart.bias.unwrap().with[SPRING], 0.0);
        apart.bias = Some(Bias { mean: f64::NAN, ..bias });
        assert!(!apart.is_sound());
    }
}
