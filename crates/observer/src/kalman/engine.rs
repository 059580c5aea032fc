//! The engine's speed at any time, from its readings: a filter of speed and acceleration.

use drivetrain::Real;

use super::gate::{Gate, Verdict};
use crate::InputLimits;

/// Time without a reading after which the acceleration is taken to fade, and in which it does, s.
const SILENT_S: f64 = 0.05;
/// Time without a reading after which its error is one that lasts, and no noise, s: longer than from one reading to the next.
const LATE_S: f64 = 0.025;

/// Innovation beyond which a reading is refused, in its standard deviations: fewer than for the other speeds, as nothing else tells
/// the engine speed, and it is the turbine torque within the same step.
const GATE: u8 = 3;

/// What the engine's filter knows beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EngineNoise<T> {
    /// Standard deviation of a reading, rad/s.
    pub reading_rad_s: T,
    /// How the acceleration changes: random walk, rad/s^2 per root second.
    pub acceleration_walk: T,
    /// Largest size of an acceleration, rad/s^2.
    pub acceleration_max_rad_s2: T,
}

impl<T: Real> EngineNoise<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> EngineNoise<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        EngineNoise {
            reading_rad_s: to(self.reading_rad_s),
            acceleration_walk: to(self.acceleration_walk),
            acceleration_max_rad_s2: to(self.acceleration_max_rad_s2),
        }
    }
}

/// Memory of the engine's filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Engine<T> {
    /// Speed, rad/s, and acceleration, rad/s^2.
    mean: [T; 2],
    /// Variances of both, and their covariance.
    speed_variance: T,
    covariance: T,
    acceleration_variance: T,
    gate: Gate,
    /// Time since the last reading that was taken, s.
    pub(crate) silent_s: T,
}

impl<T: Real> Engine<T> {
    /// Begins with a reading.
    pub(crate) fn new(speed_rad_s: T, noise: &EngineNoise<T>) -> Self {
        let zero = T::zero();
        Self {
            mean: [speed_rad_s, zero],
            speed_variance: noise.reading_rad_s * noise.reading_rad_s,
            covariance: zero,
            acceleration_variance: noise.acceleration_max_rad_s2 * noise.acceleration_max_rad_s2,
            gate: Gate::new(GATE),
            silent_s: zero,
        }
    }

    /// Speed a time ago, rad/s.
    #[inline]
    pub(crate) fn speed_before(&self, time_s: T) -> T {
        self.mean[0] - time_s * self.mean[1]
    }

    /// Acceleration, rad/s^2, and its standard deviation.
    #[inline]
    pub(crate) fn acceleration(&self) -> (T, T) {
        (self.mean[1], self.acceleration_variance.at_least(T::zero()).sqrt())
    }

    /// Variance of the speed now, (rad/s)^2.
    #[inline]
    pub(crate) fn variance(&self) -> T {
        self.speed_variance
    }

    /// For how long the speed has had one error, s, where that is longer than from one reading to the next. What it moves has a
    /// variance that grows with the square of this time, by `2 dt` of it in a step.
    #[inline]
    pub(crate) fn same_error_s(&self) -> Option<T> {
        (self.silent_s > T::of(LATE_S)).then_some(self.silent_s)
    }

    /// Lets time pass.
    #[inline]
    pub(crate) fn predict(&mut self, noise: &EngineNoise<T>, dt_s: T) {
        let square = |x: T| x * x;
        let (two, third) = (T::of(2.0), T::of(1.0 / 3.0));
        // The acceleration fades, so that its variance ends at the square of its limit. If only this variance were cut there,
        // the three numbers would no longer be a covariance.
        let limit = noise.acceleration_max_rad_s2;
        let fade_s = two * square(limit / noise.acceleration_walk);
        let stay = fade_s / (fade_s + dt_s);
        let walk = square(limit) * (T::one() - square(stay));
        self.mean[0] = self.mean[0] + dt_s * self.mean[1];
        // Without readings an acceleration does not last for ever.
        let silent = if self.silent_s > T::of(SILENT_S) { T::of(SILENT_S) / (T::of(SILENT_S) + dt_s) } else { stay };
        self.mean[1] = self.mean[1].at_least(-limit).at_most(limit) * silent;
        self.speed_variance = self.speed_variance
            + dt_s * (two * self.covariance + dt_s * self.acceleration_variance)
            + third * walk * dt_s * dt_s;
        self.covariance = stay * (self.covariance + dt_s * self.acceleration_variance) + T::of(0.5) * walk * dt_s;
        self.acceleration_variance = square(stay) * self.acceleration_variance + walk;
        self.silent_s = self.silent_s + dt_s;
    }

