//! What the slip of turbine and output speed in gears shows of their readings and of the ratios.
//!
//! In a gear of ratio `(1 + e) i`, with readings that are late by `d_t` and `d_o` and, of toothed wheels that are not described, by the angles `l_t` and `l_o`,
//!
//! ```text
//! w_t - i w_o = e i w_o + i w_o' (d_o + l_o/|w_o| - d_t - l_t/|w_t|)
//! ```
//!
//! Least squares over the time in all gears give `d_o - d_t`, `l_o`, `l_t`, and `e` of each gear. They are one estimate, as a lag that is left out looks like
//! a delay and an error of the ratio. A delay that both speeds have in common does not show.
//!
//! The sums of each gear are kept. Its `e` is eliminated, and what is left of all gears is solved for the three that they have in common.

use drivetrain::Real;

use super::information::{cholesky, lower_inverse};
use super::powertrain::dot;
use super::square;

/// Gears whose ratios are followed \[chosen\]; those beyond are taken to have the mean of these.
pub(super) const GEARS: usize = 12;
/// Standard deviations before the first gear: of the delay, s, and of the error of a ratio, as a fraction \[chosen\].
const DELAY_S: f64 = 0.02;
const RATIO: f64 = 5e-3;
/// How long a reading counts, of the time in its gear, s \[chosen\].
const MEMORY_S: f64 = 60.0;
/// Smallest lag of the slip that is taken off, as an angle of the output, rad \[chosen\]: half a pitch of sixty teeth. And its standard deviations.
const LAG_MIN_RAD: f64 = 0.05;
const LAG_SHOWN: f64 = 3.0;
/// Of a sensor without noise, rad^2/s^2 \[chosen\].
const SMALLEST_VARIANCE: f64 = 1e-6;

/// Delay, and lags of output and turbine, each in its standard deviation before the first gear: what all gears have in common.
const COMMON: usize = 3;
/// Their pairs.
const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)];

/// The slip of a gear, rad/s, with what it is compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct InGear<T> {
    /// Slip at the turbine.
    pub(super) slip: T,
    /// Its variance by the noise of one reading of each speed.
    pub(super) variance: T,
    pub(super) ratio: T,
    pub(super) output_rad_s: T,
    /// Rate of the output speed, rad/s^2, or zero as long as noise may be all of it.
    pub(super) rate_rad_s2: T,
}

impl<T: Real> InGear<T> {
    /// The slip per delay, s, and lags of output and turbine, rad.
    fn row(&self) -> [T; COMMON] {
        // In reverse the ratio is negative, and an age is none.
        let (rate, output) = (self.ratio * self.rate_rad_s2, self.output_rad_s.abs());
        [rate, rate / output, -rate / (self.ratio.abs() * output)]
    }
}

/// Sums over the time in gears: of the weights times the pairs of the common unknowns, and times these and the slip.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sums<T> {
    pairs: [T; PAIRS.len()],
    by_slip: [T; COMMON],
}

impl<T: Real> Sums<T> {
    fn nothing() -> Self {
        Self { pairs: [T::zero(); PAIRS.len()], by_slip: [T::zero(); COMMON] }
    }

    fn add(&mut self, other: &Self) {
        self.pairs = core::array::from_fn(|k| self.pairs[k] + other.pairs[k]);
        self.by_slip = core::array::from_fn(|k| self.by_slip[k] + other.by_slip[k]);
    }
}

/// What a gear has shown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct OfGear<T> {
    time_s: T,
    /// Sum of the weights.
    weight: T,
    common: Sums<T>,
    /// Of the weights times `x = i w_o` and the common unknowns, itself, the slip; and of the slip times itself.
    mixed: [T; COMMON],
    own: T,
    own_by_slip: T,
    slips: T,
    /// Whether the unknowns explain the slip.
    explains: bool,
}

impl<T: Real> OfGear<T> {
    fn nothing() -> Self {
        let zero = T::zero();
        Self {
            time_s: zero,
            weight: zero,
            common: Sums::nothing(),
            mixed: [zero; COMMON],
            own: zero,
            own_by_slip: zero,
            slips: zero,
            explains: false,
        }
    }

