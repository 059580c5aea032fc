//! What a shift has shown of the lasting quantities that act in it.
//!
//! The filter knew them with a covariance `P` before the shift and with `P+` after it. With `P = L L'` and
//! `L^-1 P+ L^-T = Q v Q'` the shift was, in these directions, one measurement each:
//!
//! ```text
//! y_i = sqrt(1/v_i - 1) q_i' L^-1 a + noise of variance one
//! ```
//!
//! These measurements do not depend on what was known before. So what a shift says can be held against other knowledge
//! than the filter had in it.

use drivetrain::Real;

use super::learnt::{ACTING, Known};
use super::powertrain::dot;

/// A matrix of the acting quantities.
pub(super) type Matrix<T> = [[T; ACTING]; ACTING];

/// Part of a variance above which nothing was seen in this direction, and the minimum that is left of one \[chosen\]: far from
/// all that a shift shows, near to what single precision resolves.
const LEFT: (f64, f64) = (1e-4, 0.99);
/// Sweeps of rotations by which the directions are found: they converge quadratically.
const SWEEPS: usize = 6;

/// Measurements of the acting quantities with noise of variance one; a row of zeros where nothing was seen.
pub(super) struct InformationGain<T> {
    pub(super) rows: Matrix<T>,
    pub(super) values: [T; ACTING],
}

impl<T: Real> InformationGain<T> {
    /// What leads from the one knowledge to the other; `None` if these are not means and covariances.
    pub(super) fn between(before: &Known<T>, after: &Known<T>) -> Option<Self> {
        let root = lower_inverse(&cholesky(&before.covariance)?);
        let moved: [T; ACTING] = core::array::from_fn(|a| after.mean[a] - before.mean[a]);
        let moved = root.map(|row| dot(&row, &moved));
        let (parts, directions) = directions(around(&root, &after.covariance));
        if !parts.iter().chain(&moved).all(|x| x.is_finite()) {
            return None;
        }
        let mut gain = Self { rows: [[T::zero(); ACTING]; ACTING], values: [T::zero(); ACTING] };
        for ((row, value), (part, direction)) in
            gain.rows.iter_mut().zip(&mut gain.values).zip(parts.iter().zip(&directions))
        {
            let part = part.max(T::of(LEFT.0));
            if part > T::of(LEFT.1) {
                continue;
            }
            let root_of_information = (part.recip() - T::one()).sqrt();
            for (x, root) in direction.iter().zip(&root) {
                for (row, root) in row.iter_mut().zip(root) {
                    *row = *row + root_of_information * *x * *root;
                }
            }
            *value = dot(row, &before.mean) + dot(direction, &moved) / (part * root_of_information);
        }
        Some(gain)
    }
}

/// `A B A'`.
pub(super) fn around<T: Real>(a: &Matrix<T>, b: &Matrix<T>) -> Matrix<T> {
    let half = a.map(|row| b.map(|column| dot(&row, &column)));
    half.map(|row| a.map(|other| dot(&row, &other)))
}

/// `L` with `L L'` a covariance, or `None` if it is none.
pub(super) fn cholesky<T: Real, const L: usize>(of: &[[T; L]; L]) -> Option<[[T; L]; L]> {
    let mut lower = [[T::zero(); L]; L];
    for i in 0..L {
        for j in 0..=i {
            let left = of[i][j] - dot(&lower[i], &lower[j]);
            if i != j {
                lower[i][j] = left / lower[j][j];
            } else if left > T::epsilon() && left.is_finite() {
                lower[i][i] = left.sqrt();
            } else {
                return None;
            }
        }
    }
    Some(lower)
}

/// The inverse of a lower triangular matrix.
pub(super) fn lower_inverse<T: Real, const L: usize>(of: &[[T; L]; L]) -> [[T; L]; L] {
    let mut inverse = [[T::zero(); L]; L];
    for i in 0..L {
        let mut row = [T::zero(); L];
        row[i] = T::one();
        for k in 0..i {
            for j in 0..=k {
                row[j] = row[j] - of[i][k] * inverse[k][j];
            }
        }
        inverse[i] = row.map(|x| x / of[i][i]);
    }
    inverse
}

/// Whether a symmetric matrix is that of a covariance: all pivots are positive.
pub(super) fn is_positive<T: Real, const L: usize>(mut of: [[T; L]; L]) -> bool {
    for k in 0..L {
        let row = of[k];
        if row[k] <= T::zero() || row[k].is_nan() {
            return false;
        }
        for below in of.iter_mut().skip(k + 1) {
            let factor = below[k] / row[k];
            for (x, above) in below.iter_mut().zip(&row) {
                *x = *x - factor * *above;
            }
        }
    }
    true
}

