//! The smallest ellipsoid that no error within the bounds can leave (J. Abedor, K. Nagpal, K. Poolla, A linear matrix
//! inequality approach to peak-to-peak gain minimization, 1996), by a line search on `lambda`:
//!
//! ```text
//! [ (1-lambda) Q   0          (Q A_i)'  ]
//! [ 0              diag(a_i)  (Q B_i)'  ] >= 0 and sum a_i <= lambda g at every vertex i,   [Q C'; C g] >= 0,   min g
//! [ *              *          Q         ]
//! ```
//!
//! with `A = Phi - L G Psi` and `B` the columns of the errors of `x = e + L n`, see [`super::system`]; then in steady state
//! `|C x| <= g`, and `|C e| <= g + |C L| n`. The ellipsoid is `x' Q x <= g`. With one state and one vertex this is the exact
//! peak-to-peak gain.
//!
//! For a given gain that is a program in `Q`, `a` and `g`. With the gain as an unknown, `Y = Q L`, all is linear but the columns
//! `Q (I - A) L n` of the readings and the last term. They are replaced by their tangent at the last gain found, `L0` with `Q0`
//! and `A0`:
//!
//! ```text
//! Q (I - A) L  by  (Q - Q Phi + Y G Psi) L0 + Q0 (I - A0) Q0^-1 (Y - Q L0),      L  by  L0 + Q0^-1 (Y - Q L0)
//! ```
//!
//! Each solution is the next `L0`, as long as its bound, which is computed for the gain itself, falls.
//!
//! A gain that follows the friction is `b_1 L_1 + b_2 L_2`, as `G` is. Its columns are cubic in `b`: with `M_pqi` the matrix
//! above for the gain `p` in `A`, the gain `q` behind it, and the vertex `i`, it is certified between the ends if the mean of all
//! `M_pqi` with the same number of indices 2 is not negative, for each number.

use nalgebra::DMatrix;

use super::found::{DiscreteMargin, Found, WORTH_A_GAIN, open_loop_bound, slowest};
use super::norm::Norm;
use super::search::{Search, SolverRecord, min_over};
use super::system::{Corner, ErrorSystem};
use crate::iss::DesignError;
use crate::lmi::{Block, Problem, block_of, min_eigenvalue, stacked};

/// Errors are made larger by this fraction in a program than in the check, which leaves room for rounding.
const RESERVE: f64 = 1e-4;
/// The gain is sought in multiples of this, so that the unknowns are of order 1.
const GAIN_UNIT: f64 = 30.0;
/// Where the searches for `lambda` end: a factor between its last two values, at first and for the gain that was found.
const WITHIN: [f64; 2] = [0.2, 0.02];
/// Times that the gain is sought for a `lambda` and then the best `lambda` for the gain, at most.
const PASSES: usize = 4;
/// A tangent, and a pass, is the last if it reduces the bound by less than this fraction.
const SETTLED: f64 = 5e-4;
/// Part of the way to the next gain that is tried at least.
const SHORTEST_WAY: f64 = 0.2;

/// The gain, constant or following the friction, with the smallest bound, if one is certified.
pub(crate) fn smallest_ellipsoid(
    system: &ErrorSystem,
    scheduled: bool,
    round: impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<(Option<Found>, SolverRecord), DesignError> {
    let inequalities = inequalities(system, scheduled);
    let ends = 1 + inequalities.iter().flat_map(|i| &i.terms).map(|term| term.gain).max().unwrap_or(0);
    let design = Design { system, inequalities, ends };
    let mut search = Search::default();
    let range = [0.1 * (1.0 - slowest(system)), 0.99];
    let mut tangent = Tangent::open_loop(system, ends);
    // At the open loop the tangent leaves out what is of second order in the gain, so that this cost is too low.
    let mut min_cost = f64::INFINITY;
    let mut lambda = min_over(range, WITHIN[0], |lambda| {
        let solution = search.solve(&design.program(lambda, &tangent, true));
        let cost = solution.map_or(f64::INFINITY, |x| design.cost(&x));
        min_cost = min_cost.min(cost);
        cost
    });
    let mut bound = f64::INFINITY;
    // The best lambda moves with the gain.
    for _ in 0..PASSES {
        let last = bound;
        while let Some((lower, next)) = design.next(&mut search, lambda, &tangent, bound, &round) {
            let settled = lower > bound * (1.0 - SETTLED);
            (bound, tangent) = (lower, next);
            if settled || min_cost >= WORTH_A_GAIN * open_loop_bound(system) {
                break;
            }
        }
        let within = if bound > last * (1.0 - SETTLED) { WITHIN[1] } else { WITHIN[0] };
        lambda = min_over([lambda / 1.5, (1.5 * lambda).min(0.99)], within, |lambda| {
            let (found, _) = design.evaluated(&mut search, lambda, tangent.gains.clone());
            search.keep(found)
        });
        if within == WITHIN[1] {
            break;
        }
    }
    search.finish()
}

/// One matrix of a mean: the gain `p` in `A`, the gain `q` behind it, the corner.
struct Term<'a> {
    gain: usize,
    behind: usize,
    corner: &'a Corner,
}

