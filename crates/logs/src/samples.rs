//! Samples of several streams, merged in time order, and the rules for time stamps.
//!
//! A stream is what shares one clock: a table, a bus, a channel group. Within a stream samples keep their order in the file;
//! the streams are merged by time, so that no more than one batch of each is held in memory.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::LogError;

/// What a sample is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quality {
    /// It can be used.
    Good,
    /// It is not a finite number, or the frame is too short for the signal. (An empty cell of a table, or NaN in it, is no sample.)
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
}

impl Quality {
    /// All of them, in their order.
    pub const ALL: [Self; 8] = [
        Self::Good,
        Self::Missing,
        Self::Invalid,
        Self::Saturated,
        Self::Repeated,
        Self::Backward,
        Self::OutOfRange,
        Self::Frozen,
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

/// What shares one clock.
pub(crate) trait Stream {
    /// Appends the next samples in the order of the file, with finite times and the quality as far as the format says it.
    /// False at the end.
    fn next_batch(&mut self, batch: &mut Vec<Sample>) -> Result<bool, LogError>;

    /// What else is to be said about the stream, at its end.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
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
            notes.push(format!("the clock was reset {} times: the time goes on one second later", self.resets));
        }
        if self.wrong_jumps > 0 {
            notes.push(format!("{} time stamps are far too late: the time goes on before them", self.wrong_jumps));
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
        if time_s > newest_s {
            if time_s - newest_s >= self.jump_s {
                self.jump_s = time_s - newest_s;
                self.before_jump_s = newest_s;
            }
            self.newest_s = Some(time_s);
        }
        Some(time_s)
    }
}

/// A stream with the batch that is held of it.
struct Merged<'a> {
    stream: Box<dyn Stream + 'a>,
    clock: Clock,
    batch: Vec<Sample>,
    at: usize,
    /// The sample whose place in time is on the heap.
    next: Option<Sample>,
    /// The last stamp, s, and the time that the clock made of it: those of one record have the same.
    stamp: Option<(f64, Option<f64>)>,
    /// How many stamps were seen to be far too late before they were used, and the last of them.
    too_late: Option<(u32, f64)>,
}