/// Eigenvalues and, as rows, eigenvectors of a symmetric matrix, by Jacobi's rotations.
fn directions<T: Real>(mut of: Matrix<T>) -> ([T; ACTING], Matrix<T>) {
    let mut rows = [[T::zero(); ACTING]; ACTING];
    for (k, row) in rows.iter_mut().enumerate() {
        row[k] = T::one();
    }
    for _ in 0..SWEEPS {
        for p in 0..ACTING {
            for q in p + 1..ACTING {
                if of[p][q] == T::zero() {
                    continue;
                }
                let half = (of[q][q] - of[p][p]) / (of[p][q] + of[p][q]);
                let size = (half.abs() + (half * half + T::one()).sqrt()).recip();
                let tangent = if half < T::zero() { -size } else { size };
                let cosine = (tangent * tangent + T::one()).sqrt().recip();
                let sine = tangent * cosine;
                let turn = |p: T, q: T| (cosine * p - sine * q, sine * p + cosine * q);
                for row in &mut of {
                    (row[p], row[q]) = turn(row[p], row[q]);
                }
                for rows in [&mut of, &mut rows] {
                    let both: [(T, T); ACTING] = core::array::from_fn(|k| turn(rows[p][k], rows[q][k]));
                    (rows[p], rows[q]) = (both.map(|both| both.0), both.map(|both| both.1));
                }
            }
        }
    }
    (core::array::from_fn(|k| of[k][k]), rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: [[f64; 6]; 6] = [
        [1.0, 0.3, -0.2, 0.1, 0.0, 0.2],
        [0.3, 0.8, 0.1, -0.3, 0.2, 0.0],
        [-0.2, 0.1, 0.9, 0.2, 0.1, 0.1],
        [0.1, -0.3, 0.2, 0.7, 0.0, -0.1],
        [0.0, 0.2, 0.1, 0.0, 1.1, 0.3],
        [0.2, 0.0, 0.1, -0.1, 0.3, 0.6],
    ];

    /// A covariance with this corner.
    fn some() -> Matrix<f64> {
        let own = |i: usize, j: usize| if i == j { 0.5 + 0.1 * i as f64 } else { 0.02 };
        let value = |i: usize, j: usize| CORNER.get(i).and_then(|row| row.get(j)).copied().unwrap_or(own(i, j));
        core::array::from_fn(|i| core::array::from_fn(|j| value(i, j)))
    }

    #[test]
    fn directions_and_roots_make_the_matrix_again() {
        let some = some();
        let (values, rows) = directions(some);
        let lower = cholesky(&some).unwrap();
        let inverse = lower_inverse(&lower);
        for i in 0..ACTING {
            for j in 0..ACTING {
                let sum: f64 = (0..ACTING).map(|k| rows[k][i] * values[k] * rows[k][j]).sum();
                assert!((sum - some[i][j]).abs() < 1e-12, "{i} {j}: {sum}");
                assert!((dot(&lower[i], &lower[j]) - some[i][j]).abs() < 1e-12);
                let unit: f64 = (0..ACTING).map(|k| inverse[i][k] * lower[k][j]).sum();
                assert!((unit - f64::from(u8::from(i == j))).abs() < 1e-12);
            }
        }
        let mut none = some;
        none[2][2] = -0.1;
        assert_eq!(cholesky(&none), None);
        none[2][2] = f64::NAN;
        assert_eq!(cholesky(&none), None);
    }

    /// One measurement in, the same measurement out.
    #[test]
    fn a_measurement_is_found_again() {
        let mean = [0.3, -0.2, 0.1, 0.5, -0.4, 0.2, 0.1, 0.0, -0.3, 0.6];
        let before = Known { mean, covariance: some() };
        let h = [0.9, -0.2, 0.4, 0.1, -0.7, 0.8, 0.3, -0.5, 0.2, 0.6];
        let (value, noise) = (0.8, 0.2_f64);
        let with = some().map(|row| dot(&row, &h));
        let variance = dot(&with, &h) + noise;
        let mut after = before;
        for a in 0..ACTING {
            after.mean[a] += with[a] / variance * (value - dot(&h, &before.mean));
            for b in 0..ACTING {
                after.covariance[a][b] -= with[a] * with[b] / variance;
            }
        }
        let gain = InformationGain::between(&before, &after).unwrap();
        let mut seen = gain.rows.iter().zip(&gain.values).filter(|(row, _)| **row != [0.0; ACTING]);
        let (row, found) = seen.next().unwrap();
        assert!(seen.next().is_none());
        let sign = (row[0] * h[0]).signum();
        for (row, h) in row.iter().zip(&h) {
            assert!((row - sign * h / noise.sqrt()).abs() < 1e-9);
        }
        assert!((found - sign * value / noise.sqrt()).abs() < 1e-9);
        after.covariance[3][3] = f64::NAN;
        assert!(InformationGain::between(&before, &after).is_none());
    }
}
