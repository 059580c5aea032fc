//! `H` from samples of the model error: the smallest ellipsoid around zero that holds them all.

use nalgebra::{DMatrix, DVector};

/// Rounds of the algorithm; the volume is then within a per cent of the smallest.
const ROUNDS: usize = 500;

/// A lower triangular `H` such that every sample is `H w` with `|w| <= 1`, of nearly the smallest volume; `None`
/// without samples that span the space.
///
/// By the multiplicative algorithm for D-optimal designs (S. Silvey, D. Titterington, B. Torsney, 1978): weights
/// grow where `x' M^-1 x` exceeds the dimension, with `M` the weighted sum of `x x'`. The last step stretches the
/// ellipsoid to the outermost sample, so that it holds all of them whatever the rounds left undone.
pub fn enclosing_matrix(samples: &[DVector<f64>]) -> Option<DMatrix<f64>> {
    let dimension = samples.first()?.len();
    let mut weights = vec![1.0 / samples.len() as f64; samples.len()];
    let moment = |weights: &[f64]| {
        (samples.iter().zip(weights))
            .fold(DMatrix::zeros(dimension, dimension), |sum, (x, &weight)| sum + x * x.transpose() * weight)
    };
    for _ in 0..ROUNDS {
        let cholesky = moment(&weights).cholesky()?;
        for (weight, x) in weights.iter_mut().zip(samples) {
            *weight *= x.dot(&cholesky.solve(x)) / dimension as f64;
        }
    }
    let cholesky = moment(&weights).cholesky()?;
    let reach = samples.iter().map(|x| x.dot(&cholesky.solve(x))).fold(0.0, f64::max);
    Some(cholesky.l() * reach.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ellipsoid_of_a_known_one_is_found_again() {
        let shape = DMatrix::from_row_slice(2, 2, &[3.0, 0.0, 1.0, 0.5]);
        let on_circle = (0..100).map(|i| std::f64::consts::TAU * f64::from(i) / 100.0);
        let samples: Vec<_> = on_circle.map(|a| &shape * DVector::from_vec(vec![a.cos(), a.sin()])).collect();
        let found = enclosing_matrix(&samples).unwrap();
        assert!((&found - &shape).abs().max() < 0.02, "{found}");
        let inverse = found.try_inverse().unwrap();
        assert!(samples.iter().all(|x| (&inverse * x).norm() <= 1.0 + 1e-9));
    }

    #[test]
    fn samples_on_a_line_have_no_ellipsoid() {
        let samples = [1.0, 2.0].map(|x| DVector::from_vec(vec![x, x]));
        assert!(enclosing_matrix(&samples).is_none() && enclosing_matrix(&[]).is_none());
    }
}
