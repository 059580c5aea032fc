//! What the slip of turbine and output speed in gears shows of their readings and of the ratios.
//!
//! In a gear of ratio `(1 + e) i`, with readings that are late by `d_t` and `d_o` and, of toothed wheels that are not described, by the angles `l_t` and `l_o`,
//!
//! ```text
//! w_t - i w_o = e i w_o + i w_o' (d_o + l_o/w_o - d_t - l_t/w_t)
//! ```
//!
//! Recursive least squares over the time in gears give `d_o - d_t`, `l_o`, `l_t`, and `e` of each gear. They are one estimate: a lag that were left out would look like
//! a delay and an error of the ratio. Of what is equal to the last digit in all readings, as a delay of both, nothing shows.

use drivetrain::Real;

use super::square;

/// Gears whose ratios are followed \[chosen\]; those beyond are taken to have the mean of these.
pub(super) const GEARS: usize = 12;
/// Standard deviations before the first gear: of the delay, s, and of the error of a ratio, as a fraction \[chosen\].
const DELAY_S: f64 = 0.02;
const RATIO: f64 = 5e-3;
/// The delay is not known better than this, s \[chosen\]: it may change.
const DELAY_KNOWN_S: f64 = 2e-4;
/// How long a reading counts for the error of a ratio, s \[chosen\].
const MEMORY_S: f64 = 60.0;
/// Smallest lag of the slip that is taken off, as an angle of the output, rad \[chosen\]: half a pitch of sixty teeth. And its standard deviations.
const LAG_MIN_RAD: f64 = 0.05;
const LAG_SHOWN: f64 = 3.0;
/// Of a sensor without noise, rad^2/s^2 \[chosen\].
const SMALLEST_VARIANCE: f64 = 1e-6;

/// Delay, lags of output and turbine, and error of the ratio of the gear at hand.
const UNKNOWNS: usize = 4;
const OF_RATIO: usize = UNKNOWNS - 1;

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
    /// The slip per delay, lags and error of the ratio.
    fn row(&self) -> [T; UNKNOWNS] {
        // In reverse the ratio is negative, and an age is none.
        let (rate, output) = (self.ratio * self.rate_rad_s2, self.output_rad_s.abs());
        [rate, rate / output, -rate / (self.ratio.abs() * output), self.ratio * self.output_rad_s]
    }
}

/// What is known of a gear that is not at hand.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct OfGear<T> {
    /// Error of the ratio, and its variance.
    error: [T; 2],
    /// For how long it was compared, s, and the mean square of what the unknowns do not explain of the slip, rad^2/s^2.
    time_s: T,
    unexplained: T,
}

/// The estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SlipFit<T> {
    mean: [T; UNKNOWNS],
    covariance: [[T; UNKNOWNS]; UNKNOWNS],
    /// Place of the gear at hand; `GEARS` before the first.
    place: usize,
    gears: [Option<OfGear<T>>; GEARS],
    /// Whether a rate has come.
    has_rate: bool,
}

impl<T: Real> SlipFit<T> {
    /// Before anything was read, with the variances of the lags of turbine and output, rad^2.
    pub(super) fn nothing([turbine, output]: [T; 2]) -> Self {
        let mut covariance = [[T::zero(); UNKNOWNS]; UNKNOWNS];
        let variances = [square(T::of(DELAY_S)), output, turbine, square(T::of(RATIO))];
        for (k, variance) in variances.into_iter().enumerate() {
            covariance[k][k] = variance;
        }
        Self { mean: [T::zero(); UNKNOWNS], covariance, place: GEARS, gears: [None; GEARS], has_rate: false }
    }

    /// Changes to the gear at a place, of whose ratio this error is expected if it was not compared before.
    fn change_to(&mut self, place: usize, expected: T) {
        if place == self.place {
            return;
        }
        if let Some(Some(left)) = self.gears.get_mut(self.place) {
            left.error = [self.mean[OF_RATIO], self.covariance[OF_RATIO][OF_RATIO]];
        }
        self.place = place;
        let error = self.gears.get(place).copied().flatten().map_or([expected, square(T::of(RATIO))], |of| of.error);
        for k in 0..UNKNOWNS {
            (self.covariance[k][OF_RATIO], self.covariance[OF_RATIO][k]) = (T::zero(), T::zero());
        }
        (self.mean[OF_RATIO], self.covariance[OF_RATIO][OF_RATIO]) = (error[0], error[1]);
    }

