//! The range of the pressure that follows from the commands alone.
//!
//! For any lag, gain, delay and hysteresis within the budget, the pressure at the valve's outlet is between the solutions of
//! the slowest and the fastest valve of the budget. This is the certificate's recursion for a gain of zero, with lag and
//! gain at the operating point instead of one worst rate. Without a stroke of the piston in the budget the outlet pressure is
//! the cylinder pressure; with one, [`crate::fill_range`] carries the range on to the cylinder.
//!
//! A reading of the command is as old as it says. The range is carried to the time of the newest reading with what was read
//! until then. From there to now the newest command holds until the next reading may come, and then any command.
//!
//! **What it assumes:** the entries of [`Budget`]; that the command stays between two neighbouring readings, also over
//! one lost time step, and is the first of them until [`Budget::command_age_s`] before the second; the lag at a pressure is
//! that of the budget's map times its factors; that two readings are not much closer in time than usual. Where steps came
//! between two readings that are farther apart than usual, one is missing, and any command may have been sent. Usual is the middle one
//! of the last five times between readings: at most two of five neighbouring ones may contain a lost reading.

use drivetrain::Real;

use crate::commands::Commands;
use crate::fill_range::{Outlet, PistonRange};
use crate::{Budget, Reading};

/// Longest time over which the lag is taken at its extreme, s; a longer sample is cut into pieces.
const PIECE_S: f64 = 0.0101;
/// Most pieces; beyond them each is longer, which makes the range wider and not wrong.
const MAX_PIECES: usize = 8;
/// Two readings more than this many usual periods apart have lost one between them: a command of between may be that of
/// the lost one.
const LOST: f64 = 1.5;
/// Two readings more than this many usual periods apart have lost more than one.
const GAP: f64 = 2.5;
/// Fraction by which two equal times between rows differ by rounding.
const ROUNDING: f64 = 1e-9;
/// The next reading comes after at least this fraction of the shortest of these times \[chosen\]: clocks waver by a tenth.
const SOONEST: f64 = 0.8;
/// Times between readings of which the middle one is the usual period \[chosen\]: a slower channel counts as such after three of them, not
/// at once, since it may be one that has lost readings; and clocks that waver do not make the usual time look like a gap.
const PERIODS: usize = 5;

/// Memory of the range of the pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PressureRange<T> {
    /// Ages are those at the newest reading.
    commands: Commands<T>,
    /// At the newest reading.
    at_reading: Limits<T>,
    now: Limits<T>,
    /// Time since the newest reading was true, s; none before the first.
    since_reading_s: Option<T>,
    /// Whether a step has come since then without a reading.
    stepped: bool,
    /// The last times between two readings, s.
    periods: Periods<T>,
    /// A command under which the limits at the newest reading stand still, and the longest time over which they did, s.
    still: Option<(T, T)>,
}

/// The last times between two readings.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Periods<T> {
    /// In the order in which they came, around `at`; those to come are infinite.
    last_s: [T; PERIODS],
    at: u8,
    /// The middle one, and the shortest: infinite and zero before the first.
    usual_s: T,
    shortest_s: T,
}

impl<T: Real> Periods<T> {
    fn new() -> Self {
        Self { last_s: [T::infinity(); PERIODS], at: 0, usual_s: T::infinity(), shortest_s: T::zero() }
    }

    /// Takes a time. Of an even number of them, the shorter of the two in the middle is the usual one.
    #[inline]
    fn push(&mut self, period_s: T) {
        let at = usize::from(self.at) % PERIODS;
        let oldest_s = core::mem::replace(&mut self.last_s[at], period_s);
        self.at = ((at + 1) % PERIODS) as u8;
        // Times of even rows differ by their rounding alone.
        if (oldest_s - period_s).abs() <= T::of(ROUNDING) * period_s {
            return;
        }
        let mut sorted = self.last_s;
        for end in 1..PERIODS {
            for i in (1..=end).rev() {
                let (low, high) = (sorted[i - 1].at_most(sorted[i]), sorted[i - 1].at_least(sorted[i]));
                (sorted[i - 1], sorted[i]) = (low, high);
            }
        }
        let count = sorted.iter().filter(|period_s| period_s.is_finite()).count();
        (self.usual_s, self.shortest_s) = (sorted[count.saturating_sub(1) / 2], sorted[0]);
    }
}

