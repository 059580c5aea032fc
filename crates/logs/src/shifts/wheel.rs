//! The output speed by the wheels, while the output's own does not come or is refused.

/// Readings of both are compared that are no further apart, s.
const FRESH_S: f64 = 0.05;
/// Where the output has not come for so long, the wheels stand for it, s: longer than the time between two readings of a slow channel.
const ABSENT_S: f64 = 0.12;
/// Below this output speed a ratio says nothing, rad/s.
const OUTPUT_MIN_RAD_S: f64 = 8.0;
/// Part of a new ratio in the mean one: wheels twist and slip against the output for some tenths of a second.
const NEW: f64 = 0.02;

/// What the output turns by the wheels.
#[derive(Debug, Default)]
pub(super) struct Wheel {
    /// The newest output speed: time and value.
    output: Option<(f64, f64)>,
    /// Output over wheel speed.
    ratio: Option<f64>,
}

impl Wheel {
    pub(super) fn output(&mut self, time_s: f64, rad_s: f64) {
        self.output = Some((time_s, rad_s));
    }

    /// Takes a wheel speed. The output speed by it, rad/s, where the output's own is absent and turned with the wheels before.
    pub(super) fn wheel(&mut self, time_s: f64, rad_s: f64) -> Option<f64> {
        let (read_s, output_rad_s) = self.output?;
        if (time_s - read_s).abs() <= FRESH_S && output_rad_s > OUTPUT_MIN_RAD_S && rad_s > 0.0 {
            let new = output_rad_s / rad_s;
            self.ratio = Some(self.ratio.map_or(new, |mean| mean + NEW * (new - mean)));
        }
        self.ratio.filter(|_| time_s - read_s > ABSENT_S).map(|ratio| ratio * rad_s)
    }
}

#[cfg(test)]
mod tests {
    use super::Wheel;

    #[test]
    fn the_wheels_stand_for_the_output_while_it_is_absent() {
        let mut wheel = Wheel::default();
        assert_eq!(wheel.wheel(0.0, 10.0), None);
        for step in 1..=200 {
            let time_s = 0.01 * f64::from(step);
            wheel.output(time_s, 30.0);
            assert_eq!(wheel.wheel(time_s, 10.0), None);
        }
        assert_eq!(wheel.wheel(2.1, 20.0), None);
        assert!((wheel.wheel(2.2, 20.0).unwrap() - 60.0).abs() < 1e-9);
        wheel.output(2.3, 60.0);
        assert_eq!(wheel.wheel(2.31, 20.0), None);
    }
}
