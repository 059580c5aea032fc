//! How sure the parameters of a fit are.
//!
//! The plain standard errors hold for independent errors of a perfect model. Stated is the larger of two that ask for less:
//! "auto", the information divided by the correlation of the residuals in sequence, and "cluster", the spread of the shifts' own
//! gradients. What the model leaves out (tyres with inertia, noise of the command) is in neither: a factor and a floor
//! stand for it.

use nalgebra::{DMatrix, DVector};

use crate::parameters::{DELAY_UNIT_S, HYSTERESIS_UNIT_PA, Prior};
use crate::shape::Map;
use crate::shift_model::{Linearised, ShiftModel};
use crate::solver::{NO_INFLATION, Problem, Unknowns};
use crate::weights::{Weights, correlation_factor};
use crate::{Channel, FitError, Parameter};

/// Factor on the larger of both standard deviations, from fits of cars whose parameters are known.
pub(crate) const FACTOR: f64 = 1.4;

/// What is known of the parameters after a fit.
#[derive(Debug, Clone)]
pub struct Precision {
    /// Covariance of the unknowns as it is stated.
    pub stated: DMatrix<f64>,
    /// Covariance with the correlation of the residuals, without factor and floor.
    pub auto: DMatrix<f64>,
}

impl Precision {
    /// Of the first unknowns, whatever the others are.
    pub(crate) fn of_first(&self, count: usize) -> Self {
        let first = |covariance: &DMatrix<f64>| covariance.view((0, 0), (count, count)).into_owned();
        Self { stated: first(&self.stated), auto: first(&self.auto) }
    }

    /// Widens what is known by how far the unknowns moved as the maps were given a freer shape. A shape that is freer still is taken to move
    /// them by half of that, the next by a quarter and so on: no further than as much again, which is two standard deviations \[chosen\].
    pub(crate) fn with_moved(&mut self, moved: &DVector<f64>, priors: &[Prior]) {
        let outer = 0.25 * moved * moved.transpose();
        self.auto += &outer / (FACTOR * FACTOR);
        self.stated += outer;
        // No fit knows less than was known before.
        for (i, prior) in priors.iter().enumerate() {
            let scale = (prior.sd / self.stated[(i, i)].sqrt()).min(1.0);
            self.stated.row_mut(i).scale_mut(scale);
            self.stated.column_mut(i).scale_mut(scale);
        }
    }

    /// Standard deviation of a combination of unknowns as it is stated.
    pub(crate) fn combination_sd(&self, along: &DVector<f64>) -> f64 {
        /// Least one: what the model leaves out does not shrink with more shifts.
        const FLOOR: f64 = 0.005;
        (FACTOR * along.dot(&(&self.auto * along)).max(0.0).sqrt()).hypot(FLOOR)
    }
}

/// Least standard deviation of a parameter: what the model leaves out does not shrink with more shifts.
pub(crate) fn floor(parameter: Parameter) -> f64 {
    match parameter {
        Parameter::Inertia(_) | Parameter::Stiffness => 0.015,
        Parameter::Damping | Parameter::Tyre | Parameter::Lag | Parameter::Shape(Map::Lag, _) => 0.02,
        Parameter::Hysteresis => 300.0 / HYSTERESIS_UNIT_PA,
        Parameter::WheelScale => 1e-4,
        Parameter::PressureScale => 1e-3,
        _ if parameter.is_delay() => 0.3e-3 / DELAY_UNIT_S,
        _ => 0.005,
    }
}

