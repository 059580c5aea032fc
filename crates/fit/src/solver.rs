//! Gauss-Newton with Levenberg's damping over many shifts.
//!
//! Each shift has unknowns of its own (load, start of each segment). They are eliminated by their Schur complement, so the
//! cost grows linearly with the shifts, and the step has only as many unknowns as there are parameters. A general solver would factor
//! one matrix of all shifts' rows and unknowns, and would not know of scales that change between steps.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::FitError;
use crate::car::Car;
use crate::drives::{DriveNormal, Drives};
use crate::parameters::{Prior, Shaft};
use crate::shift_model::{Block, Linearised, ShiftModel};
use crate::weights::{HUBER, Weights};

/// The steps of a stage of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Iterations {
    /// With new scales and gains.
    pub(crate) scaled: u32,
    /// All of them.
    pub(crate) most: u32,
    pub(crate) end: End,
}

/// What ends a stage of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct End {
    /// A step that changes no unknown by more than so many of its standard deviations.
    pub(crate) small: f64,
    /// A step of up to so many of them,
    pub(crate) passable: f64,
    /// which lowers the cost by less than this. At kinks of the model, such as the kiss point, steps go to and fro around a minimum.
    pub(crate) decrease: f64,
}

impl End {
    /// That of a fit. From a minimum to a standard deviation of `d` away the cost grows by `d^2/2`.
    pub(crate) const OF_FIT: Self = Self { small: 0.2, passable: 0.5, decrease: 0.1 };
    /// Where something else follows.
    pub(crate) const COARSE: Self = Self { small: 0.5, passable: f64::INFINITY, decrease: 0.5 };

    fn is_reached(self, size: f64, decrease: f64) -> bool {
        size <= self.small || (size <= self.passable && decrease <= self.decrease)
    }
}
/// Dampings tried in one iteration.
const TRIES: u32 = 8;

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
    /// Deviation of the mass in the driving of each log.
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
    pub(crate) weights: Weights,
    /// The last step was small; otherwise the iterations were used up.
    pub(crate) is_converged: bool,
    /// Where the last step began.
    pub(crate) lines: Vec<Linearised>,
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
}

/// What is needed to find the own unknowns of a shift when the parameters are known.
struct Eliminated {
    own: Cholesky<f64, Dyn>,
    gradient: DVector<f64>,
    mixed: DMatrix<f64>,
}

