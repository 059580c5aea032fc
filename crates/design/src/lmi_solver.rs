//! The interior-point method behind [`Problem`].

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT, SupportedConeT::NonnegativeConeT,
    SupportedConeT::PSDTriangleConeT,
};
use lapack_nalgebra as _;
use nalgebra::DMatrix;

use crate::lmi::{Block, Outcome, Problem};

impl Problem {
    /// The same with half of `squares` times the squares of the unknowns added to the objective.
    pub(crate) fn solve_with(&self, squares: &[f64]) -> Outcome {
        let n = self.objective.len();
        // A linear inequality is cheaper in the cone of non-negative numbers; those come first.
        let (linear, matrix): (Vec<&Block>, Vec<&Block>) = self.blocks.iter().partition(|b| b.constant.nrows() == 1);
        let mut cones: Vec<SupportedConeT<f64>> = Vec::new();
        if !linear.is_empty() {
            cones.push(NonnegativeConeT(linear.len()));
        }
        cones.extend(matrix.iter().map(|block| PSDTriangleConeT(block.constant.nrows())));

        // The solver wants A x + s = b with s in the cone: b holds F0 and A the negative of the Fk.
        let stacked = |pick: &dyn Fn(&Block) -> &DMatrix<f64>| -> Vec<f64> {
            linear.iter().chain(&matrix).flat_map(|block| upper_triangle(pick(block))).collect()
        };
        let b = stacked(&|block| &block.constant);
        let columns: Vec<Vec<f64>> = (0..n).map(|k| stacked(&|block| &block.per_unknown[k])).collect();
        let rows: Vec<Vec<f64>> = (0..b.len()).map(|i| columns.iter().map(|column| -column[i]).collect()).collect();
        let a = CscMatrix::from(&rows);
        let p = CscMatrix::from(
            &(0..n)
                .map(|k| (0..n).map(|j| if j == k { squares[k] } else { 0.0 }).collect::<Vec<f64>>())
                .collect::<Vec<_>>(),
        );

        let settings = DefaultSettings { verbose: false, ..DefaultSettings::default() };
        let mut solver = match DefaultSolver::new(&p, &self.objective, &a, &b, &cones, settings) {
            Ok(solver) => solver,
            Err(error) => return Outcome::Failed(error.to_string()),
        };
        solver.solve();
        match solver.solution.status {
            // A solution of reduced accuracy is accepted too: the caller evaluates the inequalities again.
            SolverStatus::Solved | SolverStatus::AlmostSolved => {
                Outcome::Solved { unknowns: solver.solution.x.clone(), iterations: solver.solution.iterations }
            }
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Outcome::Infeasible,
            other => Outcome::Failed(format!("{other:?}")),
        }
    }
}

/// Upper triangle by columns, off-diagonal entries times the square root of 2, which keeps inner products.
fn upper_triangle(matrix: &DMatrix<f64>) -> Vec<f64> {
    let n = matrix.nrows();
    let entry = |i: usize, j: usize| if i == j { matrix[(i, j)] } else { std::f64::consts::SQRT_2 * matrix[(i, j)] };
    (0..n).flat_map(|j| (0..=j).map(move |i| (i, j))).map(|(i, j)| entry(i, j)).collect()
}
