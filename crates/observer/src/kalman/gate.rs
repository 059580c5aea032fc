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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Gate {
    /// Largest innovation of a reading that is believed, in its own standard deviations.
    std_devs: u8,
    /// Readings of this channel that may not be refused.
    believed: u8,
    /// Whether a reading that agrees ends them.
    ended_by_agreement: bool,
}

impl Gate {
    /// An open one.
    pub(crate) fn new(std_devs: u8) -> Self {
        Self { std_devs, believed: 0, ended_by_agreement: false }
    }

    /// The same, but after a refused reading one within half of the gate tells that nothing has jumped: the next one beyond
    /// the gate is another outlier.
    // The gearbox filter does without: refusing by this rule too, it fails two of its tests.
    pub(crate) fn ended_by_agreement(self) -> Self {
        Self { ended_by_agreement: true, ..self }
    }

    /// Judges an innovation with this variance, by the chi-square distribution of its square over its variance.
    #[inline]
    pub(crate) fn judge<T: Real>(&mut self, innovation: T, variance: T) -> Verdict {
        let maximum = T::of(f64::from(self.std_devs));
        let (square, limit) = (innovation * innovation, maximum * maximum * variance);
        let (far, near) = (square > limit, square <= T::of(0.25) * limit);
        let believed = self.believed > 0;
        self.believed = if near && self.ended_by_agreement { 0 } else { self.believed.saturating_sub(1) };
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
    use Verdict::{Jumped, Refused, Taken};

    /// What becomes of innovations, in standard deviations.
    fn verdicts<const K: usize>(mut gate: Gate, innovations: [f64; K]) -> [Verdict; K] {
        innovations.map(|innovation| gate.judge(innovation, 1.0))
    }

    #[test]
    fn two_outliers_with_a_reading_between_that_agrees_are_both_refused_where_agreement_ends_belief() {
        let innovations = [0.0, 9.0, 0.5, -7.0, 1.0];
        assert_eq!(verdicts(Gate::new(4), innovations), [Taken, Refused, Taken, Jumped, Taken]);
        let gate = Gate::new(4).ended_by_agreement();
        assert_eq!(verdicts(gate, innovations), [Taken, Refused, Taken, Refused, Taken]);
    }

    #[test]
    fn a_jump_is_believed_at_the_second_reading_also_where_one_is_between_that_says_little() {
        for gate in [Gate::new(4), Gate::new(4).ended_by_agreement()] {
            assert_eq!(verdicts(gate, [9.0, 9.0, 9.0]), [Refused, Jumped, Jumped]);
            assert_eq!(verdicts(gate, [5.0, 3.0, 5.0]), [Refused, Taken, Jumped]);
        }
    }
}