    /// Takes the slip of the gear at a place over a step, which counts as this part of a reading. `expected` is the error of a ratio that was not compared before.
    pub(super) fn take(&mut self, (place, expected): (usize, T), at: &InGear<T>, (dt_s, counts): (T, T)) {
        self.change_to(place, expected);
        let row = at.row();
        let by_row = self.covariance.each_ref().map(|of| dot(of, &row));
        let per = (dot(&row, &by_row) + at.variance.at_least(T::of(SMALLEST_VARIANCE)) / counts).recip();
        let innovation = at.slip - dot(&row, &self.mean);
        if !(per * innovation).is_finite() {
            return;
        }
        for (k, own) in by_row.into_iter().enumerate() {
            self.mean[k] = self.mean[k] + per * own * innovation;
            for (covariance, other) in self.covariance[k].iter_mut().zip(by_row) {
                *covariance = *covariance - per * own * other;
            }
            self.covariance[k][k] = self.covariance[k][k].at_least(T::zero());
        }
        self.has_rate |= at.rate_rad_s2 != T::zero();
        self.covariance[0][0] = self.covariance[0][0].at_least(square(T::of(DELAY_KNOWN_S)));
        let left = at.slip - dot(&row, &self.mean);
        let Some(gear) = self.gears.get_mut(place) else { return };
        let nothing = OfGear { error: [T::zero(); 2], time_s: T::zero(), unexplained: T::zero() };
        let gear = gear.get_or_insert(nothing);
        gear.time_s = gear.time_s + dt_s;
        gear.unexplained = gear.unexplained + (dt_s / gear.time_s) * (square(left) - gear.unexplained);
        if gear.time_s > T::of(MEMORY_S) {
            gear.time_s = T::of(MEMORY_S);
            let own = &mut self.covariance[OF_RATIO][OF_RATIO];
            *own = *own * (T::one() + dt_s / T::of(MEMORY_S));
        }
    }

    /// Forgets the error of the ratio of a gear.
    pub(super) fn forget(&mut self, place: usize) {
        if let Some(gear) = self.gears.get_mut(place) {
            *gear = None;
        }
        if place == self.place {
            self.place = GEARS;
        }
    }

    /// The delay `d_o - d_t`, s, and its standard deviation; none before a rate has come.
    pub(super) fn delay_s(&self) -> Option<[T; 2]> {
        self.has_rate.then(|| [self.mean[0], self.covariance[0][0].sqrt()])
    }

    /// The lags of turbine and output, rad.
    pub(super) fn lags_rad(&self) -> [T; 2] {
        [self.mean[2], self.mean[1]]
    }

    /// Whether the lag of the slip in the gear of this ratio has shown itself.
    pub(super) fn shows_lag(&self, ratio: T) -> bool {
        let [_, output, turbine, _] = &self.covariance;
        let ratio = ratio.abs();
        let lag = self.mean[1] - self.mean[2] / ratio;
        let variance = output[1] - (output[2] + turbine[1]) / ratio + turbine[2] / square(ratio);
        square(lag) > (square(T::of(LAG_SHOWN)) * variance).at_least(square(T::of(LAG_MIN_RAD)))
    }

    /// Error of the ratio of the gear at hand and its standard deviation, for how long it was compared, s, and the mean square of what is left of the slip, rad^2/s^2.
    pub(super) fn ratio(&self) -> Option<([T; 2], T, T)> {
        let gear = self.gears.get(self.place)?.as_ref()?;
        let std_dev = self.covariance[OF_RATIO][OF_RATIO].sqrt();
        Some(([self.mean[OF_RATIO], std_dev], gear.time_s, gear.unexplained))
    }

    /// What delay and lags make of the slip, rad/s.
    pub(super) fn late_rad_s(&self, at: &InGear<T>) -> T {
        let mut row = at.row();
        row[OF_RATIO] = T::zero();
        dot(&row, &self.mean)
    }
}

fn dot<T: Real>(a: &[T; UNKNOWNS], b: &[T; UNKNOWNS]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
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
                    fit.take((place, 0.0), &at, (0.01, 1.0));
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

    #[test]
    fn a_lag_is_shown_by_wheels_that_are_not_described_alone() {
        let shows = |lags_rad, variances| fitted(lags_rad, 0.0, &GEARS_RATIOS, variances).shows_lag(4.1);
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
            fit.take((2, 0.0), &at, (0.01, 1.0));
            fit.take((2, 0.0), &InGear { slip: 0.0, rate_rad_s2: wrong, ..at }, (0.01, 1.0));
        }
        assert_eq!(fit, before);
    }
}
