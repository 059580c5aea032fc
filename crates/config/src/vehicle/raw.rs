//! What a vehicle file says, key by key.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use crate::check::{Number, Numbers};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawVehicleFile {
    pub(super) name: String,
    pub(super) engine: RawEngine,
    pub(super) converter: RawConverter,
    pub(super) gear_train: RawGearTrain,
    pub(super) clutch: BTreeMap<String, RawClutch>,
    pub(super) driveline: RawDriveline,
    pub(super) tyre: RawTyre,
    pub(super) vehicle: RawRoad,
    pub(super) observer: RawObserver,
    pub(super) design: RawDesign,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEngine {
    pub(super) inertia_kg_m2: Number,
    pub(super) drag_n_m_s: Number,
    pub(super) torque: RawEngineMap,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEngineMap {
    pub(super) throttle: Numbers,
    pub(super) speed_rad_s: Numbers,
    pub(super) torque_n_m: Spanned<Vec<Numbers>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawConverter {
    pub(super) speed_ratio: Numbers,
    pub(super) capacity_n_m_s2: Numbers,
    pub(super) torque_ratio: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGearTrain {
    pub(super) input: Spanned<String>,
    pub(super) output: Spanned<String>,
    pub(super) offgoing: Spanned<String>,
    pub(super) oncoming: Spanned<String>,
    pub(super) shaft: Spanned<Vec<RawShaft>>,
    #[serde(default)]
    pub(super) planetary_set: Vec<RawPlanetarySet>,
    #[serde(default)]
    pub(super) held: Vec<RawHeld>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawShaft {
    pub(super) name: String,
    pub(super) inertia_kg_m2: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPlanetarySet {
    pub(super) sun: Spanned<String>,
    pub(super) ring: Spanned<String>,
    pub(super) carrier: Spanned<String>,
    pub(super) sun_teeth: Number,
    pub(super) ring_teeth: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawHeld {
    pub(super) input: Spanned<String>,
    pub(super) output: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawClutch {
    pub(super) input: Spanned<String>,
    pub(super) output: Spanned<String>,
    pub(super) mean_radius_m: Number,
    pub(super) friction_faces: Number,
    pub(super) piston_area_m2: Number,
    pub(super) return_spring_n: Number,
    pub(super) static_friction: Number,
    pub(super) friction: RawFriction,
    pub(super) valve: RawValveMaps,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFriction {
    pub(super) slip_rad_s: Numbers,
    pub(super) coefficient: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawValveMaps {
    pub(super) lag: RawLag,
    pub(super) gain: RawGain,
    pub(super) delay: RawDelay,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLag {
    pub(super) pressure_pa: Numbers,
    pub(super) time_constant_s: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawGain {
    pub(super) current_a: Numbers,
    pub(super) gain_pa_a: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDelay {
    pub(super) current_a: Numbers,
    pub(super) delay_s: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDriveline {
    pub(super) final_ratio: Number,
    pub(super) shaft_stiffness_n_m_rad: Number,
    pub(super) shaft_damping_n_m_s_rad: Number,
    pub(super) wheel_inertia_kg_m2: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTyre {
    pub(super) max_force_n: Number,
    pub(super) slip_scale: Number,
    pub(super) floor_m_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRoad {
    pub(super) mass_kg: Number,
    pub(super) wheel_radius_m: Number,
    pub(super) front_area_m2: Number,
    pub(super) drag_coefficient: Number,
    pub(super) air_density_kg_m3: Number,
    pub(super) rolling_moment_n_m: Number,
    pub(super) grade_rad: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObserver {
    pub(super) speed_max_rad_s: Number,
    pub(super) command_max: Number,
    pub(super) shaft_settling_s: Number,
    pub(super) valve: RawValve,
    pub(super) uncertainty: RawUncertainty,
    pub(super) supervisor: RawSupervisor,
    pub(super) filter: RawFilter,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFilter {
    pub(super) turbine_share: Number,
    pub(super) turbine_share_s: Number,
    pub(super) twist_rate_rad_s: Number,
    pub(super) valve_rate_s: Number,
    pub(super) offgoing_n_m: Number,
    pub(super) offgoing_release_s: Number,
    pub(super) output_least_rad_s: Number,
}

#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum RawValve {
    Proportional { time_constant_s: f64, gain_pa_a: f64 },
    PulseWidth { flow_sqrt_pa_s: f64, line_pressure_pa: f64, operating_pressure_pa: f64 },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawUncertainty {
    pub(super) friction: Numbers,
    pub(super) time_constant_s: Option<Numbers>,
    pub(super) command: Option<Numbers>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSupervisor {
    pub(super) release_slip_rad_s: Number,
    pub(super) lock_slip_rad_s: Number,
    pub(super) lock_hold_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawDesign {
    pub(super) torque_phase: RawRequirement,
    pub(super) inertia_phase: RawRequirement,
    pub(super) error_bounds: RawErrorBounds,
    pub(super) compliant: RawCompliantDesign,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawErrorBounds {
    pub(super) turbine_torque_n_m: Number,
    pub(super) pressure_pa: Number,
    pub(super) mass_kg: Number,
    pub(super) grade_rad: Number,
    pub(super) shaft_torque_n_m: Number,
    pub(super) output_torque_n_m: Number,
    pub(super) offgoing_torque_n_m: Number,
    pub(super) turbine_torque_share: Number,
    pub(super) offgoing_drain_s: Number,
    pub(super) turbine_quantum_rad_s: Number,
    pub(super) output_quantum_rad_s: Number,
    pub(super) slip_quantum_rad_s: Number,
    pub(super) wheel_quantum_rad_s: Number,
    pub(super) sampling_delay_s: Number,
    pub(super) float32_rounding: Number,
    pub(super) shift_pressure_pa: Number,
    pub(super) shift_ramp_pa_s: Number,
    pub(super) valve_lag_factor: Numbers,
    pub(super) valve_gain_factor: Numbers,
    pub(super) valve_delay_s: Numbers,
    pub(super) friction_factor: Numbers,
    pub(super) current_a: Number,
    pub(super) slip_rad_s: Number,
    pub(super) pressure_max_pa: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCompliantDesign {
    pub(super) torque_phase: RawCompliantRequirement,
    pub(super) inertia_phase: RawCompliantRequirement,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCompliantRequirement {
    pub(super) settling_time_s: Number,
    pub(super) kappa1_per_s: Option<Number>,
    pub(super) offset_max_pa: Number,
    pub(super) error_matrix: Option<Spanned<Vec<Numbers>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRequirement {
    pub(super) settling_time_s: Number,
    pub(super) kappa1_per_s: Option<Number>,
    pub(super) model_error_max_rad_s2: Number,
    pub(super) offset_max_pa: Number,
}
