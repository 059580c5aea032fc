//! The last seconds of a signal.

use std::collections::VecDeque;

use super::held::Held;

/// Values of a signal with their times, the last seconds of them.
#[derive(Debug, Clone)]
pub(super) struct Track {
    held: Held,
    values: VecDeque<(f64, f64)>,
}

impl Track {
    pub(super) fn new(held_s: f64) -> Self {
        Self { held: Held::new(held_s), values: VecDeque::new() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.values.clear();
    }

    pub(super) fn push(&mut self, time_s: f64, value: f64) {
        self.values.push_back((time_s, value));
        let oldest_s = self.held.oldest_s(time_s);
        while self.values.front().is_some_and(|(first_s, _)| *first_s < oldest_s) {
            self.values.pop_front();
        }
    }

    /// Removes the newest value of this time, if there is one.
    pub(super) fn take_back(&mut self, time_s: f64) {
        // A time that was computed back differs in its last digits.
        const SAME_S: f64 = 1e-9;
        let is_it = |(other_s, _): &(f64, f64)| (other_s - time_s).abs() <= SAME_S * time_s.abs().max(1.0);
        let newest = self.values.iter().rev().take_while(|(other_s, _)| *other_s >= time_s - 1.0).position(is_it);
        if let Some(newest) = newest {
            self.values.remove(self.values.len() - 1 - newest);
        }
    }

    /// The values from one time to another.
    pub(super) fn between(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let first = self.values.partition_point(|(time_s, _)| *time_s < from_s);
        self.values.range(first..).copied().take_while(move |(time_s, _)| *time_s <= to_s)
    }

    /// The mean from one time to another.
    pub(super) fn mean(&self, from_s: f64, to_s: f64) -> Option<f64> {
        let (count, sum) =
            self.between(from_s, to_s).fold((0_u32, 0.0), |(count, sum), (_, value)| (count + 1, sum + value));
        (count > 0).then(|| sum / f64::from(count))
    }

    /// The value at a time by a line between its neighbours, if they are not further apart than this.
    pub(super) fn at(&self, time_s: f64, apart_s: f64) -> Option<f64> {
        // It is mostly the newest.
        let is_before = |(other_s, _): &(f64, f64)| *other_s < time_s;
        let newest = self.values.len().saturating_sub(1);
        let is_newest = self.values.get(newest).is_some_and(|newest| !is_before(newest))
            && newest.checked_sub(1).is_none_or(|before| is_before(&self.values[before]));
        let after = if is_newest { newest } else { self.values.partition_point(is_before) };
        let &(after_s, after_value) = self.values.get(after)?;
        if after_s == time_s {
            return Some(after_value);
        }
        let &(before_s, before_value) = self.values.get(after.checked_sub(1)?)?;
        let fraction = (time_s - before_s) / (after_s - before_s);
        (after_s - before_s <= apart_s).then_some(before_value + fraction * (after_value - before_value))
    }

    /// The newest time.
    pub(super) fn newest_s(&self) -> f64 {
        self.values.back().map_or(f64::NEG_INFINITY, |(time_s, _)| *time_s)
    }
}
