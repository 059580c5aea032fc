//! The five-step design of the input-to-state-stable observer, Theorem 2.2.
//!
//! 1. `kappa2` follows from the wanted settling time.
//! 2. `kappa1` starts small.
//! 3. The smallest gain that satisfies (2.50) is the solution of (2.53).
//! 4. The offset follows from (2.42).
//! 5. If it is too large, `kappa1` is raised.
//!
//! In the scalar case `|L| = (kappa1 + kappa2 + A22)/|G_min|`, so the offset goes as
//! `(kappa1 + kappa2 + A22)/sqrt(kappa1 kappa2)`: it has its minimum at `kappa1 = kappa2 + A22`, and past
//! that raising `kappa1` makes things worse. The loop stops there and says what can be had.

use config::DesignRequirement;
use nalgebra::DMatrix;

use crate::lmi::{Block, Outcome, Problem};
use crate::{Certificate, Polytope};

/// `kappa1` starts at this part of `kappa2` and is raised by as much each time.
const KAPPA1_STEP: f64 = 1.0 / 40.0;
/// The loop ends where `kappa1` reaches this many times `kappa2`; the minimum lies below `kappa2`.
const KAPPA1_MOST: f64 = 4.0;
/// By how much the program asks for more decay than required, relatively, so that the solution satisfies
/// the inequalities strictly: the solver meets its constraints to about 1e-8.
const DECAY_RESERVE: f64 = 1e-7;

/// What the gain must reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IssRequirement {
    /// `kappa1`, 1/s, if it is to be just that and not found by the loop.
    pub kappa1_per_s: Option<f64>,
    /// `kappa2`, 1/s.
    pub kappa2_per_s: f64,
    /// Bound on the model error `|w|`, rad/s^2.
    pub model_error_max_rad_s2: f64,
    /// Largest acceptable offset, Pa.
    pub offset_max_pa: f64,
}

impl From<&DesignRequirement> for IssRequirement {
    fn from(requirement: &DesignRequirement) -> Self {
        Self {
            kappa1_per_s: requirement.kappa1_per_s,
            kappa2_per_s: 4.0 / requirement.settling_time_s,
            model_error_max_rad_s2: requirement.model_error_max_rad_s2,
            offset_max_pa: requirement.offset_max_pa,
        }
    }
}

/// Why there is no gain.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// No constant gain reaches the decay at every vertex.
    #[error(
        "no constant gain makes the error decay with {decay_per_s:.1}/s at every vertex of the polytope\n\
         hint: ask for a longer settling time, or narrow the ranges in [observer.uncertainty]"
    )]
    DecayUnreachable {
        /// `kappa1 + kappa2`, 1/s.
        decay_per_s: f64,
    },
    /// Gains exist, but none keeps the offset small enough.
    #[error(
        "the offset bound cannot be brought below {best_pa:.0} Pa (at kappa1 = {kappa1_per_s:.2}/s), and \
         {wanted_pa:.0} Pa are required\n\
         hint: allow a longer settling time or a larger offset, or find a smaller bound on the model error"
    )]
    OffsetUnreachable {
        /// The smallest offset bound, Pa.
        best_pa: f64,
        /// Where it is reached, 1/s.
        kappa1_per_s: f64,
        /// What was required, Pa.
        wanted_pa: f64,
    },
    /// The conic solver ended without an answer.
    #[error("the conic solver ended without an answer: {0}")]
    Solver(String),
    /// The solution failed the check by eigenvalues.
    #[error("the solver's gain does not satisfy the inequalities when they are evaluated again")]
    NotCertified,
}

/// Designs the gain for this polytope by the five steps.
///
/// # Errors
/// See [`DesignError`]; each says which requirement cannot be met.
pub fn design_iss(requirement: &IssRequirement, polytope: &Polytope) -> Result<Certificate, DesignError> {
    five_steps(
        requirement.kappa1_per_s,
        requirement.kappa2_per_s,
        requirement.offset_max_pa,
        |certificate: &Certificate| (certificate.kappa1_per_s, certificate.offset_pa),
        |kappa1_per_s| smallest_gain(kappa1_per_s, requirement, polytope),
    )
}

