//! Gains of the rigid and the compliant observer for a sample time, with the errors of valve and readings in the bound.
//!
//! With `F`, `G` and the valve frozen over a sample of length `T`, the error of the observer obeys
//!
//! ```text
//! e+ = (Phi - L G Psi) e - T L H w - L n + E v
//! ```
//!
//! for model errors `w`, errors `n` of the measured changes of speed, and `v` of valve and twist, each within its bound of
//! the vehicle file. Two designs, in the normalised units of [`crate::compliant`]:
//!
//! * [`Method::Iss`], the twin of Eq. (2.83)-(2.84): the least `trace(alpha)` with `[alpha LH; * I] >= 0` among the gains that
//!   contract by `rho = exp(-kappa2 T)` at every vertex. Then ultimately `|e| <= sum |columns| / (1 - rho)`.
//! * [`Method::PeakToPeak`]: the smallest ellipsoid that no error within the bounds can leave (J. Abedor, K. Nagpal, K. Poolla,
//!   A linear matrix inequality approach to peak-to-peak gain minimization, 1996), by a line search on `lambda`:
//!
//! ```text
//! [ (1-lambda) P   0          (P Phi - Y G Psi)' ]
//! [ 0              diag(a)    (P B)'             ] >= 0 at every vertex,   sum a <= lambda,   [P C'; C g2] >= 0,   min g2
//! [ *              *          P                  ]
//! ```
//!
//! with `Y = P L` and `B = [-T L H, -L q, E]`; then ultimately `|C e| <= sqrt(g2)`.
//!
//! Every inequality is evaluated again, apart from the solver, for the gain as rounded to single precision. A gain whose bound
//! on the pressure is not below the open loop's is not shipped.

use config::Vehicle;
use nalgebra::DMatrix;
use observer::{CompliantGains, Phase, RigidGains};
use serde::Serialize;

use crate::compliant::{
    PRESSURE_UNIT_PA, SHAFT_UNIT_N_M, SPEED_UNITS_RAD_S, compliant_model, compliant_requirement, outputs,
    physical_gains, sampled_vertices,
};
use crate::iss::DesignError;
use crate::lmi::{Block, Outcome, Problem, largest_eigenvalue};
use crate::polytope::{distinct, valve_extremes};
use crate::rigid::{requirement, rigid_model};

/// How the gain is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The smallest gain that decays as required.
    Iss,
    /// The smallest ellipsoid that the error cannot leave.
    PeakToPeak,
}

/// The gain is sought in multiples of this, so that the unknowns are of order 1.
const GAIN_UNIT: f64 = 30.0;
/// Errors are made larger by this share in the program than in the check, which leaves room for rounding.
const RESERVE: f64 = 1e-3;
/// A bound must beat the open loop's by this factor.
const WORTH_A_GAIN: f64 = 0.999;
/// Steps of the search for `lambda`; each shrinks its interval by 0.618.
const SEARCH_STEPS: usize = 24;

/// A gain of a sampled observer in one phase, with the bound on its error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteCertificate {
    /// How it was chosen.
    pub method: Method,
    /// `L`, normalised, rows `(T_s, p)` or `p` alone, as rounded to single precision; zero where the open loop serves.
    pub gain_normalised: Vec<Vec<f64>>,
    /// The sample time, s.
    pub sample_time_s: f64,
    /// Whether no gain beats the open loop, which then serves.
    pub uses_open_loop: bool,
    /// Ultimate bound on the error of the pressure, Pa.
    pub bound_pa: f64,
    /// Ultimate bound of the best gain, Pa, whether it is used or not; infinite where none has one.
    pub best_gain_bound_pa: f64,
    /// Ultimate bound of the open loop, Pa.
    pub open_loop_bound_pa: f64,
    /// The least eigenvalue of each inequality for the rounded gain; none is negative.
    pub margins: Vec<DiscreteMargin>,
    /// SHA-256 of the vehicle file.
    pub vehicle_sha256: String,
}

/// One inequality, evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteMargin {
    /// Which.
    pub label: String,
    /// Its least eigenvalue.
    pub least_eigenvalue: f64,
}

