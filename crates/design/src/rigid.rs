//! From a vehicle to the rigid observer: model, polytopes, gains, certificates.

use car::{DesignRequirement, Vehicle};
use drivetrain::CommandKind;
use observer::{
    Bounded, Budget, Discretisation, InputLimits, Phase, RangeEstimator, RigidGains, RigidModel, RigidObserver,
    Schedule, ShaftErrors, ShaftRange, Tracker, phase_supervisor,
};
use serde::Serialize;

use crate::iss::{OffsetMissed, required, settling_time_for};
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

    /// The longest step over which the speeds may correct the estimate, s: over it the error still decays as certified.
    pub fn longest_step_s(&self, vehicle: &Vehicle, discretisation: Discretisation) -> f64 {
        let of = |certificate: &Certificate, phase| certificate.longest_step_s(vehicle, phase, discretisation);
        of(&self.torque_phase, Phase::TorquePhase).min(of(&self.inertia_phase, Phase::InertiaPhase))
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
        Phase::InertiaPhase | Phase::AfterShift => &vehicle.requirements.inertia_phase,
        Phase::BeforeShift | Phase::TorquePhase => &vehicle.requirements.torque_phase,
    }
}

/// The powertrain model of the rigid observer of this vehicle.
pub fn rigid_model(vehicle: &Vehicle) -> RigidModel<f64> {
    RigidModel::new(
        vehicle.shift,
        vehicle.output_inertia_kg_m2,
        vehicle.converter,
        vehicle.oncoming.clutch,
        vehicle.settings.valve,
        vehicle.road,
        vehicle.driveline,
    )
}

/// The rigid observer of this vehicle with these gains.
pub fn rigid_observer(vehicle: &Vehicle, gains: impl Into<Schedule<f64, RigidGains<f64>>>) -> RigidObserver<f64> {
    RigidObserver { model: rigid_model(vehicle), gains: gains.into(), tracker: tracker(vehicle) }
}

/// Longest sample over which an observer without a certificate may correct, s [chosen]: the time constant of the valve of the
/// reference car, over which the frozen model is still a fair one. Designed gains have a limit of their own,
/// [`RigidDesign::longest_step_s`] and the like.
const SAMPLE_MAX_S: f64 = 0.04;

/// Checks, valve and phase for the observers of this vehicle.
pub fn tracker(vehicle: &Vehicle) -> Tracker<f64> {
    Tracker {
        valve: vehicle.settings.valve,
        shift: vehicle.shift,
        supervisor: phase_supervisor(vehicle),
        limits: input_limits(vehicle),
        discretisation: Discretisation::Exact,
        sample_max_s: SAMPLE_MAX_S,
    }
}

/// The least factor on the gain of a valve for which the largest command of a file is taken to be stated: that of the usual bounds.
const USUAL_GAIN: f64 = 0.9;

/// What a reading or an estimate of this vehicle can be. A current valve that may be weaker than usual may get a larger command by as much.
pub fn input_limits(vehicle: &Vehicle) -> InputLimits<f64> {
    let [weakest, _] = vehicle.error_bounds.valve_gain_factor;
    let room = match vehicle.oncoming.valve.command_kind() {
        CommandKind::Current => (USUAL_GAIN / weakest).max(1.0),
        CommandKind::DutyCycle => 1.0,
    };
    InputLimits {
        speed_max_rad_s: vehicle.settings.speed_max_rad_s,
        command_max: room * vehicle.settings.command_max,
        command_error: vehicle.error_bounds.command,
        pressure_max_pa: vehicle.error_bounds.pressure_max_pa,
        shaft_torque_max_n_m: vehicle.shaft_torque_max_n_m(),
    }
}

