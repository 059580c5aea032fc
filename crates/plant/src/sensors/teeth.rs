//! The teeth of a wheel that have passed its sensor.
//!
//! Thousands of teeth pass, but a reading needs the times of two of them. The teeth of every interval are counted; the time of
//! one is computed when a reading asks for it.

use config::SpeedSensor;

use super::{Channel, SAME_TIME_S, STANDSTILL_S};

/// The teeth that pass in a record of a speed, in their order.
#[derive(Debug)]
pub(super) struct Teeth<'a> {
    truth: Channel<'a>,
    timer_s: f64,
    ticks_per_s: f64,
    /// Angle between two teeth, rad.
    pitch: f64,
    /// Times of the teeth that the first readings need, before the record, s.
    before_s: Vec<f64>,
    /// Between each time of the record and the next one.
    intervals: Vec<Interval>,
    /// How many pass in the whole record.
    count: usize,
    /// How many of the record's times are surely over.
    times: usize,
}

/// What passes between two times of the record.
#[derive(Debug, Clone, Copy)]
struct Interval {
    /// How many teeth have passed before.
    passed: usize,
    /// How far the wheel turns until the first one passes, rad.
    to_go: f64,
}

/// A tooth of the record.
#[derive(Debug, Clone, Copy)]
struct Pass {
    /// It passes between the times at this place and the place before.
    end: usize,
    /// How far the wheel turns from the time before until it passes, rad.
    turned_rad: f64,
}

impl<'a> Teeth<'a> {
    pub(super) fn new(sensor: &SpeedSensor, truth: Channel<'a>) -> Self {
        let pitch = std::f64::consts::TAU / sensor.teeth;
        let (time_s, speed) = (truth.time_s, truth.values);
        let ticks_per_s = if sensor.timer_s > 0.0 { 1.0 / sensor.timer_s } else { 0.0 };
        let mut teeth = Self {
            truth,
            timer_s: sensor.timer_s,
            ticks_per_s,
            pitch,
            before_s: Vec::new(),
            intervals: Vec::with_capacity(time_s.len().saturating_sub(1)),
            count: 0,
            times: 0,
        };
        teeth.before_s = before_the_record(sensor, truth, pitch).map(|edge_s| teeth.tick(edge_s)).collect();
        // How far the wheel has to turn until the next tooth passes.
        let mut to_go = pitch;
        for end in 1..time_s.len() {
            teeth.intervals.push(Interval { passed: teeth.count, to_go });
            let turned = 0.5 * (speed[end - 1].abs() + speed[end].abs()) * (time_s[end] - time_s[end - 1]);
            let mut next = to_go;
            while next <= turned {
                teeth.count += 1;
                next += pitch;
            }
            to_go = next - turned;
        }
        teeth
    }

    /// How many have passed by a time, s, not before the time of the last question.
    pub(super) fn passed(&mut self, now_s: f64) -> usize {
        // The timer moves a tooth by half a tick: only those of the intervals about now have to be timed.
        let surely_s = now_s - self.timer_s - SAME_TIME_S;
        while self.truth.time_s.get(self.times).is_some_and(|&time_s| time_s <= surely_s) {
            self.times += 1;
        }
        let begun = self.times.saturating_sub(1);
        let perhaps_s = now_s + self.timer_s + SAME_TIME_S;
        let about_now = (begun..self.intervals.len())
            .take_while(|&interval| self.truth.time_s[interval] <= perhaps_s)
            .flat_map(|interval| self.passes(interval))
            .take_while(|pass| self.pass_s(pass) <= now_s)
            .count();
        match self.passed_before(begun) + about_now {
            0 => self.before_s.partition_point(|&edge_s| edge_s <= now_s),
            passed => self.before_s.len() + passed,
        }
    }

    /// When one passes, in steps of the timer, s.
    pub(super) fn time_s(&self, tooth: usize) -> f64 {
        match self.before_s.get(tooth) {
            Some(&edge_s) => edge_s,
            None => {
                let number = tooth - self.before_s.len();
                // The last interval that begins with no more.
                let interval = self.intervals.partition_point(|interval| interval.passed <= number).saturating_sub(1);
                let within = number - self.passed_before(interval);
                self.passes(interval).nth(within).map_or(f64::NAN, |pass| self.pass_s(&pass))
            }
        }
    }

    /// How many have passed before an interval.
    fn passed_before(&self, interval: usize) -> usize {
        self.intervals.get(interval).map_or(self.count, |interval| interval.passed)
    }

