//! The newest readings of a speed, without a model: what the decisions about slip are made from. A wrong model could
//! otherwise confirm itself.

use drivetrain::Real;

/// Time between two readings beyond which no line is drawn through them, s.
const LONGEST_S: f64 = 0.05;

/// Rate of an acceleration that a powertrain can have over the time of two readings, rad/s^3 \[chosen\]: a clutch that grips,
/// and the swing of the shafts.
const JERK_RAD_S3: f64 = 10_000.0;
/// By how much a speed may bend away from the line through the oldest readings where it is carried on before them, rad/s \[chosen\]:
/// less than the threshold of a slip.
const BENT_RAD_S: f64 = 0.3;
/// Standard deviations of a reading from the line through the two before it beyond which it is no speed of this shaft.
const STD_DEVS: f64 = 5.0;

/// The newest reading of a speed and the two before: the other channel may miss two in a row and is still compared at a time
/// that lies between readings.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Newest<T> {
    pub(super) value: T,
    pub(super) age_s: T,
    /// By how much it may be older or newer, s.
    late_s: T,
    /// Values and ages of those before, newer one first.
    before: [Option<(T, T)>; 2],
    /// By how much the reading before may be older or newer, s.
    before_late_s: T,
    /// Whether the last reading was refused: an outlier is single, a jump persists.
    pub(super) refused: bool,
}

/// A speed now, from the line through the two newest readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpeedNow<T> {
    pub(super) value: T,
    /// Its standard deviation by those of the readings.
    pub(super) std_dev: T,
    /// By how much it errs at most beside them: the speed bends, and the readings are of other times.
    pub(super) drift: T,
}

impl<T: Real> Newest<T> {
    /// Takes a reading that is `age_s` old up to `late_s`, with this standard deviation. Whether it was taken: one that lies off the line
    /// through the two before by more than a powertrain can do is refused once.
    pub(super) fn take(newest: &mut Option<Self>, value: T, [age_s, late_s]: [T; 2], std_dev: T) -> bool {
        if let Some(newest) = newest
            && newest.is_off(value, age_s, std_dev)
            && !newest.refused
        {
            newest.refused = true;
            return false;
        }
        let before = newest
            .filter(|newest| newest.age_s > age_s)
            .map_or([None; 2], |newest| [Some((newest.value, newest.age_s)), newest.before[0]]);
        let before_late_s = newest.map_or(T::zero(), |newest| newest.late_s);
        *newest = Some(Self { value, age_s, late_s, before, before_late_s, refused: false });
        true
    }

    fn is_off(&self, value: T, age_s: T, std_dev: T) -> bool {
        let Some((_, before_s)) = self.before[0] else { return false };
        let (step_s, line_s) = (self.age_s - age_s, before_s - self.age_s);
        if line_s > T::of(LONGEST_S) || step_s <= T::zero() {
            return false;
        }
        let distance = (value - self.at(age_s)).abs() - T::of(JERK_RAD_S3) * step_s * step_s.at_least(line_s);
        if distance <= T::zero() {
            return false;
        }
        let reach = step_s / line_s;
        // Of the line's end, whose ends err by one standard deviation each, and of the reading.
        let one = T::one();
        let noise = std_dev * ((one + reach) * (one + reach) + reach * reach + one).sqrt();
        distance > T::of(STD_DEVS) * noise
    }

    /// Takes the readings times a factor.
    pub(super) fn scale(&mut self, factor: T) {
        self.value = factor * self.value;
        for (value, _) in self.before.iter_mut().flatten() {
            *value = factor * *value;
        }
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
        if age_s == self.age_s {
            return self.value;
        }
        let mut late = (self.value, self.age_s);
        for early in self.before.into_iter().flatten() {
            let span_s = early.1 - late.1;
            if span_s > T::of(LONGEST_S) {
                break;
            }
            // Readings of one time are no line.
            if age_s <= early.1 && span_s > T::zero() {
                return late.0 + (early.0 - late.0) * (age_s - late.1) / span_s;
            }
            late = early;
        }
        late.0
    }

