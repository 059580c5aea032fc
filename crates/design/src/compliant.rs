//! Gains of the compliant observer, Eq. (2.83)-(2.84), in the chapter's normalised units.
//!
//! States are measured in 1000 N m and 0.1 MPa, speeds in 100 rad/s (turbine, slip) and 10 rad/s (wheel).
//! The error obeys `de/dt = (A22 - L G) e - L H w`, Eq. (2.75), where `H w` is the effect of the errors of turbine
//! torque, mass and grade on the accelerations. The gain satisfies
//!
//! ```text
//! sym(A22_i - L G_i) <= -(kappa1 + kappa2) I   at every vertex i                       (2.78), (2.83)
//! min trace(alpha),  alpha diagonal,  [alpha L H; H' L' I] >= 0                        (2.84)
//! ```
//!
//! and the remaining error is at most `|w| sqrt(lambda_max(H' L' L H)/(4 kappa1 kappa2))`, Eq. (2.81).

use car::Vehicle;
use nalgebra::DMatrix;
use observer::{CompliantGains, CompliantModel, CompliantObserver, Discretisation, Phase, Schedule};
use serde::Serialize;

use crate::budget::{grade_n_m, mass_n_m, turbine_n_m};
use crate::certificate::BOTH_DIRECTIONS;
use crate::iss::{DesignError, OffsetMissed, five_steps, settling_time_for};
use crate::lmi::{Block, Outcome, Problem, largest_eigenvalue};
use crate::polytope::{distinct, valve_extremes};
use crate::rigid::{rigid_model, tracker};

/// Unit of the shaft torque, N m.
pub const SHAFT_UNIT_N_M: f64 = 1000.0;
/// Unit of the pressure, Pa.
pub const PRESSURE_UNIT_PA: f64 = 1e5;
/// Units of `(w_t, dw, w_w)`, rad/s.
pub const SPEED_UNITS_RAD_S: [f64; 3] = [100.0, 100.0, 10.0];
/// The gain is sought in multiples of this, so that the unknowns are of order 1.
const GAIN_UNIT: f64 = 50.0;
/// By how much the program asks for more decay than required, relatively; see `iss`.
const DECAY_RESERVE: f64 = 1e-6;

/// What the gain must reach.
#[derive(Debug, Clone, PartialEq)]
pub struct CompliantRequirement {
    /// `kappa1`, 1/s, if it is to be just that and not found by the loop.
    pub kappa1_per_s: Option<f64>,
    /// `kappa2`, 1/s.
    pub kappa2_per_s: f64,
    /// `H`, normalised: a row for each output, a column for each cause of error.
    pub h: DMatrix<f64>,
    /// Bound on `|w|`; 1 for one cause at its limit, the root of their number for all at once.
    pub w_max: f64,
    /// Largest acceptable offset of the pressure, Pa.
    pub offset_max_pa: f64,
}

/// A vertex: what is extreme there, `A22` and `G`, normalised.
#[derive(Debug, Clone, PartialEq)]
struct Vertex {
    label: String,
    a22: DMatrix<f64>,
    g: DMatrix<f64>,
}

/// One vertex inequality of Eq. (2.83), evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompliantMargin {
    /// What is extreme there.
    pub label: String,
    /// `-lambda_max(sym(A22 - L G))`, 1/s.
    pub decay_per_s: f64,
    /// How far that exceeds `kappa1 + kappa2`, 1/s; not negative.
    pub margin_per_s: f64,
}

/// A gain of the compliant observer with what is promised about it.
///
/// Assumes what `H` was computed from, and, as the chapter, a valve that obeys its model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompliantCertificate {
    /// `L`, normalised, as the chapter prints it: rows `(T_s, p)`, a column for each output.
    pub gain_normalised: Vec<Vec<f64>>,
    /// `H`, normalised.
    pub h_normalised: Vec<Vec<f64>>,
    /// `kappa1`, 1/s.
    pub kappa1_per_s: f64,
    /// `kappa2`, 1/s.
    pub kappa2_per_s: f64,
    /// Bound on `|w|`.
    pub w_max: f64,
    /// Bound on the normalised error that remains, Eq. (2.81).
    pub offset_normalised: f64,
    /// The same for the pressure alone, Pa.
    pub offset_pa: f64,
    /// The same for the shaft torque alone, N m.
    pub offset_n_m: f64,
    /// What was asked for, Pa.
    pub offset_max_pa: f64,
    /// Every vertex inequality.
    pub vertices: Vec<CompliantMargin>,
    /// Directions of slip for which it holds: with backward slip the gain on the pressure changes its sign with `G`.
    pub slip_directions: &'static str,
    /// Iterations of the conic solver.
    pub solver_iterations: u32,
}

