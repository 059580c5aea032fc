//! The smallest gain with the required contraction, the discrete form of Eq. (2.83)-(2.84):
//!
//! ```text
//! min trace(alpha),  [alpha LH; * I] >= 0,  [rho I, (Phi - L G Psi)'; *, rho I] >= 0 at every vertex
//! ```
//!
//! with `rho = exp(-kappa2 T)`. Of several solutions it is the one with the smallest `|L|`: with two causes of error, three
//! outputs leave a direction of `L` that `LH` does not contain. In steady state `|x|` of [`super::system`] is at most the sum of
//! the lengths of all columns over `1 - |Phi - L G Psi|`, at the vertex where that is largest.

use drivetrain::Real;
use nalgebra::{DMatrix, DVector};

use super::found::{DiscreteMargin, Found};
use super::norm::Norm;
use super::search::{Search, SolverRecord};
use super::system::{Corner, ErrorSystem};
use crate::iss::DesignError;
use crate::lmi::{Block, Problem, block, min_eigenvalue, stacked};

/// The gain is sought in multiples of this, so that the unknowns are of order 1.
const GAIN_UNIT: f64 = 30.0;

/// How much more than the required contraction is asked of the solver, as a relative margin, one after the other: the first is lost where the
/// terms of `L G Psi` cancel, so that the solver's tolerance or the rounding of the gain to single precision is more than it.
const MARGINS: [f64; 3] = [1e-6, 1e-5, 1e-4];

