//! A guaranteed range around every estimate.
//!
//! The pressure's follows from the command alone: whatever the valve does within its budget of lag, gain and delay, it
//! stays between the slowest and the fastest that the budget allows. That is the certificate's recursion for a gain of
//! zero, with lag and gain over the operating point in place of one worst rate. The clutch torque's adds the friction, the
//! shaft torque's is that of [`crate::shaft_range`]. Of the observer they use only the phase, which all see alike, so they
//! hold for any of them.

use drivetrain::{Clutch, Real, ValveMaps};

use crate::{Estimate, Estimator, Health, Input, InputLimits, ShaftMemory, ShaftRange};

/// Largest errors under which the range holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget<T> {
    /// The valve as measured: lag, gain and delay over the operating point.
    pub valve: ValveMaps<T>,
    /// Least and greatest factor on its lag.
    pub lag_factor: [T; 2],
    /// Least and greatest factor on its gain.
    pub gain_factor: [T; 2],
    /// Least and greatest delay, s.
    pub delay_s: [T; 2],
    /// Error of a reading of the command, A.
    pub command: T,
    /// Highest pressure that the supply can give, Pa.
    pub pressure_max_pa: T,
    /// Least and greatest factor on the clutch's friction.
    pub friction_factor: [T; 2],
    /// Error of a reading of the slip, rad/s.
    pub slip_rad_s: T,
}

/// Ranges that hold the truth as long as every error is within its budget.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds<T> {
    /// Lowest and highest pressure, Pa.
    pub pressure_pa: [T; 2],
    /// Lowest and highest clutch torque while the clutch slips, N m; a locked one carries any torque up to the larger.
    pub clutch_torque_n_m: [T; 2],
    /// Lowest and highest drive-shaft torque, N m, where the wheel speed is measured.
    pub shaft_torque_n_m: Option<[T; 2]>,
}

/// Any observer with a guaranteed range around its estimates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounded<T, O> {
    /// The observer.
    pub observer: O,
    /// What the range is made from.
    pub budget: Budget<T>,
    /// The oncoming clutch.
    pub clutch: Clutch<T>,
    /// The drive shafts' part.
    pub shaft: ShaftRange<T>,
    /// What counts as a measurement.
    pub limits: InputLimits<T>,
}

/// Commands that are remembered: enough for a delay of 30 ms at a sample time of 1 ms.
const REMEMBERED: usize = 36;
/// Longest time over which the lag is taken at its extreme, s; a longer sample is cut into pieces.
const PIECE_S: f64 = 0.0101;
/// Most pieces; beyond them each is longer, which makes the range wider and not wrong.
const MOST_PIECES: usize = 8;

/// A command that may still be on its way to the valve.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sent<T> {
    age_s: T,
    lowest: T,
    highest: T,
}

/// Memory of the range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tube<T> {
    lower_pa: T,
    upper_pa: T,
    /// Newest first.
    sent: [Sent<T>; REMEMBERED],
    count: usize,
}

impl<T: Real> Tube<T> {
    /// An empty cylinder whose valve has had no command for long.
    pub fn new() -> Self {
        let zero = T::zero();
        let none = Sent { age_s: T::of(1e6), lowest: zero, highest: zero };
        Self { lower_pa: zero, upper_pa: zero, sent: [none; REMEMBERED], count: 1 }
    }

    /// Lowest and highest pressure, Pa.
    pub fn pressure_pa(&self) -> [T; 2] {
        [self.lower_pa, self.upper_pa]
    }

