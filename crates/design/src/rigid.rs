//! From a vehicle to the rigid observer: model, polytopes, gains, certificates.

use config::{DesignRequirement, Vehicle};
use observer::{
    Bounded, Budget, Discretisation, Phase, RigidGains, RigidModel, RigidObserver, Schedule, ShaftErrors, ShaftRange,
    Tracker,
};
use serde::Serialize;

use crate::{Certificate, DesignError, IssRequirement, Polytope, design_iss};

/// Certified gains of the rigid observer in both phases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RigidDesign {
    /// Torque phase; the second entry of the gain is zero, because the slip is an input there.
    pub torque_phase: Certificate,
    /// Inertia phase.
    pub inertia_phase: Certificate,
}

impl RigidDesign {
    /// The gains alone.
    pub fn gains(&self) -> RigidGains<f64> {
        RigidGains {
            torque_phase_pa_s_rad: self.torque_phase.gain_pa_s_rad[0],
            inertia_phase_pa_s_rad: self.inertia_phase.gain_pa_s_rad,
        }
    }

    /// The certificate of a phase in which the observer corrects.
    pub fn of(&self, phase: Phase) -> Option<&Certificate> {
        match phase {
            Phase::TorquePhase => Some(&self.torque_phase),
            Phase::InertiaPhase => Some(&self.inertia_phase),
            Phase::BeforeShift | Phase::AfterShift => None,
        }
    }
}

/// What the vehicle file requires in a phase; before and after the shift there is nothing to design.
pub fn requirement(vehicle: &Vehicle, phase: Phase) -> &DesignRequirement {
    match phase {
        Phase::InertiaPhase | Phase::AfterShift => &vehicle.inertia_phase,
        Phase::BeforeShift | Phase::TorquePhase => &vehicle.torque_phase,
    }
}

/// The powertrain as the rigid observer of this vehicle sees it.
pub fn rigid_model(vehicle: &Vehicle) -> RigidModel<f64> {
    RigidModel::new(
        vehicle.shift,
        vehicle.output_inertia_kg_m2,
        vehicle.converter,
        vehicle.oncoming.clutch,
        vehicle.observer_valve,
        vehicle.road,
        vehicle.driveline,
    )
}

/// The rigid observer of this vehicle with these gains.
pub fn rigid_observer(vehicle: &Vehicle, gains: impl Into<Schedule<f64, RigidGains<f64>>>) -> RigidObserver<f64> {
    RigidObserver { model: rigid_model(vehicle), gains: gains.into(), tracker: tracker(vehicle) }
}

/// Longest sample over which gains designed in continuous time may correct, s. The chapter's gains multiply
/// the error by -0.85 over 0.04 s at the strong vertex of the inertia phase, and by -1.1 over 0.05 s.
const SAMPLE_MAX_S: f64 = 0.04;

/// Checks, valve and phase for the observers of this vehicle.
pub fn tracker(vehicle: &Vehicle) -> Tracker<f64> {
    Tracker {
        valve: vehicle.observer_valve,
        shift: vehicle.shift,
        supervisor: vehicle.supervisor,
        limits: vehicle.limits,
        discretisation: Discretisation::Exact,
        sample_max_s: SAMPLE_MAX_S,
    }
}

/// The observer with a guaranteed range around its estimates, from the vehicle file's error budget. The budget is of
/// a valve that is commanded by a current; of another there is none.
pub fn bounded<O>(vehicle: &Vehicle, observer: O) -> Bounded<f64, O> {
    let errors = &vehicle.error_bounds;
    let budget = Budget {
        valve: vehicle.oncoming.valve,
        lag_factor: errors.valve_lag_factor,
        gain_factor: errors.valve_gain_factor,
        delay_s: errors.valve_delay_s,
        command: errors.current_a,
        pressure_max_pa: errors.pressure_max_pa,
        friction_factor: errors.friction_factor,
        slip_rad_s: errors.slip_rad_s,
    };
    let shaft = ShaftErrors {
        turbine_torque_share: errors.turbine_torque_share,
        turbine_rad_s: errors.turbine_quantum_rad_s,
        output_rad_s: errors.output_quantum_rad_s,
        wheel_rad_s: errors.wheel_quantum_rad_s,
        age_s: errors.sampling_delay_s,
        offgoing_n_m: errors.offgoing_torque_n_m,
        offgoing_drain_s: errors.offgoing_drain_s,
    };
    let shaft = ShaftRange::new(vehicle.shift, vehicle.converter, vehicle.driveline, shaft);
    Bounded { observer, budget, clutch: vehicle.oncoming.clutch, shaft, limits: vehicle.limits }
}

/// Designs the gains of both phases from the vehicle file's requirements.
///
/// # Errors
/// The requirement that cannot be met, see [`DesignError`].
pub fn design_rigid(vehicle: &Vehicle) -> Result<RigidDesign, DesignError> {
    let phase = |phase| design_phase(vehicle, phase, &requirement(vehicle, phase).into());
    Ok(RigidDesign { torque_phase: phase(Phase::TorquePhase)?, inertia_phase: phase(Phase::InertiaPhase)? })
}

/// Designs the gain of one phase.
///
/// # Errors
/// The requirement that cannot be met, see [`DesignError`].
pub fn design_phase(vehicle: &Vehicle, phase: Phase, requirement: &IssRequirement) -> Result<Certificate, DesignError> {
    let polytope = Polytope::of(&rigid_model(vehicle), &vehicle.uncertainty, phase);
    let certificate = design_iss(requirement, &polytope)?;
    Ok(Certificate { vehicle_sha256: vehicle.source.sha256(), ..certificate })
}
