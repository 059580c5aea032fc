//! Gear signals without their glitches.

/// A value counts when it was there for so long, s, or for so many samples.
const STEADY_S: f64 = 0.05;
const STEADY_SAMPLES: u32 = 3;

/// A change of a gear signal; none is no forward gear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    pub(super) time_s: f64,
    pub(super) from: Option<u32>,
    pub(super) to: Option<u32>,
}

/// A signal of whole numbers whose short excursions do not count.
#[derive(Debug, Default)]
pub(super) struct Steady {
    steady: Option<Option<u32>>,
    /// A new value, since when, and how often it was seen.
    candidate: Option<(Option<u32>, f64, u32)>,
}

impl Steady {
    /// The value that counts; none before there is one.
    pub(super) fn value(&self) -> Option<Option<u32>> {
        self.steady
    }

    /// Takes a value; the change to it, once it is steady.
    pub(super) fn push(&mut self, time_s: f64, value: Option<u32>) -> Option<Change> {
        if self.steady == Some(value) {
            self.candidate = None;
            return None;
        }
        let (since_s, samples) = match self.candidate {
            Some((candidate, since_s, samples)) if candidate == value => (since_s, samples + 1),
            _ => (time_s, 1),
        };
        self.candidate = Some((value, since_s, samples));
        if samples < STEADY_SAMPLES && time_s - since_s < STEADY_S {
            return None;
        }
        self.candidate = None;
        let from = self.steady.replace(value);
        from.map(|from| Change { time_s: since_s, from, to: value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_glitch_is_no_change_and_a_change_has_the_time_of_its_first_sample() {
        let mut gear = Steady::default();
        let values = [1, 1, 1, 7, 1, 1, 2, 2, 2, 2];
        let changes: Vec<Change> =
            (0_u32..).zip(values).filter_map(|(i, value)| gear.push(f64::from(i) * 0.01, Some(value))).collect();
        assert_eq!(changes, [Change { time_s: 0.06, from: Some(1), to: Some(2) }]);
    }
}
