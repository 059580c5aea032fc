//! One step of a linearly implicit Runge-Kutta method of order 3 with its dense output.
//!
//! At a few metres per second the tyre couples wheel and vehicle within less than a millisecond; an
//! explicit method would take its step from that alone; so does the oil in a filled clutch cylinder. This one treats
//! the stiff rows of the equations implicitly, which costs one division each, and everything else explicitly. It is a
//! W-method: its order does not depend on how well the rows are known.
//!
//! Coefficients: ROS34PW2 of J. Rang, L. Angermann, New Rosenbrock W-methods of order 3 for partial
//! differential algebraic equations of index 1, BIT 45 (2005) 761-787. Autonomous form: inputs are
//! constant over a step.

use std::ops::Range;

use drivetrain::Real;

const GAMMA: f64 = 0.435_866_521_508_459;
const ALPHA: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [0.871_733_043_016_918, 0.0, 0.0],
    [0.844_570_600_153_694_2, -0.112_990_642_363_484_18, 0.0],
    [0.0, 0.0, 1.0],
];
const GAMMAS: [[f64; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [-0.871_733_043_016_918, 0.0, 0.0],
    [-0.903_380_570_130_440_8, 0.054_180_672_388_095_326, 0.0],
    [0.242_123_807_060_953_46, -1.223_250_583_904_514_7, 0.545_260_255_335_102_1],
];
const WEIGHTS: [f64; 4] = [0.242_123_807_060_953_46, -1.223_250_583_904_514_7, 1.545_260_255_335_102, GAMMA];
const LOWER_ORDER: [f64; 4] = [0.378_109_031_458_193_7, -0.096_042_292_212_423_18, 0.5, 0.217_933_260_754_229_5];
const ERROR_WEIGHTS: [f64; 4] = [
    WEIGHTS[0] - LOWER_ORDER[0],
    WEIGHTS[1] - LOWER_ORDER[1],
    WEIGHTS[2] - LOWER_ORDER[2],
    WEIGHTS[3] - LOWER_ORDER[3],
];

/// A row of the Jacobian that is treated implicitly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StiffRow<const N: usize> {
    /// Which state's equation it is.
    state: usize,
    /// Derivative of that state's rate by every state.
    gradient: [f64; N],
    /// The first state that the row depends on, and the one after the last.
    first: usize,
    end: usize,
}

impl<const N: usize> StiffRow<N> {
    /// The row of this state's equation: derivative of its rate by every state.
    #[inline]
    pub fn new(state: usize, gradient: [f64; N]) -> Self {
        let first = gradient.iter().position(|g| *g != 0.0).unwrap_or(N);
        let last = gradient.iter().rposition(|g| *g != 0.0).unwrap_or(N);
        Self::of_states(state, first..last.saturating_add(1).min(N), gradient)
    }

    /// The same, where only the derivatives by these states may differ from zero.
    #[inline]
    pub fn of_states(state: usize, states: Range<usize>, gradient: [f64; N]) -> Self {
        Self { state, gradient, first: states.start.min(N), end: states.end.min(N) }
    }

    /// Treats everything explicitly.
    pub fn none() -> Self {
        Self::of_states(0, 0..0, [0.0; N])
    }

    /// What the states before its own one add to the row times a vector.
    #[inline]
    fn before(&self, x: &[f64; N]) -> f64 {
        self.add(self.first.min(self.state)..self.state, 0.0, x)
    }

    /// The sum with what the states after its own one add to the row times a vector.
    #[inline]
    fn after(&self, sum: f64, x: &[f64; N]) -> f64 {
        self.add(self.state + 1..self.end.max(self.state + 1), sum, x)
    }

    /// The sum with what these states add: each sum waits for the one before, so there should be few.
    #[inline]
    fn add(&self, states: Range<usize>, sum: f64, x: &[f64; N]) -> f64 {
        let terms = self.gradient[states.clone()].iter().zip(&x[states]);
        terms.fold(sum, |sum, (g, x)| sum + g * x)
    }
}

/// A step that was tried.
#[derive(Debug, Clone, Copy)]
pub struct Trial<const N: usize, E = ()> {
    /// State at the end.
    pub end: [f64; N],
    /// Derivative at the end, with which the next step begins.
    pub end_slope: [f64; N],
    /// What the right-hand side had besides the derivative at the end.
    pub end_applied: E,
    /// Error estimate over the tolerance; the step is good up to 1.
    pub error: f64,
    start: [f64; N],
    start_slope: [f64; N],
    length_s: f64,
}

impl<const N: usize, E> Trial<N, E> {
    /// State at the fraction `theta` of the step: the cubic through both ends and their slopes.
    #[inline]
    pub fn at(&self, theta: f64) -> [f64; N] {
        let rest = 1.0 - theta;
        std::array::from_fn(|i| {
            let change = self.end[i] - self.start[i];
            let bend_start = self.length_s * self.start_slope[i] - change;
            let bend_end = change - self.length_s * self.end_slope[i];
            self.start[i] + theta * (change + rest * (rest * bend_start + theta * bend_end))
        })
    }
}

