//! How sure the parameters of a fit are.
//!
//! Stated is the larger of two variances: "auto", where the information is divided by the correlation of the residuals in sequence,
//! and "cluster", the spread of the shifts' own gradients. What the model leaves out (tyres with inertia, noise of the command) is in
//! neither: a factor and a floor stand for it.

use drivetrain::Real;
use nalgebra::{DMatrix, DVector};

use crate::parameters::{Held, Prior};
use crate::weights::FACTOR;

/// What is known of the parameters after a fit.
#[derive(Debug, Clone)]
pub struct Precision {
    /// Covariance of the unknowns as it is stated.
    pub stated: DMatrix<f64>,
    /// The larger of the two without the floor is at least this one, with the correlation of the residuals.
    pub auto: DMatrix<f64>,
}

impl Precision {
    /// Of the first unknowns, whatever the others are.
    pub(crate) fn of_first(&self, count: usize) -> Self {
        let first = |covariance: &DMatrix<f64>| covariance.view((0, 0), (count, count)).into_owned();
        Self { stated: first(&self.stated), auto: first(&self.auto) }
    }

    /// Widens what is known by a move of the unknowns that the shifts ask for and the fit does not make, as one standard deviation.
    pub(crate) fn with_move(&mut self, moved: &DVector<f64>, priors: &[Prior]) {
        let outer = moved * moved.transpose();
        self.auto += &outer;
        self.stated += outer;
        // No fit knows less than was known before.
        for (i, prior) in priors.iter().enumerate() {
            let scale = (prior.sd / self.stated[(i, i)].sqrt()).min(1.0);
            self.stated.row_mut(i).scale_mut(scale);
            self.stated.column_mut(i).scale_mut(scale);
        }
    }

    /// Makes it what was known before.
    pub(crate) fn forget_all(&mut self, priors: &[Prior]) {
        let variances = DVector::from_iterator(priors.len(), priors.iter().map(|prior| prior.sd * prior.sd));
        self.stated = DMatrix::from_diagonal(&variances);
        self.auto = self.stated.clone();
    }

    /// Standard deviation of a combination of unknowns as it is stated.
    pub(crate) fn combination_sd(&self, along: &DVector<f64>) -> f64 {
        /// Minimum one: what the model leaves out does not shrink with more shifts.
        const FLOOR: f64 = 0.005;
        Real::hypot(along.dot(&(&self.auto * along)).max(0.0).sqrt(), FLOOR)
    }
}

/// The precision at a minimum where the data have this information, and these gradients of shifts and drives.
pub(crate) fn precision(
    priors: &[Prior],
    information: &DMatrix<f64>,
    scores: &[DVector<f64>],
    held: &[Held],
) -> Option<Precision> {
    let count = priors.len();
    let prior = DMatrix::from_diagonal(&DVector::from_iterator(count, priors.iter().map(|p| Real::powi(p.sd, -2))));
    let mut auto = (information + &prior).cholesky()?.inverse();
    let cluster = cluster(&auto, scores, &prior);
    let mut stated = auto.clone();
    // Each parameter takes the larger variance; the correlations are those of "auto".
    for (i, prior) in priors.iter().enumerate() {
        let found = Real::hypot(auto[(i, i)].max(cluster[(i, i)]).sqrt(), prior.floor);
        // No fit knows less than was known before.
        let scale = found.min(prior.sd) / auto[(i, i)].sqrt();
        stated.row_mut(i).scale_mut(scale);
        stated.column_mut(i).scale_mut(scale);
    }
    for covariance in [&mut auto, &mut stated] {
        for (weights, variance) in unidentified(priors, held) {
            forget(covariance, &weights, variance);
        }
    }
    Some(Precision { stated, auto })
}

/// Combinations of the unknowns of which data may say nothing, with the variance that the priors leave them.
///
/// The factor of all torques: what speeds seem to say of it comes from rolling resistance, drag and the inertia of
/// the wheels, which the file takes as exact. And what is held near the file.
fn unidentified(priors: &[Prior], held: &[Held]) -> Vec<(DVector<f64>, f64)> {
    let (scale, precision) = torque_scale(priors);
    let mut combinations = vec![(scale, precision.recip())];
    for held in held {
        if let Some(place) = priors.iter().position(|prior| prior.parameter == held.parameter) {
            let mut only = DVector::zeros(priors.len());
            only[place] = 1.0;
            combinations.push((only, held.sd * held.sd));
        }
    }
    combinations
}

/// The logarithm of the factor of all torques as a combination of the unknowns, and its precision, by the priors alone.
pub(crate) fn torque_scale(priors: &[Prior]) -> (DVector<f64>, f64) {
    let power = |prior: &Prior| prior.parameter.power_of_torque();
    let precision: f64 = priors.iter().map(|prior| Real::powi(power(prior) / prior.sd, 2)).sum();
    let weights = priors.iter().map(|prior| power(prior) / (prior.sd * prior.sd * precision));
    (DVector::from_iterator(priors.len(), weights), precision)
}

/// Gives a combination of unknowns at least this variance; what is known of the others when it is known stays as it is.
pub(crate) fn forget(covariance: &mut DMatrix<f64>, weights: &DVector<f64>, variance: f64) {
    let with = &*covariance * weights;
    let now = weights.dot(&with);
    if now < variance {
        *covariance += &with * with.transpose() * ((variance - now) / (now * now));
    }
}

/// The sandwich over shifts, or groups of them: how much they disagree.
pub(crate) fn cluster(covariance: &DMatrix<f64>, scores: &[DVector<f64>], prior: &DMatrix<f64>) -> DMatrix<f64> {
    let count = scores.len() as f64;
    if scores.len() < 2 {
        return covariance.clone();
    }
    let mut middle = prior.clone();
    for score in scores {
        middle += score * score.transpose() * (FACTOR * FACTOR * count / (count - 1.0));
    }
    covariance * middle * covariance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_forgotten_has_the_variance_of_before_and_the_rest_given_it_stays() {
        let mut covariance = DMatrix::from_row_slice(2, 2, &[4.0, -3.9, -3.9, 4.0]);
        let given = |c: &DMatrix<f64>| c[(1, 1)] - c[(0, 1)] * c[(0, 1)] / c[(0, 0)];
        let before = given(&covariance);
        let first = DVector::from_vec(vec![1.0, 0.0]);
        forget(&mut covariance, &first, 16.0);
        assert!((covariance[(0, 0)] - 16.0).abs() < 1e-12);
        assert!((given(&covariance) - before).abs() < 1e-12);
        let same = covariance.clone();
        forget(&mut covariance, &first, 9.0);
        assert_eq!(covariance, same);
    }
}
