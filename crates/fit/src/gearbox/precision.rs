//! How sure the parameters are: the larger of two standard deviations, one with the correlation of the residuals in time and one from
//! the scatter of the shifts, times a factor and with a floor, as in the one-shift fit.

use nalgebra::{DMatrix, DVector};

use super::solver::{Problem, Solved};
use crate::FitError;
use crate::intervals::FACTOR;
use crate::weights::correlation_factor;

/// Covariance of the unknowns as it is stated.
pub(crate) fn stated(problem: &Problem<'_>, solved: &Solved) -> Result<DMatrix<f64>, FitError> {
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
    let cluster = cluster(problem, solved, &plain);
    let scale = DVector::from_fn(count, |j, _| {
        let found = FACTOR * auto[(j, j)].max(cluster[(j, j)]).sqrt();
        // No fit knows less than was known before.
        let sd = found.hypot(problem.quantities.all[j].floor()).min(problem.quantities.sd_before(j));
        sd / auto[(j, j)].sqrt()
    });
    Ok(DMatrix::from_fn(count, count, |i, j| scale[i] * scale[j] * auto[(i, j)]))
}

/// The sandwich over shifts: how much the shifts disagree.
fn cluster(problem: &Problem<'_>, solved: &Solved, plain: &DMatrix<f64>) -> DMatrix<f64> {
    let count = solved.shifts.len() as f64;
    if solved.shifts.len() < 2 {
        return plain.clone();
    }
    let mut middle = problem.precision.clone();
    for shift in &solved.shifts {
        middle += &shift.score * shift.score.transpose() * (count / (count - 1.0));
    }
    plain * middle * plain
}