impl Problem<'_> {
    /// Residuals of each shift.
    pub(crate) fn residuals(&self, shifts: &[ShiftModel], at: &Unknowns) -> Vec<DVector<f64>> {
        let car = self.file.with(self.shafts, self.priors, &at.shared);
        (shifts.iter().zip(&at.own)).map(|(shift, own)| shift.residuals(&car, &shift.inputs(&car), own)).collect()
    }

    /// Half the robust sum of squares, priors included.
    fn cost(&self, shifts: &[ShiftModel], at: &Unknowns, residuals: &[DVector<f64>], weights: &Weights) -> f64 {
        let prior: f64 = (self.priors.iter().zip(&at.shared)).map(|(p, x)| ((x - p.mean) / p.sd).powi(2)).sum();
        let data = shifts.iter().zip(residuals).zip(&at.own).map(|((shift, rows), own)| {
            let mut errors = rows.clone();
            weights.errors(&shift.blocks, errors.as_mut_slice());
            let huber = |e: f64| if e.abs() <= HUBER { e * e } else { HUBER * (2.0 * e.abs() - HUBER) };
            let own: f64 = shift.own.iter().zip(own).map(|(u, x)| ((x - u.mean) / u.sd).powi(2)).sum();
            let of_block = |block: &Block| {
                let sum: f64 = errors.as_slice()[block.rows.clone()].iter().map(|e| huber(*e)).sum();
                sum / weights.inflation[block.channel as usize]
            };
            own + shift.blocks.iter().map(of_block).sum::<f64>()
        });
        let driving = self.drives.cost(self.priors, at.of_driving(), &weights.drives);
        0.5 * (prior + data.sum::<f64>()) + driving
    }

    pub(crate) fn linearised(&self, shifts: &[ShiftModel], at: &Unknowns) -> Vec<Linearised> {
        let linearised = |(shift, own): (&ShiftModel, &Vec<f64>)| {
            shift.linearised(self.file, self.shafts, self.priors, &at.shared, own)
        };
        shifts.iter().zip(&at.own).map(linearised).collect()
    }

    /// The normal equations.
    pub(crate) fn normal(
        &self,
        shifts: &[ShiftModel],
        lines: &[Linearised],
        at: &Unknowns,
        weights: &Weights,
        damping: f64,
    ) -> Result<Normal, FitError> {
        let count = self.priors.len();
        let drives = self.drives.normal(self.priors, at.of_driving(), &weights.drives, damping)?;
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
            for mut column in all.column_iter_mut() {
                weights.errors(&shift.blocks, column.as_mut_slice());
            }
            for block in &shift.blocks {
                for row in block.rows.clone() {
                    let robust = (HUBER / errors[row].abs()).min(1.0);
                    let root = (robust / weights.inflation[block.channel as usize]).sqrt();
                    errors[row] *= root;
                    all.row_mut(row).iter_mut().for_each(|cell| *cell *= root);
                }
            }
            let squares = all.tr_mul(&all);
            let gradient = all.tr_mul(&errors);
            let own_count = own.len();
            let mut own_square = squares.view((count, count), (own_count, own_count)).into_owned();
            let mut own_gradient = gradient.rows(count, own_count).into_owned();
            for (j, (unknown, x)) in shift.own.iter().zip(own).enumerate() {
                let precision = unknown.sd.powi(-2);
                own_square[(j, j)] = (own_square[(j, j)] + precision) * (1.0 + damping);
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
        mut at: Unknowns,
        mut weights: Weights,
        iterations: Iterations,
        progress: &mut dyn FnMut(u32),
    ) -> Result<Solved, FitError> {
        let mut is_converged = false;
        let mut damping = 1e-3;
        let mut residuals = self.residuals(shifts, &at);
        let mut lines = Vec::new();
        for iteration in 0..iterations.most {
            progress(iteration);
            // The first residuals are those of the file, whose scale says nothing of the readings.
            if (1..=iterations.scaled).contains(&iteration) {
                weights = weights.following(shifts, &residuals);
                weights.drives = self.drives.following(self.priors, at.of_driving());
            }
            lines = self.linearised(shifts, &at);
            let cost = self.cost(shifts, &at, &residuals, &weights);
            if !cost.is_finite() {
                return Err(not_finite("the shifts"));
            }
            let (mut largest, mut decrease) = (f64::INFINITY, f64::INFINITY);
            for _ in 0..TRIES {
                let normal = self.normal(shifts, &lines, &at, &weights, damping)?;
                let (next, size) = self.step(&at, &normal, damping)?;
                let next_residuals = self.residuals(shifts, &next);
                let next_cost = self.cost(shifts, &next, &next_residuals, &weights);
                if next_cost <= cost {
                    (at, residuals, largest, decrease) = (next, next_residuals, size, cost - next_cost);
                    damping = (damping / 10.0).max(1e-8);
                    break;
                }
                damping = (damping * 8.0).max(1e-6);
                // Where no damping helps, nothing smaller can be found.
                largest = size.min(iterations.end.small);
            }
            if iterations.end.is_reached(largest, decrease) && iteration > iterations.scaled {
                is_converged = true;
                break;
            }
        }
        Ok(Solved { at, weights, is_converged, lines })
    }

    /// The unknowns after a step, and its largest size in standard deviations after the fit.
    fn step(&self, at: &Unknowns, normal: &Normal, damping: f64) -> Result<(Unknowns, f64), FitError> {
        let mut matrix = normal.information.clone();
        let mut gradient: DVector<f64> = normal.scores.iter().sum::<DVector<f64>>() + &normal.driving;
        for (j, (prior, x)) in self.priors.iter().zip(&at.shared).enumerate() {
            let precision = prior.sd.powi(-2);
            matrix[(j, j)] = (matrix[(j, j)] + precision) * (1.0 + damping);
            gradient[j] += precision * (x - prior.mean);
        }
        let (whole, inverse) = self.within_limits(at, matrix, &gradient)?;
        let limited = |j: usize| {
            let [least, greatest] = self.priors[j].limits();
            (at.shared[j] + whole[j]).clamp(least, greatest)
        };
        let shared: Vec<f64> = (0..whole.len()).map(limited).collect();
        let step = DVector::from_fn(whole.len(), |j, _| shared[j] - at.shared[j]);
        let size = (0..step.len()).map(|j| step[j].abs() / inverse[(j, j)].sqrt()).fold(0.0, f64::max);
        let own = (at.own.iter().zip(&normal.eliminated))
            .map(|(own, eliminated)| {
                let step = -eliminated.own.solve(&(&eliminated.gradient + &eliminated.mixed * &step));
                own.iter().zip(step.iter()).map(|(x, dx)| x + dx).collect()
            })
            .collect();
        let drives = normal.drives.iter().zip(&at.drives).map(|(drive, x)| drive.stepped(*x, &step)).collect();
        Ok((Unknowns { shared, own, drives }, size))
    }
}

impl Problem<'_> {
    /// The step of the parameters and the inverse of their matrix. A parameter that is at its limit and would leave it is held there
    /// before the others are solved for: clamped afterwards, it would have made their steps wrong again and again.
    fn within_limits(
        &self,
        at: &Unknowns,
        mut matrix: DMatrix<f64>,
        gradient: &DVector<f64>,
    ) -> Result<(DVector<f64>, DMatrix<f64>), FitError> {
        /// Precision over that of the data with which a parameter is held.
        const HELD: f64 = 1e9;
        let mut is_held = vec![false; gradient.len()];
        loop {
            let cholesky = matrix.clone().cholesky().ok_or_else(|| not_finite("the parameters"))?;
            let step = -cholesky.solve(gradient);
            let leaves = |j: usize| {
                let [least, greatest] = self.priors[j].limits();
                (at.shared[j] <= least && step[j] < 0.0) || (at.shared[j] >= greatest && step[j] > 0.0)
            };
            let leaving: Vec<usize> = (0..step.len()).filter(|j| !is_held[*j] && leaves(*j)).collect();
            if leaving.is_empty() {
                return Ok((step, cholesky.inverse()));
            }
            for j in leaving {
                is_held[j] = true;
                matrix[(j, j)] *= HELD;
            }
        }
    }
}

fn not_finite(what: &str) -> FitError {
    FitError::Work(format!(
        "the fit left the range in which the model of {what} can be computed\nhint: check units and signs of the channels with `wetclutch inspect`"
    ))
}
