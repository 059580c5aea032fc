//! Errors of the observers' models of the powertrain, found by simulation: the `|w|` and the `H` that the gain design
//! needs.
//!
//! `w = dy/dt - F - G z`, Eq. (2.24), with the true speeds, pressure and shaft torque: the difference between the
//! acceleration of the simulated car and that of the model. Errors of the sensors are not included.

use car::Vehicle;
use config::{Study, Varied, toml_string};
use design::compliant::{SPEED_UNITS_RAD_S, compliant_model};
use design::enclosing::enclosing_matrix;
use design::rigid_model;
use drivetrain::Real;
use nalgebra::{DMatrix, DVector};
use observer::{CompliantModel, Phase, RigidModel};
use serde::Serialize;
use trace::{Trace, TraceError, signal};

use crate::campaign::{PHASES, factor_values, in_order};
use crate::drive::simulate_shift;
use crate::score::size as size_of;
use crate::{StudyError, true_phases};

/// What the rigid model's error is made of.
pub const PARTS: [&str; 4] = [
    "turbine torque (engine, converter)",
    "torque of the oncoming clutch (friction)",
    "torque of the offgoing clutch",
    "output side (shafts, tyres, mass, grade, road)",
];

/// Samples next to a change of phase are left out: across it there is no derivative.
const GUARD_SAMPLES: usize = 2;
/// Directions in which the outermost samples of a run are kept.
const DIRECTIONS: usize = 26;
/// A maximum has settled when it grows no more than by this fraction.
const SETTLED: f64 = 0.02;

/// How large something was over the runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Size {
    /// Largest over all runs.
    pub largest: f64,
    /// The largest of a run, below which 50, 95 and 99 % of the runs stay.
    pub quantiles: [f64; 3],
    /// Run after which the largest grew by no more than 2 %.
    pub settled_after: u64,
}

/// The errors of both models in one phase.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseErrors {
    /// The phase.
    pub phase: &'static str,
    /// Runs that had it.
    pub runs: u64,
    /// `|w|` of the rigid model, rad/s^2.
    pub rigid: Size,
    /// Its channels `w_t`, `dw`, rad/s^2; the torque phase has the first alone.
    pub rigid_channels: Vec<Size>,
    /// What it is made of, as [`PARTS`]: the size of each part, rad/s^2.
    pub rigid_parts: Vec<Size>,
    /// Channels of the compliant model, `w_t`, (`dw`,) `w_w`, rad/s^2.
    pub compliant_channels: Vec<Size>,
    /// `H` of the compliant model, normalised: every error was `H w` with `|w| <= 1`.
    pub compliant_matrix: Option<Vec<Vec<f64>>>,
}

/// What the study found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorBound {
    /// Runs that were made.
    pub runs: u64,
    /// Runs without a whole shift.
    pub unfinished: u64,
    /// Torque and inertia phase.
    pub phases: Vec<PhaseErrors>,
}

/// The largest errors of one run in one phase.
#[derive(Debug, Clone, Default)]
struct RunErrors {
    samples: usize,
    rigid: f64,
    rigid_channels: [f64; 2],
    rigid_parts: [f64; PARTS.len()],
    compliant_channels: [f64; 3],
    /// Outermost samples of the compliant model's error, normalised.
    outermost: Vec<[f64; 3]>,
}

/// Runs the study and finds the errors; `progress` hears of each finished run.
///
/// # Errors
/// The recorded drive lacks a signal, which no study file can cause. A run that fails is counted as unfinished; a defect
/// of the program in one is an error, for a bound must hold in every run.
pub fn error_bound(study: &Study, threads: usize, mut progress: impl FnMut()) -> Result<ErrorBound, StudyError> {
    let mut runs: [Vec<RunErrors>; 2] = [Vec::new(), Vec::new()];
    let mut unfinished = 0;
    let one = |run| -> Result<Option<[RunErrors; 2]>, StudyError> {
        let Ok(mut varied) = study.varied(&factor_values(study, run)) else { return Ok(None) };
        varied.experiment.adapt_controller();
        let Ok(trace) = simulate_shift(&varied.car, &varied.vehicle, &varied.experiment, study.record_before_s) else {
            return Ok(None);
        };
        Ok(Some(run_errors(&varied, &trace)?))
    };
    in_order(0..study.runs, threads, one, |errors| -> Result<(), StudyError> {
        match errors? {
            Some(errors) if errors.iter().all(|phase| phase.samples > 0) => {
                let [torque, inertia] = errors;
                runs[0].push(torque);
                runs[1].push(inertia);
            }
            _ => unfinished += 1,
        }
        progress();
        Ok(())
    })?;
    let phases = PHASES.into_iter().zip(&runs).map(|(phase, runs)| phase_errors(phase, runs)).collect();
    Ok(ErrorBound { runs: study.runs, unfinished, phases })
}

