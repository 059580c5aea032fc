//! The motion of a car around the shift that is under way, or was the last one, for what the occupants feel of it.

use std::collections::VecDeque;

use drivetrain::jerk::derivatives;
use drivetrain::jerk_of_readings::Holes;

use crate::shift_comfort::{AFTER_S, AccelerationSource, BEFORE_S, FeltSample, ShiftComfort};

/// The acceleration at a time is the slope of the parabola with the least squares of distances to the speeds up to this time around it, s
/// \[chosen\]: it takes an oscillation of 3 Hz to 0.7 of its amplitude, and the rounding of a speed to 0.05 km/h at 50 Hz to 0.02 m/s^2.
const SLOPE_S: f64 = 0.1;
/// A parabola needs so many speeds, and at least this fraction of its time on both sides: at its ends it is loose.
const MIN_SPEEDS: usize = 5;
const WHOLE: f64 = 0.8;
/// Samples that are kept at most: those of a shift of a minute at 1 kHz.
const MAX_SAMPLES: usize = 60_000;

/// A moving car at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    /// Time, s.
    pub(crate) time_s: f64,
    /// Its acceleration, m/s^2, or speed, m/s, by the source.
    pub(crate) value: f64,
    /// Slip of the old and of the new gear, rad/s at the turbine.
    pub(crate) slips_rad_s: [f64; 2],
}

/// The motion around one shift.
#[derive(Debug)]
pub(crate) struct FeltShift {
    source: AccelerationSource,
    samples: VecDeque<Motion>,
    /// The request, and the end once it is known, of the shift that is under way or has just ended, s.
    span_s: Option<(f64, Option<f64>)>,
}

impl FeltShift {
    pub(crate) fn of(source: AccelerationSource) -> Self {
        Self { source, samples: VecDeque::new(), span_s: None }
    }

    /// Takes the next motion. A reading that came before is left out, and a clock that goes back begins anew.
    pub(crate) fn push(&mut self, motion: Motion) {
        match self.samples.back() {
            Some(last) if last.time_s > motion.time_s + 1.0 => self.samples.clear(),
            Some(last) if last.time_s >= motion.time_s => return,
            _ => {}
        }
        self.samples.push_back(motion);
        let from_s = self.span_s.map_or(motion.time_s, |(request_s, _)| request_s) - BEFORE_S - SLOPE_S;
        while self.samples.len() > MAX_SAMPLES || self.samples.front().is_some_and(|sample| sample.time_s < from_s) {
            self.samples.pop_front();
        }
    }

    /// Begins a shift; what was felt of the one before, if that has just ended.
    pub(crate) fn begin(&mut self, request_s: f64) -> Option<ShiftComfort> {
        let before = self.finish();
        self.span_s = Some((request_s, None));
        before
    }

    /// The shift is complete at this time, s; without one nothing is said of it.
    pub(crate) fn end(&mut self, end_s: Option<f64>) {
        self.span_s = self.span_s.zip(end_s).map(|((request_s, _), end_s)| (request_s, Some(end_s)));
    }

    /// What was felt of the shift that has ended, once all of its motion is there.
    pub(crate) fn ended(&mut self, time_s: f64) -> Option<ShiftComfort> {
        let (_, end_s) = self.span_s?;
        if time_s >= end_s? + AFTER_S[1] + SLOPE_S { self.finish() } else { None }
    }

    /// What was felt of the shift that has ended, by the motion that there is.
    pub(crate) fn finish(&mut self) -> Option<ShiftComfort> {
        let (request_s, end_s) = self.span_s?;
        let span_s = [request_s, end_s?];
        self.span_s = None;
        let mut holes = Holes::default();
        if self.samples.iter().any(|sample| holes.is_behind_one(sample.time_s)) {
            return None;
        }
        let comfort = ShiftComfort::of(&self.accelerations()?, span_s)?;
        comfort.vibration_dose_m_s1_75.is_finite().then_some(ShiftComfort { source: self.source, ..comfort })
    }

    fn accelerations(&self) -> Option<Vec<FeltSample>> {
        let felt = |motion: &Motion, acceleration_m_s2: f64| FeltSample {
            time_s: motion.time_s,
            acceleration_m_s2,
            slips_rad_s: motion.slips_rad_s,
        };
        if self.source == AccelerationSource::Vehicle {
            return Some(self.samples.iter().map(|motion| felt(motion, motion.value)).collect());
        }
        // A car that moves has no speed that stays to the last digit.
        let first = self.samples.front()?.value;
        if self.samples.iter().all(|motion| motion.value == first) {
            return None;
        }
        let speeds: Vec<(f64, f64)> = self.samples.iter().map(|motion| (motion.time_s, motion.value)).collect();
        let last_s = self.samples.back()?.time_s;
        let slope = |time_s: f64| {
            let beside_s = (time_s - self.samples[0].time_s).min(last_s - time_s);
            if beside_s < WHOLE * SLOPE_S {
                return None;
            }
            let from = speeds.partition_point(|(at_s, _)| *at_s < time_s - SLOPE_S);
            let to = speeds.partition_point(|(at_s, _)| *at_s <= time_s + SLOPE_S);
            let around = speeds.get(from..to).filter(|around| around.len() >= MIN_SPEEDS)?;
            derivatives(around, time_s).map(|[slope, _]| slope)
        };
        Some(self.samples.iter().filter_map(|motion| Some(felt(motion, slope(motion.time_s)?))).collect())
    }
}

