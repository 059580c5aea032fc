//! The size of an error in which a certificate says that it shrinks, and the longest step over which it does.

use car::{SAMPLE_TIMES_S, Vehicle};
use nalgebra::{DMatrix, DVector};
use observer::{Discretisation, Phase};

use super::model::Model;
use super::system::{Corner, corners};

/// How the size of an error is measured.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Norm {
    /// The root of `x' Q x`: `Q = R' R`, here `R` and its inverse.
    Ellipsoid(DMatrix<f64>, DMatrix<f64>),
    /// The sum of the sizes of all entries, each with its weight.
    Weighted(DVector<f64>),
}

impl Norm {
    /// The root of `x' Q x`, if `Q` is positive definite.
    pub(crate) fn ellipsoid(q: DMatrix<f64>) -> Option<Self> {
        let root = q.cholesky()?.l().transpose();
        let inverse = root.clone().try_inverse()?;
        Some(Self::Ellipsoid(root, inverse))
    }

    /// Length.
    pub(crate) fn euclidean(states: usize) -> Self {
        Self::Ellipsoid(DMatrix::identity(states, states), DMatrix::identity(states, states))
    }

    /// Largest factor by which this matrix multiplies the size of an error.
    pub(crate) fn factor(&self, matrix: &DMatrix<f64>) -> f64 {
        match self {
            Self::Ellipsoid(root, inverse) => (root * matrix * inverse).singular_values().max(),
            Self::Weighted(weights) => {
                (0..weights.len()).map(|b| weights.dot(&matrix.column(b).abs()) / weights[b]).fold(0.0, f64::max)
            }
        }
    }
}

/// Relative width of the interval in which the longest step is found.
const STEP_WITHIN: f64 = 1e-3;
/// Factor between the steps that are tried one after the other.
const NEXT_STEP: f64 = 1.02;

/// The longest step for which, and for all shorter ones down to `from_s`, this holds, s; at most the longest sample time that an
/// observer may have.
pub(crate) fn longest_step(from_s: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let longest_s = *SAMPLE_TIMES_S.end();
    let (mut held, mut next) = (from_s, from_s * NEXT_STEP);
    while next < longest_s && holds(next) {
        (held, next) = (next, next * NEXT_STEP);
    }
    if next >= longest_s && holds(longest_s) {
        return longest_s.max(from_s);
    }
    next = next.min(longest_s);
    while next - held > STEP_WITHIN * held {
        let middle = 0.5 * (held + next);
        if holds(middle) { held = middle } else { next = middle }
    }
    held
}

/// Gains (one, or two at the ends of the friction) with the contraction that is certified for a sample time: the longest step
/// over which they multiply the size of an error by at most the same factor, s.
pub(super) fn longest_certified_step(
    (vehicle, model, phase, sample_time_s): (&Vehicle, Model, Phase, f64),
    gains: &[DMatrix<f64>],
    norm: &Norm,
    contraction: f64,
) -> f64 {
    longest_step(sample_time_s, |step_s| {
        let corners = corners(vehicle, model, phase, step_s, Discretisation::Exact);
        error_dynamics(&corners, gains).iter().all(|matrix| norm.factor(matrix) <= contraction)
    })
}

/// Matrices whose means are all that `Phi - L G Psi` can be between the corners.
fn error_dynamics(corners: &[Corner], gains: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
    let [first, .., last] = gains else {
        return corners.iter().flat_map(|corner| gains.iter().map(|gain| corner.error_dynamics(gain))).collect();
    };
    let minimum = corners.iter().map(|corner| corner.friction).fold(f64::INFINITY, f64::min);
    let own = |corner: &Corner| if corner.friction > minimum { last } else { first };
    let mut matrices: Vec<_> = corners.iter().map(|corner| corner.error_dynamics(own(corner))).collect();
    for (i, one) in corners.iter().enumerate() {
        for other in corners[i + 1..].iter().filter(|other| other.valve == one.valve) {
            matrices.push((one.error_dynamics(own(other)) + other.error_dynamics(own(one))) * 0.5);
        }
    }
    matrices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_factor_is_the_largest_over_all_errors() {
        let matrix = DMatrix::from_row_slice(2, 2, &[0.5, -0.3, 0.2, 0.7]);
        let q = DMatrix::from_row_slice(2, 2, &[2.0, 0.5, 0.5, 1.0]);
        let weights = DVector::from_vec(vec![3.0, 1.0]);
        let length = |x: &DVector<f64>| (x.transpose() * &q * x)[0].sqrt();
        let sum = |x: &DVector<f64>| weights.dot(&x.abs());
        let around = (0..10_000).map(|k| 1e-4 * std::f64::consts::TAU * f64::from(k));
        let errors: Vec<_> = around.map(|a| DVector::from_vec(vec![a.cos(), a.sin()])).collect();
        let largest = |size: &dyn Fn(&DVector<f64>) -> f64| {
            errors.iter().map(|x| size(&(&matrix * x)) / size(x)).fold(0.0, f64::max)
        };
        let by_length = Norm::ellipsoid(q.clone()).unwrap().factor(&matrix);
        assert!((largest(&length) / by_length - 1.0).abs() < 1e-6, "{by_length}");
        let by_sum = Norm::Weighted(weights.clone()).factor(&matrix);
        assert!((largest(&sum) / by_sum - 1.0).abs() < 1e-3, "{by_sum}");
    }

    #[test]
    fn the_longest_step_is_the_first_beyond_which_it_does_not_hold() {
        let holds = |step_s: f64| !(0.0312..=0.05).contains(&step_s);
        assert!((longest_step(0.001, holds) / 0.0312 - 1.0).abs() < 2e-3);
        assert_eq!(longest_step(0.001, |_| true), *SAMPLE_TIMES_S.end());
        assert_eq!(longest_step(0.01, |_| false), 0.01);
    }
}
