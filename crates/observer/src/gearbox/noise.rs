//! How noisy the readings of the speeds are, beside what is stated.
//!
//! Differences of order `n` of what is smooth are the noise of the readings, whatever the car does (von Neumann's estimate of a variance):
//!
//! ```text
//! q = mean of (d^n z)^2 / (c var z)         c = 2, 6, 20 for n = 1, 2, 3
//! ```
//!
//! | readings | `z` in a gear | `n` | is smooth because |
//! |---|---|---|---|
//! | turbine, output | slip `w_t - i w_o` | 1 | it is zero, or a clutch slips |
//! | wheel | `w_w - w_o / i_f` | 2 | the drive shafts swing slowly |
//! | engine | `w_e` | 3 | its torque has no corners for most of the time |
//!
//! `q` is 1 with the stated noise. Of `m` differences of white noise it has the standard deviation `q sqrt(3 / m)`, or `4` and `5` for the
//! higher orders. Only what lies two of these above 1 counts, so that readings as stated are used as stated. Neither state nor equations of
//! the filter take part: a wrong model cannot take its error for noise. Readings near standstill are left out: a wheel that stands has none.
//!
//! Readings in coarse steps `s` have an error of variance `s^2/12` beside the noise, and one error as long as they stand: `n` equal readings in a
//! row count as one, each with `n` times that variance. The step is what all changes of a channel are multiples of.

use car::Gear;
use drivetrain::Real;

use super::{GearboxFilter, GearboxState, Newest, OUTPUT, Reading, SPEEDS, ShiftInput, TURBINE, square};

/// Differences in the mean at most: it follows a change of the noise within some seconds \[chosen\].
const MAXIMUM: u16 = 400;
/// Fewest differences from which the noise is taken: of the slip two standard deviations are then less than the value itself.
const FEWEST: u16 = 16;
/// Most readings in a row that count as the same \[chosen\].
const LONGEST_SAME: u16 = 50;
/// Changes that are multiples of one step, and those of them of a reading that stood, from which on the step is one of the channel \[chosen\].
const MULTIPLES: u8 = 8;
const REPEATS: u8 = 4;
/// By this fraction of the step a change may be none: times and values are rounded.
const ROUNDED: f64 = 0.02;
/// Changes that are no multiples until the step is smaller: one wrong reading makes two of them. So many multiples make them none \[chosen\].
const MISSES: u8 = 3;
const FORGOTTEN: u8 = 16;
/// Highest order of a difference.
const HIGHEST: usize = 3;
/// Largest difference that is noise, in its standard deviations: an outlier counts as this.
const OUTLIER: f64 = 5.0;
/// Longest step over which the differences of wheel and engine speed are those of a smooth speed, s \[chosen\].
const LONGEST_STEP_S: f64 = 0.025;

/// Memory of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ReadingNoise<T> {
    /// The gear of the slip in the step before.
    gear: Gear,
    slip: Differences<T, 1>,
    wheel: Differences<T, 2>,
    engine: Differences<T, 3>,
    /// Of turbine, output, wheel and engine.
    steps: [Steps<T>; SPEEDS + 1],
}

/// The step of a channel, and readings in a row that are the same: those of a coarse step have one error as long as they stand, and not one each.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Steps<T> {
    value: T,
    /// How many there are of this value, and how many there were of the one before.
    count: u16,
    before: u16,
    /// What all changes were multiples of, rad/s; zero before the first.
    step: T,
    multiples: u8,
    misses: u8,
    repeats: u8,
}

/// The differences of order `N` of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Differences<T, const N: usize> {
    /// The newest differences of order 0 to `N - 1`; the rest is zero.
    newest: [T; HIGHEST],
    /// How many of these are known.
    known: u8,
    /// Mean of the squared differences over what is stated.
    mean: T,
    /// How many are in the mean.
    count: u16,
    /// By what the stated standard deviation is multiplied, at least 1.
    factor: T,
}

impl<T: Real> ReadingNoise<T> {
    /// The noise as stated.
    pub(super) fn stated() -> Self {
        Self {
            gear: Gear::Neutral,
            slip: Differences::stated(),
            wheel: Differences::stated(),
            engine: Differences::stated(),
            steps: [Steps::nothing(); SPEEDS + 1],
        }
    }

    /// By what the standard deviations of the readings of turbine, output, wheel and engine are multiplied, at least 1.
    fn factors(&self) -> [T; SPEEDS + 1] {
        [self.slip.factor, self.slip.factor, self.wheel.factor, self.engine.factor]
    }