/// Certified gains of the compliant observer in both phases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompliantDesign {
    /// Torque phase, outputs `(w_t, w_w)`.
    pub torque_phase: CompliantCertificate,
    /// Inertia phase, outputs `(w_t, dw, w_w)`.
    pub inertia_phase: CompliantCertificate,
}

impl CompliantDesign {
    /// The longest step over which the speeds may correct the estimate, s: over it the error still decays as certified.
    pub fn longest_step_s(&self, vehicle: &Vehicle, discretisation: Discretisation) -> f64 {
        let of = |certificate: &CompliantCertificate, phase| certificate.longest_step_s(vehicle, phase, discretisation);
        of(&self.torque_phase, Phase::TorquePhase).min(of(&self.inertia_phase, Phase::InertiaPhase))
    }

    /// The gains in physical units.
    pub fn gains(&self) -> CompliantGains<f64> {
        physical_gains(&self.torque_phase.gain_normalised, &self.inertia_phase.gain_normalised)
    }

    /// The certificate of a phase in which the observer corrects.
    pub fn of(&self, phase: Phase) -> Option<&CompliantCertificate> {
        match phase {
            Phase::TorquePhase => Some(&self.torque_phase),
            Phase::InertiaPhase => Some(&self.inertia_phase),
            Phase::BeforeShift | Phase::AfterShift => None,
        }
    }
}

/// Normalised gains, rows `(T_s, p)` by outputs, in physical units: torque phase on `(w_t, w_w)`, inertia phase
/// on `(w_t, dw, w_w)`.
pub fn physical_gains<R: AsRef<[f64]>, S: AsRef<[f64]>>(torque: &[R], inertia: &[S]) -> CompliantGains<f64> {
    CompliantGains {
        torque_phase: physical(torque, outputs(Phase::TorquePhase)),
        inertia_phase: physical(inertia, outputs(Phase::InertiaPhase)),
    }
}

fn physical<R: AsRef<[f64]>>(normalised: &[R], outputs: &[usize]) -> [[f64; 3]; 2] {
    let mut gain = [[0.0; 3]; 2];
    for ((row, unit), given) in gain.iter_mut().zip([SHAFT_UNIT_N_M, PRESSURE_UNIT_PA]).zip(normalised) {
        for (&output, value) in outputs.iter().zip(given.as_ref()) {
            row[output] = value * unit / SPEED_UNITS_RAD_S[output];
        }
    }
    gain
}

/// Which of `(w_t, dw, w_w)` are outputs in a phase.
pub(crate) fn outputs(phase: Phase) -> &'static [usize] {
    match phase {
        Phase::InertiaPhase => &[0, 1, 2],
        _ => &[0, 2],
    }
}

/// The powertrain model of the compliant observer of this vehicle.
pub fn compliant_model(vehicle: &Vehicle) -> CompliantModel<f64> {
    CompliantModel::new(rigid_model(vehicle), vehicle.shift)
}

/// The compliant observer of this vehicle with these gains.
pub fn compliant_observer(
    vehicle: &Vehicle,
    gains: impl Into<Schedule<f64, CompliantGains<f64>>>,
) -> CompliantObserver<f64> {
    CompliantObserver {
        model: compliant_model(vehicle),
        gains: gains.into(),
        tracker: tracker(vehicle),
        shaft_settling_s: vehicle.settings.shaft_settling_s,
    }
}

/// `H` from bounds on the errors of turbine torque and of the load at the wheel, Eq. (2.85), (2.86).
///
/// The turbine torque enters turbine and slip together, through one column. A grade acts on the vehicle
/// with `m g R_w sin(theta)`; a mass error makes the wheel answer the shaft torque wrongly by its relative error.
pub fn error_matrix(vehicle: &Vehicle, phase: Phase) -> DMatrix<f64> {
    let model = compliant_model(vehicle);
    let wheel = model.wheel_per_torque * (grade_n_m(vehicle) + mass_n_m(vehicle)) / SPEED_UNITS_RAD_S[2];
    let turbine_n_m = turbine_n_m(vehicle, phase);
    let turbine = |per_torque: f64, output: usize| per_torque * turbine_n_m / SPEED_UNITS_RAD_S[output];
    let rows = &model.inertia_phase;
    match phase {
        Phase::InertiaPhase => DMatrix::from_row_slice(
            3,
            2,
            &[
                turbine(rows.turbine.per_turbine_torque, 0),
                0.0,
                turbine(rows.slip_oncoming.per_turbine_torque, 1),
                0.0,
                0.0,
                wheel,
            ],
        ),
        _ => {
            let per_torque = model.torque_phase.turbine.per_turbine_torque;
            DMatrix::from_row_slice(2, 2, &[turbine(per_torque, 0), 0.0, 0.0, wheel])
        }
    }
}

