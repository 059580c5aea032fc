//! The valve as the filter knows it: the vehicle's maps, and commands that arrive after the middle of the delay budget.

use drivetrain::{ClutchValve, Real, ValveStep};

/// Commands that are remembered: enough for a delay of 30 ms at a sample time of 1 ms.
const REMEMBERED: usize = 32;

/// A pressure this near to what the commands end at is there, Pa.
const SETTLED_PA: f64 = 1.0;

/// A time up to this is a moment, s \[chosen\]: what is in effect for a part of it is not known, as times are rounded.
const MOMENT_S: f64 = 1e-6;

/// The valve model.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ValveModel<T> {
    /// Lag and gain over the operating point.
    pub valve: ClutchValve<T>,
    /// Time until a command arrives, s.
    pub delay_s: T,
}

/// A command that was sent, as the pressure it ends at.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sent<T> {
    age_s: T,
    settled_pa: T,
}

/// The commands on their way to the valve, newest first.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Commands<T> {
    sent: [Sent<T>; REMEMBERED],
    count: usize,
    /// Age of the newest reading, s: one that is like the newest command is that one going on.
    read_s: T,
}

impl<T: Real> Commands<T> {
    /// None yet.
    pub(crate) fn new() -> Self {
        Self { sent: [Sent { age_s: T::zero(), settled_pa: T::zero() }; REMEMBERED], count: 0, read_s: T::zero() }
    }

    /// Pressure that the newest command ends at, Pa, if there was one.
    pub(crate) fn newest_pa(&self) -> Option<T> {
        self.sent.iter().take(self.count).map(|sent| sent.settled_pa).next()
    }

    /// Whether a command came in the last `lost_s`.
    pub(crate) fn is_fresh(&self, lost_s: T) -> bool {
        self.count > 0 && self.read_s <= lost_s
    }

    /// Lets time pass.
    #[inline]
    pub(crate) fn pass(&mut self, dt_s: T) {
        self.read_s = self.read_s + dt_s;
        for sent in self.sent.iter_mut().take(self.count) {
            sent.age_s = sent.age_s + dt_s;
        }
    }

    /// Takes a command that was sent `age_s` ago. Those that were replaced more than `needed_s` ago are forgotten.
    #[inline]
    pub(crate) fn send(&mut self, age_s: T, settled_pa: T, needed_s: T) {
        // Commands arrive in their order; the oldest one gives way.
        let age_s = if self.count > 0 { age_s.at_most(self.read_s) } else { age_s };
        self.read_s = age_s;
        let oldest = self.sent.iter().take(self.count).position(|sent| sent.age_s >= needed_s);
        let kept = oldest.map_or(self.count, |at| at + 1).min(REMEMBERED - 1);
        if self.newest_pa() == Some(settled_pa) {
            self.count = kept;
            return;
        }
        let mut moved = Sent { age_s, settled_pa };
        for sent in self.sent.iter_mut().take(kept + 1) {
            core::mem::swap(sent, &mut moved);
        }
        self.count = kept + 1;
    }

    /// Mean of what the commands end at that were in effect from `dt_s` ago until now, Pa; `None` before the first
    /// command. The first one is taken to have stood before.
    #[inline]
    fn mean_pa(&self, delay_s: T, dt_s: T) -> Option<T> {
        // One has stood all the time.
        if self.count == 1 {
            return self.newest_pa();
        }
        // At a time `x` ago the newest command was in effect that is older than `x` and the delay.
        let (newest, oldest) = (delay_s, delay_s + dt_s);
        let earliest = self.sent.get(self.count.checked_sub(1)?)?;
        if dt_s <= T::of(MOMENT_S) {
            let first = self.sent.iter().take(self.count).find(|sent| sent.age_s >= newest);
            return Some(first.unwrap_or(earliest).settled_pa);
        }
        let (mut until, mut sum) = (newest, T::zero());
        for sent in self.sent.iter().take(self.count) {
            let begun = sent.age_s.at_least(newest).at_most(oldest);
            sum = sum + (begun - until) * sent.settled_pa;
            until = begun;
            if sent.age_s >= oldest {
                break;
            }
        }
        Some((sum + (oldest - until) * earliest.settled_pa) / dt_s)
    }
}

impl<T: Real> ValveModel<T> {
    /// Mean of what the commands in effect over the last `dt_s` end at, Pa.
    #[inline]
    pub(crate) fn target_pa(&self, commands: &Commands<T>, dt_s: T) -> T {
        self.target_after_pa(commands, self.delay_s, dt_s)
    }

