//! Unscented Kalman filter on the states and noises of [`ExtendedFilter`].
//!
//! It propagates sigma points instead of a Jacobian. This is an advantage at the kiss point, where the derivative of
//! the clutch torque is discontinuous (S. Julier, J. Uhlmann, Unscented filtering and nonlinear estimation, Proc.
//! IEEE 92 (2004) 401). The readings are states, so the correction is the same.

use drivetrain::Real;

use crate::extended::{N, PRESSURE, Running, Start};
use crate::{Estimate, ExtendedFilter, ExtendedState, Interval, Sample, SampleEstimator, Tracker};

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnscentedFilter<T> {
    /// Powertrain, noises, checks.
    pub filter: ExtendedFilter<T>,
}

impl<T: Real> UnscentedFilter<T> {
    /// The same filter in another precision.
    pub fn cast<U: Real>(&self) -> UnscentedFilter<U> {
        UnscentedFilter { filter: self.filter.cast() }
    }
}

impl<T: Real> SampleEstimator<T> for UnscentedFilter<T> {
    type SampleState = ExtendedState<T>;
    const READS_WHEEL: bool = true;

    fn tracker(&self) -> &Tracker<T> {
        &self.filter.tracker
    }

    fn start_sample(&self) -> ExtendedState<T> {
        ExtendedState::new()
    }

    #[inline]
    fn step_sample(&self, state: &mut ExtendedState<T>, sample: &Sample<T>) -> Estimate<T> {
        self.filter.step_by(state, sample, predict)
    }
}

/// Carries a pair of points along each axis of the covariance over the interval. All weigh the same, and the mean has
/// no point of its own: then no weight is negative, and the covariance stays one.
#[inline]
fn predict<T: Real>(
    filter: &ExtendedFilter<T>,
    running: &mut Running<T>,
    interval: &Interval<T>,
    sample: &Sample<T>,
) -> Start<T> {
    filter.follow(running, interval, sample);
    let passage = filter.passage(running, interval, sample);
    let before = running.mean;
    let axes = square_root(&running.covariance);
    let (mut points, mut mean) = ([[T::zero(); N]; 2 * N], [T::zero(); N]);
    let reach = T::of(N as f64).sqrt();
    let weight = T::of(0.5 / N as f64);
    let sign = |n: usize| if n < N { reach } else { -reach };
    for (n, point) in points.iter_mut().enumerate() {
        let start: [T; N] = core::array::from_fn(|i| before[i] + sign(n) * axes[i][n % N]);
        *point = passage.propagate(&start, passage.above_kiss(start[PRESSURE]));
        for (mean, x) in mean.iter_mut().zip(point.iter()) {
            *mean = *mean + weight * *x;
        }
    }
    let mut covariance = [[T::zero(); N]; N];
    let mut across = [[T::zero(); 2]; N];
    for (n, point) in points.iter().enumerate() {
        let off: [T; N] = core::array::from_fn(|i| point[i] - mean[i]);
        for (sums, off) in across.iter_mut().zip(off) {
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum = *sum + weight * off * sign(n) * axes[k][n % N];
            }
        }
        for (row, a) in covariance.iter_mut().zip(off) {
            for (sum, b) in row.iter_mut().zip(off) {
                *sum = *sum + weight * a * b;
            }
        }
    }
    for (i, variance) in filter.added(&passage, &before, running.motion_pa_s).into_iter().enumerate() {
        covariance[i][i] = covariance[i][i] + variance;
    }
    let p = &running.covariance;
    let within = [[p[0][0], p[0][1]], [p[1][0], p[1][1]]];
    running.mean = mean;
    running.covariance = covariance;
    Start { mean: [before[0], before[1]], within, across }
}

/// Lower triangular square root; an axis that rounding has made negative is taken as none.
#[inline]
fn square_root<T: Real>(p: &[[T; N]; N]) -> [[T; N]; N] {
    let zero = T::zero();
    let mut root = [[zero; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let rest = p[i][j] - (0..j).fold(zero, |sum, k| sum + root[i][k] * root[j][k]);
            root[i][j] = if i == j {
                rest.at_least(zero).sqrt()
            } else if root[j][j] > zero {
                rest / root[j][j]
            } else {
                zero
            };
        }
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_square_root_squares_to_what_it_came_from() {
        let lower: [[f64; N]; N] = core::array::from_fn(|i| {
            core::array::from_fn(|j| if j <= i { 1.0 + (i * 3 + j * 5) as f64 % 7.0 } else { 0.0 })
        });
        let square = |m: &[[f64; N]; N]| -> [[f64; N]; N] {
            core::array::from_fn(|i| core::array::from_fn(|j| (0..N).map(|k| m[i][k] * m[j][k]).sum()))
        };
        let (p, again) = (square(&lower), square(&square_root(&square(&lower))));
        assert!(p.iter().flatten().zip(again.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-9 * a.abs().max(1.0)));
        assert_eq!(square_root(&[[0.0; N]; N]), [[0.0; N]; N]);
    }
}