/// Matrices whose mean must not be negative.
struct Inequality<'a> {
    label: String,
    terms: Vec<Term<'a>>,
}

fn inequalities(system: &ErrorSystem, scheduled: bool) -> Vec<Inequality<'_>> {
    let corners = &system.corners;
    let pairs = corners.iter().enumerate().flat_map(|(i, first)| {
        corners[i + 1..].iter().filter(|second| second.valve == first.valve).map(move |second| [first, second])
    });
    let pairs: Vec<[&Corner; 2]> = pairs.collect();
    if !scheduled || pairs.is_empty() {
        let term = |corner| Term { gain: 0, behind: 0, corner };
        return corners.iter().map(|c| Inequality { label: c.label.clone(), terms: vec![term(c)] }).collect();
    }
    pairs.into_iter().flat_map(|ends| (0..=3).map(move |seconds| between(ends, seconds))).collect()
}

/// All terms with this number of indices of the second end.
fn between(ends: [&Corner; 2], seconds: usize) -> Inequality<'_> {
    let label = match seconds {
        0 => ends[0].label.clone(),
        3 => ends[1].label.clone(),
        _ => format!("{} with {}, {seconds}/3", ends[0].label, ends[1].label),
    };
    let all = (0..8).map(|bits| [bits & 1, bits >> 1 & 1, bits >> 2 & 1]);
    let terms = all.filter(|indices| indices.iter().sum::<usize>() == seconds);
    let terms = terms.map(|[gain, behind, corner]| Term { gain, behind, corner: ends[corner] }).collect();
    Inequality { label, terms }
}

/// Gains with the ellipsoid that was found for them.
#[derive(Clone)]
struct Tangent {
    gains: Vec<DMatrix<f64>>,
    shape: DMatrix<f64>,
    /// Its inverse.
    inverse: DMatrix<f64>,
}

impl Tangent {
    fn open_loop(system: &ErrorSystem, ends: usize) -> Self {
        let states = system.states();
        let shape = DMatrix::identity(states, states);
        Self { gains: vec![DMatrix::zeros(states, system.h.nrows()); ends], inverse: shape.clone(), shape }
    }
}

/// The numbers that a program or a check puts into the matrix.
struct Point<'a> {
    q: DMatrix<f64>,
    ys: Vec<DMatrix<f64>>,
    lambda: f64,
    tangent: &'a Tangent,
    /// Factor on every error.
    inflated: f64,
}

struct Design<'a> {
    system: &'a ErrorSystem,
    inequalities: Vec<Inequality<'a>>,
    /// Number of gains.
    ends: usize,
}

