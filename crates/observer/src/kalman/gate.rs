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
    #[inline]
    pub(crate) fn judge<T: Real>(&mut self, innovation: T, variance: T) -> Verdict {
        let most = T::of(f64::from(self.deviations));
        let far = innovation * innovation > most * most * variance;
        let believed = self.believed > 0;
        self.believed = self.believed.saturating_sub(1);
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
