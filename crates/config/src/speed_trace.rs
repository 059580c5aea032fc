//! Speeds over time that a driver follows: a file of two columns.

use car::SpeedTrace;

use crate::check::Check;
use crate::{ConfigError, Source};

/// Highest speed, m/s.
const FASTEST_M_S: f64 = 100.0;
/// Columns of speeds, each with its unit in m/s.
const SPEEDS: [(&str, f64); 3] = [("speed_m_s", 1.0), ("speed_km_h", 1.0 / 3.6), ("speed_mph", 1609.344 / 3600.0)];

/// Reads a file: a head with `time_s` and one of `speed_m_s`, `speed_km_h` and `speed_mph`, then the points. What follows a
/// `#` is a comment.
///
/// # Errors
/// The first line that is wrong.
pub(crate) fn of_source(source: &Source, grade_rad: f64) -> Result<SpeedTrace, ConfigError> {
    let check = Check::of(source);
    let wrong = |at: usize, message: String, hint: &str| {
        Err(check.meaning("time_s, speed", at, message, (!hint.is_empty()).then(|| hint.to_owned())))
    };
    const HEAD: &str = "the first line is \"time_s,speed_km_h\" (or speed_m_s, speed_mph), then one point in each line";
    let mut unit_m_s = None;
    let mut points: Vec<(f64, f64)> = Vec::new();
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
            return wrong(
                begin,
                format!("\"{text}\" is not two numbers"),
                "write time and speed with decimal points, such as 12.5,48.2",
            );
        };
        let speed_m_s = unit * speed;
        if !(0.0..=FASTEST_M_S).contains(&speed_m_s) {
            return wrong(
                begin,
                format!("the speed is {speed_m_s:.1} m/s, expected 0 to {FASTEST_M_S}"),
                "check the unit in the first line: speed_km_h, speed_m_s or speed_mph",
            );
        }
        let follows = points.last().map_or(time_s == 0.0, |(before, _)| time_s > *before && time_s < 1e9);
        if !follows {
            return wrong(begin, format!("the time is {time_s} s"), "times begin at 0 and rise, in s");
        }
        points.push((time_s, speed_m_s));
    }
    // The times were checked above: what is left is their number.
    SpeedTrace::new(points, grade_rad)
        .map_or_else(|| wrong(0, "the file has fewer than two points".to_owned(), HEAD), Ok)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(text: &str) -> Result<SpeedTrace, String> {
        of_source(&Source::built_in("t.csv", text), 0.0).map_err(|error| error.to_string())
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
            ("time_s,speed_km_h\n0,0\n1,-3\n", "the speed is -0.8 m/s, expected 0 to "),
            ("time_s,speed_m_s\n0,0\n1,120\n", "the speed is 120.0 m/s"),
            ("time_s,speed_km_h\n0,0\n1,1\n1,2\n", "t.csv:4"),
            ("time_s,speed_km_h\n5,0\n6,2\n", "times begin at 0 and rise, in s"),
            ("time_s,speed_km_h\n0,0\ninf,2\n", "the time is inf s"),
        ] {
            let error = trace(text).unwrap_err();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