    /// Takes the slip with a weight over a time, s.
    fn take(&mut self, row: &[T; COMMON], [x, slip]: [T; 2], weight: T, dt_s: T) {
        let kept = if self.time_s > T::of(MEMORY_S) { T::of(MEMORY_S) / self.time_s } else { T::one() };
        let sum = |sum: T, product: T| kept * (sum + weight * product);
        for (of, (a, b)) in self.common.pairs.iter_mut().zip(PAIRS) {
            *of = sum(*of, row[a] * row[b]);
        }
        let of_common = self.common.by_slip.iter_mut().zip(&mut self.mixed);
        for ((by_slip, mixed), per) in of_common.zip(row) {
            (*by_slip, *mixed) = (sum(*by_slip, *per * slip), sum(*mixed, *per * x));
        }
        self.own = sum(self.own, x * x);
        self.own_by_slip = sum(self.own_by_slip, x * slip);
        self.slips = sum(self.slips, slip * slip);
        self.weight = sum(self.weight, T::one());
        self.time_s = kept * (self.time_s + dt_s);
    }

    /// Information on the error of the ratio.
    fn information(&self) -> T {
        self.own + T::of(1.0 / (RATIO * RATIO))
    }

    /// What it says of the common unknowns, whatever its error of the ratio is.
    fn of_common(&self) -> Sums<T> {
        let (per, common) = (self.information().recip(), &self.common);
        let mut sums = Sums::nothing();
        for (k, (a, b)) in PAIRS.into_iter().enumerate() {
            sums.pairs[k] = common.pairs[k] - per * self.mixed[a] * self.mixed[b];
        }
        sums.by_slip = core::array::from_fn(|k| common.by_slip[k] - per * self.mixed[k] * self.own_by_slip);
        sums
    }
}

/// The estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SlipFit<T> {
    /// Standard deviations of delay, s, and of the lags of output and turbine, rad, before the first gear.
    std_devs: [T; COMMON],
    gears: [OfGear<T>; GEARS],
    /// Place of the gear at hand, `GEARS` before the first, and what the others say of the common unknowns.
    place: usize,
    others: Sums<T>,
    /// Mean and covariance of the common unknowns.
    mean: [T; COMMON],
    covariance: [[T; COMMON]; COMMON],
    /// Error of the ratio of the gear at hand and its standard deviation, and the mean square of what is left of its slip, rad^2/s^2.
    error: [T; 2],
    unexplained: T,
    /// Whether a rate has come.
    has_rate: bool,
}

impl<T: Real> SlipFit<T> {
    /// Before anything was read, with the variances of the lags of turbine and output, rad^2.
    pub(super) fn nothing([turbine, output]: [T; 2]) -> Self {
        let unit = |a: usize, b: usize| if a == b { T::one() } else { T::zero() };
        Self {
            std_devs: [T::of(DELAY_S), output.sqrt(), turbine.sqrt()],
            gears: [OfGear::nothing(); GEARS],
            place: GEARS,
            others: Sums::nothing(),
            mean: [T::zero(); COMMON],
            covariance: core::array::from_fn(|a| core::array::from_fn(|b| unit(a, b))),
            error: [T::zero(), T::of(RATIO)],
            unexplained: T::zero(),
            has_rate: false,
        }
    }

    /// Takes the slip of the gear at a place over a step, which counts as this part of a reading.
    pub(super) fn take(&mut self, place: usize, at: &InGear<T>, (dt_s, counts): (T, T)) {
        let row: [T; COMMON] = core::array::from_fn(|k| self.std_devs[k] * at.row()[k]);
        let (x, weight) = (at.ratio * at.output_rad_s, counts / at.variance.at_least(T::of(SMALLEST_VARIANCE)));
        let is_finite = (dot(&row, &row) + x + at.slip).is_finite() && weight > T::zero() && weight.is_finite();
        let Some(gear) = self.gears.get_mut(place).filter(|_| is_finite) else { return };
        gear.take(&row, [x, at.slip], weight, dt_s);
        self.has_rate |= at.rate_rad_s2 != T::zero();
        if place != self.place {
            self.place = place;
            self.others = Sums::nothing();
            for (_, gear) in self.gears.iter().enumerate().filter(|(other, gear)| *other != place && gear.explains) {
                self.others.add(&gear.of_common());
            }
        }
        self.solve(place);
    }

    fn solve(&mut self, place: usize) {
        let Some(gear) = self.gears.get(place) else { return };
        let mut sums = gear.of_common();
        sums.add(&self.others);
        let mut information = [[T::zero(); COMMON]; COMMON];
        for ((a, b), sum) in PAIRS.into_iter().zip(sums.pairs) {
            (information[a][b], information[b][a]) = (sum, sum);
        }
        for (k, row) in information.iter_mut().enumerate() {
            row[k] = row[k] + T::one();
        }
        let Some(lower) = cholesky(&information) else { return };
        let root = lower_inverse(&lower);
        let of = |a: usize, b: usize| root.iter().fold(T::zero(), |sum, row| sum + row[a] * row[b]);
        self.covariance = core::array::from_fn(|a| core::array::from_fn(|b| of(a, b)));
        self.mean = self.covariance.map(|row| dot(&row, &sums.by_slip));
        let per = gear.information().recip();
        let error = per * (gear.own_by_slip - dot(&gear.mixed, &self.mean));
        let by_common = self.covariance.map(|row| dot(&row, &gear.mixed));
        let variance = per + square(per) * dot(&by_common, &gear.mixed);
        self.error = [error, variance.sqrt()];
        let explained = error * gear.own_by_slip + dot(&self.mean, &gear.common.by_slip);
        self.unexplained = (gear.slips - explained) / gear.weight;
    }

