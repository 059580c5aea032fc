//! The cost of the shifts of one pair of gears, and its normal equations.
//!
//! Each shift has unknowns of its own (load, start of each segment). They are eliminated by their Schur complement, so the
//! cost grows linearly with the shifts, and a step has only as many unknowns as there are parameters.

use car::Shaft;
use std::ops::ControlFlow;

use drivetrain::Real;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::FitError;
use crate::car::Car;
use crate::drives::{DriveNormal, Drives};
use crate::least_squares::{Equations, Iterations, Minimum, Objective, minimised};
use crate::parameters::Prior;
use crate::shift_model::{Block, Changed, Linearised, ShiftModel};
use crate::shift_weights::ShiftWeights;

/// What does not change during a fit.
pub(crate) struct Problem<'a> {
    pub(crate) file: &'a Car,
    pub(crate) shafts: &'a [Shaft],
    pub(crate) priors: &'a [Prior],
    pub(crate) drives: &'a Drives<'a>,
}

/// The unknowns of a fit.
#[derive(Debug, Clone)]
pub(crate) struct Unknowns {
    pub(crate) shared: Vec<f64>,
    /// Of each shift.
    pub(crate) own: Vec<Vec<f64>>,
    /// Standard deviation of the mass in the driving of each log.
    pub(crate) drives: Vec<f64>,
}

impl Unknowns {
    /// Those that driving depends on.
    pub(crate) fn of_driving(&self) -> [&[f64]; 2] {
        [&self.shared, &self.drives]
    }
}

/// Where a fit ended.
pub(crate) struct Solved {
    pub(crate) at: Unknowns,
    pub(crate) weights: ShiftWeights,
    /// The last step was small; otherwise the iterations were used up.
    pub(crate) is_converged: bool,
    /// Where the last step began.
    pub(crate) normal: Normal,
}

/// Normal equations of the parameters with the shifts' own unknowns eliminated.
pub(crate) struct Normal {
    /// Information of the data, without the priors.
    pub(crate) information: DMatrix<f64>,
    /// Half the gradient of the data by the parameters, of each shift.
    pub(crate) scores: Vec<DVector<f64>>,
    /// That of the driving between them, of all logs.
    pub(crate) driving: DVector<f64>,
    eliminated: Vec<Eliminated>,
    drives: Vec<DriveNormal>,
}

impl Normal {
    /// The gradients of shifts and drives.
    pub(crate) fn all_scores(&self) -> Vec<DVector<f64>> {
        self.scores.iter().chain(self.drives.iter().map(|drive| &drive.score)).cloned().collect()
    }

    /// What the own unknowns of shifts and drives can take away of the cost with the parameters as they are.
    fn own_decrease(&self) -> f64 {
        let shifts = self.eliminated.iter().map(Eliminated::decrease).sum::<f64>();
        shifts + self.drives.iter().map(DriveNormal::own_decrease).sum::<f64>()
    }
}

/// What is needed to find the own unknowns of a shift when the parameters are known.
struct Eliminated {
    own: Cholesky<f64, Dyn>,
    gradient: DVector<f64>,
    mixed: DMatrix<f64>,
}

impl Eliminated {
    /// Their step: a fraction of their own one, and what follows from a step of the parameters.
    fn step(&self, parameters: &DVector<f64>, fraction: f64) -> DVector<f64> {
        -self.own.solve(&(&self.gradient * fraction + &self.mixed * parameters))
    }

    /// What their own step takes away of the cost.
    fn decrease(&self) -> f64 {
        0.5 * self.gradient.dot(&self.own.solve(&self.gradient))
    }
}

