//! The newest readings of a speed, without a model: what the decisions about slip are made from. A wrong model could
//! otherwise confirm itself.

use drivetrain::Real;

/// Time between two readings beyond which no line is drawn through them, s.
const LONGEST_S: f64 = 0.05;

/// The newest reading of a speed and the one before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Newest<T> {
    pub(super) value: T,
    pub(super) age_s: T,
    before: Option<(T, T)>,
}

impl<T: Real> Newest<T> {
    /// Takes a reading that is `age_s` old.
    pub(super) fn take(newest: &mut Option<Self>, value: T, age_s: T) {
        let before = newest.map(|newest| (newest.value, newest.age_s)).filter(|&(_, before_s)| before_s > age_s);
        *newest = Some(Self { value, age_s, before });
    }

    /// Lets time pass.
    pub(super) fn pass(&mut self, dt_s: T) {
        self.age_s = self.age_s + dt_s;
        if let Some((_, age_s)) = &mut self.before {
            *age_s = *age_s + dt_s;
        }
    }

    /// The speed a time ago, on the line through both readings.
    pub(super) fn at(&self, age_s: T) -> T {
        match self.before {
            Some((before, before_s)) if before_s - self.age_s <= T::of(LONGEST_S) => {
                self.value + (before - self.value) * (age_s - self.age_s) / (before_s - self.age_s)
            }
            _ => self.value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_lies_on_the_line_through_two_readings() {
        let mut newest = None;
        Newest::take(&mut newest, 100.0, 0.004);
        newest.iter_mut().for_each(|newest| newest.pass(0.01));
        Newest::take(&mut newest, 102.0, 0.004);
        let newest = newest.unwrap();
        assert!((newest.at(0.004) - 102.0_f64).abs() < 1e-9);
        assert!((newest.at(0.009) - 101.0).abs() < 1e-9);
        assert!((newest.at(0.0) - 102.8).abs() < 1e-9);
    }

    #[test]
    fn after_a_pause_the_newest_reading_stands() {
        let mut newest = None;
        Newest::take(&mut newest, 100.0, 0.0);
        newest.iter_mut().for_each(|newest| newest.pass(0.2));
        Newest::take(&mut newest, 200.0, 0.0);
        assert_eq!(newest.map(|newest| newest.at(0.01)), Some(200.0_f64));
    }
}