/// The precision at the minimum.
pub(crate) fn precision(
    problem: &Problem<'_>,
    shifts: &[ShiftModel],
    lines: &[Linearised],
    at: &Unknowns,
    weights: &Weights,
    untold_gain_sd: Option<f64>,
) -> Result<Precision, FitError> {
    let plain = problem.normal(shifts, lines, at, weights, &NO_INFLATION, 0.0)?;
    let inflation = inflation(shifts, lines.iter().map(|line| &line.residuals), weights);
    let auto = problem.normal(shifts, lines, at, weights, &inflation, 0.0)?;
    let count = problem.priors.len();
    let prior = DMatrix::from_diagonal(&DVector::from_iterator(count, problem.priors.iter().map(|p| p.sd.powi(-2))));
    let inverse = |matrix: DMatrix<f64>| {
        let singular = || FitError::Work("the information of the shifts is not finite".to_owned());
        Ok::<_, FitError>(matrix.cholesky().ok_or_else(singular)?.inverse())
    };
    let plain_covariance = inverse(&plain.information + &prior)?;
    let auto_covariance = inverse(&auto.information + &prior)?;
    let cluster = cluster(&plain_covariance, &plain.scores, &prior);
    let mut stated = auto_covariance.clone();
    // Each parameter takes the larger variance; the correlations are those of "auto".
    let scale: Vec<f64> = (0..count)
        .map(|j| {
            let auto = auto_covariance[(j, j)];
            let found = FACTOR * auto.max(cluster[(j, j)]).sqrt();
            let prior = &problem.priors[j];
            // No fit knows less than was known before.
            found.hypot(floor(prior.parameter)).min(prior.sd) / auto.sqrt()
        })
        .collect();
    for i in 0..count {
        for j in 0..count {
            stated[(i, j)] *= scale[i] * scale[j];
        }
    }
    let mut auto = auto_covariance;
    for covariance in [&mut auto, &mut stated] {
        for (weights, variance) in untold(problem.priors, untold_gain_sd) {
            forget(covariance, &weights, variance);
        }
    }
    Ok(Precision { stated, auto })
}

/// Combinations of the unknowns of which data may say nothing, with the variance that the priors leave them.
///
/// The factor of all torques: what speeds seem to say of it comes from rolling resistance, drag and the inertia of
/// the wheels, which the file takes as exact. The gain of the valve, where no pressure is measured: what speeds seem to say
/// of it comes from the shape of its lag over pressure.
fn untold(priors: &[Prior], untold_gain_sd: Option<f64>) -> Vec<(DVector<f64>, f64)> {
    let (scale, precision) = torque_scale(priors);
    let mut combinations = vec![(scale, precision.recip())];
    let gain = priors.iter().position(|prior| prior.parameter == Parameter::Gain);
    if let Some((gain, sd)) = gain.zip(untold_gain_sd) {
        let mut only = DVector::zeros(priors.len());
        only[gain] = 1.0;
        combinations.push((only, sd * sd));
    }
    combinations
}

/// The logarithm of the factor of all torques as a combination of the unknowns, and its precision, by the priors alone.
pub(crate) fn torque_scale(priors: &[Prior]) -> (DVector<f64>, f64) {
    let power = |prior: &Prior| prior.parameter.power_of_torque();
    let precision: f64 = priors.iter().map(|prior| (power(prior) / prior.sd).powi(2)).sum();
    let weights = priors.iter().map(|prior| power(prior) / (prior.sd * prior.sd * precision));
    (DVector::from_iterator(priors.len(), weights), precision)
}

/// Gives a combination of unknowns at least this variance; what is known of the others when it is known stays as it is.
fn forget(covariance: &mut DMatrix<f64>, weights: &DVector<f64>, variance: f64) {
    let with = &*covariance * weights;
    let now = weights.dot(&with);
    if now < variance {
        *covariance += &with * with.transpose() * ((variance - now) / (now * now));
    }
}

/// The sandwich over shifts: how much the shifts disagree.
fn cluster(covariance: &DMatrix<f64>, scores: &[DVector<f64>], prior: &DMatrix<f64>) -> DMatrix<f64> {
    let count = scores.len() as f64;
    if scores.len() < 2 {
        return covariance.clone();
    }
    let mut middle = prior.clone();
    for score in scores {
        middle += score * score.transpose() * (count / (count - 1.0));
    }
    covariance * middle * covariance
}

/// Correlation factor of each channel, at least 1.
fn inflation<'a>(
    shifts: &[ShiftModel],
    residuals: impl Iterator<Item = &'a DVector<f64>>,
    weights: &Weights,
) -> [f64; Channel::ALL.len()] {
    let errors: Vec<DVector<f64>> = (shifts.iter().zip(residuals))
        .map(|(shift, rows)| {
            let mut errors = rows.clone();
            weights.errors(&shift.blocks, errors.as_mut_slice());
            errors
        })
        .collect();
    Channel::ALL.map(|channel| {
        let blocks: Vec<&[f64]> = (shifts.iter().zip(&errors))
            .flat_map(|(shift, errors)| {
                let of_channel = shift.blocks.iter().filter(|block| block.channel == channel);
                of_channel.map(|block| &errors.as_slice()[block.rows.clone()])
            })
            .collect();
        if blocks.is_empty() { 1.0 } else { correlation_factor(&blocks).max(1.0) }
    })
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
