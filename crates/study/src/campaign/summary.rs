//! Summary of a study's rows, computed row by row in memory that does not grow with their number.

use std::collections::BTreeMap;

use config::{Plan, Study};
use drivetrain::Real;

use super::layout::{Layout, Metric, PHASES};
use super::plan::{place_of, saltelli_place};
use super::row::{Row, Status};

/// Bins of a distribution per factor of two: quantiles are good to half a per cent.
const BINS_PER_OCTAVE: f64 = 64.0;
/// Bins over a factor's values for its main effect.
pub const EFFECT_BINS: usize = 10;
/// How many of the worst runs are kept.
pub const WORST: usize = 10;

/// How a positive quantity is distributed. Runs in which it is infinite, because an estimate diverged, lie above all
/// others.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Distribution {
    bins: BTreeMap<i32, u64>,
    count: u64,
    diverged: u64,
    largest: f64,
}

impl Distribution {
    /// Takes a value; NaN is none.
    fn push(&mut self, value: f64) {
        if value.is_nan() {
            return;
        }
        self.count += 1;
        self.largest = self.largest.max(value);
        if value.is_infinite() {
            self.diverged += 1;
            return;
        }
        let bin = (Real::log2(value.max(1e-12)) * BINS_PER_OCTAVE).floor().clamp(-1e6, 1e6) as i32;
        *self.bins.entry(bin).or_default() += 1;
    }

    /// How many values there were.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// How many of them were infinite.
    pub fn diverged(&self) -> u64 {
        self.diverged
    }

    /// The largest value; NaN without values.
    pub fn largest(&self) -> f64 {
        if self.count > 0 { self.largest } else { f64::NAN }
    }

    /// The quantile for this fraction; NaN without values.
    pub fn quantile(&self, fraction: f64) -> f64 {
        let wanted = fraction * as_f64(self.count);
        let mut below = 0;
        for (&bin, &count) in &self.bins {
            below += count;
            if as_f64(below) >= wanted {
                return Real::exp2((f64::from(bin) + 0.5) / BINS_PER_OCTAVE).min(self.largest);
            }
        }
        if self.count > 0 { f64::INFINITY } else { f64::NAN }
    }

    /// Fraction of the values below a limit.
    pub fn fraction_below(&self, limit: f64) -> f64 {
        let below: u64 = self.bins.iter().filter(|&(&bin, _)| upper_edge(bin) <= limit).map(|(_, count)| count).sum();
        as_f64(below) / as_f64(self.count.max(1))
    }
}

/// Ratio of two errors in the same run; infinite if the first one diverged.
pub(crate) fn over(error: f64, other: f64) -> f64 {
    if error.is_infinite() { error } else { error / other }
}

fn upper_edge(bin: i32) -> f64 {
    Real::exp2((f64::from(bin) + 1.0) / BINS_PER_OCTAVE)
}

/// Sums from which a mean and a variance follow.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Moments {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Moments {
    fn push(&mut self, value: f64) {
        self.count += 1.0;
        let step = value - self.mean;
        self.mean += step / self.count;
        self.squares += step * (value - self.mean);
    }

    fn variance(&self) -> f64 {
        if self.count > 1.0 { self.squares / (self.count - 1.0) } else { 0.0 }
    }
}

/// How one factor moves one score.
#[derive(Debug, Clone, PartialEq)]
pub struct FactorEffect {
    /// The factor.
    pub factor: String,
    /// Mean of the finite scores over the factor's bins from its smallest to its largest value; NaN for an empty bin.
    pub means: Vec<f64>,
    /// First-order Sobol index: fraction of the score's variance that this factor explains alone.
    pub first_order: f64,
    /// Total Sobol index: fraction of the variance that would go if the factor were known, interactions included;
    /// only a Saltelli plan gives it.
    pub total: Option<f64>,
}

/// Sums for the effects of all factors on one score.
#[derive(Debug, Clone, PartialEq)]
struct Effects {
    all: Moments,
    bins: Vec<[Moments; EFFECT_BINS]>,
    /// Of Saltelli's arrangement: sums of (fB - fABi)^2 / 2 and (fA - fABi)^2 / 2, moments of fA and fB (M. Jansen,
    /// Analysis of variance designs for model output, Comput. Phys. Commun. 117 (1999) 35).
    first: Vec<f64>,
    total: Vec<f64>,
    pairs: f64,
    samples: Moments,
}