impl Problem<'_> {
    /// Residuals of each shift.
    pub(crate) fn residuals(&self, shifts: &[ShiftModel], at: &Unknowns) -> Vec<DVector<f64>> {
        let car = self.file.with(self.shafts, self.priors, &at.shared);
        (shifts.iter().zip(&at.own)).map(|(shift, own)| shift.residuals(&car, &shift.inputs(&car), own)).collect()
    }

    /// Half the robust sum of squares, priors included.
    fn cost(&self, shifts: &[ShiftModel], at: &Unknowns, residuals: &[DVector<f64>], weights: &ShiftWeights) -> f64 {
        let prior: f64 = (self.priors.iter().zip(&at.shared)).map(|(p, x)| Real::powi((x - p.mean) / p.sd, 2)).sum();
        let data = shifts.iter().zip(residuals).zip(&at.own).map(|((shift, rows), own)| {
            let mut errors = rows.clone();
            weights.errors(&shift.blocks, errors.as_mut_slice());
            let own: f64 = shift.own.iter().zip(own).map(|(u, x)| Real::powi((x - u.mean) / u.sd, 2)).sum();
            let of_block = |block: &Block| weights.of(block.channel).cost(&errors.as_slice()[block.rows.clone()]);
            0.5 * own + shift.blocks.iter().map(of_block).sum::<f64>()
        });
        let driving = self.drives.cost(self.priors, at.of_driving(), &weights.drives);
        0.5 * prior + data.sum::<f64>() + driving
    }

    pub(crate) fn linearised(&self, shifts: &[ShiftModel], at: &Unknowns) -> Vec<Linearised> {
        let car = self.file.with(self.shafts, self.priors, &at.shared);
        let changed = Changed::all(self.file, self.shafts, self.priors, &at.shared);
        shifts.iter().zip(&at.own).map(|(shift, own)| shift.linearised(&car, &changed, own)).collect()
    }

    /// The normal equations.
    pub(crate) fn normal(
        &self,
        shifts: &[ShiftModel],
        lines: &[Linearised],
        at: &Unknowns,
        weights: &ShiftWeights,
    ) -> Result<Normal, FitError> {
        let count = self.priors.len();
        let drives = self.drives.normal(self.priors, at.of_driving(), &weights.drives)?;
        let sum = |zero: DMatrix<f64>| drives.iter().fold(zero, |sum, drive| sum + &drive.information);
        let mut normal = Normal {
            information: sum(DMatrix::zeros(count, count)),
            scores: Vec::new(),
            driving: drives.iter().fold(DVector::zeros(count), |sum, drive| sum + &drive.score),
            eliminated: Vec::new(),
            drives,
        };
        for ((shift, lines), own) in shifts.iter().zip(lines).zip(&at.own) {
            let mut all = DMatrix::zeros(shift.rows, count + own.len());
            all.columns_mut(0, count).copy_from(&lines.by_parameter);
            all.columns_mut(count, own.len()).copy_from(&lines.by_own);
            let mut errors = lines.residuals.clone();
            weights.errors(&shift.blocks, errors.as_mut_slice());
            let mut roots = DVector::zeros(shift.rows);
            for block in &shift.blocks {
                let channel = weights.of(block.channel);
                block.rows.clone().for_each(|row| roots[row] = channel.weight(errors[row]).sqrt());
            }
            errors.component_mul_assign(&roots);
            for mut column in all.column_iter_mut() {
                weights.errors(&shift.blocks, column.as_mut_slice());
                column.component_mul_assign(&roots);
            }
            let squares = squares(&all);
            let gradient = all.tr_mul(&errors);
            let own_count = own.len();
            let mut own_square = squares.view((count, count), (own_count, own_count)).into_owned();
            let mut own_gradient = gradient.rows(count, own_count).into_owned();
            for (j, (unknown, x)) in shift.own.iter().zip(own).enumerate() {
                let precision = Real::powi(unknown.sd, -2);
                own_square[(j, j)] += precision;
                own_gradient[j] += precision * (x - unknown.mean);
            }
            let cholesky = own_square.cholesky().ok_or_else(|| not_finite(&shift.record.name))?;
            let mixed = squares.view((count, 0), (own_count, count)).into_owned();
            let shared = squares.view((0, 0), (count, count));
            normal.information += shared - mixed.tr_mul(&cholesky.solve(&mixed));
            normal.scores.push(gradient.rows(0, count) - mixed.tr_mul(&cholesky.solve(&own_gradient)));
            normal.eliminated.push(Eliminated { own: cholesky, gradient: own_gradient, mixed });
        }
        Ok(normal)
    }

    /// Goes on from unknowns until a step is small.
    pub(crate) fn solve(
        &self,
        shifts: &[ShiftModel],
        at: Unknowns,
        weights: ShiftWeights,
        iterations: Iterations,
        progress: &mut dyn FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Solved, FitError> {
        let residuals = self.residuals(shifts, &at);
        let mut weighed = Weighed { problem: self, shifts, weights };
        let Minimum { at: Point { unknowns, .. }, line, is_converged } =
            minimised(&mut weighed, Point { unknowns: at, residuals }, iterations, progress)?;
        Ok(Solved { at: unknowns, weights: weighed.weights, is_converged, normal: line })
    }
}