/// What is known of the valve and the cylinder at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Limits<T> {
    /// The lowest and the highest command that were in effect, and the minimum and maximum pressure that they end at, Pa.
    commands: [T; 2],
    ends_pa: [T; 2],
    /// Lowest and highest settled pressure behind the hysteresis, Pa.
    asked_pa: [T; 2],
    /// Lowest and highest pressure at the valve's outlet, Pa.
    outlet_pa: [T; 2],
    piston: PistonRange<T>,
}

impl<T: Real> PressureRange<T> {
    /// Nothing is known of the cylinder, nor of the command before the first one, up to `command_max`.
    pub fn unknown(budget: &Budget<T>, command_max: T) -> Self {
        let limits = Limits::unknown(budget.pressure_max_pa);
        Self {
            commands: Commands::unknown(command_max),
            at_reading: limits,
            now: limits,
            since_reading_s: None,
            stepped: false,
            periods: Periods::new(),
            still: None,
        }
    }

    /// Lowest and highest cylinder pressure, Pa.
    #[inline]
    pub fn pressure_pa(&self, budget: &Budget<T>) -> [T; 2] {
        budget.fill.as_ref().map_or(self.now.outlet_pa, |fill| self.now.piston.pressure_pa(fill))
    }

    /// What is known of the piston, where the budget has a stroke.
    pub fn piston(&self, budget: &Budget<T>) -> Option<&PistonRange<T>> {
        budget.fill.is_some().then_some(&self.now.piston)
    }

    /// Lets `dt_s` pass and takes a reading of the command, if there is a new one; `command_max` is the largest command
    /// that there is. A reading that is older than the one before is left out.
    #[inline]
    pub fn step(&mut self, budget: &Budget<T>, dt_s: T, command: Option<Reading<T>>, command_max: T) {
        let zero = T::zero();
        let before_s = self.since_reading_s;
        let now_s = before_s.map(|before_s| before_s + dt_s);
        // The first one tells nothing of the time before it.
        let new = command.map(|reading| (reading, now_s.map_or(zero, |now_s| now_s - reading.age_s)));
        if let Some((reading, interval_s)) = new.filter(|(_, interval_s)| *interval_s >= zero) {
            self.take(budget, interval_s, reading.value, command_max);
            self.now = self.at_reading;
            if reading.age_s > zero {
                self.carry_on(budget, zero, reading.age_s, command_max);
            }
            (self.since_reading_s, self.stepped) = (Some(reading.age_s), false);
        } else {
            let start_s = before_s.unwrap_or(zero);
            self.carry_on(budget, start_s, start_s + dt_s, command_max);
            (self.since_reading_s, self.stepped) = (now_s, true);
        }
    }

    /// Everything is possible: time was lost, and with it commands.
    pub fn forget(&mut self, budget: &Budget<T>, command_max: T) {
        *self = Self { periods: self.periods, ..Self::unknown(budget, command_max) };
    }

    /// Carries the limits at the newest reading on to the next one, `interval_s` later.
    #[inline]
    fn take(&mut self, budget: &Budget<T>, interval_s: T, command: T, command_max: T) {
        let (zero, delay_max_s) = (T::zero(), budget.delay_s[1]);
        let period_s = self.periods.usual_s;
        let lost = interval_s > T::of(LOST) * period_s;
        if lost && self.stepped || interval_s > T::of(GAP) * period_s {
            self.commands.send(zero, zero, [zero, command_max]);
        }
        if interval_s > zero {
            self.periods.push(interval_s);
        }
        // As all commands are alike, their ages do not matter.
        if self.still.is_some_and(|(still, longest_s)| !lost && still == command && interval_s <= longest_s) {
            return;
        }
        let before = (!lost && self.commands.are_all(command)).then_some(self.at_reading);
        let early_s = if lost { interval_s } else { budget.command_age_s.at_most(interval_s) };
        if early_s > zero {
            self.commands.send(-interval_s, early_s, [command; 2]);
        }
        let commands = &self.commands;
        self.at_reading
            .carry(budget, zero, interval_s, |start_s, end_s| commands.in_effect(budget.delay_s, start_s, end_s));
        self.commands.age(interval_s, delay_max_s);
        if early_s <= zero {
            self.commands.send(zero, zero, [command; 2]);
        }
        self.still = (before == Some(self.at_reading)).then_some((command, interval_s));
    }

