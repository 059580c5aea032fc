//! The jerk of a car from measured speeds: single wrong ones are left out, and none is given across a hole.

use crate::jerk::PeakJerk;

/// Readings further apart are not joined by a line, s.
const APART_S: f64 = 0.3;

/// The jerk of a car whose speeds, m/s, are these at their times, s, by the definition of [`crate::jerk`], m/s^3: single wrong
/// speeds are left out; none where a hole would leave the parabola free, or where there are too few.
pub fn peak_jerk_m_s3(speeds: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let (mut jerk, mut strays, mut holes) = (PeakJerk::default(), Strays::default(), Holes::default());
    for (time_s, speed_m_s) in speeds {
        if holes.is_behind_one(time_s) {
            return None;
        }
        if let Some((time_s, speed_m_s)) = strays.next(time_s, speed_m_s) {
            jerk.speed(time_s, speed_m_s);
        }
    }
    strays.last().into_iter().for_each(|(time_s, speed_m_s)| jerk.speed(time_s, speed_m_s));
    jerk.peak_m_s3()
}

/// Tells where readings are too far apart.
#[derive(Debug, Clone, Copy, Default)]
pub struct Holes {
    before_s: Option<f64>,
}

impl Holes {
    /// Whether the reading at this time, s, is too far behind the one before.
    pub fn is_behind_one(&mut self, time_s: f64) -> bool {
        self.before_s.replace(time_s).is_some_and(|before_s| time_s - before_s > APART_S)
    }
}

/// Leaves single wrong speeds out: those from which the car would have to come back faster than it can.
#[derive(Default)]
struct Strays {
    /// The newest speed that counts, and the one after it, which waits for the next: time, s, and m/s.
    kept: Option<(f64, f64)>,
    waiting: Option<(f64, f64)>,
}

impl Strays {
    /// Takes a speed, and returns the one before it, if that counts.
    fn next(&mut self, time_s: f64, speed_m_s: f64) -> Option<(f64, f64)> {
        /// An acceleration that no car has, m/s^2 \[chosen\]: five times what tyres transmit.
        const IMPOSSIBLE_M_S2: f64 = 50.0;
        let (at_s, value) = self.waiting.replace((time_s, speed_m_s))?;
        let is_stray = self.kept.is_some_and(|(before_s, before)| {
            let [from, to] = [(value - before) / (at_s - before_s), (value - speed_m_s) / (time_s - at_s)];
            from.signum() == to.signum() && from.abs().min(to.abs()) > IMPOSSIBLE_M_S2
        });
        if is_stray {
            return None;
        }
        self.kept = Some((at_s, value));
        self.kept
    }

    /// The last speed, of which nothing says that it is wrong.
    fn last(self) -> Option<(f64, f64)> {
        self.waiting
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    #[test]
    fn a_single_wrong_speed_is_left_out_and_no_other() {
        let speed = |at: u32| 10.0 + 0.02 * f64::from(at);
        for (wrong, by_m_s) in [(3, 20.0), (7, -300.0), (5, 0.6), (1, 5.0)] {
            let (mut strays, mut kept) = (Strays::default(), Vec::new());
            for at in 0..10 {
                let value = speed(at) + if at == wrong { by_m_s } else { 0.0 };
                kept.extend(strays.next(0.01 * f64::from(at), value));
            }
            kept.extend(strays.last());
            let expected: Vec<_> =
                (0..10).filter(|at| *at != wrong).map(|at| (0.01 * f64::from(at), speed(at))).collect();
            assert_eq!(kept, expected, "{by_m_s}");
        }
        // A jump that lasts, and steps of a coarse speed on a bus, 0.1 km/h.
        let jump = (0..10).map(|at| (0.01 * f64::from(at), if at < 5 { 10.0 } else { 12.0 }));
        let coarse = (0..10).map(|at| (0.01 * f64::from(at), 10.0 + f64::from(at % 2) / 36.0));
        for speeds in [jump.collect::<Vec<_>>(), coarse.collect()] {
            let mut strays = Strays::default();
            let mut kept: Vec<_> = speeds.iter().filter_map(|(time_s, speed)| strays.next(*time_s, *speed)).collect();
            kept.extend(strays.last());
            assert_eq!(kept, speeds);
        }
    }
}