/// Steps 2 to 5: raises `kappa1` until `smallest_gain` gives an acceptable offset, or takes the one `kappa1`
/// that is given. `measure` reads `kappa1` (1/s) and offset (Pa) of a certificate.
pub(crate) fn five_steps<C>(
    kappa1_per_s: Option<f64>,
    kappa2_per_s: f64,
    offset_max_pa: f64,
    measure: impl Fn(&C) -> (f64, f64),
    smallest_gain: impl Fn(f64) -> Result<C, DesignError>,
) -> Result<C, DesignError> {
    let unreachable = |best: &C| {
        let (kappa1_per_s, best_pa) = measure(best);
        DesignError::OffsetUnreachable { best_pa, kappa1_per_s, wanted_pa: offset_max_pa }
    };
    let acceptable = |certificate: &C| measure(certificate).1 <= offset_max_pa;
    if let Some(kappa1_per_s) = kappa1_per_s {
        let certificate = smallest_gain(kappa1_per_s)?;
        return if acceptable(&certificate) { Ok(certificate) } else { Err(unreachable(&certificate)) };
    }
    let step = KAPPA1_STEP * kappa2_per_s;
    let mut best = smallest_gain(step)?;
    while !acceptable(&best) {
        let next = smallest_gain(measure(&best).0 + step)?;
        let (kappa1_per_s, offset_pa) = measure(&next);
        if offset_pa >= measure(&best).1 || kappa1_per_s > KAPPA1_MOST * kappa2_per_s {
            return Err(unreachable(&best));
        }
        best = next;
    }
    Ok(best)
}

/// The smallest gain for this `kappa1`: `min alpha` subject to (2.50) and `[alpha L; L' I] >= 0` (2.53).
fn smallest_gain(
    kappa1_per_s: f64,
    requirement: &IssRequirement,
    polytope: &Polytope,
) -> Result<Certificate, DesignError> {
    let decay_per_s = kappa1_per_s + requirement.kappa2_per_s;
    let asked = decay_per_s * (1.0 + DECAY_RESERVE);
    // In units of the gain that one vertex alone would need, the unknowns (alpha, L) are of order 1.
    let needed = |a22: f64, g: [f64; 2]| (asked + a22).max(0.0) / g[0].hypot(g[1]);
    let unit = (polytope.vertices.iter()).map(|v| needed(v.a22_per_s, v.g_rad_s2_pa)).fold(0.0, f64::max);
    if unit == 0.0 {
        return certify([0.0; 2], kappa1_per_s, requirement, polytope, 0);
    }
    let mut blocks: Vec<Block> = (polytope.vertices.iter())
        .map(|vertex| {
            let [g0, g1] = vertex.g_rad_s2_pa.map(|g| g * unit / asked);
            Block::linear(-(asked + vertex.a22_per_s) / asked, &[0.0, g0, g1])
        })
        .collect();
    blocks.push(gain_block());
    match (Problem { objective: vec![1.0, 0.0, 0.0], blocks }).solve() {
        Outcome::Solved { unknowns, iterations } => {
            let gain = [unit * unknowns[1], unit * unknowns[2]];
            certify(gain, kappa1_per_s, requirement, polytope, iterations)
        }
        Outcome::Infeasible => Err(DesignError::DecayUnreachable { decay_per_s }),
        Outcome::Failed(word) => Err(DesignError::Solver(word)),
    }
}

/// `[alpha L; L' I]` for the unknowns `(alpha, L1, L2)`.
fn gain_block() -> Block {
    let symmetric = |i: usize, j: usize| {
        let mut matrix = DMatrix::zeros(3, 3);
        matrix[(i, j)] = 1.0;
        matrix[(j, i)] = 1.0;
        matrix
    };
    let mut identity = DMatrix::identity(3, 3);
    identity[(0, 0)] = 0.0;
    Block { constant: identity, per_unknown: vec![symmetric(0, 0), symmetric(0, 1), symmetric(0, 2)] }
}

fn certify(
    gain: [f64; 2],
    kappa1_per_s: f64,
    requirement: &IssRequirement,
    polytope: &Polytope,
    solver_iterations: u32,
) -> Result<Certificate, DesignError> {
    let certificate = Certificate::check(gain, kappa1_per_s, requirement, polytope);
    certificate.map(|c| Certificate { solver_iterations, ..c }).ok_or(DesignError::NotCertified)
}
