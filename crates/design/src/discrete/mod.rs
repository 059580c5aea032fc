//! Gains of the rigid and the compliant observer for a sample time, with every error of the budget in the bound.
//!
//! With `F`, `G` and the valve frozen over a sample of length `T`, the error of the observer obeys
//!
//! ```text
//! e+ = (Phi - L G Psi) e - L (T H w + n+ - n) + v
//! ```
//!
//! for errors `w` of the accelerations, `n` of the speed readings, and `v` of valve and twist, each within its bound of the
//! vehicle file; `system` brings it into the form in which the readings' errors do not add up. Four designs, in the normalised units of
//! [`crate::compliant`]; each has its own file:
//!
//! * [`GainMethod::IssDiscrete`], the discrete form of Eq. (2.83)-(2.84): the smallest gain with the required decay.
//! * [`GainMethod::PeakToPeak`]: the smallest ellipsoid that no error within the bounds can leave.
//! * [`GainMethod::Scheduled`]: the same with a gain that depends on the friction coefficient. In discrete time the error does not
//!   depend on a derivative of the gain.
//! * [`GainMethod::Interval`]: an undisturbed error keeps its sign, so that a lower and an upper limit of the estimate can be
//!   computed with it; the gain with the smallest width.
//!
//! Every inequality is evaluated again without the solver, for the gain in single precision as a controller stores
//! it. If the bound of a gain is not below the bound of the open loop, the result is the open loop.
//!
//! A certificate is for its sample time. The speeds may correct the estimate over a longer step, after a lost sample, as long as
//! an error still shrinks by the certified factor: [`DiscreteCertificate::longest_step_s`].

mod contributions;
mod ellipsoid;
mod error_model;
pub(crate) mod found;
pub(crate) mod given;
mod interval;
mod model;
pub(crate) mod norm;
pub(crate) mod search;
mod smallest_gain;
pub(crate) mod system;

use car::{GainMethod, SAMPLE_TIMES_S, Vehicle};
use nalgebra::DMatrix;
use observer::{CompliantGains, Phase, RigidGains, Schedule};
use serde::Serialize;

use crate::certificate::BOTH_DIRECTIONS;
use crate::compliant::{PRESSURE_UNIT_PA, SPEED_UNITS_RAD_S, compliant_requirement};
use crate::iss::DesignError;
use crate::rigid::requirement;
pub use contributions::Contribution;
use contributions::contributions;
pub use error_model::{ErrorModel, error_models};
pub use found::DiscreteMargin;
use found::{Found, WORTH_A_GAIN, open_loop_bound};
pub use model::{Model, Quantity};
use norm::{Norm, longest_certified_step};
pub use search::SolverRecord;
use system::{Corner, ErrorSystem, outputs, state_units};

/// A gain of a sampled observer in one phase, with the bound on its error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteCertificate {
    /// The observer.
    pub model: Model,
    /// How the gain was chosen.
    pub method: GainMethod,
    /// What the bounds are on.
    pub quantity: Quantity,
    /// The gain; two at the ends of a schedule.
    pub gains: Vec<GainAt>,
    /// The sample time, s.
    pub sample_time_s: f64,
    /// Whether no gain reduces the bound, so that the result is the open loop.
    pub uses_open_loop: bool,
    /// Steady-state bound on the error, Pa.
    pub bound_pa: f64,
    /// Steady-state bound of the best gain, Pa, whether it is used or not.
    pub best_gain_bound_pa: f64,
    /// Steady-state bound of the open loop, Pa.
    pub open_loop_bound_pa: f64,
    /// The longest step over which the gain multiplies an error by at most the certified factor of one sample, s, in the norm of
    /// the certificate. Over a longer one the speeds must not correct the estimate. Of the open loop, which corrects nothing, it
    /// is the longest sample time that an observer may have.
    pub longest_step_s: f64,
    /// What the solver did.
    pub solver: SolverRecord,
    /// What the error is made of at the worst corner of the polytope, were friction and valve to stay there.
    pub contributions: Vec<Contribution>,
    /// Every inequality, evaluated; none is negative.
    pub margins: Vec<DiscreteMargin>,
    /// Clutch torque of 1 MPa at the middle of the friction's range, N m.
    pub torque_n_m_mpa: f64,
    /// Directions of slip for which it holds: with backward slip the gain on the pressure changes its sign with `G`.
    pub slip_directions: &'static str,
}

/// A gain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainAt {
    /// The friction coefficient that it is for, if it follows that.
    pub friction: Option<f64>,
    /// `L`, normalised, rows `(T_s, p)` or `p` alone, of a gain that is exact in single precision in physical units; zero
    /// for the open loop.
    pub normalised: Vec<Vec<f64>>,
}

