//! Samples of several streams, merged in time order, and the rules for time stamps.
//!
//! Within a stream (see [`crate::columns`]) samples keep their order in the file; the streams are merged by time, record by record, so
//! that no more than one batch of each is held in memory.

use crate::LogError;
use crate::columns::{Batch, Said, Source, Stream};

/// What a sample is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quality {
    /// It can be used.
    Good,
    /// It is not a finite number, or the frame is too short for the signal. (An empty cell of a table, or NaN in it or in a
    /// channel of an MDF file that has no conversion, is no sample.) A finite value of such a sample is the number of a gear whose letter a CSV
    /// table has.
    Missing,
    /// Its invalidation bit is set.
    Invalid,
    /// Every bit of the raw value of a bus signal of at least 8 bits is set: not available, or at the end of its range.
    Saturated,
    /// It has the time stamp of the sample of its channel before; the first of them counts.
    Repeated,
    /// Its time stamp is before that of the sample of its channel before.
    Backward,
    /// It is outside `valid_range` of the channel map.
    OutOfRange,
    /// The value stands still while another speed changes, see [`crate::frozen`].
    Frozen,
    /// No shaft can have this speed, see [`crate::speed_faults`].
    Impossible,
    /// The speed of the sample before, which a table holds until the next one comes, see [`crate::held`]: the first of them counts.
    Held,
}

impl Quality {
    /// All of them, in their order.
    pub const ALL: [Self; 10] = [
        Self::Good,
        Self::Missing,
        Self::Invalid,
        Self::Saturated,
        Self::Repeated,
        Self::Backward,
        Self::OutOfRange,
        Self::Frozen,
        Self::Impossible,
        Self::Held,
    ];

    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Missing => "missing",
            Self::Invalid => "invalid",
            Self::Saturated => "saturated",
            Self::Repeated => "repeated",
            Self::Backward => "backward",
            Self::OutOfRange => "out of range",
            Self::Frozen => "frozen",
            Self::Impossible => "impossible",
            Self::Held => "held",
        }
    }
}

/// Samples of each quality.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct QualityCounts([u64; Quality::ALL.len()]);

impl QualityCounts {
    /// Counts one more.
    pub fn push(&mut self, quality: Quality) {
        self.0[quality as usize] += 1;
    }

    /// One that counted as good is of another quality.
    pub(crate) fn withdraw(&mut self, quality: Quality) {
        self.0[Quality::Good as usize] -= 1;
        self.push(quality);
    }

    /// How many there are of this quality.
    pub fn of(&self, quality: Quality) -> u64 {
        self.0[quality as usize]
    }

    /// All together.
    pub fn total(&self) -> u64 {
        self.0.iter().sum()
    }

    /// Each quality but good that was seen: `3 missing, 1 frozen`.
    pub fn faults(&self) -> String {
        let seen = Quality::ALL.into_iter().skip(1).filter(|quality| self.of(*quality) > 0);
        seen.map(|quality| format!("{} {}", self.of(quality), quality.name())).collect::<Vec<_>>().join(", ")
    }
}

/// One value of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Its channel, by its place in [`crate::Log::channels`].
    pub channel: usize,
    /// Its time stamp, s. After a reset of the clock the time goes on, see [`Samples`].
    pub time_s: f64,
    /// The value in the unit of the channel; NaN where there is none.
    pub value: f64,
    /// What it is worth.
    pub quality: Quality,
}

/// A time stamp this far behind the newest one of its stream is not a matter of order on a bus, s.
pub const BEHIND_S: f64 = 0.5;
/// So many rising time stamps behind the newest one are a reset of the clock.
pub const RESET_AFTER: u32 = 20;
/// A time stamp this far after the one before is wrong where the next one goes on from the one before, s.
pub const FAR_S: f64 = 2.0;
/// Time from the last sample before a reset to the first after it: unknown, so this is set, s.
pub const RESET_GAP_S: f64 = 1.0;

/// The clock of a stream.
///
/// Stamps that lie more than [`BEHIND_S`] behind the newest one are backward. When [`RESET_AFTER`] of them in sequence rise,
/// the clock was reset and the time goes on [`RESET_GAP_S`] after the newest stamp. If they go on after the stamp before the newest, the newest
/// was wrong, and the time goes on from there without a shift.
#[derive(Debug, Default)]
pub struct Clock {
    newest_s: Option<f64>,
    /// The last stamp before the largest jump forward so far, since the last reset.
    before_jump_s: f64,
    jump_s: f64,
    shift_s: f64,
    behind: u32,
    behind_s: f64,
    resets: u32,
    wrong_jumps: u32,
}

