//! The newest readings of a speed, without a model: what the decisions about slip are made from. A wrong model could
//! otherwise confirm itself.

use drivetrain::Real;

/// Time between two readings beyond which no line is drawn through them, s.
const LONGEST_S: f64 = 0.05;

/// Rate of an acceleration that a powertrain can have over the time of two readings, rad/s^3 \[chosen\]: a clutch that grips,
/// and the swing of the shafts.
const JERK_RAD_S3: f64 = 10_000.0;
/// Deviations of a reading from the line through the two before it beyond which it is no speed of this shaft.
const DEVIATIONS: f64 = 5.0;

/// The newest reading of a speed and the two before: the other channel may miss two in a row and is still compared at a time
/// that lies between readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Newest<T> {
    pub(super) value: T,
    pub(super) age_s: T,
    /// Values and ages of those before, newer one first.
    before: [Option<(T, T)>; 2],
    /// Whether the last reading was refused: an outlier is single, a jump persists.
    pub(super) refused: bool,
}

impl<T: Real> Newest<T> {
    /// Takes a reading that is `age_s` old, with this standard deviation. Whether it was taken: one that lies off the line
    /// through the two before by more than a powertrain can do is refused once.
    pub(super) fn take(newest: &mut Option<Self>, value: T, age_s: T, deviation: T) -> bool {
        if let Some(newest) = newest
            && newest.is_off(value, age_s, deviation)
            && !newest.refused
        {
            newest.refused = true;
            return false;
        }
        let before = newest
            .filter(|newest| newest.age_s > age_s)
            .map_or([None; 2], |newest| [Some((newest.value, newest.age_s)), newest.before[0]]);
        *newest = Some(Self { value, age_s, before, refused: false });
        true
    }

    fn is_off(&self, value: T, age_s: T, deviation: T) -> bool {
        let Some((_, before_s)) = self.before[0] else { return false };
        let (step_s, line_s) = (self.age_s - age_s, before_s - self.age_s);
        if line_s > T::of(LONGEST_S) || step_s <= T::zero() {
            return false;
        }
        let reach = step_s / line_s;
        // Of the line's end, whose ends err by one deviation each, and of the reading.
        let one = T::one();
        let noise = deviation * ((one + reach) * (one + reach) + reach * reach + one).sqrt();
        let most = T::of(DEVIATIONS) * noise + T::of(JERK_RAD_S3) * step_s * step_s.max(line_s);
        (value - self.at(age_s)).abs() > most
    }

    /// Lets time pass.
    pub(super) fn pass(&mut self, dt_s: T) {
        self.age_s = self.age_s + dt_s;
        for (_, age_s) in self.before.iter_mut().flatten() {
            *age_s = *age_s + dt_s;
        }
    }

    /// The speed a time ago, on the lines through the readings; before the oldest that reading.
    pub(super) fn at(&self, age_s: T) -> T {
        let mut late = (self.value, self.age_s);
        for early in self.before.into_iter().flatten() {
            let span_s = early.1 - late.1;
            if span_s > T::of(LONGEST_S) {
                break;
            }
            if age_s <= early.1 {
                return late.0 + (early.0 - late.0) * (age_s - late.1) / span_s;
            }
            late = early;
        }
        late.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_lies_on_the_line_through_two_readings() {
        let mut newest = None;
        assert!(Newest::take(&mut newest, 100.0, 0.004, 0.1));
        newest.iter_mut().for_each(|newest| newest.pass(0.01));
        assert!(Newest::take(&mut newest, 102.0, 0.004, 0.1));
        let newest = newest.unwrap();
        assert!((newest.at(0.004) - 102.0_f64).abs() < 1e-9);
        assert!((newest.at(0.009) - 101.0).abs() < 1e-9);
        assert!((newest.at(0.0) - 102.8).abs() < 1e-9);
        assert_eq!(newest.at(0.02), 100.0);
    }

    #[test]
    fn after_a_pause_the_newest_reading_stands() {
        let mut newest = None;
        assert!(Newest::take(&mut newest, 100.0, 0.0, 0.1));
        newest.iter_mut().for_each(|newest| newest.pass(0.2));
        assert!(Newest::take(&mut newest, 200.0, 0.0, 0.1));
        assert_eq!(newest.map(|newest| newest.at(0.01)), Some(200.0_f64));
    }

    #[test]
    fn an_outlier_is_refused_and_a_jump_is_taken_at_the_second_reading() {
        let mut newest = None;
        let mut read = |value: f64| {
            newest.iter_mut().for_each(|newest: &mut Newest<f64>| newest.pass(0.01));
            Newest::take(&mut newest, value, 0.0, 0.1)
        };
        for value in [100.0, 101.0, 102.0] {
            assert!(read(value));
        }
        assert!(!read(108.0) && read(104.0) && read(105.0));
        assert!(!read(150.0) && read(151.0));
    }

    #[test]
    fn a_clutch_that_grips_is_no_outlier() {
        let mut newest = None;
        for value in [300.0, 297.0, 294.0, 292.5, 292.6, 292.8] {
            newest.iter_mut().for_each(|newest: &mut Newest<f64>| newest.pass(0.01));
            assert!(Newest::take(&mut newest, value, 0.0, 0.1), "{value}");
        }
    }
}
