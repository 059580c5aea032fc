//! The innovation gate: which readings are believed.

use drivetrain::Real;

/// Readings of a channel after a refused one that are not refused: an outlier is single, a jump persists.
const BELIEVED_AFTER: u8 = 5;

/// What becomes of a reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// It is taken as usual.
    Taken,
    /// It is refused as an outlier.
    Refused,
    /// The quantity has jumped: the reading is taken, and the state's variance grows by the square of the innovation.
    Jumped,
}

/// Memory of a gate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Gate {
    /// Largest innovation of a reading that is believed, in its own standard deviations.
    deviations: u8,
    /// Readings of this channel that may not be refused.
    believed: u8,
}

impl Gate {
    /// An open one.
    pub(crate) fn new(deviations: u8) -> Self {
        Self { deviations, believed: 0 }
    }

    /// Judges an innovation with this variance, by the chi-square distribution of its square over its variance.
    ///
    /// After a refused reading, one within half of the gate tells that nothing has jumped: the next one beyond the gate is
    /// another outlier.
    #[inline]
    pub(crate) fn judge<T: Real>(&mut self, innovation: T, variance: T) -> Verdict {
        let most = T::of(f64::from(self.deviations));
        let (square, limit) = (innovation * innovation, most * most * variance);
        let (far, near) = (square > limit, square <= T::of(0.25) * limit);
        let believed = self.believed > 0;
        self.believed = if near { 0 } else { self.believed.saturating_sub(1) };
        match (far, believed) {
            (false, _) => Verdict::Taken,
            (true, true) => Verdict::Jumped,
            (true, false) => {
                self.believed = BELIEVED_AFTER;
                Verdict::Refused
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What becomes of innovations, in deviations.
    fn verdicts<const K: usize>(innovations: [f64; K]) -> [Verdict; K] {
        let mut gate = Gate::new(4);
        innovations.map(|innovation| gate.judge(innovation, 1.0))
    }

    #[test]
    fn two_outliers_with_a_reading_between_that_agrees_are_both_refused() {
        use Verdict::{Refused, Taken};
        assert_eq!(verdicts([0.0, 9.0, 0.5, -7.0, 1.0]), [Taken, Refused, Taken, Refused, Taken]);
    }

    #[test]
    fn a_jump_is_believed_at_the_second_reading_also_where_one_is_between_that_says_little() {
        use Verdict::{Jumped, Refused, Taken};
        assert_eq!(verdicts([9.0, 9.0, 9.0]), [Refused, Jumped, Jumped]);
        assert_eq!(verdicts([5.0, 3.0, 5.0]), [Refused, Taken, Jumped]);
    }
}
