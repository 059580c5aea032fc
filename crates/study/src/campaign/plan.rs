//! The values of the factors in each run.
//!
//! Every plan is a function of the run's number alone: runs can be made in any order, on any thread or machine.

use config::{Plan, Sometimes, Study, Values};
use drivetrain::Real;
use evaluate::mixed;

/// Values of the factors in a run, in the order of the factors.
pub fn factor_values(study: &Study, run: u64) -> Vec<f64> {
    let places = places(study, run);
    study.factors.iter().zip(places).map(|(factor, place)| value_at(&factor.values, place)).collect()
}

/// Seed of a run's sensors.
pub fn run_seed(study: &Study, run: u64) -> u64 {
    mixed(study.seed, run)
}

/// Which of Saltelli's samples a run belongs to: its group, and 0 for A, 1 for B, 2 + i for A with column i of B.
pub fn saltelli_place(study: &Study, run: u64) -> (u64, u64) {
    let group = study.factors.len() as u64 + 2;
    (run / group, run % group)
}

/// Position of each factor in its values, from 0 to 1; for levels, that of the middle of the level.
pub(crate) fn places(study: &Study, run: u64) -> Vec<f64> {
    let count = study.factors.len();
    match study.plan {
        Plan::FullFactorial => {
            let mut rest = run;
            let level = |values: &Values| {
                let levels = values.levels() as u64;
                let at = rest % levels;
                rest /= levels;
                as_f64(at) / as_f64(levels) + 0.5 / as_f64(levels)
            };
            // The last factor changes fastest.
            let mut places: Vec<f64> = study.factors.iter().rev().map(|f| &f.values).map(level).collect();
            places.reverse();
            places.iter().zip(&study.factors).map(|(&place, factor)| ends_for_levels(&factor.values, place)).collect()
        }
        Plan::LatinHypercube => (0..count as u64)
            .map(|i| {
                let layer = shuffled(run % study.runs, study.runs, mixed(study.seed, i));
                (as_f64(layer) + unit(study.seed, run, i)) / as_f64(study.runs)
            })
            .collect(),
        Plan::Sobol => (0..count).map(|i| sobol(study, run, i)).collect(),
        Plan::Random => (0..count as u64).map(|i| unit(study.seed, run, i)).collect(),
        Plan::Saltelli => {
            let (group, sample) = saltelli_place(study, run);
            let from_b = |i: usize| sample == 1 || sample == 2 + i as u64;
            (0..count).map(|i| sobol(study, group, if from_b(i) { count + i } else { i })).collect()
        }
    }
}

/// Levels of a range reach from end to end.
fn ends_for_levels(values: &Values, place: f64) -> f64 {
    match values {
        Values::List(_) => place,
        Values::Sometimes(sometimes) => {
            // The first level is the value without the factor.
            let levels = values.levels() as f64;
            let within = (place * levels - 1.0) / (levels - 1.0);
            if within < 0.0 { 0.0 } else { sometimes.place_within(ends_for_levels(&sometimes.values, within)) }
        }
        _ => {
            let levels = values.levels() as f64;
            ((place * levels - 0.5) / (levels - 1.0)).clamp(0.0, 1.0)
        }
    }
}

/// Number of points of the Sobol sequence, after which it would repeat.
const SOBOL_LENGTH: u64 = 1 << 16;

fn sobol(study: &Study, run: u64, dimension: usize) -> f64 {
    // The sequence is SOBOL_LENGTH long; another scramble of it follows.
    let (part, index) = (run / SOBOL_LENGTH, run % SOBOL_LENGTH);
    // Below the limits of the sequence; the seed's upper half is meant.
    let (index, dimension, seed) = (index as u32, dimension as u32, (mixed(study.seed, part) >> 32) as u32);
    f64::from(sobol_burley::sample(index, dimension, seed))
}

/// The value at a place between 0 and 1.
pub(crate) fn value_at(values: &Values, place: f64) -> f64 {
    match *values {
        Values::List(ref list) => {
            let at = (place * list.len() as f64) as usize;
            list[at.min(list.len() - 1)]
        }
        Values::Uniform(low, high, _) => low + place * (high - low),
        Values::LogUniform(low, high, _) => low * Real::powf(high / low, place),
        Values::Normal(mean, std_dev, _) => {
            // Cut off at three standard deviations.
            let [low, high] = [-3.0, 3.0].map(normal_cdf);
            mean + std_dev * normal_quantile(low + place * (high - low)).clamp(-3.0, 3.0)
        }
        Values::Sometimes(Sometimes { chance, otherwise, ref values }) => {
            let rest = 1.0 - chance;
            if place < rest { otherwise } else { value_at(values, ((place - rest) / chance).min(1.0)) }
        }
    }
}

