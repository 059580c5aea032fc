//! Gains that are not made for a sample time: given ones, and those of continuous time. Whether an error grows from sample to
//! sample, and the longest step over which it shrinks.

use car::{GainMethod, GivenGains, ObserverEntry, ObserverKind, SAMPLE_TIMES_S, Vehicle};
use drivetrain::Real;
use nalgebra::DMatrix;
use observer::{Discretisation, Phase};

use super::design_discrete;
use super::model::Model;
use super::norm::{Norm, longest_step};
use super::system::{corners, outputs};
use crate::certificate::Certificate;
use crate::compliant::{CompliantCertificate, PRESSURE_UNIT_PA, SPEED_UNITS_RAD_S, best_compliant};
use crate::iss::DesignError;
use crate::rigid::best_rigid;

/// A corner of the polytope at which an error grows.
#[derive(Debug, Clone, PartialEq)]
pub struct UnstableCorner {
    /// The phase.
    pub phase: Phase,
    /// What is extreme there.
    pub label: String,
    /// Largest size of an eigenvalue of `Phi - L G Psi`: what an error is multiplied by in a sample.
    pub factor: f64,
}

/// Normalised gains of the torque phase and the inertia phase.
struct Gains {
    model: Model,
    phases: [(Phase, DMatrix<f64>); 2],
}

/// The gains that are given for this observer; none if its gains are designed, or if it is of another kind: the error of a
/// sliding mode is not linear.
fn given(entry: &ObserverEntry) -> Option<Gains> {
    let rigid = |gain: &[f64]| {
        let normalised = gain.iter().zip(SPEED_UNITS_RAD_S).map(|(l, unit)| l * unit / PRESSURE_UNIT_PA);
        DMatrix::from_row_iterator(1, gain.len(), normalised)
    };
    let (model, torque, inertia) = match &entry.gains {
        Some(GivenGains::Rigid { torque_phase_pa_s_rad, inertia_phase_pa_s_rad }) => {
            (Model::Rigid, rigid(&[*torque_phase_pa_s_rad]), rigid(inertia_phase_pa_s_rad))
        }
        Some(GivenGains::CompliantNormalised(torque, inertia)) => (
            Model::Compliant,
            DMatrix::from_row_slice(2, 2, torque.as_flattened()),
            DMatrix::from_row_slice(2, 3, inertia.as_flattened()),
        ),
        Some(GivenGains::Sliding { .. }) | None => return None,
    };
    Some(Gains { model, phases: [(Phase::TorquePhase, torque), (Phase::InertiaPhase, inertia)] })
}

/// The corners at which the given gains of this observer let an error grow at its sample time; none if its gains are
/// designed, or if it is of another kind.
pub fn unstable_corners(vehicle: &Vehicle, entry: &ObserverEntry) -> Vec<UnstableCorner> {
    let gains = given(entry);
    gains.map_or_else(Vec::new, |gains| unstable_at(vehicle, &gains, entry.discretisation, entry.sample_time_s))
}

fn unstable_at(
    vehicle: &Vehicle,
    gains: &Gains,
    discretisation: Discretisation,
    sample_time_s: f64,
) -> Vec<UnstableCorner> {
    let in_phase = |(phase, gain): &(Phase, DMatrix<f64>)| {
        let (phase, gain) = (*phase, gain.clone());
        let corners = corners(vehicle, gains.model, phase, sample_time_s, discretisation);
        corners.into_iter().filter_map(move |corner| {
            let closed_loop = corner.error_dynamics(&gain);
            let factor = closed_loop
                .complex_eigenvalues()
                .iter()
                .map(|value| Real::hypot(value.re, value.im))
                .fold(0.0, f64::max);
            (factor >= 1.0).then_some(UnstableCorner { phase, label: corner.label, factor })
        })
    };
    gains.phases.iter().flat_map(in_phase).collect()
}

/// The longest step over which no error grows with the given gains of this observer, s; none if it has no such gains, or if an
/// error grows over the shortest step already.
pub fn longest_stable_step_s(vehicle: &Vehicle, entry: &ObserverEntry) -> Option<f64> {
    let gains = given(entry)?;
    let stable = |step_s: f64| unstable_at(vehicle, &gains, entry.discretisation, step_s).is_empty();
    let shortest_s = *SAMPLE_TIMES_S.start();
    stable(shortest_s).then(|| longest_step(shortest_s, stable))
}

/// The longest step over which an error decays with `kappa2` at least, as a certificate in continuous time promises it, s:
/// `|Phi - L G Psi| <= exp(-kappa2 step)` at every vertex.
fn longest_decaying_step_s(
    vehicle: &Vehicle,
    model: Model,
    phase: Phase,
    discretisation: Discretisation,
    (gain, kappa2_per_s): (&DMatrix<f64>, f64),
) -> f64 {
    let norm = Norm::euclidean(gain.nrows());
    longest_step(*SAMPLE_TIMES_S.start(), |step_s| {
        let corners = corners(vehicle, model, phase, step_s, discretisation);
        let decayed = Real::exp(-kappa2_per_s * step_s);
        corners.iter().all(|corner| norm.factor(&corner.error_dynamics(gain)) <= decayed)
    })
}

impl Certificate {
    /// The longest step over which the gain may correct, s: over it the error still decays with `kappa2` at every vertex.
    pub fn longest_step_s(&self, vehicle: &Vehicle, phase: Phase, discretisation: Discretisation) -> f64 {
        let outputs = outputs(Model::Rigid, phase);
        let entry = |&output: &usize| self.gain_pa_s_rad[output] * SPEED_UNITS_RAD_S[output] / PRESSURE_UNIT_PA;
        let gain = DMatrix::from_row_iterator(1, outputs.len(), outputs.iter().map(entry));
        longest_decaying_step_s(vehicle, Model::Rigid, phase, discretisation, (&gain, self.kappa2_per_s))
    }
}

impl CompliantCertificate {
    /// The longest step over which the gain may correct, s: over it the normalised error still decays with `kappa2` at every
    /// vertex.
    pub fn longest_step_s(&self, vehicle: &Vehicle, phase: Phase, discretisation: Discretisation) -> f64 {
        let rows = &self.gain_normalised;
        let gain = DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
        longest_decaying_step_s(vehicle, Model::Compliant, phase, discretisation, (&gain, self.kappa2_per_s))
    }
}

/// The longest step over which the speeds may correct the estimate of an observer of an experiment file, s: of designed gains
/// by their certificate, of given ones that over which no error grows. `None` of an observer without such gains.
///
/// # Errors
/// There is no certified gain.
pub fn longest_step_of(vehicle: &Vehicle, entry: &ObserverEntry) -> Result<Option<f64>, DesignError> {
    if entry.gains.is_some() {
        return Ok(longest_stable_step_s(vehicle, entry));
    }
    let (method, discretisation) = (entry.method, entry.discretisation);
    Ok(match (entry.kind, method) {
        (ObserverKind::Rigid, GainMethod::Iss) => Some(best_rigid(vehicle)?.0.longest_step_s(vehicle, discretisation)),
        (ObserverKind::Compliant, GainMethod::Iss) => {
            Some(best_compliant(vehicle)?.0.longest_step_s(vehicle, discretisation))
        }
        (ObserverKind::Rigid, _) => {
            Some(design_discrete(vehicle, Model::Rigid, method, entry.sample_time_s)?.longest_step_s())
        }
        (ObserverKind::Compliant, _) => {
            Some(design_discrete(vehicle, Model::Compliant, method, entry.sample_time_s)?.longest_step_s())
        }
        _ => None,
    })
}
