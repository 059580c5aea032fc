//! The teeth of a wheel that have passed its sensor.
//!
//! Thousands of teeth pass, but a reading needs the times of two of them. Tooth `n` passes when the wheel has turned by `n`
//! pitches since the begin of the record; its time is computed when a reading asks for it.

use car::SpeedSensor;

use super::{Channel, SAME_TIME_S, STANDSTILL_S};

/// The teeth that pass in a record of a speed, in their order. Before the record begins, the wheel turns as at its
/// beginning, or stands.
#[derive(Debug)]
pub(super) struct Teeth<'a> {
    truth: Channel<'a>,
    timer_s: f64,
    ticks_per_s: f64,
    /// Angle between two teeth, rad.
    pitch: f64,
    /// Speed before the record, rad/s; zero for a wheel that stands.
    before_rad_s: f64,
    /// How far the wheel has turned at each time of the record, rad.
    turned_rad: Vec<f64>,
    /// The last time of the record that the questions have reached.
    reached: usize,
}

/// A tooth that has passed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tooth {
    /// Its number, counted from the one that passes as the record begins: a whole number, negative before the record.
    pub(super) number: f64,
    /// When it passed, in steps of the timer, s.
    pub(super) time_s: f64,
}

impl<'a> Teeth<'a> {
    pub(super) fn new(sensor: &SpeedSensor, truth: Channel<'a>) -> Self {
        let pitch = std::f64::consts::TAU / sensor.teeth;
        let first = truth.values.first().map_or(0.0, |speed| speed.abs());
        let mut turned = 0.0;
        let mut from = first;
        let intervals = truth.time_s.windows(2).zip(truth.values.iter().skip(1)).map(|(ends, speed)| {
            let to = speed.abs();
            turned += 0.5 * (from + to) * (ends[1] - ends[0]);
            from = to;
            turned
        });
        Self {
            truth,
            timer_s: sensor.timer_s,
            ticks_per_s: if sensor.timer_s > 0.0 { 1.0 / sensor.timer_s } else { 0.0 },
            pitch,
            before_rad_s: if first * STANDSTILL_S > pitch { first } else { 0.0 },
            turned_rad: std::iter::once(0.0).chain(intervals).collect(),
            reached: 0,
        }
    }

    /// The last tooth that has passed by a time, s, not before the time of the last question; `None` if none has.
    pub(super) fn last(&mut self, now_s: f64) -> Option<Tooth> {
        // The timer moves a tooth by half a tick: of those that pass a little later some may be in time.
        let number = (self.angle(now_s + self.timer_s + SAME_TIME_S) / self.pitch).floor();
        let mut last = Tooth { number, time_s: self.time_s(number)? };
        while last.time_s > now_s {
            let number = last.number - 1.0;
            last = Tooth { number, time_s: self.time_s(number)? };
        }
        Some(last)
    }

    /// When the tooth of this number passes, in steps of the timer, s; it must have been reached. `None` of a wheel that
    /// stood before.
    pub(super) fn time_s(&self, number: f64) -> Option<f64> {
        let begin_s = self.truth.time_s.first()?;
        let angle = number * self.pitch;
        if number > 0.0 {
            Some(self.tick(self.pass_s(angle)))
        } else if self.before_rad_s > 0.0 {
            Some(self.tick(begin_s + angle / self.before_rad_s))
        } else {
            None
        }
    }

    /// How far the wheel has turned by a time, rad.
    fn angle(&mut self, time_s: f64) -> f64 {
        let times = self.truth.time_s;
        while times.get(self.reached + 1).is_some_and(|&next_s| next_s <= time_s) {
            self.reached += 1;
        }
        let since_s = time_s - times.get(self.reached).copied().unwrap_or_default();
        if since_s < 0.0 {
            return self.before_rad_s * since_s;
        }
        let [start_rad, from] = [self.turned_rad[self.reached], self.speed(self.reached)];
        match times.get(self.reached + 1) {
            Some(_) => start_rad + (from + 0.5 * self.bend(self.reached) * since_s) * since_s,
            None => start_rad,
        }
    }

    /// When the wheel has turned this far, s: an angle above zero that has been reached.
    fn pass_s(&self, angle: f64) -> f64 {
        let start = self.interval(angle);
        let (start_s, from, turned) = (self.truth.time_s[start], self.speed(start), angle - self.turned_rad[start]);
        // Within the interval the speed changes linearly: the angle is a quadratic function of time.
        let root = (from * from + 2.0 * self.bend(start) * turned).max(0.0).sqrt();
        start_s + 2.0 * turned / (from + root)
    }

    /// The interval in which the wheel reaches an angle, by the time that it begins with. It is most often just before the
    /// questions: from there the steps back grow.
    fn interval(&self, angle: f64) -> usize {
        let end = self.reached.min(self.turned_rad.len().saturating_sub(2));
        let (mut low, mut step) = (end, 1);
        while low > 0 && self.turned_rad[low] >= angle {
            low = low.saturating_sub(step);
            step *= 2;
        }
        let within = &self.turned_rad[low..=end];
        low + within.partition_point(|&turned| turned < angle).saturating_sub(1)
    }

    fn speed(&self, at: usize) -> f64 {
        self.truth.values.get(at).map_or(0.0, |speed| speed.abs())
    }

