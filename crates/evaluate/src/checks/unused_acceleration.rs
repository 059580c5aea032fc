//! A longitudinal acceleration that the filter does not use.

use observer::ChannelHealth;

use super::check::{Check, CheckedRow};

/// Readings from which on it is said \[chosen\].
const ENOUGH: u64 = 50;

/// What became of the readings so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct UnusedAcceleration {
    came: u64,
    used: u64,
    refused: u64,
}

impl Check for UnusedAcceleration {
    fn row(&mut self, row: &CheckedRow<'_>) {
        if row.step.input.acceleration_m_s2.is_none() {
            return;
        }
        self.came += 1;
        match row.estimate.channels.acceleration {
            ChannelHealth::Good => self.used += 1,
            ChannelHealth::Refused => self.refused += 1,
            _ => {}
        }
    }

    fn warnings(&self) -> Vec<String> {
        let Self { came, used, refused } = *self;
        let warning = if came < ENOUGH {
            None
        } else if 2 * refused > came {
            Some(
                "warning: longitudinal_acceleration is not used: most of its readings do not follow the torque at the gearbox input, stand, or are beyond \
                 15 m/s^2\nhint: check its unit, sign and scale, and that it is the reading of an accelerometer along the car, which is positive when the \
                 car accelerates",
            )
        } else if used == 0 {
            Some(
                "warning: longitudinal_acceleration is not used: in this log the torque at the gearbox input does not change enough in a gear to show that the \
                 readings follow it\nhint: describe the sensor in the file of --sensors, table [sensors.acceleration], to use it from the first row on",
            )
        } else {
            None
        };
        warning.map(str::to_owned).into_iter().collect()
    }
}
