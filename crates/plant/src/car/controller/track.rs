//! A speed and its rate from readings.

use drivetrain::Real;

/// A filter of second order that follows a speed without a lag behind its rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Track {
    time_constant_s: f64,
    /// Speed, rad/s, once there is a reading.
    speed_rad_s: Option<f64>,
    /// Its rate, rad/s^2.
    pub(super) rate_rad_s2: f64,
}

impl Track {
    pub(super) fn new(time_constant_s: f64) -> Self {
        Self { time_constant_s, speed_rad_s: None, rate_rad_s2: 0.0 }
    }

    /// The speed, rad/s.
    pub(super) fn speed_rad_s(&self) -> f64 {
        self.speed_rad_s.unwrap_or(0.0)
    }

    /// Takes the reading at the end of a period.
    pub(super) fn follow(&mut self, reading_rad_s: f64, period_s: f64) {
        let Some(speed) = self.speed_rad_s else {
            self.speed_rad_s = Some(reading_rad_s);
            return;
        };
        // Both poles at exp(-period/time constant).
        let pole = Real::exp(-period_s / self.time_constant_s);
        let predicted = speed + self.rate_rad_s2 * period_s;
        let error = reading_rad_s - predicted;
        self.speed_rad_s = Some(predicted + (1.0 - pole * pole) * error);
        self.rate_rad_s2 += (1.0 - pole) * (1.0 - pole) / period_s * error;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rising_speed_is_followed_without_lag() {
        let mut track = Track::new(0.04);
        let speed = |n: u32| 100.0 + 30.0 * 0.01 * f64::from(n);
        (0..100).for_each(|n| track.follow(speed(n), 0.01));
        assert!((track.speed_rad_s() - speed(99)).abs() < 1e-6 && (track.rate_rad_s2 - 30.0).abs() < 1e-6);
    }
}