/// Certified gains of both phases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteDesign {
    /// Torque phase, outputs `(w_t, w_w)`.
    pub torque_phase: DiscreteCertificate,
    /// Inertia phase, outputs `(w_t, dw, w_w)`.
    pub inertia_phase: DiscreteCertificate,
}

impl DiscreteDesign {
    /// The gains in physical units.
    pub fn gains(&self) -> CompliantGains<f64> {
        physical_gains(&self.torque_phase.gain_normalised, &self.inertia_phase.gain_normalised)
    }
}

/// The sampled error system, normalised.
#[derive(Debug, Clone)]
pub(crate) struct Sampled {
    pub(crate) phi: DMatrix<f64>,
    /// `G Psi` at every vertex.
    pub(crate) g_psi: Vec<(String, DMatrix<f64>)>,
}

/// What disturbs it, columns within the unit cube.
struct Disturbances {
    /// Through the gain: `T H` and the readings.
    through_gain: DMatrix<f64>,
    /// Past it: valve and twist.
    direct: DMatrix<f64>,
    /// `H` alone, for the gain's size.
    h: DMatrix<f64>,
}

/// Designs the gains of both phases for a sample time.
///
/// # Errors
/// The solver's, see [`DesignError`].
pub fn design_compliant_discrete(
    vehicle: &Vehicle,
    method: Method,
    sample_time_s: f64,
) -> Result<DiscreteDesign, DesignError> {
    let phase = |phase| design_compliant_discrete_phase(vehicle, phase, method, sample_time_s);
    Ok(DiscreteDesign { torque_phase: phase(Phase::TorquePhase)?, inertia_phase: phase(Phase::InertiaPhase)? })
}

/// Designs the gain of one phase for a sample time.
///
/// # Errors
/// The solver's, see [`DesignError`].
pub fn design_compliant_discrete_phase(
    vehicle: &Vehicle,
    phase: Phase,
    method: Method,
    sample_time_s: f64,
) -> Result<DiscreteCertificate, DesignError> {
    let system = sampled_vertices(vehicle, phase, sample_time_s);
    let required = compliant_requirement(vehicle, phase);
    let errors = disturbances(vehicle, phase, sample_time_s, &required.h);
    let rho = (-required.kappa2_per_s * sample_time_s).exp();
    certified(vehicle, method, sample_time_s, &system, &errors, rho)
}

/// Designs the gain of the rigid observer in one phase for a sample time, by [`Method::Iss`]; its peak-to-peak design needs no
/// ellipsoid and is [`crate::design_peak_to_peak`].
///
/// # Errors
/// The solver's, see [`DesignError`].
pub fn design_rigid_discrete_phase(
    vehicle: &Vehicle,
    phase: Phase,
    sample_time_s: f64,
) -> Result<DiscreteCertificate, DesignError> {
    let model = rigid_model(vehicle);
    let outputs = if phase == Phase::InertiaPhase { 2 } else { 1 };
    let extremes = valve_extremes(&model, &vehicle.uncertainty);
    let slowest = extremes.iter().map(|(_, a)| *a).fold(f64::NEG_INFINITY, f64::max);
    let mut g_psi = Vec::new();
    for (label, a) in &extremes {
        let psi = ((a * sample_time_s).exp() - 1.0) / a;
        for friction in distinct(vehicle.uncertainty.friction) {
            let influence = model.influence(phase, friction);
            let column =
                DMatrix::from_fn(outputs, 1, |i, _| influence[i] * psi * PRESSURE_UNIT_PA / SPEED_UNITS_RAD_S[i]);
            g_psi.push((format!("friction {friction}{label}"), column));
        }
    }
    let system = Sampled { phi: DMatrix::from_element(1, 1, (slowest * sample_time_s).exp()), g_psi };
    let required = requirement(vehicle, phase);
    // The model error may point anywhere.
    let h = DMatrix::from_fn(outputs, outputs, |i, j| {
        if i == j { required.model_error_max_rad_s2 / SPEED_UNITS_RAD_S[i] } else { 0.0 }
    });
    let bounds = &vehicle.error_bounds;
    let readings = [bounds.turbine_change_rad_s, bounds.slip_change_rad_s];
    let through_gain = DMatrix::from_fn(outputs, 2 * outputs, |i, j| match j {
        j if j < outputs => h[(i, j)] * sample_time_s,
        j if j - outputs == i => readings[i] / SPEED_UNITS_RAD_S[i],
        _ => 0.0,
    });
    let valve = bounds.valve_rate_pa_s * sample_time_s / PRESSURE_UNIT_PA;
    let errors = Disturbances { through_gain, direct: DMatrix::from_element(1, 1, valve), h };
    let rho = (-4.0 / required.settling_time_s * sample_time_s).exp();
    certified(vehicle, Method::Iss, sample_time_s, &system, &errors, rho)
}

