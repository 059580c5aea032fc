//! Nonlinear least squares with eliminated unknowns, by the Levenberg-Marquardt method of the crate `levenberg-marquardt`.
//!
//! A fit has a few parameters and many own unknowns of shifts and drives. An [`Objective`] eliminates the own ones: about a
//! point the cost is
//!
//! ```text
//! c + g' dx + dx' H dx/2 - d (2 t - t^2)
//! ```
//!
//! with the reduced gradient `g` and information `H` of the parameters, priors included, and with the decrease `d` by the own
//! unknowns alone when they go the fraction `t` of their step. The crate sees the parameters and `s = sqrt(2 d) t`, of which it wants residuals `r`
//! and derivatives `J`. Here `r = (sqrt(2 c), 0, ..., 0)`, and
//!
//! ```text
//! J = [ g'/sqrt(2 c) ]      L L' = H      u = L^-1 g      M = (1 - a u u') L'      a = (1 - sqrt(1 - u'u/2c))/u'u
//!     [      M       ]
//! ```
//!
//! so that `J' J = H` and `J' r = g`: its steps, its damping and its predictions are those of the whole problem, of which it never
//! factors the rows. The root is real: the cost that a step can take away, `u'u/2`, is not more than the cost.

use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn};

use crate::FitError;

/// What is minimised.
pub(crate) trait Objective {
    /// Parameters and own unknowns, with what was computed of them.
    type Point: Clone;
    /// What the own unknowns follow from.
    type Line;

    /// The parameters of a point.
    fn parameters<'a>(&self, point: &'a Self::Point) -> &'a [f64];

    /// Minimum and maximum value of a parameter.
    fn limits(&self, place: usize) -> [f64; 2];

    /// Takes the weights that a point asks for; the point with them.
    fn reweighted(&mut self, point: Self::Point) -> Self::Point;

    /// Half the robust sum of squares, priors included.
    fn cost(&self, point: &Self::Point) -> f64;

    /// The equations of a step.
    fn equations(&self, point: &Self::Point) -> Result<Equations<Self::Line>, FitError>;

    /// The point with these parameters, whose own unknowns go a fraction of their own step from another point and follow the parameters.
    fn moved(&self, from: &Self::Point, line: &Self::Line, parameters: Vec<f64>, fraction: f64) -> Self::Point;

    /// Why there is no step.
    fn not_finite(&self) -> FitError;
}

/// The cost about a point: half its gradient and the information by the parameters, with own unknowns eliminated and with priors, and
/// the decrease by the own unknowns alone.
pub(crate) struct Equations<Line> {
    pub(crate) information: DMatrix<f64>,
    pub(crate) gradient: DVector<f64>,
    pub(crate) own_decrease: f64,
    pub(crate) line: Line,
}

/// How long a fit goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Iterations {
    /// Steps after each of which the weights follow the residuals.
    pub(crate) reweighted: u32,
    /// All of them.
    pub(crate) maximum: u32,
    /// The step that is expected to lower the cost by no more than this is the last one. From a minimum to a standard deviation of `d` away the
    /// cost grows by `d^2/2`.
    pub(crate) decrease: f64,
}

/// Where a fit ended.
pub(crate) struct Minimum<O: Objective> {
    pub(crate) at: O::Point,
    /// Of the point where the last step began.
    pub(crate) line: O::Line,
    /// The last step was small; otherwise the steps were used up.
    pub(crate) is_converged: bool,
}

/// Goes on from a point until a step is small. `progress` takes the number of each step, and may end the search with an error.
pub(crate) fn minimised<O: Objective>(
    objective: &mut O,
    mut at: O::Point,
    iterations: Iterations,
    progress: &mut dyn FnMut(u32) -> ControlFlow<()>,
) -> Result<Minimum<O>, FitError> {
    let (mut done, mut reweighted) = (0, 0);
    loop {
        let maximum = if reweighted < iterations.reweighted { done + 1 } else { iterations.maximum };
        let cost = objective.cost(&at);
        if !cost.is_finite() {
            return Err(objective.not_finite());
        }
        let start = Search::new(objective, at, [done, maximum], iterations.decrease, progress);
        // At kinks of the model, such as the kiss point, steps go to and fro around a minimum: there the crate ends the search.
        let solver = LevenbergMarquardt::new().with_ftol(iterations.decrease / cost);
        let (end, report) = solver.minimize(start);
        done = end.done.get();
        if let Some(error) = end.error.into_inner() {
            return Err(error);
        }
        let base = end.base.into_inner().ok_or_else(|| end.objective.not_finite())?;
        at = end.at;
        let is_converged = match report.termination {
            // The search was ended here.
            TerminationReason::User(_) => base.expected <= iterations.decrease,
            TerminationReason::Numerical(_) => return Err(objective.not_finite()),
            _ => true,
        };
        if reweighted < iterations.reweighted && done < iterations.maximum {
            reweighted += 1;
            at = objective.reweighted(at);
        } else if is_converged || done >= iterations.maximum {
            return Ok(Minimum { at, line: base.line, is_converged });
        }
    }
}