/// Certified gains of both phases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteDesign {
    /// Torque phase.
    pub torque_phase: DiscreteCertificate,
    /// Inertia phase.
    pub inertia_phase: DiscreteCertificate,
}

/// Designs the gain of one phase for a sample time. For [`GainMethod::Iss`], which has no sample time, the result is
/// that of [`GainMethod::IssDiscrete`].
///
/// # Errors
/// The solver's, see [`DesignError`].
pub fn design_discrete_phase(
    vehicle: &Vehicle,
    model: Model,
    method: GainMethod,
    quantity: Quantity,
    phase: Phase,
    sample_time_s: f64,
) -> Result<DiscreteCertificate, DesignError> {
    certified(vehicle, model, method, quantity, phase, sample_time_s).map_err(|error| error.in_phase(phase))
}

fn certified(
    vehicle: &Vehicle,
    model: Model,
    method: GainMethod,
    quantity: Quantity,
    phase: Phase,
    sample_time_s: f64,
) -> Result<DiscreteCertificate, DesignError> {
    let system = ErrorSystem::of(vehicle, model, quantity, phase, sample_time_s);
    let open_loop_bound = open_loop_bound(&system);
    let (found, solver) = match open_loop_bound {
        // Nothing disturbs the valve model, and no gain can do better than that.
        0.0 => (None, SolverRecord::default()),
        _ => best_gain(vehicle, &system, method, (model, phase), sample_time_s)?,
    };
    // Where no gain is certified, none is the best.
    let found = found.unwrap_or_else(|| without_a_gain(&system, method, open_loop_bound));
    let open_loop_bound_pa = PRESSURE_UNIT_PA * open_loop_bound;
    let best_gain_bound_pa = PRESSURE_UNIT_PA * found.bound;
    let uses_open_loop = best_gain_bound_pa >= WORTH_A_GAIN * open_loop_bound_pa;
    let gains: Vec<DMatrix<f64>> =
        found.gains.iter().map(|gain| if uses_open_loop { gain * 0.0 } else { gain.clone() }).collect();
    let case = (vehicle, model, phase, sample_time_s);
    let longest_step_s = match uses_open_loop {
        true => *SAMPLE_TIMES_S.end(),
        false => longest_certified_step(case, &gains, &found.norm, found.contraction),
    };
    let scheduled = gains.len() > 1;
    let at = |end: usize| scheduled.then(|| end_friction(vehicle, end));
    Ok(DiscreteCertificate {
        model,
        method,
        quantity,
        torque_n_m_mpa: torque_n_m_mpa(vehicle),
        contributions: contributions(&system, &gains),
        gains: (gains.iter().enumerate())
            .map(|(end, gain)| GainAt {
                friction: at(end),
                normalised: gain.row_iter().map(|row| row.iter().map(|x| x + 0.0).collect()).collect(),
            })
            .collect(),
        sample_time_s,
        uses_open_loop,
        bound_pa: if uses_open_loop { open_loop_bound_pa } else { best_gain_bound_pa },
        best_gain_bound_pa,
        open_loop_bound_pa,
        longest_step_s,
        solver,
        margins: found.margins,
        slip_directions: BOTH_DIRECTIONS,
    })
}

/// The gain by this method with its bound; none where no gain is certified.
fn best_gain(
    vehicle: &Vehicle,
    system: &ErrorSystem,
    method: GainMethod,
    (model, phase): (Model, Phase),
    sample_time_s: f64,
) -> Result<(Option<Found>, SolverRecord), DesignError> {
    let round = |gain: &DMatrix<f64>| rounded(gain, model, phase);
    match method {
        GainMethod::Iss | GainMethod::IssDiscrete => {
            let kappa2_per_s = match model {
                Model::Rigid => 4.0 / requirement(vehicle, phase).settling_time_s,
                Model::Compliant => compliant_requirement(vehicle, phase).kappa2_per_s,
            };
            match smallest_gain::smallest_gain(system, kappa2_per_s, sample_time_s, round) {
                Err(DesignError::DecayUnreachable { .. }) => Ok((None, SolverRecord { solved: 1, failed: 0 })),
                found => found.map(|(found, solver)| (Some(found), solver)),
            }
        }
        GainMethod::PeakToPeak => ellipsoid::smallest_ellipsoid(system, false, round),
        GainMethod::Scheduled => ellipsoid::smallest_ellipsoid(system, true, round),
        GainMethod::Interval => interval::narrowest_interval(system, round),
    }
}

