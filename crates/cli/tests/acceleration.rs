//! Logs of cars with a gearbox that have a longitudinal acceleration.

use crate::any_car::numbers;
use crate::support::{Folder, ROOT, said, wetclutch};

const COLUMN: &str = "longitudinal_acceleration_m_s2";
const READING: &str = "longitudinal_acceleration_reading";

/// A drive in town whose car has this accelerometer: its log. Its folder has the sensors, as `sensors.toml`, and the truth.
fn drive(folder: &Folder, accelerometer: &str) -> String {
    let bench = std::fs::read_to_string(format!("{ROOT}experiments/bench.toml")).unwrap();
    let sensors = &bench[bench.find("[sensors]").unwrap()..bench.find("# The observers").unwrap()];
    let sensors = format!("{sensors}\n[sensors.acceleration]\n{accelerometer}\n");
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive = drive.replacen("repetitions = 20", "repetitions = 1", 1);
    folder.write("sensors.toml", &sensors);
    let drive = folder.write("city.toml", drive + &sensors);
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car(), "-o", &folder.path("sim")]));
    folder.path("sim/city_measured.csv")
}

fn car() -> String {
    format!("{ROOT}vehicles/eight_speed.toml")
}

/// What the estimate of a log says, and the words of a column of it.
fn estimate(folder: &Folder, log: &str, more: &[&str]) -> (String, Vec<String>) {
    let out = folder.path("out.csv");
    let found = said(&wetclutch(&[&["estimate", log, "--vehicle", &car(), "-o", &out][..], more].concat()));
    let text = folder.read("out.csv");
    let mut lines = text.lines();
    let at = lines.next().unwrap().split(',').position(|name| name == READING);
    let words = at.map_or(Vec::new(), |at| lines.map(|row| row.split(',').nth(at).unwrap().to_owned()).collect());
    (found, words)
}

/// RMS error of the torque of the oncoming clutch, N m.
fn error_n_m(folder: &Folder) -> f64 {
    let [truth, estimate] = [("sim/city.csv", "oncoming_torque_n_m"), ("out.csv", "oncoming_torque_estimate_n_m")]
        .map(|(file, name)| numbers(&folder.read(file), name));
    let errors = truth.iter().zip(&estimate).map(|(truth, estimate)| estimate - truth).filter(|error| !error.is_nan());
    let (sum, count) = errors.fold((0.0, 0_u32), |(sum, count), error| (sum + error * error, count + 1));
    assert!(count > 300);
    (sum / f64::from(count)).sqrt()
}

/// The column of the log with each value changed, and with another name.
fn changed(folder: &Folder, log: &str, name: &str, change: impl Fn(usize, f64) -> String) -> String {
    let text = std::fs::read_to_string(log).unwrap();
    let mut lines = text.lines();
    let head = lines.next().unwrap();
    let at = head.split(',').position(|of| of == COLUMN).unwrap();
    let mut out = head.replace(COLUMN, name) + "\n";
    for (row, line) in lines.enumerate() {
        let cells: Vec<String> = line
            .split(',')
            .enumerate()
            .map(|(column, cell)| match cell.parse::<f64>() {
                Ok(value) if column == at => change(row, value),
                _ => cell.to_owned(),
            })
            .collect();
        out += &(cells.join(",") + "\n");
    }
    folder.write("changed.csv", &out)
}