/// Probability that a standard normal variable is below this.
fn normal_cdf(x: f64) -> f64 {
    0.5 * Real::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

/// The value that a standard normal variable is below with this probability, which is that of a value within five standard deviations:
/// Halley's iteration from the middle, whose steps approach the value from one side.
fn normal_quantile(probability: f64) -> f64 {
    let mut x = 0.0;
    for _ in 0..16 {
        let density = Real::exp(-0.5 * x * x) / std::f64::consts::TAU.sqrt();
        let step = (normal_cdf(x) - probability) / density;
        x -= step / (1.0 + 0.5 * x * step);
    }
    x
}

/// Position of a value in its factor's values, from 0 to 1.
pub(crate) fn place_of(values: &Values, value: f64) -> f64 {
    match values {
        Values::List(list) => {
            let at = list.iter().position(|&x| x.total_cmp(&value).is_eq()).unwrap_or(0);
            (at as f64 + 0.5) / list.len() as f64
        }
        Values::Uniform(low, high, _) => (value - low) / (high - low),
        Values::LogUniform(low, high, _) => Real::ln(value / low) / Real::ln(high / low),
        Values::Normal(mean, std_dev, _) => normal_cdf((value - mean) / std_dev),
        Values::Sometimes(sometimes) if value.total_cmp(&sometimes.otherwise).is_eq() => 0.5 * (1.0 - sometimes.chance),
        Values::Sometimes(sometimes) => sometimes.place_within(place_of(&sometimes.values, value)),
    }
}

/// A number from 0 to 1 that belongs to a run and a factor.
fn unit(seed: u64, run: u64, factor: u64) -> f64 {
    as_f64(mixed(mixed(seed, factor + 1), run) >> 11) / as_f64(1 << 53)
}

/// Where `at` goes in a permutation of `count` numbers that belongs to the seed: a Feistel network over the next
/// power of four, walked until it comes back into range.
fn shuffled(at: u64, count: u64, seed: u64) -> u64 {
    let half_bits = (64 - count.saturating_sub(1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1_u64 << half_bits) - 1;
    let mut x = at;
    loop {
        let (mut left, mut right) = (x >> half_bits, x & mask);
        for round in 0..4 {
            (left, right) = (right, left ^ (mixed(seed ^ round, right) & mask));
        }
        x = (left << half_bits) | right;
        if x < count {
            return x;
        }
    }
}

fn as_f64(x: u64) -> f64 {
    x as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shuffle_meets_every_number_once() {
        for count in [1, 2, 7, 64, 1000] {
            let mut seen: Vec<u64> = (0..count).map(|at| shuffled(at, count, 5)).collect();
            assert!(count < 7 || seen != (0..count).collect::<Vec<_>>());
            seen.sort_unstable();
            assert_eq!(seen, (0..count).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_study_may_have_as_many_factors_as_the_sobol_sequence_has_dimensions() {
        assert_eq!(config::study::SOBOL_DIMENSIONS, sobol_burley::NUM_DIMENSIONS as usize);
    }

    #[test]
    fn numbers_of_runs_and_factors_are_spread_evenly() {
        let (mut mean, mut cross) = (0.0, 0.0);
        for run in 0..10_000 {
            let (a, b) = (unit(1, run, 0), unit(1, run, 1));
            mean += a / 1e4;
            cross += (a - 0.5) * (b - 0.5) / 1e4;
        }
        // Five standard errors.
        assert!((mean - 0.5).abs() < 5.0 * 0.289 / 100.0 && cross.abs() < 5.0 / 12.0 / 100.0, "{mean} {cross}");
    }

    #[test]
    fn quantiles_of_the_normal_distribution_are_those_of_its_tables() {
        // Abramowitz and Stegun, table 26.5.
        for (probability, x) in [(0.5, 0.0), (0.975, 1.959_963_984_540_054), (0.999, 3.090_232_306_167_813_5)] {
            assert!(
                (normal_quantile(probability) - x).abs() < 1e-13,
                "{probability}: {}",
                normal_quantile(probability)
            );
        }
        for step in -50..=50 {
            let x = f64::from(step) / 10.0;
            assert!((normal_quantile(normal_cdf(x)) - x).abs() < 1e-9, "{x}: {}", normal_quantile(normal_cdf(x)));
        }
    }

    #[test]
    fn a_normal_factor_has_its_mean_and_standard_deviation() {
        let normal = Values::Normal(10.0, 2.0, 3);
        let draws: Vec<f64> = (0..1000).map(|i| value_at(&normal, (f64::from(i) + 0.5) / 1000.0)).collect();
        let mean = draws.iter().sum::<f64>() / 1000.0;
        let std_dev = (draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 1000.0).sqrt();
        assert!((mean - 10.0).abs() < 1e-6 && (std_dev - 1.973).abs() < 0.01, "{mean} {std_dev}");
        assert!(draws.iter().all(|x| (4.0..=16.0).contains(x)));
    }
}