/// Clutch torque of 1 MPa at the middle of the friction's range, N m.
fn torque_n_m_mpa(vehicle: &Vehicle) -> f64 {
    let (minimum, maximum) = vehicle.settings.uncertainty.friction;
    let clutch = &vehicle.oncoming.clutch;
    1e6 * 0.5 * (minimum + maximum) * clutch.lever() * clutch.piston_area_m2
}

/// Designs the gains of both phases for a sample time, with the smallest bounds on the clutch torque.
///
/// # Errors
/// As [`design_discrete_phase`].
pub fn design_discrete(
    vehicle: &Vehicle,
    model: Model,
    method: GainMethod,
    sample_time_s: f64,
) -> Result<DiscreteDesign, DesignError> {
    let phase = |phase| design_discrete_phase(vehicle, model, method, Quantity::ClutchTorque, phase, sample_time_s);
    Ok(DiscreteDesign { torque_phase: phase(Phase::TorquePhase)?, inertia_phase: phase(Phase::InertiaPhase)? })
}

impl DiscreteDesign {
    /// The longest step over which the speeds may correct the estimate in every phase, s.
    pub fn longest_step_s(&self) -> f64 {
        self.torque_phase.longest_step_s.min(self.inertia_phase.longest_step_s)
    }

    /// The gains of the rigid observer in physical units.
    pub fn rigid_gains(&self) -> Schedule<f64, RigidGains<f64>> {
        let of = |certificate: &DiscreteCertificate, end: usize| -> Vec<f64> {
            let row = &certificate.end(end).normalised[0];
            row.iter().zip(SPEED_UNITS_RAD_S).map(|(l, unit)| l * PRESSURE_UNIT_PA / unit).collect()
        };
        self.schedule(|end| {
            let (torque, inertia) = (of(&self.torque_phase, end), of(&self.inertia_phase, end));
            RigidGains { torque_phase_pa_s_rad: torque[0], inertia_phase_pa_s_rad: [inertia[0], inertia[1]] }
        })
    }

    /// The gains of the compliant observer in physical units.
    pub fn compliant_gains(&self) -> Schedule<f64, CompliantGains<f64>> {
        self.schedule(|end| {
            let of = |certificate: &DiscreteCertificate| certificate.end(end).normalised.clone();
            crate::compliant::physical_gains(&of(&self.torque_phase), &of(&self.inertia_phase))
        })
    }

    fn schedule<G: Clone>(&self, at: impl Fn(usize) -> G) -> Schedule<f64, G> {
        let ends = [0, 1].map(|end| self.inertia_phase.end(end).friction);
        match ends {
            [Some(minimum), Some(maximum)] => Schedule { friction: [minimum, maximum], ends: [at(0), at(1)] },
            _ => Schedule::constant(at(0)),
        }
    }
}

impl DiscreteCertificate {
    /// The gain at an end of the schedule; a constant one is the same at both.
    fn end(&self, end: usize) -> &GainAt {
        &self.gains[end.min(self.gains.len() - 1)]
    }
}

fn end_friction(vehicle: &Vehicle, end: usize) -> f64 {
    if end == 0 { vehicle.settings.uncertainty.friction.0 } else { vehicle.settings.uncertainty.friction.1 }
}

/// What the open loop has as a gain: none. Its inequality is that of a valve that forgets: `1 - Phi` of the pressure.
fn without_a_gain(system: &ErrorSystem, method: GainMethod, bound: f64) -> Found {
    let (states, outputs) = (system.states(), system.h.nrows());
    let forgets = |corner: &Corner| DiscreteMargin {
        label: corner.label.clone(),
        minimum: 1.0 - corner.phi[(states - 1, states - 1)],
    };
    let ends = if method == GainMethod::Scheduled { 2 } else { 1 };
    Found {
        gains: vec![DMatrix::zeros(states, outputs); ends],
        bound,
        margins: system.corners.iter().map(forgets).collect(),
        norm: Norm::euclidean(states),
        contraction: 1.0,
    }
}

/// The gain as a controller has it: in physical units and in single precision, here normalised again.
// Rounding is the purpose.
fn rounded(gain: &DMatrix<f64>, model: Model, phase: Phase) -> DMatrix<f64> {
    let (states, outputs) = (state_units(model), outputs(model, phase));
    DMatrix::from_fn(gain.nrows(), gain.ncols(), |i, j| {
        let unit = states[i] / SPEED_UNITS_RAD_S[outputs[j]];
        f64::from((gain[(i, j)] * unit) as f32) / unit
    })
}

#[cfg(test)]
mod tests;