fn phase_errors(phase: Phase, runs: &[RunErrors]) -> PhaseErrors {
    let size = |value: &dyn Fn(&RunErrors) -> f64| size(&runs.iter().map(value).collect::<Vec<_>>());
    let (rigid_channels, compliant) = match phase {
        Phase::InertiaPhase => (2, &[0, 1, 2][..]),
        _ => (1, &[0, 2][..]),
    };
    let outermost: Vec<DVector<f64>> = (runs.iter())
        .flat_map(|run| &run.outermost)
        .map(|w| DVector::from_iterator(compliant.len(), compliant.iter().map(|&i| w[i])))
        .collect();
    let rows = |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    PhaseErrors {
        phase: phase.name(),
        runs: runs.len() as u64,
        rigid: size(&|run| run.rigid),
        rigid_channels: (0..rigid_channels).map(|i| size(&|run| run.rigid_channels[i])).collect(),
        rigid_parts: (0..PARTS.len()).map(|i| size(&|run| run.rigid_parts[i])).collect(),
        compliant_channels: compliant.iter().map(|&i| size(&|run| run.compliant_channels[i])).collect(),
        compliant_matrix: enclosing_matrix(&outermost).as_ref().map(rows),
    }
}

fn size(of_runs: &[f64]) -> Size {
    let largest = of_runs.iter().copied().fold(0.0, f64::max);
    let reached = of_runs.iter().position(|&value| value * (1.0 + SETTLED) >= largest);
    let mut sorted = of_runs.to_vec();
    sorted.sort_by(f64::total_cmp);
    let quantile = |fraction: f64| {
        let at = (fraction * sorted.len() as f64).ceil() as usize;
        sorted.get(at.saturating_sub(1)).copied().unwrap_or(f64::NAN)
    };
    Size { largest, quantiles: [0.5, 0.95, 0.99].map(quantile), settled_after: reached.map_or(0, |at| at as u64 + 1) }
}

/// The errors of both models over one drive, by phase.
fn run_errors(varied: &Varied, trace: &Trace) -> Result<[RunErrors; 2], TraceError> {
    let signals = Signals::of(trace)?;
    let models = Models::of(&varied.vehicle);
    let phases = true_phases(trace).unwrap_or_default();
    let mut errors = [RunErrors::default(), RunErrors::default()];
    for (phase, errors) in PHASES.into_iter().zip(&mut errors) {
        let mut outermost = [([0.0; 3], 0.0); DIRECTIONS];
        for i in GUARD_SAMPLES..phases.len().saturating_sub(GUARD_SAMPLES) {
            let around = &phases[i - GUARD_SAMPLES..=i + GUARD_SAMPLES];
            if around.iter().all(|&p| p == phase) {
                models.take(&signals, phase, i, errors, &mut outermost);
            }
        }
        errors.outermost = outermost.iter().filter(|(_, reach)| *reach > 0.0).map(|(w, _)| *w).collect();
    }
    Ok(errors)
}

struct Signals<'a> {
    time_s: &'a [f64],
    engine: &'a [f64],
    turbine: &'a [f64],
    slip: &'a [f64],
    wheel: &'a [f64],
    pressure_pa: &'a [f64],
    shaft_n_m: &'a [f64],
    turbine_n_m: &'a [f64],
    oncoming_n_m: &'a [f64],
    offgoing_n_m: &'a [f64],
}

impl<'a> Signals<'a> {
    fn of(trace: &'a Trace) -> Result<Self, TraceError> {
        Ok(Self {
            time_s: &trace.time_s,
            engine: trace.require(signal::ENGINE_SPEED)?,
            turbine: trace.require(signal::TURBINE_SPEED)?,
            slip: trace.require(signal::ONCOMING_SLIP)?,
            wheel: trace.require(signal::WHEEL_SPEED)?,
            pressure_pa: trace.require(signal::ONCOMING_PRESSURE)?,
            shaft_n_m: trace.require(signal::SHAFT_TORQUE)?,
            turbine_n_m: trace.require(signal::TURBINE_TORQUE)?,
            oncoming_n_m: trace.require(signal::ONCOMING_TORQUE)?,
            offgoing_n_m: trace.require(signal::OFFGOING_TORQUE)?,
        })
    }

    fn rate(&self, values: &[f64], i: usize) -> f64 {
        (values[i + 1] - values[i - 1]) / (self.time_s[i + 1] - self.time_s[i - 1])
    }
}

struct Models {
    rigid: RigidModel<f64>,
    compliant: CompliantModel<f64>,
}

impl Models {
    fn of(vehicle: &Vehicle) -> Self {
        Self { rigid: rigid_model(vehicle), compliant: compliant_model(vehicle) }
    }