    /// Carries the limits for now from `start_s` to `end_s` after the newest reading. Its command holds until the next one
    /// may come; from then on any command may have been sent.
    #[inline]
    fn carry_on(&mut self, budget: &Budget<T>, start_s: T, end_s: T, command_max: T) {
        let any_s =
            (T::of(SOONEST) * self.periods.shortest_s - budget.command_age_s).at_least(T::zero()) + budget.delay_s[0];
        let commands = &self.commands;
        self.now.carry(budget, start_s, end_s, |start_s, end_s| {
            if end_s <= any_s { commands.in_effect(budget.delay_s, start_s, end_s) } else { [T::zero(), command_max] }
        });
    }
}

impl<T: Real> Limits<T> {
    /// Nothing is known, up to the highest pressure of the supply.
    fn unknown(pressure_max_pa: T) -> Self {
        let zero = T::zero();
        Self {
            // No command is that large: the pressures are found with the first one.
            commands: [T::infinity(); 2],
            ends_pa: [zero, T::infinity()],
            asked_pa: [zero, T::infinity()],
            outlet_pa: [zero, pressure_max_pa],
            piston: PistonRange::unknown(pressure_max_pa),
        }
    }

    /// Carries the limits from one time to another under the commands that may be in effect between two times.
    #[inline]
    fn carry(&mut self, budget: &Budget<T>, start_s: T, end_s: T, in_effect: impl Fn(T, T) -> [T; 2]) {
        let dt_s = end_s - start_s;
        if dt_s > T::zero() {
            let (mut pieces, mut length_s) = (1, dt_s);
            if dt_s > T::of(PIECE_S) {
                pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, MAX_PIECES);
                length_s = dt_s / T::of(pieces as f64);
            }
            let mut at_s = start_s;
            for _ in 0..pieces {
                let commands = in_effect(at_s, at_s + length_s);
                if commands != self.commands {
                    (self.commands, self.ends_pa) = (commands, budget.ends(commands));
                }
                self.asked_pa = budget.asked(self.asked_pa, self.ends_pa);
                self.advance_piece(budget, length_s);
                at_s = at_s + length_s;
            }
        }
    }

    /// Carries the pressures over a piece of the time step.
    #[inline]
    fn advance_piece(&mut self, budget: &Budget<T>, dt_s: T) {
        let ([lowest, highest], [low, high]) = (self.outlet_pa, budget.supplied(self.asked_pa));
        let lag = budget.lag_factor;
        let lower = budget.valve.moved(lowest, low, dt_s, lag, low < lowest);
        let upper = budget.valve.moved(highest, high, dt_s, lag, high > highest);
        let lower = lower.at_least(T::zero()).at_most(budget.pressure_max_pa);
        // Where both ends have settled at one pressure, rounding may put them in the wrong order.
        let upper = upper.at_least(lower).at_most(budget.pressure_max_pa);
        self.outlet_pa = [lower, upper];
        if let Some(fill) = &budget.fill {
            let outlet = Outlet {
                lowest_pa: lowest.at_most(lower),
                highest_pa: highest.at_least(upper),
                line_pa: budget.line_pressure_pa[1],
            };
            self.piston.advance(fill, &outlet, dt_s);
        }
    }
}