impl Merged<'_> {
    /// Counts a stamp that is far too late; those of one record are one.
    fn note_too_late(&mut self) {
        let stamp_s = self.batch[self.at - 1].time_s;
        if self.too_late.is_none_or(|(_, last_s)| last_s != stamp_s) {
            self.too_late = Some((self.too_late.map_or(0, |(count, _)| count) + 1, stamp_s));
        }
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

/// Time and stream, earliest first.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Next(f64, usize);

impl Eq for Next {}

impl PartialOrd for Next {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Next {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

/// The samples of a log in time order.
///
/// Within a channel the times of good samples rise: repeated and backward ones are marked. A stream whose clock was reset
/// goes on one second after its newest sample. A stream that ends in a damaged place gives what was read before it and a note;
/// where nothing could be read it is an error.
pub struct Samples<'a> {
    streams: Vec<Merged<'a>>,
    /// Where the next samples of the streams are in time, but for the stream in front.
    heap: BinaryHeap<Reverse<Next>>,
    /// The stream that gave the last sample: it often gives the next ones too. It does so up to this place in time.
    front: Option<(usize, Next)>,
    channels: Vec<Newest>,
    notes: Vec<String>,
    /// Resets of clocks so far.
    resets: u32,
    given: u64,
    /// The first damage; an error if nothing could be read.
    damage: Option<LogError>,
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
            stream,
            clock: Clock::default(),
            batch: Vec::new(),
            at: 0,
            next: None,
            stamp: None,
            too_late: None,
        };
        let mut samples = Self {
            streams: streams.into_iter().map(merged).collect(),
            heap: BinaryHeap::new(),
            front: None,
            channels: vec![Newest { time_s: f64::NEG_INFINITY, stream: 0 }; channels],
            notes: Vec::new(),
            resets: 0,
            given: 0,
            damage: None,
        };
        for i in 0..samples.streams.len() {
            samples.refill(i)?;
        }
        Ok(samples)
    }

    /// What is to be said about the log, complete after the last sample.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// How often a clock did not simply go on: resets, and stamps that were far too late.
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Reads the next batch of a stream; false at its end.
    fn read(&mut self, i: usize) -> Result<bool, LogError> {
        let merged = &mut self.streams[i];
        merged.batch.clear();
        merged.at = 0;
        while merged.batch.is_empty() {
            let damage = match merged.stream.next_batch(&mut merged.batch) {
                Ok(true) => continue,
                Ok(false) => None,
                Err(error @ LogError::Damaged { .. }) => Some(error),
                Err(error) => return Err(error),
            };
            self.notes.append(&mut merged.stream.notes());
            if let Some(error) = damage {
                self.notes.push(format!("{error}\nhint: the log is read up to this place"));
                self.damage.get_or_insert(error);
            }
            // What came with the end or before the damage is given first.
            merged.stream = Box::new(Ended);
            if merged.batch.is_empty() {
                self.notes.append(&mut merged.notes());
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Takes the next sample of a stream out of its batch, which has one.
    #[inline]
    fn stamped(&mut self, i: usize) -> Sample {
        let merged = &mut self.streams[i];
        let mut sample = merged.batch[merged.at];
        merged.at += 1;
        let stamped = match merged.stamp {
            Some((stamp_s, time_s)) if stamp_s == sample.time_s => time_s,
            _ => self.time(i, sample.time_s),
        };
        let newest_s = self.streams[i].clock.newest_s.unwrap_or(sample.time_s);
        let channel = &mut self.channels[sample.channel];
        channel.stream = i;
        match stamped {
            Some(time_s) if time_s > channel.time_s => {
                sample.time_s = time_s;
                channel.time_s = time_s;
            }
            Some(time_s) => {
                sample.quality = if time_s == channel.time_s { Quality::Repeated } else { Quality::Backward };
                sample.time_s = time_s;
            }
            None => {
                sample.quality = Quality::Backward;
                sample.time_s = newest_s;
            }
        }
        sample
    }

    /// The time of a stamp that is not the one before, of the sample that was taken last; none if it is not used.
    fn time(&mut self, i: usize, stamp_s: f64) -> Option<f64> {
        // Where streams wait for each other, a wrong stamp would hold its stream back until the others end.
        let looks_ahead = self.streams.len() > 1;
        let merged = &mut self.streams[i];
        let (resets, wrong_jumps) = (merged.clock.resets, merged.clock.wrong_jumps);
        let is_wrong = looks_ahead && merged.clock.would_jump(stamp_s) && {
            let after = merged.batch[merged.at..].iter().find(|after| after.time_s != stamp_s);
            after.is_some_and(|after| merged.clock.goes_on(after.time_s) && after.time_s < stamp_s)
        };
        let time_s = if is_wrong {
            merged.note_too_late();
            None
        } else {
            merged.clock.time(stamp_s)
        };
        merged.stamp = Some((stamp_s, time_s));
        let newest_s = merged.clock.newest_s.unwrap_or(stamp_s);
        self.resets += merged.clock.resets - resets;
        if merged.clock.wrong_jumps > wrong_jumps {
            // What came with the wrong stamps is not newer than this; whoever has seen them starts again.
            self.resets += 1;
            for channel in self.channels.iter_mut().filter(|channel| channel.stream == i) {
                channel.time_s = channel.time_s.min(newest_s.next_down());
            }
        }
        time_s
    }

    /// Goes on to the stream whose next sample is the earliest, and gives that.
    fn of_the_earliest(&mut self) -> Result<Option<Sample>, LogError> {
        if let Some((i, _)) = self.front.take() {
            self.refill(i)?;
        }
        let Some(Reverse(Next(_, i))) = self.heap.pop() else {
            return self.damage.take().filter(|_| self.given == 0).map_or(Ok(None), Err);
        };
        self.front = Some((i, self.heap.peek().map_or(Next(f64::INFINITY, i), |Reverse(next)| *next)));
        self.given += 1;
        Ok(self.streams[i].next.take())
    }

    /// Reads the next batch of a stream if there is none, and lets its first sample wait for its time.
    fn refill(&mut self, i: usize) -> Result<(), LogError> {
        if self.streams[i].next.is_none() && (self.streams[i].at < self.streams[i].batch.len() || self.read(i)?) {
            let sample = self.stamped(i);
            self.put_back(i, sample);
        }
        Ok(())
    }

    /// Lets a stream wait in place of the first one that waits; that one.
    fn change_places(&mut self, next: Next) -> Option<usize> {
        let mut first = self.heap.peek_mut()?;
        let Reverse(Next(_, other)) = std::mem::replace(&mut *first, Reverse(next));
        Some(other)
    }

    /// Puts a sample where it waits for its time.
    fn put_back(&mut self, i: usize, sample: Sample) {
        self.streams[i].next = Some(sample);
        self.heap.push(Reverse(Next(sample.time_s, i)));
    }
}

impl Iterator for Samples<'_> {
    type Item = Result<Sample, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some((i, until)) = self.front
            && self.streams[i].at < self.streams[i].batch.len()
        {
            let sample = self.stamped(i);
            let next = Next(sample.time_s, i);
            if next <= until {
                self.given += 1;
                return Some(Ok(sample));
            }
            if let Some(other) = self.change_places(next) {
                self.streams[i].next = Some(sample);
                self.front = Some((other, self.heap.peek().map_or(next, |Reverse(first)| *first)));
                self.given += 1;
                return self.streams[other].next.take().map(Ok);
            }
            self.put_back(i, sample);
        }
        self.of_the_earliest().transpose()
    }
}

/// What is left of a stream after its end.
struct Ended;

impl Stream for Ended {
    fn next_batch(&mut self, _: &mut Vec<Sample>) -> Result<bool, LogError> {
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Records of two channels at these times, in one batch.
    struct Records(Vec<f64>, usize);

    impl Stream for Records {
        fn next_batch(&mut self, batch: &mut Vec<Sample>) -> Result<bool, LogError> {
            let Self(times, first) = self;
            let both = |time_s: f64| {
                [*first, *first + 1].map(|channel| Sample { channel, time_s, value: time_s, quality: Quality::Good })
            };
            batch.extend(times.drain(..).flat_map(both));
            Ok(!batch.is_empty())
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
