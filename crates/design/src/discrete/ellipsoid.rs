//! The smallest ellipsoid that no error within the bounds can leave (J. Abedor, K. Nagpal, K. Poolla, A linear matrix
//! inequality approach to peak-to-peak gain minimization, 1996), by a line search on `lambda`:
//!
//! ```text
//! [ (1-lambda) P   0          (P Phi - Y G Psi)' ]
//! [ 0              diag(a)    (P B)'             ] >= 0 at every vertex,   sum a <= lambda,   [P C'; C g2] >= 0,   min g2
//! [ *              *          P                  ]
//! ```
//!
//! with `Y = P L` and `B` the columns of the errors; then ultimately `|C e| <= sqrt(g2)`. With one state and
//! one vertex this is the exact peak-to-peak gain.
//!
//! A gain that follows the friction has `Y = b_1 Y_1 + b_2 Y_2`. With `M_ij` the matrix above for `Y_i` at the vertex `j`, it is
//! certified between the ends if `M_11 >= 0`, `M_22 >= 0` and `M_12 + M_21 >= 0`.

use nalgebra::DMatrix;

use super::system::{Corner, ErrorSystem};
use super::{DiscreteMargin, Found, RESERVE, best_found, block, least_eigenvalue, solved, stacked};
use crate::iss::DesignError;
use crate::lmi::{Block, Problem};

/// The gain is sought in multiples of this, so that the unknowns are of order 1.
const GAIN_UNIT: f64 = 30.0;
/// Steps of the search for `lambda`; each shrinks its interval by 0.618.
const SEARCH_STEPS: usize = 14;

/// The gain, constant or following the friction, with the smallest bound.
pub(crate) fn smallest_ellipsoid(
    system: &ErrorSystem,
    scheduled: bool,
    round: impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<Found, DesignError> {
    let pairs = pairs(system, scheduled);
    best_found(0.01, 0.95, SEARCH_STEPS, |lambda| ellipsoid(system, &pairs, lambda, &round))
}

/// Inequalities: each the sum of the matrix above over some gains at some corners.
type Pairs<'a> = Vec<(String, Vec<(usize, &'a Corner)>)>;

fn pairs(system: &ErrorSystem, scheduled: bool) -> Pairs<'_> {
    let least = system.corners.iter().map(|corner| corner.friction).fold(f64::INFINITY, f64::min);
    let end = |corner: &Corner| usize::from(scheduled && corner.friction > least);
    let mut pairs: Pairs<'_> =
        system.corners.iter().map(|corner| (corner.label.clone(), vec![(end(corner), corner)])).collect();
    if scheduled {
        for (i, first) in system.corners.iter().enumerate() {
            for second in system.corners[i + 1..].iter().filter(|second| second.valve == first.valve) {
                let label = format!("{} with {}", first.label, second.label);
                pairs.push((label, vec![(end(second), first), (end(first), second)]));
            }
        }
    }
    pairs
}

/// The smallest ellipsoid for this `lambda`, if there is one. Unknowns: the upper triangle of `P`, each `Y` by rows, `a`, `g2`.
fn ellipsoid(
    system: &ErrorSystem,
    pairs: &Pairs<'_>,
    lambda: f64,
    round: &impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<Option<Found>, DesignError> {
    let direct = &system.direct_columns;
    let (states, outputs) = (system.states(), system.h.nrows());
    let through = system.corners[0].columns.ncols();
    let causes = through + direct.ncols();
    let count = 1 + pairs.iter().flat_map(|(_, terms)| terms).map(|(end, _)| *end).max().unwrap_or(0);
    let triangle = states * (states + 1) / 2;
    let a_at = triangle + count * states * outputs;
    let g2_at = a_at + causes;
    let unknowns = g2_at + 1;
    let p = |x: &[f64]| match states {
        1 => DMatrix::from_element(1, 1, x[0]),
        _ => DMatrix::from_row_slice(2, 2, &[x[0], x[1], x[1], x[2]]),
    };
    let y = |x: &[f64], end: usize| {
        let at = triangle + end * states * outputs;
        DMatrix::from_row_slice(states, outputs, &x[at..at + states * outputs]) * GAIN_UNIT
    };
    let matrix = |p: &DMatrix<f64>, y: &DMatrix<f64>, a: &[f64], corner: &Corner, lambda: f64, inflated: f64| {
        let n = states + causes;
        let mut diagonal = DMatrix::zeros(n, n);
        diagonal.view_mut((0, 0), (states, states)).copy_from(&(p * (1.0 - lambda)));
        for (j, a) in a.iter().enumerate() {
            diagonal[(states + j, states + j)] = *a;
        }
        let mut row = DMatrix::zeros(states, n);
        row.columns_mut(0, states).copy_from(&(p * &corner.phi - y * &corner.g_psi));
        row.columns_mut(states, through).copy_from(&(y * &corner.columns * -inflated));
        row.columns_mut(states + through, direct.ncols()).copy_from(&(p * direct * inflated));
        stacked(&diagonal, &row, p)
    };
    let sum = |p: &DMatrix<f64>, ys: &[DMatrix<f64>], a: &[f64], terms: &[(usize, &Corner)], lambda, inflated| {
        let matrices = terms.iter().map(|(end, corner)| matrix(p, &ys[*end], a, corner, lambda, inflated));
        matrices.reduce(|sum, matrix| sum + matrix).unwrap_or_default()
    };
    let mut blocks: Vec<Block> = (pairs.iter())
        .map(|(_, terms)| {
            block(unknowns, |x| {
                let ys: Vec<_> = (0..count).map(|end| y(x, end)).collect();
                sum(&p(x), &ys, &x[a_at..g2_at], terms, lambda, 1.0 + RESERVE)
            })
        })
        .collect();
    let mut pressure = DMatrix::zeros(1, states);
    pressure[(0, states - 1)] = 1.0;
    blocks.push(block(unknowns, |x| stacked(&p(x), &pressure, &DMatrix::from_element(1, 1, x[g2_at]))));
    let mut share = vec![0.0; unknowns];
    share[a_at..g2_at].fill(-1.0);
    // The check takes the smaller lambda on both sides, which leaves room for rounding in the decay too.
    let checked = lambda * (1.0 - RESERVE);
    blocks.push(Block::linear(checked * (1.0 - 1e-6), &share));
    let mut objective = vec![0.0; unknowns];
    objective[g2_at] = 1.0;
    let Some(x) = solved(&Problem { objective, blocks })? else { return Ok(None) };

    // From here on the solver is not believed.
    let p = p(&x);
    // An error that the gain does not let in has a multiplier of zero, up to the solver's tolerance.
    let a: Vec<f64> = x[a_at..g2_at].iter().map(|a| a.max(0.0) + checked * 0.5e-6 / causes as f64).collect();
    let Some(inverse) = p.clone().try_inverse() else { return Ok(None) };
    let gains: Vec<DMatrix<f64>> = (0..count).map(|end| round(&(&inverse * y(&x, end)))).collect();
    let ys: Vec<DMatrix<f64>> = gains.iter().map(|gain| &p * gain).collect();
    let margins: Vec<DiscreteMargin> = (pairs.iter())
        .map(|(label, terms)| DiscreteMargin {
            label: label.clone(),
            least: least_eigenvalue(&sum(&p, &ys, &a, terms, checked, 1.0)),
        })
        .collect();
    let holds = margins.iter().all(|margin| margin.least >= 0.0) && a.iter().sum::<f64>() <= checked;
    let bound = inverse[(states - 1, states - 1)].sqrt();
    Ok(holds.then_some(Found { gains, bound, margins }))
}