    /// The next readings have none before them.
    pub(super) fn pause(&mut self) {
        (self.slip.known, self.wheel.known, self.engine.known) = (0, 0, 0);
    }
}

impl<T: Real> Steps<T> {
    fn nothing() -> Self {
        Self { value: T::zero(), count: 0, before: 1, step: T::zero(), multiples: 0, misses: 0, repeats: 0 }
    }

    fn take(&mut self, value: T) {
        let change = (value - self.value).abs();
        if self.count == 0 || change == T::zero() {
            (self.value, self.count) = (value, LONGEST_SAME.min(self.count + 1));
            return;
        }
        (self.value, self.count, self.before) = (value, 1, self.count);
        let nearest = (change / self.step + T::of(0.5)).floor() * self.step;
        let left = (change - nearest).abs();
        if nearest > T::zero() && left <= T::of(ROUNDED) * self.step {
            self.multiples = self.multiples.checked_add(1).unwrap_or(u8::MAX - FORGOTTEN + 1);
            self.repeats = self.repeats.saturating_add(u8::from(self.before > 1));
            if self.multiples.is_multiple_of(FORGOTTEN) {
                self.misses = 0;
            }
            return;
        }
        self.misses = MISSES.min(self.misses + 1);
        if self.misses >= MISSES || self.step == T::zero() {
            // A comparison with NaN is false: then this is the first step.
            self.step = if left > T::zero() { left } else { change };
            (self.multiples, self.misses, self.repeats) = (0, 0, 0);
        }
    }

    /// Variance of one reading by the step, and that of readings that stand, as if each had an error of its own.
    fn variances(&self) -> [T; 2] {
        if self.multiples < MULTIPLES || self.repeats < REPEATS {
            return [T::zero(); 2];
        }
        let of_one = square(self.step) / T::of(12.0);
        [of_one, of_one * T::of(f64::from(self.count.max(self.before)))]
    }
}

impl<T: Real, const N: usize> Differences<T, N> {
    /// Variance of a difference over that of a reading, and the variance of the mean of many over its square and their inverse number.
    const OF_ORDER: (f64, f64) = match N {
        1 => (2.0, 3.0),
        2 => (6.0, 4.0),
        _ => (20.0, 5.0),
    };

    fn stated() -> Self {
        Self { newest: [T::zero(); HIGHEST], known: 0, mean: T::one(), count: 0, factor: T::one() }
    }

