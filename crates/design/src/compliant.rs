//! Gains of the compliant observer, Eq. (2.83)-(2.84), in the chapter's normalised units.
//!
//! States are measured in 1000 N m and 0.1 MPa, speeds in 100 rad/s (turbine, slip) and 10 rad/s (wheel).
//! The error obeys `de/dt = (A22 - L G) e - L H w`, Eq. (2.75), where `H w` collects what the errors of turbine
//! torque, mass and grade do to the accelerations. The gain satisfies
//!
//! ```text
//! sym(A22_i - L G_i) <= -(kappa1 + kappa2) I   at every vertex i                       (2.78), (2.83)
//! min trace(alpha),  alpha diagonal,  [alpha L H; H' L' I] >= 0                        (2.84)
//! ```
//!
//! and the remaining error is at most `|w| sqrt(lambda_max(H' L' L H)/(4 kappa1 kappa2))`, Eq. (2.81).

use config::Vehicle;
use nalgebra::DMatrix;
use observer::{CompliantGains, CompliantModel, CompliantObserver, Phase, Schedule};
use serde::Serialize;

use crate::budget::{grade_n_m, mass_n_m};
use crate::iss::{DesignError, five_steps};
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
    /// Iterations of the conic solver.
    pub solver_iterations: u32,
    /// SHA-256 of the vehicle file.
    pub vehicle_sha256: String,
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

/// The powertrain as the compliant observer of this vehicle sees it.
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
        shaft_settling_s: vehicle.shaft_settling_s,
    }
}

/// `H` from bounds on the errors of turbine torque and of the load at the wheel, Eq. (2.85), (2.86).
///
/// The turbine torque enters turbine and slip together, through one column. A grade acts on the vehicle
/// with `m g R_w sin(theta)`; a mass error makes the wheel answer the shaft torque wrongly by its own share.
pub fn error_matrix(vehicle: &Vehicle, phase: Phase) -> DMatrix<f64> {
    let model = compliant_model(vehicle);
    let wheel = model.wheel_per_torque * (grade_n_m(vehicle) + mass_n_m(vehicle)) / SPEED_UNITS_RAD_S[2];
    let turbine_n_m = vehicle.error_bounds.turbine_torque_n_m;
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

fn required(vehicle: &Vehicle, phase: Phase) -> &config::CompliantRequirement {
    match phase {
        Phase::InertiaPhase | Phase::AfterShift => &vehicle.compliant_inertia_phase,
        Phase::BeforeShift | Phase::TorquePhase => &vehicle.compliant_torque_phase,
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

/// Designs the gain of one phase.
///
/// # Errors
/// The requirement that cannot be met, see [`DesignError`].
pub fn design_compliant_phase(
    vehicle: &Vehicle,
    phase: Phase,
    requirement: &CompliantRequirement,
) -> Result<CompliantCertificate, DesignError> {
    let vertices = vertices(vehicle, phase);
    let certificate = five_steps(
        requirement.kappa1_per_s,
        requirement.kappa2_per_s,
        requirement.offset_max_pa,
        |certificate: &CompliantCertificate| (certificate.kappa1_per_s, certificate.offset_pa),
        |kappa1_per_s| smallest_gain(kappa1_per_s, requirement, &vertices),
    )?;
    Ok(CompliantCertificate { vehicle_sha256: vehicle.source.sha256(), ..certificate })
}

/// `A22` and `G` at every combination of the extremes of friction and valve, Eq. (2.69), (2.70), (2.82).
fn vertices(vehicle: &Vehicle, phase: Phase) -> Vec<Vertex> {
    let model = compliant_model(vehicle);
    let outputs = outputs(phase);
    let mut vertices = Vec::new();
    for (valve_label, a22_per_s) in valve_extremes(&model.rigid, &vehicle.uncertainty) {
        for friction in distinct(vehicle.uncertainty.friction) {
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

/// The smallest gain for this `kappa1`. Unknowns: the two entries of alpha, then `L` by rows.
fn smallest_gain(
    kappa1_per_s: f64,
    requirement: &CompliantRequirement,
    vertices: &[Vertex],
) -> Result<CompliantCertificate, DesignError> {
    let (outputs, causes) = requirement.h.shape();
    let decay_per_s = kappa1_per_s + requirement.kappa2_per_s;
    let asked = decay_per_s * (1.0 + DECAY_RESERVE);
    let unknowns = 2 + 2 * outputs;
    let entry = |k: usize| ((k - 2) / outputs, (k - 2) % outputs);
    let symmetric = |matrix: &DMatrix<f64>| (matrix + matrix.transpose()) * 0.5;
    let unit_gain = |k: usize| {
        let (row, column) = entry(k);
        let mut gain = DMatrix::zeros(2, outputs);
        gain[(row, column)] = GAIN_UNIT;
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
                let corner = unit_gain(k) * &requirement.h / GAIN_UNIT;
                block.view_mut((0, 2), (2, causes)).copy_from(&corner);
                block.view_mut((2, 0), (causes, 2)).copy_from(&corner.transpose());
            }
            block
        })
        .collect();
    blocks.push(Block { constant, per_unknown });

    let mut objective = vec![0.0; unknowns];
    objective[..2].fill(1.0);
    match (Problem { objective, blocks }).solve() {
        Outcome::Solved { unknowns, iterations } => {
            let gain = DMatrix::from_row_slice(2, outputs, &unknowns[2..]) * GAIN_UNIT;
            check(&gain, kappa1_per_s, requirement, vertices)
                .map(|certificate| CompliantCertificate { solver_iterations: iterations, ..certificate })
                .ok_or(DesignError::NotCertified)
        }
        Outcome::Infeasible => Err(DesignError::DecayUnreachable { decay_per_s }),
        Outcome::Failed(word) => Err(DesignError::Solver(word)),
    }
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
        solver_iterations: 0,
        vehicle_sha256: String::new(),
    })
}
