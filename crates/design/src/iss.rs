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

use std::fmt;

use car::DesignRequirement;
use drivetrain::Real;
use nalgebra::DMatrix;
use observer::Phase;

use crate::lmi::{Block, Outcome, Problem};
use crate::{Certificate, Polytope};

/// `kappa1` starts at this part of `kappa2` and is raised by as much each time.
const KAPPA1_STEP: f64 = 1.0 / 40.0;
/// The loop ends where `kappa1` reaches this many times `kappa2`; the minimum lies below `kappa2`.
const KAPPA1_MAX: f64 = 4.0;
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
        "no constant gain gives a decay rate of {decay_per_s:.1}/s at every vertex of the polytope\n\
         hint: use a longer settling time, or narrower ranges in [observer.uncertainty]"
    )]
    DecayUnreachable {
        /// `kappa1 + kappa2`, 1/s.
        decay_per_s: f64,
    },
    /// Gains exist, but no gain meets the limit of the offset.
    #[error(transparent)]
    OffsetUnreachable(Box<OffsetMissed>),
    /// The conic solver found no solution.
    #[error(
        "the conic solver found no solution: {0}\nhint: relax the requirements in [design], such as the settling time, or use another method"
    )]
    Solver(String),
    /// The solution failed the check by eigenvalues.
    #[error(
        "the gain of the solver does not satisfy the inequalities when they are evaluated without the solver\nhint: use another method, or another settling time"
    )]
    NotCertified,
    /// One of these errors, in this phase.
    #[error("{}: {error}", .phase.name().replace('_', " "))]
    InPhase {
        /// The phase.
        phase: Phase,
        /// What is wrong there.
        error: Box<DesignError>,
    },
}

impl DesignError {
    /// This error of the design for a phase.
    pub(crate) fn in_phase(self, phase: Phase) -> Self {
        match self {
            said @ (Self::OffsetUnreachable(_) | Self::InPhase { .. }) => said,
            error => Self::InPhase { phase, error: Box::new(error) },
        }
    }
}

/// A required offset that no certified gain reaches, and the best certified gain.
#[derive(Debug, Clone, PartialEq)]
pub struct OffsetMissed {
    /// The phase.
    pub phase: Phase,
    /// Source of the requirement: a key and its file, or an option.
    pub required_by: String,
    /// Required offset, Pa.
    pub required_pa: f64,
    /// The settling time that is required with it, s.
    pub settling_time_s: f64,
    /// The smallest offset that a certified gain has with that settling time, Pa.
    pub offset_pa: f64,
    /// Its `kappa1`, 1/s.
    pub kappa1_per_s: f64,
    /// Whether `kappa1` was given, so that no other value was tried.
    pub kappa1_is_required: bool,
    /// That gain, as text.
    pub gain: String,
    /// The shortest settling time with which a certified gain has the required offset, s, if there is one.
    pub reached_with_s: Option<f64>,
}

impl core::error::Error for OffsetMissed {}

impl fmt::Display for OffsetMissed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (required, offset) = (1e-6 * self.required_pa, 1e-6 * self.offset_pa);
        let phase = self.phase.name().replace('_', " ");
        writeln!(
            f,
            "{phase}: {} requires an offset of at most {required:.5} MPa; with a settling time of {:.3} s{} the smallest offset \
             of a certified gain is {offset:.5} MPa",
            self.required_by,
            self.settling_time_s,
            if self.kappa1_is_required { format!(" and kappa1 {}/s", self.kappa1_per_s) } else { String::new() },
        )?;
        writeln!(f, "  the best certified gain: {}, with kappa1 {:.2}/s", self.gain, self.kappa1_per_s)?;
        match self.reached_with_s {
            Some(time_s) => {
                // Rounded up: the time must be long enough.
                let time_s = (1e3 * time_s).ceil() / 1e3;
                write!(
                    f,
                    "hint: use a settling time of {time_s:.3} s, which reaches {required:.5} MPa; or allow a larger offset"
                )?;
            }
            None => write!(
                f,
                "hint: no settling time up to {LONGEST_S} s reaches {required:.5} MPa; allow a larger offset"
            )?,
        }
        write!(f, ", or find a smaller bound on the model error")
    }
}

/// Longest settling time that is tried for an offset, s; the longest that a vehicle file may require.
const LONGEST_S: f64 = 10.0;
/// Factor between the settling times that are tried.
const TIME_STEP: f64 = std::f64::consts::SQRT_2;
/// Halvings of the last step.
const HALVINGS: usize = 6;

/// The shortest settling time from `from_s` on with which `offset` (of `kappa2`, 1/s) is at most `required_pa`, s.
pub(crate) fn settling_time_for(required_pa: f64, from_s: f64, offset: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let reached = |time_s: f64| offset(4.0 / time_s).is_some_and(|offset_pa| offset_pa <= required_pa);
    let (mut short, mut long) = (from_s, from_s * TIME_STEP);
    while !reached(long.min(LONGEST_S)) {
        if long >= LONGEST_S {
            return None;
        }
        (short, long) = (long, long * TIME_STEP);
    }
    long = long.min(LONGEST_S);
    for _ in 0..HALVINGS {
        let middle = (short * long).sqrt();
        if reached(middle) { long = middle } else { short = middle }
    }
    Some(long)
}

/// Designs the gain for this polytope by the five steps: the first certified one with the required offset, or, where
/// there is none, the one with the smallest.
///
/// # Errors
/// See [`DesignError`]; there is no certified gain.
pub fn design_iss(requirement: &IssRequirement, polytope: &Polytope) -> Result<Certificate, DesignError> {
    five_steps(
        requirement.kappa1_per_s,
        requirement.kappa2_per_s,
        requirement.offset_max_pa,
        |certificate: &Certificate| (certificate.kappa1_per_s, certificate.offset_pa),
        |kappa1_per_s| smallest_gain(kappa1_per_s, requirement, polytope),
    )
}

/// Steps 2 to 5: raises `kappa1` until `smallest_gain` gives an acceptable offset or no smaller one, or takes the one
/// `kappa1` that is given. `measure` reads `kappa1` (1/s) and offset (Pa) of a certificate.
pub(crate) fn five_steps<C>(
    kappa1_per_s: Option<f64>,
    kappa2_per_s: f64,
    offset_max_pa: f64,
    measure: impl Fn(&C) -> (f64, f64),
    smallest_gain: impl Fn(f64) -> Result<C, DesignError>,
) -> Result<C, DesignError> {
    if let Some(kappa1_per_s) = kappa1_per_s {
        return smallest_gain(kappa1_per_s);
    }
    let step = KAPPA1_STEP * kappa2_per_s;
    let mut best = smallest_gain(step)?;
    while measure(&best).1 > offset_max_pa {
        let Ok(next) = smallest_gain(measure(&best).0 + step) else { break };
        let (kappa1_per_s, offset_pa) = measure(&next);
        if offset_pa >= measure(&best).1 || kappa1_per_s > KAPPA1_MAX * kappa2_per_s {
            break;
        }
        best = next;
    }
    Ok(best)
}

/// A certified gain with what it misses as an error.
pub(crate) fn required<C>((certificate, missed): (C, Option<OffsetMissed>)) -> Result<C, DesignError> {
    match missed {
        None => Ok(certificate),
        Some(missed) => Err(DesignError::OffsetUnreachable(Box::new(missed))),
    }
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
    let needed = |a22: f64, g: [f64; 2]| (asked + a22).max(0.0) / Real::hypot(g[0], g[1]);
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