    /// Carries the range over `dt_s`.
    #[inline]
    pub fn advance(&mut self, budget: &Budget<T>, dt_s: T) {
        let zero = T::zero();
        if dt_s > zero {
            let pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, MOST_PIECES);
            let length_s = dt_s / T::of(pieces as f64);
            let mut done_s = zero;
            for _ in 0..pieces {
                let target = self.settled(budget, done_s, done_s + length_s);
                self.lower_pa = lower(budget, self.lower_pa, target[0], length_s);
                self.upper_pa = upper(budget, self.upper_pa, target[1], length_s);
                done_s = done_s + length_s;
            }
            for sent in &mut self.sent[..self.count] {
                sent.age_s = sent.age_s + dt_s;
            }
        }
        self.lower_pa = self.lower_pa.max(zero).min(budget.pressure_max_pa);
        self.upper_pa = self.upper_pa.max(zero).min(budget.pressure_max_pa);
    }

    /// Takes a new command between these limits.
    #[inline]
    pub fn send(&mut self, budget: &Budget<T>, lowest: T, highest: T) {
        // What is older than the longest delay has been replaced by what came after it.
        let oldest = self.sent[..self.count].iter().position(|sent| sent.age_s >= budget.delay_s[1]);
        let kept = oldest.map_or(self.count, |at| at + 1).min(REMEMBERED);
        let full = kept == REMEMBERED;
        if full {
            // No room: the two oldest become one that may have been either.
            let (last, before) = (self.sent[REMEMBERED - 1], &mut self.sent[REMEMBERED - 2]);
            before.lowest = before.lowest.min(last.lowest);
            before.highest = before.highest.max(last.highest);
            before.age_s = last.age_s;
        }
        let kept = if full { REMEMBERED - 1 } else { kept };
        self.sent.copy_within(..kept, 1);
        self.sent[0] = Sent { age_s: T::zero(), lowest, highest };
        self.count = kept + 1;
    }

    /// Everything is possible: time or command were lost.
    pub fn forget(&mut self, budget: &Budget<T>) {
        self.lower_pa = T::zero();
        self.upper_pa = budget.pressure_max_pa;
    }

    /// Lowest and highest pressure at which the commands end that may be in effect from `start_s` to `end_s` from
    /// now.
    #[inline]
    fn settled(&self, budget: &Budget<T>, start_s: T, end_s: T) -> [T; 2] {
        let [least, most] = budget.delay_s;
        let (mut lowest, mut highest) = (T::infinity(), T::zero());
        for sent in &self.sent[..self.count] {
            if sent.age_s + end_s < least {
                continue;
            }
            lowest = lowest.min(sent.lowest);
            highest = highest.max(sent.highest);
            if sent.age_s + start_s >= most {
                break;
            }
        }
        let zero = T::zero();
        let low = (lowest - budget.command).max(zero);
        let high = highest + budget.command;
        [
            budget.gain_factor[0] * budget.valve.settled_pressure(low),
            budget.gain_factor[1] * budget.valve.settled_pressure(high),
        ]
    }
}

impl<T: Real> Default for Tube<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Highest pressure after `dt_s` from `pressure_pa` under commands that end at `target_pa` at most.
#[inline]
fn upper<T: Real>(budget: &Budget<T>, pressure_pa: T, target_pa: T, dt_s: T) -> T {
    let fast = target_pa > pressure_pa;
    moved(budget, pressure_pa, target_pa, dt_s, fast)
}

/// Lowest pressure after `dt_s` from `pressure_pa` under commands that end at `target_pa` at least.
#[inline]
fn lower<T: Real>(budget: &Budget<T>, pressure_pa: T, target_pa: T, dt_s: T) -> T {
    let fast = target_pa < pressure_pa;
    moved(budget, pressure_pa, target_pa, dt_s, fast)
}

/// Where a pressure is after `dt_s`, with the shortest lag that it can meet on its way if `fast`, else the longest.
#[inline]
fn moved<T: Real>(budget: &Budget<T>, pressure_pa: T, target_pa: T, dt_s: T, fast: bool) -> T {
    let lag = |from: T, to: T| {
        let (shortest, longest) = budget.valve.time_constant_s.range_within(from.min(to), from.max(to));
        if fast { shortest * budget.lag_factor[0] } else { longest * budget.lag_factor[1] }
    };
    // It cannot get further than at its first speed, which tells what lags it meets.
    let furthest = if fast {
        let share = (dt_s / lag(pressure_pa, target_pa)).min(T::one());
        pressure_pa + share * (target_pa - pressure_pa)
    } else {
        let (shortest, _) =
            budget.valve.time_constant_s.range_within(pressure_pa.min(target_pa), pressure_pa.max(target_pa));
        let share = (dt_s / (shortest * budget.lag_factor[0])).min(T::one());
        pressure_pa + share * (target_pa - pressure_pa)
    };
    let left = (-dt_s / lag(pressure_pa, furthest)).exp();
    target_pa + (pressure_pa - target_pa) * left
}