/// Tolerances: the error of state `i` is measured against `relative * (scale[i] + |x[i]|)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance<const N: usize> {
    /// Relative tolerance.
    pub relative: f64,
    /// Size of each state below which the tolerance does not shrink further.
    pub scale: [f64; N],
}

/// Longest step, s: short enough that no event function crosses zero twice within one.
pub const LONGEST_STEP_S: f64 = 0.02;
/// Shortest step, s; an integration that needs less has diverged.
pub const SHORTEST_STEP_S: f64 = 1e-10;

/// Length of the next step, s, as the errors of those before it allow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSize(f64);

impl StepSize {
    /// Where nothing is known yet.
    pub const FIRST: Self = Self(1e-4);

    /// Finds a step of at most `rest_s` whose error is small enough; returns its length with its trial. `None` if it would
    /// be shorter than [`SHORTEST_STEP_S`].
    #[inline]
    pub fn accepted<const N: usize, E>(
        &mut self,
        rest_s: f64,
        trial: impl Fn(f64) -> Trial<N, E>,
    ) -> Option<(f64, Trial<N, E>)> {
        loop {
            // Stretch a little rather than leave a sliver for the next step.
            let step_s = if self.0 > 0.9 * rest_s { rest_s } else { self.0 };
            let trial = trial(step_s);
            if self.0 >= LONGEST_STEP_S && trial.error < if step_s < self.0 { 1.0 } else { 0.7 } {
                // It stays the longest one: most of a drive needs no root.
                return Some((step_s, trial));
            }
            let factor = (0.9 / Real::cbrt(trial.error)).clamp(0.2, 4.0);
            if trial.error <= 1.0 {
                // A step cut short by the end of the segment says nothing against the usual length.
                let usual = if step_s < self.0 { self.0 } else { 0.0 };
                self.0 = usual.max(step_s * factor).min(LONGEST_STEP_S);
                return Some((step_s, trial));
            }
            self.0 = if factor.is_nan() { 0.2 * step_s } else { factor * step_s };
            if self.0 < SHORTEST_STEP_S {
                return None;
            }
        }
    }
}

/// Tries a step of length `h` from `x`, where `slope = f(x)`; `at_end` is `f` with what else is wanted at the end.
///
/// The stages satisfy `(1 - h gamma J) k_i = h f(x + sum alpha_ij k_j) + h J sum gamma_ij k_j`. No stiff row may depend on
/// the state of another one: each is solved by itself.
#[inline]
pub fn step<const N: usize, const ROWS: usize, E>(
    f: &impl Fn(&[f64; N]) -> [f64; N],
    at_end: &impl Fn(&[f64; N]) -> ([f64; N], E),
    x: &[f64; N],
    slope: &[f64; N],
    rows: &[StiffRow<N>; ROWS],
    h: f64,
    tolerance: &Tolerance<N>,
) -> Trial<N, E> {
    let solve = Solve { rows, pivots: rows.map(|row| 1.0 / (1.0 - h * GAMMA * row.gradient[row.state])), h };
    let mut rows_times_k = [[0.0; 4]; ROWS];
    let k1 = solve.stage::<0>(slope, &mut rows_times_k);
    let k2 = solve.stage::<1>(&f(&combine(x, &ALPHA[1], &[&k1])), &mut rows_times_k);
    let k3 = solve.stage::<2>(&f(&combine(x, &ALPHA[2], &[&k1, &k2])), &mut rows_times_k);
    let k4 = solve.stage::<3>(&f(&combine(x, &ALPHA[3], &[&k1, &k2, &k3])), &mut rows_times_k);
    let k = [&k1, &k2, &k3, &k4];
    let end = combine(x, &WEIGHTS, &k);
    let error = combine(&[0.0; N], &ERROR_WEIGHTS, &k);
    let scaled = |i: usize| {
        let allowed = tolerance.relative * (tolerance.scale[i] + x[i].abs().max(end[i].abs()));
        let fraction = error[i] / allowed;
        fraction * fraction
    };
    let error = ((0..N).map(scaled).sum::<f64>() / N as f64).sqrt();
    let (end_slope, end_applied) = at_end(&end);
    Trial { end, end_slope, end_applied, error, start: *x, start_slope: *slope, length_s: h }
}

/// The implicit part of the stages of a step.
struct Solve<'a, const N: usize, const ROWS: usize> {
    rows: &'a [StiffRow<N>; ROWS],
    pivots: [f64; ROWS],
    h: f64,
}