fn required(vehicle: &Vehicle, phase: Phase) -> &car::CompliantRequirement {
    match phase {
        Phase::InertiaPhase | Phase::AfterShift => &vehicle.requirements.compliant_inertia_phase,
        Phase::BeforeShift | Phase::TorquePhase => &vehicle.requirements.compliant_torque_phase,
    }
}

/// `H` as the vehicle file gives it, if it does.
pub(crate) fn given_error_matrix(vehicle: &Vehicle, phase: Phase) -> Option<DMatrix<f64>> {
    required(vehicle, phase).error_matrix.as_ref().map(|given| {
        let causes = (1..=3).rev().find(|&n| given.iter().any(|row| row[n - 1] != 0.0)).unwrap_or(1);
        DMatrix::from_fn(outputs(phase).len(), causes, |i, j| given[i][j])
    })
}

/// What the vehicle file requires of the compliant observer in a phase.
pub fn compliant_requirement(vehicle: &Vehicle, phase: Phase) -> CompliantRequirement {
    let required = required(vehicle, phase);
    let (h, w_max) = match given_error_matrix(vehicle, phase) {
        None => (error_matrix(vehicle, phase), std::f64::consts::SQRT_2),
        Some(given) => (given, 1.0),
    };
    CompliantRequirement {
        kappa1_per_s: required.kappa1_per_s,
        kappa2_per_s: 4.0 / required.settling_time_s,
        h,
        w_max,
        offset_max_pa: required.offset_max_pa,
    }
}

/// Designs the gains of both phases from the vehicle file's requirements.
///
/// # Errors
/// The requirement that cannot be met, see [`DesignError`].
pub fn design_compliant(vehicle: &Vehicle) -> Result<CompliantDesign, DesignError> {
    let phase = |phase| design_compliant_phase(vehicle, phase, &compliant_requirement(vehicle, phase));
    Ok(CompliantDesign { torque_phase: phase(Phase::TorquePhase)?, inertia_phase: phase(Phase::InertiaPhase)? })
}

/// The same with the best certified gain where the required offset cannot be had, and what is missed.
///
/// # Errors
/// There is no certified gain, see [`DesignError`].
pub fn best_compliant(vehicle: &Vehicle) -> Result<(CompliantDesign, Vec<OffsetMissed>), DesignError> {
    let phase = |phase| best_compliant_phase(vehicle, phase, &compliant_requirement(vehicle, phase));
    let ((torque_phase, first), (inertia_phase, second)) = (phase(Phase::TorquePhase)?, phase(Phase::InertiaPhase)?);
    Ok((CompliantDesign { torque_phase, inertia_phase }, first.into_iter().chain(second).collect()))
}

/// Designs the gain of one phase.
///
/// # Errors
/// The requirement that cannot be met, see [`DesignError`].
pub fn design_compliant_phase(
    vehicle: &Vehicle,
    phase: Phase,
    requirement: &CompliantRequirement,
) -> Result<CompliantCertificate, DesignError> {
    crate::iss::required(best_compliant_phase(vehicle, phase, requirement)?)
}

/// The same with the best certified gain where the required offset cannot be had, and what is missed.
///
/// # Errors
/// There is no certified gain, see [`DesignError`].
pub fn best_compliant_phase(
    vehicle: &Vehicle,
    phase: Phase,
    requirement: &CompliantRequirement,
) -> Result<(CompliantCertificate, Option<OffsetMissed>), DesignError> {
    let vertices = vertices(vehicle, phase);
    let design = |kappa2_per_s| {
        let requirement = CompliantRequirement { kappa2_per_s, ..requirement.clone() };
        five_steps(
            requirement.kappa1_per_s,
            requirement.kappa2_per_s,
            requirement.offset_max_pa,
            |certificate: &CompliantCertificate| (certificate.kappa1_per_s, certificate.offset_pa),
            |kappa1_per_s| smallest_gain(kappa1_per_s, &requirement, &vertices),
        )
    };
    let certificate = design(requirement.kappa2_per_s).map_err(|error| error.in_phase(phase))?;
    let missed = (certificate.offset_pa > requirement.offset_max_pa).then(|| {
        let settling_time_s = 4.0 / requirement.kappa2_per_s;
        let offset = |kappa2_per_s| design(kappa2_per_s).ok().map(|certificate| certificate.offset_pa);
        let row = |row: &Vec<f64>| row.iter().map(|x| format!("{x:.3}")).collect::<Vec<_>>().join(", ");
        let rows = certificate.gain_normalised.iter().map(row).collect::<Vec<_>>().join("; ");
        let key = format!("design.compliant.{}.offset_max_pa", phase.name());
        OffsetMissed {
            phase,
            required_by: format!("`{key}` of {}", vehicle.name),
            required_pa: requirement.offset_max_pa,
            settling_time_s,
            offset_pa: certificate.offset_pa,
            kappa1_per_s: certificate.kappa1_per_s,
            kappa1_is_required: requirement.kappa1_per_s.is_some(),
            gain: format!("L = [{rows}], normalised, rows (T_s, p)"),
            reached_with_s: settling_time_for(requirement.offset_max_pa, settling_time_s, offset),
        }
    });
    Ok((certificate, missed))
}

