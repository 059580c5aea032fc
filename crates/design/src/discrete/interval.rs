//! The gain with the narrowest interval: `A_i = Phi - L G_i Psi` has no negative entry at any vertex, so a lowest and a highest
//! estimate that hold the truth go on holding it, and the width `W` of `x = e + L n` (see [`super::system`]) obeys
//!
//! ```text
//! W+ <= A W + |(I - A) L| n + |L| T |H| w + v
//! ```
//!
//! (J. Gouzé, A. Rapaport, Z. Hadj-Sadok, Interval observers for uncertain biological systems, 2000). For weights `l > 0` with
//! `l' A_i <= rho_i l'` at every vertex, `l' W` ends below the largest `l' (|(I - A_i) L| n + |L| ... + v) / (1 - rho_i)`; the
//! weight of the pressure is 1, and to its error `|L| n` of the last reading is added.
//!
//! The program: with `Y = diag(l) L` and one `rho` for all vertices the conditions are linear, and so is the cost, if the part
//! of the readings is taken as `|Y| n` for `x` and `|Y| n` of the pressure for the last one, which with one state it is. A line
//! search finds `rho`; the bound is evaluated without these simplifications.

use nalgebra::{DMatrix, DVector};

use super::found::{DiscreteMargin, Found, slowest};
use super::norm::Norm;
use super::search::{Search, SolverRecord, min_over};
use super::system::{Corner, ErrorSystem};
use crate::iss::DesignError;
use crate::lmi::{Block, Problem, block};

/// The gain is sought in multiples of this, so that the unknowns are of order 1.
const GAIN_UNIT: f64 = 30.0;
/// Where the search for `1 - rho` ends: a factor between its last two values.
const WITHIN: f64 = 0.005;
/// What an entry of `diag(l) A_i` must have above zero, for rounding.
const ENTRY_RESERVE: f64 = 1e-6;

/// The gain with the minimum ultimate bound on the width of the pressure, if one is certified.
pub(crate) fn narrowest_interval(
    system: &ErrorSystem,
    round: impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<(Option<Found>, SolverRecord), DesignError> {
    let mut search = Search::default();
    // A gain makes an error decay faster than the valve alone, but may let that of the shaft torque decay slower.
    let range = [0.01 * (1.0 - slowest(system)), 1.0];
    min_over(range, WITHIN, |left| {
        let problem = program(system, 1.0 - left);
        let Some(x) = search.solve(&problem) else { return f64::INFINITY };
        search.keep(certified(system, &x, &round));
        // The bound with one `rho`: unlike that of the gain it has one minimum.
        let cost: f64 = problem.objective.iter().zip(&x).map(|(cost, x)| cost * x).sum();
        (cost + direct_size(system, system.states() - 1)) / left
    });
    search.finish()
}

/// What reaches an entry of the error past the gain in a sample, at most.
fn direct_size(system: &ErrorSystem, state: usize) -> f64 {
    system.corners.iter().map(|corner| corner.direct_columns.row(state).abs().sum()).fold(0.0, f64::max)
}

/// Where the unknowns stand: the weights but that of the pressure, `Y` by rows, the sizes of the entries of `Y` times the
/// errors, those of `Y` times the readings' errors.
struct Layout {
    states: usize,
    outputs: usize,
    causes: usize,
    readings: usize,
}

impl Layout {
    fn of(system: &ErrorSystem) -> Self {
        Self {
            states: system.states(),
            outputs: system.h.nrows(),
            causes: system.corners[0].columns.ncols(),
            readings: system.readings.ncols(),
        }
    }

    fn y_at(&self) -> usize {
        self.states - 1
    }

    fn size_at(&self) -> usize {
        self.y_at() + self.states * self.outputs
    }

    fn reading_at(&self) -> usize {
        self.size_at() + self.states * self.causes
    }

    fn unknowns(&self) -> usize {
        self.reading_at() + self.states * self.readings
    }

    fn weights(&self, x: &[f64]) -> DMatrix<f64> {
        let of_pressure = [1.0];
        DMatrix::from_diagonal(&DVector::from_iterator(
            self.states,
            x[..self.y_at()].iter().chain(&of_pressure).copied(),
        ))
    }

    fn y(&self, x: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.states, self.outputs, &x[self.y_at()..self.size_at()]) * GAIN_UNIT
    }
}

