//! The Kalman filters of a vehicle: what it does not know, from the error budget and the sensors.

use config::{Sensors, SpeedSensor, Vehicle};
use observer::{FilterNoise, KalmanFilter, Readings, UnscentedFilter};

use crate::budget::{ValveErrors, shift_pressure};
use crate::compliant::compliant_model;
use crate::rigid::tracker;

/// Standard deviation of a speed reading where no sensor is described, rad/s.
const READING_RAD_S: f64 = 0.02;

/// Standard deviation of an error whose bound is the edge of a uniform distribution.
fn deviation_of(bound: f64) -> f64 {
    bound / 3.0_f64.sqrt()
}

/// The Kalman filter of this vehicle, for signals from these sensors; without them the readings are taken to be of the
/// moment and nearly exact.
///
/// A bound of the budget counts as the edge of a uniform distribution.
pub fn kalman_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> KalmanFilter<f64> {
    let told = &vehicle.filter;
    let deviation = |sensor: fn(&Sensors) -> &SpeedSensor| {
        sensors.map_or(READING_RAD_S, |sensors| sensor(sensors).noise_rad_s.max(READING_RAD_S))
    };
    let lag = |sensor: fn(&Sensors) -> &SpeedSensor| {
        sensors.map_or(0.0, |sensors| {
            let sensor = sensor(sensors);
            0.5 * (sensor.periods + 1.0) * std::f64::consts::TAU / sensor.teeth
        })
    };
    let valve = ValveErrors::of(vehicle);
    let noise = FilterNoise {
        turbine_rad_s: deviation(|sensors| &sensors.turbine),
        output_rad_s: deviation(|sensors| &sensors.output),
        wheel_rad_s: deviation(|sensors| &sensors.wheel),
        turbine_share: told.turbine_share,
        turbine_share_s: told.turbine_share_s,
        twist_rate_rad_s: told.twist_rate_rad_s,
        output_least_rad_s: told.output_least_rad_s,
        valve_moving: deviation_of(valve.lag_pa_s.hypot(valve.delay_pa_s)) / vehicle.error_bounds.shift_ramp_pa_s,
        valve_resting_per_s: deviation_of(valve.gain_pa_s) / shift_pressure(vehicle),
        valve_rate_s: told.valve_rate_s,
        offgoing_n_m: told.offgoing_n_m,
        offgoing_release_s: told.offgoing_release_s,
    };
    let readings = Readings {
        turbine_rad: lag(|sensors| &sensors.turbine),
        output_rad: lag(|sensors| &sensors.output),
        wheel_rad: lag(|sensors| &sensors.wheel),
    };
    KalmanFilter::new(compliant_model(vehicle), noise, readings, tracker(vehicle))
}

/// The extended Kalman filter as textbooks have it: told the same, but every reading is of the moment.
pub fn extended_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> KalmanFilter<f64> {
    let readings = Readings { turbine_rad: 0.0, output_rad: 0.0, wheel_rad: 0.0 };
    KalmanFilter { readings, ..kalman_filter(vehicle, sensors) }
}

/// The unscented filter of this vehicle, told the same.
pub fn unscented_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> UnscentedFilter<f64> {
    UnscentedFilter { filter: kalman_filter(vehicle, sensors) }
}