    /// Takes the next value and the stated variance of its noise.
    fn take(&mut self, value: T, variance: T) {
        let (of_noise, of_mean) = Self::OF_ORDER;
        let mut difference = value;
        for (order, newest) in (0..).zip(self.newest.iter_mut().take(N)) {
            let before = core::mem::replace(newest, difference);
            if order >= self.known {
                self.known = order + 1;
                return;
            }
            difference = difference - before;
        }
        let maximum = square(T::of(OUTLIER)) * self.mean.at_least(T::one());
        let ratio = square(difference) / (T::of(of_noise) * variance);
        if !ratio.is_finite() {
            self.known = 0;
            return;
        }
        self.count = MAXIMUM.min(self.count + 1);
        let count = T::of(f64::from(self.count));
        self.mean = self.mean + (ratio.at_most(maximum) - self.mean) / count;
        if self.count >= FEWEST {
            let lower = self.mean * (T::one() - T::of(2.0) * (T::of(of_mean) / count).sqrt());
            self.factor = lower.at_least(T::one()).sqrt();
        }
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// The same filter with noisier readings; none where all are as stated.
    pub(super) fn noisier(&self, noise: &ReadingNoise<T>) -> Option<Self> {
        let (factors, steps) = (noise.factors(), noise.steps.each_ref().map(Steps::variances));
        let is_as_stated = |(factor, [_, of_steps]): (&T, &[T; 2])| *factor <= T::one() && *of_steps <= T::zero();
        if factors.iter().zip(&steps).all(is_as_stated) {
            return None;
        }
        let (mut readings, mut engine) = (self.readings, self.engine);
        let [turbine, output, wheel] = readings.each_mut().map(|reading| &mut reading.std_dev_rad_s);
        let std_devs = [turbine, output, wheel, &mut engine.1.reading_rad_s];
        for (std_dev, (factor, [_, of_steps])) in std_devs.into_iter().zip(factors.into_iter().zip(steps)) {
            *std_dev = factor * (square(*std_dev) + of_steps).sqrt();
        }
        Some(Self { readings, engine, ..*self })
    }

    /// Takes the readings of a step after it. The filter is that of the readings as stated.
    pub(super) fn take_noise(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) {
        let given = [input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s, input.engine_rad_s];
        for (steps, reading) in state.noise.steps.iter_mut().zip(given) {
            if let Some(reading) = reading.filter(|reading| self.limits.speed_valid(reading.value)) {
                steps.take(reading.value);
            }
        }
        let gear = input.gear.to;
        let row = self.tables.gear(gear).filter(|_| input.gear.is_steady());
        let Some(row) = row else { return state.noise.pause() };
        let valid = |reading: &Option<Reading<T>>| {
            reading.map(|reading| reading.value).filter(|&value| self.limits.speed_valid(value))
        };
        let came = |k: usize, reading: &Option<Reading<T>>| {
            state.newest[k].filter(|newest| reading.is_some() && !newest.refused)
        };
        let moves = |output: &Newest<T>| output.value.abs() >= self.uncertainty.output_least_rad_s;
        let output = came(OUTPUT, &input.output_rad_s).filter(moves);
        let turbine = came(TURBINE, &input.turbine_rad_s);
        let noise = &mut state.noise;
        let [of_turbine, of_output, of_wheel, of_engine] = {
            let [turbine, output, wheel] = self.readings.each_ref().map(|sensor| sensor.std_dev_rad_s);
            let stated = [turbine, output, wheel, self.engine.1.reading_rad_s];
            core::array::from_fn(|k| square(stated[k]) + noise.steps[k].variances()[0])
        };
        match turbine.zip(output) {
            Some((turbine, output)) => {
                if core::mem::replace(&mut noise.gear, gear) != gear {
                    noise.slip.known = 0;
                }
                let slip = turbine.value - row.ratio * output.value;
                noise.slip.take(slip, of_turbine + square(row.ratio) * of_output);
            }
            None => noise.slip.known = 0,
        }
        // Over longer steps such speeds bend.
        let bends = input.dt_s > T::of(LONGEST_STEP_S);
        match valid(&input.wheel_rad_s).zip(output).filter(|_| !bends) {
            Some((wheel, output)) => {
                let final_ratio = self.driveline.final_ratio;
                let of_output = square(noise.slip.factor / final_ratio) * of_output;
                noise.wheel.take(wheel - output.value / final_ratio, of_wheel + of_output);
            }
            None if bends => noise.wheel.known = 0,
            None => {}
        }
        match valid(&input.engine_rad_s).filter(|_| !bends) {
            Some(engine) => noise.engine.take(engine, of_engine),
            None if bends => noise.engine.known = 0,
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Standard deviation of a slip, rad/s, as stated.
    const STATED_RAD_S: f64 = 0.3;

    /// The factor after readings with a multiple of the stated noise, about this slip at the time in s.
    fn factor(seed: u64, count: u32, times: f64, slip: impl Fn(f64) -> f64) -> f64 {
        let (mut noise, mut random) = (Differences::<f64, 1>::stated(), Pcg64Mcg::new(u128::from(seed)));
        for k in 0..count {
            let normal: f64 = StandardNormal.sample(&mut random);
            noise.take(slip(0.01 * f64::from(k)) + times * STATED_RAD_S * normal, STATED_RAD_S * STATED_RAD_S);
        }
        noise.factor
    }

    #[test]
    fn noise_as_stated_is_used_as_stated() {
        // Two standard deviations on one side: one in 44.
        let higher = (0..1000).filter(|&seed| factor(seed, 400, 1.0, |_| 0.0) > 1.0).count();
        assert!(higher <= 40, "{higher}");
        assert!((0..1000).all(|seed| factor(seed, 400, 1.0, |_| 0.0) < 1.15));
        assert_eq!(factor(1, 1000, 0.3, |_| 0.0), 1.0, "less noise than stated");
    }

    #[test]
    fn three_times_the_noise_is_found_from_below() {
        for (count, lowest) in [(40, 1.2), (100, 1.8), (400, 2.4)] {
            let below = (0..200).filter(|&seed| factor(seed, count, 3.0, |_| 0.0) < lowest).count();
            let above = (0..200).filter(|&seed| factor(seed, count, 3.0, |_| 0.0) > 3.1).count();
            assert!(below <= 10 && above <= 10, "{count}: {below} {above}");
        }
    }

    #[test]
    fn a_clutch_that_slips_and_a_swing_of_the_shafts_are_no_noise() {
        assert_eq!(factor(1, 400, 0.0, |t| 200.0 - 30.0 * t), 1.0, "30 rad/s^2");
        let swing = |t: f64| 0.5 * (core::f64::consts::TAU * 11.0 * t).sin();
        assert_eq!(factor(1, 400, 0.0, swing), 1.0);
    }

    #[test]
    fn one_outlier_and_what_is_no_number_are_no_noise() {
        let outlier = |t: f64| if (t - 2.0).abs() < 0.004 { 50.0 } else { 0.0 };
        assert!(factor(1, 400, 1.0, outlier) < 1.1);
        let mut noise = Differences::<f64, 1>::stated();
        noise.take(f64::NAN, STATED_RAD_S * STATED_RAD_S);
        noise.take(f64::INFINITY, 0.0);
        assert_eq!(noise.factor, 1.0);
    }

    /// The factor by differences of order `N` of a value with so many times the stated noise.
    fn of_order<const N: usize>(seed: u64, count: u32, times: f64, smooth: impl Fn(f64) -> f64) -> f64 {
        let (mut noise, mut random) = (Differences::<f64, N>::stated(), Pcg64Mcg::new(u128::from(seed)));
        for k in 0..count {
            let normal: f64 = StandardNormal.sample(&mut random);
            noise.take(smooth(0.01 * f64::from(k)) + times * STATED_RAD_S * normal, STATED_RAD_S * STATED_RAD_S);
        }
        noise.factor
    }

    #[test]
    fn higher_differences_find_the_noise_of_a_speed_that_bends() {
        // An engine that races in 0.5 s, and a wheel against the output while the shafts swing with 7 Hz.
        let races = |t: f64| 200.0 + 100.0 * (6.0 * t).sin();
        let swings = |t: f64| 0.3 * (core::f64::consts::TAU * 7.0 * t).sin();
        for seed in 0..100 {
            assert!(of_order::<3>(seed, 400, 1.0, races) < 1.15 && of_order::<2>(seed, 400, 1.0, swings) < 1.15);
            for found in [of_order::<3>(seed, 400, 5.0, races), of_order::<2>(seed, 400, 5.0, swings)] {
                assert!(found > 3.5 && found < 5.6, "{seed}: {found}");
            }
        }
    }

    /// The standard deviations of one reading and of the newest one as it counts, after these readings every 10 ms.
    fn by_steps(reading: impl Fn(f64) -> f64, count: u32) -> [f64; 2] {
        let mut steps = Steps::nothing();
        (0..count).for_each(|k| steps.take(reading(0.01 * f64::from(k))));
        steps.variances().map(f64::sqrt)
    }

    #[test]
    fn the_step_of_a_channel_is_found_and_counts_for_as_long_as_a_reading_stands() {
        let speed = |t: f64| 100.0 + 30.0 * (0.7 * t).sin();
        for step in [0.1047, 1.0, 2.618] {
            let coarse = |t: f64| (speed(t) / step).round() * step;
            let [one, _] = by_steps(coarse, 600);
            assert!((one / (step / 12.0_f64.sqrt()) - 1.0).abs() < 0.03, "{step}: {one}");
            // At the top it stands, and so many readings have one error.
            let stands = by_steps(|t| coarse(t.min(2.0)), 240);
            assert!(stands[1] > 6.0 * one && stands[1] <= one * f64::from(LONGEST_SAME).sqrt() + 1e-9, "{stands:?}");
        }
    }

    #[test]
    fn fine_readings_have_no_step() {
        let mut random = Pcg64Mcg::new(3);
        let mut steps = Steps::nothing();
        for k in 0..400_u32 {
            let normal: f64 = StandardNormal.sample(&mut random);
            steps.take(100.0 + 0.2 * f64::from(k) + 0.02 * normal);
            assert_eq!(steps.variances(), [0.0; 2], "{k}");
        }
        // A ramp without noise, after a standstill.
        assert_eq!(by_steps(|t| (30.0 * (t - 1.0)).max(0.0), 300), [0.0; 2]);
    }

    #[test]
    fn one_wrong_reading_does_not_hide_the_step() {
        let speed = |t: f64| (100.0 + 20.0 * t + if (t - 3.0).abs() < 0.004 { 0.37 } else { 0.0 }) / 0.5;
        let [one, _] = by_steps(|t| if (t - 3.0).abs() < 0.004 { 0.5 * speed(t) } else { speed(t).round() * 0.5 }, 400);
        assert!((one - 0.5 / 12.0_f64.sqrt()).abs() < 1e-6, "{one}");
    }
}
