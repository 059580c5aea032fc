//! How residuals are weighed: one-step prediction errors of "white noise and a random walk", robustly.
//!
//! `e_k = r_k - s_(k-1)`, `s_k = s_(k-1) + g e_k`: `g = 0` is the error of the output, `g = 1` that of its changes. The errors of engine
//! speed and maps act as torques and add up in the speeds; how much they do so, `g` is found from the residuals themselves.

use drivetrain::Real;

/// Beyond so many scales a residual counts linearly.
pub(crate) const HUBER: f64 = 2.5;
/// Factor on standard deviations for what the model leaves out, from fits of cars whose parameters are known.
pub(crate) const FACTOR: f64 = 1.4;
/// Standard deviation of a normal distribution over the median of its sizes.
const MAD: f64 = 1.4826;
/// Half of the interval that holds a normal value in 95 %, in standard deviations.
pub(crate) const NORMAL_95: f64 = 1.96;
/// Standard deviation of the logarithm of [`MAD`] times the median of the sizes of n errors, times the root of n: `1/(4 phi(q) q)` with the quartile `q` of
/// a normal distribution and its density `phi`.
const SCALE_SD: f64 = 1.166;
/// The values that `g` is chosen from.
const GAINS: [f64; 14] = [0.0, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8];

/// Gain and scale of the one-step errors of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChannelWeights {
    pub(crate) gain: f64,
    pub(crate) scale: f64,
    /// Intervals that hold gain and scale in 95 %.
    intervals: [[f64; 2]; 2],
    /// Factor by which the information of the readings is less than that of independent ones of a perfect model, in the fit as in the
    /// intervals: otherwise what is known before would count too little in the fit.
    pub(crate) inflation: f64,
}

impl ChannelWeights {
    /// What is usual for a channel.
    pub(crate) const fn usual(gain: f64, scale: f64) -> Self {
        Self { gain, scale, intervals: [[0.0, 1.0], [0.0, f64::INFINITY]], inflation: FACTOR * FACTOR }
    }

    /// What a fit says of them.
    pub(crate) fn one_step(&self) -> OneStep {
        let [gain_interval, scale_interval] = self.intervals;
        OneStep { scale: self.scale, scale_interval, gain: self.gain, gain_interval }
    }

    /// One-step errors of residuals, or of a column of their derivatives, in scales.
    pub(crate) fn in_scales(&self, column: &mut [f64]) {
        one_step(column, self.gain);
        column.iter_mut().for_each(|error| *error /= self.scale);
    }

    pub(crate) fn weight(&self, error: f64) -> f64 {
        (HUBER / error.abs()).min(1.0) / self.inflation
    }

    /// Half the robust sum of squares.
    pub(crate) fn cost(&self, errors: &[f64]) -> f64 {
        let loss = |e: &f64| if e.abs() <= HUBER { e * e } else { HUBER * (2.0 * e.abs() - HUBER) };
        0.5 * errors.iter().map(loss).sum::<f64>() / self.inflation
    }

    /// For errors that are to be independent already.
    pub(crate) fn of_independent(errors: &[f64], scale: f64) -> Self {
        let inflation = FACTOR * FACTOR * correlation(&[errors], 0.0, scale);
        Self { inflation, ..Self::usual(0.0, scale) }
    }

    /// Those that residuals ask for; without any they stay.
    pub(crate) fn following(self, blocks: &[&[f64]]) -> Self {
        let spreads = GAINS.map(|gain| spread(blocks, gain));
        let least = spreads.iter().copied().enumerate().min_by(|one, other| one.1.0.total_cmp(&other.1.0));
        let Some((at, (sum, scale))) = least.filter(|(_, (_, scale))| *scale > 0.0) else { return self };
        let gain = GAINS[at];
        let correlation = correlation(blocks, gain, scale);
        // As many errors that are independent.
        let count = blocks.iter().map(|block| block.len()).sum::<usize>() as f64 / correlation;
        let half = NORMAL_95 * SCALE_SD / count.sqrt();
        let scales = [-half, half].map(|side| scale * Real::exp(side));
        // Gains whose likelihood is not too small; each stands for those that are nearest to it.
        let is_possible = |&(other, _): &(f64, f64)| count * Real::ln(other / sum) <= NORMAL_95 * NORMAL_95;
        let from = spreads.iter().position(is_possible).unwrap_or(at);
        let to = spreads.iter().rposition(is_possible).unwrap_or(at);
        let middle = |one: usize, other: f64| 0.5 * (GAINS[one] + other);
        let gains = [
            if from == 0 { 0.0 } else { middle(from, GAINS[from - 1]) },
            GAINS.get(to + 1).map_or(1.0, |next| middle(to, *next)),
        ];
        Self { gain, scale, intervals: [gains, scales], inflation: FACTOR * FACTOR * correlation }
    }
}

