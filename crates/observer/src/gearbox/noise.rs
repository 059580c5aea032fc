//! How noisy the readings of turbine and output speed are, beside what is stated.
//!
//! In a gear the slip `z = w_t - i w_o` is zero, or where a clutch slips it is smooth. The difference of two in a row is then the
//! noise of the readings, whatever the car does (von Neumann's estimate of a variance):
//!
//! ```text
//! q = mean of (z_k - z_{k-1})^2 / (2 var z)         var z = sigma_t^2 + i^2 sigma_o^2, as stated
//! ```
//!
//! `q` is 1 with the stated noise. Of `n` differences of white noise it has the standard deviation `q sqrt(3 / n)`. Only what lies
//! two of these above 1 counts, so that readings as stated are used as stated. Neither state nor equations of the filter take part: a wrong model cannot take
//! its error for noise. Readings near standstill are left out: a wheel that stands has none.

use car::Gear;
use drivetrain::Real;

use super::{GearboxFilter, GearboxState, Newest, OUTPUT, Reading, ShiftInput, TURBINE, square};

/// Differences in the mean at most: it follows a change of the noise within some seconds \[chosen\].
const MAXIMUM: u16 = 400;
/// Fewest differences from which the noise is taken: two standard deviations are then less than the value itself.
const FEWEST: u16 = 16;
/// Largest difference that is noise, in its standard deviations: an outlier counts as this.
const OUTLIER: f64 = 5.0;

/// Memory of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ReadingNoise<T> {
    /// The slip in the step before, rad/s, and the gear that it is of.
    before: Option<(T, Gear)>,
    /// Mean of the squared differences over what is stated.
    mean: T,
    /// How many are in the mean.
    count: u16,
    /// By what the stated standard deviations are multiplied, at least 1.
    factor: T,
}

impl<T: Real> ReadingNoise<T> {
    /// The noise as stated.
    pub(super) fn stated() -> Self {
        Self { before: None, mean: T::one(), count: 0, factor: T::one() }
    }

    /// By what the stated standard deviations of turbine and output readings are multiplied, at least 1.
    pub(super) fn factor(&self) -> T {
        self.factor
    }

    /// The next slip has none before it.
    pub(super) fn pause(&mut self) {
        self.before = None;
    }

    /// Takes the slip in a gear, rad/s, and its stated variance.
    fn take(&mut self, slip: T, gear: Gear, variance: T) {
        let before = self.before.replace((slip, gear));
        let Some((before, _)) = before.filter(|&(_, of)| of == gear) else { return };
        let maximum = square(T::of(OUTLIER)) * self.mean.at_least(T::one());
        let ratio = square(slip - before) / (T::of(2.0) * variance);
        if !ratio.is_finite() {
            self.before = None;
            return;
        }
        self.count = MAXIMUM.min(self.count + 1);
        let count = T::of(f64::from(self.count));
        self.mean = self.mean + (ratio.at_most(maximum) - self.mean) / count;
        if self.count >= FEWEST {
            let lower = self.mean * (T::one() - T::of(2.0) * (T::of(3.0) / count).sqrt());
            self.factor = lower.at_least(T::one()).sqrt();
        }
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// The same filter with noisier readings of turbine and output.
    pub(super) fn noisier(&self, factor: T) -> Self {
        let mut readings = self.readings;
        for k in [TURBINE, OUTPUT] {
            readings[k].std_dev_rad_s = factor * readings[k].std_dev_rad_s;
        }
        Self { readings, ..*self }
    }

    /// Takes the readings of turbine and output that came together in a gear.
    pub(super) fn take_noise(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) {
        let gear = input.gear.to;
        let row = self.tables.gear(gear).filter(|_| input.gear.is_steady());
        let came = |k: usize, reading: &Option<Reading<T>>| {
            state.newest[k].filter(|newest| reading.is_some() && !newest.refused)
        };
        let moves = |output: &Newest<T>| output.value.abs() >= self.uncertainty.output_least_rad_s;
        let output = came(OUTPUT, &input.output_rad_s).filter(moves);
        let together = came(TURBINE, &input.turbine_rad_s).zip(output);
        let (Some(row), Some((turbine, output))) = (row, together) else { return state.noise.pause() };
        let [of_turbine, of_output] = [TURBINE, OUTPUT].map(|k| square(self.readings[k].std_dev_rad_s));
        let slip = turbine.value - row.ratio * output.value;
        let stated = (of_turbine + square(row.ratio) * of_output) / square(state.noise.factor());
        state.noise.take(slip, gear, stated);
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
        let (mut noise, mut random) = (ReadingNoise::stated(), Pcg64Mcg::new(u128::from(seed)));
        for k in 0..count {
            let normal: f64 = StandardNormal.sample(&mut random);
            noise.take(
                slip(0.01 * f64::from(k)) + times * STATED_RAD_S * normal,
                Gear::at(2),
                STATED_RAD_S * STATED_RAD_S,
            );
        }
        noise.factor()
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
    fn one_outlier_and_a_change_of_gear_are_no_noise() {
        let outlier = |t: f64| if (t - 2.0).abs() < 0.004 { 50.0 } else { 0.0 };
        assert!(factor(1, 400, 1.0, outlier) < 1.1);
        let mut noise = ReadingNoise::stated();
        for k in 0..100_u8 {
            let gear = Gear::at(usize::from(k / 20));
            noise.take(100.0 * f64::from(k / 20), gear, STATED_RAD_S * STATED_RAD_S);
        }
        assert_eq!(noise.factor(), 1.0);
        noise.take(f64::NAN, Gear::at(0), STATED_RAD_S * STATED_RAD_S);
        noise.take(f64::INFINITY, Gear::at(0), 0.0);
        assert_eq!(noise.factor(), 1.0);
    }
}
