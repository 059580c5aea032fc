//! Mean and covariance of the states.

use drivetrain::Real;

use super::N;
use super::powertrain::{CORE, dot};

/// Mean and covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gaussian<T> {
    pub(super) mean: [T; N],
    pub(super) covariance: [[T; N]; N],
}

/// A scalar measurement, as a row over the states.
pub(super) struct Measured<T> {
    pub(super) row: [T; N],
    /// Its value less what does not depend on the states.
    pub(super) value: T,
    /// Variance of its noise.
    pub(super) noise: T,
}

impl<T: Real> Gaussian<T> {
    /// Independent states with these standard deviations.
    pub(super) fn of(mean: [T; N], deviations: [T; N]) -> Self {
        let mut covariance = [[T::zero(); N]; N];
        for (k, deviation) in deviations.into_iter().enumerate() {
            covariance[k][k] = deviation * deviation;
        }
        Self { mean, covariance }
    }

    /// Carries the first states on by their rows, and lets the others fade by their factors.
    pub(super) fn pass(&mut self, rows: &[[T; N]; CORE], rest: &[T; CORE], stay: &[T; N]) {
        let before = self.mean;
        for (k, x) in self.mean.iter_mut().enumerate() {
            *x = if k < CORE { dot(&rows[k], &before) + rest[k] } else { stay[k] * *x };
        }
        let p = &mut self.covariance;
        let mut carried = [[T::zero(); N]; CORE];
        for (carried, row) in carried.iter_mut().zip(rows) {
            for (weight, p) in row.iter().zip(p.iter()) {
                for (x, p) in carried.iter_mut().zip(p) {
                    *x = *x + *weight * *p;
                }
            }
        }
        for i in CORE..N {
            for j in CORE..N {
                p[i][j] = stay[i] * stay[j] * p[i][j];
            }
        }
        for i in 0..CORE {
            for j in i..N {
                let value = if j < CORE { dot(&carried[i], &rows[j]) } else { stay[j] * carried[i][j] };
                p[i][j] = value;
                p[j][i] = value;
            }
        }
    }

    /// Adds to the covariance of two states.
    pub(super) fn add(&mut self, i: usize, j: usize, covariance: T) {
        self.covariance[i][j] = self.covariance[i][j] + covariance;
        if i != j {
            self.covariance[j][i] = self.covariance[j][i] + covariance;
        }
    }

    /// Makes a state independent of the others, with this mean and variance.
    pub(super) fn renew(&mut self, state: usize, mean: T, variance: T) {
        for k in 0..N {
            self.covariance[k][state] = T::zero();
            self.covariance[state][k] = T::zero();
        }
        self.mean[state] = mean;
        self.covariance[state][state] = variance;
    }

    /// Exchanges two states.
    pub(super) fn swap(&mut self, a: usize, b: usize) {
        self.mean.swap(a, b);
        self.covariance.swap(a, b);
        for row in &mut self.covariance {
            row.swap(a, b);
        }
    }

    /// Variance of a combination of the states.
    pub(super) fn variance(&self, row: &[T; N]) -> T {
        dot(&self.with(row), row).max(T::zero())
    }

    /// Covariance of the states with a combination of them.
    fn with(&self, row: &[T; N]) -> [T; N] {
        core::array::from_fn(|k| dot(&self.covariance[k], row))
    }

    /// The innovation of a measurement, and its variance.
    pub(super) fn innovation(&self, measured: &Measured<T>) -> [T; 2] {
        [measured.value - dot(&measured.row, &self.mean), self.variance(&measured.row) + measured.noise]
    }

    /// Corrects by a measurement, in Joseph's form: `P - K S' - S K' + K V K'`.
    pub(super) fn correct(&mut self, measured: &Measured<T>) {
        let with = self.with(&measured.row);
        let [innovation, variance] = self.innovation(measured);
        if variance <= T::zero() {
            return;
        }
        let gain = with.map(|with| with / variance);
        let half = T::of(0.5) * variance;
        // K w' + w K' with w = K V/2 - S: both halves come out the same.
        let weight: [T; N] = core::array::from_fn(|k| half * gain[k] - with[k]);
        for (i, row) in self.covariance.iter_mut().enumerate() {
            for (j, p) in row.iter_mut().enumerate() {
                *p = *p + (gain[i] * weight[j] + weight[i] * gain[j]);
            }
        }
        for (x, gain) in self.mean.iter_mut().zip(gain) {
            *x = *x + gain * innovation;
        }
    }

    /// Whether all are numbers, and no variance is negative.
    pub(super) fn is_sound(&self) -> bool {
        let variances = self.covariance.iter().enumerate().all(|(k, row)| row[k] >= T::zero() && row[k].is_finite());
        variances && self.mean.iter().all(|x| x.is_finite())
    }
}
