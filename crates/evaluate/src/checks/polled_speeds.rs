//! Whether speeds are read less often than they are measured, and at other times.
//!
//! A control unit measures a speed every 20 ms, and a tester asks for it every 50 ms: each reading is up to 20 ms old, now 0 and now 10 ms. The time at
//! which a smooth course had the value of a reading tells when it was measured. Where these times lie on the grid of a period and the times of the readings do
//! not, the speed is measured with this period.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use drivetrain::Real;
use observer::Reading;

use super::check::{Check, CheckedRow};

/// Periods with which control units measure and send, s; the longest first. A shorter one makes no age that matters.
const PERIODS_S: [f64; 5] = [0.1, 0.05, 0.04, 0.025, 0.02];
/// Readings of a window.
const WINDOW: usize = 16;
/// Change of the speed in a period below which its readings tell nothing, rad/s \[chosen: several times the noise of a toothed wheel\].
const CHANGE_RAD_S: f64 = 0.5;
/// Length of the mean of the phases up to which the times of the readings are not on a grid \[chosen\].
const OFF_GRID: f64 = 0.2;
/// Longest period over the step of the readings: a longer one gives a reading twice.
const MAX_PERIOD: f64 = 0.95;
/// Windows from which on it is said, and what the sum over them of the readings times the square of the length of the mean of their phases has to be: 1 for
/// each of random phases, and 16 on a grid \[chosen: four windows of random phases reach it once in 57,000 cases\].
const ENOUGH: u32 = 4;
const SURE: [f64; 2] = [10.0, 2.0];

/// The speeds, in the order of a row.
const NAMES: [&str; 4] = ["engine_speed", "turbine_speed", "output_speed", "wheel_speed"];

/// What the readings of each speed show.
#[derive(Default)]
pub(super) struct PolledSpeeds {
    speeds: [PolledSpeed; 4],
}

/// A speed, so far.
#[derive(Default)]
struct PolledSpeed {
    /// Times, s, and values, rad/s, of the window.
    window: VecDeque<(f64, f64)>,
    /// By period: windows that tell something, how far their times lie on its grid, and the sum of the steps between their readings, s.
    windows: [(u32, f64, f64); PERIODS_S.len()],
}

impl PolledSpeed {
    fn push(&mut self, time_s: f64, value: f64) {
        if self.window.back().is_some_and(|(before_s, _)| time_s <= *before_s) {
            self.window.clear();
        }
        self.window.push_back((time_s, value));
        if self.window.len() == WINDOW {
            self.judge();
            self.window.clear();
        }
    }

    fn judge(&mut self) {
        let (Some((first_s, _)), Some((last_s, _))) = (self.window.front(), self.window.back()) else { return };
        let step_s = (last_s - first_s) / (WINDOW - 1) as f64;
        // Read as often as it is measured, a speed has readings of one age.
        let is_shorter = |period_s: f64| period_s <= MAX_PERIOD * step_s;
        if !PERIODS_S.into_iter().any(is_shorter) {
            return;
        }
        let Some(ages_s) = self.ages_s(0.5 * (first_s + last_s)) else { return };
        for (at, period_s) in PERIODS_S.into_iter().enumerate() {
            if !is_shorter(period_s) {
                continue;
            }
            let on_grid = |time_s: &dyn Fn(usize) -> f64| {
                let phases = (0..WINDOW).map(|i| TAU * time_s(i) / period_s);
                let [cos, sin] =
                    phases.fold([0.0; 2], |[cos, sin], phase| [cos + Real::cos(phase), sin + Real::sin(phase)]);
                Real::hypot(cos, sin) / WINDOW as f64
            };
            let change_rad_s = ages_s.slope_rad_s2.abs() * period_s;
            if change_rad_s < CHANGE_RAD_S || on_grid(&|i| self.window[i].0) > OFF_GRID {
                continue;
            }
            let length = on_grid(&|i| self.window[i].0 - ages_s.age_s[i]);
            self.windows[at].0 += 1;
            self.windows[at].1 += WINDOW as f64 * length * length;
            self.windows[at].2 += step_s;
        }
    }

    /// By how much each reading of the window is late against a smooth course; none where that cannot be told.
    fn ages_s(&self, middle_s: f64) -> Option<Ages> {
        // The parabola through the window, by polynomials that are orthogonal in it.
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            self.window.iter().map(|(time_s, value)| of(time_s - middle_s, *value)).sum()
        };
        let count = WINDOW as f64;
        let mean_s = sum(&|t, _| t) / count;
        let squares = sum(&|t, _| Real::powi(t - mean_s, 2));
        let skew = sum(&|t, _| Real::powi(t - mean_s, 3)) / squares;
        let bent = |t: f64| (t - mean_s) * (t - mean_s - skew) - squares / count;
        let mean = sum(&|_, value| value) / count;
        let by_line = sum(&|t, value| (t - mean_s) * value) / squares;
        let by_bend = sum(&|t, value| bent(t) * value) / sum(&|t, _| Real::powi(bent(t), 2));
        let course = |time_s: f64| mean + by_line * (time_s - middle_s - mean_s) + by_bend * bent(time_s - middle_s);
        let slope = |time_s: f64| by_line + by_bend * (2.0 * (time_s - middle_s - mean_s) - skew);
        let lowest = self.window.iter().map(|(time_s, _)| slope(*time_s).abs()).fold(f64::INFINITY, f64::min);
        // Where the speed turns, a value has no time.
        let ends = [self.window.front()?.0, self.window.back()?.0].map(slope);
        (lowest > 0.0 && ends[0] * ends[1] > 0.0).then(|| Ages {
            slope_rad_s2: lowest,
            age_s: self.window.iter().map(|(time_s, value)| (course(*time_s) - value) / slope(*time_s)).collect(),
        })
    }

    /// The period with which the speed is measured, and the step with which it is read, s, where they differ.
    fn period_s(&self) -> Option<(f64, f64)> {
        let is_sure =
            |(windows, sum, _): &(u32, f64, f64)| *windows >= ENOUGH && *sum >= SURE[0] + SURE[1] * f64::from(*windows);
        let at = self.windows.iter().position(is_sure)?;
        let (windows, _, steps_s) = self.windows[at];
        Some((PERIODS_S[at], steps_s / f64::from(windows)))
    }
}

