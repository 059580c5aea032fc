//! What an experiment file says, key by key.

use serde::Deserialize;
use toml::Spanned;

use crate::check::{Number, Numbers};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawExperiment {
    pub(super) name: String,
    pub(super) title: String,
    pub(super) vehicle: Spanned<String>,
    pub(super) duration_s: Number,
    pub(super) sample_time_s: Number,
    pub(super) initial: RawInitial,
    pub(super) throttle: RawThrottle,
    #[serde(default)]
    pub(super) off_nominal: RawOffNominal,
    pub(super) shift: RawShift,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawInitial {
    pub(super) engine_rad_s: Number,
    pub(super) vehicle_m_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawThrottle {
    pub(super) time_s: Numbers,
    pub(super) position: Numbers,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct RawOffNominal {
    pub(super) engine_torque_factor: Option<Number>,
    pub(super) converter_capacity_factor: Option<Number>,
    pub(super) friction_factor: Option<Number>,
    pub(super) mass_kg: Option<Number>,
    pub(super) grade_rad: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawShift {
    pub(super) request_s: Number,
    pub(super) control_period_s: Number,
    pub(super) line_pressure_pa: Number,
    pub(super) lead_s: Number,
    pub(super) fill: RawFill,
    pub(super) torque_phase: RawTorquePhase,
    pub(super) inertia_phase: RawInertiaPhase,
    pub(super) lock: RawLock,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFill {
    pub(super) boost_pressure_pa: Number,
    pub(super) boost_s: Number,
    pub(super) settle_s: Number,
    pub(super) holding_margin: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTorquePhase {
    pub(super) duration_s: Number,
    pub(super) holding_margin: Number,
    pub(super) release_slip_rad_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawInertiaPhase {
    pub(super) duration_s: Number,
    pub(super) proportional_n_m_s_rad: Number,
    pub(super) integral_n_m_rad: Number,
    pub(super) throttle_factor: Number,
    pub(super) throttle_ramp_s: Number,
    pub(super) throttle_return_slip_rad_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLock {
    pub(super) slip_rad_s: Number,
    pub(super) ramp_s: Number,
}