/// `A22` and `G` at every combination of the extremes of friction and valve, Eq. (2.69), (2.70), (2.82).
fn vertices(vehicle: &Vehicle, phase: Phase) -> Vec<Vertex> {
    let model = compliant_model(vehicle);
    let outputs = outputs(phase);
    let mut vertices = Vec::new();
    for (valve_label, a22_per_s) in valve_extremes(&model.rigid, &vehicle.settings.uncertainty) {
        for friction in distinct(vehicle.settings.uncertainty.friction) {
            let influence = model.influence(phase, friction);
            let unit = [SHAFT_UNIT_N_M, PRESSURE_UNIT_PA];
            vertices.push(Vertex {
                label: format!("friction {friction}{valve_label}"),
                a22: DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, a22_per_s]),
                g: DMatrix::from_fn(outputs.len(), 2, |i, j| {
                    influence[outputs[i]][j] * unit[j] / SPEED_UNITS_RAD_S[outputs[i]]
                }),
            });
        }
    }
    vertices
}

/// The smallest gain for this `kappa1`; of several, that with the smallest sum of squares. `trace(alpha)` leaves a direction of
/// `L` free in the inertia phase: two causes of error act on three outputs, and `L H` does not contain the third.
fn smallest_gain(
    kappa1_per_s: f64,
    requirement: &CompliantRequirement,
    vertices: &[Vertex],
) -> Result<CompliantCertificate, DesignError> {
    smallest_gain_from(GAIN_UNIT, kappa1_per_s, requirement, vertices)
}

/// The same, sought at first in multiples of `gain_unit`, then in those in which the minimum is 1: the gain that is taken
/// depends on what the minimum may grow by, which is a fraction of it only then.
fn smallest_gain_from(
    gain_unit: f64,
    kappa1_per_s: f64,
    requirement: &CompliantRequirement,
    vertices: &[Vertex],
) -> Result<CompliantCertificate, DesignError> {
    let decay_per_s = kappa1_per_s + requirement.kappa2_per_s;
    let take = |outcome| match outcome {
        Outcome::Solved { unknowns, iterations } => Ok((unknowns, iterations)),
        Outcome::Infeasible => Err(DesignError::DecayUnreachable { decay_per_s }),
        Outcome::Failed(word) => Err(DesignError::Solver(word)),
    };
    let at_first = program(gain_unit, decay_per_s, requirement, vertices);
    let (unknowns, first) = take(at_first.solve())?;
    let minimum = unknowns[0] + unknowns[1];
    let gain_unit = if minimum > 0.0 { gain_unit * minimum.sqrt() } else { gain_unit };
    let gains = 2..unknowns.len();
    let (unknowns, more) = take(program(gain_unit, decay_per_s, requirement, vertices).solve_min_norm(gains))?;
    let gain = DMatrix::from_row_slice(2, requirement.h.nrows(), &unknowns[2..]) * gain_unit;
    check(&gain, kappa1_per_s, requirement, vertices)
        .map(|certificate| CompliantCertificate { solver_iterations: first + more, ..certificate })
        .ok_or(DesignError::NotCertified)
}

