//! A whole drive in a few hundred numbers, however long it is.

use observer::Health;

use crate::shift_estimates::LogSample;

/// Intervals of time in an overview, at most.
const MAXIMUM: usize = 600;
/// The first interval, s. It doubles when the drive has filled the most of them.
const FIRST_S: f64 = 0.01;

/// Lowest and highest value of a signal in an interval; NaN if it had none.
pub type Extremes = [f64; 2];

/// Signals of an interval of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Engine, turbine and output speed, rad/s.
    pub speeds_rad_s: [Extremes; 3],
    /// Estimated pressure, Pa.
    pub pressure_pa: Extremes,
    /// Ends of its range, Pa.
    pub range_pa: Extremes,
    /// Which healths its samples have, in the order of [`Health::ALL`]; none without a sample.
    pub healths: [bool; Health::ALL.len()],
}

const EMPTY: Interval = Interval {
    speeds_rad_s: [[f64::NAN; 2]; 3],
    pressure_pa: [f64::NAN; 2],
    range_pa: [f64::NAN; 2],
    healths: [false; Health::ALL.len()],
};

/// The lowest and highest of both.
fn joined(a: Extremes, b: Extremes) -> Extremes {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Joins the second to the first, in place: most values lie within those before.
fn widen(extremes: &mut Extremes, [low, high]: Extremes) {
    if !(extremes[0] <= low && high <= extremes[1]) {
        *extremes = joined(*extremes, [low, high]);
    }
}

impl Interval {
    fn joined(&self, other: &Self) -> Self {
        Self {
            speeds_rad_s: std::array::from_fn(|i| joined(self.speeds_rad_s[i], other.speeds_rad_s[i])),
            pressure_pa: joined(self.pressure_pa, other.pressure_pa),
            range_pa: joined(self.range_pa, other.range_pa),
            healths: std::array::from_fn(|i| self.healths[i] || other.healths[i]),
        }
    }

    /// Joins a sample to it.
    fn take(&mut self, sample: &LogSample) {
        let LogSample { speeds_rad_s, estimate, .. } = sample;
        for (extremes, speed) in self.speeds_rad_s.iter_mut().zip(speeds_rad_s) {
            widen(extremes, [*speed; 2]);
        }
        widen(&mut self.pressure_pa, [estimate.pressure_pa; 2]);
        if let Some(bounds) = estimate.bounds {
            widen(&mut self.range_pa, bounds.pressure_pa);
        }
        self.healths[estimate.health as usize] |= sample.is_estimated();
    }
}

/// A drive in intervals of equal length. Times may jump; they do not fall.
#[derive(Debug, Clone, PartialEq)]
pub struct Overview {
    first_s: f64,
    interval_s: f64,
    intervals: Vec<Interval>,
}

impl Default for Overview {
    fn default() -> Self {
        Self { first_s: f64::NAN, interval_s: FIRST_S, intervals: Vec::new() }
    }
}

impl Overview {
    /// Takes the next sample.
    pub fn push(&mut self, sample: &LogSample) {
        if self.intervals.is_empty() {
            self.first_s = sample.time_s;
        }
        let place = |interval_s: f64| (sample.time_s - self.first_s) / interval_s;
        while place(self.interval_s) >= MAXIMUM as f64 {
            self.interval_s *= 2.0;
            self.intervals =
                self.intervals.chunks(2).map(|pair| pair[0].joined(pair.get(1).unwrap_or(&EMPTY))).collect();
        }
        let at = place(self.interval_s) as usize;
        if self.intervals.len() <= at {
            self.intervals.resize(at + 1, EMPTY);
        }
        self.intervals[at].take(sample);
    }

    /// The same drive on a clock that began at this time of the log's, s.
    pub fn earlier_by(mut self, origin_s: f64) -> Self {
        self.first_s -= origin_s;
        self
    }

    /// The intervals with the times of their beginnings and ends, s.
    pub fn intervals(&self) -> impl Iterator<Item = ([f64; 2], &Interval)> {
        let time_s = |at: usize| self.first_s + at as f64 * self.interval_s;
        self.intervals.iter().enumerate().map(move |(at, interval)| ([time_s(at), time_s(at + 1)], interval))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use observer::{ChannelHealth, Channels, Estimate, Input, Phase};

    fn sample(time_s: f64, engine_rad_s: f64, health: Health) -> LogSample {
        LogSample {
            time_s,
            speeds_rad_s: [engine_rad_s, f64::NAN, f64::NAN],
            command: f64::NAN,
            input: Input::none(0.01),
            estimate: Estimate {
                pressure_pa: 1.0,
                clutch_torque_n_m: 0.0,
                shaft_torque_n_m: None,
                phase: Phase::BeforeShift,
                health,
                channels: Channels::all(ChannelHealth::Good),
                bounds: None,
            },
            pressure_pa: None,
            torque_n_m: None,
        }
    }

    #[test]
    fn a_long_drive_keeps_its_extremes_and_every_health() {
        let mut overview = Overview::default();
        for i in 0..100_000 {
            let odd = i == 77_777;
            let health = if odd { Health::SpeedsRejected } else { Health::Good };
            overview.push(&sample(1e9 + f64::from(i) * 0.01, if odd { 900.0 } else { 100.0 }, health));
        }
        let intervals: Vec<_> = overview.intervals().collect();
        assert!((MAXIMUM / 2..=MAXIMUM).contains(&intervals.len()));
        let odd: Vec<_> = intervals.iter().filter(|(_, i)| i.healths[Health::SpeedsRejected as usize]).collect();
        assert_eq!(odd.len(), 1);
        let ([from_s, to_s], interval) = odd[0];
        assert!((*from_s..*to_s).contains(&(1e9 + 777.77)) && interval.speeds_rad_s[0] == [100.0, 900.0]);
        assert!(interval.speeds_rad_s[1][0].is_nan());
    }

    #[test]
    fn a_jump_over_years_is_a_hole() {
        let mut overview = Overview::default();
        for time_s in [0.0, 0.01, 1e9] {
            overview.push(&sample(time_s, 1.0, Health::Good));
        }
        assert_eq!(overview.intervals().filter(|(_, interval)| interval.healths.contains(&true)).count(), 2);
    }
}
