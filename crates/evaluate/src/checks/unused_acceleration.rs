//! A longitudinal acceleration that the filter does not use, or not to the end.

use observer::ChannelHealth;

use super::check::{Check, CheckedRow};

/// Readings that a warning needs, time without a usable one, s, and speed of the output from which on the car moves, rad/s \[chosen\]:
/// while it stands, a coarse sensor may give the same reading.
const ENOUGH: u64 = 50;
const LASTS_S: f64 = 5.0;
const MOVES_RAD_S: f64 = 5.0;

/// What became of the readings so far, while the car moved.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct UnusedAcceleration {
    came: u64,
    used: u64,
    refused: u64,
    last_used_s: f64,
    /// Time in which it was refused or lost since, s.
    without_s: f64,
}

impl Check for UnusedAcceleration {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let health = row.estimate.channels.acceleration;
        let [_, _, output] = row.used_rad_s;
        if output.is_nan() || output.abs() < MOVES_RAD_S {
            return;
        }
        match health {
            ChannelHealth::Good => {
                self.used += 1;
                (self.last_used_s, self.without_s) = (row.step.time_s, 0.0);
            }
            ChannelHealth::Refused | ChannelHealth::Lost => {
                self.without_s += row.step.input.dt_s.clamp(0.0, 1.0);
            }
            ChannelHealth::Absent | ChannelHealth::Unused => {}
        }
        if row.step.input.acceleration_m_s2.is_some() {
            self.came += 1;
            self.refused += u64::from(health == ChannelHealth::Refused);
        }
    }

    fn warnings(&self) -> Vec<String> {
        let Self { came, used, refused, last_used_s, without_s } = *self;
        let warning = if came < ENOUGH {
            None
        } else if used > 0 && without_s >= LASTS_S {
            Some(format!(
                "warning: longitudinal_acceleration has no usable reading from {last_used_s:.1} s to the end of the log\nhint: check this sensor and its channel; \
                 the estimate goes on without it"
            ))
        } else if 2 * refused > came {
            let warning = "warning: longitudinal_acceleration is not used: most of its readings do not follow the torque at the gearbox input, stay the same, are \
                           beyond 15 m/s^2, or are older than 0.25 s\nhint: check its unit, sign, scale and delay, and that it is the reading of an \
                           accelerometer along the car, which is positive when the car accelerates";
            Some(warning.to_owned())
        } else if used == 0 {
            let warning = "warning: longitudinal_acceleration is not used: in this log the torque at the gearbox input does not change enough in a gear to show that \
                           the readings follow it\nhint: describe the sensor in the file of --sensors, table [sensors.acceleration], to use it from the \
                           first row on";
            Some(warning.to_owned())
        } else {
            None
        };
        warning.into_iter().collect()
    }
}
