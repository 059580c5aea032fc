//! Fortran operands in and out of `nalgebra`, and the operations on them.

use std::ffi::{c_char, c_int};

use nalgebra::{Cholesky, DMatrix, RealField, SVD, SymmetricEigen};

/// Iterations after which a decomposition counts as failed; they need a few per row.
const MAX_ITERATIONS: usize = 10_000;

/// A size that a caller passed; negative ones become empty.
pub(crate) fn size(n: c_int) -> usize {
    usize::try_from(n).unwrap_or(0)
}

/// Whether an option character is the given letter, in either case.
pub(crate) fn is(option: c_char, letter: u8) -> bool {
    let given = option as u8;
    given.eq_ignore_ascii_case(&letter)
}

/// Copies a column-major matrix.
///
/// # Safety
/// `data` points to `columns` columns of `rows` values at a distance of `leading >= rows`.
pub(crate) unsafe fn read<T: RealField + Copy>(
    data: *const T,
    rows: usize,
    columns: usize,
    leading: usize,
) -> DMatrix<T> {
    // SAFETY: each index lies in the matrix that the caller described.
    DMatrix::from_fn(rows, columns, |i, j| unsafe { *data.add(i + j * leading) })
}

/// Copies a vector whose elements are `step` apart.
///
/// # Safety
/// `data` points to `n` values at a distance of `step > 0`.
pub(crate) unsafe fn read_vector<T: RealField + Copy>(data: *const T, n: usize, step: c_int) -> DMatrix<T> {
    // SAFETY: each index lies in the vector that the caller described.
    DMatrix::from_fn(n, 1, |i, _| unsafe { *data.add(i * size(step)) })
}

/// Writes a column-major matrix.
///
/// # Safety
/// As [`read`], for writing.
pub(crate) unsafe fn write<T: RealField + Copy>(data: *mut T, leading: usize, matrix: &DMatrix<T>) {
    for j in 0..matrix.ncols() {
        for i in 0..matrix.nrows() {
            // SAFETY: each index lies in the matrix that the caller described.
            unsafe { *data.add(i + j * leading) = matrix[(i, j)] };
        }
    }
}

/// The matrix or its transpose, as a BLAS option asks.
pub(crate) fn transposed<T: RealField + Copy>(option: c_char, matrix: DMatrix<T>) -> DMatrix<T> {
    if is(option, b'N') { matrix } else { matrix.transpose() }
}

/// The symmetric matrix of which one triangle was given.
pub(crate) fn symmetric<T: RealField + Copy>(triangle: c_char, matrix: &DMatrix<T>) -> DMatrix<T> {
    let upper = is(triangle, b'U');
    DMatrix::from_fn(
        matrix.nrows(),
        matrix.nrows(),
        |i, j| if (i <= j) == upper { matrix[(i, j)] } else { matrix[(j, i)] },
    )
}

/// `alpha x + beta y`, where a zero `beta` ignores `y` even if it holds no numbers.
pub(crate) fn combine<T: RealField + Copy>(alpha: T, x: &DMatrix<T>, beta: T, y: &DMatrix<T>) -> DMatrix<T> {
    if beta == T::zero() { x * alpha } else { x * alpha + y * beta }
}

/// `update` in one triangle, `old` in the other.
pub(crate) fn in_triangle<T: RealField + Copy>(triangle: c_char, update: &DMatrix<T>, old: &DMatrix<T>) -> DMatrix<T> {
    let upper = is(triangle, b'U');
    DMatrix::from_fn(old.nrows(), old.ncols(), |i, j| {
        let inside = if upper { i <= j } else { i >= j };
        if inside { update[(i, j)] } else { old[(i, j)] }
    })
}

/// Lower Cholesky factor of a symmetric matrix, if it is positive definite.
pub(crate) fn cholesky<T: RealField + Copy>(matrix: DMatrix<T>) -> Option<DMatrix<T>> {
    Cholesky::new(matrix).map(|factor| factor.l())
}

/// Eigenvalues in rising order and their vectors as columns.
pub(crate) fn eigen<T: RealField + Copy>(matrix: DMatrix<T>) -> Option<(DMatrix<T>, DMatrix<T>)> {
    let n = matrix.nrows();
    let eigen = SymmetricEigen::try_new(matrix, T::default_epsilon(), MAX_ITERATIONS)?;
    let mut order: Vec<usize> = (0..n).collect();
    order
        .sort_by(|&a, &b| eigen.eigenvalues[a].partial_cmp(&eigen.eigenvalues[b]).unwrap_or(std::cmp::Ordering::Equal));
    let values = DMatrix::from_fn(n, 1, |i, _| eigen.eigenvalues[order[i]]);
    let vectors = DMatrix::from_fn(n, n, |i, j| eigen.eigenvectors[(i, order[j])]);
    Some((values, vectors))
}

/// Compact singular value decomposition `(U, s, V')`, singular values falling.
pub(crate) fn singular<T: RealField + Copy>(matrix: DMatrix<T>) -> Option<(DMatrix<T>, DMatrix<T>, DMatrix<T>)> {
    let svd = SVD::try_new(matrix, true, true, T::default_epsilon(), MAX_ITERATIONS)?;
    let values = DMatrix::from_fn(svd.singular_values.len(), 1, |i, _| svd.singular_values[i]);
    Some((svd.u?, values, svd.v_t?))
}