/// The ranges of pressure and torque, from the vehicle file's error budget.
pub fn range(vehicle: &Vehicle) -> RangeEstimator<f64> {
    let errors = &vehicle.error_bounds;
    let budget = Budget {
        valve: vehicle.oncoming.valve,
        lag_factor: errors.valve_lag_factor,
        gain_factor: errors.valve_gain_factor,
        delay_s: errors.valve_delay_s,
        hysteresis_pa: errors.valve_hysteresis_pa,
        command: errors.command,
        command_age_s: errors.command_age_s,
        line_pressure_pa: errors.line_pressure_pa,
        fill: errors.fill,
        pressure_max_pa: errors.pressure_max_pa,
        friction_factor: errors.friction_factor,
        // The file of a car with two speeds has no drag of open plates.
        drag_n_m: 0.0,
        slip_rad_s: errors.slip_rad_s,
    };
    let shaft = ShaftErrors {
        turbine_torque_share: errors.turbine_torque_share,
        turbine_rad_s: errors.turbine_quantum_rad_s,
        output_rad_s: errors.output_quantum_rad_s,
        wheel_rad_s: errors.wheel_quantum_rad_s,
        wheel_scale: errors.wheel_scale,
        age_s: errors.sampling_delay_s,
        offgoing_n_m: errors.offgoing_torque_n_m,
        offgoing_drain_s: errors.offgoing_drain_s,
    };
    let shaft = ShaftRange::new(vehicle.shift, vehicle.converter, vehicle.driveline, shaft);
    RangeEstimator {
        budget,
        clutch: vehicle.oncoming.clutch,
        age_s: errors.sampling_delay_s,
        shaft: Some(shaft),
        tracker: tracker(vehicle),
    }
}

/// The observer with these ranges around its estimates.
pub fn bounded<O>(vehicle: &Vehicle, observer: O) -> Bounded<f64, O> {
    Bounded { observer, range: range(vehicle) }
}

/// Designs the gains of both phases from the vehicle file's requirements.
///
/// # Errors
/// The requirement that cannot be met, see [`DesignError`].
pub fn design_rigid(vehicle: &Vehicle) -> Result<RigidDesign, DesignError> {
    let phase = |phase| design_phase(vehicle, phase, &requirement(vehicle, phase).into());
    Ok(RigidDesign { torque_phase: phase(Phase::TorquePhase)?, inertia_phase: phase(Phase::InertiaPhase)? })
}

/// The same with the best certified gain where the required offset cannot be had, and what is missed.
///
/// # Errors
/// There is no certified gain, see [`DesignError`].
pub fn best_rigid(vehicle: &Vehicle) -> Result<(RigidDesign, Vec<OffsetMissed>), DesignError> {
    let phase = |phase| best_phase(vehicle, phase, &requirement(vehicle, phase).into());
    let ((torque_phase, first), (inertia_phase, second)) = (phase(Phase::TorquePhase)?, phase(Phase::InertiaPhase)?);
    Ok((RigidDesign { torque_phase, inertia_phase }, first.into_iter().chain(second).collect()))
}

/// Designs the gain of one phase.
///
/// # Errors
/// The requirement that cannot be met, see [`DesignError`].
pub fn design_phase(vehicle: &Vehicle, phase: Phase, requirement: &IssRequirement) -> Result<Certificate, DesignError> {
    required(best_phase(vehicle, phase, requirement)?)
}

/// The same with the best certified gain where the required offset cannot be had, and what is missed.
///
/// # Errors
/// There is no certified gain, see [`DesignError`].
pub fn best_phase(
    vehicle: &Vehicle,
    phase: Phase,
    requirement: &IssRequirement,
) -> Result<(Certificate, Option<OffsetMissed>), DesignError> {
    let polytope = Polytope::of(&rigid_model(vehicle), &vehicle.settings.uncertainty, phase);
    let design = |kappa2_per_s| design_iss(&IssRequirement { kappa2_per_s, ..*requirement }, &polytope);
    let certificate = design(requirement.kappa2_per_s).map_err(|error| error.in_phase(phase))?;
    let missed = (certificate.offset_pa > requirement.offset_max_pa).then(|| {
        let settling_time_s = 4.0 / requirement.kappa2_per_s;
        let offset = |kappa2_per_s| design(kappa2_per_s).ok().map(|certificate| certificate.offset_pa);
        OffsetMissed {
            phase,
            required_by: format!("`design.{}.offset_max_pa` of {}", phase.name(), vehicle.name),
            required_pa: requirement.offset_max_pa,
            settling_time_s,
            offset_pa: certificate.offset_pa,
            kappa1_per_s: certificate.kappa1_per_s,
            kappa1_is_required: requirement.kappa1_per_s.is_some(),
            gain: certificate.gain_text(phase),
            reached_with_s: settling_time_for(requirement.offset_max_pa, settling_time_s, offset),
        }
    });
    Ok((certificate, missed))
}
