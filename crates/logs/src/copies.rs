//! Channels that show the reading of the speed next to them.
//!
//! A gateway that maps a signal wrongly for a while, or a logger that fills a gap, writes the value of one speed into the channel of another. Two
//! sensors of two shafts agree to the last digit where the shafts turn together, as behind a lock-up clutch, and then their speeds came together by
//! and by. A channel shows another one that agrees with it to the last digit for [`SAMPLES`] samples, after a difference that closed within one
//! sample by [`SUDDEN`] times what it changes by from sample to sample: the one that jumped is wrong, until they differ again or for
//! [`LONGEST_S`]. A difference that was closed before says nothing: what begins while both shafts turn together, as in the direct gear, and
//! goes on after it, is not seen here.

use crate::Role;
use crate::speed_faults::LONGEST_S;

/// So many equal samples show it.
const SAMPLES: u32 = 3;
/// How many times its usual change a difference closes by at once, with a size that is no rounding, rad/s \[chosen\].
const SUDDEN: (f64, f64) = (8.0, 1.0);
/// Samples in which the usual change is learnt, and weight of one in its mean.
const LEARNT: u32 = 20;
const LATEST: f64 = 0.125;
/// In slower samples a shift passes between two of them, s: an inertia phase takes longer.
const SLOWEST_S: f64 = 0.05;
/// Below this a shaft stands, rad/s.
const STANDS_RAD_S: f64 = 1.0;
/// Relative difference of one number in two units.
const ROUNDING: f64 = 1e-12;

/// Engine and turbine, turbine and output, output and wheel.
const PAIRS: [[usize; 2]; 3] = [
    [Role::EngineSpeed as usize, Role::TurbineSpeed as usize],
    [Role::TurbineSpeed as usize, Role::OutputSpeed as usize],
    [Role::OutputSpeed as usize, Role::WheelSpeed as usize],
];

/// A reading: its value, rad/s, and its time, s.
pub(crate) type Stamped = [f64; 2];

/// Watches the speeds of the four shafts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Copies([Pair; PAIRS.len()]);

/// Two speeds next to each other.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Readings since both were compared.
    newest: [Option<Stamped>; 2],
    /// The readings at which they differed last.
    before: Option<[Stamped; 2]>,
    /// Change of the difference from sample to sample: its mean, and the last one, rad/s; and how many there were.
    change: [f64; 2],
    changes: u32,
    /// Samples in which they are equal, and which of both jumped to the other, if one did.
    equal: u32,
    jumped: Option<usize>,
}

impl Copies {
    pub(crate) fn new() -> Self {
        Self(
            [Pair { newest: [None; 2], before: None, change: [0.0; 2], changes: 0, equal: 0, jumped: None };
                PAIRS.len()],
        )
    }

    /// Takes a reading that is believed. Returns the speed whose channel shows another one, with its last reading that is right.
    pub(crate) fn push(&mut self, role: Role, reading: Stamped) -> Option<(Role, Stamped)> {
        let at = role as usize;
        let mut found = None;
        for (pair, of) in self.0.iter_mut().zip(PAIRS) {
            let Some(which) = of.iter().position(|speed| *speed == at) else { continue };
            pair.newest[which] = Some(reading);
            if let [Some(one), Some(other)] = pair.newest {
                pair.newest = [None; 2];
                let copy = pair.compare([one, other]);
                found = found.or(copy.map(|(which, before)| (Role::SPEEDS[of[which]], before)));
            }
        }
        found
    }
}

impl Pair {
    /// Which of both is the other's value, with its last reading that is right.
    fn compare(&mut self, newest: [Stamped; 2]) -> Option<(usize, Stamped)> {
        let [[one, _], [other, _]] = newest;
        if (one - other).abs() > ROUNDING * other.abs() || one.abs() < STANDS_RAD_S {
            self.differ(newest);
            return None;
        }
        let before = self.before?;
        if self.equal == 0 {
            self.jumped = self.jump(before, newest);
        }
        self.equal = self.equal.saturating_add(1);
        let which = self.jumped.filter(|_| self.equal >= SAMPLES)?;
        let is_short = newest[which][1] - before[which][1] <= LONGEST_S;
        is_short.then_some((which, before[which]))
    }

