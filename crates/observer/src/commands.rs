//! Commands that may still be on their way to the valve.
//!
//! The command that a sample shows was sent at the sample, or up to [`Commands::send`]'s `early_s` before it; it is in
//! force until the next one was sent. It reaches the cylinder after a delay between a minimum and a maximum.

use drivetrain::Real;

/// Commands that are remembered: enough for a delay of 30 ms at a sample time of 1 ms.
const REMEMBERED: usize = 36;

/// One command.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sent<T> {
    /// Time since its sample, s; below zero while that sample is still to come.
    age_s: T,
    /// How long before its sample it may have been sent, s.
    early_s: T,
    lowest: T,
    highest: T,
}

/// Commands that may still be on their way to the valve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Commands<T> {
    /// Newest first.
    #[cfg_attr(
        feature = "serde",
        serde(
            with = "serde_big_array::BigArray",
            bound(serialize = "T: serde::Serialize", deserialize = "T: serde::Deserialize<'de>")
        )
    )]
    sent: [Sent<T>; REMEMBERED],
    count: usize,
}

impl<T: Real> Commands<T> {
    /// Nothing is known of the command before the first one, up to `command_max`.
    pub(crate) fn unknown(command_max: T) -> Self {
        let zero = T::zero();
        let any = Sent { age_s: T::of(1e6), early_s: zero, lowest: zero, highest: command_max };
        Self { sent: [any; REMEMBERED], count: 1 }
    }

    /// Takes a new command between these limits, of a sample `age_s` ago, sent up to `early_s` before it. One that is like
    /// the newest is that one going on.
    #[inline]
    pub(crate) fn send(&mut self, age_s: T, early_s: T, [lowest, highest]: [T; 2]) {
        let newest = &self.sent[0];
        if newest.lowest == lowest && newest.highest == highest && lowest == highest {
            return;
        }
        let kept = self.count.min(REMEMBERED);
        let full = kept == REMEMBERED;
        if full {
            // No room: the two oldest become one that may have been either.
            let (last, before) = (self.sent[REMEMBERED - 1], &mut self.sent[REMEMBERED - 2]);
            before.lowest = before.lowest.at_most(last.lowest);
            before.highest = before.highest.at_least(last.highest);
            (before.age_s, before.early_s) = (last.age_s, before.early_s.at_least(last.early_s));
        }
        let kept = if full { REMEMBERED - 1 } else { kept };
        // A slice of its own, so that on every target the optimiser sees that the places are within it.
        let moved = self.sent.get_mut(..=kept).unwrap_or_default();
        for at in (1..moved.len()).rev() {
            moved[at] = moved[at - 1];
        }
        self.sent[0] = Sent { age_s, early_s, lowest, highest };
        self.count = kept + 1;
    }

    /// Whether every one of them is this command: then there is one, since neighbours are not alike.
    #[inline]
    pub(crate) fn are_all(&self, command: T) -> bool {
        self.count == 1 && self.sent[0].lowest == command && self.sent[0].highest == command
    }

    /// Carries all of them on by `dt_s`. Those that were sent more than `delay_max_s` before now are forgotten, but for the
    /// newest of them: they have been replaced by what came after them.
    #[inline]
    pub(crate) fn age(&mut self, dt_s: T, delay_max_s: T) {
        for (at, sent) in self.sent.iter_mut().take(self.count).enumerate() {
            sent.age_s = sent.age_s + dt_s;
            if sent.age_s >= delay_max_s {
                self.count = at + 1;
                break;
            }
        }
    }

    /// Lowest and highest of the commands that may be in effect from `start_s` to `end_s` from now.
    #[inline]
    pub(crate) fn in_effect(&self, [min_s, max_s]: [T; 2], start_s: T, end_s: T) -> [T; 2] {
        let (mut lowest, mut highest) = (T::infinity(), T::zero());
        for sent in self.sent.iter().take(self.count) {
            if sent.age_s + sent.early_s + end_s < min_s {
                continue;
            }
            lowest = lowest.at_most(sent.lowest);
            highest = highest.at_least(sent.highest);
            if sent.age_s + start_s >= max_s {
                break;
            }
        }
        [lowest, highest]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DELAY_S: [f64; 2] = [0.005, 0.02];

    #[test]
    fn a_command_acts_from_the_minimum_delay_until_the_maximum_after_the_next() {
        let mut commands = Commands::unknown(0.0);
        commands.send(0.0, 0.0, [1.0, 1.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.0, 0.004), [0.0, 0.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.0, 0.006), [0.0, 1.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.021, 0.03), [1.0, 1.0]);
        commands.age(0.01, DELAY_S[1]);
        commands.send(0.0, 0.0, [3.0, 3.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.0, 0.01), [0.0, 3.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.011, 0.019), [1.0, 3.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.021, 0.022), [3.0, 3.0]);
    }

    #[test]
    fn a_command_that_is_read_again_goes_on() {
        let mut commands = Commands::unknown(0.0);
        for _ in 0..4 {
            commands.send(0.0, 0.0, [1.0, 1.0]);
            commands.age(0.01, DELAY_S[1]);
        }
        // Sent 40 ms ago for the first time: nothing else is in effect.
        assert!(commands.are_all(1.0) && !commands.are_all(2.0));
        assert_eq!(commands.in_effect(DELAY_S, 0.0, 0.01), [1.0, 1.0]);
        commands.send(0.0, 0.0, [2.0, 2.0]);
        assert!(!commands.are_all(1.0) && !commands.are_all(2.0));
        assert_eq!(commands.in_effect(DELAY_S, 0.0, 0.006), [1.0, 2.0]);
        commands.age(0.01, DELAY_S[1]);
        // The old one again: the one between is still on its way.
        commands.send(0.0, 0.0, [1.0, 1.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.0, 0.006), [1.0, 2.0]);
        assert!(!commands.are_all(1.0));
    }

    #[test]
    fn a_command_of_the_coming_sample_acts_as_early_as_it_may_have_been_sent() {
        // Sent somewhere in the 10 ms before its sample, which lies 10 ms ahead.
        let mut commands = Commands::unknown(0.0);
        commands.send(-0.01, 0.01, [1.0, 1.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.0, 0.004), [0.0, 0.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.004, 0.008), [0.0, 1.0]);
        assert_eq!(commands.in_effect(DELAY_S, 0.031, 0.032), [1.0, 1.0]);
    }
}