impl<const N: usize, const ROWS: usize> Solve<'_, N, ROWS> {
    /// `k` of a stage whose right-hand side is `rate`; `rows_times_k` is known of the stages before. Always inlined: which
    /// coefficients are zero, and where the rows lie, is known to the compiler.
    #[inline(always)]
    fn stage<const STAGE: usize>(&self, rate: &[f64; N], rows_times_k: &mut [[f64; 4]; ROWS]) -> [f64; N] {
        let h = self.h;
        let mut k = rate.map(|rate| h * rate);
        // Of (1 - h gamma J) k = known only the stiff rows are not solved already.
        for ((row, pivot), row_times_k) in self.rows.iter().zip(self.pivots).zip(rows_times_k) {
            let earlier: f64 =
                GAMMAS[STAGE].iter().zip(&*row_times_k).take(STAGE).map(|(gamma, row_k)| gamma * row_k).sum();
            let known = k[row.state] + h * earlier;
            let before = row.before(&k);
            let own = pivot * (known + h * GAMMA * row.after(before, &k));
            row_times_k[STAGE] = row.after(before + row.gradient[row.state] * own, &k);
            k[row.state] = own;
        }
        k
    }
}

/// `x + sum of weight[j] k[j]`.
#[inline(always)]
fn combine<const N: usize>(x: &[f64; N], weights: &[f64], k: &[&[f64; N]]) -> [f64; N] {
    let mut sum = *x;
    for (weight, k) in weights.iter().zip(k).filter(|(weight, _)| **weight != 0.0) {
        for (sum, k) in sum.iter_mut().zip(*k) {
            *sum += weight * k;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance<2> = Tolerance { relative: 1.0, scale: [1.0; 2] };

    fn oscillator(x: &[f64; 2]) -> [f64; 2] {
        [x[1], -x[0]]
    }

    fn alone<const N: usize>(f: impl Fn(&[f64; N]) -> [f64; N]) -> impl Fn(&[f64; N]) -> ([f64; N], ()) {
        move |x| (f(x), ())
    }

    /// Error at `t = 2` of the oscillator that starts at (1, 0), and of the dense output in mid-step.
    fn errors(steps: u32, row: StiffRow<2>) -> (f64, f64) {
        let h = 2.0 / f64::from(steps);
        let (mut x, mut dense_error) = ([1.0, 0.0], 0.0_f64);
        for n in 0..steps {
            let trial = step(&oscillator, &alone(oscillator), &x, &oscillator(&x), &[row], h, &TOLERANCE);
            let middle = h * (f64::from(n) + 0.5);
            dense_error = dense_error.max((trial.at(0.5)[0] - middle.cos()).abs());
            x = trial.end;
        }
        ((x[0] - 2.0_f64.cos()).hypot(x[1] + 2.0_f64.sin()), dense_error)
    }

    #[test]
    fn halving_the_step_shows_order_3_with_any_stiff_row() {
        let right = StiffRow::new(1, [-1.0, 0.0]);
        let wrong = StiffRow::new(0, [-2.0, 0.7]);
        for row in [StiffRow::none(), right, wrong] {
            let (coarse, fine) = (errors(80, row), errors(160, row));
            let order = |a: f64, b: f64| (a / b).log2();
            assert!((order(coarse.0, fine.0) - 3.0).abs() < 0.2, "{}", order(coarse.0, fine.0));
            assert!((order(coarse.1, fine.1) - 3.0).abs() < 0.2, "{}", order(coarse.1, fine.1));
        }
    }

    #[test]
    fn a_row_is_summed_from_the_first_to_the_last_state_that_it_depends_on() {
        let supports = [[0.0, 2.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0, 3.0], [0.0, 0.0, 0.0, 0.0, 4.0], [0.0; 5]];
        let x = [1.0, 10.0, 100.0, 1e3, 1e4];
        for (gradient, (support, expected)) in
            supports.into_iter().zip([(1..4, -980.0), (0..5, 30_001.0), (4..5, 4e4), (5..5, 0.0)])
        {
            let row = StiffRow::new(1, gradient);
            let whole = row.after(row.before(&x) + gradient[1] * x[1], &x);
            assert_eq!((row.first..row.end, whole), (support, expected));
        }
    }

    #[test]
    fn a_stiff_row_is_stable_at_steps_far_beyond_its_time_constant() {
        let f = |x: &[f64; 2]| [-1e5 * (x[0] - x[1]), -x[1]];
        let row = StiffRow::new(0, [-1e5, 1e5]);
        let mut x = [3.0, 1.0];
        for _ in 0..100 {
            x = step(&f, &alone(f), &x, &f(&x), &[row], 0.02, &TOLERANCE).end;
        }
        assert!((x[1] - (-2.0_f64).exp()).abs() < 1e-5 && (x[0] - x[1]).abs() < 1e-4, "{x:?}");
    }

    #[test]
    fn the_dense_output_meets_both_ends_of_the_step() {
        let x = [0.3, -0.8];
        let trial = step(&oscillator, &alone(oscillator), &x, &oscillator(&x), &[], 0.4, &TOLERANCE);
        assert_eq!(trial.at(0.0), x);
        assert!(trial.at(1.0).iter().zip(trial.end).all(|(a, b)| (a - b).abs() < 1e-15));
    }
}