/// The program for this `rho`.
fn program(system: &ErrorSystem, rho: f64) -> Problem {
    let at = Layout::of(system);
    let unknowns = at.unknowns();
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let mut blocks: Vec<Block> = Vec::new();
    for corner in &system.corners {
        let weighted = |x: &[f64]| at.weights(x) * &corner.phi - at.y(x) * &corner.g_psi;
        for b in 0..at.states {
            for a in 0..at.states {
                blocks.push(block(unknowns, |x| one(weighted(x)[(a, b)] - ENTRY_RESERVE)));
            }
            blocks.push(block(unknowns, |x| one(rho * at.weights(x)[(b, b)] - weighted(x).column(b).sum())));
        }
    }
    let mut size_of = |size: usize, a: usize, column: &DVector<f64>| {
        for sign in [1.0, -1.0] {
            blocks.push(block(unknowns, |x| one(x[size] + sign * (at.y(x).row(a) * column)[0])));
        }
    };
    for a in 0..at.states {
        for (c, corner) in (0..at.causes).flat_map(|c| system.corners.iter().map(move |corner| (c, corner))) {
            size_of(at.size_at() + a * at.causes + c, a, &corner.columns.column(c).into_owned());
        }
        for c in 0..at.readings {
            size_of(at.reading_at() + a * at.readings + c, a, &system.readings.column(c).into_owned());
        }
    }
    for k in 0..at.y_at() {
        blocks.push(block(unknowns, |x| one(x[k] - ENTRY_RESERVE)));
    }
    // The bound with one `rho`, times `1 - rho`, but for what reaches the pressure whatever the gain.
    let mut objective = vec![0.0; unknowns];
    for (k, weight) in objective[..at.y_at()].iter_mut().enumerate() {
        *weight = direct_size(system, k);
    }
    objective[at.size_at()..at.reading_at()].fill(1.0);
    objective[at.reading_at()..].fill(1.0 - rho);
    objective[unknowns - at.readings..].fill(2.0 * (1.0 - rho));
    Problem { objective, blocks }
}

/// The gain of a solution with its bound; from here on the solver is not believed.
fn certified(system: &ErrorSystem, x: &[f64], round: &impl Fn(&DMatrix<f64>) -> DMatrix<f64>) -> Option<Found> {
    let at = Layout::of(system);
    let (weights, y) = (at.weights(x).diagonal(), at.y(x));
    let gain = round(&DMatrix::from_fn(at.states, at.outputs, |i, j| y[(i, j)] / weights[i]));
    let matrices: Vec<DMatrix<f64>> = system.corners.iter().map(|corner| corner.error_dynamics(&gain)).collect();
    let margins: Vec<DiscreteMargin> = (system.corners.iter().zip(&matrices))
        .map(|(corner, matrix)| DiscreteMargin { label: corner.label.clone(), minimum: matrix.min() })
        .collect();
    let norm = Norm::Weighted(weights.clone());
    let contraction = matrices.iter().map(|matrix| norm.factor(matrix)).fold(0.0, f64::max);
    if margins.iter().any(|margin| margin.minimum < 0.0) || contraction >= 1.0 || weights.iter().any(|w| *w <= 0.0) {
        return None;
    }
    let bound_at = |(corner, matrix): (&Corner, &DMatrix<f64>)| {
        let of_readings = (DMatrix::identity(at.states, at.states) - matrix) * &gain * &system.readings;
        let through = &gain * &corner.columns;
        let size =
            |columns: &DMatrix<f64>| -> f64 { (0..at.states).map(|a| weights[a] * columns.row(a).abs().sum()).sum() };
        let added = size(&of_readings) + size(&through) + size(&corner.direct_columns);
        added / (1.0 - norm.factor(matrix))
    };
    let bound = system.corners.iter().zip(&matrices).map(bound_at).fold(0.0, f64::max);
    let bound = bound + system.last_reading(&gain);
    Some(Found { gains: vec![gain], bound, margins, norm, contraction })
}
