//! How long values are held.

use std::collections::VecDeque;

/// A longer time without values is a pause of the recording, s.
const PAUSE_S: f64 = 1.0;

/// Tells which of the values that come in time order are of the last seconds of a recording. A pause of the recording counts
/// one second: what lay before it is still needed when the first value after it tells that a shift is over.
#[derive(Debug, Clone)]
pub struct Held {
    held_s: f64,
    newest_s: f64,
    /// Pauses within what is held: their ends, s, and by how much they are longer than one second, s.
    pauses: VecDeque<(f64, f64)>,
}

impl Held {
    /// Holds values for so long, s.
    pub fn new(held_s: f64) -> Self {
        Self { held_s, newest_s: f64::NAN, pauses: VecDeque::new() }
    }

    /// Takes the time of the next value, s, and gives that of the oldest that is held, s.
    #[inline]
    pub fn oldest_s(&mut self, time_s: f64) -> f64 {
        let step_s = time_s - self.newest_s;
        self.newest_s = time_s;
        if step_s > PAUSE_S {
            self.pauses.push_back((time_s, step_s - PAUSE_S));
        }
        let oldest_s = time_s - self.held_s;
        if self.pauses.is_empty() { oldest_s } else { self.before_pauses(time_s, oldest_s) }
    }

    /// The oldest time that is held, where so long ago was a pause.
    fn before_pauses(&mut self, time_s: f64, mut oldest_s: f64) -> f64 {
        // The time may go back.
        self.pauses.retain(|(end_s, _)| *end_s <= time_s);
        let mut within = 0;
        for (end_s, longer_s) in self.pauses.iter().rev() {
            if oldest_s >= *end_s {
                break;
            }
            oldest_s -= longer_s;
            within += 1;
        }
        self.pauses.drain(..self.pauses.len() - within);
        oldest_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_counts_one_second() {
        let mut held = Held::new(10.0);
        assert_eq!(held.oldest_s(0.0), -10.0);
        assert_eq!(held.oldest_s(0.5), -9.5);
        // 59.5 s longer than a second.
        assert_eq!(held.oldest_s(61.0), -8.5);
        assert_eq!(held.oldest_s(62.0), -7.5);
        // And one of 9 s: 8 s longer.
        assert_eq!(held.oldest_s(71.0), -6.5);
        for second in 72..=80 {
            held.oldest_s(f64::from(second));
        }
        // 10 s of recording: from 71 s, a second of the pause before it.
        assert_eq!(held.oldest_s(81.0), 71.0);
        assert_eq!(held.pauses.len(), 0);
    }

    #[test]
    fn pauses_are_forgotten_when_the_time_goes_back_and_do_not_pile_up() {
        let mut held = Held::new(10.0);
        held.oldest_s(0.0);
        held.oldest_s(1e9);
        assert_eq!(held.oldest_s(5.0), -5.0);
        for i in 0..1000 {
            held.oldest_s(10.0 + 3.0 * f64::from(i));
            assert!(held.pauses.len() <= 10, "{}", held.pauses.len());
        }
        assert!(held.oldest_s(f64::NAN).is_nan());
    }
}
