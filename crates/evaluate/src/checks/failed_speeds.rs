//! Whether a speed, or the reported engine torque, has no usable reading from some time on: a sensor that has failed, or a channel that ends.

use observer::Reading;

use super::check::{Check, CheckedRow};

/// The speeds, in the order of a row, and the engine torque.
const NAMES: [&str; 5] = ["engine_speed", "turbine_speed", "output_speed", "wheel_speed", "reported_engine_torque"];
/// Place of the torque, which has no shaft that stands.
const TORQUE: usize = 4;
/// Readings that are needed before \[chosen\].
const ENOUGH: u64 = 100;
/// Speed of another shaft from which on the car runs, speed below which a shaft may stand, rad/s, and time in which the car runs after the last
/// reading, s \[chosen\].
const RUNS_RAD_S: f64 = 20.0;
const STANDS_RAD_S: f64 = 1.0;
const LASTS_S: f64 = 5.0;

/// The usable readings of each speed so far.
#[derive(Default)]
pub(super) struct FailedSpeeds {
    speeds: [Usable; 5],
}

/// The usable readings of one of them.
#[derive(Debug, Clone, Copy, Default)]
struct Usable {
    count: u64,
    last_s: f64,
    /// Time in which another shaft has run since, s.
    without_s: f64,
    /// Whether the newest usable reading is zero: a shaft that stands, or a dead sensor.
    stands: bool,
}

impl Check for FailedSpeeds {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let (input, channels) = (&row.step.input, &row.estimate.channels);
        let readings = [
            (input.engine_rad_s, channels.engine),
            (input.turbine_rad_s, channels.turbine),
            (input.output_rad_s, channels.output),
            (input.wheel_rad_s, channels.wheel),
            (row.step.reported_n_m, channels.engine_torque),
        ];
        let usable = readings.map(|(reading, health)| {
            let Reading { value, .. } = reading.filter(|of| of.value.is_finite() && !health.is_refused())?;
            Some(value)
        });
        let turns = |at: usize| at != TORQUE && usable[at].is_some_and(|rad_s: f64| rad_s.abs() > RUNS_RAD_S);
        for (at, speed) in self.speeds.iter_mut().enumerate() {
            match usable[at] {
                Some(rad_s) if rad_s.abs() < STANDS_RAD_S && at != TORQUE => speed.stands = true,
                Some(_) => *speed = Usable { count: speed.count + 1, last_s: row.step.time_s, ..Usable::default() },
                // Of a shaft that stands the next reading may come late; it does not stand while the car moves.
                None => {
                    let others = if speed.stands { 2..4 } else { 0..4 };
                    if others.into_iter().any(|other| other != at && turns(other)) {
                        speed.without_s += input.dt_s.clamp(0.0, 1.0);
                    }
                }
            }
        }
    }

    fn warnings(&self) -> Vec<String> {
        let failed =
            NAMES.iter().zip(&self.speeds).filter(|(_, speed)| speed.count >= ENOUGH && speed.without_s >= LASTS_S);
        failed
            .map(|(name, speed)| {
                format!(
                    "warning: {name} has no usable reading from {:.1} s to the end of the log, and the car goes on\nhint: check this sensor and its \
                     channel; the estimate goes on without it",
                    speed.last_s
                )
            })
            .collect()
    }
}