/// The rigid observer's gains for a sample time from the certificates of both phases.
///
/// # Errors
/// The solver's, see [`DesignError`].
pub fn design_rigid_discrete(vehicle: &Vehicle, sample_time_s: f64) -> Result<RigidGains<f64>, DesignError> {
    let gain = |phase| -> Result<Vec<f64>, DesignError> {
        let certificate = design_rigid_discrete_phase(vehicle, phase, sample_time_s)?;
        let row = certificate.gain_normalised.into_iter().next().unwrap_or_default();
        Ok(row.iter().zip(SPEED_UNITS_RAD_S).map(|(l, unit)| l * PRESSURE_UNIT_PA / unit).collect())
    };
    let (torque, inertia) = (gain(Phase::TorquePhase)?, gain(Phase::InertiaPhase)?);
    Ok(RigidGains { torque_phase_pa_s_rad: torque[0], inertia_phase_pa_s_rad: [inertia[0], inertia[1]] })
}

/// The gain of this system by this method, with its bound, or the open loop.
fn certified(
    vehicle: &Vehicle,
    method: Method,
    sample_time_s: f64,
    system: &Sampled,
    errors: &Disturbances,
    rho: f64,
) -> Result<DiscreteCertificate, DesignError> {
    // The open loop leaves the pressure, the last state, to the valve model alone.
    let pressure = system.phi.nrows() - 1;
    let valve = errors.direct.row(pressure).iter().map(|x| x.abs()).sum::<f64>();
    let open_loop_bound_pa = PRESSURE_UNIT_PA * valve / (1.0 - system.phi[(pressure, pressure)]);
    let found = match method {
        Method::Iss => smallest_gain(system, errors, rho)?,
        Method::PeakToPeak => smallest_ellipsoid(system, errors)?,
    };
    let (gain, bound, margins) = found;
    let best_gain_bound_pa = PRESSURE_UNIT_PA * bound;
    let uses_open_loop = best_gain_bound_pa >= WORTH_A_GAIN * open_loop_bound_pa;
    let gain = if uses_open_loop { gain * 0.0 } else { gain };
    Ok(DiscreteCertificate {
        method,
        gain_normalised: gain.row_iter().map(|row| row.iter().copied().collect()).collect(),
        sample_time_s,
        uses_open_loop,
        bound_pa: if uses_open_loop { open_loop_bound_pa } else { best_gain_bound_pa },
        best_gain_bound_pa,
        open_loop_bound_pa,
        margins,
        vehicle_sha256: vehicle.source.sha256(),
    })
}

fn disturbances(vehicle: &Vehicle, phase: Phase, sample_time_s: f64, h: &DMatrix<f64>) -> Disturbances {
    let bounds = &vehicle.error_bounds;
    let readings = [bounds.turbine_change_rad_s, bounds.slip_change_rad_s, bounds.wheel_change_rad_s];
    let outputs = outputs(phase);
    let count = outputs.len();
    let mut through_gain = DMatrix::zeros(count, h.ncols() + count);
    through_gain.view_mut((0, 0), (count, h.ncols())).copy_from(&(h * sample_time_s));
    for (i, &output) in outputs.iter().enumerate() {
        through_gain[(i, h.ncols() + i)] = readings[output] / SPEED_UNITS_RAD_S[output];
    }
    let model = compliant_model(vehicle);
    let overall = vehicle.shift.ratio_offgoing() * vehicle.driveline.final_ratio;
    let twist = bounds.wheel_change_rad_s + bounds.turbine_change_rad_s / overall;
    let shaft = model.rigid.driveline.shaft_stiffness_n_m_rad * sample_time_s * twist / SHAFT_UNIT_N_M;
    let valve = bounds.valve_rate_pa_s * sample_time_s / PRESSURE_UNIT_PA;
    Disturbances { through_gain, direct: DMatrix::from_row_slice(2, 2, &[shaft, 0.0, 0.0, valve]), h: h.clone() }
}