    fn differ(&mut self, newest: [Stamped; 2]) {
        let difference = |[[one, _], [other, _]]: [Stamped; 2]| one - other;
        if let Some(before) = self.before.filter(|_| self.equal == 0) {
            let change = (difference(newest) - difference(before)).abs();
            let [mean, _] = self.change;
            self.change = [mean + LATEST * (change - mean), change];
            self.changes = self.changes.saturating_add(1);
        }
        (self.before, self.equal, self.jumped) = (Some(newest), 0, None);
    }

    /// Which of both jumped to the other, where the difference closed at once.
    fn jump(&self, before: [Stamped; 2], newest: [Stamped; 2]) -> Option<usize> {
        let (times, min_rad_s) = SUDDEN;
        let [mean, last] = self.change;
        let closed = (before[0][0] - before[1][0]).abs();
        let moved = [0, 1].map(|which| (newest[which][0] - before[which][0]).abs());
        let passed_s = newest[0][1].max(newest[1][1]) - before[0][1].min(before[1][1]);
        let is_sudden = closed > times * mean.max(last) + min_rad_s && (0.0..=SLOWEST_S).contains(&passed_s);
        let which = usize::from(moved[1] > moved[0]);
        let is_one = 2.0 * moved[which] > closed && 2.0 * moved[1 - which] < closed;
        (is_sudden && is_one && self.changes >= LEARNT).then_some(which)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows in which a speed is withdrawn, of engine and turbine every 10 ms.
    fn found(speeds: impl Fn(u32) -> [f64; 2]) -> Vec<(u32, Role, f64)> {
        let mut copies = Copies::new();
        let mut all = Vec::new();
        for row in 0..600 {
            let (time_s, [engine, turbine]) = (0.01 * f64::from(row), speeds(row));
            assert_eq!(copies.push(Role::EngineSpeed, [engine, time_s]), None);
            let copy = copies.push(Role::TurbineSpeed, [turbine, time_s]);
            all.extend(copy.map(|(role, [right, _])| (row, role, right)));
        }
        all
    }

    /// With noise of two sensors, 12 rad/s apart.
    fn apart(row: u32) -> [f64; 2] {
        let noise = |factor: f64| 0.1 * (factor * f64::from(row)).sin();
        [200.0 + 0.1 * f64::from(row) + noise(7.3), 188.0 + 0.1 * f64::from(row) + noise(5.1)]
    }

    #[test]
    fn a_channel_that_shows_the_speed_next_to_it_is_found_by_its_digits() {
        for (which, role) in [(0, Role::EngineSpeed), (1, Role::TurbineSpeed)] {
            let rows = found(|row| {
                let mut speeds = apart(row);
                if (200..300).contains(&row) {
                    speeds[which] = speeds[1 - which];
                }
                speeds
            });
            assert_eq!(rows.iter().map(|(row, ..)| *row).collect::<Vec<_>>(), (202..300).collect::<Vec<_>>());
            assert!(rows.iter().all(|(_, found, right)| *found == role && *right == apart(199)[which]), "{rows:?}");
        }
    }

    #[test]
    fn shafts_that_come_together_are_no_copies() {
        // A lock-up clutch closes in 0.2 s and opens at once; both are then one shaft.
        let locks = |row: u32| {
            let [engine, _] = apart(row);
            let slip = if row < 400 { (12.0 - 0.6 * f64::from(row.max(200) - 200)).max(0.0) } else { 12.0 };
            [engine, engine - slip]
        };
        assert_eq!(found(locks), []);
        // Whole revolutions a minute, 1 rpm a row; and the speeds of a car that stands.
        assert_eq!(found(|row| [900.0, f64::from(600 + row.min(300))]), []);
        assert_eq!(found(|row| if row < 200 { apart(row) } else { [0.0, 0.0] }), []);
        // One jump of both, as where a recording goes on elsewhere.
        assert_eq!(found(|row| if row < 200 { apart(row) } else { [120.0, 120.0 + f64::from(row % 2)] }), []);
    }

    #[test]
    fn a_copy_is_believed_in_the_end() {
        let rows = found(|row| if row < 200 { apart(row) } else { [apart(row)[0]; 2] });
        let last = rows.last().map(|(row, ..)| 0.01 * f64::from(*row - 200)).unwrap_or_default();
        assert!((LONGEST_S - 0.03..=LONGEST_S).contains(&last), "{last}");
    }
}