#[test]
fn a_log_with_an_accelerometer() {
    let folder = Folder::new("acceleration");
    let log = drive(&folder, "bias_m_s2 = 0.3");
    let (found, words) = estimate(&folder, &log, &[]);
    let used = words.iter().filter(|word| *word == "good").count();
    assert!(2 * used > words.len() && !found.contains("longitudinal"), "{used} of {}: {found}", words.len());
    // Before the readings have followed the torque they are not taken.
    assert_eq!(words[0], "absent");
    let sensors = folder.path("sensors.toml");
    let (_, stated) = estimate(&folder, &log, &["--sensors", &sensors]);
    assert_eq!(stated[0], "good");
    let with = error_n_m(&folder);
    let empty = changed(&folder, &log, COLUMN, |_, _| String::new());
    let (found, words) = estimate(&folder, &empty, &["--sensors", &sensors]);
    assert!(words.iter().all(|word| word == "unused") && !found.contains("longitudinal"), "{found}");
    println!("{with} N m, {} without", error_n_m(&folder));
    assert!(with < 1.05 * error_n_m(&folder));
    let reversed = changed(&folder, &log, COLUMN, |_, value| format!("{}", -value));
    let (found, words) = estimate(&folder, &reversed, &[]);
    assert!(found.contains("longitudinal_acceleration is not used: most of its readings do not follow"), "{found}");
    assert!(words.iter().all(|word| word != "good"));
    let stands = changed(&folder, &log, COLUMN, |_, _| "0.0".to_owned());
    assert!(estimate(&folder, &stands, &[]).0.contains("longitudinal_acceleration is not used: most of its readings"));
    // A channel that ends, and one wrong reading after a pause, which ends nothing.
    let half = words.len() / 2;
    let ends = changed(&folder, &log, COLUMN, |row, value| if row < half { value.to_string() } else { String::new() });
    assert!(estimate(&folder, &ends, &[]).0.contains("longitudinal_acceleration has no usable reading from "));
    let pause = changed(&folder, &log, COLUMN, |row, value| match row {
        6000..8500 | 8501..8600 => String::new(),
        8500 => "14.0".to_owned(),
        _ => value.to_string(),
    });
    let (found, words) = estimate(&folder, &pause, &[]);
    let refused = words[9000..].iter().filter(|word| *word == "refused").count();
    assert!(refused < 20 && !found.contains("longitudinal"), "{refused} refused: {found}");
    let without = changed(&folder, &log, "other", |_, value| value.to_string());
    let (_, words) = estimate(&folder, &without, &["--columns", READING]);
    assert!(!words.is_empty() && words.iter().all(|word| word == "unused"));
    // A log with a single shift.
    let text = std::fs::read_to_string(&log).unwrap();
    let short: String = text.lines().take(950).map(|line| format!("{line}\n")).collect();
    let (found, words) = estimate(&folder, &folder.write("short.csv", &short), &[]);
    assert!(found.contains("does not change enough in a gear"), "{found}");
    assert!(words.iter().all(|word| word == "absent"));
}

#[test]
fn an_accelerometer_that_is_late_is_found_and_can_be_stated() {
    let folder = Folder::new("late-acceleration");
    let log = drive(&folder, "delay_s = 0.03");
    let (found, _) = estimate(&folder, &log, &[]);
    let found_ms = found
        .split("longitudinal_acceleration comes later than is stated, by ")
        .nth(1)
        .and_then(|rest| rest.split(" ms").next()?.parse().ok());
    assert!(found_ms.is_some_and(|ms: f64| (10.0..32.0).contains(&ms)), "{found}");
    let sensors = folder.path("sensors.toml");
    assert!(!estimate(&folder, &log, &["--sensors", &sensors]).0.contains("longitudinal"));
    // The channel map does the same.
    let header = std::fs::read_to_string(&log).unwrap().lines().next().unwrap().to_owned();
    let channel = |name: &str| {
        let more = if name == COLUMN { "delay_s = 0.03\n" } else { "" };
        let key = name
            .rsplit_once("_rad_s")
            .or_else(|| name.rsplit_once("_current_a").map(|(of, _)| (of, "")))
            .map_or(name, |(of, _)| of);
        let key = match name {
            COLUMN => "longitudinal_acceleration".to_owned(),
            _ if name.ends_with("_current_a") => format!("{key}_current"),
            "reported_engine_torque_n_m" => "engine_torque".to_owned(),
            _ => key.to_owned(),
        };
        format!("[channel.{key}]\nname = \"{name}\"\n{more}")
    };
    let mapped = header.split(',').filter(|name| {
        name.ends_with("_speed_rad_s")
            || name.starts_with("element_")
            || ["gear", "target_gear", "lock_up_applied", "reported_engine_torque_n_m", COLUMN].contains(name)
    });
    let map = folder.write("map.toml", mapped.map(channel).collect::<String>());
    let (found, words) = estimate(&folder, &log, &["--map", &map]);
    assert!(words.iter().any(|word| word == "good") && !found.contains("longitudinal_acceleration comes"), "{found}");
}