/// A point with the equations of a step from there.
struct Base<O: Objective> {
    point: O::Point,
    cost: f64,
    /// As the crate has it.
    unknowns: DVector<f64>,
    /// `sqrt(2 d)`.
    own_way: f64,
    /// What the step is expected to take away of the cost, where nothing limits it.
    expected: f64,
    line: O::Line,
}

/// A search with weights that stay.
struct Search<'a, O: Objective> {
    objective: &'a O,
    at: O::Point,
    cost: f64,
    /// Parameters, not limited, and `s`.
    unknowns: DVector<f64>,
    /// Where the last step began.
    base: RefCell<Option<Base<O>>>,
    /// Steps that were begun, and how many may be.
    done: Cell<u32>,
    maximum: u32,
    /// Expected decrease of the cost with which a step is the last one.
    decrease: f64,
    error: RefCell<Option<FitError>>,
    progress: RefCell<&'a mut dyn FnMut(u32) -> ControlFlow<()>>,
}

impl<'a, O: Objective> Search<'a, O> {
    fn new(
        objective: &'a O,
        at: O::Point,
        [done, maximum]: [u32; 2],
        decrease: f64,
        progress: &'a mut dyn FnMut(u32) -> ControlFlow<()>,
    ) -> Self {
        let unknowns = DVector::from_iterator(
            objective.parameters(&at).len() + 1,
            objective.parameters(&at).iter().copied().chain(std::iter::once(0.0)),
        );
        Self {
            cost: objective.cost(&at),
            objective,
            at,
            unknowns,
            base: RefCell::new(None),
            done: Cell::new(done),
            maximum,
            decrease,
            error: RefCell::new(None),
            progress: RefCell::new(progress),
        }
    }

    /// Whether a parameter was stopped at its limit: the crate does not know of it, and the search goes on from there anew.
    fn is_limited(&self) -> bool {
        self.objective.parameters(&self.at).iter().zip(self.unknowns.iter()).any(|(value, asked)| value != asked)
    }

    /// Derivatives of the residuals about the point, and the equations that they are of.
    fn derivatives(&self) -> Result<(DMatrix<f64>, Base<O>), FitError> {
        let equations = self.objective.equations(&self.at)?;
        let parameters = self.objective.parameters(&self.at);
        let (count, own_way) = (parameters.len(), (2.0 * equations.own_decrease).sqrt());
        let mut information = equations.information.insert_row(count, 0.0).insert_column(count, 0.0);
        information[(count, count)] = 1.0;
        let mut gradient = equations.gradient.insert_row(count, -own_way);
        let mut held: Vec<usize> = Vec::new();
        // A parameter that is at its limit and would leave it is held there before the others are solved for: limited afterwards, it would
        // have made their steps wrong again and again.
        let (factor, u) = loop {
            let factor = information.clone().cholesky().ok_or_else(|| self.objective.not_finite())?;
            let step = -factor.solve(&gradient);
            let leaves = |j: usize| {
                let [minimum, maximum] = self.objective.limits(j);
                (parameters[j] <= minimum && step[j] < 0.0) || (parameters[j] >= maximum && step[j] > 0.0)
            };
            let leaving: Vec<usize> = (0..count).filter(|j| !held.contains(j) && leaves(*j)).collect();
            if leaving.is_empty() {
                let whitened = factor.l().solve_lower_triangular(&gradient);
                break (factor.l(), whitened.ok_or_else(|| self.objective.not_finite())?);
            }
            for j in leaving {
                information.row_mut(j).fill(0.0);
                information.column_mut(j).fill(0.0);
                information[(j, j)] = 1.0;
                gradient[j] = 0.0;
                held.push(j);
            }
        };
        let left = (1.0 - u.norm_squared() / (2.0 * self.cost)).max(0.0).sqrt();
        let upper = factor.transpose();
        // `(1 - sqrt(1 - q))/u'u` without a difference of numbers that are nearly equal.
        let a = (2.0 * self.cost * (1.0 + left)).recip();
        let rest = &upper - &u * (upper.tr_mul(&u).transpose() * a);
        let mut derivatives = rest.insert_row(0, 0.0);
        derivatives.row_mut(0).copy_from(&(gradient.transpose() / (2.0 * self.cost).sqrt()));
        held.iter().for_each(|j| derivatives.column_mut(*j).fill(0.0));
        let base = Base {
            point: self.at.clone(),
            cost: self.cost,
            unknowns: self.unknowns.clone(),
            own_way,
            expected: 0.5 * u.norm_squared(),
            line: equations.line,
        };
        Ok((derivatives, base))
    }
}