/// `A' A`, of which only one half is computed.
fn squares(a: &DMatrix<f64>) -> DMatrix<f64> {
    let mut squares = DMatrix::zeros(a.ncols(), a.ncols());
    for j in 0..a.ncols() {
        for i in 0..=j {
            squares[(i, j)] = a.column(i).dot(&a.column(j));
        }
    }
    squares.fill_lower_triangle_with_upper_triangle();
    squares
}

/// A problem with weights.
struct Weighed<'a> {
    problem: &'a Problem<'a>,
    shifts: &'a [ShiftModel],
    weights: ShiftWeights,
}

/// Unknowns and what they leave of the readings of each shift.
#[derive(Clone)]
struct Point {
    unknowns: Unknowns,
    residuals: Vec<DVector<f64>>,
}

impl Objective for Weighed<'_> {
    type Point = Point;
    type Line = Normal;

    fn parameters<'a>(&self, point: &'a Point) -> &'a [f64] {
        &point.unknowns.shared
    }

    fn limits(&self, place: usize) -> [f64; 2] {
        self.problem.priors[place].limits()
    }

    fn reweighted(&mut self, point: Point) -> Point {
        self.weights = self.weights.clone().following(self.shifts, &point.residuals);
        self.weights.drives = self.problem.drives.following(self.problem.priors, point.unknowns.of_driving());
        point
    }

    fn cost(&self, point: &Point) -> f64 {
        self.problem.cost(self.shifts, &point.unknowns, &point.residuals, &self.weights)
    }

    fn equations(&self, Point { unknowns, .. }: &Point) -> Result<Equations<Normal>, FitError> {
        let lines = self.problem.linearised(self.shifts, unknowns);
        let normal = self.problem.normal(self.shifts, &lines, unknowns, &self.weights)?;
        let mut information = normal.information.clone();
        let mut gradient: DVector<f64> = normal.scores.iter().sum::<DVector<f64>>() + &normal.driving;
        for (j, (prior, x)) in self.problem.priors.iter().zip(&unknowns.shared).enumerate() {
            let precision = Real::powi(prior.sd, -2);
            information[(j, j)] += precision;
            gradient[j] += precision * (x - prior.mean);
        }
        Ok(Equations { information, gradient, own_decrease: normal.own_decrease(), line: normal })
    }

    fn moved(&self, from: &Point, normal: &Normal, shared: Vec<f64>, fraction: f64) -> Point {
        let step = DVector::from_column_slice(&shared) - DVector::from_column_slice(&from.unknowns.shared);
        let own = (from.unknowns.own.iter().zip(&normal.eliminated))
            .map(|(own, eliminated)| {
                let step = eliminated.step(&step, fraction);
                own.iter().zip(step.iter()).map(|(x, dx)| x + dx).collect()
            })
            .collect();
        let drives = normal.drives.iter().zip(&from.unknowns.drives);
        let drives = drives.map(|(drive, x)| drive.stepped(*x, &step, fraction)).collect();
        let unknowns = Unknowns { shared, own, drives };
        Point { residuals: self.problem.residuals(self.shifts, &unknowns), unknowns }
    }

    fn not_finite(&self) -> FitError {
        not_finite("the shifts")
    }
}

fn not_finite(what: &str) -> FitError {
    FitError::Work(format!(
        "the fit left the range in which the model of {what} can be computed\nhint: check units and signs of the channels with `wetclutch inspect`"
    ))
}