/// By how much the readings of a window are late, s, and the lowest size of its slope, rad/s^2.
struct Ages {
    slope_rad_s2: f64,
    age_s: Vec<f64>,
}

impl Check for PolledSpeeds {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let input = &row.step.input;
        let readings = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        for (speed, reading) in self.speeds.iter_mut().zip(readings) {
            if let Some(Reading { value, age_s }) = reading.filter(|reading| reading.value.is_finite()) {
                speed.push(row.step.time_s - age_s, value);
            }
        }
    }

    fn warnings(&self) -> Vec<String> {
        let found: Vec<(&str, (f64, f64))> =
            NAMES.into_iter().zip(&self.speeds).filter_map(|(name, speed)| Some((name, speed.period_s()?))).collect();
        let sentence = |period_s: f64| {
            let of_period: Vec<_> = found.iter().filter(|(_, (of, _))| *of == period_s).collect();
            let (_, (_, step_s)) = of_period.first()?;
            let names: Vec<&str> = of_period.iter().map(|(name, _)| *name).collect();
            let [period_ms, step_ms, mean_s] = [1e3 * period_s, 1e3 * step_s, 0.5 * period_s];
            Some(format!(
                "warning: {} measured every {period_ms:.0} ms and read every {step_ms:.0} ms: a reading is 0 to {period_ms:.0} ms old, and its time does not \
                 say how much\nhint: record at {period_ms:.0} ms or faster; for this log `delay_s = {mean_s}` of these channels in the map is the mean age",
                match names.as_slice() {
                    [one] => format!("{one} is"),
                    [others @ .., last] => format!("{} and {last} are", others.join(", ")),
                    [] => String::new(),
                }
            ))
        };
        PERIODS_S.into_iter().filter_map(sentence).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A speed that rises and falls, with noise, measured every `period_s` and read every `step_s`.
    fn read(period_s: f64, step_s: f64, noise_rad_s: f64) -> PolledSpeed {
        let mut speed = PolledSpeed::default();
        for row in 0..2400 {
            let time_s = step_s * f64::from(row);
            let measured_s = if period_s > 0.0 { (time_s / period_s + 1e-9).floor() * period_s } else { time_s };
            let noise = noise_rad_s * Real::sin(12.9898 * f64::from(row) * f64::from(row));
            speed.push(time_s, 300.0 + 250.0 * Real::sin(0.3 * measured_s) + noise);
        }
        speed
    }

    #[test]
    fn a_period_that_is_not_that_of_the_readings_is_found() {
        for (period_s, step_s) in [(0.02, 0.05), (0.04, 0.05), (0.02, 0.03), (0.04, 0.1), (0.02, 0.033)] {
            for noise in [0.0, 0.1] {
                let found = read(period_s, step_s, noise).period_s();
                assert!(
                    found.is_some_and(|(at, step)| at == period_s && (step - step_s).abs() < 1e-9),
                    "{period_s} {step_s} {found:?}"
                );
            }
        }
    }

    #[test]
    fn readings_of_one_age_are_not_polled() {
        for step_s in [0.01, 0.02, 0.033, 0.05, 0.1] {
            for noise in [0.0, 0.1, 2.0] {
                assert_eq!(read(0.0, step_s, noise).period_s(), None, "{step_s} {noise}");
            }
        }
        // A measurement for each reading, or several between two.
        for (period_s, step_s) in [(0.05, 0.05), (0.01, 0.05), (0.025, 0.05), (0.02, 0.1)] {
            assert_eq!(read(period_s, step_s, 0.1).period_s(), None, "{period_s} {step_s}");
        }
    }

    #[test]
    fn a_few_readings_and_a_standing_speed_say_nothing() {
        assert_eq!(PolledSpeed::default().period_s(), None);
        let mut speed = PolledSpeed::default();
        (0..10_000).for_each(|row| speed.push(0.05 * f64::from(row), 0.0));
        assert_eq!(speed.period_s(), None);
        (0..10_000).for_each(|row| speed.push(0.05 * f64::from(row % 3), f64::from(row)));
        assert_eq!(speed.period_s(), None);
    }
}