impl<T: Real> Budget<T> {
    /// Minimum and maximum pressure that the commands in effect end at, Pa.
    #[inline]
    fn ends(&self, [lowest, highest]: [T; 2]) -> [T; 2] {
        let settled = |command: T, gain: T| gain * self.valve.settled_pressure(command);
        let (weakest, strongest) = ((lowest - self.command).at_least(T::zero()), highest + self.command);
        let (weakest, strongest) = if self.valve.falls() { (strongest, weakest) } else { (weakest, strongest) };
        [settled(weakest, self.gain_factor[0]), settled(strongest, self.gain_factor[1])]
    }

    /// Lowest and highest settled pressure behind the hysteresis, Pa, from those before and the pressures that the commands
    /// in effect end at.
    ///
    /// The hysteresis is a play operator of half-width 0 to `r`: the settled pressure stays where it is until the
    /// command has moved by more than the half-width from it. It does not fall with command and start, and the largest
    /// value over all half-widths is `max(u, min(w, u + r))`: after a rise `u`, after a fall at most `u + r`.
    #[inline]
    fn asked(&self, [low, high]: [T; 2], [bottom, top]: [T; 2]) -> [T; 2] {
        [
            bottom.at_most(low.at_least(bottom - self.hysteresis_pa)),
            top.at_least(high.at_most(top + self.hysteresis_pa)),
        ]
    }

