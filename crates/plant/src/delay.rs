//! Transport delay of a valve, `L_cv` of Eq. (2.4): commands arrive after a delay, always in their order.

use std::collections::VecDeque;

/// Commands on their way to a valve.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayLine {
    arrived: f64,
    under_way: VecDeque<(f64, f64)>,
}

impl DelayLine {
    /// A line on which this command has stood for ever.
    pub fn new(command: f64) -> Self {
        Self { arrived: command, under_way: VecDeque::new() }
    }

    /// Sends a command at `now_s` that arrives `delay_s` later, but not before those sent earlier.
    pub fn send(&mut self, now_s: f64, delay_s: f64, command: f64) {
        let newest = self.under_way.back().map_or(self.arrived, |&(_, command)| command);
        // An unchanged command arrives nowhere new; this spares the integrator a stop.
        // Only the very same command may be left out.
        if newest == command {
            return;
        }
        let after = self.under_way.back().map_or(now_s, |&(arrival, _)| arrival);
        self.under_way.push_back((after.max(now_s + delay_s), command));
    }

    /// Time of the next arrival, s.
    pub fn next_arrival_s(&self) -> Option<f64> {
        self.under_way.front().map(|&(arrival, _)| arrival)
    }

    /// Command that arrived last.
    pub fn arrived(&self) -> f64 {
        self.arrived
    }

    /// Command that has arrived by `now_s`.
    pub fn arrive(&mut self, now_s: f64) -> f64 {
        while let Some(&(arrival, command)) = self.under_way.front() {
            if arrival > now_s {
                break;
            }
            self.arrived = command;
            self.under_way.pop_front();
        }
        self.arrived
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
