//! Speeds that a table holds until the next value comes.
//!
//! A control unit sends a speed every 20 ms, and a logger writes rows every 10 ms with the newest value: the second row of each value is no
//! reading of its time, and an acceleration makes it wrong. A speed is held if its values stand for at least two rows and change by
//! [`MOVED_QUANTA`] of their quantum and more on both sides: a speed that stands still because it is coarse changes by one. So many
//! rows of a value are then one reading; where it stands for longer, the speed stands still, and the next is one again.

/// Changes on both sides of a value that coarse steps do not explain, in the smallest change that was seen.
pub const MOVED_QUANTA: f64 = 3.0;
/// So many held values more than a quarter as many single ones tell that a speed is held.
pub const ENOUGH: u8 = 5;
/// What a value in a single row takes from the held ones that were seen: a clock that is a little faster than the rows leaves one
/// now and then.
const AGAINST: u8 = 4;
/// Most held values that are remembered.
const MAXIMUM: u8 = 20;

/// Watches a speed.
#[derive(Debug, Clone, Copy)]
pub struct HeldSpeed {
    value: f64,
    /// Rows in which it has stood.
    rows: u32,
    /// How it changed to this value.
    change: f64,
    /// The smallest change so far.
    quantum: f64,
    /// Rows for which a value is held: the fewest that were seen, and whether one more was.
    held_rows: u32,
    one_more: bool,
    seen: u8,
}

impl HeldSpeed {
    /// Before the first value.
    pub fn new() -> Self {
        Self {
            value: f64::NAN,
            rows: 0,
            change: f64::NAN,
            quantum: f64::INFINITY,
            held_rows: 0,
            one_more: false,
            seen: 0,
        }
    }

    /// Whether the next value is the one before, held.
    pub fn is_held(&mut self, value: f64) -> bool {
        if value == self.value {
            let again = self.rows.is_multiple_of((self.held_rows + u32::from(self.one_more)).max(1));
            self.rows = self.rows.saturating_add(1);
            return self.seen >= ENOUGH && !again;
        }
        let change = (value - self.value).abs();
        self.quantum = self.quantum.min(change);
        if self.rows == 1 {
            self.seen = self.seen.saturating_sub(AGAINST);
        } else if self.change.min(change) >= MOVED_QUANTA * self.quantum && !self.change.is_nan() {
            self.count();
        }
        (self.value, self.rows, self.change) = (value, 1, change);
        false
    }

    /// Counts a held value. One that stands for two rows more than others has come twice.
    fn count(&mut self) {
        match self.rows {
            rows if self.seen == 0 || rows + 1 < self.held_rows => (self.held_rows, self.one_more) = (rows, false),
            rows if rows + 1 == self.held_rows => (self.held_rows, self.one_more) = (rows, true),
            rows if rows == self.held_rows + 1 => self.one_more = true,
            rows if rows > self.held_rows => return,
            _ => {}
        }
        self.seen = self.seen.saturating_add(1).min(MAXIMUM);
    }
}

impl Default for HeldSpeed {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows that are held, of a speed that goes on by this from row to row, is sent every so many rows, and has this quantum.
    fn held(rates: impl Iterator<Item = f64>, every: impl Fn(u32) -> bool, quantum: f64) -> Vec<bool> {
        let (mut watch, mut speed, mut sent) = (HeldSpeed::new(), 100.0, 100.0);
        let rows = rates.zip(0..).map(|(rate, i)| {
            speed += rate;
            if every(i) {
                sent = (speed / quantum).round() * quantum;
            }
            watch.is_held(sent)
        });
        rows.collect()
    }

    /// Rates of a speed that rises, now slowly and now fast.
    fn rising(rows: u32) -> impl Iterator<Item = f64> {
        (0..rows).map(|i| 0.5 - 0.49 * (0.2 * f64::from(i)).cos())
    }

    #[test]
    fn the_rows_between_two_values_are_held() {
        let rows = held(rising(400), |i| i % 5 == 0, 0.01);
        assert!(rows[..25].iter().all(|held| !held), "five values tell it");
        assert!((100..400).all(|i| rows[i] == (i % 5 != 0)), "{rows:?}");
    }

    #[test]
    fn a_speed_that_stands_still_is_read_as_often_as_it_is_sent() {
        let rates = rising(101).chain(std::iter::repeat_n(0.0, 100));
        let rows = held(rates, |i| i % 2 == 0, 0.01);
        assert!((50..200).all(|i| rows[i] == (i % 2 == 1)), "{rows:?}");
    }

    #[test]
    fn coarse_and_slow_speeds_are_not_held() {
        // 0.02 rad/s in a row with a quantum of 0.1 rad/s: five rows for a value.
        assert!(held(std::iter::repeat_n(0.02, 1000), |_| true, 0.1).iter().all(|held| !held));
        // One that swings, coarse where it turns.
        let swing = (0..2000).map(|i| 0.3 * (0.05 * f64::from(i)).sin());
        assert!(held(swing, |_| true, 0.1).iter().all(|held| !held));
        assert!(held(std::iter::repeat_n(0.0, 100), |_| true, 0.1).iter().all(|held| !held));
    }

    #[test]
    fn a_clock_that_does_not_fit_the_rows_is_seen() {
        // 25 ms in rows of 10 ms: two and three rows.
        let rows = held(rising(400), |i| i % 5 == 0 || i % 5 == 3, 0.01);
        assert!((100..400).all(|i| rows[i] != (i % 5 == 0 || i % 5 == 3)), "{rows:?}");
        // 19.9 ms: a value in one row now and then.
        let sent = |i: u32| i == 0 || (i * 100 / 199) != ((i - 1) * 100 / 199);
        let rows = held(rising(2000), sent, 0.01);
        assert!((1000..2000).all(|i| !rows[i as usize] || !sent(i)), "no value that was sent is held");
        assert!(rows[1000..].iter().filter(|held| **held).count() > 480, "{rows:?}");
    }
}