/// One-step errors of a channel, as `residual = white noise + random walk` leaves them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OneStep {
    /// Their robust standard deviation, in the unit of the channel.
    pub scale: f64,
    /// What holds it in 95 %, by the noise of the readings; shifts may differ by more.
    pub scale_interval: [f64; 2],
    /// The gain `g`: 0 for white noise, 1 for a random walk.
    pub gain: f64,
    /// What holds it in 95 %.
    pub gain_interval: [f64; 2],
}

/// Turns residuals into one-step errors. The first is the residual itself.
fn one_step(residuals: &mut [f64], gain: f64) {
    let mut state = 0.0;
    for residual in residuals {
        *residual -= state;
        state += gain * *residual;
    }
}

/// Robust sum of squares of the one-step errors with this gain, and their scale.
fn spread(blocks: &[&[f64]], gain: f64) -> (f64, f64) {
    let mut errors: Vec<f64> = blocks
        .iter()
        .flat_map(|block| {
            let mut errors = block.to_vec();
            one_step(&mut errors, gain);
            errors
        })
        .collect();
    if errors.is_empty() {
        return (f64::INFINITY, 0.0);
    }
    let middle = errors.len() / 2;
    errors.iter_mut().for_each(|error| *error = error.abs());
    let (_, median, _) = errors.select_nth_unstable_by(middle, f64::total_cmp);
    let scale = MAD * *median;
    (errors.iter().map(|error| Real::powi(error.min(3.0 * HUBER * scale), 2)).sum(), scale)
}

/// Correlation factor of the one-step errors, at least 1.
pub(crate) fn correlation(blocks: &[&[f64]], gain: f64, scale: f64) -> f64 {
    let errors: Vec<Vec<f64>> = (blocks.iter())
        .map(|block| {
            let mut errors = block.to_vec();
            one_step(&mut errors, gain);
            errors.iter_mut().for_each(|error| *error /= scale);
            errors
        })
        .collect();
    correlation_factor(&errors.iter().map(Vec::as_slice).collect::<Vec<_>>()).max(1.0)
}

/// Factor by which the variance of a mean of errors that are alike in sequence exceeds that of independent ones.
fn correlation_factor(blocks: &[&[f64]]) -> f64 {
    const LAGS: usize = 30;
    let limited = |error: f64| error.clamp(-HUBER, HUBER);
    let variance: f64 = blocks.iter().copied().flatten().map(|error| Real::powi(limited(*error), 2)).sum();
    let mut factor = 1.0;
    for lag in 1..=LAGS {
        let product: f64 = (blocks.iter())
            .flat_map(|block| block.iter().zip(block.iter().skip(lag)).map(|(a, b)| limited(*a) * limited(*b)))
            .sum();
        let correlation = product / variance.max(f64::MIN_POSITIVE);
        // Beyond the first lag without correlation there is only noise.
        if correlation < 0.02 {
            break;
        }
        factor += 2.0 * correlation;
    }
    factor
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal values by the sum of twelve uniform ones, by Marsaglia's generator.
    fn normal(bits: &mut u64) -> f64 {
        let uniform = |_| {
            *bits ^= *bits << 13;
            *bits ^= *bits >> 7;
            *bits ^= *bits << 17;
            (*bits >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(uniform).sum::<f64>() - 6.0
    }

    #[test]
    fn intervals_of_scale_and_gain_hold_the_values_of_the_process() {
        let (mut bits, logs) = (88_172_645_463_325_252, 400);
        for true_gain in [0.0, 0.3, 1.0] {
            let mut holds = [0; 2];
            for _ in 0..logs {
                // Three shifts of 100 readings: r = s + e, s' = s + g e.
                let shifts: Vec<Vec<f64>> = (0..3)
                    .map(|_| {
                        let mut state = 0.0;
                        let mut next = |_| {
                            let error = 0.2 * normal(&mut bits);
                            let residual = state + error;
                            state += true_gain * error;
                            residual
                        };
                        (0..100).map(&mut next).collect()
                    })
                    .collect();
                let blocks: Vec<&[f64]> = shifts.iter().map(Vec::as_slice).collect();
                let found = ChannelWeights::usual(0.3, 0.5).following(&blocks).one_step();
                let is_within = |[low, high]: [f64; 2], value: f64| (low..=high).contains(&value);
                holds[0] += usize::from(is_within(found.scale_interval, 0.2));
                holds[1] += usize::from(is_within(found.gain_interval, true_gain));
                assert!(is_within(found.scale_interval, found.scale) && is_within(found.gain_interval, found.gain));
            }
            assert!(holds.iter().all(|held| *held >= logs * 9 / 10), "g {true_gain}: {holds:?} of {logs}");
        }
    }

    #[test]
    fn without_residuals_nothing_is_known_of_a_channel() {
        for blocks in [&[][..], &[&[][..]], &[&[f64::NAN; 5][..]], &[&[0.0; 5][..]]] {
            let found = ChannelWeights::usual(0.3, 0.5).following(blocks).one_step();
            assert_eq!((found.scale_interval, found.gain_interval), ([0.0, f64::INFINITY], [0.0, 1.0]));
        }
    }
}