impl<T: Real, O: Estimator<T>> Estimator<T> for Bounded<T, O> {
    type State = (O::State, Tube<T>, ShaftMemory<T>);

    fn start(&self) -> Self::State {
        (self.observer.start(), Tube::new(), ShaftMemory::new())
    }

    #[inline]
    fn step(&self, (state, tube, shaft): &mut Self::State, input: &Input<T>) -> Estimate<T> {
        let estimate = self.observer.step(state, input);
        let budget = &self.budget;
        if estimate.health == Health::TimeRejected {
            tube.forget(budget);
        } else {
            tube.advance(budget, input.dt_s.max(T::zero()));
        }
        if self.limits.command_valid(input) {
            tube.send(budget, input.command, input.command);
        } else {
            tube.send(budget, T::zero(), self.limits.command_max);
        }
        let mut bounds = self.bounds(tube, input);
        let usable = self.limits.speeds_valid(input) && self.limits.wheel_valid(input);
        if usable && estimate.health != Health::TimeRejected {
            bounds.shaft_torque_n_m = self.shaft.step(shaft, estimate.phase, input, bounds.clutch_torque_n_m);
        } else {
            *shaft = ShaftMemory::new();
        }
        Estimate { bounds: Some(bounds), ..estimate }
    }
}

impl<T: Real, O> Bounded<T, O> {
    /// The ranges of pressure and clutch torque.
    #[inline]
    fn bounds(&self, tube: &Tube<T>, input: &Input<T>) -> Bounds<T> {
        let [lower_pa, upper_pa] = tube.pressure_pa();
        let slip = input.slip_rad_s;
        let [least, most] = self.budget.friction_factor;
        let (clutch, zero) = (&self.clutch, T::zero());
        let slips = self.limits.speeds_valid(input) && slip.abs() > self.budget.slip_rad_s;
        let (lowest, highest) = if slips {
            let (size, error) = (slip.abs(), self.budget.slip_rad_s);
            clutch.friction.range_within(size - error, size + error)
        } else {
            let (lowest, highest) = clutch.friction.range();
            (lowest.min(clutch.static_friction), highest.max(clutch.static_friction))
        };
        let at_most = most * highest * clutch.lever() * clutch.clamp_force(upper_pa);
        let at_least = least * lowest * clutch.lever() * clutch.clamp_force(lower_pa);
        let clutch_torque_n_m = match slips {
            false => [-at_most, at_most],
            true if slip > zero => [at_least, at_most],
            true => [-at_most, -at_least],
        };
        Bounds { pressure_pa: [lower_pa, upper_pa], clutch_torque_n_m, shaft_torque_n_m: None }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use drivetrain::Table1;
    use std::vec;
    use std::vec::Vec;

    fn budget() -> Budget<f64> {
        Budget {
            valve: ValveMaps {
                time_constant_s: Table1::new(&[0.0, 1e5, 4e5, 1e6], &[0.2, 0.08, 0.035, 0.02]).unwrap(),
                gain_pa_a: Table1::new(&[0.0, 0.5, 1.0], &[0.7e6, 1.0e6, 1.1e6]).unwrap(),
                delay_s: Table1::constant(0.01),
            },
            lag_factor: [0.5, 1.5],
            gain_factor: [0.9, 1.1],
            delay_s: [0.0, 0.03],
            command: 0.005,
            pressure_max_pa: 1.2e6,
            friction_factor: [0.8, 1.2],
            slip_rad_s: 0.6,
        }
    }

    /// A valve within the budget, by small Euler steps, under commands held for 10 ms.
    fn simulated(lag: f64, gain: f64, delay_ms: usize, commands: &[f64]) -> Vec<f64> {
        let (b, mut p) = (budget(), 0.0);
        let mut at_samples = vec![0.0];
        for k in 0..commands.len() * 10 {
            let command = if k < delay_ms { 0.0 } else { commands[(k - delay_ms) / 10] };
            let settled = gain * b.valve.settled_pressure(command);
            for _ in 0..100 {
                p += 1e-5 * (settled - p) / (lag * b.valve.time_constant_s.at(p));
            }
            if (k + 1) % 10 == 0 {
                at_samples.push(p);
            }
        }
        at_samples
    }

    #[test]
    fn every_valve_within_the_budget_stays_in_the_range() {
        let commands: Vec<f64> = (0..60).map(|i| [0.0, 0.3, 0.12, 0.15, 0.2, 0.5, 0.9, 0.4, 0.05][i / 7]).collect();
        let b = budget();
        let mut tube = Tube::new();
        let ranges: Vec<[f64; 2]> = (0..=60)
            .map(|k| {
                tube.advance(&b, if k == 0 { 0.0 } else { 0.01 });
                let range = tube.pressure_pa();
                if k < 60 {
                    tube.send(&b, commands[k], commands[k]);
                }
                range
            })
            .collect();
        let mut closest = f64::INFINITY;
        for (lag, gain, delay) in
            [(0.5, 1.1, 0), (0.5, 0.9, 0), (1.5, 1.1, 30), (1.5, 0.9, 30), (1.0, 1.0, 10), (0.5, 1.1, 30)]
        {
            for (p, [low, high]) in simulated(lag, gain, delay, &commands).iter().zip(&ranges) {
                assert!(low - 1e-6 <= *p && *p <= high + 1e-6, "{p} not in {low} to {high} ({lag}, {gain}, {delay})");
                closest = closest.min(high - p).min(p - low);
            }
        }
        assert!(ranges.iter().all(|[low, high]| *low >= 0.0 && *high <= 1.2e6));
        assert!(closest < 20e3, "the range is far wider than any of these valves: {closest}");
    }

    #[test]
    fn a_held_command_leaves_only_the_gain_and_the_reading() {
        let (b, mut tube) = (budget(), Tube::new());
        for _ in 0..200 {
            tube.send(&b, 0.3, 0.3);
            tube.advance(&b, 0.01);
        }
        let settled = |command: f64, gain: f64| gain * b.valve.settled_pressure(command);
        let [low, high] = tube.pressure_pa();
        assert!((low - settled(0.295, 0.9)).abs() < 1.0 && (high - settled(0.305, 1.1)).abs() < 1.0, "{low} {high}");
    }

    #[test]
    fn a_valve_outside_the_budget_leaves_the_range() {
        let commands = [0.4; 40];
        let b = budget();
        let mut tube = Tube::new();
        let mut left = false;
        for p in simulated(1.0, 1.3, 10, &commands) {
            let [_, high] = tube.pressure_pa();
            left |= p > high;
            tube.send(&b, 0.4, 0.4);
            tube.advance(&b, 0.01);
        }
        assert!(left);
    }

    #[test]
    fn more_commands_than_can_be_remembered_widen_the_range() {
        let b = Budget { delay_s: [0.0, 0.2], ..budget() };
        let mut tube = Tube::new();
        for k in 0..500 {
            let command = if k == 300 { 1.0 } else { 0.1 };
            tube.send(&b, command, command);
            tube.advance(&b, 0.001);
            assert!(tube.count <= REMEMBERED);
            // Up to 0.2 s later the large command may still act.
            if (301..=500).contains(&k) {
                assert!(tube.pressure_pa()[1] > 0.1e6);
            }
        }
    }
}
