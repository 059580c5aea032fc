//! Holes of the recording within shifts.

use car::ShiftCommand;

use super::check::Check;

/// Rows further apart, and three times as far as usual, are a hole in the recording, s \[chosen\]: a phase of a shift may pass in it.
const HOLE_S: f64 = 0.5;

/// Holes of the recording within shifts.
pub(crate) struct Holes {
    pub(crate) count: u64,
    /// The shift that the last one cut, as long as the log goes on in it: the rest is no other shift.
    pub(crate) cut: Option<ShiftCommand>,
    /// The last times between rows, s; the oldest is at `at`.
    steps_s: [f64; 31],
    at: usize,
}

impl Default for Holes {
    fn default() -> Self {
        // NaN sorts last, so the median is NaN until half of the times are known.
        Self { count: 0, cut: None, steps_s: [f64::NAN; 31], at: 0 }
    }
}

impl Holes {
    /// Takes a time between two rows, s: whether it is a hole. In a log whose rows are always so far apart it is none.
    pub(crate) fn is_hole(&mut self, dt_s: f64) -> bool {
        const TIMES: f64 = 3.0;
        let mut before_s = self.steps_s;
        self.steps_s[self.at] = dt_s;
        self.at = (self.at + 1) % self.steps_s.len();
        if dt_s <= HOLE_S {
            return false;
        }
        before_s.sort_by(f64::total_cmp);
        dt_s > TIMES * before_s[before_s.len() / 2]
    }
}

impl Check for Holes {
    fn warnings(&self) -> Vec<String> {
        let warning = (self.count > 0).then(|| {
            format!(
                "warning: {} shifts have a hole of more than {HOLE_S} s in the recording: they end with it and count as not completed\nhint: check recorder and bus for lost data; the other shifts are not affected",
                self.count
            )
        });
        warning.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_is_long_and_longer_than_the_rows_are_usually_apart() {
        let holes = |usual_s: f64, rows: usize, last_s: f64| {
            let mut holes = Holes::default();
            (0..rows).for_each(|_| assert!(!holes.is_hole(usual_s)));
            holes.is_hole(last_s)
        };
        assert!(holes(0.01, 40, 0.6) && !holes(0.01, 40, 0.4));
        // Rows that are always a second apart have none, and after a few rows it is not known.
        assert!(!holes(0.3, 40, 0.8) && holes(0.3, 40, 1.0));
        assert!(!holes(0.01, 10, 0.6));
    }
}
