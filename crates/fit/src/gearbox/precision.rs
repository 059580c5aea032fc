//! How sure the parameters are: the larger of two standard deviations, one with the correlation of the residuals in time and one from
//! the scatter of the groups of shifts, times a factor and with a floor, as in the one-shift fit.
//!
//! A group is all shifts between the same gears of one kind: what the model leaves out, such as the drag of the elements that are open
//! there, is alike in them.

use nalgebra::{DMatrix, DVector};

use super::shift::ShiftModel;
use super::solver::{Problem, Solved};
use crate::FitError;
use crate::weights::{FACTOR, correlation_factor};

/// Covariance of the unknowns as it is stated.
pub(crate) fn stated(problem: &Problem<'_>, models: &[ShiftModel], solved: &Solved) -> Result<DMatrix<f64>, FitError> {
    let count = solved.at.len();
    let information = solved.shifts.iter().fold(DMatrix::zeros(count, count), |sum, shift| sum + &shift.information);
    let errors: Vec<&[f64]> = solved.shifts.iter().map(|shift| shift.errors.as_slice()).collect();
    let inflation = correlation_factor(&errors).max(1.0);
    let inverse = |matrix: DMatrix<f64>| {
        let singular = || FitError::Work("the information of the shifts is not finite".to_owned());
        Ok::<_, FitError>(matrix.cholesky().ok_or_else(singular)?.inverse())
    };
    let plain = inverse(&information + &problem.precision)?;
    let auto = inverse(information / inflation + &problem.precision)?;
    let cluster = cluster(problem, models, solved, &plain);
    let scale = DVector::from_fn(count, |j, _| {
        let found = FACTOR * auto[(j, j)].max(cluster[(j, j)]).sqrt();
        // No fit knows less than was known before.
        let sd = found.hypot(problem.quantities.all[j].floor()).min(problem.quantities.sd_before(j));
        sd / auto[(j, j)].sqrt()
    });
    Ok(DMatrix::from_fn(count, count, |i, j| scale[i] * scale[j] * auto[(i, j)]))
}

/// The sandwich over groups of shifts: how much they disagree.
fn cluster(problem: &Problem<'_>, models: &[ShiftModel], solved: &Solved, plain: &DMatrix<f64>) -> DMatrix<f64> {
    let mut groups: Vec<(&ShiftModel, DVector<f64>)> = Vec::new();
    for (model, shift) in models.iter().zip(&solved.shifts) {
        let is_same = |other: &ShiftModel| (other.pair, other.kind) == (model.pair, model.kind);
        match groups.iter_mut().find(|(other, _)| is_same(other)) {
            Some((_, sum)) => *sum += &shift.score,
            None => groups.push((model, shift.score.clone())),
        }
    }
    if groups.len() < 2 {
        return plain.clone();
    }
    let count = groups.len() as f64;
    let mut middle = problem.precision.clone();
    for (_, score) in &groups {
        middle += score * score.transpose() * (count / (count - 1.0));
    }
    plain * middle * plain
}
