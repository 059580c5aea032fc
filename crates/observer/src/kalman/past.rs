//! The speeds at a few earlier times: readings are older than the step that they come with.

use drivetrain::Real;

use super::covariance::{ALL, speed_at};

/// Earlier times that are remembered.
pub(super) const PASTS: usize = 2;
/// Turbine, output and wheel.
pub(super) const SPEEDS: usize = 3;
/// Remembered speeds.
pub(super) const CLONES: usize = PASTS * SPEEDS;
/// Time after which the speeds are remembered again, s: no multiple of a usual sample time, so that rounding does not decide.
/// Most readings are less than twice that old.
pub(super) const EVERY_S: f64 = 0.0087;
/// Least time over which an acceleration is taken, s.
const LEAST_SPAN_S: f64 = 0.0047;

/// The speeds at one time, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point<T> {
    age_s: T,
    speeds: [T; SPEEDS],
}

/// The speeds at the earlier times, the newest first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Past<T> {
    points: [Point<T>; PASTS],
}

/// A time between two of `now` and the earlier times, which are counted from 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place<T> {
    /// The one after it, and the one before it.
    pub(super) between: [usize; 2],
    /// How much of each.
    pub(super) shares: [T; 2],
    /// Time between the two, s.
    pub(super) width_s: T,
    /// How much older it is than the oldest, s.
    pub(super) beyond_s: T,
}

impl<T> Place<T> {
    /// Whether it is between now and the newest.
    #[inline]
    pub(super) fn is_recent(&self) -> bool {
        self.between[0] == 0
    }
}

impl<T: Real> Past<T> {
    /// As it would be with accelerations that have stood for long.
    pub(super) fn steady(speeds: [T; SPEEDS], accelerations: [T; SPEEDS]) -> Self {
        let mut age_s = T::zero();
        let points = core::array::from_fn(|_| {
            age_s = age_s + T::of(EVERY_S);
            Point { age_s, speeds: core::array::from_fn(|k| speeds[k] - age_s * accelerations[k]) }
        });
        Self { points }
    }

    /// Lets time pass.
    #[inline]
    pub(super) fn pass(&mut self, dt_s: T) {
        for point in &mut self.points {
            point.age_s = point.age_s + dt_s;
        }
    }

    /// Whether the newest is old enough for the speeds to be remembered again.
    #[inline]
    pub(super) fn is_due(&self) -> bool {
        self.points[0].age_s >= T::of(EVERY_S)
    }

    /// Remembers the speeds of now; the oldest are forgotten.
    #[inline]
    pub(super) fn remember(&mut self, speeds: [T; SPEEDS]) {
        for n in (1..PASTS).rev() {
            self.points[n] = self.points[n - 1];
        }
        self.points[0] = Point { age_s: T::zero(), speeds };
    }

    /// Ages, s.
    pub(super) fn ages(&self) -> [T; PASTS] {
        core::array::from_fn(|n| self.points[n].age_s)
    }

    /// Moves the remembered speeds, in the order of [`speed_at`], by a gain each times an innovation.
    #[inline]
    pub(super) fn correct(&mut self, gains: &[T; ALL], innovation: T) {
        for (n, point) in self.points.iter_mut().enumerate() {
            for (k, speed) in point.speeds.iter_mut().enumerate() {
                *speed = *speed + gains[speed_at(k, n + 1)] * innovation;
            }
        }
    }

    /// The speed `k` at a point, counted from 0 for now.
    #[inline]
    pub(super) fn speed(&self, k: usize, now: T, point: usize) -> T {
        match point.checked_sub(1).and_then(|n| self.points.get(n)) {
            Some(point) => point.speeds[k],
            None => now,
        }
    }

    /// Accelerations of the speed `k`, rad/s^2: now, and over the time before.
    #[inline]
    pub(super) fn accelerations(&self, k: usize, now: T) -> [T; 2] {
        let [newest, oldest] = &self.points;
        let over =
            |late: T, early: &Point<T>, span_s: T| (late - early.speeds[k]) / span_s.at_least(T::of(LEAST_SPAN_S));
        let before = over(newest.speeds[k], oldest, oldest.age_s - newest.age_s);
        let after = if newest.age_s >= T::of(LEAST_SPAN_S) { newest } else { oldest };
        [over(now, after, after.age_s), before]
    }

    /// Where a time is that was `age_s` ago.
    #[inline]
    pub(super) fn place(&self, age_s: T) -> Place<T> {
        let zero = T::zero();
        let mut after = (0, zero);
        for (n, point) in self.points.iter().enumerate() {
            if age_s <= point.age_s {
                let width_s = point.age_s - after.1;
                let share = if width_s > zero { (age_s - after.1) / width_s } else { zero };
                return Place { between: [after.0, n + 1], shares: [T::one() - share, share], width_s, beyond_s: zero };
            }
            after = (n + 1, point.age_s);
        }
        let width_s = self.points[PASTS - 1].age_s - self.points[PASTS - 2].age_s;
        Place { between: [PASTS - 1, PASTS], shares: [zero, T::one()], width_s, beyond_s: age_s - after.1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_lies_between_the_points_around_it() {
        let mut past = Past::<f64>::steady([100.0, 50.0, 10.0], [1000.0, 0.0, -100.0]);
        assert_eq!(past.ages(), [0.0087, 0.0174]);
        past.remember([100.0, 50.0, 10.0]);
        past.pass(0.01);
        let speed = |k: usize, now: f64, age_s: f64| {
            let place = past.place(age_s);
            let [a, b] = place.between.map(|point| past.speed(k, now, point));
            place.shares[0] * a + place.shares[1] * b
        };
        assert!((speed(0, 110.0, 0.0) - 110.0).abs() < 1e-9);
        assert!((speed(0, 110.0, 0.005) - 105.0).abs() < 1e-9);
        assert!((speed(0, 110.0, 0.015) - 95.0).abs() < 1e-9);
        assert!((speed(2, 9.0, 0.0187) - 10.87).abs() < 1e-9);
        let place = past.place(0.03);
        assert!((place.beyond_s - 0.0113).abs() < 1e-9 && place.between[1] == PASTS, "{place:?}");
        assert!((past.accelerations(0, 110.0)[0] - 1000.0).abs() < 1e-6);
    }
}