type Found = (DMatrix<f64>, f64, Vec<DiscreteMargin>);

/// A block that depends affinely on the unknowns, from a function that evaluates it.
fn block(unknowns: usize, at: impl Fn(&[f64]) -> DMatrix<f64>) -> Block {
    let mut x = vec![0.0; unknowns];
    let constant = at(&x);
    let per_unknown = (0..unknowns)
        .map(|k| {
            x[k] = 1.0;
            let column = at(&x) - &constant;
            x[k] = 0.0;
            column
        })
        .collect();
    Block { constant, per_unknown }
}

/// `[a b'; b c]`.
fn stacked(a: &DMatrix<f64>, b: &DMatrix<f64>, c: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, m) = (a.nrows(), c.nrows());
    let mut whole = DMatrix::zeros(n + m, n + m);
    whole.view_mut((0, 0), (n, n)).copy_from(a);
    whole.view_mut((n, 0), (m, n)).copy_from(b);
    whole.view_mut((0, n), (n, m)).copy_from(&b.transpose());
    whole.view_mut((n, n), (m, m)).copy_from(c);
    whole
}

fn least_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    -largest_eigenvalue(&-matrix)
}

/// The gain as a controller in single precision has it.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
fn rounded(gain: &DMatrix<f64>) -> DMatrix<f64> {
    gain.map(|x| f64::from(x as f32))
}

fn solved(problem: &Problem) -> Result<Option<Vec<f64>>, DesignError> {
    match problem.solve() {
        Outcome::Solved { unknowns, .. } => Ok(Some(unknowns)),
        Outcome::Infeasible => Ok(None),
        Outcome::Failed(word) => Err(DesignError::Solver(word)),
    }
}

/// The smallest gain with this contraction. Unknowns: the entries of alpha, then `L` by rows.
fn smallest_gain(system: &Sampled, errors: &Disturbances, rho: f64) -> Result<Found, DesignError> {
    let (states, outputs) = (system.phi.nrows(), errors.h.nrows());
    let unknowns = states + states * outputs;
    let gain = |x: &[f64]| DMatrix::from_row_slice(states, outputs, &x[states..]) * GAIN_UNIT;
    let identity = DMatrix::identity(states, states);
    let contraction = |l: &DMatrix<f64>, g_psi: &DMatrix<f64>, rho: f64| {
        stacked(&(&identity * rho), &(&system.phi - l * g_psi), &(&identity * rho))
    };
    let mut blocks: Vec<Block> = (system.g_psi.iter())
        .map(|(_, g_psi)| block(unknowns, |x| contraction(&gain(x), g_psi, rho * (1.0 - 1e-6))))
        .collect();
    let causes = errors.h.ncols();
    blocks.push(block(unknowns, |x| {
        let alpha = DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&x[..states]));
        let size = gain(x) * &errors.h / GAIN_UNIT;
        stacked(&alpha, &size.transpose(), &DMatrix::identity(causes, causes))
    }));
    let mut objective = vec![0.0; unknowns];
    objective[..states].fill(1.0);
    let Some(x) = solved(&Problem { objective, blocks })? else {
        return Err(DesignError::DecayUnreachable { decay_per_s: rho });
    };
    let gain = rounded(&gain(&x));
    let margins: Vec<DiscreteMargin> = (system.g_psi.iter())
        .map(|(label, g_psi)| DiscreteMargin {
            label: label.clone(),
            least_eigenvalue: least_eigenvalue(&contraction(&gain, g_psi, rho)),
        })
        .collect();
    if margins.iter().any(|margin| margin.least_eigenvalue < 0.0) {
        return Err(DesignError::NotCertified);
    }
    let columns = (&gain * &errors.through_gain).column_iter().map(|c| c.norm()).sum::<f64>()
        + errors.direct.column_iter().map(|c| c.norm()).sum::<f64>();
    Ok((gain, columns / (1.0 - rho), margins))
}

