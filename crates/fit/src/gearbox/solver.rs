//! The cost of the shifts of a car and of the driving between them, and its normal equations.
//!
//! A shift's own unknowns act linearly: for given parameters they are found at once, and the parameters see what is left (variable
//! projection). The weights are those of the one-shift fit.

use std::ops::ControlFlow;

use drivetrain::Real;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::quantities::Quantities;
use super::shift::{Linearised, MeasuredPressure, OWN, ShiftModel};
use crate::FitError;
use crate::driving::{DrivingModel, DrivingWeights, Evaluated};
use crate::least_squares::{Equations, Iterations, Minimum, Objective, minimised};
use crate::weights::ChannelWeights;

/// Steps after each of which the weights follow the residuals, and all of them.
const ITERATIONS: Iterations = Iterations { reweighted: 5, maximum: 20, decrease: 0.1 };
/// Turns in which the own unknowns of a shift are found with Huber's weights.
const OWN_TURNS: u32 = 4;
/// Standard deviations of what was known before beyond which nothing is held possible.
const LIMIT: f64 = 4.0;

/// Weights of the turbine speed and of the measured pressures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Weights {
    pub(crate) turbine: ChannelWeights,
    pub(crate) pressure: ChannelWeights,
    /// Of the balances of car and engine while driving, whose errors are independent already.
    pub(crate) driving: [DrivingWeights; 2],
}

impl Weights {
    /// Where a fit starts: what is usual.
    const START: Self = Self {
        turbine: ChannelWeights::usual(0.3, 0.5),
        pressure: ChannelWeights::usual(0.3, 3e3),
        driving: [DrivingWeights::START; 2],
    };
}

/// Shifts and driving at unknowns.
#[derive(Clone)]
pub(crate) struct Point {
    pub(crate) at: Vec<f64>,
    pub(crate) shifts: Vec<Profiled>,
    pub(crate) driving: Evaluated,
}

impl Point {
    /// Information about the unknowns, and half the gradient by them, with the sign of a step.
    pub(crate) fn normal(&self) -> (DMatrix<f64>, DVector<f64>) {
        let start = (self.driving.information.clone(), self.driving.score.clone());
        self.shifts
            .iter()
            .fold(start, |(information, score), shift| (information + &shift.information, score + &shift.score))
    }
}

/// A shift at unknowns, with its own unknowns at their best.
#[derive(Clone)]
pub(crate) struct Profiled {
    /// Residuals of the turbine speed, rad/s, and of measured pressures, Pa.
    residuals: Vec<f64>,
    pressure: Vec<Vec<f64>>,
    /// Half the gradient by the parameters, with the sign of a step.
    pub(crate) score: DVector<f64>,
    /// Information about the parameters, own unknowns eliminated.
    pub(crate) information: DMatrix<f64>,
    /// Error of the torque at the turbine, in its standard deviations.
    pub(crate) torque_error: f64,
    cost: f64,
}

/// Where a fit ended.
pub(crate) struct Solved {
    pub(crate) weights: Weights,
    pub(crate) is_converged: bool,
    pub(crate) point: Point,
}

/// A shift with its own unknowns at their best for these parameters.
fn profiled(shift: &ShiftModel, lines: &Linearised, weights: Weights) -> Profiled {
    let mut profiled = profiled_turbine(shift, lines, weights.turbine);
    for MeasuredPressure { residuals, by_parameter } in &lines.pressure {
        let mut errors = residuals.clone();
        let mut whitened = by_parameter.clone();
        weights.pressure.in_scales(errors.as_mut_slice());
        whitened.column_iter_mut().for_each(|mut column| weights.pressure.in_scales(column.as_mut_slice()));
        let mut all = whitened.clone();
        for (row, error) in errors.iter().enumerate() {
            all.row_mut(row).scale_mut(weights.pressure.weight(*error));
        }
        profiled.score += all.tr_mul(&errors);
        profiled.information += all.tr_mul(&whitened);
        profiled.cost += weights.pressure.cost(errors.as_slice());
        profiled.pressure.push(residuals.as_slice().to_vec());
    }
    profiled
}

