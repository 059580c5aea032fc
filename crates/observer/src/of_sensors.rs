//! How sensors read speeds: standard deviations, lags and delays, from a car's description of them.

use car::SpeedSensor;

use crate::{EngineNoise, SpeedReading};

/// Minimum standard deviation of a speed reading, rad/s \[chosen\].
const READING_RAD_S: f64 = 0.02;
/// A quantum of the error budget over the standard deviation of one reading: five standard deviations of the difference of two.
const QUANTUM: f64 = 5.0 * core::f64::consts::SQRT_2;

/// Inertia of the engine that the three torques below are of, kg m^2: a 2.0 L engine with 190 N m. Inertia and torque of an
/// engine grow together, so that another engine has the same accelerations, and torques in proportion to its inertia.
pub const ENGINE_KG_M2: f64 = 0.17;
/// Torque by which the engine's may change within [`ENGINE_CHANGE_S`], N m \[chosen\].
const ENGINE_CHANGE_N_M: f64 = 50.0;
/// Time of a fast change of the engine's torque, s \[chosen\].
const ENGINE_CHANGE_S: f64 = 0.05;
/// Largest torque that accelerates the engine, N m: twice what an engine of this size gives \[chosen\].
const ENGINE_MAX_N_M: f64 = 400.0;
/// The scale is known no better than this \[chosen\]: scale and delay of the wheel trade with each other while the
/// acceleration stands. A test of the combined study holds the errors after a launch against it.
pub const SCALE_MIN: f64 = 3e-4;

/// Standard deviation of an error whose bound is the edge of a uniform distribution.
pub fn std_dev_of(bound: f64) -> f64 {
    bound / 3.0_f64.sqrt()
}

/// Angle by which a reading of a toothed wheel lags, rad: half of the teeth that it spans, and half a pitch.
pub fn lag_rad(sensor: &SpeedSensor) -> f64 {
    0.5 * (sensor.periods + 1.0) * core::f64::consts::TAU / sensor.teeth
}

/// Standard deviation of a speed reading, rad/s: that of its sensor, or of the quantum of the error budget.
pub fn std_dev_rad_s(sensor: Option<&SpeedSensor>, quantum_rad_s: f64) -> f64 {
    sensor.map_or(quantum_rad_s / QUANTUM, |sensor| sensor.noise_rad_s).max(READING_RAD_S)
}

/// How a speed is read by a sensor, or with the quantum of the error budget, rad/s, where none is described.
pub fn speed_reading(sensor: Option<&SpeedSensor>, quantum_rad_s: f64) -> SpeedReading<f64> {
    SpeedReading {
        std_dev_rad_s: std_dev_rad_s(sensor, quantum_rad_s),
        lag_rad: sensor.map_or(0.0, lag_rad),
        pitch_rad: sensor.map_or(0.0, |sensor| core::f64::consts::TAU / sensor.teeth),
        delay_s: sensor.map_or(0.0, |sensor| sensor.delay_s),
    }
}

/// How the speed of an engine changes, and is read.
pub fn engine_noise(sensor: Option<&SpeedSensor>, quantum_rad_s: f64) -> EngineNoise<f64> {
    EngineNoise {
        reading_rad_s: std_dev_rad_s(sensor, quantum_rad_s),
        acceleration_walk: ENGINE_CHANGE_N_M / ENGINE_KG_M2 / ENGINE_CHANGE_S.sqrt(),
        acceleration_max_rad_s2: ENGINE_MAX_N_M / ENGINE_KG_M2,
    }
}