/// Eq. (2.84) with a gain in multiples of `gain_unit`. Unknowns: the two entries of alpha, then `L` by rows.
fn program(gain_unit: f64, decay_per_s: f64, requirement: &CompliantRequirement, vertices: &[Vertex]) -> Problem {
    let (outputs, causes) = requirement.h.shape();
    let asked = decay_per_s * (1.0 + DECAY_RESERVE);
    let unknowns = 2 + 2 * outputs;
    let entry = |k: usize| ((k - 2) / outputs, (k - 2) % outputs);
    let symmetric = |matrix: &DMatrix<f64>| (matrix + matrix.transpose()) * 0.5;
    let unit_gain = |k: usize| {
        let (row, column) = entry(k);
        let mut gain = DMatrix::zeros(2, outputs);
        gain[(row, column)] = gain_unit;
        gain
    };

    let mut blocks: Vec<Block> = (vertices.iter())
        .map(|vertex| Block {
            constant: (-symmetric(&vertex.a22) - DMatrix::identity(2, 2) * asked) / asked,
            per_unknown: (0..unknowns)
                .map(|k| if k < 2 { DMatrix::zeros(2, 2) } else { symmetric(&(unit_gain(k) * &vertex.g)) / asked })
                .collect(),
        })
        .collect();
    // [alpha L H; H' L' I], with alpha in units of the gain's unit squared.
    let order = 2 + causes;
    let mut constant = DMatrix::identity(order, order);
    constant[(0, 0)] = 0.0;
    constant[(1, 1)] = 0.0;
    let per_unknown = (0..unknowns)
        .map(|k| {
            let mut block = DMatrix::zeros(order, order);
            if k < 2 {
                block[(k, k)] = 1.0;
            } else {
                let corner = unit_gain(k) * &requirement.h / gain_unit;
                block.view_mut((0, 2), (2, causes)).copy_from(&corner);
                block.view_mut((2, 0), (causes, 2)).copy_from(&corner.transpose());
            }
            block
        })
        .collect();
    blocks.push(Block { constant, per_unknown });

    let mut objective = vec![0.0; unknowns];
    objective[..2].fill(1.0);
    Problem { objective, blocks }
}

/// Evaluates every inequality for this gain, without the solver; `None` if one does not hold.
fn check(
    gain: &DMatrix<f64>,
    kappa1_per_s: f64,
    requirement: &CompliantRequirement,
    vertices: &[Vertex],
) -> Option<CompliantCertificate> {
    let kappa2_per_s = requirement.kappa2_per_s;
    let margins: Vec<CompliantMargin> = (vertices.iter())
        .map(|vertex| {
            let decay_per_s = -largest_eigenvalue(&(&vertex.a22 - gain * &vertex.g));
            CompliantMargin {
                label: vertex.label.clone(),
                decay_per_s,
                margin_per_s: decay_per_s - kappa1_per_s - kappa2_per_s,
            }
        })
        .collect();
    if !margins.iter().all(|vertex| vertex.margin_per_s >= 0.0) {
        return None;
    }
    let disturbance = gain * &requirement.h;
    let size_squared = largest_eigenvalue(&(disturbance.transpose() * &disturbance)).max(0.0);
    let offset = requirement.w_max * (size_squared / (4.0 * kappa1_per_s * kappa2_per_s)).sqrt();
    let rows = |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    Some(CompliantCertificate {
        gain_normalised: rows(gain),
        h_normalised: rows(&requirement.h),
        kappa1_per_s,
        kappa2_per_s,
        w_max: requirement.w_max,
        offset_normalised: offset,
        offset_pa: offset * PRESSURE_UNIT_PA,
        offset_n_m: offset * SHAFT_UNIT_N_M,
        offset_max_pa: requirement.offset_max_pa,
        vertices: margins,
        slip_directions: BOTH_DIRECTIONS,
        solver_iterations: 0,
    })
}

#[cfg(test)]
mod tests {
    use config::VehicleFile;

    use super::*;

    /// The gain of the inertia phase is not unique by its cost; it must not depend on how the program is scaled.
    #[test]
    fn the_gain_of_minimum_norm_is_the_same_however_the_program_is_scaled() {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let phase = Phase::InertiaPhase;
        let (requirement, vertices) = (compliant_requirement(&vehicle, phase), vertices(&vehicle, phase));
        let at = |unit| {
            let certificate = smallest_gain_from(unit, 5.0, &requirement, &vertices).unwrap();
            let rows = &certificate.gain_normalised;
            (DMatrix::from_fn(2, 3, |i, j| rows[i][j]), certificate.offset_normalised)
        };
        let (gain, offset) = at(GAIN_UNIT);
        for unit in [20.0, 37.0, 90.0] {
            let (other, other_offset) = at(unit);
            // Three digits of the gain: along a flat direction a fraction of 1e-7 of the cost moves it by its root.
            assert!((&other - &gain).norm() < 1e-3 * gain.norm(), "{unit}: {other} {gain}");
            assert!((other_offset / offset - 1.0).abs() < 1e-4, "{unit}: {other_offset} {offset}");
        }
    }
}
