//! What the shifts of a log do to what the filter has learnt.

use observer::gearbox::Learnt;

/// Shifts that were learnt from, counted step by step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LearningCount {
    /// Shifts that were learnt from.
    pub taken: u32,
    /// How often all that was known before was forgotten, because shifts contradicted it.
    pub forgotten: u32,
    shifts: u32,
    refused: u8,
}

impl LearningCount {
    /// Begins with what is known before the first step.
    pub fn of(learnt: &Learnt<f64>) -> Self {
        Self { taken: 0, forgotten: 0, shifts: learnt.shifts, refused: learnt.refused }
    }

    /// Takes what is known after a step. What is forgotten is counted from zero again.
    pub fn push(&mut self, learnt: &Learnt<f64>) {
        let (before, now) = ((self.shifts, self.refused), (learnt.shifts, learnt.refused));
        (self.shifts, self.refused) = now;
        if now.0 > before.0 {
            self.taken += now.0 - before.0;
        } else if now < before {
            self.forgotten += u32::from(before.0 > 0);
            self.taken += now.0;
        }
    }

    /// Whether what is known is other than before the first step.
    pub fn has_changed(&self) -> bool {
        self.taken > 0 || self.forgotten > 0
    }
}

#[cfg(test)]
mod tests {
    use observer::gearbox::LEARNT;

    use super::*;

    fn learnt(shifts: u32, refused: u8) -> Learnt<f64> {
        Learnt { mean: [0.0; LEARNT], covariance: [[0.0; LEARNT]; LEARNT], shifts, refused, odds: 0.0, oil_degc: None }
    }

    fn counted(steps: &[(u32, u8)]) -> (u32, u32) {
        let (first, rest) = steps.split_first().unwrap();
        let mut count = LearningCount::of(&learnt(first.0, first.1));
        rest.iter().for_each(|&(shifts, refused)| count.push(&learnt(shifts, refused)));
        (count.taken, count.forgotten)
    }

    #[test]
    fn shifts_are_counted_from_where_the_file_ends_and_again_after_all_is_forgotten() {
        assert_eq!(counted(&[(0, 0), (1, 0), (1, 0), (2, 0)]), (2, 0));
        assert_eq!(counted(&[(30, 0), (30, 0), (31, 0)]), (1, 0));
        assert_eq!(counted(&[(30, 0), (30, 1), (30, 2)]), (0, 0));
        // Forgotten with the eighth refused shift, or by the odds: then the shift itself is the first of another car.
        assert_eq!(counted(&[(30, 7), (0, 0), (1, 0)]), (1, 1));
        assert_eq!(counted(&[(30, 2), (1, 0), (2, 0)]), (2, 1));
        assert_eq!(counted(&[(1, 2), (1, 0)]), (1, 1));
        assert!(!LearningCount::of(&learnt(30, 3)).has_changed());
    }
}
