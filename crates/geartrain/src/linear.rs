//! Linear equations whose rank is not known beforehand.

use nalgebra::{DMatrix, DVector};

/// A pivot below this is zero; rows are scaled to about one.
const ZERO: f64 = 1e-9;

/// Equations `A x = b` after Gauss-Jordan elimination with complete pivoting.
struct Eliminated {
    /// `A` with `b` in its last column.
    matrix: DMatrix<f64>,
    /// Column of the pivot of each of the first rows.
    pivots: Vec<usize>,
}

impl Eliminated {
    fn of(rows: &DMatrix<f64>, right: &DVector<f64>) -> Self {
        let unknowns = rows.ncols();
        let mut matrix = rows.clone().insert_column(unknowns, 0.0);
        matrix.set_column(unknowns, right);
        let mut pivots = Vec::new();
        for at in 0..rows.nrows().min(unknowns) {
            let free = || (at..rows.nrows()).flat_map(|i| (0..unknowns).map(move |j| (i, j)));
            let size = |&(i, j): &(usize, usize)| matrix[(i, j)].abs();
            // Of equal pivots the first, so that the result does not depend on the order of a search.
            let Some((i, j)) = free().rev().max_by(|a, b| size(a).total_cmp(&size(b))) else { break };
            if size(&(i, j)) < ZERO {
                break;
            }
            matrix.swap_rows(at, i);
            let pivot = matrix.row(at) / matrix[(at, j)];
            for row in (0..rows.nrows()).filter(|&row| row != at) {
                let factor = matrix[(row, j)];
                for column in 0..=unknowns {
                    matrix[(row, column)] -= factor * pivot[column];
                }
                matrix[(row, j)] = 0.0;
            }
            matrix.set_row(at, &pivot);
            pivots.push(j);
        }
        Self { matrix, pivots }
    }

    /// A basis of the solutions of `A x = 0`, one column each.
    fn null_space(&self) -> DMatrix<f64> {
        let unknowns = self.matrix.ncols() - 1;
        let free: Vec<usize> = (0..unknowns).filter(|column| !self.pivots.contains(column)).collect();
        let mut basis = DMatrix::zeros(unknowns, free.len());
        for (motion, &column) in free.iter().enumerate() {
            basis[(column, motion)] = 1.0;
            for (row, &pivot) in self.pivots.iter().enumerate() {
                basis[(pivot, motion)] = -self.matrix[(row, column)];
            }
        }
        basis
    }
}

/// A basis of the solutions of `A x = 0`, one column each.
pub(crate) fn null_space(rows: &DMatrix<f64>) -> DMatrix<f64> {
    Eliminated::of(rows, &DVector::zeros(rows.nrows())).null_space()
}

/// The smallest solution of `A x = b`, and whether it is the only one. `None` if there is no solution.
pub(crate) fn min_norm(rows: &DMatrix<f64>, right: &DVector<f64>) -> Option<(DVector<f64>, bool)> {
    let eliminated = Eliminated::of(rows, right);
    let unknowns = rows.ncols();
    let rest = |row: usize| eliminated.matrix[(row, unknowns)];
    if (eliminated.pivots.len()..rows.nrows()).any(|row| rest(row).abs() > ZERO) {
        return None;
    }
    let mut solution = DVector::zeros(unknowns);
    for (row, &pivot) in eliminated.pivots.iter().enumerate() {
        solution[pivot] = rest(row);
    }
    let free = eliminated.null_space();
    if free.ncols() == 0 {
        return Some((solution, true));
    }
    // Any solution less its part in the null space is the smallest one.
    let part = (free.transpose() * &free).cholesky()?.solve(&(free.transpose() * &solution));
    Some((solution - free * part, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_null_space_of_dependent_rows_has_what_they_leave() {
        let rows = DMatrix::from_row_slice(3, 4, &[1.0, 2.0, 0.0, -1.0, 2.0, 4.0, 0.0, -2.0, 0.0, 0.0, 1.0, -1.0]);
        let basis = null_space(&rows);
        assert_eq!(basis.ncols(), 2);
        assert!((rows * basis).amax() < 1e-12);
    }

    #[test]
    fn of_many_solutions_the_smallest_is_taken() {
        let rows = DMatrix::from_row_slice(1, 2, &[1.0, 1.0]);
        let (solution, only) = min_norm(&rows, &DVector::from_element(1, 2.0)).unwrap();
        assert!((solution - DVector::from_element(2, 1.0)).amax() < 1e-12 && !only);
    }

    #[test]
    fn equations_that_contradict_each_other_have_no_solution() {
        let rows = DMatrix::from_row_slice(2, 1, &[1.0, 1.0]);
        assert_eq!(min_norm(&rows, &DVector::from_row_slice(&[1.0, 2.0])), None);
    }

    #[test]
    fn without_equations_or_unknowns_nothing_is_determined_or_asked() {
        assert_eq!(null_space(&DMatrix::zeros(0, 3)).ncols(), 3);
        assert_eq!(null_space(&DMatrix::zeros(2, 0)).ncols(), 0);
        assert!(min_norm(&DMatrix::zeros(1, 0), &DVector::zeros(1)).is_some_and(|(_, only)| only));
    }
}