    /// The speed a time ago as [`at`](Self::at); none where it is too far before the oldest reading.
    pub(super) fn reached(&self, age_s: T) -> Option<T> {
        let [near, far] = self.before;
        let (oldest, next) = match (near, far) {
            (Some(near), Some(far)) if far.1 - near.1 <= T::of(LONGEST_S) => (far, near),
            (Some(near), _) if near.1 - self.age_s <= T::of(LONGEST_S) => (near, (self.value, self.age_s)),
            _ => return (age_s <= self.age_s).then_some(self.value),
        };
        let (beyond_s, span_s) = (age_s - oldest.1, oldest.1 - next.1);
        if beyond_s <= T::zero() {
            return Some(self.at(age_s));
        }
        let bent = T::of(0.5 * JERK_RAD_S3) * beyond_s * (beyond_s + span_s);
        (bent <= T::of(BENT_RAD_S)).then(|| oldest.0 + (oldest.0 - next.0) / span_s * beyond_s)
    }

    /// Rate between the two newest readings, rad/s^2, and the time between them, s; none where they are far apart.
    pub(super) fn rate(&self) -> Option<(T, T)> {
        let (early, early_s) = self.before[0]?;
        let span_s = early_s - self.age_s;
        (span_s > T::zero() && span_s <= T::of(LONGEST_S)).then(|| ((self.value - early) / span_s, span_s))
    }

