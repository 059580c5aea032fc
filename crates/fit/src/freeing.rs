//! Which map of the file has another shape than the car's.
//!
//! The shifts are fitted with all shapes free first. A map is bound to the shape of the file again where that is more probable than another one,
//! both held equally probable before (Savage and Dickey's ratio of densities), the one that asks least for another shape first. This way round each decision is made near the minimum: a test of a shape that
//! is held has its power only there, and where a map is far from the car's, the values of others are wrong until it is free.
//!
//! What no fit frees, a finer shape of each map, is looked for at the end. Without fitting it, each shift has a gradient by its numbers, from which
//! what the other parameters and the shift's own unknowns can do is taken away: an efficient score. Where the shape is right, the scores
//! of the shifts scatter around zero. [Hotelling's T2](crate::hotelling) compares their mean with their own scatter, so it
//! needs neither the noise of the readings nor its correlation in time.

use drivetrain::Real;
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::hotelling::excess;
use crate::parameters::Prior;
use crate::shape::Map;
use crate::solver::Normal;
use crate::verdict::SIDES;

/// Probability with which a misfit is said where all maps are right \[chosen\].
pub(crate) const LEVEL: f64 = 0.01;
/// Fewer shifts do not show how much they differ, and free nothing.
const FEWEST: usize = 4;

/// The maps whose freed shape is not that of the file, by what is stated of it after so many shifts.
pub(crate) fn differing(priors: &[Prior], unknowns: &[f64], stated: &DMatrix<f64>, shifts: usize) -> Vec<Map> {
    let pair =
        |map: &Map| map.parameters().map(|parameter| priors.iter().position(|prior| prior.parameter == parameter));
    let mut free: Vec<(Map, [usize; 2])> = (Map::ALL.iter())
        .filter_map(|map| match pair(map) {
            [Some(one), Some(other)] => Some((*map, [one, other])),
            _ => None,
        })
        .collect();
    if shifts < FEWEST {
        return Vec::new();
    }
    let (mut at, mut covariance) = (DVector::from_column_slice(unknowns), stated.clone());
    loop {
        // Twice the logarithm of the ratio of probabilities: density of no change before over that after, which is Student's: a covariance
        // that rests on the scatter of few shifts is uncertain itself.
        let freedom = shifts as f64 - 1.0;
        let evidence = |(_, [i, j]): &(Map, [usize; 2])| {
            let (x, of) = chosen(&at, &covariance, [*i, *j]);
            let Some(inverse) = of.try_inverse() else { return 0.0 };
            let before = Real::powi(priors[*i].sd * priors[*j].sd, 2);
            let size = x.dot(&(inverse * x));
            (freedom + 2.0) * Real::ln_1p(size / freedom) - Real::ln(before / of.determinant())
        };
        let minimum = free.iter().enumerate().min_by(|one, other| evidence(one.1).total_cmp(&evidence(other.1)));
        let Some((place, bound)) = minimum.filter(|(_, map)| evidence(map) <= 0.0) else { break };
        let columns = covariance.select_columns(&bound.1);
        let (x, of) = chosen(&at, &covariance, bound.1);
        let gain = of.try_inverse().map(|inverse| &columns * DMatrix::from_column_slice(2, 2, inverse.as_slice()));
        free.remove(place);
        // What is known of the others when the shape of this one is that of the file.
        if let Some(gain) = gain {
            at -= &gain * DVector::from_column_slice(x.as_slice());
            covariance -= &gain * columns.transpose();
        }
    }
    free.into_iter().map(|(map, _)| map).collect()
}

/// Two of the unknowns and their covariance.
fn chosen(at: &DVector<f64>, covariance: &DMatrix<f64>, [i, j]: [usize; 2]) -> (Vector2<f64>, Matrix2<f64>) {
    let of = |a: usize, b: usize| covariance[(a, b)];
    (Vector2::new(at[i], at[j]), Matrix2::new(of(i, i), of(i, j), of(j, i), of(j, j)))
}

/// A finer shape that the shifts ask for.
pub(crate) struct Misfit {
    pub(crate) map: Map,
    /// How far it would move the fitted unknowns.
    pub(crate) moves: DVector<f64>,
    /// Whether it would move one of them out of its stated interval.
    pub(crate) is_grave: bool,
}

/// Pairs of numbers which the shifts ask not to be zero; the first `known` priors are fitted, after them come the pairs of `maps`.
pub(crate) fn misfits(
    priors: &[Prior],
    stated: &DMatrix<f64>,
    known: usize,
    maps: &[Map],
    normal: &Normal,
    unknowns: &[f64],
) -> Option<Vec<Misfit>> {
    let precision = |j: usize| Real::powi(priors[j].sd, -2);
    let mut fitted = normal.information.view((0, 0), (known, known)).into_owned();
    (0..known).for_each(|j| fitted[(j, j)] += precision(j));
    let fitted = fitted.cholesky()?;
    // What the priors and the driving between shifts pull is shared by all shifts, so that the gradients of what is fitted add up to none.
    let fraction = (normal.scores.len() as f64).recip();
    let pulls =
        DVector::from_fn(known, |j, _| fraction * (precision(j) * (unknowns[j] - priors[j].mean) + normal.driving[j]));
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
        let change = information.try_inverse().map_or(Vector2::zeros(), |inverse| -(inverse * sum));
        let moves = -(projected * DVector::from_column_slice(change.as_slice()));
        let is_grave = moves.iter().enumerate().any(|(j, x)| x.abs() > SIDES * stated[(j, j)].sqrt());
        if excess(&scores, LEVEL / maps.len() as f64) > 1.0 {
            found.push(Misfit { map: *map, moves, is_grave });
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameter;

    fn shape(map: Map, number: usize) -> Prior {
        Prior { parameter: Parameter::Shape(map, number), name: String::new(), mean: 0.0, sd: 1.0, floor: 0.0 }
    }

    /// Friction is far from the file's shape. The lag seems to be, because it is correlated with a gain that is not.
    #[test]
    fn a_shape_that_only_another_one_asks_for_is_bound_again() {
        let priors: Vec<Prior> =
            [Map::Friction, Map::Lag].into_iter().flat_map(|map| [0, 1].map(|i| shape(map, i))).collect();
        let mut covariance = DMatrix::identity(4, 4) * 1e-4;
        assert_eq!(differing(&priors, &[0.0, 0.1, 0.0, 0.0], &covariance, 20), [Map::Friction]);
        assert_eq!(differing(&priors, &[0.0, 0.01, 0.0, 0.1], &covariance, 20), [Map::Lag]);
        assert!(differing(&priors, &[0.0, 0.01, 0.0, 0.01], &covariance, 20).is_empty());
        assert!(differing(&priors, &[0.0, 0.1, 0.0, 0.1], &covariance, 3).is_empty());
        // Each alone lies within what is stated, but not both: one of them stays free.
        (covariance[(1, 3)], covariance[(3, 1)]) = (-0.99e-4, -0.99e-4);
        assert_eq!(differing(&priors, &[0.0, 0.03, 0.0, 0.031], &covariance, 20), [Map::Lag]);
    }
}
