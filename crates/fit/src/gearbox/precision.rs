//! How sure the parameters are: the larger of two standard deviations, one with the correlation of the residuals in time and one from
//! the scatter of the groups of shifts, times a factor and with a floor, as in the one-shift fit.
//!
//! A group is all shifts between the same gears of one kind, or all driving in a gear: what the model leaves out, such as the drag of the
//! elements that are open there, is alike in them.

use drivetrain::Real;
use nalgebra::{DMatrix, DVector};

use super::shift::ShiftModel;
use super::solver::{Problem, Solved};
use super::unfitted::Unfitted;
use crate::{FitError, intervals};

/// Covariance of the unknowns as it is stated.
pub(crate) fn stated(
    problem: &Problem<'_>,
    models: &[ShiftModel],
    solved: &Solved,
    unfitted: &[Unfitted],
) -> Result<DMatrix<f64>, FitError> {
    let count = solved.point.at.len();
    let (information, _) = solved.point.normal();
    let singular = || FitError::Work("the information of the shifts is not finite".to_owned());
    let curvature = (information + &problem.precision).cholesky().ok_or_else(singular)?;
    let auto = curvature.inverse();
    let cluster = intervals::cluster(&auto, &scores(models, solved), &problem.precision);
    let mut stated = with_std_devs(&auto, |j| {
        let found =
            Real::hypot(auto[(j, j)].max(cluster[(j, j)]).sqrt(), problem.quantities.floor(problem.quantities.all[j]));
        // No fit knows less than was known before.
        found.min(problem.quantities.sd_before(j))
    });
    for place in problem.quantities.held() {
        let only = DVector::from_fn(count, |j, _| f64::from(u8::from(j == place)));
        intervals::forget(&mut stated, &only, problem.quantities.before[(place, place)]);
    }
    unfitted.iter().for_each(|error| error.add_to(&mut stated, problem, models, solved, &curvature));
    // Nor does one with what is held or not fitted.
    Ok(with_std_devs(&stated, |j| stated[(j, j)].sqrt().min(problem.quantities.sd_before(j))))
}

/// The covariance with the same correlations and other standard deviations.
fn with_std_devs(covariance: &DMatrix<f64>, sd: impl Fn(usize) -> f64) -> DMatrix<f64> {
    let scale: Vec<f64> = (0..covariance.nrows()).map(|j| sd(j) / covariance[(j, j)].sqrt()).collect();
    DMatrix::from_fn(scale.len(), scale.len(), |i, j| scale[i] * scale[j] * covariance[(i, j)])
}

/// The gradients of the groups of shifts and of driving.
fn scores(models: &[ShiftModel], solved: &Solved) -> Vec<DVector<f64>> {
    let mut groups: Vec<(&ShiftModel, DVector<f64>)> = Vec::new();
    for (model, shift) in models.iter().zip(&solved.point.shifts) {
        let is_same = |other: &ShiftModel| (other.pair, other.kind) == (model.pair, model.kind);
        match groups.iter_mut().find(|(other, _)| is_same(other)) {
            Some((_, sum)) => *sum += &shift.score,
            None => groups.push((model, shift.score.clone())),
        }
    }
    let of_driving = solved.point.driving.groups.iter().map(|(_, score)| score.clone());
    groups.into_iter().map(|(_, score)| score).chain(of_driving).collect()
}