/// The gain, of the smallest margin with which it is certified.
pub(crate) fn smallest_gain(
    system: &ErrorSystem,
    kappa2_per_s: f64,
    sample_time_s: f64,
    round: impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<(Found, SolverRecord), DesignError> {
    let rho = Real::exp(-kappa2_per_s * sample_time_s);
    let with_margin = |margin: f64| with_margin(system, (rho, margin), kappa2_per_s, &round);
    let is_refused = |found: &Result<_, DesignError>| matches!(found, Err(DesignError::NotCertified));
    let [first, others @ ..] = MARGINS;
    let mut found = with_margin(first);
    for margin in others {
        if is_refused(&found) {
            found = with_margin(margin);
        }
    }
    found
}

/// Unknowns: the entries of alpha, then `L` by rows.
fn with_margin(
    system: &ErrorSystem,
    (rho, margin): (f64, f64),
    kappa2_per_s: f64,
    round: &impl Fn(&DMatrix<f64>) -> DMatrix<f64>,
) -> Result<(Found, SolverRecord), DesignError> {
    let (states, outputs) = (system.states(), system.h.nrows());
    let unknowns = states + states * outputs;
    let gain = |x: &[f64]| DMatrix::from_row_slice(states, outputs, &x[states..]) * GAIN_UNIT;
    let identity = DMatrix::identity(states, states);
    let contraction = |l: &DMatrix<f64>, corner: &Corner, rho: f64| {
        stacked(&(&identity * rho), &(&corner.phi - l * &corner.g_psi), &(&identity * rho))
    };
    let mut blocks: Vec<Block> = (system.corners.iter())
        .map(|corner| block(unknowns, |x| contraction(&gain(x), corner, rho * (1.0 - margin))))
        .collect();
    let causes = system.h.ncols();
    blocks.push(block(unknowns, |x| {
        let alpha = DMatrix::from_diagonal(&DVector::from_row_slice(&x[..states]));
        let size = gain(x) * &system.h / GAIN_UNIT;
        stacked(&alpha, &size.transpose(), &DMatrix::identity(causes, causes))
    }));
    let mut objective = vec![0.0; unknowns];
    objective[..states].fill(1.0);
    let mut search = Search::default();
    let Some(x) = search.take((Problem { objective, blocks }).solve_min_norm(states..unknowns)) else {
        let (_, record) = search.finish()?;
        debug_assert_eq!(record.failed, 0);
        return Err(DesignError::DecayUnreachable { decay_per_s: kappa2_per_s });
    };
    let gain = round(&gain(&x));
    let margins: Vec<DiscreteMargin> = (system.corners.iter())
        .map(|corner| DiscreteMargin {
            label: corner.label.clone(),
            minimum: min_eigenvalue(&contraction(&gain, corner, rho)),
        })
        .collect();
    if margins.iter().any(|margin| margin.minimum < 0.0) {
        return Err(DesignError::NotCertified);
    }
    let length = |columns: &DMatrix<f64>| columns.column_iter().map(|column| column.norm()).sum::<f64>();
    let norm = Norm::euclidean(states);
    let bound_at = |corner: &Corner| {
        let matrix = corner.error_dynamics(&gain);
        let of_readings = (&identity - &matrix) * &gain * &system.readings;
        let added = length(&of_readings) + length(&(&gain * &corner.columns)) + length(&corner.direct_columns);
        added / (1.0 - norm.factor(&matrix).min(rho))
    };
    let bound = system.corners.iter().map(bound_at).fold(0.0, f64::max) + system.last_reading(&gain);
    let (_, record) = search.finish()?;
    Ok((Found { gains: vec![gain], bound, margins, norm, contraction: rho }, record))
}

#[cfg(test)]
mod tests {
    use car::{GainMethod, Vehicle};
    use config::VehicleFile;
    use observer::Phase;

    use super::super::{Model, Quantity, design_discrete_phase, rounded};
    use super::*;

    #[test]
    fn the_discrete_twin_has_the_reference_gain() {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let phase = Phase::TorquePhase;
        let mut system = ErrorSystem::of(&vehicle, Model::Compliant, Quantity::Pressure, phase, 0.01);
        system.h = DMatrix::from_row_slice(2, 2, &[2.38, 0.0, 0.0, 0.13]);
        let (found, _) =
            smallest_gain(&system, -0.67_f64.ln() / 0.01, 0.01, |gain| rounded(gain, Model::Compliant, phase)).unwrap();
        let reference = DMatrix::from_row_slice(2, 2, &[-1.29, 18.04, -2.70, -64.8]);
        // The reference is printed to three digits.
        let gain = &found.gains[0];
        assert!((gain - &reference).component_div(&reference).abs().max() < 0.004, "{gain}");
    }

    #[test]
    fn the_rigid_twin_contracts_and_yields_to_the_open_loop_where_it_must() {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let design = |vehicle: &Vehicle, phase| {
            design_discrete_phase(vehicle, Model::Rigid, GainMethod::IssDiscrete, Quantity::Pressure, phase, 0.01)
                .unwrap()
        };
        assert!(design(&vehicle, Phase::TorquePhase).uses_open_loop);
        // A valve that may be five times as late is worth a gain, and that gain contracts as the settling time asks.
        let mut poor = vehicle.clone();
        poor.error_bounds.valve_delay_s[1] *= 5.0;
        let certificate = design(&poor, Phase::InertiaPhase);
        assert!(!certificate.uses_open_loop && certificate.bound_pa < certificate.open_loop_bound_pa);
        let rho = (-4.0 / vehicle.requirements.inertia_phase.settling_time_s * 0.01).exp();
        let model = crate::rigid_model(&vehicle);
        let valve = model.valve.linear(0.0, 0.0);
        let phi = (valve.a22_per_s * 0.01).exp();
        for friction in [0.10, 0.13, 0.16] {
            let influence = model.influence(Phase::InertiaPhase, friction);
            let gain = &certificate.gains[0].normalised[0];
            let per_gain = |i: usize| gain[i] * influence[i] * 1e5 / 100.0;
            let factor = phi - (per_gain(0) + per_gain(1)) * (phi - 1.0) / valve.a22_per_s;
            assert!(factor.abs() <= rho, "{factor} at friction {friction}");
        }
    }
}