impl Clock {
    /// Resets so far.
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Stamps so far that were far too late.
    pub fn wrong_jumps(&self) -> u32 {
        self.wrong_jumps
    }

    /// What was met so far, in sentences.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.resets > 0 {
            notes.push(format!("the clock was reset {} times: the time continues one second later", self.resets));
        }
        if self.wrong_jumps > 0 {
            notes.push(format!("{} time stamps are far too late: the time continues without them", self.wrong_jumps));
        }
        notes
    }

    /// Whether a stamp is far after the newest one.
    fn would_jump(&self, stamp_s: f64) -> bool {
        self.newest_s.is_some_and(|newest_s| stamp_s + self.shift_s > newest_s + FAR_S)
    }

    /// Whether a stamp simply goes on from the newest one.
    fn goes_on(&self, stamp_s: f64) -> bool {
        let time_s = stamp_s + self.shift_s;
        self.newest_s.is_some_and(|newest_s| time_s >= newest_s && time_s <= newest_s + FAR_S)
    }

    /// The time of a stamp that simply goes on from the newest one, s; none, and nothing happens, if it does not.
    #[inline]
    fn step(&mut self, stamp_s: f64) -> Option<f64> {
        let (time_s, newest_s) = (stamp_s + self.shift_s, self.newest_s?);
        (time_s > newest_s && time_s <= newest_s + FAR_S).then(|| self.go_on(time_s, newest_s))
    }

    /// Takes a time, s, that is after the newest one.
    #[inline]
    fn go_on(&mut self, time_s: f64, newest_s: f64) -> f64 {
        self.behind = 0;
        if time_s - newest_s >= self.jump_s {
            self.jump_s = time_s - newest_s;
            self.before_jump_s = newest_s;
        }
        self.newest_s = Some(time_s);
        time_s
    }

    /// The time of a stamp, s; none if it is backward.
    pub fn time(&mut self, stamp_s: f64) -> Option<f64> {
        let time_s = stamp_s + self.shift_s;
        let Some(newest_s) = self.newest_s else {
            self.newest_s = Some(time_s);
            return Some(time_s);
        };
        if time_s < newest_s - BEHIND_S {
            if self.behind > 0 && stamp_s < self.behind_s {
                self.behind = 0;
            }
            if self.behind == 0 || stamp_s > self.behind_s {
                self.behind += 1;
                self.behind_s = stamp_s;
            }
            if self.behind <= RESET_AFTER {
                return None;
            }
            self.behind = 0;
            if self.jump_s > BEHIND_S && time_s > self.before_jump_s {
                self.wrong_jumps += 1;
            } else {
                self.resets += 1;
                self.shift_s = newest_s + RESET_GAP_S - stamp_s;
            }
            self.jump_s = 0.0;
            self.newest_s = Some(stamp_s + self.shift_s);
            return self.newest_s;
        }
        self.behind = 0;
        Some(if time_s > newest_s { self.go_on(time_s, newest_s) } else { time_s })
    }
}

/// A stream and where it stands.
struct Merged<'a> {
    source: Source<'a>,
    clock: Clock,
    /// The record of its batch after those that were taken out.
    at: usize,
    /// The last stamp, s, and the time that the clock made of it: those of one record have the same.
    stamp: Option<(f64, Option<f64>)>,
    /// How many stamps were seen to be far too late before they were used, and the last of them.
    too_late: Option<(u32, f64)>,
}

/// A record that was taken out of its batch.
#[derive(Debug, Clone, Copy)]
struct Record {
    /// Its place in time, s: its time, or that of the newest record of its stream where its stamp is not used.
    place_s: f64,
    is_used: bool,
    stream: usize,
    at: usize,
}

impl Record {
    /// Whether it comes before another one.
    fn is_before(&self, other: &Self) -> bool {
        self.place_s < other.place_s || self.place_s == other.place_s && self.stream < other.stream
    }
}

impl Merged<'_> {
    /// Counts a stamp that is far too late; those of one record are one.
    fn note_too_late(&mut self, stamp_s: f64) {
        if self.too_late.is_none_or(|(_, last_s)| last_s != stamp_s) {
            self.too_late = Some((self.too_late.map_or(0, |(count, _)| count) + 1, stamp_s));
        }
    }

    /// Whether the stamp of the record that was taken last is far later than those after it, which go on from the one before.
    fn is_too_late(&self, stamp_s: f64) -> bool {
        let after = || (self.at..self.source.batch.len()).filter_map(|record| self.source.batch.stamp_s(record));
        self.clock.would_jump(stamp_s)
            && after()
                .find(|after_s| *after_s != stamp_s)
                .is_some_and(|after_s| self.clock.goes_on(after_s) && after_s < stamp_s)
    }

    /// What was met in the stamps, in sentences.
    fn notes(&self) -> Vec<String> {
        let mut notes = self.clock.notes();
        if let Some((count, _)) = self.too_late {
            notes.push(format!("{count} time stamps are far later than those after them and are not used"));
        }
        notes
    }
}