    /// The teeth of an interval.
    fn passes(&self, interval: usize) -> impl Iterator<Item = Pass> {
        let count = self.passed_before(interval + 1) - self.passed_before(interval);
        let first = self.intervals.get(interval).map_or(0.0, |interval| interval.to_go);
        // Each is one pitch after the one before, by the same sums as they were counted.
        let turned = std::iter::successors(Some(first), |turned| Some(turned + self.pitch)).take(count);
        turned.map(move |turned_rad| Pass { end: interval + 1, turned_rad })
    }

    fn pass_s(&self, pass: &Pass) -> f64 {
        let Channel { time_s, values, .. } = self.truth;
        let (start_s, from, to) = (time_s[pass.end - 1], values[pass.end - 1].abs(), values[pass.end].abs());
        // Within the interval the speed changes linearly: the angle is a quadratic function of time.
        let bend = (to - from) / (time_s[pass.end] - start_s);
        let root = (from * from + 2.0 * bend * pass.turned_rad).max(0.0).sqrt();
        self.tick(start_s + 2.0 * pass.turned_rad / (from + root))
    }

    fn tick(&self, time_s: f64) -> f64 {
        if self.ticks_per_s > 0.0 { (time_s * self.ticks_per_s).round() * self.timer_s } else { time_s }
    }
}

/// Times of the teeth that the first readings need. Before the record begins, the wheel turns as at its beginning.
fn before_the_record(sensor: &SpeedSensor, truth: Channel<'_>, pitch: f64) -> impl Iterator<Item = f64> {
    let (begin_s, speed) = match (truth.time_s.first(), truth.values.first()) {
        (Some(&begin_s), Some(speed)) => (begin_s, speed.abs()),
        _ => (0.0, 0.0),
    };
    // The first row has a reading that may be as old as the period of the channel.
    let oldest_s = sensor.delay_s + sensor.sample_time_s;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of teeth")]
    let count = (sensor.periods + 1.0 + speed * oldest_s / pitch).ceil() as u32;
    let turning = speed * STANDSTILL_S > pitch;
    (0..=count).rev().filter(move |_| turning).map(move |tooth| begin_s - f64::from(tooth) * pitch / speed)
}

#[cfg(test)]
mod tests {
    use config::ReadingErrors;

    use super::*;

    #[test]
    fn as_many_have_passed_as_have_a_time_before_now() {
        // Standing, speeding up through zero and back, fast; times at a millisecond, and a gap.
        let time_s: Vec<f64> = (0..600).map(|i| f64::from(i) * 1e-3 + if i > 400 { 0.05 } else { 0.0 }).collect();
        let speed = |t: f64| if t < 0.1 { 0.0 } else { 300.0 * (8.0 * t).sin() };
        let values: Vec<f64> = time_s.iter().map(|&t| speed(t)).collect();
        let from = |start: usize| Channel { name: "x", time_s: &time_s[start..], values: &values[start..] };
        for (timer_s, start) in [(0.0, 0), (1e-6, 0), (1e-3, 0), (0.0, 150), (1e-6, 150), (7e-4, 150)] {
            let sensor = SpeedSensor {
                teeth: 60.0,
                timer_s,
                periods: 3.0,
                sample_time_s: 0.01,
                offset_s: 0.0,
                delay_s: 0.002,
                noise_rad_s: 0.0,
                errors: ReadingErrors::NONE,
                outlier_rad_s: 0.0,
            };
            let mut teeth = Teeth::new(&sensor, from(start));
            let count = teeth.before_s.len() + teeth.count;
            let times: Vec<f64> = (0..count).map(|tooth| teeth.time_s(tooth)).collect();
            assert!(count > 500 && times.is_sorted(), "{count}");
            let grid = (-10..7000).map(|i| f64::from(i) * 1e-4);
            let mut nows: Vec<f64> = grid.chain(times.iter().copied()).chain([9.0]).collect();
            nows.sort_by(f64::total_cmp);
            for now_s in nows {
                assert_eq!(teeth.passed(now_s), times.partition_point(|&edge_s| edge_s <= now_s), "{now_s} {timer_s}");
            }
        }
        let empty = Channel { name: "x", time_s: &[], values: &[] };
        let sensor = SpeedSensor {
            teeth: 60.0,
            timer_s: 0.0,
            periods: 1.0,
            sample_time_s: 0.01,
            offset_s: 0.0,
            delay_s: 0.0,
            noise_rad_s: 0.0,
            errors: ReadingErrors::NONE,
            outlier_rad_s: 0.0,
        };
        assert_eq!(Teeth::new(&sensor, empty).passed(1.0), 0);
    }
}
