//! Speeds over time that a driver follows: a file of two columns.

use std::path::PathBuf;

use crate::check::Check;
use crate::{ConfigError, Source};

/// Highest speed, m/s.
const FASTEST_M_S: f64 = 100.0;
/// Columns of speeds, each with its unit in m/s.
const SPEEDS: [(&str, f64); 3] = [("speed_m_s", 1.0), ("speed_km_h", 1.0 / 3.6), ("speed_mph", 1609.344 / 3600.0)];

/// Speeds over time, linear between the points, on a road of one grade.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedTrace {
    /// The file.
    pub path: PathBuf,
    /// Rising times, s; the first is zero.
    time_s: Vec<f64>,
    /// A speed for each, m/s.
    speed_m_s: Vec<f64>,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
}

impl SpeedTrace {
    /// Reads a file: a head with `time_s` and one of `speed_m_s`, `speed_km_h` and `speed_mph`, then the points. What follows a
    /// `#` is a comment.
    ///
    /// # Errors
    /// The first line that is wrong.
    pub fn from_source(source: &Source, grade_rad: f64) -> Result<Self, ConfigError> {
        let check = Check::of(source);
        let wrong = |at: usize, message: String, hint: &str| {
            Err(check.meaning("time_s, speed", at, message, (!hint.is_empty()).then(|| hint.to_owned())))
        };
        const HEAD: &str =
            "the first line is \"time_s,speed_km_h\" (or speed_m_s, speed_mph), then one point in each line";
        let mut unit_m_s = None;
        let mut trace = Self { path: source.path.clone(), time_s: Vec::new(), speed_m_s: Vec::new(), grade_rad };
        let mut at = 0;
        for line in source.text.split_inclusive('\n') {
            let begin = at;
            at += line.len();
            let text = line.split('#').next().unwrap_or_default().trim().trim_start_matches('\u{feff}');
            if text.is_empty() {
                continue;
            }
            let Some((time, speed)) = text.split_once(',') else {
                return wrong(begin, format!("\"{text}\" has no comma"), HEAD);
            };
            let (time, speed) = (time.trim(), speed.trim());
            let Some(unit) = unit_m_s else {
                let column = SPEEDS.iter().find(|(name, _)| *name == speed && time == "time_s");
                let Some((_, unit)) = column else { return wrong(begin, format!("the columns are \"{text}\""), HEAD) };
                unit_m_s = Some(*unit);
                continue;
            };
            let (Ok(time_s), Ok(speed)) = (time.parse::<f64>(), speed.parse::<f64>()) else {
                return wrong(begin, format!("\"{text}\" is not two numbers"), "");
            };
            let speed_m_s = unit * speed;
            if !(0.0..=FASTEST_M_S).contains(&speed_m_s) {
                return wrong(begin, format!("the speed is {speed_m_s:.1} m/s, expected 0 to {FASTEST_M_S}"), "");
            }
            let follows = trace.time_s.last().map_or(time_s == 0.0, |before| time_s > *before && time_s < 1e9);
            if !follows {
                return wrong(begin, format!("the time is {time_s} s"), "times begin at 0 and rise");
            }
            trace.time_s.push(time_s);
            trace.speed_m_s.push(speed_m_s);
        }
        if trace.time_s.len() < 2 {
            return wrong(0, "the file has fewer than two points".to_owned(), HEAD);
        }
        Ok(trace)
    }

    /// Time of the last point, s.
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.time_s.len()
    }

    /// Speed at a time, m/s; before the first point and after the last one that of these.
    pub fn at_m_s(&self, time_s: f64) -> f64 {
        let after = self.time_s.partition_point(|&point| point <= time_s);
        match (after.checked_sub(1), self.time_s.get(after)) {
            (Some(before), Some(next)) => {
                let share = (time_s - self.time_s[before]) / (next - self.time_s[before]);
                self.speed_m_s[before] + share * (self.speed_m_s[after] - self.speed_m_s[before])
            }
            (Some(last), None) => self.speed_m_s[last],
            (None, _) => self.speed_m_s.first().copied().unwrap_or(0.0),
        }
    }

    /// Lowest and highest speed within this time before and after a time, m/s.
    pub fn range_m_s(&self, time_s: f64, around_s: f64) -> [f64; 2] {
        let ends = [self.at_m_s(time_s - around_s), self.at_m_s(time_s + around_s), self.at_m_s(time_s)];
        let first = self.time_s.partition_point(|&point| point <= time_s - around_s);
        let last = self.time_s.partition_point(|&point| point < time_s + around_s);
        let within = self.speed_m_s.get(first..last).unwrap_or_default();
        let all = || ends.iter().chain(within).copied();
        [all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(text: &str) -> Result<SpeedTrace, String> {
        SpeedTrace::from_source(&Source::built_in("t.csv", text), 0.0).map_err(|error| error.to_string())
    }

    #[test]
    fn speeds_are_linear_between_the_points_in_every_unit() {
        for (unit, scale) in [("speed_m_s", 1.0), ("speed_km_h", 3.6), ("speed_mph", 3600.0 / 1609.344)] {
            let text = format!("# a comment\ntime_s, {unit}\n0,0\n2,{} # fast\n\n3,{}\n", 10.0 * scale, 5.0 * scale);
            let trace = trace(&text).unwrap();
            for (time_s, expected) in [(-1.0, 0.0), (0.0, 0.0), (1.0, 5.0), (2.5, 7.5), (3.0, 5.0), (9.0, 5.0)] {
                assert!((trace.at_m_s(time_s) - expected).abs() < 1e-12, "{unit} {time_s}");
            }
            let [low, high] = trace.range_m_s(2.5, 1.0);
            assert!((low - 5.0).abs() < 1e-12 && (high - 10.0).abs() < 1e-12, "{low} {high}");
            assert_eq!((trace.duration_s(), trace.points()), (3.0, 3));
        }
    }

    #[test]
    fn wrong_files_get_their_line() {
        for (text, expected) in [
            ("", "t.csv:1"),
            ("time_s,speed_km_h\n0,0\n", "fewer than two points"),
            ("time,speed\n0,0\n1,1\n", "t.csv:1: `time_s, speed`: the columns are \"time,speed\""),
            ("time_s,speed_km_h\n0,0\n1,x\n", "t.csv:3: `time_s, speed`: \"1,x\" is not two numbers"),
            ("time_s,speed_km_h\n0,0\n1\n", "\"1\" has no comma"),
            ("time_s,speed_km_h\n0,0\n1,NaN\n", "expected 0 to 100"),
            ("time_s,speed_km_h\n0,0\n1,-3\n", "the speed is -0.8 m/s"),
            ("time_s,speed_m_s\n0,0\n1,120\n", "the speed is 120.0 m/s"),
            ("time_s,speed_km_h\n0,0\n1,1\n1,2\n", "t.csv:4"),
            ("time_s,speed_km_h\n5,0\n6,2\n", "times begin at 0 and rise"),
            ("time_s,speed_km_h\n0,0\ninf,2\n", "the time is inf s"),
        ] {
            let error = trace(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
