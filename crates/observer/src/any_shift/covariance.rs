//! Mean and covariance of the states.

use drivetrain::Real;

use super::elements::PressureError;
use super::powertrain::{CORE, dot};
use super::{IN_GEAR, KISS, N, OUTPUT, PRESSURE, TURBINE};

/// Mean and covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gaussian<T> {
    pub(super) mean: [T; N],
    pub(super) covariance: [[T; N]; N],
    /// How many states are not independent of all others; those behind them are left out.
    pub(super) active: usize,
}

/// A scalar measurement, as a row over the states.
pub(super) struct Measured<T> {
    pub(super) row: [T; N],
    /// Its value less what does not depend on the states.
    pub(super) value: T,
    /// Variance of its noise.
    pub(super) noise: T,
}

/// A measurement beside what the states say.
pub(super) struct Look<T> {
    pub(super) innovation: T,
    /// Its variance.
    pub(super) variance: T,
    /// Covariance of the states with it.
    with: [T; N],
}

impl<T: Real> Gaussian<T> {
    /// Independent states with these standard deviations.
    pub(super) fn of(mean: [T; N], deviations: [T; N]) -> Self {
        let mut covariance = [[T::zero(); N]; N];
        for (k, deviation) in deviations.into_iter().enumerate() {
            covariance[k][k] = deviation * deviation;
        }
        Self { mean, covariance, active: N }
    }

    /// Carries the first states on by their rows, and lets the others fade by their factors.
    pub(super) fn pass(&mut self, rows: &[[T; N]; CORE], rest: &[T; CORE], stay: &[T; N]) {
        if self.active <= IN_GEAR {
            self.pass_first::<IN_GEAR>(rows, rest, stay);
        } else {
            self.pass_first::<N>(rows, rest, stay);
        }
    }

    /// The same for the first `M` states. With `M` known to the compiler the loops are unrolled.
    fn pass_first<const M: usize>(&mut self, rows: &[[T; N]; CORE], rest: &[T; CORE], stay: &[T; N]) {
        let before = self.mean;
        for (k, x) in self.mean.iter_mut().enumerate().take(M) {
            *x = if k < CORE { dot(&rows[k], &before) + rest[k] } else { stay[k] * *x };
        }
        let p = &mut self.covariance;
        let mut carried = [[T::zero(); M]; CORE];
        for (carried, row) in carried.iter_mut().zip(rows) {
            for (weight, p) in row.iter().zip(p.iter()).take(M) {
                for (x, p) in carried.iter_mut().zip(p) {
                    *x = *x + *weight * *p;
                }
            }
        }
        for (row, own) in p.iter_mut().zip(stay).take(M).skip(CORE) {
            for (p, other) in row.iter_mut().zip(stay).take(M).skip(CORE) {
                *p = *own * *other * *p;
            }
        }
        for i in 0..CORE {
            for j in i..M {
                let value = if j < CORE {
                    carried[i].iter().zip(&rows[j]).fold(T::zero(), |sum, (p, weight)| sum + *p * *weight)
                } else {
                    stay[j] * carried[i][j]
                };
                p[i][j] = value;
                p[j][i] = value;
            }
        }
    }

    /// Adds to the covariance of two states.
    pub(super) fn add(&mut self, i: usize, j: usize, covariance: T) {
        let (i, j) = (i.min(N - 1), j.min(N - 1));
        self.covariance[i][j] = self.covariance[i][j] + covariance;
        if i != j {
            self.covariance[j][i] = self.covariance[j][i] + covariance;
        }
    }

    /// Makes a state independent of the others, with this mean and variance.
    pub(super) fn renew(&mut self, state: usize, mean: T, variance: T) {
        let state = state.min(N - 1);
        for k in 0..N {
            self.covariance[k][state] = T::zero();
            self.covariance[state][k] = T::zero();
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
        self.covariance.swap(a, b);
        for row in &mut self.covariance {
            row.swap(a, b);
        }
    }

    /// What is known of the errors of a shift clutch's pressure and kiss point.
    pub(super) fn pressure_error(&self, clutch: usize) -> PressureError<T> {
        let (x, k) = (PRESSURE[clutch.min(1)], KISS[clutch.min(1)]);
        let p = &self.covariance;
        PressureError { pressure: self.mean[x], kiss: self.mean[k], variance: [p[x][x], p[k][k]], covariance: p[x][k] }
    }

    /// Makes the first state the second times a ratio; the second becomes the sum of both with these shares.
    pub(super) fn tie(&mut self, ratio: T, share: [T; 2]) {
        let joined = |a: T, b: T| share[0] * a + share[1] * b;
        let output = joined(self.mean[TURBINE], self.mean[OUTPUT]);
        (self.mean[TURBINE], self.mean[OUTPUT]) = (ratio * output, output);
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
        dot(&self.with(row), row).max(T::zero())
    }

    /// Covariance of the states with a combination of them. Most combinations are of few states.
    fn with(&self, row: &[T; N]) -> [T; N] {
        let mut with = [T::zero(); N];
        for (per, p) in row.iter().zip(&self.covariance).take(self.active) {
            if *per != T::zero() {
                for (with, p) in with.iter_mut().zip(p) {
                    *with = *with + *per * *p;
                }
            }
        }
        with
    }

    /// What a measurement says beside the states.
    pub(super) fn look(&self, measured: &Measured<T>) -> Look<T> {
        let with = self.with(&measured.row);
        let variance = dot(&with, &measured.row).max(T::zero()) + measured.noise;
        Look { innovation: measured.value - dot(&measured.row, &self.mean), variance, with }
    }

    /// Corrects by a measurement: `x + S e/V`, `P - S S'/V`. The product is made of two equal factors, so that `P` stays
    /// symmetric to the last digit.
    pub(super) fn correct(&mut self, look: &Look<T>) {
        if look.variance <= T::zero() {
            return;
        }
        let per = look.variance.sqrt().recip();
        let factor = look.with.map(|with| per * with);
        for (i, (row, own)) in self.covariance.iter_mut().zip(&factor).enumerate().take(self.active) {
            for (p, other) in row.iter_mut().zip(&factor) {
                *p = *p - *own * *other;
            }
            row[i] = row[i].max(T::zero());
        }
        let innovation = per * look.innovation;
        for (x, factor) in self.mean.iter_mut().zip(&factor).take(self.active) {
            *x = *x + *factor * innovation;
        }
    }

    /// Whether all are numbers, and no variance is negative.
    pub(super) fn is_sound(&self) -> bool {
        let variances = self.covariance.iter().enumerate().all(|(k, row)| row[k] >= T::zero() && row[k].is_finite());
        variances && self.mean.iter().all(|x| x.is_finite())
    }
}