/// The samples of a log in time order.
///
/// Within a channel the times of good samples rise: repeated and backward ones are marked. A stream whose clock was reset
/// goes on one second after its newest sample. A stream that ends in a damaged place gives what was read before it and a note;
/// where nothing could be read it is an error.
pub struct Samples<'a> {
    streams: Vec<Merged<'a>>,
    /// The next record of each stream but for the one in front; the earliest last.
    waiting: Vec<Record>,
    /// The stream whose record is given: it often gives the next ones too.
    front: Option<usize>,
    /// Samples in time order, and how many of them were given.
    ready: Vec<Sample>,
    given: usize,
    channels: Vec<Newest>,
    said: Said,
    /// Resets of clocks in the samples so far, and in the records that were taken.
    resets: u32,
    resets_taken: u32,
    is_empty: bool,
}

/// The newest good sample of a channel.
#[derive(Debug, Clone, Copy)]
struct Newest {
    time_s: f64,
    stream: usize,
}

impl<'a> Samples<'a> {
    pub(crate) fn new(channels: usize, streams: Vec<Box<dyn Stream + 'a>>) -> Result<Self, LogError> {
        let merged = |stream| Merged {
            source: Source::new(stream),
            clock: Clock::default(),
            at: 0,
            stamp: None,
            too_late: None,
        };
        let mut samples = Self {
            streams: streams.into_iter().map(merged).collect(),
            waiting: Vec::new(),
            front: None,
            ready: Vec::new(),
            given: 0,
            channels: vec![Newest { time_s: f64::NEG_INFINITY, stream: 0 }; channels],
            said: Said::default(),
            resets: 0,
            resets_taken: 0,
            is_empty: true,
        };
        for i in 0..samples.streams.len() {
            samples.refill(i)?;
        }
        Ok(samples)
    }

    /// What is to be said about the log, complete after the last sample.
    pub fn notes(&self) -> &[String] {
        &self.said.notes
    }

    /// How often a clock did not simply go on: resets, and stamps that were far too late.
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Gives the samples of a record of a stream: what each is worth follows from the times of its channel.
    #[inline]
    fn give(&mut self, record: Record) {
        let Self { streams, channels, ready, .. } = self;
        streams[record.stream].source.batch.samples_of(record.at, |mut sample| {
            let channel = &mut channels[sample.channel];
            channel.stream = record.stream;
            sample.time_s = record.place_s;
            match record.is_used {
                true if record.place_s > channel.time_s => channel.time_s = record.place_s,
                true if record.place_s == channel.time_s => sample.quality = Quality::Repeated,
                _ => sample.quality = Quality::Backward,
            }
            ready.push(sample);
        });
    }

    /// Takes the next record of a stream out of its batch; none if that has no more.
    #[inline]
    fn take(&mut self, i: usize) -> Option<Record> {
        let merged = &mut self.streams[i];
        let at = merged.at;
        let stamp_s = merged.source.batch.stamp_s(at)?;
        merged.at += 1;
        if let Some(time_s) = merged.clock.step(stamp_s) {
            merged.stamp = Some((stamp_s, Some(time_s)));
            return Some(Record { place_s: time_s, is_used: true, stream: i, at });
        }
        let time_s = match merged.stamp {
            Some((last_s, time_s)) if last_s == stamp_s => time_s,
            _ => self.time(i, stamp_s),
        };
        let place_s = time_s.or(self.streams[i].clock.newest_s).unwrap_or(stamp_s);
        Some(Record { place_s, is_used: time_s.is_some(), stream: i, at })
    }

    /// The time of a stamp that is not the one before, of the record that was taken last; none if it is not used.
    #[cold]
    fn time(&mut self, i: usize, stamp_s: f64) -> Option<f64> {
        // Where streams wait for each other, a wrong stamp would hold its stream back until the others end.
        let looks_ahead = self.streams.len() > 1;
        let merged = &mut self.streams[i];
        let (resets, wrong_jumps) = (merged.clock.resets, merged.clock.wrong_jumps);
        let time_s = if looks_ahead && merged.is_too_late(stamp_s) {
            merged.note_too_late(stamp_s);
            None
        } else {
            merged.clock.time(stamp_s)
        };
        merged.stamp = Some((stamp_s, time_s));
        let newest_s = merged.clock.newest_s.unwrap_or(stamp_s);
        self.resets_taken += merged.clock.resets - resets;
        if merged.clock.wrong_jumps > wrong_jumps {
            // What came with the wrong stamps is not newer than this; whoever has seen them starts again.
            self.resets_taken += 1;
            for channel in self.channels.iter_mut().filter(|channel| channel.stream == i) {
                channel.time_s = channel.time_s.min(newest_s.next_down());
            }
        }
        time_s
    }

