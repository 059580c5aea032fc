//! Transport delay of a valve: commands arrive late, and never overtake one another.

use std::collections::VecDeque;

/// Commands on their way to a valve.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayLine {
    arrived_a: f64,
    under_way: VecDeque<(f64, f64)>,
}

impl DelayLine {
    /// A line on which this current has stood for ever.
    pub fn new(current_a: f64) -> Self {
        Self { arrived_a: current_a, under_way: VecDeque::new() }
    }

    /// Sends a current at `now_s` that arrives `delay_s` later, but not before those sent earlier.
    pub fn send(&mut self, now_s: f64, delay_s: f64, current_a: f64) {
        let newest = self.under_way.back().map_or(self.arrived_a, |&(_, current)| current);
        // An unchanged current arrives nowhere new; this spares the integrator a stop.
        #[expect(clippy::float_cmp, reason = "only the very same command may be left out")]
        if newest == current_a {
            return;
        }
        let after = self.under_way.back().map_or(now_s, |&(arrival, _)| arrival);
        self.under_way.push_back((after.max(now_s + delay_s), current_a));
    }

    /// Time of the next arrival, s.
    pub fn next_arrival_s(&self) -> Option<f64> {
        self.under_way.front().map(|&(arrival, _)| arrival)
    }

    /// Current that has arrived by `now_s`, A.
    pub fn arrive(&mut self, now_s: f64) -> f64 {
        while let Some(&(arrival, current)) = self.under_way.front() {
            if arrival > now_s {
                break;
            }
            self.arrived_a = current;
            self.under_way.pop_front();
        }
        self.arrived_a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_arrives_after_its_delay_and_not_before() {
        let mut line = DelayLine::new(0.0);
        line.send(1.0, 0.02, 0.5);
        assert_eq!((line.next_arrival_s(), line.arrive(1.019)), (Some(1.02), 0.0));
        assert_eq!((line.arrive(1.02), line.next_arrival_s()), (0.5, None));
    }

    #[test]
    fn a_later_command_with_less_delay_does_not_overtake() {
        let mut line = DelayLine::new(0.0);
        line.send(0.0, 0.03, 0.1);
        line.send(0.01, 0.0, 0.9);
        assert_eq!(line.arrive(0.02), 0.0);
        assert_eq!(line.arrive(0.03), 0.9);
    }
}
