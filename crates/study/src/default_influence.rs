//! What the defaults of a vehicle file may do to an estimate.
//!
//! The car of the file makes a power-on upshift. Its readings at 100 Hz, without errors, are estimated with the file, and again with
//! each default changed by its stated uncertainty, one way and the other.

use car::{GainMethod, ObserverKind, Vehicle};
use config::{Change, DefaultTaken, ExperimentFile, VehicleFile};
use drivetrain::{Real, Table1};
use observer::{Estimate, Phase};
use trace::Trace;

use crate::sampling::sampled;
use crate::{AnyObserver, RunColumns, StudyError, simulate_shift, true_phases};

/// The observers that are looked at: the valve model of the file alone, and the default.
pub const OBSERVERS: [ObserverKind; 2] = [ObserverKind::OpenLoopMaps, ObserverKind::Gearbox];
/// Time between two readings, s.
const SAMPLE_S: f64 = 0.01;
/// Throttle of the shift: the middle of what a driver uses in town [chosen].
const THROTTLE: f64 = 0.3;
/// Speed of the vehicle before the throttle opens, m/s, and of the engine, rad/s.
const START_M_S: f64 = 5.0;
const IDLE_RAD_S: f64 = 83.8;

/// RMS change of an estimate while clutch and plates slip: of the torque and the inertia phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeOfEstimate {
    /// Of the pressure, Pa.
    pub pressure_pa: f64,
    /// Of the torque of the oncoming clutch, N m.
    pub torque_n_m: f64,
}

/// What a default may do to the estimates.
#[derive(Debug, Clone, PartialEq)]
pub struct Influence {
    /// The default.
    pub taken: DefaultTaken,
    /// What was done to it.
    pub change: Change,
    /// How far, one way and the other. A limit at which no vehicle file could be is left out.
    pub limits: Vec<f64>,
    /// The greater change of each of [`OBSERVERS`].
    pub changes: [ChangeOfEstimate; OBSERVERS.len()],
}

/// What each default with a stated uncertainty may do, the largest change of the default observer's pressure first; none where the
/// simulated car makes no whole shift.
///
/// # Errors
/// The car cannot be simulated.
pub fn default_influences(vehicle: &VehicleFile) -> Result<Option<Vec<Influence>>, StudyError> {
    let Some(readings) = readings(vehicle)? else { return Ok(None) };
    let nominal = OBSERVERS.map(|kind| estimates(vehicle, kind, &readings.trace));
    let mut found = Vec::new();
    for taken in &vehicle.defaults_taken {
        let Some(off) = taken.uncertainty(&vehicle.error_bounds) else { continue };
        let mut limits = Vec::new();
        let mut changes = [ChangeOfEstimate { pressure_pa: 0.0, torque_n_m: 0.0 }; OBSERVERS.len()];
        for limit in off.limits {
            let Ok(changed) = taken.at_limit(vehicle, off.change, limit) else { continue };
            limits.push(limit);
            for ((kind, nominal), maximum) in OBSERVERS.iter().zip(&nominal).zip(&mut changes) {
                let (Ok(nominal), Ok(other)) = (nominal, estimates(&changed, *kind, &readings.trace)) else { continue };
                let change = readings.change(nominal, &other);
                maximum.pressure_pa = maximum.pressure_pa.max(change.pressure_pa);
                maximum.torque_n_m = maximum.torque_n_m.max(change.torque_n_m);
            }
        }
        if !limits.is_empty() {
            found.push(Influence { taken: taken.clone(), change: off.change, limits, changes });
        }
    }
    let weight = |influence: &Influence| influence.changes[OBSERVERS.len() - 1].pressure_pa;
    found.sort_by(|one, other| weight(other).total_cmp(&weight(one)));
    Ok(Some(found))
}

/// Readings of a shift, and which of them are in its torque and inertia phase.
struct Shift {
    trace: Trace,
    is_weighed: Vec<bool>,
}

fn readings(vehicle: &Vehicle) -> Result<Option<Shift>, StudyError> {
    let mut experiment = ExperimentFile::e1()?;
    let ratio = vehicle.shift.ratio_offgoing() * vehicle.driveline.final_ratio;
    experiment.throttle = Table1::new(&[0.0, 0.2, 0.6], &[0.1, 0.1, THROTTLE]).unwrap_or(experiment.throttle);
    experiment.initial_vehicle_m_s = START_M_S;
    experiment.initial_engine_rad_s = (ratio * START_M_S / vehicle.road.wheel_radius_m).max(IDLE_RAD_S);
    experiment.shift.request_s = 2.5;
    experiment.duration_s = 7.0;
    let whole = simulate_shift(vehicle, vehicle, &experiment, 1.2)?;
    let trace = sampled(&whole, SAMPLE_S);
    let Some(phases) = true_phases(&trace) else { return Ok(None) };
    if !phases.contains(&Phase::AfterShift) || !phases.contains(&Phase::InertiaPhase) {
        return Ok(None);
    }
    let is_weighed = phases.iter().map(|phase| matches!(phase, Phase::TorquePhase | Phase::InertiaPhase)).collect();
    Ok(Some(Shift { trace, is_weighed }))
}

fn estimates(vehicle: &Vehicle, kind: ObserverKind, trace: &Trace) -> Result<Vec<Estimate<f64>>, StudyError> {
    let observer = AnyObserver::designed(vehicle, kind, GainMethod::Iss, SAMPLE_S, None)?;
    Ok(observer.run_alone(&RunColumns::of(trace, vehicle)?))
}

impl Shift {
    fn change(&self, nominal: &[Estimate<f64>], other: &[Estimate<f64>]) -> ChangeOfEstimate {
        let rms = |signal: fn(&Estimate<f64>) -> f64| {
            let weighed = nominal.iter().zip(other).zip(&self.is_weighed).filter(|(_, weighed)| **weighed);
            let (squares, count) = weighed.fold((0.0, 0.0), |(squares, count), ((nominal, other), _)| {
                (squares + Real::powi(signal(other) - signal(nominal), 2), count + 1.0)
            });
            (squares / f64::max(count, 1.0)).sqrt()
        };
        ChangeOfEstimate {
            pressure_pa: rms(|estimate| estimate.pressure_pa),
            torque_n_m: rms(|estimate| estimate.clutch_torque_n_m),
        }
    }
}
