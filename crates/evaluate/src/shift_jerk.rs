//! The jerk of the shifts of a log, by the speed of the car: that of its channel, or by the wheels. The output of the gearbox swings against the car by
//! more than the jerk of a shift.

use std::collections::VecDeque;

use observer::Reading;

use crate::LogStep;

/// The jerk of a shift is that of the speeds from so long before it to so long after it, s, as in `logs::shifts`.
const AROUND_S: f64 = 0.45;
/// Speeds that are kept at most: those of a shift of ten minutes at 100 Hz.
const MAX_SPEEDS: usize = 60_000;

/// The jerk of the shifts: speeds around the shift that is under way, or was the last one.
#[derive(Debug, Default)]
pub(crate) struct ShiftJerk {
    /// Times, s, and speeds, m/s: of the last tenths of a second, from the request of a shift on all of them.
    speeds: VecDeque<(f64, f64)>,
    /// Whether a shift is under way or has just ended, and until when its speeds count, s.
    until_s: Option<f64>,
    /// Place of the source of the speeds, the best first; none before the first speed.
    source: Option<usize>,
}

impl ShiftJerk {
    /// Takes a row with the speeds of the car in it, m/s: by its own channel, and by the wheels. Of a log the best source that has come is used.
    pub(crate) fn push(&mut self, step: &LogStep, speeds_m_s: [Option<Reading<f64>>; 2]) {
        let came = speeds_m_s.into_iter().enumerate().filter_map(|(source, speed)| Some((source, speed?)));
        let mut usable =
            came.filter(|(source, speed)| speed.value.is_finite() && self.source.is_none_or(|best| *source <= best));
        if let Some((source, speed)) = usable.next() {
            if self.source != Some(source) {
                self.speeds.clear();
                self.source = Some(source);
            }
            let time_s = step.time_s - speed.age_s;
            match self.speeds.back() {
                Some((last_s, _)) if *last_s > time_s + 1.0 => self.speeds.clear(),
                Some((last_s, _)) if *last_s >= time_s => return,
                _ => {}
            }
            self.speeds.push_back((time_s, speed.value));
        }
        let keeps = |(time_s, _): &(f64, f64)| *time_s >= step.time_s - AROUND_S;
        while self.speeds.len() > MAX_SPEEDS || self.until_s.is_none() && self.speeds.front().is_some_and(|s| !keeps(s))
        {
            self.speeds.pop_front();
        }
    }

    /// Begins a shift; the jerk of the one before, if it was still under way.
    pub(crate) fn begin(&mut self, time_s: f64) -> Option<f64> {
        let before = self.until_s.filter(|until_s| until_s.is_finite()).and_then(|_| self.jerk_m_s3());
        self.speeds.retain(|(speed_s, _)| *speed_s >= time_s - AROUND_S);
        if self.speeds.is_empty() {
            // A channel that has ended leaves its place to the next one.
            self.source = None;
        }
        self.until_s = Some(f64::INFINITY);
        before
    }

    /// The shift ends at this time, s; `None` where the rest of it is not seen.
    pub(crate) fn end(&mut self, time_s: Option<f64>) {
        self.until_s = time_s.map(|time_s| time_s + AROUND_S);
    }

    /// The jerk of the shift that has ended, m/s^3, once its speeds are all there, or at the end of the log.
    pub(crate) fn ended(&mut self, time_s: f64) -> Option<f64> {
        self.until_s.filter(|until_s| until_s.is_finite() && time_s >= *until_s)?;
        self.until_s = None;
        self.jerk_m_s3()
    }

    fn jerk_m_s3(&self) -> Option<f64> {
        // A car that moves has no speed that stays to the last digit.
        let first = self.speeds.front()?.1;
        let stands = self.speeds.iter().all(|(_, speed)| *speed == first);
        if stands { None } else { drivetrain::jerk_of_readings::peak_jerk_m_s3(self.speeds.iter().copied()) }
    }
}