    /// The speed now; `None` without a line, where the newest reading may be older than `longest_s`, where a toothed wheel may turn
    /// at less than half of it, or after a refused one: a clutch that grips hard looks so, and the line does not show it.
    ///
    /// An acceleration that changes by at most `j` leads away from a line through two readings that are `a` and `b` old by at
    /// most `j a b / 2`. An age that errs by `e` changes the value of its reading by the rate times `e`.
    pub(super) fn now(&self, std_dev: T, longest_s: T) -> Option<SpeedNow<T>> {
        let (early, early_s) = self.before[0].filter(|_| !self.refused)?;
        let (age_s, span_s) = (self.age_s + self.late_s, early_s - self.age_s);
        if !(age_s <= longest_s && span_s <= T::of(LONGEST_S)) {
            return None;
        }
        let (one, half) = (T::one(), T::of(0.5));
        let (rate, reach) = ((self.value - early) / span_s, self.age_s / span_s);
        let bent = half * T::of(JERK_RAD_S3) * age_s * (early_s + self.before_late_s);
        let late = rate.abs() * ((one + reach) * self.late_s + reach * self.before_late_s);
        let (value, drift) = (self.value + rate * self.age_s, bent + late);
        // The spread of the ages is that of a wheel that turns at half its reading or faster.
        let turns = value.abs() - drift >= half * self.value.abs() || self.late_s <= T::zero();
        turns.then(|| SpeedNow {
            value,
            std_dev: std_dev * ((one + reach) * (one + reach) + reach * reach).sqrt(),
            drift,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_lies_on_the_line_through_two_readings() {
        let mut newest = None;
        assert!(Newest::take(&mut newest, 100.0, [0.004, 0.0], 0.1));
        newest.iter_mut().for_each(|newest| newest.pass(0.01));
        assert!(Newest::take(&mut newest, 102.0, [0.004, 0.0], 0.1));
        let newest = newest.unwrap();
        assert!((newest.at(0.004) - 102.0_f64).abs() < 1e-9);
        assert!((newest.at(0.009) - 101.0).abs() < 1e-9);
        assert!((newest.at(0.0) - 102.8).abs() < 1e-9);
        assert_eq!(newest.at(0.02), 100.0);
    }

    #[test]
    fn readings_whose_ages_have_become_equal_are_no_line() {
        let mut newest = None;
        for value in [100.0_f32, 102.0] {
            newest.iter_mut().for_each(|newest: &mut Newest<f32>| newest.pass(0.01));
            assert!(Newest::take(&mut newest, value, [0.004, 0.0], 0.1));
        }
        let mut newest = newest.unwrap();
        newest.pass(1e6);
        assert_eq!(newest.at(1e5), 100.0);
    }

    #[test]
    fn before_the_oldest_reading_the_line_reaches_as_far_as_it_is_sure() {
        let mut newest = None;
        for value in [100.0, 101.0, 103.0] {
            newest.iter_mut().for_each(|newest: &mut Newest<f64>| newest.pass(0.01));
            assert!(Newest::take(&mut newest, value, [0.004, 0.0], 0.1));
        }
        let newest = newest.unwrap();
        // Ages 4, 14 and 24 ms. An acceleration that changes by 10,000 rad/s^3 bends by 0.28 rad/s over 4 ms behind 10 ms.
        assert_eq!(newest.reached(0.014), Some(101.0));
        assert!((newest.reached(0.028).unwrap() - 99.6).abs() < 1e-9);
        assert_eq!(newest.reached(0.029), None);
        assert_eq!(newest.at(0.035), 100.0);
    }

    #[test]
    fn after_a_pause_the_newest_reading_stands() {
        let mut newest = None;
        assert!(Newest::take(&mut newest, 100.0, [0.0, 0.0], 0.1));
        newest.iter_mut().for_each(|newest| newest.pass(0.2));
        assert!(Newest::take(&mut newest, 200.0, [0.0, 0.0], 0.1));
        assert_eq!(newest.map(|newest| newest.at(0.01)), Some(200.0_f64));
    }

    #[test]
    fn an_outlier_is_refused_and_a_jump_is_taken_at_the_second_reading() {
        let mut newest = None;
        let mut read = |value: f64| {
            newest.iter_mut().for_each(|newest: &mut Newest<f64>| newest.pass(0.01));
            Newest::take(&mut newest, value, [0.0, 0.0], 0.1)
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
            assert!(Newest::take(&mut newest, value, [0.0, 0.0], 0.1), "{value}");
        }
    }

    /// Takes a reading without noise after 10 ms, that is as old as it says.
    fn read(newest: &mut Option<Newest<f64>>, value: f64) -> bool {
        newest.iter_mut().for_each(|newest| newest.pass(0.01));
        Newest::take(newest, value, [0.005, 0.0], 0.1)
    }

    #[test]
    fn a_speed_that_bends_is_within_its_drift_of_the_line() {
        // 300 rad/s^2 that grow by the bound of the rate.
        let speed = |t: f64| 200.0 - 300.0 * t - 0.5 * JERK_RAD_S3 * t * t;
        let mut newest = None;
        for i in 0..10 {
            let t = 0.01 * f64::from(i);
            assert!(read(&mut newest, speed(t - 0.005)));
            let now = newest.and_then(|newest| newest.now(0.1, 0.05));
            let Some(now) = now else { continue };
            let error = (speed(t) - now.value).abs();
            assert!(error > 0.3 && error <= now.drift + 1e-9, "{t}: {error} {now:?}");
        }
        assert!(newest.is_some_and(|newest| newest.now(0.1, 0.05).is_some()));
    }

    #[test]
    fn without_a_line_there_is_no_speed_now() {
        let now = |newest: Option<Newest<f64>>| newest.and_then(|newest| newest.now(0.1, 0.05));
        let mut newest = None;
        assert!(read(&mut newest, 100.0) && now(newest).is_none());
        assert!(read(&mut newest, 101.0) && now(newest).is_some());
        assert!(!read(&mut newest, 150.0) && now(newest).is_none());
        assert!(read(&mut newest, 103.0) && now(newest).is_some());
        newest.iter_mut().for_each(|newest| newest.pass(0.06));
        assert!(now(newest).is_none(), "too old");
        assert!(read(&mut newest, 104.0) && now(newest).is_none(), "after a pause");
        let mut stops = None;
        for (value, late_s) in [(24.0, 0.002), (20.0, 0.002), (16.0, 0.002), (12.0, 0.002)] {
            stops.iter_mut().for_each(|newest: &mut Newest<f64>| newest.pass(0.01));
            assert!(Newest::take(&mut stops, value, [0.02, late_s], 0.1));
        }
        assert!(now(stops).is_none(), "it may stand");
        let mut still = None;
        for _ in 0..3 {
            still.iter_mut().for_each(|newest: &mut Newest<f64>| newest.pass(0.01));
            assert!(Newest::take(&mut still, 0.0, [0.02, f64::INFINITY], 0.1) && now(still).is_none());
        }
    }
}
