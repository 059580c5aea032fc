//! What an experiment file says, key by key.

use serde::Deserialize;
use toml::Spanned;

use super::{GainMethod, ObserverKind};
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
    pub(super) sensors: Option<RawSensors>,
    #[serde(default)]
    pub(super) observer: Vec<Spanned<RawObserver>>,
    #[serde(default)]
    pub(super) scenario: Vec<RawScenario>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScenario {
    pub(super) name: String,
    pub(super) throttle: Option<Number>,
    pub(super) sensor_delay_s: Option<Number>,
    pub(super) sensor_noise_factor: Option<Number>,
    pub(super) wheel_periods: Option<Number>,
    pub(super) output_periods: Option<Number>,
    #[serde(default)]
    pub(super) off_nominal: RawOffNominal,
}

/// A file of which only the sensors are read.
#[derive(Deserialize)]
pub(super) struct RawSensorsFile {
    pub(super) sensors: Option<RawSensors>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSensors {
    pub(super) seed: u64,
    pub(super) engine: RawSpeedSensor,
    pub(super) turbine: RawSpeedSensor,
    pub(super) output: RawSpeedSensor,
    pub(super) wheel: RawSpeedSensor,
    pub(super) current: RawCurrentSensor,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSpeedSensor {
    pub(super) teeth: Number,
    pub(super) timer_s: Number,
    pub(super) periods: Number,
    pub(super) sample_time_s: Number,
    pub(super) delay_s: Number,
    pub(super) noise_rad_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCurrentSensor {
    pub(super) noise_a: Number,
    pub(super) offset_a: Number,
    pub(super) resolution_a: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawObserver {
    pub(super) name: String,
    pub(super) kind: ObserverKind,
    pub(super) method: Option<GainMethod>,
    pub(super) sample_time_s: Option<Number>,
    #[serde(default)]
    pub(super) discretisation: RawDiscretisation,
    #[serde(default)]
    pub(super) sensors: RawSignals,
    pub(super) gains: Option<RawGains>,
}

#[derive(Deserialize, Clone, Copy, Default)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawDiscretisation {
    #[default]
    Exact,
    Euler,
}

#[derive(Deserialize, Clone, Copy, Default, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawSignals {
    #[default]
    Ideal,
    Real,
}

#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub(super) enum RawGains {
    Rigid {
        torque_phase_pa_s_rad: f64,
        inertia_phase_pa_s_rad: [f64; 2],
    },
    Sliding {
        torque_speed_rad_s2: f64,
        torque_pressure_pa_s: f64,
        inertia_speed_rad_s2: [f64; 2],
        inertia_pressure_pa_s: [f64; 2],
    },
    Compliant {
        torque_phase_normalised: [[f64; 2]; 2],
        inertia_phase_normalised: [[f64; 3]; 2],
    },
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
    pub(super) valve_lag_factor: Option<Number>,
    pub(super) valve_gain_factor: Option<Number>,
    pub(super) valve_delay_s: Option<Number>,
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
    pub(super) torque_factor: Option<Number>,
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