/// The errors that are compared with those of the open loop.
pub const COMPARED: [Metric; 2] = [Metric::PressureRms, Metric::TorqueRms];

/// The errors of an observer over those of the open loop, in one phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative {
    /// Median of the ratio within a run.
    pub median: f64,
    /// Its 95 % quantile.
    pub high: f64,
    /// The maximum.
    pub largest: f64,
    /// 95 % quantile of the errors over the 95 % quantile of the open loop's.
    pub high_over_high: f64,
    /// Largest error over the largest one of the open loop.
    pub worst_over_worst: f64,
    /// Fraction of the runs in which the error is smaller.
    pub better: f64,
}

/// What a study's rows say together.
#[derive(Debug, Clone)]
pub struct Summary {
    study: Study,
    /// Positions in a row.
    pub layout: Layout,
    /// How many runs ended how.
    pub statuses: BTreeMap<Status, u64>,
    /// Of each of [`COMPARED`].
    errors: [Vec<Distribution>; COMPARED.len()],
    ratios: [Vec<Distribution>; COMPARED.len()],
    chatter: Vec<Distribution>,
    widths: Vec<Distribution>,
    covered: Vec<(u64, u64)>,
    effects: Vec<Effects>,
    /// Rows of the group of a Saltelli plan that is not complete yet.
    group: Vec<Row>,
    /// The runs in which the first observer has the largest RMS error of the pressure in either phase, the worst
    /// first: those in which it diverged, if there are any.
    pub worst: Vec<Row>,
}

impl Summary {
    /// Of no rows yet.
    pub fn new(study: &Study) -> Self {
        let layout = Layout::of(study);
        let scores = layout.observers.len() * PHASES.len();
        let factors = layout.factors.len();
        let effects = Effects {
            all: Moments::default(),
            bins: vec![[Moments::default(); EFFECT_BINS]; factors],
            first: vec![0.0; factors],
            total: vec![0.0; factors],
            pairs: 0.0,
            samples: Moments::default(),
        };
        Self {
            study: study.clone(),
            layout,
            statuses: BTreeMap::new(),
            errors: COMPARED.map(|_| vec![Distribution::default(); scores]),
            ratios: COMPARED.map(|_| vec![Distribution::default(); scores]),
            chatter: vec![Distribution::default(); scores],
            widths: vec![Distribution::default(); scores],
            covered: vec![(0, 0); scores],
            effects: vec![effects; scores],
            group: Vec::new(),
            worst: Vec::new(),
        }
    }

    /// Number of rows.
    pub fn runs(&self) -> u64 {
        self.statuses.values().sum()
    }

    /// RMS error of an observer's pressure in a phase, Pa.
    pub fn rms(&self, observer: usize, phase: usize) -> &Distribution {
        &self.errors[0][observer * PHASES.len() + phase]
    }

    /// The same over that of the open loop in the same run.
    pub fn ratio(&self, observer: usize, phase: usize) -> &Distribution {
        &self.ratios[0][observer * PHASES.len() + phase]
    }

    /// One of the [`COMPARED`] errors of an observer in a phase, over that of the open loop; nothing for the open loop
    /// itself, and without one.
    pub fn relative(&self, compared: usize, observer: usize, phase: usize) -> Option<Relative> {
        let open_loop = self.layout.open_loop.filter(|&open_loop| open_loop != observer)?;
        let at = |observer: usize| observer * PHASES.len() + phase;
        let (mine, reference) = (&self.errors[compared][at(observer)], &self.errors[compared][at(open_loop)]);
        let ratio = &self.ratios[compared][at(observer)];
        Some(Relative {
            median: ratio.quantile(0.5),
            high: ratio.quantile(0.95),
            largest: ratio.largest(),
            high_over_high: over(mine.quantile(0.95), reference.quantile(0.95)),
            worst_over_worst: over(mine.largest(), reference.largest()),
            better: ratio.fraction_below(1.0),
        })
    }

