//! What is in a log: for each channel samples, rate, span, values, gaps.

use crate::samples::{Quality, QualityCounts, Sample};
use crate::{Log, LogError};

/// Intervals of which the middle one is the period of a channel: so many, of very many channels fewer, so that all have at most so many, but
/// so many at least.
const FIRST: usize = 512;
const INTERVALS: usize = 4 << 20;
const FEWEST: usize = 7;
/// An interval of so many periods is a gap.
pub const GAP: f64 = 5.0;

/// What is known of a channel after all samples.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChannelSummary {
    /// Samples of each quality.
    pub counts: QualityCounts,
    /// Middle interval between the first samples, s; none with fewer than two.
    pub period_s: Option<f64>,
    /// Times of the first and the last sample, s.
    pub span_s: Option<[f64; 2]>,
    /// Minimum and maximum good value.
    pub range: Option<[f64; 2]>,
    /// Intervals longer than [`GAP`] periods.
    pub gaps: u64,
    /// The longest interval, s.
    pub longest_s: f64,
}

/// What is in a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// What is known of each of [`Log::channels`].
    pub channels: Vec<ChannelSummary>,
    /// What else is to be said.
    pub notes: Vec<String>,
}

impl Inspection {
    /// Minimum and maximum of the values of each channel, in its unit.
    pub fn ranges(&self) -> Vec<Option<[f64; 2]>> {
        self.channels.iter().map(|channel| channel.range).collect()
    }
}

/// A channel while it is read. A log may have very many.
#[derive(Default)]
struct Watched {
    summary: ChannelSummary,
    /// Those before the period is known.
    intervals_s: Vec<f64>,
}

impl Watched {
    fn push(&mut self, first: usize, Sample { time_s, value, quality, .. }: Sample) {
        self.summary.counts.push(quality);
        if !matches!(quality, Quality::Repeated | Quality::Backward) {
            match &mut self.summary.span_s {
                None => self.summary.span_s = Some([time_s, time_s]),
                Some([_, last_s]) => {
                    let interval_s = time_s - *last_s;
                    *last_s = time_s;
                    self.interval(first, interval_s);
                }
            }
        }
        if quality == Quality::Good {
            let [minimum, maximum] = self.summary.range.unwrap_or([value, value]);
            self.summary.range = Some([minimum.min(value), maximum.max(value)]);
        }
    }

    fn interval(&mut self, first: usize, interval_s: f64) {
        self.summary.longest_s = self.summary.longest_s.max(interval_s);
        match self.summary.period_s {
            Some(period_s) => self.summary.gaps += u64::from(interval_s > GAP * period_s),
            None => {
                self.intervals_s.push(interval_s);
                if self.intervals_s.len() == first {
                    self.settle();
                }
            }
        }
    }

    /// Finds the period from the intervals so far.
    fn settle(&mut self) {
        let mut intervals_s = std::mem::take(&mut self.intervals_s);
        intervals_s.sort_by(f64::total_cmp);
        let Some(&period_s) = intervals_s.get(intervals_s.len() / 2) else { return };
        self.summary.gaps += intervals_s.iter().filter(|interval_s| **interval_s > GAP * period_s).count() as u64;
        self.summary.period_s = Some(period_s);
    }

    fn finish(mut self) -> ChannelSummary {
        if self.summary.period_s.is_none() {
            self.settle();
        }
        self.summary
    }
}

/// Reads a whole log and says what is in it.
///
/// # Errors
/// The log cannot be read.
pub fn inspect(log: &mut Log) -> Result<Inspection, LogError> {
    let all: Vec<usize> = (0..log.channels().len()).collect();
    let mut watched: Vec<Watched> = all.iter().map(|_| Watched::default()).collect();
    let mut samples = log.samples(&all)?;
    drop(all);
    let first = (INTERVALS / watched.len().max(1)).clamp(FEWEST, FIRST);
    for sample in &mut samples {
        let sample = sample?;
        watched[sample.channel].push(first, sample);
    }
    let notes = samples.notes().to_vec();
    Ok(Inspection { channels: watched.into_iter().map(Watched::finish).collect(), notes })
}
