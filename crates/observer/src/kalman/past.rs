//! The speeds at two earlier times: readings are older than the step that they come with.

use drivetrain::Real;

use super::covariance::Moves;

/// Turbine, output and wheel.
pub(super) const SPEEDS: usize = 3;
/// Time after which the speeds are remembered again, s: no multiple of a usual sample time, so that rounding does not decide.
/// Most readings are less than twice that old.
const EVERY_S: f64 = 0.0087;
/// Minimum time over which an acceleration is taken, s.
const MIN_SPAN_S: f64 = 0.0047;

/// The speeds at two earlier times. The covariance has those of the newer one; those of the older one err alike.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Past<T> {
    /// Age of the newer ones, s.
    age_s: T,
    /// The newer ones, rad/s.
    speeds: [T; SPEEDS],
    /// How much older the others are, s.
    span_s: T,
    /// How the speeds have changed from the older to the newer, rad/s.
    changes: [T; SPEEDS],
}

/// A speed a time ago, on the line between the two of now and the earlier times around that, or through both earlier ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Then<T> {
    /// The speed, rad/s.
    pub(super) value: T,
    /// Slope of the line, rad/s^2.
    pub(super) acceleration: T,
    /// By how much a parabola differs from the line, per change of the acceleration from one interval to the next, s.
    pub(super) bend_s: T,
    /// How much older than the oldest it is, s.
    pub(super) beyond_s: T,
}

/// A time on the line through now and the newer of the earlier times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OnLine<T> {
    /// How much of now, and of the earlier time.
    pub(super) fractions: [T; 2],
    /// How many times the length of the line it is behind its end: zero where the line reaches it.
    pub(super) beyond: T,
}

impl<T: Real> Past<T> {
    /// As it would be with accelerations that have stood for long.
    pub(super) fn steady(speeds: [T; SPEEDS], accelerations: [T; SPEEDS]) -> Self {
        let age_s = T::of(EVERY_S);
        let changes = accelerations.map(|acceleration| age_s * acceleration);
        Self { age_s, speeds: core::array::from_fn(|k| speeds[k] - changes[k]), span_s: age_s, changes }
    }

    /// Lets time pass.
    #[inline]
    pub(super) fn pass(&mut self, dt_s: T) {
        self.age_s = self.age_s + dt_s;
    }

    /// Whether the newer ones are old enough for the speeds to be remembered again by the next step.
    #[inline]
    pub(super) fn is_due(&self) -> bool {
        self.age_s >= T::of(EVERY_S)
    }

    /// Age of the newer ones, s.
    #[inline]
    pub(super) fn age_s(&self) -> T {
        self.age_s
    }

    /// Remembers the speeds of now; the oldest are forgotten.
    #[inline]
    pub(super) fn remember(&mut self, speeds: [T; SPEEDS]) {
        let changes = core::array::from_fn(|k| speeds[k] - self.speeds[k]);
        *self = Self { age_s: T::zero(), speeds, span_s: self.age_s, changes };
    }

    /// Corrects the remembered speeds. The older ones move as the newer, with which they have most of their error in common.
    #[inline]
    pub(super) fn correct(&mut self, moves: &Moves<T>) {
        for (speed, by) in self.speeds.iter_mut().zip(&moves.earlier) {
            *speed = *speed + *by;
        }
    }

    /// The speed `k` of which the one now is given, `age_s` ago.
    #[inline]
    pub(super) fn then(&self, k: usize, now: T, age_s: T) -> Then<T> {
        let (zero, one, half) = (T::zero(), T::one(), T::of(0.5));
        let slope = |change: T, width_s: T| if width_s > zero { change / width_s } else { zero };
        if age_s <= self.age_s {
            let acceleration = slope(now - self.speeds[k], self.age_s);
            let bend_s = half * age_s * (one - slope(age_s, self.age_s));
            return Then { value: now - age_s * acceleration, acceleration, bend_s, beyond_s: zero };
        }
        let acceleration = slope(self.changes[k], self.span_s);
        let before_s = age_s - self.age_s;
        let (within_s, beyond_s) = (before_s.at_most(self.span_s), (before_s - self.span_s).at_least(zero));
        let bend_s = half * (within_s * (one - slope(within_s, self.span_s)) + beyond_s);
        Then { value: self.speeds[k] - before_s * acceleration, acceleration, bend_s, beyond_s }
    }