    /// What the supply gives of settled pressures, Pa.
    #[inline]
    fn supplied(&self, [low, high]: [T; 2]) -> [T; 2] {
        let [minimum, maximum] = self.line_pressure_pa;
        [low.at_least(T::zero()).at_most(minimum), high.at_most(maximum)]
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use drivetrain::{ClutchValve, PulseWidth, Table1, ValveMaps};
    use std::vec;
    use std::vec::Vec;

    fn budget() -> Budget<f64> {
        Budget {
            valve: ClutchValve::Proportional(ValveMaps {
                time_constant_s: Table1::new(&[0.0, 1e5, 4e5, 1e6], &[0.2, 0.08, 0.035, 0.02]).unwrap(),
                gain_pa_a: Table1::new(&[0.0, 0.5, 1.0], &[0.7e6, 1.0e6, 1.1e6]).unwrap(),
                delay_s: Table1::constant(0.01),
            }),
            lag_factor: [0.5, 1.5],
            gain_factor: [0.9, 1.1],
            delay_s: [0.0, 0.03],
            hysteresis_pa: 0.0,
            command: 0.005,
            command_age_s: 0.0,
            line_pressure_pa: [1.2e6; 2],
            pressure_max_pa: 1.2e6,
            fill: None,
            friction_factor: [0.8, 1.2],
            drag_n_m: 0.0,
            slip_rad_s: 0.6,
        }
    }

    /// The same of a valve that is commanded by a duty cycle.
    fn pulse_width_budget() -> Budget<f64> {
        let law = PulseWidth { flow_sqrt_pa_s: 12e3, line_pressure_pa: 1e6 };
        let valve = ClutchValve::PulseWidth { law, delay_s: Table1::constant(0.01) };
        Budget { valve, command: 0.5, ..budget() }
    }

    fn read(value: f64) -> Option<Reading<f64>> {
        Some(Reading::now(value))
    }

    /// An empty cylinder whose valve has had no command for long.
    fn empty(b: &Budget<f64>) -> PressureRange<f64> {
        let mut range = PressureRange::unknown(b, 0.0);
        range.at_reading.outlet_pa[1] = 0.0;
        range
    }

    /// A valve within the budget, by small Euler steps, under commands held for 10 ms.
    fn simulated(b: &Budget<f64>, lag: f64, gain: f64, delay_ms: usize, commands: &[f64]) -> Vec<f64> {
        let mut p = 0.0;
        let mut at_samples = vec![0.0];
        for k in 0..commands.len() * 10 {
            let command = if k < delay_ms { 0.0 } else { commands[(k - delay_ms) / 10] };
            let settled = gain * b.valve.settled_pressure(command);
            for _ in 0..100 {
                p += 1e-5 * b.valve.pressure_rate(p, settled) / lag;
            }
            if (k + 1) % 10 == 0 {
                at_samples.push(p);
            }
        }
        at_samples
    }

    #[test]
    fn every_valve_within_the_budget_stays_in_the_range() {
        for (b, unit) in [(budget(), 1.0), (pulse_width_budget(), 100.0)] {
            let steps = [0.0, 0.3, 0.12, 0.15, 0.2, 0.5, 0.9, 0.4, 0.05];
            let commands: Vec<f64> = (0..60).map(|i| unit * steps[i / 7]).collect();
            assert_every_valve_stays_in_the_range(&b, &commands);
        }
    }

    fn assert_every_valve_stays_in_the_range(b: &Budget<f64>, commands: &[f64]) {
        let mut range = empty(b);
        let ranges: Vec<[f64; 2]> = (0..=60)
            .map(|k| {
                let command = commands.get(k).copied().unwrap_or_default();
                range.step(b, if k == 0 { 0.0 } else { 0.01 }, read(command), 1.2);
                range.pressure_pa(b)
            })
            .collect();
        let mut closest = f64::INFINITY;
        for (lag, gain, delay) in
            [(0.5, 1.1, 0), (0.5, 0.9, 0), (1.5, 1.1, 30), (1.5, 0.9, 30), (1.0, 1.0, 10), (0.5, 1.1, 30)]
        {
            let pressures = simulated(b, lag, gain, delay, commands);
            assert_eq!((pressures.len(), ranges.len()), (61, 61));
            for (p, [low, high]) in pressures.iter().zip(&ranges) {
                assert!(low - 1e-6 <= *p && *p <= high + 1e-6, "{p} not in {low} to {high} ({lag}, {gain}, {delay})");
                closest = closest.min(high - p).min(p - low);
            }
        }
        assert!(ranges.iter().all(|[low, high]| *low >= 0.0 && *high <= 1.2e6));
        assert!(closest < 20e3, "the range is far wider than any of these valves: {closest}");
    }

    #[test]
    fn a_held_command_leaves_only_the_gain_and_the_reading() {
        let b = budget();
        let mut range = PressureRange::unknown(&b, 1.2);
        for _ in 0..200 {
            range.step(&b, 0.01, read(0.3), 1.2);
        }
        let settled = |command: f64, gain: f64| gain * b.valve.settled_pressure(command);
        let [low, high] = range.pressure_pa(&b);
        assert!((low - settled(0.295, 0.9)).abs() < 1.0 && (high - settled(0.305, 1.1)).abs() < 1.0, "{low} {high}");
    }

    #[test]
    fn a_normally_high_valve_has_the_range_of_the_mirrored_commands() {
        let low = budget();
        let Some(&maps) = low.valve.maps() else { panic!("it has maps") };
        let high = Budget { valve: ClutchValve::NormallyHigh { maps, zero_pressure_a: 1.2 }, ..budget() };
        let mut ranges = [PressureRange::unknown(&low, 1.2), PressureRange::unknown(&high, 1.2)];
        for k in 0..80 {
            let current = [0.0, 0.3, 0.12, 0.5, 0.9, 0.4, 0.05, 0.2][k / 10];
            ranges[0].step(&low, 0.01, read(current), 1.2);
            ranges[1].step(&high, 0.01, read(1.2 - current), 1.2);
            let [a, b] = [ranges[0].pressure_pa(&low), ranges[1].pressure_pa(&high)];
            assert!((a[0] - b[0]).abs() < 1e-3 && (a[1] - b[1]).abs() < 1e-3, "{k}: {a:?} {b:?}");
        }
    }

    #[test]
    fn a_valve_outside_the_budget_leaves_the_range() {
        let commands = [0.4; 40];
        let b = budget();
        let mut range = empty(&b);
        let mut left = false;
        for (k, p) in simulated(&b, 1.0, 1.3, 10, &commands).into_iter().enumerate() {
            range.step(&b, if k == 0 { 0.0 } else { 0.01 }, read(0.4), 1.2);
            let [_, high] = range.pressure_pa(&b);
            left |= p > high;
        }
        assert!(left);
    }

    #[test]
    fn more_commands_than_can_be_remembered_widen_the_range() {
        let b = Budget { delay_s: [0.0, 0.2], ..budget() };
        let mut range = empty(&b);
        for k in 0..500 {
            let command = if k == 300 { 1.0 } else { 0.1 };
            range.step(&b, 0.001, read(command), 1.2);
            // Up to 0.2 s later the large command may still act.
            if (302..=500).contains(&k) {
                assert!(range.pressure_pa(&b)[1] > 0.1e6);
            }
        }
    }

    #[test]
    fn an_unknown_start_and_a_gap_leave_everything_possible_until_the_command_tells() {
        let b = budget();
        let mut range = PressureRange::unknown(&b, 1.2);
        assert_eq!(range.pressure_pa(&b), [0.0, b.pressure_max_pa]);
        let mut hold = |dt_s: f64, samples: u32| {
            for _ in 0..samples {
                range.step(&b, dt_s, read(0.3), 1.2);
            }
            range.pressure_pa(&b)
        };
        let [low, high] = hold(0.01, 300);
        assert!(low > 0.2e6 && high < 0.4e6, "{low} {high}");
        // One lost sample is no gap; in a longer one the clutch may have been emptied or filled.
        let [low, high] = hold(0.02, 1);
        assert!(low > 0.2e6 && high < 0.4e6, "{low} {high}");
        let [low, high] = hold(0.5, 1);
        assert!(low < 0.05e6 && high > 1.1e6, "{low} {high}");
    }

    /// Ranges under a rising command that is read every 10 ms and `late_ms` after it was true, in steps of 1 ms.
    fn late_ranges(b: &Budget<f64>, late_ms: usize) -> Vec<[f64; 2]> {
        let mut range = PressureRange::unknown(b, 1.2);
        let ranges = (0..3000_usize).map(|now_ms| {
            let true_ms = now_ms.checked_sub(late_ms).filter(|true_ms| true_ms % 10 == 0);
            let reading =
                true_ms.map(|true_ms| Reading { value: 0.2 + 1e-4 * true_ms as f64, age_s: 1e-3 * late_ms as f64 });
            range.step(b, 1e-3, reading, 1.2);
            range.pressure_pa(b)
        });
        ranges.collect()
    }

    #[test]
    fn a_late_command_is_taken_at_its_time() {
        let b = budget();
        let (now, late) = (late_ranges(&b, 0), late_ranges(&b, 5));
        // Up to 8 ms after a reading no other command can have been sent.
        for at_ms in (2000..3000).filter(|ms| ms % 10 <= 7 && ms % 10 >= 5) {
            let ends = now[at_ms].into_iter().zip(late[at_ms]);
            assert!(ends.clone().all(|(now, late)| (now - late).abs() < 1.0), "{at_ms} ms: {ends:?}");
        }
        let widest = late[2000..].iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        assert!(widest < 0.8e6, "{widest}");
        // Older than its period, it leaves more open; the range is taken back at the next reading all the same.
        let older = late_ranges(&b, 20);
        let width = |ranges: &[[f64; 2]]| ranges[2000..].iter().map(|[low, high]| high - low).sum::<f64>() / 1000.0;
        let widths = [&now, &late, &older].map(|ranges| width(ranges));
        assert!(widths.is_sorted() && widths[2] < 1.0e6, "{widths:?}");
    }

    #[test]
    fn a_missing_reading_leaves_any_command_possible_until_the_next() {
        let b = budget();
        let mut range = PressureRange::unknown(&b, 1.2);
        let mut hold = |samples: usize, command: Option<Reading<f64>>| {
            (0..samples).for_each(|_| range.step(&b, 0.01, command, 1.2));
            range.pressure_pa(&b)
        };
        let [_, settled] = hold(300, read(0.3));
        let [_, unread] = hold(1, None);
        assert!(unread > settled + 0.05e6, "{unread} {settled}");
        // What came and went in the meantime fades.
        assert!(hold(1, read(0.3))[1] > settled + 0.05e6);
        assert!((hold(300, read(0.3))[1] - settled).abs() < 1.0);
    }

    #[test]
    fn a_reading_out_of_order_is_left_out() {
        let b = budget();
        let mut range = PressureRange::unknown(&b, 1.2);
        (0..300).for_each(|_| range.step(&b, 0.01, read(0.3), 1.2));
        let mut other = range;
        range.step(&b, 0.001, Some(Reading { value: 1.0, age_s: 0.005 }), 1.2);
        other.step(&b, 0.001, None, 1.2);
        assert_eq!(range, other);
    }

    #[test]
    fn leaving_out_what_stands_still_changes_nothing() {
        for b in [budget(), pulse_width_budget(), Budget { command_age_s: 0.01, hysteresis_pa: 1e4, ..budget() }] {
            let mut range = PressureRange::unknown(&b, 1.0);
            let mut whole = range;
            let mut still = 0;
            for k in 0..4000_u32 {
                let held = if k < 2000 { 0.3 } else { 0.6 };
                // After a long time with one command some are others, and some readings are late or missing.
                let moves = k % 1000 > 900;
                let command = if moves { held + 1e-3 * f64::from(k % 7) } else { held };
                let reading = Reading { value: command, age_s: if moves && k % 13 == 0 { 0.004 } else { 0.0 } };
                let reading = (!moves || k % 31 != 0).then_some(reading);
                still += u32::from(range.still.is_some());
                whole.still = None;
                range.step(&b, 0.01, reading, 1.0);
                whole.step(&b, 0.01, reading, 1.0);
                assert_eq!(range.pressure_pa(&b), whole.pressure_pa(&b), "step {k}");
            }
            assert!(still > 100, "{still}");
        }
    }

    /// The mean width of the range, of which each of some valves is in, under commands that are sent with these rows.
    fn width_with_rows_at(row_ms: &[usize]) -> f64 {
        let b = budget();
        let command = |k: usize| [0.0, 0.3, 0.12, 0.15, 0.2, 0.5, 0.9, 0.4][k / 7 % 8];
        let mut sum = 0.0;
        for (lag, gain, delay_ms) in [(0.5, 0.9, 0), (0.5, 1.1, 0), (1.5, 0.9, 30), (1.5, 1.1, 30), (1.0, 1.0, 10)] {
            let (mut range, mut p, mut ms) = (PressureRange::unknown(&b, 1.2), 0.0, row_ms[0]);
            for k in 1..row_ms.len() {
                // A row's command holds from its time on, and acts after the delay.
                while ms < row_ms[k] {
                    let sent = row_ms[..k].iter().rposition(|row_ms| row_ms + delay_ms <= ms);
                    let settled = gain * b.valve.settled_pressure(sent.map_or(0.0, command));
                    (0..100).for_each(|_| p += 1e-5 * b.valve.pressure_rate(p, settled) / lag);
                    ms += 1;
                }
                range.step(&b, 1e-3 * (row_ms[k] - row_ms[k - 1]) as f64, read(command(k)), 1.2);
                let [low, high] = range.pressure_pa(&b);
                // Euler's error is a few hundred Pa.
                assert!(low - 300.0 <= p && p <= high + 300.0, "row {k}: {low} {p} {high}");
                sum += high - low;
            }
        }
        sum / 5.0 / row_ms.len() as f64
    }

    #[test]
    fn a_clock_that_wavers_does_not_make_the_range_wide() {
        let even: Vec<usize> = (1..600).map(|k| 10 * k).collect();
        // Each row is up to 4 ms early or late.
        let wavers: Vec<usize> = (0..600).map(|k| 10 * k + [10, 14, 6, 12, 9, 6, 13, 14, 7, 11, 8][k % 11]).collect();
        let [even, wavers] = [even, wavers].map(|row_ms| width_with_rows_at(&row_ms));
        assert!(wavers < 1.2 * even, "{wavers} {even}");
    }
}