impl Design<'_> {
    fn triangle(&self) -> usize {
        self.system.states() * (self.system.states() + 1) / 2
    }

    /// Entries of one gain.
    fn entries(&self) -> usize {
        self.system.states() * self.system.h.nrows()
    }

    /// Columns of `B`.
    fn causes(&self) -> usize {
        let readings = self.system.readings.ncols();
        readings * self.ends + self.system.corners[0].columns.ncols() + self.system.corners[0].direct_columns.ncols()
    }

    /// Unknowns: the upper triangle of `Q`, `a` of each inequality, `g`; of a program for a gain also each `Y` by rows and the
    /// bound on each reading's part of the last term.
    fn g_at(&self) -> usize {
        self.triangle() + self.inequalities.len() * self.causes()
    }

    fn a<'x>(&self, x: &'x [f64], inequality: usize) -> &'x [f64] {
        let at = self.triangle() + inequality * self.causes();
        &x[at..at + self.causes()]
    }

    fn q(&self, x: &[f64]) -> DMatrix<f64> {
        match self.system.states() {
            1 => DMatrix::from_element(1, 1, x[0]),
            _ => DMatrix::from_row_slice(2, 2, &[x[0], x[1], x[1], x[2]]),
        }
    }

    fn y(&self, x: &[f64], end: usize) -> DMatrix<f64> {
        let at = self.g_at() + 1 + end * self.entries();
        DMatrix::from_row_slice(self.system.states(), self.system.h.nrows(), &x[at..at + self.entries()]) * GAIN_UNIT
    }

    fn point<'t>(&self, x: &[f64], lambda: f64, tangent: &'t Tangent, sought: bool) -> Point<'t> {
        let q = self.q(x);
        let y = |end| if sought { self.y(x, end) } else { &q * &tangent.gains[end] };
        Point { ys: (0..self.ends).map(y).collect(), q, lambda, tangent, inflated: 1.0 + RESERVE }
    }

    /// The program for this `lambda`: for a gain that is `sought`, or for that of the tangent.
    fn program(&self, lambda: f64, tangent: &Tangent, sought: bool) -> Problem {
        let (states, readings, g_at) = (self.system.states(), self.system.readings.ncols(), self.g_at());
        let t_at = g_at + 1 + self.ends * self.entries();
        let unknowns = if sought { t_at + readings } else { g_at + 1 };
        let mut blocks: Vec<Block> = Vec::new();
        // The check takes the smaller lambda on both sides, which leaves room for rounding in the decay too.
        let fraction = lambda * (1.0 - RESERVE) * (1.0 - 1e-6);
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        let of_y = g_at + 1..if sought { t_at } else { g_at + 1 };
        for (i, inequality) in self.inequalities.iter().enumerate() {
            let of_a = self.triangle() + i * self.causes()..self.triangle() + (i + 1) * self.causes();
            let mut matrix = block_of(unknowns, (0..self.triangle()).chain(of_y.clone()), |x| {
                self.matrix(inequality, &self.point(x, lambda, tangent, sought), self.a(x, i))
            });
            for (j, k) in of_a.clone().enumerate() {
                matrix.per_unknown[k][(states + j, states + j)] = 1.0;
            }
            blocks.push(matrix);
            let room = |x: &[f64]| one(fraction * x[g_at] - self.a(x, i).iter().sum::<f64>());
            blocks.push(block_of(unknowns, of_a.chain([g_at]), room));
        }
        let mut pressure = DMatrix::zeros(1, states);
        pressure[(0, states - 1)] = 1.0;
        let on = (0..self.triangle()).chain([g_at]);
        blocks.push(block_of(unknowns, on, |x| stacked(&self.q(x), &pressure, &one(x[g_at]))));
        if sought {
            for (end, gain) in tangent.gains.iter().enumerate() {
                for reading in 0..readings {
                    let last = |x: &[f64]| {
                        let moved = gain + &tangent.inverse * (self.y(x, end) - self.q(x) * gain);
                        (moved.row(states - 1) * self.system.readings.column(reading))[0]
                    };
                    for sign in [1.0, -1.0] {
                        let room = |x: &[f64]| one(x[t_at + reading] + sign * last(x));
                        let on = (0..self.triangle()).chain(g_at + 1..t_at).chain([t_at + reading]);
                        blocks.push(block_of(unknowns, on, room));
                    }
                }
            }
        }
        let mut objective = vec![0.0; unknowns];
        objective[g_at..].fill(1.0);
        if sought {
            objective[g_at + 1..t_at].fill(0.0);
        }
        Problem { objective, blocks }
    }

    /// What a program for a gain minimises, at its solution.
    fn cost(&self, x: &[f64]) -> f64 {
        let g_at = self.g_at();
        x[g_at] + x[g_at + 1 + self.ends * self.entries()..].iter().sum::<f64>()
    }

    /// The gains of a solution.
    fn gains(&self, x: &[f64]) -> Option<Vec<DMatrix<f64>>> {
        let inverse = self.q(x).try_inverse()?;
        Some((0..self.ends).map(|end| &inverse * self.y(x, end)).collect())
    }

    /// The mean of the matrices of an inequality, with `a` on the diagonal.
    fn matrix(&self, inequality: &Inequality<'_>, at: &Point<'_>, a: &[f64]) -> DMatrix<f64> {
        let states = self.system.states();
        let n = states + a.len();
        let mut diagonal = DMatrix::zeros(n, n);
        diagonal.view_mut((0, 0), (states, states)).copy_from(&(&at.q * (1.0 - at.lambda)));
        for (j, a) in a.iter().enumerate() {
            diagonal[(states + j, states + j)] = *a;
        }
        let mut row = DMatrix::zeros(states, n);
        for term in &inequality.terms {
            row += self.row(term, at);
        }
        row /= inequality.terms.len() as f64;
        stacked(&diagonal, &row, &at.q)
    }

    /// `[Q A, Q B]` of one term.
    fn row(&self, term: &Term<'_>, at: &Point<'_>) -> DMatrix<f64> {
        let (corner, tangent, readings) = (term.corner, at.tangent, &self.system.readings);
        let (y, behind) = (&at.ys[term.gain], &at.ys[term.behind]);
        let q_a = &at.q * &corner.phi - y * &corner.g_psi;
        // `Q0 A0 Q0^-1`.
        let a0 = &tangent.shape * corner.error_dynamics(&tangent.gains[term.gain]) * &tangent.inverse;
        let l0 = &tangent.gains[term.behind];
        let turned = behind - &at.q * l0;
        let of_readings = (&at.q - &q_a) * l0 + &turned - &a0 * turned;
        let mut parts = vec![q_a.clone(), of_readings * readings * at.inflated];
        if self.ends > 1 {
            let across = &tangent.gains[1] - &tangent.gains[0];
            let turned = &at.ys[1] - &at.ys[0] - &at.q * &across;
            let stepped = q_a * across + a0 * turned;
            parts.push(stepped * readings * (self.system.friction_step * at.inflated));
        }
        parts.push(y * &corner.columns * -at.inflated);
        parts.push(&at.q * &corner.direct_columns * at.inflated);
        let columns: Vec<_> = parts.iter().flat_map(|part| part.column_iter()).collect();
        DMatrix::from_columns(&columns)
    }

    /// The gains of the program at this tangent, with their ellipsoid, if their bound is below `bound`; else those between.
    fn next(
        &self,
        search: &mut Search,
        lambda: f64,
        tangent: &Tangent,
        bound: f64,
        round: &impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
    ) -> Option<(f64, Tangent)> {
        let x = search.solve(&self.program(lambda, tangent, true))?;
        let to = self.gains(&x)?;
        let mut way = 1.0;
        while way >= SHORTEST_WAY {
            let gains = tangent.gains.iter().zip(&to).map(|(from, to)| round(&(from + (to - from) * way))).collect();
            let (found, next) = self.evaluated(search, lambda, gains);
            let reached = search.keep(found);
            if reached < bound {
                return next.map(|next| (reached, next));
            }
            way *= 0.5;
        }
        None
    }

    /// The ellipsoid of these gains for this `lambda`, if there is one, and the gains with it.
    fn evaluated(
        &self,
        search: &mut Search,
        lambda: f64,
        gains: Vec<DMatrix<f64>>,
    ) -> (Option<Found>, Option<Tangent>) {
        let given = Tangent { gains, ..Tangent::open_loop(self.system, self.ends) };
        let Some(x) = search.solve(&self.program(lambda, &given, false)) else { return (None, None) };

        // From here on the solver is not believed.
        let checked = lambda * (1.0 - RESERVE);
        let q = self.q(&x);
        let Some(inverse) = q.clone().try_inverse() else { return (None, None) };
        // An error that the gain does not let in has a multiplier of zero, up to the solver's tolerance.
        let minimum = x[self.g_at()].abs() * checked * 0.5e-6 / self.causes() as f64;
        let multipliers: Vec<Vec<f64>> = (0..self.inequalities.len())
            .map(|i| self.a(&x, i).iter().map(|a| a.max(0.0) + minimum).collect())
            .collect();
        let sum = multipliers.iter().map(|a| a.iter().sum::<f64>()).fold(0.0, f64::max);
        let g = sum / checked;
        let ys = given.gains.iter().map(|gain| &q * gain).collect();
        let point = Point { q: q.clone(), ys, lambda: checked, tangent: &given, inflated: 1.0 };
        let margins: Vec<DiscreteMargin> = (self.inequalities.iter().zip(&multipliers))
            .map(|(inequality, a)| DiscreteMargin {
                label: inequality.label.clone(),
                minimum: min_eigenvalue(&self.matrix(inequality, &point, a)),
            })
            .collect();
        let holds = margins.iter().all(|margin| margin.minimum >= 0.0);
        let last = given.gains.iter().map(|gain| self.system.last_reading(gain)).fold(0.0, f64::max);
        let pressure = self.system.states() - 1;
        let bound = (g * inverse[(pressure, pressure)]).sqrt() + last;
        let contraction = (1.0 - checked).sqrt();
        let found = holds.then(|| {
            let norm = Norm::ellipsoid(q.clone())?;
            Some(Found { gains: given.gains.clone(), bound, margins, norm, contraction })
        });
        (found.flatten(), Some(Tangent { shape: q, inverse, ..given }))
    }
}