    /// Chatter of an observer in a phase, Pa.
    pub fn chatter(&self, observer: usize, phase: usize) -> &Distribution {
        &self.chatter[observer * PHASES.len() + phase]
    }

    /// Mean width of the guaranteed range of an observer's pressure in a phase, Pa.
    pub fn width(&self, observer: usize, phase: usize) -> &Distribution {
        &self.widths[observer * PHASES.len() + phase]
    }

    /// Runs in which the guaranteed range of an observer held the truth throughout a phase, and runs with a range.
    pub fn covered(&self, observer: usize, phase: usize) -> (u64, u64) {
        self.covered[observer * PHASES.len() + phase]
    }

    /// Takes the next row; rows come in the order of their numbers.
    pub fn push(&mut self, row: &Row) {
        *self.statuses.entry(row.status).or_default() += 1;
        if self.study.plan == Plan::Saltelli {
            self.take_group(row);
        }
        if !row.status.is_scored() {
            return;
        }
        let places = self.places(row);
        for observer in 0..self.layout.observers.len() {
            for phase in 0..PHASES.len() {
                let at = observer * PHASES.len() + phase;
                let value = |observer, metric| row.numbers[self.layout.score(observer, phase, metric)];
                for (i, metric) in COMPARED.into_iter().enumerate() {
                    let error = value(observer, metric);
                    self.errors[i][at].push(error);
                    if let Some(open_loop) = self.layout.open_loop {
                        self.ratios[i][at].push(over(error, value(open_loop, metric)));
                    }
                }
                let rms = value(observer, Metric::PressureRms);
                self.chatter[at].push(value(observer, Metric::Chatter));
                let coverage = value(observer, Metric::Coverage);
                if !coverage.is_nan() {
                    self.widths[at].push(value(observer, Metric::RangeWidth));
                    let (covered, all) = &mut self.covered[at];
                    *covered += u64::from(coverage >= 1.0);
                    *all += 1;
                }
                // A mean and a variance are of numbers.
                if rms.is_finite() {
                    self.effects[at].push(rms, &places);
                }
            }
        }
        self.keep_if_among_the_worst(row);
    }

    fn places(&self, row: &Row) -> Vec<f64> {
        self.study.factors.iter().zip(&row.numbers).map(|(factor, &value)| place_of(&factor.values, value)).collect()
    }

    fn keep_if_among_the_worst(&mut self, row: &Row) {
        let size = |row: &Row, layout: &Layout| {
            let rms = |phase| row.numbers[layout.score(0, phase, Metric::PressureRms)];
            (0..PHASES.len()).map(rms).fold(0.0, f64::max)
        };
        let mine = size(row, &self.layout);
        let at = self.worst.iter().position(|other| mine > size(other, &self.layout)).unwrap_or(self.worst.len());
        if at < WORST {
            self.worst.insert(at, row.clone());
            self.worst.truncate(WORST);
        }
    }

    /// Saltelli's estimators for a whole group of runs.
    fn take_group(&mut self, row: &Row) {
        let (_, sample) = saltelli_place(&self.study, row.run);
        if sample == 0 {
            self.group.clear();
        }
        self.group.push(row.clone());
        let factors = self.layout.factors.len();
        if self.group.len() != factors + 2 || !self.group.iter().all(|row| row.status.is_scored()) {
            return;
        }
        for observer in 0..self.layout.observers.len() {
            for phase in 0..PHASES.len() {
                let column = self.layout.score(observer, phase, Metric::PressureRms);
                let f: Vec<f64> = self.group.iter().map(|row| row.numbers[column]).collect();
                if f.iter().any(|score| !score.is_finite()) {
                    continue;
                }
                let effects = &mut self.effects[observer * PHASES.len() + phase];
                effects.pairs += 1.0;
                effects.samples.push(f[0]);
                effects.samples.push(f[1]);
                for i in 0..factors {
                    effects.first[i] += 0.5 * Real::powi(f[1] - f[2 + i], 2);
                    effects.total[i] += 0.5 * Real::powi(f[0] - f[2 + i], 2);
                }
            }
        }
    }

