//! Gains of the rigid and the compliant observer for a sample time, with every error of the budget in the bound.
//!
//! With `F`, `G` and the valve frozen over a sample of length `T`, the error of the observer obeys
//!
//! ```text
//! e+ = (Phi - L G Psi) e - L (T H w + n) + v
//! ```
//!
//! for errors `w` of the accelerations, `n` of the speeds and of what they tell about the pressure, and `v` of valve and
//! twist, each within its bound of the vehicle file. Four designs, in the normalised units of [`crate::compliant`]; each is in
//! a file of its own:
//!
//! * [`GainMethod::IssDiscrete`], the twin of Eq. (2.83)-(2.84): the smallest gain that decays as required.
//! * [`GainMethod::PeakToPeak`]: the smallest ellipsoid that no error within the bounds can leave.
//! * [`GainMethod::Scheduled`]: the same with a gain that follows the friction coefficient. In discrete time no derivative of
//!   the gain enters the error.
//! * [`GainMethod::Interval`]: an error that keeps its sign if nothing disturbs it, so that a lowest and a highest estimate can
//!   be carried along; the gain with the smallest width.
//!
//! Every inequality is evaluated again, apart from the solver, for the gain as a controller has it in single precision. A gain
//! whose bound is not below the open loop's is not shipped.

mod ellipsoid;
mod interval;
mod smallest_gain;
mod system;

use config::{GainMethod, Vehicle};
use nalgebra::DMatrix;
use observer::{CompliantGains, Phase, RigidGains, Schedule};
use serde::Serialize;

use crate::compliant::{PRESSURE_UNIT_PA, SPEED_UNITS_RAD_S, compliant_requirement};
use crate::iss::DesignError;
use crate::lmi::{Block, Outcome, Problem, largest_eigenvalue};
use crate::rigid::requirement;
use system::{ErrorSystem, outputs, state_units};

/// Which of the two reduced-order observers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Stiff shafts.
    Rigid,
    /// Elastic drive shafts.
    Compliant,
}

/// What a bound is on. Speeds tell a torque, and a friction that is not what the observer is told makes it another pressure;
/// the valve model tells a pressure, and the same friction makes it another torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// The clutch torque, as the pressure that gives it with the friction that the observer is told.
    ClutchTorque,
    /// The pressure.
    Pressure,
}

/// Errors are made larger by this share in a program than in the check, which leaves room for rounding.
const RESERVE: f64 = 1e-4;
/// A bound must beat the open loop's by this factor.
const WORTH_A_GAIN: f64 = 0.999;

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
    /// Whether no gain beats the open loop, which then serves.
    pub uses_open_loop: bool,
    /// Ultimate bound on the error, Pa.
    pub bound_pa: f64,
    /// Ultimate bound of the best gain, Pa, whether it is used or not.
    pub best_gain_bound_pa: f64,
    /// Ultimate bound of the open loop, Pa.
    pub open_loop_bound_pa: f64,
    /// What the error is made of at the worst corner of the polytope, were friction and valve to stay there.
    pub contributions: Vec<Contribution>,
    /// Every inequality, evaluated; none is negative.
    pub margins: Vec<DiscreteMargin>,
    /// Clutch torque of 1 MPa at the middle of the friction's range, N m.
    pub torque_n_m_mpa: f64,
    /// SHA-256 of the vehicle file.
    pub vehicle_sha256: String,
}

/// A gain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainAt {
    /// The friction coefficient that it is for, if it follows that.
    pub friction: Option<f64>,
    /// `L`, normalised, rows `(T_s, p)` or `p` alone, of a gain that is exact in single precision in physical units; zero
    /// where the open loop serves.
    pub normalised: Vec<Vec<f64>>,
}

/// Part of an error that one cause makes up.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contribution {
    /// The cause.
    pub cause: &'static str,
    /// Its part, Pa.
    pub bound_pa: f64,
}

/// One inequality, evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteMargin {
    /// Which.
    pub label: String,
    /// Its least eigenvalue; of an interval gain, the least entry of the matrix that must have no negative one.
    pub least: f64,
}