    /// Takes a reading that was measured `age_s` ago.
    #[inline]
    pub(crate) fn take(&mut self, noise: &EngineNoise<T>, speed_rad_s: T, age_s: T) -> Verdict {
        let surprise = speed_rad_s - self.speed_before(age_s);
        let reading = noise.reading_rad_s * noise.reading_rad_s;
        let with_reading = |engine: &Self| {
            [
                engine.speed_variance - age_s * engine.covariance,
                engine.covariance - age_s * engine.acceleration_variance,
            ]
        };
        let total = |with: [T; 2]| (with[0] - age_s * with[1]).at_least(T::zero()) + reading;
        let mut with = with_reading(self);
        let verdict = self.gate.judge(surprise, total(with));
        match verdict {
            Verdict::Refused => return verdict,
            Verdict::Jumped => {
                self.speed_variance = self.speed_variance + surprise * surprise;
                with = with_reading(self);
            }
            Verdict::Taken => {}
        }
        let variance = total(with);
        let gain = with.map(|with| with / variance);
        self.mean = [self.mean[0] + gain[0] * surprise, self.mean[1] + gain[1] * surprise];
        // Joseph's form stays a covariance when rounding or a cut variance has made the gain another one.
        let left = [T::one() - gain[0], age_s * gain[0], -gain[1], T::one() + age_s * gain[1]];
        let row = |a: T, b: T| {
            [a * self.speed_variance + b * self.covariance, a * self.covariance + b * self.acceleration_variance]
        };
        let (speed, acceleration) = (row(left[0], left[1]), row(left[2], left[3]));
        self.speed_variance = speed[0] * left[0] + speed[1] * left[1] + gain[0] * gain[0] * reading;
        self.covariance = speed[0] * left[2] + speed[1] * left[3] + gain[0] * gain[1] * reading;
        self.acceleration_variance =
            acceleration[0] * left[2] + acceleration[1] * left[3] + gain[1] * gain[1] * reading;
        self.silent_s = T::zero();
        verdict
    }

    /// Whether its speed is possible, and all of it are numbers.
    pub(crate) fn is_sound(&self, limits: &InputLimits<T>) -> bool {
        let [speed, acceleration] = self.mean;
        let numbers = [acceleration, self.speed_variance, self.covariance, self.acceleration_variance];
        limits.speed_valid(speed) && numbers.into_iter().all(|x| x.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE: EngineNoise<f64> =
        EngineNoise { reading_rad_s: 0.1, acceleration_walk: 1300.0, acceleration_max_rad_s2: 2000.0 };

    #[test]
    fn a_steady_acceleration_is_found_through_old_readings() {
        let mut engine = Engine::new(100.0, &NOISE);
        for k in 1..=40 {
            engine.predict(&NOISE, 0.01);
            // 150 rad/s^2, read 4 ms late.
            engine.take(&NOISE, 100.0 + 150.0 * (0.01 * f64::from(k) - 0.004), 0.004);
        }
        assert!((engine.speed_before(0.0) - 160.0).abs() < 0.05, "{engine:?}");
        assert!((engine.speed_before(0.01) - 158.5).abs() < 0.05, "{engine:?}");
    }

    #[test]
    fn the_covariance_stays_one_from_the_first_reading_on() {
        for age_s in [0.0, 0.004, 0.0064, 0.02, 0.05] {
            let mut engine = Engine::new(
                93.2_f32,
                &EngineNoise { reading_rad_s: 0.1, acceleration_walk: 1315.0, acceleration_max_rad_s2: 2353.0 },
            );
            let noise = EngineNoise { reading_rad_s: 0.1, acceleration_walk: 1315.0, acceleration_max_rad_s2: 2353.0 };
            for k in 0..200_u16 {
                engine.predict(&noise, 0.01);
                let product = engine.speed_variance * engine.acceleration_variance;
                assert!(product >= engine.covariance * engine.covariance * 0.999, "{age_s} {k}: {engine:?}");
                if k % 7 != 0 {
                    engine.take(&noise, 93.2 + 0.6 * f32::from(k), age_s);
                    assert!((engine.mean[0] - (93.2 + 0.6 * f32::from(k) + 60.0 * age_s)).abs() < 20.0, "{engine:?}");
                }
            }
            assert!((engine.mean[0] - (93.2 + 0.6 * 199.0 + 60.0 * age_s)).abs() < 0.3, "{age_s}: {engine:?}");
        }
    }

    #[test]
    fn one_wrong_reading_is_refused_and_a_jump_is_believed() {
        let mut engine = Engine::new(100.0, &NOISE);
        let mut step = |speed: f64| {
            engine.predict(&NOISE, 0.01);
            (engine.take(&NOISE, speed, 0.0), engine.mean[0])
        };
        for _ in 0..30 {
            step(100.0);
        }
        let (verdict, speed) = step(900.0);
        assert!(verdict == Verdict::Refused && (speed - 100.0).abs() < 0.1);
        assert_eq!(step(100.0).0, Verdict::Taken);
        for _ in 0..10 {
            step(100.0);
        }
        assert_eq!(step(200.0).0, Verdict::Refused);
        let (verdict, speed) = step(200.0);
        assert!(verdict == Verdict::Jumped && (speed - 200.0).abs() < 1.0, "{speed}");
    }
}