    fn take(
        &self,
        s: &Signals<'_>,
        phase: Phase,
        i: usize,
        errors: &mut RunErrors,
        outermost: &mut [([f64; 3], f64); DIRECTIONS],
    ) {
        let (engine, turbine, slip, wheel) = (s.engine[i], s.turbine[i], s.slip[i], s.wheel[i]);
        let rates = [s.rate(s.turbine, i), s.rate(s.slip, i), s.rate(s.wheel, i)];
        let with_slip = phase == Phase::InertiaPhase;

        let model = self.rigid.speed_model(phase, engine, turbine, slip);
        let mut w =
            [0, 1].map(|k| rates[k] - model.free_rad_s2[k] - model.per_pressure_rad_s2_pa[k] * s.pressure_pa[i]);
        if !with_slip {
            w[1] = 0.0;
        }
        let norm = |w: [f64; 2]| Real::hypot(w[0], w[1]);
        keep(&mut errors.rigid, norm(w));
        (0..2).for_each(|k| keep(&mut errors.rigid_channels[k], w[k]));

        let rows = self.rigid.coefficients(phase);
        let slip_row = |x: f64| if with_slip { x } else { 0.0 };
        let turbine_off = s.turbine_n_m[i] - self.rigid.known_torques(engine, turbine, slip).turbine_n_m;
        let modelled = self.rigid.clutch.torque_capacity(s.pressure_pa[i], slip) * slip.signum();
        let oncoming_off = s.oncoming_n_m[i] - modelled;
        // In the torque phase the offgoing clutch sticks and has no column of its own.
        let offgoing_off = if with_slip { s.offgoing_n_m[i] } else { 0.0 };
        let part = |torque: f64, per_turbine: f64, per_slip: f64| [torque * per_turbine, torque * slip_row(per_slip)];
        let (t, d) = (&rows.turbine, &rows.slip_oncoming);
        let parts = [
            part(turbine_off, t.per_turbine_torque, d.per_turbine_torque),
            part(oncoming_off, t.per_oncoming_torque, d.per_oncoming_torque),
            part(offgoing_off, t.per_offgoing_torque, d.per_offgoing_torque),
        ];
        let rest = [0, 1].map(|k| w[k] - parts.iter().map(|part| part[k]).sum::<f64>());
        for (kept, part) in errors.rigid_parts.iter_mut().zip(parts.iter().chain([&rest])) {
            keep(kept, norm(*part));
        }

        let model = self.compliant.speed_model(phase, engine, turbine, slip, wheel);
        let state = [s.shaft_n_m[i], s.pressure_pa[i]];
        let w = [0, 1, 2].map(|k| {
            let known = model.free_rad_s2[k] + model.influence[k][0] * state[0] + model.influence[k][1] * state[1];
            if k == 1 && !with_slip { 0.0 } else { rates[k] - known }
        });
        (0..3).for_each(|k| keep(&mut errors.compliant_channels[k], w[k]));
        let normalised = [0, 1, 2].map(|k| w[k] / SPEED_UNITS_RAD_S[k]);
        for (n, (sample, reach)) in outermost.iter_mut().enumerate() {
            let here: f64 = direction(n).iter().zip(&normalised).map(|(d, w)| d * w).sum();
            if here > *reach && here.is_finite() {
                (*sample, *reach) = (normalised, here);
            }
        }
        errors.samples += 1;
    }
}

/// Every combination of -1, 0 and 1 but the one of zeros.
fn direction(n: usize) -> [f64; 3] {
    let n = if n < DIRECTIONS / 2 { n } else { n + 1 };
    [n % 3, n / 3 % 3, n / 9].map(|digit| digit as f64 - 1.0)
}

fn keep(largest: &mut f64, value: f64) {
    *largest = largest.max(size_of(value));
}

impl ErrorBound {
    /// What was found, as a file that `wetclutch design --bounds` reads.
    pub fn toml(&self, study: &Study) -> String {
        let mut text = format!(
            "# Largest model errors over {} runs of {} ({} without a complete shift), sha256 {}.\n\
             # Written by `wetclutch error-bound`; read by `wetclutch design VEHICLE --bounds THIS_FILE`.\n",
            self.runs,
            toml_string(&study.title),
            self.unfinished,
            study.fingerprint(),
        );
        for phase in &self.phases {
            let quantiles = phase.rigid.quantiles.map(|value| format!("{value:.1}")).join(", ");
            text += &format!(
                "\n[design.{}]\n# 50, 95, 99 % of the runs stay below {quantiles}; settled after run {} of {}\n\
                 model_error_max_rad_s2 = {:.1}\n",
                phase.phase, phase.rigid.settled_after, phase.runs, phase.rigid.largest,
            );
            if let Some(matrix) = &phase.compliant_matrix {
                let row = |row: &Vec<f64>| {
                    format!("[{}]", row.iter().map(|x| format!("{x:.4}")).collect::<Vec<_>>().join(", "))
                };
                let rows = matrix.iter().map(row).collect::<Vec<_>>().join(", ");
                text += &format!("\n[design.compliant.{}]\nerror_matrix = [{rows}] # H, normalised\n", phase.phase);
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directions_are_all_different_and_none_is_zero() {
        let all: Vec<[f64; 3]> = (0..DIRECTIONS).map(direction).collect();
        assert!(all.iter().all(|d| d.iter().any(|x| *x != 0.0)));
        assert!((0..DIRECTIONS).all(|i| (0..i).all(|j| all[i] != all[j])));
    }

    #[test]
    fn a_size_knows_its_largest_and_when_it_settled() {
        let found = size(&[1.0, 3.0, 9.9, 2.0, 10.0]);
        assert_eq!((found.largest, found.settled_after, found.quantiles[0]), (10.0, 3, 3.0));
    }
}