fn profiled_turbine(shift: &ShiftModel, lines: &Linearised, weights: ChannelWeights) -> Profiled {
    let in_scales = |column: &mut [f64]| weights.in_scales(column);
    let mut by_own = lines.by_own.clone();
    by_own.column_iter_mut().for_each(|mut column| in_scales(column.as_mut_slice()));
    let mut of_parameters = lines.residuals.clone();
    in_scales(of_parameters.as_mut_slice());
    let precision = Matrix2::from_diagonal(&Vector2::from(shift.own_sd.map(|sd| Real::powi(sd, -2))));
    let mut own = Vector2::new(lines.residuals.get(0).copied().unwrap_or(0.0), 0.0);
    let weight = |error: f64| weights.weight(error);
    let own_step = |own: &Vector2<f64>| {
        let errors = &of_parameters - &by_own * own;
        let mut square = precision;
        let mut gradient = Vector2::zeros();
        for (row, error) in errors.iter().enumerate() {
            let line = Vector2::new(by_own[(row, 0)], by_own[(row, 1)]);
            square += weight(*error) * line * line.transpose();
            gradient += weight(*error) * *error * line;
        }
        // The start of a shift has no mean before.
        gradient[1] -= precision[(1, 1)] * own[1];
        (square, gradient)
    };
    for _ in 0..OWN_TURNS {
        let (square, gradient) = own_step(&own);
        own += square.try_inverse().map_or(Vector2::zeros(), |inverse| inverse * gradient);
    }
    let errors = &of_parameters - &by_own * own;
    let mut whitened = lines.by_parameter.clone();
    whitened.column_iter_mut().for_each(|mut column| in_scales(column.as_mut_slice()));
    let mut all = whitened.clone();
    for (row, error) in errors.iter().enumerate() {
        all.row_mut(row).scale_mut(weight(*error));
    }
    let (square, _) = own_step(&own);
    let mixed = by_own.tr_mul(&all);
    let inverse = square.try_inverse().unwrap_or_else(Matrix2::zeros);
    let information = all.tr_mul(&whitened) - mixed.tr_mul(&(inverse * &mixed));
    let cost = weights.cost(errors.as_slice()) + 0.5 * precision[(1, 1)] * own[1] * own[1];
    let residuals = (&lines.residuals - &lines.by_own * own).as_slice().to_vec();
    Profiled {
        residuals,
        pressure: Vec::new(),
        score: all.tr_mul(&errors),
        information,
        torque_error: own[1] / shift.own_sd[1],
        cost,
    }
}

/// What is fitted.
pub(crate) struct Models<'a> {
    pub(crate) shifts: &'a [ShiftModel],
    pub(crate) driving: DrivingModel<'a>,
}

/// What does not change during a fit.
pub(crate) struct Problem<'a> {
    pub(crate) quantities: &'a Quantities,
    /// Inverse of the covariance before the fit, with what is held.
    pub(crate) precision: DMatrix<f64>,
}

impl<'a> Problem<'a> {
    pub(crate) fn new(quantities: &'a Quantities) -> Result<Self, FitError> {
        /// Fraction of its standard deviation in which a quantity is held; none would make it a constant, with which nothing is correlated.
        const HELD_FRACTION: f64 = 0.1;
        let mut before = quantities.before.clone();
        quantities.held().for_each(|place| before[(place, place)] *= HELD_FRACTION * HELD_FRACTION);
        Ok(Self { quantities, precision: before.cholesky().ok_or_else(not_finite)?.inverse() })
    }

    /// Half the gradient of a shift by the parameters, with the sign of a step.
    pub(crate) fn score(&self, shift: &ShiftModel, at: &[f64], weights: Weights) -> DVector<f64> {
        profiled(shift, &shift.linearised(self.quantities, at), weights).score
    }