/// The gain with the smallest bound on the pressure.
fn smallest_ellipsoid(system: &Sampled, errors: &Disturbances) -> Result<Found, DesignError> {
    let mut best: Option<Found> = None;
    let mut bound_at = |lambda: f64| -> f64 {
        let Ok(Some(found)) = ellipsoid(system, errors, lambda) else { return f64::INFINITY };
        let bound = found.1;
        if best.as_ref().is_none_or(|best| bound < best.1) {
            best = Some(found);
        }
        bound
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.01, 0.9);
    let mut inner = [high - golden * (high - low), low + golden * (high - low)];
    let mut values = inner.map(&mut bound_at);
    for _ in 0..SEARCH_STEPS {
        if values[0] <= values[1] {
            high = inner[1];
            inner = [high - golden * (high - low), inner[0]];
            values = [bound_at(inner[0]), values[0]];
        } else {
            low = inner[0];
            inner = [inner[1], low + golden * (high - low)];
            values = [values[1], bound_at(inner[1])];
        }
    }
    best.ok_or(DesignError::NotCertified)
}

/// The smallest ellipsoid of the two states for this `lambda`, if there is one. Unknowns: `P` (three), `Y` by rows, `a`, `g2`.
fn ellipsoid(system: &Sampled, errors: &Disturbances, lambda: f64) -> Result<Option<Found>, DesignError> {
    const STATES: usize = 2;
    const PRESSURE: usize = 1;
    let (outputs, through) = errors.through_gain.shape();
    let direct = errors.direct.ncols();
    let causes = through + direct;
    let (y_at, a_at) = (3, 3 + STATES * outputs);
    let g2_at = a_at + causes;
    let unknowns = g2_at + 1;
    let p = |x: &[f64]| DMatrix::from_row_slice(2, 2, &[x[0], x[1], x[1], x[2]]);
    let whole = |p: &DMatrix<f64>, y: &DMatrix<f64>, a: &[f64], g_psi: &DMatrix<f64>, lambda: f64, inflated: f64| {
        let n = STATES + causes;
        let mut corner = DMatrix::zeros(n, n);
        corner.view_mut((0, 0), (STATES, STATES)).copy_from(&(p * (1.0 - lambda)));
        for (j, a) in a.iter().enumerate() {
            corner[(STATES + j, STATES + j)] = *a;
        }
        let mut row = DMatrix::zeros(STATES, n);
        row.view_mut((0, 0), (STATES, STATES)).copy_from(&(p * &system.phi - y * g_psi));
        row.view_mut((0, STATES), (STATES, through)).copy_from(&(y * &errors.through_gain * -inflated));
        row.view_mut((0, STATES + through), (STATES, direct)).copy_from(&(p * &errors.direct * inflated));
        stacked(&corner, &row, p)
    };
    let y = |x: &[f64]| DMatrix::from_row_slice(STATES, outputs, &x[y_at..a_at]) * GAIN_UNIT;
    let mut blocks: Vec<Block> = (system.g_psi.iter())
        .map(|(_, g_psi)| block(unknowns, |x| whole(&p(x), &y(x), &x[a_at..g2_at], g_psi, lambda, 1.0 + RESERVE)))
        .collect();
    let pressure = DMatrix::from_row_slice(1, 2, &[0.0, 1.0]);
    blocks.push(block(unknowns, |x| stacked(&p(x), &pressure, &DMatrix::from_element(1, 1, x[g2_at]))));
    let mut share = vec![0.0; unknowns];
    share[a_at..g2_at].fill(-1.0);
    // The check takes the smaller lambda on both sides, which leaves room for rounding in the decay too.
    let checked = lambda * (1.0 - RESERVE);
    blocks.push(Block::linear(checked * (1.0 - 1e-6), &share));
    let mut objective = vec![0.0; unknowns];
    objective[g2_at] = 1.0;
    let Some(x) = solved(&Problem { objective, blocks })? else { return Ok(None) };

    // From here on the solver is not believed.
    let (p, a) = (p(&x), &x[a_at..g2_at]);
    let Some(inverse) = p.clone().try_inverse() else { return Ok(None) };
    let gain = rounded(&(&inverse * y(&x)));
    let margins: Vec<DiscreteMargin> = (system.g_psi.iter())
        .map(|(label, g_psi)| DiscreteMargin {
            label: label.clone(),
            least_eigenvalue: least_eigenvalue(&whole(&p, &(&p * &gain), a, g_psi, checked, 1.0)),
        })
        .collect();
    let holds = margins.iter().all(|margin| margin.least_eigenvalue >= 0.0) && a.iter().sum::<f64>() <= checked;
    Ok(holds.then(|| (gain, inverse[(PRESSURE, PRESSURE)].sqrt(), margins)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_discrete_twin_has_the_reference_gain() {
        let vehicle = Vehicle::two_speed_at().unwrap();
        let system = sampled_vertices(&vehicle, Phase::TorquePhase, 0.01);
        let h = DMatrix::from_row_slice(2, 2, &[2.38, 0.0, 0.0, 0.13]);
        let errors = Disturbances { through_gain: &h * 0.01, direct: DMatrix::zeros(2, 2), h };
        let (gain, ..) = smallest_gain(&system, &errors, 0.67).unwrap();
        let reference = DMatrix::from_row_slice(2, 2, &[-1.29, 18.04, -2.70, -64.8]);
        // The reference is printed to three digits.
        assert!((&gain - &reference).component_div(&reference).abs().max() < 0.004, "{gain}");
    }

    #[test]
    fn the_rigid_twin_contracts_and_yields_to_the_open_loop_where_it_must() {
        let vehicle = Vehicle::two_speed_at().unwrap();
        assert!(design_rigid_discrete_phase(&vehicle, Phase::InertiaPhase, 0.01).unwrap().uses_open_loop);
        // A valve five times as wrong is worth a gain, and that gain contracts as the settling time asks.
        let mut poor = vehicle.clone();
        poor.error_bounds.valve_rate_pa_s *= 5.0;
        let certificate = design_rigid_discrete_phase(&poor, Phase::InertiaPhase, 0.01).unwrap();
        assert!(!certificate.uses_open_loop);
        let rho = (-4.0 / vehicle.inertia_phase.settling_time_s * 0.01).exp();
        let model = rigid_model(&vehicle);
        let valve = model.valve.linear(0.0);
        let phi = (valve.a22_per_s * 0.01).exp();
        for friction in [0.10, 0.13, 0.16] {
            let influence = model.influence(Phase::InertiaPhase, friction);
            let gain = &certificate.gain_normalised[0];
            let per_gain = |i: usize| gain[i] * influence[i] * PRESSURE_UNIT_PA / SPEED_UNITS_RAD_S[i];
            let factor = phi - (per_gain(0) + per_gain(1)) * (phi - 1.0) / valve.a22_per_s;
            assert!(factor.abs() <= rho, "{factor} at friction {friction}");
        }
    }

    #[test]
    fn the_ellipsoid_holds_the_error_of_any_run() {
        let vehicle = Vehicle::two_speed_at().unwrap();
        for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
            let system = sampled_vertices(&vehicle, phase, 0.01);
            let errors = disturbances(&vehicle, phase, 0.01, &compliant_requirement(&vehicle, phase).h);
            let (gain, bound, _) = smallest_ellipsoid(&system, &errors).unwrap();
            // The worst signs at every step, as far as one step ahead tells.
            for (_, g_psi) in &system.g_psi {
                let a = &system.phi - &gain * g_psi;
                let b = -(&gain * &errors.through_gain);
                let mut largest = 0.0_f64;
                let mut direction = DMatrix::from_row_slice(1, 2, &[0.0, 1.0]);
                // The peak is the sum over the past of the pressure's response to each error.
                for _ in 0..400 {
                    largest += (&direction * &b).abs().sum() + (&direction * &errors.direct).abs().sum();
                    direction *= &a;
                }
                assert!(largest <= bound, "{phase:?}: {largest} beyond {bound}");
            }
        }
    }
}
