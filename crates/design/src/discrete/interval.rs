//! The gain with the narrowest interval: `A_i = Phi - L G_i Psi` has no negative entry at any vertex, so a lowest and a highest
//! estimate that hold the truth go on holding it, and the distance `W` between estimate and truth obeys
//!
//! ```text
//! W+ <= A W + |L| (T |H| w + n) + v
//! ```
//!
//! (J. Gouzé, A. Rapaport, Z. Hadj-Sadok, Interval observers for uncertain biological systems, 2000). For weights `l > 0` with
//! `l' A_i <= rho l'` at every vertex, `l' W` ends below `l' (|L| ... + v) / (1 - rho)`. With `Y = diag(l) L` and the weight of
//! the pressure set to 1 that is a linear program for each `rho`; a line search finds `rho`.

use nalgebra::DMatrix;

use super::system::ErrorSystem;
use super::{DiscreteMargin, Found, best_found, block, solved};
use crate::iss::DesignError;
use crate::lmi::{Block, Problem};

/// The gain is sought in multiples of this, so that the unknowns are of order 1.
const GAIN_UNIT: f64 = 30.0;
/// Steps of the search for `rho`; each shrinks its interval by 0.618.
const SEARCH_STEPS: usize = 30;
/// What an entry of `diag(l) A_i` must have above zero, for rounding.
const ENTRY_RESERVE: f64 = 1e-6;

/// The gain with the least ultimate bound on the width of the pressure.
pub(crate) fn narrowest_interval(
    system: &ErrorSystem,
    round: impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<Found, DesignError> {
    best_found(0.0, 1.0, SEARCH_STEPS, |rho| interval(system, rho, &round))
}

/// For this `rho`, if there is one. Unknowns: the weights but that of the pressure, `Y` by rows, the sizes of the entries of
/// `Y` times the errors.
fn interval(
    system: &ErrorSystem,
    rho: f64,
    round: &impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<Option<Found>, DesignError> {
    let direct = &system.direct_columns;
    let through: Vec<&DMatrix<f64>> = system.corners.iter().map(|corner| &corner.columns).collect();
    let causes = through[0].ncols();
    let (states, outputs) = (system.states(), system.h.nrows());
    let y_at = states - 1;
    let size_at = y_at + states * outputs;
    let unknowns = size_at + states * causes;
    let weights = |x: &[f64]| -> Vec<f64> { x[..y_at].iter().copied().chain([1.0]).collect() };
    let y = |x: &[f64]| DMatrix::from_row_slice(states, outputs, &x[y_at..size_at]) * GAIN_UNIT;
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let mut blocks: Vec<Block> = Vec::new();
    for corner in &system.corners {
        let weighted = |x: &[f64]| {
            DMatrix::from_diagonal(&nalgebra::DVector::from_vec(weights(x))) * &corner.phi - y(x) * &corner.g_psi
        };
        for b in 0..states {
            for a in 0..states {
                blocks.push(block(unknowns, |x| one(weighted(x)[(a, b)] - ENTRY_RESERVE)));
            }
            blocks.push(block(unknowns, |x| one(rho * weights(x)[b] - weighted(x).column(b).sum())));
        }
    }
    for a in 0..states {
        for c in 0..causes {
            let size = size_at + a * causes + c;
            for (columns, sign) in through.iter().flat_map(|columns| [(columns, 1.0), (columns, -1.0)]) {
                blocks.push(block(unknowns, |x| one(x[size] + sign * (y(x).row(a) * columns.column(c))[0])));
            }
        }
    }
    for k in 0..y_at {
        blocks.push(block(unknowns, |x| one(x[k] - ENTRY_RESERVE)));
    }
    let mut objective = vec![0.0; unknowns];
    objective[size_at..].fill(1.0);
    for (k, weight) in objective[..y_at].iter_mut().enumerate() {
        *weight = direct.row(k).abs().sum();
    }
    let Some(x) = solved(&Problem { objective, blocks })? else { return Ok(None) };

    // From here on the solver is not believed.
    let weights = weights(&x);
    let y = y(&x);
    let gain = round(&DMatrix::from_fn(states, outputs, |i, j| y[(i, j)] / weights[i]));
    let matrices: Vec<DMatrix<f64>> = system.corners.iter().map(|corner| &corner.phi - &gain * &corner.g_psi).collect();
    let margins: Vec<DiscreteMargin> = (system.corners.iter().zip(&matrices))
        .map(|(corner, matrix)| DiscreteMargin { label: corner.label.clone(), least: matrix.min() })
        .collect();
    let column =
        |matrix: &DMatrix<f64>, b: usize| (0..states).map(|a| weights[a] * matrix[(a, b)]).sum::<f64>() / weights[b];
    let contraction = matrices.iter().flat_map(|matrix| (0..states).map(|b| column(matrix, b))).fold(0.0, f64::max);
    if margins.iter().any(|margin| margin.least < 0.0) || contraction >= 1.0 || weights.iter().any(|w| *w <= 0.0) {
        return Ok(None);
    }
    let added = |through: &DMatrix<f64>| -> f64 {
        (0..states).map(|a| weights[a] * ((gain.row(a) * through).abs().sum() + direct.row(a).abs().sum())).sum()
    };
    let added = through.into_iter().map(added).fold(0.0, f64::max);
    Ok(Some(Found { gains: vec![gain], bound: added / (1.0 - contraction), margins }))
}
