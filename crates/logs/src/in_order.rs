//! Readings of channels whose time stamps are moved (`late_s` of a channel map), in the order of the moved stamps.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::Reading;
use crate::map::Resolved;

/// A reading with the place of its entry in the map. Of equal stamps the one that came first is the largest.
struct Waiting {
    entry: usize,
    reading: Reading,
    number: u64,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.reading.stamp_s.total_cmp(&self.reading.stamp_s).then(other.number.cmp(&self.number))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Waiting {}

/// Holds readings back until no earlier one can come: as long as the stamps of the channels are moved against each other.
pub(crate) struct InOrder {
    waiting: BinaryHeap<Waiting>,
    /// By how much the stamps of any channel are too late at most, s.
    max_s: f64,
    count: u64,
}

impl InOrder {
    /// For these channels; none if no stamp is moved.
    pub(crate) fn of(channels: &[Resolved]) -> Option<Self> {
        let late_s = || channels.iter().map(|channel| channel.entry.late_s);
        let max_s = late_s().fold(0.0, f64::max);
        late_s().any(|late_s| late_s != 0.0).then(|| Self { waiting: BinaryHeap::new(), max_s, count: 0 })
    }

    /// Takes a reading of an entry, whose stamps are moved.
    pub(crate) fn push(&mut self, entry: usize, reading: Reading) {
        self.waiting.push(Waiting { entry, reading, number: self.count });
        self.count += 1;
    }

    /// The next reading, if no earlier one can come from samples of this stamp on, s.
    pub(crate) fn next(&mut self, stamp_s: f64) -> Option<(usize, Reading)> {
        let is_ready = self.waiting.peek().is_some_and(|first| first.reading.stamp_s <= stamp_s - self.max_s);
        if is_ready { self.waiting.pop().map(|first| (first.entry, first.reading)) } else { None }
    }
}