/// Certified gains of both phases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteDesign {
    /// Torque phase.
    pub torque_phase: DiscreteCertificate,
    /// Inertia phase.
    pub inertia_phase: DiscreteCertificate,
}

/// What a method found: gains (one, or two at the ends of the friction), bound of the normalised pressure, inequalities.
pub(crate) struct Found {
    gains: Vec<DMatrix<f64>>,
    bound: f64,
    margins: Vec<DiscreteMargin>,
}

/// Designs the gain of one phase for a sample time. By [`GainMethod::Iss`], which knows no sample time, the certificate is
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
    let system = ErrorSystem::of(vehicle, model, quantity, phase, sample_time_s);
    let round = |gain: &DMatrix<f64>| rounded(gain, model, phase);
    let found = match method {
        GainMethod::Iss | GainMethod::IssDiscrete => {
            let kappa2_per_s = match model {
                Model::Rigid => 4.0 / requirement(vehicle, phase).settling_time_s,
                Model::Compliant => compliant_requirement(vehicle, phase).kappa2_per_s,
            };
            smallest_gain::smallest_gain(&system, kappa2_per_s, sample_time_s, round)?
        }
        GainMethod::PeakToPeak => ellipsoid::smallest_ellipsoid(&system, false, round)?,
        GainMethod::Scheduled => ellipsoid::smallest_ellipsoid(&system, true, round)?,
        GainMethod::Interval => interval::narrowest_interval(&system, round)?,
    };
    let open_loop_bound_pa = PRESSURE_UNIT_PA * open_loop_bound(&system);
    let best_gain_bound_pa = PRESSURE_UNIT_PA * found.bound;
    let uses_open_loop = best_gain_bound_pa >= WORTH_A_GAIN * open_loop_bound_pa;
    let gains: Vec<DMatrix<f64>> =
        found.gains.iter().map(|gain| if uses_open_loop { gain * 0.0 } else { gain.clone() }).collect();
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
        margins: found.margins,
        vehicle_sha256: vehicle.source.sha256(),
    })
}

/// Clutch torque of 1 MPa at the middle of the friction's range, N m.
fn torque_n_m_mpa(vehicle: &Vehicle) -> f64 {
    let (least, greatest) = vehicle.uncertainty.friction;
    let clutch = &vehicle.oncoming.clutch;
    1e6 * 0.5 * (least + greatest) * clutch.lever() * clutch.piston_area_m2
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
            [Some(least), Some(greatest)] => Schedule { friction: [least, greatest], ends: [at(0), at(1)] },
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
    if end == 0 { vehicle.uncertainty.friction.0 } else { vehicle.uncertainty.friction.1 }
}

/// Ultimate bound on the normalised pressure if the valve model serves alone.
fn open_loop_bound(system: &ErrorSystem) -> f64 {
    let pressure = system.states() - 1;
    let valve: f64 = system.direct.iter().map(|cause| cause.column[pressure].abs()).sum();
    let slowest = system.corners.iter().map(|corner| corner.phi[(pressure, pressure)]).fold(0.0, f64::max);
    valve / (1.0 - slowest)
}

/// Samples over which a response is followed at most.
const RESPONSE_SAMPLES: usize = 5000;

/// What each cause does to the pressure at the corner where all of them together do most.
fn contributions(system: &ErrorSystem, gains: &[DMatrix<f64>]) -> Vec<Contribution> {
    let least = system.corners.iter().map(|corner| corner.friction).fold(f64::INFINITY, f64::min);
    let at_corner = |corner: &system::Corner| -> Vec<Contribution> {
        let gain = if corner.friction > least { gains.last() } else { gains.first() };
        let Some(gain) = gain else { return Vec::new() };
        let a = &corner.phi - gain * &corner.g_psi;
        let through = corner.through_gain.iter().map(|cause| (cause.name, -gain * &cause.column));
        let direct = system.direct.iter().map(|cause| (cause.name, cause.column.clone()));
        let columns: Vec<_> = through.chain(direct).collect();
        let mut sums: Vec<Contribution> = Vec::new();
        for (cause, _) in &columns {
            if !sums.iter().any(|sum| sum.cause == *cause) {
                sums.push(Contribution { cause, bound_pa: 0.0 });
            }
        }
        let mut response = DMatrix::zeros(1, system.states());
        response[(0, system.states() - 1)] = 1.0;
        for _ in 0..RESPONSE_SAMPLES {
            for (cause, column) in &columns {
                if let Some(sum) = sums.iter_mut().find(|sum| sum.cause == *cause) {
                    sum.bound_pa += PRESSURE_UNIT_PA * (&response * column)[0].abs();
                }
            }
            response *= &a;
            if response.norm() < 1e-12 {
                break;
            }
        }
        sums
    };
    let total = |sums: &Vec<Contribution>| sums.iter().map(|sum| sum.bound_pa).sum::<f64>();
    system.corners.iter().map(at_corner).max_by(|a, b| total(a).total_cmp(&total(b))).unwrap_or_default()
}

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

