//! Acceleration and jerk of the car through a shift.
//!
//! Both are derivatives of the parabola with the least squares of distances to the speed over 0.3 s around a time: that of
//! [`drivetrain::jerk`], whose maximum jerk stands in the tables.

use drivetrain::jerk::{self, WINDOW_S};

use crate::figure::{Panel, Series, Stroke};
use crate::panels::panel;

/// Speeds that come faster are left out, s.
const STEP_S: f64 = 0.01;
/// Speeds that a parabola needs.
const MINIMUM: usize = 7;
/// Part of the window that they span at least.
const WHOLE: f64 = 0.95;
/// Times are sums of periods, and differ in their last digits, s.
const ROUNDING_S: f64 = 1e-6;

/// Panels of acceleration and jerk from the speed of the car over time, s and m/s; none where there are too few speeds.
pub(crate) fn motion_panels(speeds: impl Iterator<Item = (f64, f64)>) -> Vec<Panel> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for speed in speeds.filter(|(_, speed)| speed.is_finite()) {
        if kept.last().is_none_or(|last| speed.0 - last.0 >= STEP_S - ROUNDING_S) {
            kept.push(speed);
        }
    }
    let derivatives: Vec<(f64, [f64; 2])> =
        kept.iter().map(|&(time_s, _)| (time_s, derivatives(&kept, time_s).unwrap_or([f64::NAN; 2]))).collect();
    if derivatives.iter().all(|(_, [first, _])| first.is_nan()) {
        return Vec::new();
    }
    let curve = |which: usize| Series {
        label: "car".to_owned(),
        stroke: Stroke::SIGNAL,
        points: derivatives.iter().map(|(time_s, values)| (*time_s, values[which])).collect(),
    };
    vec![panel("acceleration (m/s²)", 80.0, vec![curve(0)]), panel("jerk (m/s³)", 80.0, vec![curve(1)])]
}

/// First and second derivative of the parabola around a time; none where the window is not whole.
fn derivatives(speeds: &[(f64, f64)], time_s: f64) -> Option<[f64; 2]> {
    let half_s = 0.5 * WINDOW_S;
    let from = speeds.partition_point(|(at_s, _)| *at_s < time_s - half_s - ROUNDING_S);
    let to = speeds.partition_point(|(at_s, _)| *at_s <= time_s + half_s + ROUNDING_S);
    let window = &speeds[from..to];
    let ((first_s, _), (last_s, _)) = (*window.first()?, *window.last()?);
    if window.len() < MINIMUM || last_s - first_s < WHOLE * WINDOW_S {
        return None;
    }
    jerk::derivatives(window, time_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::Real;
    use drivetrain::jerk::PeakJerk;

    fn speeds(count: u32, step_s: f64, speed: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        (0..count).map(|i| step_s * f64::from(i)).map(|time_s| (time_s, speed(time_s))).collect()
    }

    #[test]
    fn a_parabola_has_its_own_derivatives() {
        let speeds = speeds(100, 0.01, |t| 20.0 + 2.0 * t - 1.5 * t * t);
        let [first, second] = derivatives(&speeds, 0.5).unwrap();
        assert!((first - 0.5).abs() < 1e-9 && (second + 3.0).abs() < 1e-7, "{first} {second}");
        assert!(derivatives(&speeds, 0.1).is_none() && derivatives(&speeds, 0.9).is_none());
    }

    #[test]
    fn the_largest_jerk_of_the_curve_is_that_of_the_tables() {
        let speeds = speeds(300, 0.01, |t| 20.0 + 0.3 * Real::sin(7.0 * t));
        let mut peak = PeakJerk::default();
        speeds.iter().for_each(|&(time_s, speed)| peak.speed(time_s, speed));
        let panels = motion_panels(speeds.into_iter());
        let jerks = panels[1].series[0].points.iter().map(|point| point.1.abs());
        let largest = jerks.filter(|jerk| !jerk.is_nan()).fold(0.0, f64::max);
        assert!((largest / peak.peak_m_s3().unwrap() - 1.0).abs() < 1e-6, "{largest}");
    }

    #[test]
    fn without_speeds_there_are_no_panels() {
        assert!(motion_panels(std::iter::empty()).is_empty());
        assert!(motion_panels(speeds(50, 0.1, |_| f64::NAN).into_iter()).is_empty());
        assert!(motion_panels(speeds(5, 0.01, |t| t).into_iter()).is_empty());
        // Readings too rare for a window of 0.3 s.
        assert!(motion_panels(speeds(50, 0.1, |t| t).into_iter()).is_empty());
    }
}
