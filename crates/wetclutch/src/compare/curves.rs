//! The signals of the shifts of a run.

use std::path::Path;

use logs::{Log, OpenOptions};

use super::ShiftOfRun;
use crate::Error;

/// A signal that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Signal {
    /// What it is.
    pub title: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Columns that hold it; the first that a run has counts.
    columns: &'static [&'static str],
    /// Columns of the ends of its range.
    range: [&'static str; 2],
}

const fn signal(
    title: &'static str,
    unit: &'static str,
    columns: &'static [&'static str],
    range: [&'static str; 2],
) -> Signal {
    Signal { title, unit, columns, range }
}

/// The signals that are compared, in the order in which they are drawn.
pub const SIGNALS: [Signal; 7] = [
    signal("turbine speed", "rad/s", &["turbine_speed_rad_s"], ["", ""]),
    signal(
        "pressure of the oncoming clutch",
        "Pa",
        &["oncoming_pressure_estimate_pa", "oncoming_pressure_pa"],
        ["oncoming_pressure_least_pa", "oncoming_pressure_greatest_pa"],
    ),
    signal(
        "torque of the oncoming clutch",
        "N m",
        &["oncoming_torque_estimate_n_m", "oncoming_torque_n_m"],
        ["oncoming_torque_least_n_m", "oncoming_torque_greatest_n_m"],
    ),
    signal(
        "pressure of the offgoing clutch",
        "Pa",
        &["offgoing_pressure_estimate_pa", "offgoing_pressure_pa"],
        ["offgoing_pressure_least_pa", "offgoing_pressure_greatest_pa"],
    ),
    signal(
        "torque of the offgoing clutch",
        "N m",
        &["offgoing_torque_estimate_n_m", "offgoing_torque_n_m"],
        ["offgoing_torque_least_n_m", "offgoing_torque_greatest_n_m"],
    ),
    signal("shaft torque", "N m", &["shaft_torque_estimate_n_m", "shaft_torque_n_m"], ["", ""]),
    signal("acceleration", "m/s^2", &["vehicle_acceleration_m_s2"], ["", ""]),
];

/// A signal of a shift: time since the begin of the shift, s, value, and the ends of its range.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Curve {
    /// Time and value.
    pub points: Vec<(f64, f64)>,
    /// Time and lower end; empty where there is no range.
    pub lower: Vec<(f64, f64)>,
    /// Time and upper end.
    pub upper: Vec<(f64, f64)>,
}

/// Time around a shift that is read as well, s.
pub(super) const MARGIN_S: [f64; 2] = [0.1, 0.25];

/// The signals of each shift, in the order of [`SIGNALS`].
pub(super) type ShiftCurves = [Curve; SIGNALS.len()];

/// Reads the signals of these shifts, which stand in the order of their times.
pub(super) fn read(path: &Path, shifts: &[ShiftOfRun]) -> Result<Vec<ShiftCurves>, Error> {
    let mut log = Log::open(path, &OpenOptions::default())?;
    let find = |name: &str| log.channels().iter().position(|channel| channel.name == name);
    // The channel of each curve: the value, and the ends of its range.
    let mut uses: Vec<(usize, usize, usize)> = Vec::new();
    for (at, signal) in SIGNALS.iter().enumerate() {
        let value = signal.columns.iter().find_map(|name| find(name));
        let places = [value, find(signal.range[0]), find(signal.range[1])];
        uses.extend(places.iter().enumerate().filter_map(|(part, place)| Some(((*place)?, at, part))));
    }
    let wanted: Vec<usize> = uses.iter().map(|(channel, ..)| *channel).collect();
    let mut curves = vec![ShiftCurves::default(); shifts.len()];
    let mut samples = log.samples(&wanted)?;
    let mut first = 0;
    while let Some(sample) = samples.next().transpose()? {
        let time_s = sample.time_s;
        while shifts.get(first).is_some_and(|shift| shift.time_s[1] + MARGIN_S[1] < time_s) {
            first += 1;
        }
        if !sample.value.is_finite() {
            continue;
        }
        let around =
            shifts.iter().enumerate().skip(first).take_while(|(_, shift)| shift.time_s[0] - MARGIN_S[0] <= time_s);
        for (place, shift) in around.filter(|(_, shift)| time_s <= shift.time_s[1] + MARGIN_S[1]) {
            for &(_, at, part) in uses.iter().filter(|(channel, ..)| *channel == sample.channel) {
                let curve = &mut curves[place][at];
                let points = [&mut curve.points, &mut curve.lower, &mut curve.upper];
                for (_, points) in points.into_iter().enumerate().filter(|(of, _)| *of == part) {
                    points.push((time_s - shift.time_s[0], sample.value));
                }
            }
        }
    }
    Ok(curves)
}

impl Curve {
    /// The value at a time between two points that lie close to each other.
    fn at(&self, time_s: f64) -> Option<f64> {
        /// A gap is longer, s.
        const GAP_S: f64 = 0.1;
        let next = self.points.partition_point(|(other_s, _)| *other_s < time_s);
        let (after_s, after) = *self.points.get(next)?;
        if after_s == time_s {
            return Some(after);
        }
        let (before_s, before) = *self.points.get(next.checked_sub(1)?)?;
        let part = (time_s - before_s) / (after_s - before_s);
        (after_s - before_s <= GAP_S).then_some(before + part * (after - before))
    }

    /// RMS difference of two curves within a shift of this length, s; none where they have no time in common.
    pub(super) fn rms_difference(&self, other: &Self, length_s: f64) -> Option<f64> {
        let within = self.points.iter().filter(|(time_s, _)| (0.0..=length_s).contains(time_s));
        let squares: Vec<f64> = within
            .filter_map(|(time_s, value)| Some((other.at(*time_s)? - value) * (other.at(*time_s)? - value)))
            .collect();
        let count = squares.len() as f64;
        (count > 0.0).then(|| (squares.iter().sum::<f64>() / count).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_of_curves_is_taken_where_both_have_values() {
        let curve = |points: &[(f64, f64)]| Curve { points: points.to_vec(), ..Curve::default() };
        let line = curve(&[(0.0, 0.0), (0.05, 1.0), (0.1, 2.0), (0.5, 9.0)]);
        let shifted = curve(&[(0.02, 3.4), (0.06, 4.2), (0.1, 5.0)]);
        // Three more than the line where both are.
        assert!((line.rms_difference(&shifted, 1.0).unwrap() - 3.0).abs() < 1e-12);
        assert_eq!(line.rms_difference(&line, 1.0), Some(0.0));
        assert_eq!(line.rms_difference(&curve(&[]), 1.0), None);
        // Nothing is said of the gap from 0.1 to 0.5 s.
        assert_eq!(curve(&[(0.3, 1.0)]).rms_difference(&line, 1.0), None);
    }
}
