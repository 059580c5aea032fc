//! The keys of an experiment file.

use car::{GainMethod, ObserverKind};
use serde::Deserialize;
use toml::Spanned;

use super::off_nominal::RawOffNominal;
use crate::check::{Number, Numbers, Word};

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawExperiment {
    pub(super) name: Word,
    pub(super) title: Word,
    pub(super) vehicle: Word,
    pub(super) duration_s: Number,
    pub(super) sample_time_s: Number,
    pub(super) initial: RawInitial,
    pub(super) throttle: RawThrottle,
    #[serde(default)]
    pub(super) off_nominal: RawOffNominal,
    pub(super) shift: RawShift,
    pub(super) sensors: Option<Spanned<RawSensors>>,
    /// Draws of the sensors' random numbers in each scenario.
    pub(super) draws: Option<Number>,
    #[serde(default)]
    pub(super) observer: Vec<Spanned<RawObserver>>,
    #[serde(default)]
    pub(super) scenario: Vec<RawScenario>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawScenario {
    pub(super) name: Word,
    pub(super) throttle: Option<Number>,
    pub(super) sensor_delay_s: Option<Number>,
    pub(super) sensor_noise_factor: Option<Number>,
    pub(super) wheel_periods: Option<Number>,
    pub(super) output_periods: Option<Number>,
    pub(super) sensors: Option<Spanned<RawSensors>>,
    pub(super) row_time_s: Option<Number>,
    #[serde(default)]
    pub(super) off_nominal: RawOffNominal,
}

/// A file of which only the sensors are read.
#[derive(Deserialize)]
pub(super) struct RawSensorsFile {
    pub(super) sensors: Option<Spanned<RawSensors>>,
}

/// The sensors of a file, or what a scenario changes in them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(crate) struct RawSensors {
    pub(super) seed: Option<Spanned<u64>>,
    pub(super) row_offset_s: Option<Number>,
    pub(super) missing_share: Option<Number>,
    pub(super) outliers: Option<Number>,
    pub(super) engine: Option<Spanned<RawSpeedSensor>>,
    pub(super) turbine: Option<Spanned<RawSpeedSensor>>,
    pub(super) output: Option<Spanned<RawSpeedSensor>>,
    pub(super) wheel: Option<Spanned<RawSpeedSensor>>,
    pub(super) current: Option<Spanned<RawCurrentSensor>>,
    pub(super) acceleration: Option<Spanned<RawAccelerationSensor>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawSpeedSensor {
    pub(super) teeth: Option<Number>,
    pub(super) timer_s: Option<Number>,
    pub(super) periods: Option<Number>,
    pub(super) sample_time_s: Option<Number>,
    pub(super) delay_s: Option<Number>,
    pub(super) noise_rad_s: Option<Number>,
    pub(super) offset_s: Option<Number>,
    pub(super) scale: Option<Number>,
    pub(super) missing_share: Option<Number>,
    pub(super) burst_s: Option<Number>,
    pub(super) frozen_s: Option<Number>,
    pub(super) outliers: Option<Number>,
    pub(super) outlier_rad_s: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawCurrentSensor {
    pub(super) noise_a: Option<Number>,
    pub(super) offset_a: Option<Number>,
    pub(super) resolution_a: Option<Number>,
    pub(super) sample_time_s: Option<Number>,
    pub(super) delay_s: Option<Number>,
    pub(super) offset_s: Option<Number>,
    pub(super) scale: Option<Number>,
    pub(super) missing_share: Option<Number>,
    pub(super) burst_s: Option<Number>,
    pub(super) frozen_s: Option<Number>,
    pub(super) outliers: Option<Number>,
    pub(super) outlier_a: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawAccelerationSensor {
    pub(super) noise_m_s2: Option<Number>,
    pub(super) bias_m_s2: Option<Number>,
    pub(super) resolution_m_s2: Option<Number>,
    pub(super) sample_time_s: Option<Number>,
    pub(super) delay_s: Option<Number>,
    pub(super) offset_s: Option<Number>,
    pub(super) scale: Option<Number>,
    pub(super) missing_share: Option<Number>,
    pub(super) burst_s: Option<Number>,
    pub(super) frozen_s: Option<Number>,
    pub(super) outliers: Option<Number>,
    pub(super) outlier_m_s2: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawObserver {
    pub(super) name: Word,
    pub(super) kind: ObserverKind,
    pub(super) method: Option<GainMethod>,
    pub(super) sample_time_s: Option<Number>,
    #[serde(default)]
    pub(super) discretisation: RawDiscretisation,
    #[serde(default)]
    pub(super) sensors: RawSignals,
    pub(super) gains: Option<Spanned<RawGains>>,
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

/// The gains of any kind. An untagged enum would lose the places of its values.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawGains {
    pub(super) torque_phase_pa_s_rad: Option<Number>,
    pub(super) inertia_phase_pa_s_rad: Option<Numbers>,
    pub(super) torque_speed_rad_s2: Option<Number>,
    pub(super) torque_pressure_pa_s: Option<Number>,
    pub(super) inertia_speed_rad_s2: Option<Numbers>,
    pub(super) inertia_pressure_pa_s: Option<Numbers>,
    pub(super) torque_phase_normalised: Option<Vec<Numbers>>,
    pub(super) inertia_phase_normalised: Option<Vec<Numbers>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawInitial {
    pub(super) engine_rad_s: Number,
    pub(super) vehicle_m_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawThrottle {
    pub(super) time_s: Numbers,
    pub(super) position: Numbers,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
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
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawFill {
    pub(super) boost_pressure_pa: Number,
    pub(super) boost_s: Number,
    pub(super) settle_s: Number,
    pub(super) holding_margin: Number,
    pub(super) fast_fill_over_kiss_pa: Option<Number>,
    pub(super) fast_fill_offset_s: Option<Number>,
    pub(super) ramp_s: Option<Number>,
    pub(super) stroke_over_kiss_pa: Option<Number>,
    pub(super) hold_s: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawTorquePhase {
    pub(super) duration_s: Number,
    pub(super) holding_margin: Number,
    pub(super) release_slip_rad_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawInertiaPhase {
    pub(super) duration_s: Number,
    pub(super) proportional_n_m_s_rad: Number,
    pub(super) integral_n_m_rad: Number,
    pub(super) throttle_factor: Number,
    pub(super) throttle_ramp_s: Number,
    pub(super) throttle_return_slip_rad_s: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawLock {
    pub(super) slip_rad_s: Number,
    pub(super) ramp_s: Number,
}