/// The motion around one shift by the speeds of a log: that of the wheels, and where it says nothing that of the output.
#[derive(Debug)]
pub(crate) struct FeltBySpeeds {
    wheel: FeltShift,
    output: FeltShift,
}

impl FeltBySpeeds {
    pub(crate) fn new() -> Self {
        let [wheel, output] = [AccelerationSource::WheelSpeed, AccelerationSource::OutputSpeed].map(FeltShift::of);
        Self { wheel, output }
    }

    /// Takes the speed of the car by the wheels, or by the output.
    pub(crate) fn push(&mut self, source: AccelerationSource, motion: Motion) {
        match source {
            AccelerationSource::WheelSpeed => self.wheel.push(motion),
            _ => self.output.push(motion),
        }
    }

    /// See [`FeltShift::begin`].
    pub(crate) fn begin(&mut self, request_s: f64) -> Option<ShiftComfort> {
        let [wheel, output] = self.both(|felt| felt.begin(request_s));
        wheel.or(output)
    }

    /// See [`FeltShift::end`].
    pub(crate) fn end(&mut self, end_s: Option<f64>) {
        self.both(|felt| felt.end(end_s));
    }

    /// See [`FeltShift::ended`].
    pub(crate) fn ended(&mut self, time_s: f64) -> Option<ShiftComfort> {
        let [wheel, output] = self.both(|felt| felt.ended(time_s));
        wheel.or(output)
    }

    /// See [`FeltShift::finish`].
    pub(crate) fn finish(&mut self) -> Option<ShiftComfort> {
        let [wheel, output] = self.both(FeltShift::finish);
        wheel.or(output)
    }

    fn both<T>(&mut self, mut of: impl FnMut(&mut FeltShift) -> T) -> [T; 2] {
        [of(&mut self.wheel), of(&mut self.output)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shift from 1 s to 2 s of a car whose acceleration swings by 0.5 m/s^2 with 1 Hz about 1 m/s^2, every `step_s`.
    fn felt(source: AccelerationSource, step_s: f64, hole: impl Fn(f64) -> bool) -> Option<ShiftComfort> {
        use std::f64::consts::TAU;
        let mut felt = FeltShift::of(source);
        let mut found = None;
        for at in 0..(3.0 / step_s) as i32 {
            let time_s = step_s * f64::from(at);
            if (time_s - 1.0).abs() < 0.5 * step_s {
                felt.begin(time_s);
            }
            if (time_s - 2.0).abs() < 0.5 * step_s {
                felt.end(Some(time_s));
            }
            let value = match source {
                AccelerationSource::Vehicle => 1.0 + 0.5 * (TAU * time_s).sin(),
                _ => 10.0 + time_s - 0.5 / TAU * (TAU * time_s).cos(),
            };
            if !hole(time_s) {
                felt.push(Motion { time_s, value, slips_rad_s: [0.0; 2] });
            }
            found = found.or(felt.ended(time_s));
        }
        found
    }

    #[test]
    fn a_measured_speed_gives_what_the_acceleration_gives_up_to_a_few_per_cent() {
        let none = |_| false;
        let known = felt(AccelerationSource::Vehicle, 0.005, none).unwrap();
        for step_s in [0.005, 0.01, 0.02] {
            let by_speed = felt(AccelerationSource::OutputSpeed, step_s, none).unwrap();
            assert_eq!(by_speed.source, AccelerationSource::OutputSpeed);
            for (one, other) in [
                (known.vibration_dose_m_s1_75, by_speed.vibration_dose_m_s1_75),
                (known.beyond_m_s2[0], by_speed.beyond_m_s2[0]),
            ] {
                assert!((other / one - 1.0).abs() < 0.06, "{step_s}: {one} {other}");
            }
        }
    }

    /// A shift whose log ends with it, of a car whose speed swings fast: the ends of the log are not taken for excursions.
    #[test]
    fn a_log_that_ends_with_the_shift_has_no_excursion_at_its_end() {
        use std::f64::consts::TAU;
        let mut felt = FeltShift::of(AccelerationSource::OutputSpeed);
        for at in 0..200 {
            let time_s = 0.01 * f64::from(at);
            if at == 100 {
                felt.begin(time_s);
            }
            let value = 10.0 + time_s + 0.01 * (TAU * 8.0 * time_s).sin();
            felt.push(Motion { time_s, value, slips_rad_s: [0.0; 2] });
        }
        felt.end(Some(2.0));
        let step = felt.finish().unwrap().step_m_s2();
        assert!(step < 0.15, "{step}");
    }

    #[test]
    fn a_hole_a_speed_that_stands_and_a_shift_without_end_say_nothing() {
        assert!(felt(AccelerationSource::OutputSpeed, 0.01, |time_s| (1.3..1.7).contains(&time_s)).is_none());
        let mut stands = FeltShift::of(AccelerationSource::OutputSpeed);
        stands.begin(0.5);
        (0..200).for_each(|at| {
            stands.push(Motion { time_s: 0.01 * f64::from(at), value: 3.0, slips_rad_s: [f64::NAN; 2] });
        });
        stands.end(Some(1.0));
        assert_eq!(stands.ended(2.0), None);
        assert_eq!(stands.begin(2.0), None);
        stands.end(None);
        assert_eq!((stands.ended(9.0), stands.finish()), (None, None));
    }
}
