//! Whether pairs of numbers have a mean: Hotelling's T2.
//!
//! ```text
//! T2 = n m' S^-1 m,   F = (n - 2)/(2 (n - 1)) T2
//! ```
//!
//! `m` is the mean of the `n` pairs and `S` their covariance. Where normal pairs have no mean, `F(2, n - 2)` exceeds
//! `((n - 2)/2) (level^(-2/(n - 2)) - 1)` with probability `level`: of two and `n - 2` degrees of freedom it has a closed form. So T2
//! exceeds `(n - 1) (level^(-2/(n - 2)) - 1)`.

use drivetrain::Real;
use nalgebra::{Matrix2, Vector2};

/// Fewer pairs tell nothing.
const FEWEST: usize = 4;

/// Hotelling's T2 of pairs whose mean should be zero over its limit at this level; zero where they are too few to tell.
pub(crate) fn excess(pairs: &[Vector2<f64>], level: f64) -> f64 {
    if pairs.len() < FEWEST {
        return 0.0;
    }
    let count = pairs.len() as f64;
    let limit = (count - 1.0) * (Real::powf(level, -2.0 / (count - 2.0)) - 1.0);
    let mean = pairs.iter().sum::<Vector2<f64>>() / count;
    let scatter =
        pairs.iter().map(|pair| (pair - mean) * (pair - mean).transpose()).sum::<Matrix2<f64>>() / (count - 1.0);
    let Some(inverse) = scatter.try_inverse() else { return 0.0 };
    let excess = count * mean.dot(&(inverse * mean)) / limit;
    if excess.is_finite() { excess } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs without a mean, by a linear congruential generator: sums of twelve uniform numbers.
    fn pairs(count: usize, state: &mut u64) -> Vec<Vector2<f64>> {
        let mut normal = || {
            (0..12).fold(-6.0, |sum, _| {
                *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                sum + (*state >> 11) as f64 / 2.0_f64.powi(53)
            })
        };
        (0..count)
            .map(|_| {
                let x = normal();
                Vector2::new(3.0 * x, x + normal())
            })
            .collect()
    }

    #[test]
    fn pairs_without_a_mean_exceed_the_limit_as_often_as_the_level_says() {
        let mut state = 7;
        for count in [5, 20] {
            let often = (0..20_000).filter(|_| excess(&pairs(count, &mut state), 0.05) > 1.0).count();
            // Five standard deviations of such a count around 1000.
            assert!((845..1155).contains(&often), "{count}: {often}");
        }
    }

    #[test]
    fn a_mean_is_found_and_too_few_pairs_tell_nothing() {
        let mut state = 8;
        let off: Vec<_> = pairs(20, &mut state).into_iter().map(|pair| pair + Vector2::new(4.0, 0.0)).collect();
        assert!(excess(&off, 0.01) > 1.0);
        assert_eq!(excess(&off[..3], 0.01), 0.0);
        assert_eq!(excess(&[Vector2::new(1.0, 1.0); 9], 0.01), 0.0);
        assert_eq!(excess(&[Vector2::new(f64::NAN, 1.0); 9], 0.01), 0.0);
    }
}
