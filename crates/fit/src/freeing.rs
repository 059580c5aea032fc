//! Which map of the file has another shape than the car's.
//!
//! Each map has two numbers of a freed shape that are zero in the file. Without fitting them, each shift has a gradient by these numbers,
//! from which what the other parameters and the shift's own unknowns can do is taken away: an efficient score. Where the shape
//! is right, the scores of the shifts scatter around zero. [Hotelling's T2](crate::hotelling) compares their mean with their own scatter, so
//! it needs neither the noise of the readings nor its correlation in time.

use config::Vehicle;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::FitError;
use crate::car::Car;
use crate::fitting::scaled_by_priors;
use crate::hotelling::excess;
use crate::intervals::floor;
use crate::parameters::{self, Prior, Shaft};
use crate::shape::Map;
use crate::shift_model::{Linearised, ShiftModel};
use crate::solver::{NO_INFLATION, Problem, Solved, Unknowns};
use crate::weights::Weights;

/// Probability with which a map is freed where all are right \[chosen: a map that is freed in vain costs some time, one that is not freed
/// makes the values of others wrong\].
pub(crate) const LEVEL: f64 = 0.01;
/// Standard deviations of the floor of the intervals below which a change of shape changes nothing that is stated.
const RELEVANT: f64 = 2.0;

/// Iterations from near a minimum on, and those of them with new scales once a map is freed.
const LAST_ITERATIONS: u32 = 12;
const LAST_SCALED: u32 = 2;

/// How far the freed shapes moved the unknowns.
pub(crate) fn moved(priors: &[Prior], before: &[f64], after: &[f64]) -> DVector<f64> {
    let mut bound = before.to_vec();
    bound.resize(priors.len(), 0.0);
    let [bound, free] = [bound, after.to_vec()].map(|unknowns| DVector::from_vec(scaled_by_priors(priors, unknowns)));
    free - bound
}

/// A minimum with the maps that the residuals ask to be of another shape.
pub(crate) struct Freed {
    /// Those of the unknowns, and after them those of the shapes that are not freed.
    pub(crate) priors: Vec<Prior>,
    pub(crate) solved: Solved,
    /// At the minimum, by all of the priors.
    pub(crate) lines: Vec<Linearised>,
    pub(crate) freed: Vec<Map>,
}

/// Goes on from near a minimum: frees the maps whose shape the residuals ask for, fits again, and so on.
pub(crate) fn with_freed_maps(
    vehicle: &Vehicle,
    file: &Car,
    shafts: &[Shaft],
    mut priors: Vec<Prior>,
    models: &[ShiftModel],
    mut solved: Solved,
    say: &mut dyn FnMut(u32),
) -> Result<Freed, FitError> {
    let mut freed = Vec::new();
    let mut is_minimum = false;
    loop {
        let known = priors.len();
        let bound: Vec<Map> = file.knots.maps().iter().copied().filter(|map| !freed.contains(map)).collect();
        let shapes = bound.iter().flat_map(|map| parameters::shape_priors(vehicle, &file.knots, *map));
        let all: Vec<Prior> = priors.iter().cloned().chain(shapes).collect();
        let mut at = solved.at.clone();
        at.shared.resize(all.len(), 0.0);
        let problem = Problem { file, shafts, priors: &all };
        let lines = problem.linearised(models, &at);
        let asked = asked(&problem, known, &bound, models, &lines, &at, &solved.weights)?;
        if asked.is_empty() && is_minimum {
            return Ok(Freed { priors: all, solved: Solved { at, ..solved }, lines, freed });
        }
        for map in &asked {
            priors.extend(parameters::shape_priors(vehicle, &file.knots, *map));
            if *map == Map::Friction {
                parameters::free_friction(vehicle, &mut priors);
            }
        }
        freed.extend(asked);
        let mut at = solved.at;
        at.shared.resize(priors.len(), 0.0);
        let problem = Problem { file, shafts, priors: &priors };
        // Other scales are of use only to another model.
        let scaled = if priors.len() > known { LAST_SCALED } else { 0 };
        solved = problem.solve(models, at, solved.weights, (scaled, LAST_ITERATIONS), say)?;
        is_minimum = true;
    }
}

/// The maps whose shape the residuals ask to be another, by the last two priors for each of `maps`; the first `known` priors
/// are fitted.
fn asked(
    problem: &Problem<'_>,
    known: usize,
    maps: &[Map],
    shifts: &[ShiftModel],
    lines: &[Linearised],
    at: &Unknowns,
    weights: &Weights,
) -> Result<Vec<Map>, FitError> {
    let normal = problem.normal(shifts, lines, at, weights, &NO_INFLATION, 0.0)?;
    let precision = |j: usize| problem.priors[j].sd.powi(-2);
    let mut fitted = normal.information.view((0, 0), (known, known)).into_owned();
    (0..known).for_each(|j| fitted[(j, j)] += precision(j));
    let singular = || FitError::Work("the information of the shifts is not finite".to_owned());
    let fitted = fitted.cholesky().ok_or_else(singular)?;
    // What the priors pull is shared by all shifts, so that the gradients of what is fitted add up to none.
    let share = (shifts.len() as f64).recip();
    let pulls = DVector::from_fn(known, |j, _| share * precision(j) * (at.shared[j] - problem.priors[j].mean));
    let mut found = Vec::new();
    for (i, map) in maps.iter().enumerate() {
        let place = known + 2 * i;
        let mixed: DMatrix<f64> = normal.information.view((0, place), (known, 2)).into_owned();
        let projected = fitted.solve(&mixed);
        let scores: Vec<Vector2<f64>> = (normal.scores.iter())
            .map(|score| {
                let of_fitted = score.rows(0, known) + &pulls;
                let of_map = score.rows(place, 2) - projected.tr_mul(&of_fitted);
                Vector2::new(of_map[0], of_map[1])
            })
            .collect();
        let rest = normal.information.view((place, place), (2, 2)) - mixed.tr_mul(&projected);
        let information = Matrix2::new(
            rest[(0, 0)] + precision(place),
            rest[(0, 1)],
            rest[(1, 0)],
            rest[(1, 1)] + precision(place + 1),
        );
        let sum: Vector2<f64> = scores.iter().sum();
        let change = information.try_inverse().map_or(Vector2::zeros(), |inverse| inverse * sum);
        let is_relevant =
            map.parameters().into_iter().zip(change.iter()).any(|(p, change)| change.abs() > RELEVANT * floor(p));
        let excess = excess(&scores, LEVEL / Map::ALL.len() as f64);
        if is_relevant && excess > 1.0 {
            found.push(*map);
        }
    }
    Ok(found)
}