    /// The same with another delay, s.
    #[inline]
    pub(crate) fn target_after_pa(&self, commands: &Commands<T>, delay_s: T, dt_s: T) -> T {
        commands.mean_pa(delay_s, dt_s).unwrap_or_else(T::zero)
    }

    /// How long a command is needed after the next one was sent, for steps up to `dt_s`, s.
    #[inline]
    pub(crate) fn needed_s(&self, dt_s: T) -> T {
        self.delay_s + dt_s
    }

    /// The pressure `dt_s` after it was `pressure_pa`, under commands that end at `settled_pa`, Pa.
    #[inline]
    pub(crate) fn carried_pa(&self, settled_pa: T, pressure_pa: T, dt_s: T) -> T {
        // Most of a drive a clutch is full or empty.
        if (settled_pa - pressure_pa).abs() < T::of(SETTLED_PA) {
            return settled_pa;
        }
        self.valve.carried(settled_pa, pressure_pa, dt_s)
    }

    /// The valve over `dt_s` on its way from `pressure_pa` to `settled_pa`.
    #[inline]
    pub(crate) fn step(&self, settled_pa: T, pressure_pa: T, dt_s: T) -> ValveStep<T> {
        self.valve.step(settled_pa, pressure_pa, dt_s)
    }

    /// The same model in another precision.
    pub fn cast<U: Real>(&self) -> ValveModel<U> {
        ValveModel { valve: self.valve.cast(), delay_s: U::of(self.delay_s.to_f64_exact()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_in_effect_after_the_delay_and_for_as_long_as_it_stood() {
        let mut commands = Commands::<f64>::new();
        assert_eq!(commands.mean_pa(0.015, 0.01), None);
        commands.send(0.0, 1.0, 0.025);
        // The first command has stood for ever.
        assert!((commands.mean_pa(0.015, 0.01).unwrap() - 1.0).abs() < 1e-12);
        commands.pass(0.01);
        commands.send(0.0, 3.0, 0.025);
        commands.pass(0.01);
        // Sent 10 ms ago: not in effect yet.
        assert!((commands.mean_pa(0.015, 0.01).unwrap() - 1.0).abs() < 1e-12);
        commands.pass(0.01);
        // Sent 20 ms ago, so in effect since 5 ms of 10 ms.
        assert!((commands.mean_pa(0.015, 0.01).unwrap() - 2.0).abs() < 1e-12);
        commands.pass(0.01);
        assert!((commands.mean_pa(0.015, 0.01).unwrap() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn over_a_moment_one_command_is_in_effect() {
        let mut commands = Commands::<f32>::new();
        commands.send(0.0, 1e6, 0.025);
        commands.pass(0.1);
        commands.send(0.0, 0.0, 0.025);
        commands.pass(0.015);
        for dt_s in [0.0, 1e-44, 1e-30, 1e-9, 1e-7] {
            commands.pass(dt_s);
            let mean_pa = commands.mean_pa(0.015, dt_s).unwrap();
            assert!(mean_pa == 0.0 || mean_pa == 1e6, "{dt_s}: {mean_pa}");
        }
    }

    #[test]
    fn a_command_that_is_read_again_goes_on() {
        let mut commands = Commands::<f64>::new();
        for _ in 0..50 {
            commands.pass(0.01);
            commands.send(0.0, 2.0, 0.025);
        }
        assert!(commands.is_fresh(0.001) && commands.mean_pa(0.015, 0.01) == Some(2.0));
        commands.pass(0.3);
        assert!(!commands.is_fresh(0.25));
        commands.send(0.0, 4.0, 0.025);
        commands.pass(0.01);
        commands.send(0.0, 2.0, 0.025);
        commands.pass(0.01);
        // The one between came 20 ms ago and stood for 10 ms: it is in effect for the last 5 ms.
        assert!((commands.mean_pa(0.015, 0.01).unwrap() - 3.0).abs() < 1e-12);
        commands.pass(0.01);
        assert!((commands.mean_pa(0.015, 0.01).unwrap() - 3.0).abs() < 1e-12);
        commands.pass(0.01);
        assert!((commands.mean_pa(0.015, 0.01).unwrap() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn more_commands_than_are_remembered_do_no_harm() {
        let mut commands = Commands::<f32>::new();
        for i in 0..100_u8 {
            commands.send(0.0, f32::from(i), 1.0);
            commands.pass(0.001);
        }
        assert!(commands.is_fresh(0.0015) && !commands.is_fresh(0.0005));
        // Number 84 was sent 16 ms ago, and 83 before it.
        let mean = commands.mean_pa(0.0155, 0.001).unwrap();
        assert!((mean - 83.5).abs() < 0.01, "{mean}");
    }
}
