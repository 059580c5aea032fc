//! Readings that wait until what comes after them can no longer show that they are wrong.
//!
//! That a speed stands still, or shows another one, is known some samples after it began. A log is there as a whole, so its readings are
//! held back for [`LOOK_AHEAD_S`] and withdrawn in time. A log that is followed while it is written is not held back.

use std::collections::VecDeque;

/// How long readings are held back, s: until a speed that stands still is known to do so.
pub const LOOK_AHEAD_S: f64 = crate::frozen::FROZEN_S;

/// Items of a log that wait.
pub struct LookAhead<T, E> {
    waiting: VecDeque<(f64, T)>,
    length_s: f64,
    /// How the log ended, once it has: with an error or without.
    end: Option<Option<E>>,
}

impl<T, E> LookAhead<T, E> {
    /// Holds items back for so long, s; zero for a log that is followed.
    pub fn new(length_s: f64) -> Self {
        Self { waiting: VecDeque::new(), length_s, end: None }
    }

    /// Takes what was read next, at its time, s.
    pub fn push(&mut self, time_s: f64, item: T) {
        self.waiting.push_back((time_s, item));
    }

    /// Nothing comes after this: the log has ended, or cannot be read further.
    pub fn end(&mut self, error: Option<E>) {
        self.end = Some(error);
    }

    /// The items that wait.
    pub fn waiting(&mut self) -> impl Iterator<Item = &mut T> {
        self.waiting.iter_mut().map(|(_, item)| item)
    }

    /// The next item, and none after the last; `None` as long as more is to be read first.
    ///
    /// # Errors
    /// That with which the log ended, after the items before it.
    #[inline]
    pub fn ready(&mut self) -> Option<Result<Option<T>, E>> {
        if self.is_ready() {
            return Some(Ok(self.waiting.pop_front().map(|(_, item)| item)));
        }
        self.end.as_mut().map(|error| error.take().map_or(Ok(None), Err))
    }

    /// Whether the first item has waited long enough. A clock that went back has begun anew.
    fn is_ready(&self) -> bool {
        let (Some((first_s, _)), Some((last_s, _))) = (self.waiting.front(), self.waiting.back()) else { return false };
        self.end.is_some() || (last_s - first_s).abs() >= self.length_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows that come out, and how many were read before each, of twenty rows every 0.1 s with an error after them.
    fn run(length_s: f64) -> (Vec<(u32, u32)>, Option<&'static str>) {
        let (mut ahead, mut read, mut all) = (LookAhead::new(length_s), 0, Vec::new());
        loop {
            match ahead.ready() {
                Some(Ok(Some(row))) => all.push((row, read)),
                Some(end) => return (all, end.err()),
                None if read == 20 => ahead.end(Some("ends")),
                None => {
                    read += 1;
                    ahead.push(0.1 * f64::from(read), read);
                }
            }
        }
    }

    #[test]
    fn rows_come_once_and_in_order_before_the_error_that_ends_them() {
        for (length_s, after) in [(0.0, 0), (0.35, 4), (5.0, 20)] {
            let (all, end) = run(length_s);
            let expected: Vec<_> = (1..=20).map(|row: u32| (row, (row + after).min(20))).collect();
            assert_eq!((all, end), (expected, Some("ends")), "{length_s}");
        }
    }

    #[test]
    fn a_clock_that_goes_back_does_not_hold_rows_for_ever() {
        let mut ahead = LookAhead::<u32, ()>::new(0.5);
        ahead.push(100.0, 1);
        assert_eq!(ahead.ready(), None);
        ahead.push(0.0, 2);
        assert_eq!(ahead.ready(), Some(Ok(Some(1))));
        ahead.waiting().for_each(|row| *row = 7);
        ahead.end(None);
        assert_eq!((ahead.ready(), ahead.ready()), (Some(Ok(Some(7))), Some(Ok(None))));
    }
}
