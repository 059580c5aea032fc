//! What is in a log: for each channel samples, rate, span, values, gaps.

use crate::samples::{Quality, QualityCounts};
use crate::{Channel, Log, LogError};

/// Intervals of which the middle one is the period of a channel.
const FIRST: usize = 512;
/// An interval of so many periods is a gap.
pub const GAP: f64 = 5.0;

/// What is known of a channel after all samples.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelSummary {
    /// The channel.
    pub channel: Channel,
    /// Samples of each quality.
    pub counts: QualityCounts,
    /// Middle interval between the first samples, s; none with fewer than two.
    pub period_s: Option<f64>,
    /// Times of the first and the last sample, s.
    pub span_s: Option<[f64; 2]>,
    /// Least and greatest good value.
    pub range: Option<[f64; 2]>,
    /// Intervals longer than [`GAP`] periods.
    pub gaps: u64,
    /// The longest interval, s.
    pub longest_s: f64,
}

/// What is in a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Inspection {
    /// The channels, in the order of the log.
    pub channels: Vec<ChannelSummary>,
    /// What else is to be said.
    pub notes: Vec<String>,
}

/// A channel while it is read.
#[derive(Default)]
struct Watched {
    counts: QualityCounts,
    first_s: Option<f64>,
    last_s: f64,
    range: Option<[f64; 2]>,
    intervals_s: Vec<f64>,
    period_s: Option<f64>,
    gaps: u64,
    longest_s: f64,
}

impl Watched {
    fn push(&mut self, time_s: f64, value: f64, quality: Quality) {
        self.counts.push(quality);
        if !matches!(quality, Quality::Repeated | Quality::Backward) {
            if self.first_s.is_none() {
                self.first_s = Some(time_s);
            } else {
                self.interval(time_s - self.last_s);
            }
            self.last_s = time_s;
        }
        if quality == Quality::Good {
            let [least, greatest] = self.range.unwrap_or([value, value]);
            self.range = Some([least.min(value), greatest.max(value)]);
        }
    }

    fn interval(&mut self, interval_s: f64) {
        self.longest_s = self.longest_s.max(interval_s);
        match self.period_s {
            Some(period_s) => self.gaps += u64::from(interval_s > GAP * period_s),
            None => {
                self.intervals_s.push(interval_s);
                if self.intervals_s.len() == FIRST {
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
        self.gaps += intervals_s.iter().filter(|interval_s| **interval_s > GAP * period_s).count() as u64;
        self.period_s = Some(period_s);
    }

    fn finish(mut self, channel: Channel) -> ChannelSummary {
        if self.period_s.is_none() {
            self.settle();
        }
        ChannelSummary {
            channel,
            counts: self.counts,
            period_s: self.period_s,
            span_s: self.first_s.map(|first_s| [first_s, self.last_s]),
            range: self.range,
            gaps: self.gaps,
            longest_s: self.longest_s,
        }
    }
}

/// Reads a whole log and says what is in it.
///
/// # Errors
/// The log cannot be read.
pub fn inspect(log: &mut Log) -> Result<Inspection, LogError> {
    let all: Vec<usize> = (0..log.channels().len()).collect();
    let mut watched: Vec<Watched> = all.iter().map(|_| Watched::default()).collect();
    let channels = log.channels().to_vec();
    let mut samples = log.samples(&all)?;
    for sample in &mut samples {
        let sample = sample?;
        watched[sample.channel].push(sample.time_s, sample.value, sample.quality);
    }
    let notes = samples.notes().to_vec();
    Ok(Inspection {
        channels: watched.into_iter().zip(channels).map(|(watched, channel)| watched.finish(channel)).collect(),
        notes,
    })
}