    /// Makes the next samples ready; none at the end. Does not wait for more of a stream while there are some, and ends before a clock
    /// that did not simply go on, so that [`Self::resets`] is that of the samples that are given.
    #[inline(never)]
    fn fill(&mut self) -> Result<(), LogError> {
        const AT_ONCE: usize = 256;
        self.ready.clear();
        self.given = 0;
        while self.ready.len() < AT_ONCE {
            let mut next = None;
            if let Some(i) = self.front {
                let resets = self.resets_taken;
                match self.take(i) {
                    Some(record) if self.resets_taken > resets && !self.ready.is_empty() => {
                        self.front = None;
                        self.wait(record);
                        return Ok(());
                    }
                    Some(record) => next = Some(self.exchange(record)),
                    None if self.ready.is_empty() => self.refill(i)?,
                    None => return Ok(()),
                }
            }
            self.resets = self.resets_taken;
            self.front = None;
            let Some(record) = next.or_else(|| self.waiting.pop()) else {
                return self.said.damage.take().filter(|_| self.is_empty).map_or(Ok(()), Err);
            };
            (self.front, self.is_empty) = (Some(record.stream), false);
            self.give(record);
        }
        Ok(())
    }

    /// The earliest of a record and those that wait; the others wait.
    #[inline]
    fn exchange(&mut self, record: Record) -> Record {
        match self.waiting.last() {
            Some(&earliest) if earliest.is_before(&record) => {
                self.waiting.pop();
                self.wait(record);
                earliest
            }
            _ => record,
        }
    }

    /// Lets a record wait for its time. Streams are few, and it is mostly among the next.
    #[inline]
    fn wait(&mut self, record: Record) {
        let mut at = self.waiting.len();
        while at > 0 && self.waiting[at - 1].is_before(&record) {
            at -= 1;
        }
        self.waiting.insert(at, record);
    }

    /// Reads the next batch of a stream if there is none, and lets its first record wait for its time.
    fn refill(&mut self, i: usize) -> Result<(), LogError> {
        let merged = &mut self.streams[i];
        if merged.at >= merged.source.batch.len() {
            merged.at = 0;
            if !merged.source.read(&mut self.said)? {
                merged.source.batch = Batch::default();
                self.said.notes.append(&mut merged.notes());
                return Ok(());
            }
        }
        if let Some(record) = self.take(i) {
            self.wait(record);
        }
        Ok(())
    }
}

impl Iterator for Samples<'_> {
    type Item = Result<Sample, LogError>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        if self.given == self.ready.len()
            && let Err(error) = self.fill()
        {
            return Some(Err(error));
        }
        let sample = self.ready.get(self.given).copied()?;
        self.given += 1;
        Some(Ok(sample))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Records of two channels at these times, in one batch.
    struct Records(Vec<f64>, usize);

    impl Stream for Records {
        fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
            let Self(times, first) = self;
            let both = |time_s: f64| {
                [*first, *first + 1].map(|channel| Sample { channel, time_s, value: time_s, quality: Quality::Good })
            };
            batch.samples.extend(times.drain(..).flat_map(both));
            Ok(!batch.samples.is_empty())
        }
    }

    #[test]
    fn a_stamp_of_the_future_in_one_group_does_not_hold_it_back_until_the_others_end() {
        let times: Vec<f64> = (0..500).map(|i| f64::from(i) * 0.01).collect();
        let mut wrong = times.clone();
        wrong[200] = 3600.0;
        let streams: Vec<Box<dyn Stream>> = vec![Box::new(Records(wrong, 0)), Box::new(Records(times, 2))];
        let mut samples = Samples::new(4, streams).unwrap();
        let read = samples.by_ref().collect::<Result<Vec<_>, _>>().unwrap();
        // Both groups come side by side up to the end; of the wrong record nothing is used.
        assert!(read.windows(2).all(|pair| pair[0].time_s <= pair[1].time_s));
        let good = |channel: usize| {
            read.iter().filter(|sample| sample.channel == channel && sample.quality == Quality::Good).count()
        };
        assert_eq!([0, 1, 2, 3].map(good), [499, 499, 500, 500]);
        assert_eq!(read.len(), 2000);
        assert!((read[1999].time_s - 4.99).abs() < 1e-9);
        assert_eq!(samples.notes(), ["1 time stamps are far later than those after them and are not used"]);
        assert_eq!(samples.resets(), 0);
    }
}