    /// The line through now and the newer ones, carried on as far as `age_s` ago. Where the two are too near to each other it
    /// ends there, and now if the covariance of the newer ones is not `kept`: at a second reading of one time.
    #[inline]
    pub(super) fn on_line(&self, age_s: T, kept: bool) -> OnLine<T> {
        let (zero, one) = (T::zero(), T::one());
        let fraction = if self.age_s > zero { age_s / self.age_s } else { zero };
        let reached = match kept {
            false => zero,
            true if self.age_s < T::of(MIN_SPAN_S) => fraction.at_most(one),
            true => fraction,
        };
        OnLine { fractions: [one - reached, reached], beyond: fraction - reached }
    }

    /// Accelerations of the speed `k`, rad/s^2: now, and over the time before.
    #[inline]
    pub(super) fn accelerations(&self, k: usize, now: T) -> [T; 2] {
        let min_s = T::of(MIN_SPAN_S);
        let (mut change, mut span_s) = (now - self.speeds[k], self.age_s);
        if span_s < min_s {
            (change, span_s) = (change + self.changes[k], span_s + self.span_s);
        }
        [change / span_s.at_least(min_s), self.changes[k] / self.span_s.at_least(min_s)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_lies_between_the_times_around_it() {
        let mut past = Past::<f64>::steady([100.0, 50.0, 10.0], [1000.0, 0.0, -100.0]);
        assert_eq!((past.age_s, past.span_s), (0.0087, 0.0087));
        assert!((past.then(0, 100.0, 0.015).value - 85.0).abs() < 1e-9);
        past.remember([100.0, 50.0, 10.0]);
        past.pass(0.01);
        let speed = |k: usize, now: f64, age_s: f64| past.then(k, now, age_s).value;
        assert!((speed(0, 110.0, 0.0) - 110.0).abs() < 1e-9);
        assert!((speed(0, 110.0, 0.005) - 105.0).abs() < 1e-9);
        assert!((speed(0, 110.0, 0.015) - 95.0).abs() < 1e-9);
        assert!((speed(2, 9.0, 0.0187) - 10.87).abs() < 1e-9);
        let then = past.then(2, 9.0, 0.03);
        assert!((then.beyond_s - 0.0113).abs() < 1e-9 && (then.value - 12.0).abs() < 1e-9, "{then:?}");
        // A parabola `j t^2/2` over intervals of 10 ms: the acceleration changes by `0.01 j`, and in the middle of an interval
        // the line is `j 0.01^2/8` off.
        assert!((0.01 * past.then(0, 110.0, 0.005).bend_s - 0.01 * 0.01 / 8.0).abs() < 1e-12);
        assert!((past.accelerations(0, 110.0)[0] - 1000.0).abs() < 1e-6);
    }

    #[test]
    fn the_line_through_now_and_the_earlier_time_reaches_as_far_as_it_may() {
        let mut past = Past::<f64>::steady([100.0, 50.0, 10.0], [0.0; 3]);
        past.remember([100.0, 50.0, 10.0]);
        past.pass(0.002);
        assert_eq!(past.on_line(0.001, true), OnLine { fractions: [0.5, 0.5], beyond: 0.0 });
        // Two milliseconds tell no acceleration.
        assert_eq!(past.on_line(0.006, true), OnLine { fractions: [0.0, 1.0], beyond: 2.0 });
        assert_eq!(past.on_line(0.006, false), OnLine { fractions: [1.0, 0.0], beyond: 3.0 });
        past.pass(0.008);
        assert_eq!(past.on_line(0.02, true), OnLine { fractions: [-1.0, 2.0], beyond: 0.0 });
    }
}
