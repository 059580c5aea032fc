//! Linear matrix inequalities as conic programs.
//!
//! `min c'x` subject to `F0 + x1 F1 + ... + xn Fn >= 0` (positive semidefinite) for each of several
//! blocks. A block of order 1 is a linear inequality. Scale the unknowns to the order of 1: the solver's
//! tolerance is absolute.

use std::ops::Range;

use nalgebra::DMatrix;

/// A symmetric matrix that depends affinely on the unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// `F0`, square.
    pub constant: DMatrix<f64>,
    /// `Fk`, one for each unknown, of the size of `F0`.
    pub per_unknown: Vec<DMatrix<f64>>,
}

impl Block {
    /// The matrix at these unknowns.
    pub fn at(&self, unknowns: &[f64]) -> DMatrix<f64> {
        self.per_unknown.iter().zip(unknowns).fold(self.constant.clone(), |sum, (f, x)| sum + f * *x)
    }

    /// A linear inequality `constant + coefficients' x >= 0`.
    pub fn linear(constant: f64, coefficients: &[f64]) -> Self {
        let one = |value| DMatrix::from_element(1, 1, value);
        Self { constant: one(constant), per_unknown: coefficients.iter().map(|&c| one(c)).collect() }
    }
}

/// A problem of linear matrix inequalities.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// `c`, one number for each unknown.
    pub objective: Vec<f64>,
    /// What must be positive semidefinite.
    pub blocks: Vec<Block>,
}

/// How a problem ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// A minimum was found.
    Solved {
        /// The unknowns.
        unknowns: Vec<f64>,
        /// Iterations of the solver.
        iterations: u32,
    },
    /// No choice of unknowns satisfies every block.
    Infeasible,
    /// The solver gave up; holds its own word for it.
    Failed(String),
}

/// What the minimum may grow by where the solution of minimum norm is taken: this fraction of `1 + |minimum|`. The solver finds
/// the minimum to a tenth of it.
pub const TIE_SLACK: f64 = 1e-7;

impl Problem {
    /// Solves the problem with an interior-point method.
    pub fn solve(&self) -> Outcome {
        self.solve_with(&vec![0.0; self.objective.len()])
    }

    /// The solution whose unknowns in `among` have the smallest sum of squares, among those that cost at most
    /// [`TIE_SLACK`] more than the minimum. Where the minimum is not unique, this one is. If the solver gives that up, because
    /// hardly any solution is left, a hundred times as much is allowed, twice; then the solution that it found first is taken.
    pub fn solve_min_norm(&self, among: Range<usize>) -> Outcome {
        let (first, iterations) = match self.solve() {
            Outcome::Solved { unknowns, iterations } => (unknowns, iterations),
            ended => return ended,
        };
        let minimum: f64 = self.objective.iter().zip(&first).map(|(c, x)| c * x).sum();
        let dearer: Vec<f64> = self.objective.iter().map(|c| -c).collect();
        let squares: Vec<f64> = (0..dearer.len()).map(|k| if among.contains(&k) { 1.0 } else { 0.0 }).collect();
        for factor in [1.0, 1e2, 1e4] {
            let mut blocks = self.blocks.clone();
            blocks.push(Block::linear(minimum + factor * TIE_SLACK * (1.0 + minimum.abs()), &dearer));
            let problem = Self { objective: vec![0.0; dearer.len()], blocks };
            if let Outcome::Solved { unknowns, iterations: more } = problem.solve_with(&squares) {
                return Outcome::Solved { unknowns, iterations: iterations + more };
            }
        }
        Outcome::Solved { unknowns: first, iterations }
    }
}

/// Largest eigenvalue of the symmetric part.
pub fn largest_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    let symmetric = (matrix + matrix.transpose()) * 0.5;
    symmetric.symmetric_eigenvalues().iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// A block that depends affinely on the unknowns, from a function that evaluates it.
pub(crate) fn block(unknowns: usize, at: impl Fn(&[f64]) -> DMatrix<f64>) -> Block {
    block_of(unknowns, 0..unknowns, at)
}

/// The same of a block that depends on some unknowns only.
pub(crate) fn block_of(
    unknowns: usize,
    on: impl IntoIterator<Item = usize>,
    at: impl Fn(&[f64]) -> DMatrix<f64>,
) -> Block {
    let mut x = vec![0.0; unknowns];
    let constant = at(&x);
    let mut per_unknown = vec![DMatrix::zeros(constant.nrows(), constant.ncols()); unknowns];
    for k in on {
        x[k] = 1.0;
        per_unknown[k] = at(&x) - &constant;
        x[k] = 0.0;
    }
    Block { constant, per_unknown }
}

/// `[a b'; b c]`.
pub(crate) fn stacked(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, m) = (a.nrows(), c.nrows());
    let mut whole = DMatrix::zeros(n + m, n + m);
    whole.view_mut((0, 0), (n, n)).copy_from(a);
    whole.view_mut((n, 0), (m, n)).copy_from(b);
    whole.view_mut((0, n), (n, m)).copy_from(&b.transpose());
    whole.view_mut((n, n), (m, m)).copy_from(c);
    whole
}

pub(crate) fn min_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    -largest_eigenvalue(&-matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `min t` such that `t I - A >= 0` is the largest eigenvalue of `A`; order 5 needs the linked LAPACK.
    #[test]
    fn the_largest_eigenvalue_solves_its_own_program() {
        let a = DMatrix::from_fn(5, 5, |i, j| 1.0 / (1.0 + i as f64 + j as f64));
        let problem = Problem {
            objective: vec![1.0],
            blocks: vec![Block { constant: -a.clone(), per_unknown: vec![DMatrix::identity(5, 5)] }],
        };
        let Outcome::Solved { unknowns, .. } = problem.solve() else { panic!("{:?}", problem.solve()) };
        assert!((unknowns[0] - largest_eigenvalue(&a)).abs() < 1e-7);
    }

    /// `x1 + x2 >= 2` at the minimum of `x1 + x2`: a whole line of solutions, of which `(1, 1)` has the minimum norm.
    #[test]
    fn of_many_solutions_that_of_minimum_norm_is_taken() {
        for weight in [1.0, 1e-3] {
            let problem = Problem { objective: vec![weight; 2], blocks: vec![Block::linear(-2.0, &[1.0, 1.0])] };
            let Outcome::Solved { unknowns, .. } = problem.solve_min_norm(0..2) else { panic!("no solution") };
            // The slack moves the sum by its fraction of a cost of `2 weight`.
            let moved = TIE_SLACK * (1.0 + 2.0 * weight) / weight;
            assert!(unknowns.iter().all(|x| (x - 1.0).abs() < moved + 1e-7), "{unknowns:?}");
        }
    }

    #[test]
    fn contradicting_inequalities_are_infeasible() {
        let problem =
            Problem { objective: vec![0.0], blocks: vec![Block::linear(-1.0, &[1.0]), Block::linear(-1.0, &[-1.0])] };
        assert_eq!(problem.solve(), Outcome::Infeasible);
    }
}
