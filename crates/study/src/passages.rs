//! The shifts in a sequence of estimates, as detected by the supervisor.

use observer::Phase;

/// Shifts that went through the inertia phase to the phase after them, seen one phase at a time.
#[derive(Debug, Clone, Default)]
pub struct Passages {
    /// When the shift under way began, s.
    begun_s: Option<f64>,
    /// Whether it has come to the inertia phase: a log that begins in the gear after it has had none.
    has_slipped: bool,
    /// How many there were.
    pub count: u64,
    /// When the first of them began and ended, s.
    pub first_s: Vec<[f64; 2]>,
}

/// Shifts whose times are kept.
const KEPT: usize = 10;

impl Passages {
    /// Takes the phase at the next time.
    pub fn push(&mut self, time_s: f64, phase: Phase) {
        match phase {
            Phase::BeforeShift => (self.begun_s, self.has_slipped) = (None, false),
            Phase::TorquePhase | Phase::InertiaPhase => {
                self.begun_s.get_or_insert(time_s);
                self.has_slipped |= phase == Phase::InertiaPhase;
            }
            Phase::AfterShift => {
                let has_slipped = std::mem::take(&mut self.has_slipped);
                let Some(begun_s) = self.begun_s.take().filter(|_| has_slipped) else { return };
                self.count += 1;
                if self.first_s.len() < KEPT {
                    self.first_s.push([begun_s, time_s]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Phase::{AfterShift, BeforeShift, InertiaPhase, TorquePhase};

    #[test]
    fn only_a_shift_that_went_through_is_counted() {
        let phases = [BeforeShift, TorquePhase, BeforeShift, TorquePhase, InertiaPhase, TorquePhase, InertiaPhase];
        let mut passages = Passages::default();
        for (time_s, phase) in (0..).map(f64::from).zip(phases.into_iter().chain([AfterShift; 3]).chain(phases)) {
            passages.push(time_s, phase);
        }
        assert_eq!((passages.count, passages.first_s.as_slice()), (1, &[[3.0, 7.0]][..]));
        let mut passages = Passages::default();
        for (time_s, phase) in (0..).map(f64::from).zip([TorquePhase, AfterShift, AfterShift]) {
            passages.push(time_s, phase);
        }
        assert_eq!(passages.count, 0);
    }
}