    /// How fast the speed changes from this time of the record to the next one, rad/s^2.
    fn bend(&self, start: usize) -> f64 {
        let (times, end) = (self.truth.time_s, start + 1);
        times.get(end).map_or(0.0, |end_s| (self.speed(end) - self.speed(start)) / (end_s - times[start]))
    }

    fn tick(&self, time_s: f64) -> f64 {
        if self.ticks_per_s > 0.0 { (time_s * self.ticks_per_s).round() * self.timer_s } else { time_s }
    }
}

#[cfg(test)]
mod tests {
    use car::ReadingErrors;

    use super::*;

    fn sensor(timer_s: f64) -> SpeedSensor {
        SpeedSensor {
            teeth: 60.0,
            timer_s,
            periods: 3.0,
            sample_time_s: 0.01,
            offset_s: 0.0,
            delay_s: 0.002,
            noise_rad_s: 0.0,
            errors: ReadingErrors::NONE,
            outlier_rad_s: 0.0,
        }
    }

    /// Times of the teeth from a hundred before the record on, counted one after the other.
    fn counted(sensor: &SpeedSensor, truth: Channel<'_>) -> Vec<f64> {
        let (times, speeds, pitch) = (truth.time_s, truth.values, std::f64::consts::TAU / sensor.teeth);
        let turning = speeds[0].abs() * STANDSTILL_S > pitch;
        let before = (0..=100).rev().filter(|_| turning).map(|n| times[0] - f64::from(n) * pitch / speeds[0].abs());
        let mut found: Vec<f64> = before.collect();
        let mut to_go = pitch;
        for (ends, speed) in times.windows(2).zip(speeds.windows(2)) {
            let (from, to, dt_s) = (speed[0].abs(), speed[1].abs(), ends[1] - ends[0]);
            let turned = 0.5 * (from + to) * dt_s;
            while to_go <= turned {
                let root = (from * from + 2.0 * (to - from) / dt_s * to_go).max(0.0).sqrt();
                found.push(ends[0] + 2.0 * to_go / (from + root));
                to_go += pitch;
            }
            to_go -= turned;
        }
        let tick = |time_s: f64| {
            if sensor.timer_s > 0.0 { (time_s / sensor.timer_s).round() * sensor.timer_s } else { time_s }
        };
        found.into_iter().map(tick).collect()
    }

    #[test]
    fn the_last_tooth_is_the_last_one_that_is_counted_up_to_then() {
        // Standing, speeding up through zero and back, fast; times at a millisecond, and a gap.
        let time_s: Vec<f64> = (0..600).map(|i| f64::from(i) * 1e-3 + if i > 400 { 0.05 } else { 0.0 }).collect();
        let speed = |t: f64| if t < 0.1 { 0.0 } else { 300.0 * (8.0 * t).sin() };
        let values: Vec<f64> = time_s.iter().map(|&t| speed(t)).collect();
        let from = |start: usize| Channel { name: "x", time_s: &time_s[start..], values: &values[start..] };
        for (timer_s, start) in [(0.0, 0), (1e-6, 0), (1e-3, 0), (0.0, 150), (1e-6, 150), (7e-4, 150)] {
            let truth = from(start);
            let times = counted(&sensor(timer_s), truth);
            assert!(times.len() > 500 && times.is_sorted(), "{}", times.len());
            let mut teeth = Teeth::new(&sensor(timer_s), truth);
            // The times of both differ by rounding: nothing is asked within it.
            let grid = (-10..7000).map(|i| f64::from(i) * 1e-4 + 3e-8);
            let beside = times.iter().flat_map(|&edge_s| [edge_s - 1e-8, edge_s + 1e-8]);
            let mut nows: Vec<f64> =
                grid.chain(beside).chain([9.0]).filter(|&now_s| now_s > time_s[start] - 0.02).collect();
            nows.sort_by(f64::total_cmp);
            for now_s in nows {
                let passed = times.partition_point(|&edge_s| edge_s <= now_s);
                let last = teeth.last(now_s);
                assert_eq!(last.is_none(), passed == 0, "{now_s} {timer_s}");
                let Some(last) = last else { continue };
                assert!((last.time_s - times[passed - 1]).abs() < 1e-9, "{now_s} {timer_s}: {last:?}");
                for back in 1..passed.min(40) {
                    let time_s = teeth.time_s(last.number - back as f64).unwrap();
                    assert!((time_s - times[passed - 1 - back]).abs() < 1e-9, "{now_s} {timer_s}: {back} before");
                }
            }
        }
    }

    #[test]
    fn a_record_without_motion_or_without_numbers_has_no_tooth_and_no_panic() {
        let last = |time_s: &[f64], values: &[f64], now_s| {
            Teeth::new(&sensor(0.0), Channel { name: "x", time_s, values }).last(now_s).map(|tooth| tooth.time_s)
        };
        assert_eq!(last(&[], &[], 1.0), None);
        assert_eq!(last(&[0.0], &[0.0], 1.0), None);
        assert_eq!(last(&[0.0, 1.0], &[0.0, 0.0], 0.5), None);
        // One time alone: the wheel has turned before it.
        assert_eq!(last(&[1.0], &[60.0], 2.0), Some(1.0));
        for values in [[f64::NAN, 1.0, 1.0], [9.0, f64::NAN, 9.0], [9.0, 9.0, f64::INFINITY]] {
            assert!(last(&[0.0, 1.0, 2.0], &values, 1.5).is_none_or(|time_s| time_s.is_nan() || time_s <= 1.5));
        }
    }
}