    /// How the factors move the RMS error of an observer's pressure in a phase, Pa.
    pub fn effects(&self, observer: usize, phase: usize) -> Vec<FactorEffect> {
        let effects = &self.effects[observer * PHASES.len() + phase];
        let saltelli = effects.pairs > 0.0 && effects.samples.variance() > 0.0;
        (self.layout.factors.iter().enumerate())
            .map(|(i, factor)| FactorEffect {
                factor: factor.clone(),
                means: effects.bins[i].iter().map(|bin| if bin.count > 0.0 { bin.mean } else { f64::NAN }).collect(),
                first_order: if saltelli {
                    1.0 - effects.first[i] / effects.pairs / effects.samples.variance()
                } else {
                    effects.explained(i)
                },
                total: saltelli.then(|| effects.total[i] / effects.pairs / effects.samples.variance()),
            })
            .collect()
    }
}

impl Effects {
    fn push(&mut self, value: f64, places: &[f64]) {
        self.all.push(value);
        for (bins, place) in self.bins.iter_mut().zip(places) {
            let bin = (place * EFFECT_BINS as f64) as usize;
            bins[bin.min(EFFECT_BINS - 1)].push(value);
        }
    }

    /// Fraction of the variance between the means of the bins, less what chance alone would put there.
    fn explained(&self, factor: usize) -> f64 {
        let bins = self.bins[factor].iter().filter(|bin| bin.count > 0.0);
        let count = bins.clone().count() as f64;
        if self.all.count <= count || self.all.squares <= 0.0 {
            return f64::NAN;
        }
        let between: f64 = bins.clone().map(|bin| bin.count * Real::powi(bin.mean - self.all.mean, 2)).sum();
        let within = bins.map(|bin| bin.squares).sum::<f64>() / (self.all.count - count);
        (between - (count - 1.0) * within) / self.all.squares
    }
}

fn as_f64(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_good_to_a_per_cent() {
        let mut distribution = Distribution::default();
        (1..=1000).for_each(|i| distribution.push(f64::from(i)));
        for fraction in [0.05, 0.5, 0.95] {
            assert!((distribution.quantile(fraction) / (1000.0 * fraction) - 1.0).abs() < 0.01);
        }
        assert_eq!(distribution.largest(), 1000.0);
        assert!((distribution.fraction_below(250.0) - 0.25).abs() < 0.01);
    }

    #[test]
    fn diverged_runs_are_counted_and_lie_above_all_others() {
        let mut distribution = Distribution::default();
        (1..=90).for_each(|i| distribution.push(f64::from(i)));
        (0..10).for_each(|_| distribution.push(f64::INFINITY));
        distribution.push(f64::NAN);
        assert_eq!((distribution.count(), distribution.diverged()), (100, 10));
        assert!(distribution.quantile(0.9) < 91.0 && distribution.quantile(0.95) == f64::INFINITY);
        assert!((distribution.fraction_below(1e9) - 0.9).abs() < 1e-12 && distribution.largest() == f64::INFINITY);
        assert!(Distribution::default().largest().is_nan() && Distribution::default().quantile(0.5).is_nan());
        assert_eq!([over(f64::INFINITY, f64::INFINITY), over(1.0, f64::INFINITY)], [f64::INFINITY, 0.0]);
    }

    #[test]
    fn the_explained_fraction_is_that_of_a_known_function() {
        // f = 3 a + b on the unit square: variances 9/12 and 1/12.
        let mut effects = Effects {
            all: Moments::default(),
            bins: vec![[Moments::default(); EFFECT_BINS]; 3],
            first: vec![],
            total: vec![],
            pairs: 0.0,
            samples: Moments::default(),
        };
        for i in 0..10_000_u32 {
            let place = |k: u32| (f64::from(i) * [0.618_034, 0.414_214, 0.732_051][k as usize]).fract();
            effects.push(3.0 * place(0) + place(1), &[place(0), place(1), place(2)]);
        }
        let fractions = [0, 1, 2].map(|i| effects.explained(i));
        // Ten bins cannot see what varies within them: one hundredth of the factor's fraction.
        for (fraction, exact) in fractions.iter().zip([0.9 * 0.99, 0.1 * 0.99, 0.0]) {
            assert!((fraction - exact).abs() < 0.01, "{fractions:?}");
        }
    }
}