impl<O: Objective> LeastSquaresProblem<f64, Dyn, Dyn> for Search<'_, O> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, unknowns: &DVector<f64>) {
        self.unknowns.copy_from(unknowns);
        let Some(base) = self.base.get_mut() else { return };
        if *unknowns == base.unknowns {
            (self.at, self.cost) = (base.point.clone(), base.cost);
            return;
        }
        let count = unknowns.len() - 1;
        let limited = |j: usize| {
            let [minimum, maximum] = self.objective.limits(j);
            unknowns[j].clamp(minimum, maximum)
        };
        let parameters = (0..count).map(limited).collect();
        let way = unknowns[count] - base.unknowns[count];
        let fraction = if base.own_way > 0.0 { way / base.own_way } else { 0.0 };
        self.at = self.objective.moved(&base.point, &base.line, parameters, fraction);
        self.cost = self.objective.cost(&self.at);
    }

    fn params(&self) -> DVector<f64> {
        self.unknowns.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        /// Residual of a point whose cost cannot be computed: the crate goes on with a smaller step.
        const BEYOND: f64 = 1e100;
        let mut residuals = DVector::zeros(self.unknowns.len() + 1);
        residuals[0] = (2.0 * self.cost).sqrt().min(BEYOND);
        Some(residuals)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let was_last = self.base.borrow().as_ref().is_some_and(|base| base.expected <= self.decrease);
        if was_last || self.done.get() >= self.maximum || self.is_limited() {
            return None;
        }
        let goes_on = (self.progress.borrow_mut())(self.done.get());
        self.done.set(self.done.get() + 1);
        let derivatives = if goes_on.is_break() { Err(FitError::Stopped) } else { self.derivatives() };
        match derivatives {
            Ok((derivatives, base)) => {
                self.base.replace(Some(base));
                Some(derivatives)
            }
            Err(error) => {
                self.error.replace(Some(error));
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow::Continue;

    use super::*;
    use nalgebra::{Matrix2, Vector2};

    /// Residuals `1 - x`, `x + z - 3`, 1 and, with an own unknown `w`, `10 (w - x^2)`: Rosenbrock's valley.
    struct Valley {
        max_z: f64,
        /// Beyond this the cost cannot be computed.
        end_x: f64,
        reweighted: u32,
    }

    const VALLEY: Valley = Valley { max_z: 10.0, end_x: 10.0, reweighted: 0 };
    const LONG: Iterations = Iterations { reweighted: 0, maximum: 30, decrease: 1e-12 };

    impl Objective for Valley {
        type Point = ([f64; 2], f64);
        /// Gradient by the own unknown, information about it, and that about it and x.
        type Line = [f64; 3];

        fn parameters<'a>(&self, point: &'a Self::Point) -> &'a [f64] {
            &point.0
        }

        fn limits(&self, place: usize) -> [f64; 2] {
            [-10.0, [10.0, self.max_z][place]]
        }

        fn reweighted(&mut self, point: Self::Point) -> Self::Point {
            self.reweighted += 1;
            point
        }

        fn cost(&self, ([x, z], w): &Self::Point) -> f64 {
            let squares = (1.0 - x).powi(2) + (x + z - 3.0).powi(2) + 1.0 + 100.0 * (w - x * x).powi(2);
            if *x > self.end_x { f64::NAN } else { 0.5 * squares }
        }

        fn equations(&self, ([x, z], w): &Self::Point) -> Result<Equations<Self::Line>, FitError> {
            let of_own = [100.0 * (w - x * x), 100.0, -200.0 * x];
            let information = Matrix2::new(2.0, 1.0, 1.0, 1.0);
            let gradient = Vector2::new(x - 1.0 + x + z - 3.0, x + z - 3.0);
            Ok(Equations {
                information: DMatrix::from_column_slice(2, 2, information.as_slice()),
                gradient: DVector::from_column_slice(gradient.as_slice()),
                own_decrease: 0.5 * of_own[0] * of_own[0] / of_own[1],
                line: of_own,
            })
        }

        fn moved(
            &self,
            (from, w): &Self::Point,
            line: &Self::Line,
            parameters: Vec<f64>,
            fraction: f64,
        ) -> Self::Point {
            let step = -(fraction * line[0] + line[2] * (parameters[0] - from[0])) / line[1];
            ([parameters[0], parameters[1]], w + step)
        }

        fn not_finite(&self) -> FitError {
            FitError::Work("not finite".to_owned())
        }
    }

    #[test]
    fn the_derivatives_have_information_and_gradient_of_the_whole_problem() {
        let at = ([-1.2, 0.5], 1.0);
        let mut none = |_| Continue(());
        let search = Search::new(&VALLEY, at, [0, 1], 0.0, &mut none);
        let (derivatives, base) = search.derivatives().unwrap();
        let residuals = search.residuals().unwrap();
        let own_way = 10.0 * (1.0 - 1.44_f64).abs();
        let information = DMatrix::from_row_slice(3, 3, &[2.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let gradient = DVector::from_vec(vec![-2.2 - 3.7, -3.7, -own_way]);
        assert!((derivatives.tr_mul(&derivatives) - information).amax() < 1e-12);
        assert!((derivatives.tr_mul(&residuals) - gradient).amax() < 1e-12);
        assert!((0.5 * residuals.norm_squared() - VALLEY.cost(&at)).abs() < 1e-12);
        // Of the linear residuals the constant one alone is left.
        assert!((base.expected - (VALLEY.cost(&at) - 0.5)).abs() < 1e-12);
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let mut numbers = Vec::new();
        let end = minimised(&mut { VALLEY }, ([-1.2, 5.0], 1.0), LONG, &mut |number| {
            numbers.push(number);
            Continue(())
        })
        .unwrap();
        let ([x, z], w) = end.at;
        assert!(end.is_converged && [x - 1.0, z - 2.0, w - 1.0].iter().all(|off| off.abs() < 1e-5), "{:?}", end.at);
        assert_eq!(numbers, (0..numbers.len() as u32).collect::<Vec<_>>());
    }

    #[test]
    fn a_parameter_at_its_limit_is_held_and_the_others_are_best_with_it() {
        let mut valley = Valley { max_z: 1.0, ..VALLEY };
        let end = minimised(&mut valley, ([-1.2, -5.0], 1.0), LONG, &mut |_| Continue(())).unwrap();
        let ([x, z], w) = end.at;
        assert_eq!(z, 1.0);
        assert!(end.is_converged && (x - 1.5).abs() < 1e-5 && (w - 2.25).abs() < 1e-5, "{:?}", end.at);
    }

    #[test]
    fn a_step_to_where_nothing_can_be_computed_is_made_smaller() {
        let mut valley = Valley { end_x: 0.5, ..VALLEY };
        let end = minimised(&mut valley, ([-1.2, 3.0], 1.0), LONG, &mut |_| Continue(())).unwrap();
        let x = end.at.0[0];
        assert!((0.3..=0.5).contains(&x), "{x}");
        let error = minimised(&mut valley, ([0.6, 3.0], 1.0), LONG, &mut |_| Continue(())).map(|_| ()).unwrap_err();
        assert_eq!(error.to_string(), "not finite");
    }

    #[test]
    fn weights_follow_so_many_steps_and_no_more_steps_are_made_than_allowed() {
        // The first step ends at the x of the minimum and beside its w, the second one at the minimum.
        for (reweighted, maximum, expected) in [(3, 5, (3, 4, true)), (1, 2, (1, 2, false)), (1, 1, (0, 1, false))] {
            let (mut valley, mut steps) = (VALLEY, 0);
            let few = Iterations { reweighted, maximum, decrease: 1e-12 };
            let end = minimised(&mut valley, ([-1.2, 5.0], 40.0), few, &mut |_| {
                steps += 1;
                Continue(())
            })
            .unwrap();
            assert_eq!((valley.reweighted, steps, end.is_converged), expected);
        }
    }
}
