//! The keys of a vehicle file.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::fill::RawFill;
use super::fill_bounds::RawFillBounds;
use crate::check::{Number, Numbers, Word};

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawVehicleFile {
    pub(super) name: Word,
    pub(super) engine: RawEngine,
    pub(super) converter: RawConverter,
    pub(super) gear_train: RawGearTrain,
    pub(super) clutch: BTreeMap<String, RawClutch>,
    pub(super) driveline: RawDriveline,
    pub(super) tyre: RawTyre,
    pub(super) vehicle: RawRoad,
    #[serde(default)]
    pub(super) oil: RawOil,
    pub(super) observer: RawObserver,
    pub(super) design: RawDesign,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawEngine {
    /// Of a short file.
    pub(super) max_torque_n_m: Option<Number>,
    pub(super) inertia_kg_m2: Number,
    pub(super) drag_n_m_s: Number,
    pub(super) torque: RawEngineMap,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawEngineMap {
    pub(super) throttle: Numbers,
    pub(super) speed_rad_s: Numbers,
    pub(super) torque_n_m: Spanned<Vec<Numbers>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawConverter {
    pub(super) speed_ratio: Numbers,
    pub(super) capacity_n_m_s2: Numbers,
    pub(super) torque_ratio: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawGearTrain {
    /// Of a short file.
    pub(super) ratios: Option<Numbers>,
    pub(super) input: Word,
    pub(super) output: Word,
    pub(super) offgoing: Word,
    pub(super) oncoming: Word,
    pub(super) shaft: Spanned<Vec<RawShaft>>,
    #[serde(default)]
    pub(super) planetary_set: Vec<RawPlanetarySet>,
    #[serde(default)]
    pub(super) held: Vec<RawHeld>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawShaft {
    pub(super) name: Word,
    pub(super) inertia_kg_m2: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawPlanetarySet {
    pub(super) sun: Word,
    pub(super) ring: Word,
    pub(super) carrier: Word,
    pub(super) sun_teeth: Number,
    pub(super) ring_teeth: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawHeld {
    pub(super) input: Word,
    pub(super) output: Word,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawClutch {
    pub(super) input: Word,
    pub(super) output: Word,
    pub(super) mean_radius_m: Number,
    pub(super) friction_faces: Number,
    pub(super) piston_area_m2: Number,
    pub(super) return_spring_n: Number,
    pub(super) static_friction: Number,
    pub(super) friction: RawFriction,
    pub(super) valve: Spanned<RawClutchValve>,
    pub(super) fill: Option<RawFill>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawFriction {
    pub(super) slip_rad_s: Numbers,
    pub(super) coefficient: Numbers,
}

/// The valve of a clutch, of either kind.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawClutchValve {
    #[serde(default)]
    pub(super) kind: RawValveKind,
    pub(super) lag: Option<Spanned<RawLag>>,
    pub(super) gain: Option<Spanned<RawGain>>,
    pub(super) flow_sqrt_pa_s: Option<Number>,
    pub(super) line_pressure_pa: Option<Number>,
    pub(super) hysteresis_pa: Option<Number>,
    pub(super) zero_pressure_a: Option<Number>,
    pub(super) delay: Spanned<RawDelay>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawLag {
    pub(super) pressure_pa: Numbers,
    pub(super) time_constant_s: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawGain {
    pub(super) current_a: Numbers,
    pub(super) gain_pa_a: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawDelay {
    pub(super) current_a: Option<Numbers>,
    pub(super) duty_percent: Option<Numbers>,
    pub(super) delay_s: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawDriveline {
    pub(super) final_ratio: Number,
    pub(super) shaft_stiffness_n_m_rad: Number,
    pub(super) shaft_damping_n_m_s_rad: Number,
    pub(super) wheel_inertia_kg_m2: Number,
    pub(super) backlash_rad: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawTyre {
    pub(super) max_force_n: Number,
    pub(super) slip_scale: Number,
    pub(super) floor_m_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawRoad {
    pub(super) mass_kg: Number,
    pub(super) wheel_radius_m: Number,
    pub(super) front_area_m2: Number,
    pub(super) drag_coefficient: Number,
    pub(super) air_density_kg_m3: Number,
    pub(super) rolling_moment_n_m: Number,
    pub(super) grade_rad: Number,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawOil {
    pub(super) temperature_degc: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawObserver {
    pub(super) speed_max_rad_s: Number,
    pub(super) command_max: Number,
    pub(super) shaft_settling_s: Number,
    pub(super) valve: Spanned<RawValve>,
    pub(super) uncertainty: Spanned<RawUncertainty>,
    pub(super) supervisor: RawSupervisor,
    pub(super) filter: RawFilter,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawFilter {
    pub(super) turbine_share: Number,
    pub(super) turbine_share_s: Number,
    pub(super) twist_rate_rad_s: Number,
    pub(super) valve_rate_s: Number,
    pub(super) offgoing_n_m: Number,
    pub(super) offgoing_release_s: Number,
    pub(super) output_least_rad_s: Number,
}

/// A tagged enum would lose the places of its values.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawValve {
    pub(super) kind: RawValveKind,
    pub(super) time_constant_s: Option<Number>,
    pub(super) gain_pa_a: Option<Number>,
    pub(super) flow_sqrt_pa_s: Option<Number>,
    pub(super) line_pressure_pa: Option<Number>,
}

#[derive(Deserialize, Clone, Copy, Default)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawValveKind {
    #[default]
    Proportional,
    PulseWidth,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawUncertainty {
    pub(super) friction: Numbers,
    pub(super) time_constant_s: Option<Numbers>,
    pub(super) pressure_drop_pa: Option<Numbers>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawSupervisor {
    pub(super) release_slip_rad_s: Number,
    pub(super) lock_slip_rad_s: Number,
    pub(super) lock_hold_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawDesign {
    pub(super) torque_phase: RawRequirement,
    pub(super) inertia_phase: RawRequirement,
    pub(super) error_bounds: Spanned<RawErrorBounds>,
    pub(super) compliant: RawCompliantDesign,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
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
    pub(super) valve_hysteresis_pa: Option<Number>,
    pub(super) command_age_s: Option<Number>,
    pub(super) line_pressure_pa: Option<Numbers>,
    pub(super) fill: Option<RawFillBounds>,
    pub(super) friction_factor: Numbers,
    pub(super) current_a: Option<Number>,
    pub(super) duty_percent: Option<Number>,
    pub(super) slip_rad_s: Number,
    pub(super) pressure_max_pa: Number,
    pub(super) wheel_scale: Option<Number>,
    pub(super) wheel_delay_s: Option<Number>,
    pub(super) channel_skew_s: Option<Number>,
    pub(super) engine_torque_share: Option<Number>,
    pub(super) shaft_stiffness_factor: Option<Numbers>,
    pub(super) backlash_rad: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawCompliantDesign {
    pub(super) torque_phase: RawCompliantRequirement,
    pub(super) inertia_phase: RawCompliantRequirement,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawCompliantRequirement {
    pub(super) settling_time_s: Number,
    pub(super) kappa1_per_s: Option<Number>,
    pub(super) offset_max_pa: Number,
    pub(super) error_matrix: Option<Spanned<Vec<Numbers>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawRequirement {
    pub(super) settling_time_s: Number,
    pub(super) kappa1_per_s: Option<Number>,
    pub(super) model_error_max_rad_s2: Number,
    pub(super) offset_max_pa: Number,
}