    /// Cost of shifts after one step from the values of the file, with the usual weights; infinite where there is no step.
    pub(crate) fn cost_after_a_step(&self, shifts: &[ShiftModel]) -> f64 {
        let profiled_at = |at: &[f64]| -> Vec<Profiled> {
            shifts.iter().map(|shift| profiled(shift, &shift.linearised(self.quantities, at), Weights::START)).collect()
        };
        let (mut information, mut score) = (self.precision.clone(), DVector::zeros(self.quantities.all.len()));
        for shift in profiled_at(&vec![0.0; score.len()]) {
            information += shift.information;
            score += shift.score;
        }
        let Some(curvature) = information.cholesky() else { return f64::INFINITY };
        let at = curvature.solve(&score);
        let before = 0.5 * at.dot(&(&self.precision * &at));
        let cost = before + profiled_at(at.as_slice()).iter().map(|shift| shift.cost).sum::<f64>();
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    fn point(&self, models: &Models<'_>, at: Vec<f64>, weights: Weights) -> Point {
        let shift = |shift: &ShiftModel| profiled(shift, &shift.linearised(self.quantities, &at), weights);
        Point {
            shifts: models.shifts.iter().map(shift).collect(),
            driving: models.driving.evaluated(&|term| self.quantities.place_of(term), &at, weights.driving),
            at,
        }
    }

    fn cost(&self, point: &Point) -> f64 {
        let at = DVector::from_column_slice(&point.at);
        let shifts = point.shifts.iter().map(|shift| shift.cost).sum::<f64>();
        0.5 * at.dot(&(&self.precision * &at)) + shifts + point.driving.cost
    }

    /// Finds the parameters of shifts and driving, from those of the file.
    pub(crate) fn solve(
        &self,
        models: &Models<'_>,
        progress: &mut dyn FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Solved, FitError> {
        let mut weighed = Weighed { problem: self, models, weights: Weights::START };
        let start = weighed.at(vec![0.0; self.quantities.all.len()]);
        let start = weighed.reweighted(start);
        let Minimum { at: point, is_converged, .. } = minimised(&mut weighed, start, ITERATIONS, progress)?;
        Ok(Solved { weights: weighed.weights, is_converged, point })
    }

    /// Names of the unknowns that ended where nothing beyond is held possible.
    pub(crate) fn at_limit(&self, at: &[f64]) -> Vec<String> {
        let is_there = |(j, _): &(usize, &f64)| at[*j].abs() >= LIMIT * self.quantities.sd_before(*j);
        at.iter().enumerate().filter(is_there).map(|(j, _)| self.quantities.name(self.quantities.all[j])).collect()
    }
}

/// A problem with weights.
struct Weighed<'a> {
    problem: &'a Problem<'a>,
    models: &'a Models<'a>,
    weights: Weights,
}

impl Weighed<'_> {
    fn at(&self, at: Vec<f64>) -> Point {
        self.problem.point(self.models, at, self.weights)
    }
}

impl Objective for Weighed<'_> {
    type Point = Point;
    type Line = ();

    fn parameters<'a>(&self, point: &'a Point) -> &'a [f64] {
        &point.at
    }

    fn limits(&self, place: usize) -> [f64; 2] {
        let limit = LIMIT * self.problem.quantities.sd_before(place);
        [-limit, limit]
    }

    fn reweighted(&mut self, point: Point) -> Point {
        self.weights = following(&point, self.weights);
        let place = |term| self.problem.quantities.place_of(term);
        self.weights.driving = self.models.driving.following(&place, &point.at);
        self.at(point.at)
    }

    fn cost(&self, point: &Point) -> f64 {
        self.problem.cost(point)
    }

    fn equations(&self, point: &Point) -> Result<Equations<()>, FitError> {
        let here = DVector::from_column_slice(&point.at);
        let (information, score) = point.normal();
        let gradient = &self.problem.precision * &here - score;
        // The own unknowns of a point are at their best.
        Ok(Equations { information: information + &self.problem.precision, gradient, own_decrease: 0.0, line: () })
    }

    fn moved(&self, _: &Point, (): &(), at: Vec<f64>, _: f64) -> Point {
        self.at(at)
    }

    fn not_finite(&self) -> FitError {
        not_finite()
    }
}

/// Gain, scale and inflation that the residuals of the shifts ask for.
fn following(point: &Point, before: Weights) -> Weights {
    let shifts = &point.shifts;
    let turbine: Vec<&[f64]> = shifts.iter().map(|shift| shift.residuals.as_slice()).collect();
    let pressure: Vec<&[f64]> = shifts.iter().flat_map(|shift| shift.pressure.iter().map(Vec::as_slice)).collect();
    Weights { turbine: before.turbine.following(&turbine), pressure: before.pressure.following(&pressure), ..before }
}

const _: () = assert!(OWN == 2, "the own unknowns are solved for as two");

fn not_finite() -> FitError {
    FitError::Work(
        "the fit left the range in which the model of the shifts can be computed\nhint: check units and signs of the channels with `wetclutch inspect`".to_owned(),
    )
}
