//! Robust least squares with intervals for a few unknowns.

use drivetrain::Real;
use nalgebra::{DMatrix, DVector};

use crate::intervals::cluster;
use crate::weights::{FACTOR, HUBER, correlation};

/// Turns in which the weights follow the errors.
const TURNS: u32 = 5;

/// A measured value and its derivatives by the unknowns.
pub(crate) struct Line<const N: usize> {
    /// Derivatives by the unknowns.
    pub(crate) row: [f64; N],
    pub(crate) value: f64,
    /// Time over which its error adds up, s.
    pub(crate) span_s: f64,
    /// Lines whose errors may be alike.
    pub(crate) group: usize,
}

/// What lines tell of the unknowns: their values, and the larger of two standard deviations, with the correlation of the errors in sequence, and by the
/// scatter of the groups.
pub(crate) struct Identified<const N: usize> {
    pub(crate) value: [f64; N],
    pub(crate) sd: [f64; N],
}

impl<const N: usize> Identified<N> {
    /// From lines, and the values and standard deviations of before; none if the equations have no finite solution.
    pub(crate) fn of(lines: &[Line<N>], before: [f64; N], sd: [f64; N]) -> Option<Self> {
        let root = |i: usize| lines[i].span_s.sqrt();
        let problem = Regression {
            rows: DMatrix::from_fn(lines.len(), N, |i, j| lines[i].row[j] / root(i)),
            values: DVector::from_fn(lines.len(), |i, _| lines[i].value / root(i)),
            before: DVector::from_row_slice(&before),
            precision: DMatrix::from_diagonal(&DVector::from_row_slice(&sd.map(|sd| Real::powi(sd, -2)))),
        };
        let mut at = problem.before.clone();
        let mut covariance = problem.precision.clone();
        for _ in 0..TURNS {
            (at, covariance) = problem.step(&problem.weights(&at))?;
        }
        let weighed = problem.weights(&at).component_mul(&(&problem.values - &problem.rows * &at));
        let mut scores = vec![DVector::zeros(N); lines.last()?.group + 1];
        for (i, line) in lines.iter().enumerate() {
            scores[line.group] += problem.rows.row(i).transpose() * weighed[i];
        }
        let cluster = cluster(&covariance, &scores, &problem.precision);
        let found = Self {
            value: std::array::from_fn(|j| at[j]),
            sd: std::array::from_fn(|j| covariance[(j, j)].max(cluster[(j, j)]).sqrt()),
        };
        found.value.iter().chain(&found.sd).all(|number| number.is_finite()).then_some(found)
    }
}

/// The lines, each over the root of its time, so that their errors are alike.
struct Regression {
    rows: DMatrix<f64>,
    values: DVector<f64>,
    before: DVector<f64>,
    precision: DMatrix<f64>,
}

impl Regression {
    /// Weights of the lines at unknowns.
    fn weights(&self, at: &DVector<f64>) -> DVector<f64> {
        let errors = &self.values - &self.rows * at;
        let scale = scale_of(&errors);
        let in_scales: Vec<f64> = errors.iter().map(|error| error / scale).collect();
        let variance = scale * scale * FACTOR * FACTOR * correlation(&[&in_scales], 0.0, 1.0);
        errors.map(|error| (HUBER * scale / error.abs()).min(1.0) / variance)
    }

    /// The unknowns with these weights, and their covariance.
    fn step(&self, weights: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut weighed = self.rows.clone();
        weighed.row_iter_mut().zip(weights.iter()).for_each(|(mut row, weight)| row *= *weight);
        let cholesky = (self.rows.tr_mul(&weighed) + &self.precision).cholesky()?;
        let right = weighed.tr_mul(&self.values) + &self.precision * &self.before;
        Some((cholesky.solve(&right), cholesky.inverse()))
    }
}

/// Robust standard deviation.
fn scale_of(errors: &DVector<f64>) -> f64 {
    let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    (1.4826 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)).max(1e-9)
}
