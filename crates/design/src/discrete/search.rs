//! Searches over a parameter of a program: for the best certified gain, with an account of what the solver did.

use drivetrain::Real;
use serde::Serialize;

use super::found::Found;
use crate::iss::DesignError;
use crate::lmi::{Outcome, Problem};

/// What the solver did in the search for a gain.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct SolverRecord {
    /// Programs that were solved, or found to have no solution.
    pub solved: usize,
    /// Programs that the solver gave up.
    pub failed: usize,
}

/// The programs of a search, and the best gain that it has found.
#[derive(Debug, Default)]
pub(crate) struct Search {
    pub(crate) record: SolverRecord,
    /// Why the last failure failed, in the solver's words.
    last_failure: Option<String>,
    best: Option<Found>,
}

impl Search {
    /// The solution of a program, if there is one. A failure of the solver is counted: it does not show that there is none.
    pub(crate) fn solve(&mut self, problem: &Problem) -> Option<Vec<f64>> {
        self.take(problem.solve())
    }

    /// The same, for a result that is there already.
    pub(crate) fn take(&mut self, outcome: Outcome) -> Option<Vec<f64>> {
        match outcome {
            Outcome::Solved { unknowns, .. } => {
                self.record.solved += 1;
                Some(unknowns)
            }
            Outcome::Infeasible => {
                self.record.solved += 1;
                None
            }
            Outcome::Failed(word) => {
                self.record.failed += 1;
                self.last_failure = Some(word);
                None
            }
        }
    }

    /// Keeps a certified gain if it is the best so far; its bound.
    pub(crate) fn keep(&mut self, found: Option<Found>) -> f64 {
        let Some(found) = found else { return f64::INFINITY };
        let bound = found.bound;
        if self.best.as_ref().is_none_or(|best| bound < best.bound) {
            self.best = Some(found);
        }
        bound
    }

    /// The best certified gain, if there is one.
    ///
    /// # Errors
    /// The solver gave up every program, so that the search has shown nothing.
    pub(crate) fn finish(self) -> Result<(Option<Found>, SolverRecord), DesignError> {
        match self.last_failure {
            Some(word) if self.record.solved == 0 => {
                Err(DesignError::Solver(format!("{word}, in each of {} programs", self.record.failed)))
            }
            _ => Ok((self.best, self.record)),
        }
    }
}

/// The parameter with the minimum value, by golden sections of its logarithm until the interval is shorter than `within`, for a
/// function with one minimum. It is infinite where there is no value.
pub(crate) fn min_over([low, high]: [f64; 2], within: f64, mut at: impl FnMut(f64) -> f64) -> f64 {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (Real::ln(low), Real::ln(high));
    let mut inner = [high - golden * (high - low), low + golden * (high - low)];
    let mut values = inner.map(|x| at(Real::exp(x)));
    while high - low > within {
        if values[0] <= values[1] {
            high = inner[1];
            inner = [high - golden * (high - low), inner[0]];
            values = [at(Real::exp(inner[0])), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + golden * (high - low)];
            values = [values[1], at(Real::exp(inner[1]))];
        }
    }
    if values[0] <= values[1] { Real::exp(inner[0]) } else { Real::exp(inner[1]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lmi::Block;

    #[test]
    fn the_minimum_value_is_found_at_the_end_where_there_is_one() {
        let found = min_over([1e-4, 1.0], 1e-3, |x| if x > 0.5 { f64::INFINITY } else { (x / 0.02).ln().powi(2) });
        assert!((found / 0.02).ln().abs() < 1e-3, "{found}");
    }

    #[test]
    fn a_search_in_which_every_program_fails_is_an_error_and_one_without_a_gain_is_not() {
        let mut search = Search::default();
        assert!(search.take(Outcome::Failed("NumericalError".to_owned())).is_none());
        let error = search.finish().unwrap_err().to_string();
        assert!(error.contains("NumericalError, in each of 1 programs"), "{error}");

        let mut search = Search::default();
        search.take(Outcome::Failed("NumericalError".to_owned()));
        let contradiction = vec![Block::linear(-1.0, &[1.0]), Block::linear(-1.0, &[-1.0])];
        assert!(search.solve(&Problem { objective: vec![0.0], blocks: contradiction }).is_none());
        let (found, record) = search.finish().unwrap();
        assert_eq!((found, record), (None, SolverRecord { solved: 1, failed: 1 }));
    }
}
