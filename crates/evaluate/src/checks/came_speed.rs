//! A speed on its way through a log.

use car::LOST_S;

/// The newest reading of a speed, as long as it says something of the car: a channel that dies leaves its last reading.
#[derive(Debug, Clone, Copy, Default)]
pub struct CameSpeed {
    /// The speed, rad/s, and when it came, s.
    newest: Option<[f64; 2]>,
}

impl CameSpeed {
    /// Takes a reading.
    pub fn push(&mut self, time_s: f64, rad_s: f64) {
        self.newest = Some([rad_s, time_s]);
    }

    /// The speed at this time, rad/s; not a number where none came for as long as makes a channel lost.
    pub fn at(&self, time_s: f64) -> f64 {
        let of_late = self.newest.filter(|[_, came_s]| time_s - came_s <= LOST_S);
        of_late.map_or(f64::NAN, |[rad_s, _]| rad_s)
    }

    /// Whether there was a reading.
    pub fn has_come(&self) -> bool {
        self.newest.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::CameSpeed;

    #[test]
    fn a_speed_that_came_too_long_ago_is_none() {
        let mut came = CameSpeed::default();
        assert!(came.at(0.0).is_nan() && !came.has_come());
        came.push(1.0, 80.0);
        assert!(came.at(1.0) == 80.0 && came.at(1.2) == 80.0);
        assert!(came.at(1.3).is_nan() && came.has_come());
    }
}