    /// Whether the unknowns explain the slip of the gear at hand: else it says nothing of those that it has in common with others.
    pub(super) fn set_explains(&mut self, explains: bool) {
        if let Some(gear) = self.gears.get_mut(self.place) {
            gear.explains = explains;
        }
    }

    /// Forgets what a gear has shown.
    pub(super) fn forget(&mut self, place: usize) {
        if let Some(gear) = self.gears.get_mut(place) {
            *gear = OfGear::nothing();
        }
    }

    /// The delay `d_o - d_t`, s, and its standard deviation; none before a rate has come.
    pub(super) fn delay_s(&self) -> Option<[T; 2]> {
        let [delay, ..] = self.std_devs;
        self.has_rate.then(|| [delay * self.mean[0], delay * self.covariance[0][0].sqrt()])
    }

    /// The lags of turbine and output, rad.
    pub(super) fn lags_rad(&self) -> [T; 2] {
        [self.std_devs[2] * self.mean[2], self.std_devs[1] * self.mean[1]]
    }

    /// Whether the lag of the slip in the gear of this ratio shows itself; one that was taken off up to now does so down to half of that.
    pub(super) fn shows_lag(&self, ratio: T, was_shown: bool) -> bool {
        let [_, output, turbine] = self.std_devs;
        let per = [output, -turbine / ratio.abs()];
        let [_, [_, a, mixed], [_, _, b]] = &self.covariance;
        let lag = per[0] * self.mean[1] + per[1] * self.mean[2];
        let variance = square(per[0]) * *a + T::of(2.0) * per[0] * per[1] * *mixed + square(per[1]) * *b;
        let limit = (square(T::of(LAG_SHOWN)) * variance).at_least(square(T::of(LAG_MIN_RAD)));
        square(lag) > if was_shown { T::of(0.25) * limit } else { limit }
    }

    /// Error of the ratio of the gear at hand and its standard deviation, for how long it was compared, s, and the mean square of what is left of the slip, rad^2/s^2.
    pub(super) fn ratio(&self) -> Option<([T; 2], T, T)> {
        let gear = self.gears.get(self.place)?;
        Some((self.error, gear.time_s, self.unexplained))
    }