/// The gain as a controller has it: in physical units and in single precision, here normalised again.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
fn rounded(gain: &DMatrix<f64>, model: Model, phase: Phase) -> DMatrix<f64> {
    let (states, outputs) = (state_units(model), outputs(model, phase));
    DMatrix::from_fn(gain.nrows(), gain.ncols(), |i, j| {
        let unit = states[i] / SPEED_UNITS_RAD_S[outputs[j]];
        f64::from((gain[(i, j)] * unit) as f32) / unit
    })
}

fn solved(problem: &Problem) -> Result<Option<Vec<f64>>, DesignError> {
    match problem.solve() {
        Outcome::Solved { unknowns, .. } => Ok(Some(unknowns)),
        Outcome::Infeasible => Ok(None),
        Outcome::Failed(word) => Err(DesignError::Solver(word)),
    }
}

/// The one with the least bound, by golden sections over a parameter in which the bound has one minimum. Where there is
/// none, or the solver gives up, the search goes elsewhere.
fn best_found(
    mut low: f64,
    mut high: f64,
    steps: usize,
    at: impl Fn(f64) -> Result<Option<Found>, DesignError>,
) -> Result<Found, DesignError> {
    let mut best: Option<Found> = None;
    let mut bound_at = |parameter: f64| {
        let Ok(Some(found)) = at(parameter) else { return f64::INFINITY };
        let bound = found.bound;
        if best.as_ref().is_none_or(|best| bound < best.bound) {
            best = Some(found);
        }
        bound
    };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let mut inner = [high - golden * (high - low), low + golden * (high - low)];
    let mut values = inner.map(&mut bound_at);
    for _ in 0..steps {
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

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE_S: f64 = 0.01;
    const METHODS: [GainMethod; 4] =
        [GainMethod::IssDiscrete, GainMethod::PeakToPeak, GainMethod::Scheduled, GainMethod::Interval];

    fn vehicle() -> Vehicle {
        Vehicle::two_speed_at().expect("the built-in vehicle is valid")
    }

    fn inertia(method: GainMethod, model: Model) -> DiscreteCertificate {
        let quantity = Quantity::ClutchTorque;
        design_discrete_phase(&vehicle(), model, method, quantity, Phase::InertiaPhase, SAMPLE_S).unwrap()
    }

    /// Scalar output: `f(a) = (v + c a)/(1 - Phi + a)` with `a = L G_min Psi` is monotone, so the best is either the
    /// open loop or the largest gain that still pays at the strong vertex.
    #[test]
    fn with_one_output_the_design_is_open_loop_exactly_where_the_closed_form_says() {
        let mut vehicle = vehicle();
        let phase = Phase::TorquePhase;
        for (delay_s, pays) in [(0.0, false), (0.03, false), (5.0, true)] {
            vehicle.error_bounds.valve_delay_s[1] = delay_s;
            let system = ErrorSystem::of(&vehicle, Model::Rigid, Quantity::ClutchTorque, phase, SAMPLE_S);
            let weak = &system.corners[0];
            let c = weak.columns.abs().sum() / weak.g_psi[0].abs();
            let valve = system.direct_columns.abs().sum();
            assert_eq!(c * (1.0 - weak.phi[0]) < valve, pays, "the closed form itself");
            let certificate = design_discrete_phase(
                &vehicle,
                Model::Rigid,
                GainMethod::PeakToPeak,
                Quantity::ClutchTorque,
                phase,
                SAMPLE_S,
            )
            .unwrap();
            assert_eq!(certificate.uses_open_loop, !pays, "{certificate:?}");
            assert!(certificate.bound_pa <= certificate.open_loop_bound_pa);
        }
    }

    /// With one state the bound has a closed form, and no gain on a grid around and far from the design has a smaller one.
    #[test]
    fn no_gain_of_a_grid_search_beats_the_rigid_design() {
        let system = ErrorSystem::of(&vehicle(), Model::Rigid, Quantity::ClutchTorque, Phase::InertiaPhase, SAMPLE_S);
        let bound = |gain: &DMatrix<f64>| {
            let at_corner = |corner: &system::Corner| {
                let contraction = (corner.phi[0] - (gain * &corner.g_psi)[0]).abs();
                let disturbed = (gain * &corner.columns).abs().sum() + system.direct_columns.abs().sum();
                if contraction < 1.0 { PRESSURE_UNIT_PA * disturbed / (1.0 - contraction) } else { f64::INFINITY }
            };
            system.corners.iter().map(at_corner).fold(0.0, f64::max)
        };
        let certificate = inertia(GainMethod::PeakToPeak, Model::Rigid);
        assert!(!certificate.uses_open_loop);
        let designed = DMatrix::from_row_slice(1, 2, &certificate.gains[0].normalised[0]);
        // What the reserve of the program costs, and one `lambda` for all corners.
        assert!(certificate.bound_pa >= bound(&designed) && certificate.bound_pa < 1.003 * bound(&designed));
        for i in -60..=60 {
            for j in -60..=60 {
                let gain = DMatrix::from_row_slice(1, 2, &[0.2 * f64::from(i), 0.2 * f64::from(j)]);
                assert!(bound(&gain) >= bound(&designed) * (1.0 - 3e-3), "{gain}");
            }
        }
    }

    #[test]
    fn each_method_is_as_good_as_its_freedom_allows() {
        for model in [Model::Rigid, Model::Compliant] {
            let [iss, peak, scheduled, interval] = METHODS.map(|method| inertia(method, model).best_gain_bound_pa);
            assert!(scheduled < 0.99 * peak, "{model:?}: following the friction pays: {scheduled} {peak}");
            assert!(peak < interval && interval < iss, "{model:?}: {peak} {interval} {iss}");
        }
    }

    /// An adversary who knows the gain: friction held anywhere in its range, or elsewhere from sample to sample, and every
    /// error at its bound with the sign that hurts most at the end.
    #[test]
    fn no_adversary_exceeds_the_bound() {
        let vehicle = vehicle();
        for (model, method) in
            [Model::Rigid, Model::Compliant].into_iter().flat_map(|m| METHODS.map(|method| (m, method)))
        {
            let certificate = inertia(method, model);
            let system = ErrorSystem::of(&vehicle, model, Quantity::ClutchTorque, Phase::InertiaPhase, SAMPLE_S);
            let states = system.states();
            let gain = |end: usize| {
                let rows = &certificate.end(end).normalised;
                DMatrix::from_fn(states, rows[0].len(), |i, j| rows[i][j])
            };
            let at = |share: f64| {
                let g_psi = &system.corners[0].g_psi * (1.0 - share) + &system.corners[1].g_psi * share;
                let gain = gain(0) * (1.0 - share) + gain(1) * share;
                let through = &system.corners[0].columns * (1.0 - share) + &system.corners[1].columns * share;
                (&system.corners[0].phi - &gain * g_psi, -gain * through)
            };
            let mut largest = 0.0_f64;
            let held = [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| vec![share]);
            let alternating = [1, 2, 3, 7].map(|n| [vec![0.0; n], vec![1.0; n]].concat());
            let wandering = (1..=599).map(|k| (0.618 * f64::from(k)).fract()).collect();
            for shares in held.into_iter().chain(alternating).chain([wandering]) {
                let mut response = DMatrix::zeros(1, states);
                response[(0, states - 1)] = 1.0;
                let mut sum = 0.0;
                for k in 0..600 {
                    let (a, b) = at(shares[k % shares.len()]);
                    sum += (&response * b).abs().sum() + (&response * &system.direct_columns).abs().sum();
                    response *= a;
                }
                largest = largest.max(sum);
            }
            let bound = certificate.bound_pa / PRESSURE_UNIT_PA;
            assert!(largest <= bound * (1.0 + 1e-9), "{model:?} {method:?}: {largest} beyond {bound}");
            let parts: f64 = certificate.contributions.iter().map(|part| part.bound_pa).sum();
            assert!(parts <= certificate.bound_pa * (1.0 + 1e-9) && parts > 0.5 * certificate.bound_pa, "{parts}");
        }
    }

    #[test]
    fn an_interval_gain_keeps_the_sign_of_an_error() {
        for model in [Model::Rigid, Model::Compliant] {
            let certificate = inertia(GainMethod::Interval, model);
            let system = ErrorSystem::of(&vehicle(), model, Quantity::ClutchTorque, Phase::InertiaPhase, SAMPLE_S);
            let rows = &certificate.gains[0].normalised;
            let gain = DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
            for corner in &system.corners {
                assert!((&corner.phi - &gain * &corner.g_psi).min() >= 0.0, "{model:?} {}", corner.label);
            }
        }
    }

    type Change<'a> = (&'a str, &'a dyn Fn(&mut config::ErrorBounds));

    #[test]
    fn every_entry_of_the_budget_is_in_a_bound() {
        let nominal = inertia(GainMethod::PeakToPeak, Model::Rigid);
        let bound_with = |change: &dyn Fn(&mut config::ErrorBounds)| {
            let mut vehicle = vehicle();
            change(&mut vehicle.error_bounds);
            let (model, method, quantity) = (Model::Rigid, GainMethod::PeakToPeak, Quantity::ClutchTorque);
            let of = |phase| design_discrete_phase(&vehicle, model, method, quantity, phase, SAMPLE_S).unwrap();
            of(Phase::InertiaPhase).best_gain_bound_pa
        };
        let changes: [Change<'_>; 9] = [
            ("turbine torque", &|b| b.turbine_torque_n_m *= 2.0),
            ("offgoing", &|b| b.offgoing_torque_n_m *= 2.0),
            ("friction", &|b| b.friction_factor = [0.6, 1.4]),
            ("lag", &|b| b.valve_lag_factor[1] = 2.0),
            ("gain", &|b| b.valve_gain_factor[0] = 0.7),
            ("delay", &|b| b.valve_delay_s[1] *= 2.0),
            // A gain on the turbine speed alone, to which the design turns, does without the slip.
            ("quanta", &|b| (b.turbine_quantum_rad_s, b.slip_quantum_rad_s) = (7.0, 17.0)),
            ("sampling delay", &|b| b.sampling_delay_s *= 2.0),
            ("float32", &|b| b.float32_rounding *= 1e3),
        ];
        for (name, change) in changes {
            assert!(bound_with(change) > 1.001 * nominal.best_gain_bound_pa, "{name}");
        }
        // The load hardly shows in the inertia phase; it does in a gain on the wheel's speed.
        let iss = |change: &dyn Fn(&mut config::ErrorBounds)| {
            let mut vehicle = vehicle();
            change(&mut vehicle.error_bounds);
            let quantity = Quantity::ClutchTorque;
            let (model, method, phase) = (Model::Compliant, GainMethod::IssDiscrete, Phase::TorquePhase);
            design_discrete_phase(&vehicle, model, method, quantity, phase, SAMPLE_S).unwrap().best_gain_bound_pa
        };
        let base = iss(&|_| ());
        let loads: [&dyn Fn(&mut config::ErrorBounds); 3] =
            [&|b| b.mass_kg *= 2.0, &|b| b.grade_rad *= 2.0, &|b| b.wheel_quantum_rad_s *= 2.0];
        assert!(loads.iter().all(|change| iss(change) > 1.001 * base));
    }
}