    /// What delay and lags make of the slip, rad/s.
    pub(super) fn late_rad_s(&self, at: &InGear<T>) -> T {
        let row: [T; COMMON] = core::array::from_fn(|k| self.std_devs[k] * at.row()[k]);
        dot(&row, &self.mean)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drives through gears of these ratios with toothed wheels that lag by these angles, a delay and errors of the ratios. A gear for 4 s each, three times.
    fn fitted(
        [turbine_rad, output_rad]: [f64; 2],
        delay_s: f64,
        gears: &[[f64; 2]],
        lag_variances: [f64; 2],
    ) -> SlipFit<f64> {
        let mut fit = SlipFit::nothing(lag_variances);
        for round in 0..3 {
            for (place, [ratio, error]) in gears.iter().enumerate() {
                for row in 0..400 {
                    let time_s = 0.01 * f64::from(row);
                    let begin = 30.0 + 60.0 * place as f64 + 5.0 * f64::from(round);
                    let (output, rate) = (begin + 18.0 * time_s - 2.0 * time_s * time_s, 18.0 - 4.0 * time_s);
                    let lag_s = delay_s + output_rad / output - turbine_rad / (ratio * output);
                    let noise = 0.02 * f64::from((row * 7919 + round * 31) % 13 - 6);
                    let slip = ratio * (error * output + lag_s * rate) + noise;
                    let at = InGear { slip, variance: 0.01, ratio: *ratio, output_rad_s: output, rate_rad_s2: rate };
                    fit.take(place, &at, (0.01, 1.0));
                    fit.set_explains(true);
                }
            }
        }
        fit
    }

    const GEARS_RATIOS: [[f64; 2]; 3] = [[4.1, 0.004], [2.3, -0.003], [1.2, 0.0]];

    #[test]
    fn lags_delays_and_ratios_are_told_apart() {
        for lags_rad in [[0.0, 0.0], [0.5, 0.25], [0.1, 0.6]] {
            for delay_s in [-0.01, 0.0, 0.005] {
                let fit = fitted(lags_rad, delay_s, &GEARS_RATIOS, [0.09; 2]);
                let [found_s, std_dev_s] = fit.delay_s().unwrap();
                assert!((found_s - delay_s).abs() < 3.0 * std_dev_s, "{lags_rad:?} {delay_s}: {found_s} +-{std_dev_s}");
                let ([error, std_dev], ..) = fit.ratio().unwrap();
                assert!(error.abs() < 3.0 * std_dev && std_dev < 5e-4, "{lags_rad:?} {delay_s}: {error} +-{std_dev}");
                // The lag of the slip in the lowest gear, in which it matters most.
                let lag = |[turbine, output]: [f64; 2]| output - turbine / 4.1;
                let found = lag(fit.lags_rad()) + 60.0 * (found_s - delay_s);
                assert!((found - lag(lags_rad)).abs() < 0.06, "{lags_rad:?} {delay_s}: {found}");
            }
        }
    }

    /// Many gears of nearly constant rates, in which delay, lags and ratio look alike for as long as one gear lasts.
    #[test]
    fn gears_that_come_again_and_again_do_not_make_an_error_of_noise() {
        let mut random = 1_u64;
        let mut noise = || {
            // The sum of twelve uniform numbers has the variance one.
            let mut uniform = || {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (random >> 40) as f64 / f64::from(1_u32 << 24)
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        for (delay_s, lag_rad) in [(0.0, 0.0), (0.02, 0.0), (0.0, 0.6)] {
            let mut fit = SlipFit::nothing([0.09; 2]);
            for _ in 0..40 {
                for (place, ratio) in [4.1, 2.3, 1.5, 1.1].into_iter().enumerate() {
                    let seconds = 2.5 + 1.5 * noise().abs().min(1.0);
                    let rate = 18.0 / (1.0 + place as f64);
                    for row in 0..(100.0 * seconds) as u32 {
                        let output = 25.0 + 40.0 * place as f64 + 0.01 * f64::from(row) * rate;
                        let slip = ratio * rate * (delay_s + lag_rad / output) + 0.1 * noise();
                        let at = InGear { slip, variance: 0.01, ratio, output_rad_s: output, rate_rad_s2: rate };
                        fit.take(place, &at, (0.01, 1.0));
                        fit.set_explains(true);
                    }
                }
            }
            let [found_s, std_dev_s] = fit.delay_s().unwrap();
            assert!((found_s - delay_s).abs() < 3.5 * std_dev_s, "{delay_s} {lag_rad}: {found_s} +-{std_dev_s}");
            assert_eq!(fit.shows_lag(4.1, false), lag_rad > 0.0, "{delay_s} {lag_rad}: {:?}", fit.lags_rad());
            let ([error, std_dev], ..) = fit.ratio().unwrap();
            assert!(error.abs() < 3.5 * std_dev && std_dev < 5e-4, "{delay_s} {lag_rad}: {error} +-{std_dev}");
        }
    }

    #[test]
    fn a_lag_is_shown_by_wheels_that_are_not_described_alone() {
        let shows = |lags_rad, variances| fitted(lags_rad, 0.0, &GEARS_RATIOS, variances).shows_lag(4.1, false);
        assert!(shows([0.1, 0.6], [0.09; 2]));
        assert!(!shows([0.0; 2], [0.09; 2]) && !shows([0.1, 0.6], [0.0; 2]));
    }

    #[test]
    fn in_reverse_a_lag_acts_as_forward() {
        let of = |ratio: f64, output_rad_s: f64, rate_rad_s2: f64| {
            InGear { slip: 0.0, variance: 0.01, ratio, output_rad_s, rate_rad_s2 }.row()
        };
        assert_eq!(of(-3.0, -40.0, -20.0), of(3.0, 40.0, 20.0));
    }

    #[test]
    fn what_is_no_number_changes_nothing() {
        let mut fit = fitted([0.0; 2], 0.0, &GEARS_RATIOS, [0.09; 2]);
        let before = fit;
        for wrong in [f64::NAN, f64::INFINITY] {
            let at = InGear { slip: wrong, variance: 0.01, ratio: 1.2, output_rad_s: 100.0, rate_rad_s2: 1.0 };
            fit.take(2, &at, (0.01, 1.0));
            fit.take(2, &InGear { slip: 0.0, rate_rad_s2: wrong, ..at }, (0.01, 1.0));
            fit.take(2, &InGear { slip: 0.0, ..at }, (0.0, 0.0));
        }
        assert_eq!(fit, before);
    }
}
