//! Estimates of logs with many shifts: shift by shift, in other formats, several at a time, and while they are written.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::support::{EXPERIMENT, Folder, VEHICLE, refused, said, stderr, wetclutch};

fn estimate(log: &str, more: &[&str]) -> Output {
    wetclutch(&[&["estimate", log, "--vehicle", VEHICLE], more].concat())
}

impl Folder {
    /// The simulated launch and upshift at 100 Hz, so many times, each 12 s after the one before, with true values; cells of
    /// a column are multiplied.
    fn drives(&self, name: &str, count: u32, wrong: Option<(&str, f64)>) -> String {
        let drive = self.path("drive");
        if !Path::new(&drive).exists() {
            said(&wetclutch(&["simulate", EXPERIMENT, "-o", &drive]));
        }
        let text = self.read("drive/e1.csv");
        let names = text.lines().next().unwrap();
        let column = wrong.map(|(wrong, factor)| (names.split(',').position(|name| name == wrong).unwrap(), factor));
        let mut log = format!("{names}\n");
        for repeat in 0..count {
            for row in text.lines().skip(1).step_by(10) {
                let cells = row.split(',').enumerate().map(|(i, cell)| match (i, column) {
                    (0, _) => format!("{:.2}", cell.parse::<f64>().unwrap() + 12.0 * f64::from(repeat)),
                    (_, Some((at, factor))) if at == i => format!("{}", cell.parse::<f64>().unwrap() * factor),
                    _ => cell.to_owned(),
                });
                writeln!(log, "{}", cells.collect::<Vec<_>>().join(",")).unwrap();
            }
        }
        self.write(name, &log)
    }
}

/// The rows of a table as maps from its names.
fn rows(text: &str) -> Vec<HashMap<String, String>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| names.iter().map(|&name| name.to_owned()).zip(line.split(',').map(str::to_owned)).collect();
    lines.map(row).collect()
}

#[test]
fn a_reading_that_is_refused_is_not_in_the_quality_of_a_shift() {
    let folder = Folder::new("refused-readings");
    let log = folder.drives("log.csv", 1, None);
    said(&estimate(&log, &["-o", &folder.path("out.csv")]));
    let good = rows(&folder.read("out_shifts.csv"));
    let text = folder.read("log.csv");
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    // One reading in the inertia phase.
    for name in ["turbine_speed_rad_s", "output_speed_rad_s", "engine_speed_rad_s", "wheel_speed_rad_s"] {
        let at = names.iter().position(|other| *other == name).unwrap();
        for spike in ["1e300", "-1e300", "3000"] {
            let row = |line: &str| {
                let spoilt = |(i, cell): (usize, &str)| if i == at { spike.to_owned() } else { cell.to_owned() };
                match line.starts_with("8.10,") {
                    true => line.split(',').enumerate().map(spoilt).collect::<Vec<_>>().join(","),
                    false => line.to_owned(),
                }
            };
            let spoilt = text.lines().map(row).collect::<Vec<_>>().join("\n") + "\n";
            assert_ne!(spoilt, text);
            let spoilt = folder.write("spoilt.csv", spoilt);
            said(&estimate(&spoilt, &["-o", &folder.path("spoilt_out.csv")]));
            let found = rows(&folder.read("spoilt_out_shifts.csv"));
            assert_eq!(found.len(), 1);
            for column in ["friction_work_j", "flare_rad_s", "jerk_m_s3", "oncoming_torque_mean_n_m"] {
                let number =
                    |row: &std::collections::HashMap<String, String>| row[column].parse::<f64>().unwrap_or(0.0);
                let (found, good) = (number(&found[0]), number(&good[0]));
                // Ten milliseconds of a shift of half a second are not seen.
                assert!((found - good).abs() <= 0.05 * good.abs() + 0.5, "{name} {spike} {column}: {found} for {good}");
            }
        }
    }
}

#[test]
fn every_shift_has_its_estimate_quality_and_error() {
    let folder = Folder::new("shifts");
    let log = folder.drives("log.csv", 3, None);
    let text = said(&estimate(&log, &["-o", &folder.path("out.csv")]));
    assert!(text.contains("shifts: 3 (7.710 to 8.320 s, 19.710 to 20.320 s, 31.710 to 32.320 s)"), "{text}");
    let shifts = rows(&folder.read("out_shifts.csv"));
    let estimates = rows(&folder.read("out.csv"));
    let truth = rows(&folder.read("log.csv"));
    assert_eq!(shifts.len(), 3);
    for (i, shift) in shifts.iter().enumerate() {
        let number = |name: &str| shift[name].parse::<f64>().unwrap_or_else(|_| panic!("{name}: {}", shift[name]));
        assert_eq!((shift["number"].as_str(), shift["from_gear"].as_str()), (&*(i + 1).to_string(), "1"));
        let [begin_s, lock_up_s] = ["torque_phase_begin_s", "lock_up_s"].map(number);
        assert!((begin_s - 12.0 * i as f64 - 7.71).abs() < 0.02 && (lock_up_s - begin_s - 0.62).abs() < 0.02);
        // The same from the tables themselves.
        let (mut squares, mut count, mut work_j) = (0.0, 0_u32, 0.0);
        for (estimate, truth) in estimates.iter().zip(&truth) {
            let value = |row: &std::collections::HashMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
            let time_s = value(truth, "time_s");
            if (begin_s..lock_up_s - 0.001).contains(&time_s) {
                let error = value(truth, "oncoming_pressure_pa") - value(estimate, "oncoming_pressure_estimate_pa");
                squares += error * error;
                count += 1;
                work_j += 0.01 * value(truth, "oncoming_torque_n_m") * value(truth, "oncoming_slip_rad_s");
            }
        }
        let rms = (squares / f64::from(count)).sqrt();
        assert!((number("pressure_error_rms_pa") / rms - 1.0).abs() < 1e-9, "{rms}");
        assert!((number("friction_work_j") / work_j - 1.0).abs() < 0.06, "{work_j}");
        assert!(number("friction_work_least_j") < work_j && work_j < number("friction_work_greatest_j"));
        assert_eq!(number("pressure_inside_range"), 1.0);
        // The true minimum shaft torque of this shift is 293 N m.
        assert!((250.0..350.0).contains(&number("least_shaft_torque_n_m")));
    }
    let json: Vec<serde_json::Value> = serde_json::from_str(&folder.read("out_shifts.json")).unwrap();
    assert_eq!(json[2]["friction_work_j"].to_string(), shifts[2]["friction_work_j"]);
    assert!(json[0]["command_s"].is_null());
    let page = folder.read("out_report.html");
    assert!(!page.contains("src=") && !page.contains("http-equiv") && page.matches("<noscript><svg").count() == 4);
    assert!(page.contains("id=\"shift3\"") && page.contains("href=\"#shift3\""));
}

#[test]
fn chosen_shifts_have_only_their_rows_and_a_choice_that_fits_none_is_refused() {
    let folder = Folder::new("choice");
    let log = folder.drives("log.csv", 3, None);
    said(&estimate(&log, &["--shift", "2", "-o", &folder.path("two.csv")]));
    let times: Vec<f64> = rows(&folder.read("two.csv")).iter().map(|row| row["time_s"].parse().unwrap()).collect();
    assert!(times.iter().all(|time_s| (18.0..22.0).contains(time_s)) && times.len() > 100, "{times:?}");
    assert_eq!(rows(&folder.read("two_shifts.csv"))[0]["number"], "2");
    said(&estimate(&log, &["--shifts", "1-2", "-o", &folder.path("all.csv")]));
    assert_eq!(rows(&folder.read("all_shifts.csv")).len(), 3);
    for (more, hint) in [
        (["--shift", "4"], "it has 3, in this order: 1-2, 1-2, 1-2"),
        (["--shifts", "2-1"], "it has 3"),
        (["--shifts", "2-1,1-2"], "it has 3"),
    ] {
        let text = refused(&estimate(&log, &[&more[..], &["-o", &folder.path("none.csv")]].concat()));
        assert!(text.contains("the log has no such shift") && text.contains(hint), "{text}");
        assert!(!Path::new(&folder.path("none.csv")).exists());
    }
    for wrong in [["--shift", "0"], ["--shifts", "1"], ["--shifts", "1-1"], ["--columns", "pressure"]] {
        refused(&estimate(&log, &wrong));
    }
}

#[test]
fn columns_come_in_the_order_that_is_asked_for() {
    let folder = Folder::new("columns");
    let log = folder.drives("log.csv", 1, None);
    let output = estimate(&log, &["--columns", "health,oncoming_pressure_estimate_pa"]);
    said(&output);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.starts_with("time_s,health,oncoming_pressure_estimate_pa\n0,too_slow,0\n"), "{}", &text[..200]);
    let refusal = |columns: &str| refused(&estimate(&log, &["--columns", columns]));
    assert!(refusal("health,health").contains("--columns: `health` is given twice\nhint: name each column once"));
    assert!(
        refusal("oncoming_duty_percent")
            .contains("there is no column `oncoming_duty_percent`\nhint: did you mean `oncoming_")
    );
}

#[test]
fn an_estimate_has_the_readings_that_are_asked_for() {
    let folder = Folder::new("readings");
    let log = folder.drives("log.csv", 1, None);
    let measured = ["turbine_speed_rad_s", "wheel_speed_rad_s", "oncoming_current_a"];
    let columns = format!("{},health", measured.join(","));
    let of_log: Vec<_> = rows(&folder.read("log.csv"));
    // The whole log twice, of which the second estimate replaces the first, then a shift alone.
    for more in [&[][..], &[], &["--shift", "1"]] {
        said(&estimate(&log, &[&["--columns", &columns, "-o", &folder.path("with.csv")], more].concat()));
        let with = rows(&folder.read("with.csv"));
        let number = |row: &HashMap<String, String>, name: &str| row[name].parse::<f64>().unwrap();
        let start = of_log.iter().position(|row| number(row, "time_s") == number(&with[0], "time_s")).unwrap();
        assert!(with.len() > 100 && (!more.is_empty() || with.len() == of_log.len()));
        for (row, of_log) in with.iter().zip(&of_log[start..]) {
            assert!(measured.iter().all(|name| number(row, name) == number(of_log, name)), "{row:?} {of_log:?}");
        }
    }
}

#[test]
fn estimates_in_other_formats_hold_the_same_numbers() {
    let folder = Folder::new("formats");
    let log = folder.drives("log.csv", 1, None);
    said(&estimate(&log, &["-o", &folder.path("out.csv")]));
    let expected = wetclutch(&["inspect", &folder.path("out.csv")]);
    let channels = |output: &Output| -> Vec<String> {
        let text = String::from_utf8(output.stdout.clone()).unwrap();
        let is_number = |line: &&str| ["_pa ", "_n_m "].iter().any(|ending| line.contains(ending));
        // Name, minimum and maximum value; in MDF an absent value is one that is not a number.
        let cells = |line: &str| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let end = words.len() - if words.ends_with(&["missing"]) { 2 } else { 0 };
            [words[0], words[end - 2], words[end - 1]].join(" ")
        };
        text.lines().filter(is_number).map(cells).collect()
    };
    assert_eq!(channels(&expected).len(), 9);
    for name in ["out.parquet", "out.mf4"] {
        said(&estimate(&log, &["-o", &folder.path(name)]));
        let read = wetclutch(&["inspect", &folder.path(name)]);
        said(&read);
        assert_eq!(channels(&read), channels(&expected), "{name}");
    }
    #[cfg(unix)]
    {
        let pipe = folder.path("pipe.mf4");
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::read(pipe).unwrap()
        });
        let output = estimate(&log, &["-o", &pipe]);
        assert!(stderr(&output).contains("MDF cannot be written to a pipe"), "{}", stderr(&output));
        reader.join().unwrap();
    }
}

#[test]
fn a_signal_in_another_unit_than_its_name_says_is_an_error_with_the_likely_one() {
    let folder = Folder::new("units");
    let rpm = 30.0 / std::f64::consts::PI;
    let cases = [
        ("engine_speed_rad_s", rpm, "call it `engine_speed_rpm`"),
        ("turbine_speed_rad_s", rpm, "call it `turbine_speed_rpm`"),
        ("output_speed_rad_s", rpm, "call it `output_speed_rpm`"),
        ("wheel_speed_rad_s", rpm, "call it `wheel_speed_rpm`"),
        ("oncoming_current_a", 1000.0, "call it `oncoming_current_ma`"),
        ("output_speed_rad_s", -1.0, "its sign is the other way round"),
        ("engine_speed_rad_s", -1.0, "engine_speed is negative: an engine does not turn backwards"),
        ("oncoming_current_a", -1.0, "oncoming_current is never positive: its sign is the other way round"),
    ];
    let map = folder.path("map.toml");
    for (column, factor, hint) in cases {
        let log = folder.drives("log.csv", 1, Some((column, factor)));
        let out = folder.path("out.csv");
        let text = refused(&estimate(&log, &["-o", &out]));
        assert!(text.contains(hint), "{column}: {text}");
        assert!(!Path::new(&out).exists(), "{column}");
        std::fs::write(&map, wetclutch(&["inspect", &log, "--suggest"]).stdout).unwrap();
        let text = refused(&estimate(&log, &["-o", &out, "--map", &map]));
        assert!(text.contains("\nhint: set `channel."), "{column}: {text}");
    }
    // Most readings of a channel are no speeds, for no reason of units.
    let text = folder.read("drive/e1.csv");
    let broken = |(i, line): (usize, &str)| {
        let cells: Vec<&str> = line.split(',').collect();
        let engine = if i % 3 > 0 { "inf" } else { cells[1] };
        [&[cells[0], engine], &cells[2..]].concat().join(",") + "\n"
    };
    let log = folder.write("log.csv", text.lines().enumerate().map(broken).collect::<String>());
    let text = refused(&estimate(&log, &["-o", &folder.path("out.csv")]));
    assert!(text.contains("samples of engine_speed_rad_s are text or infinite, and are not used"), "{text}");
    assert!(!Path::new(&folder.path("out.csv")).exists());
}

#[test]
fn swapped_speeds_of_a_two_speed_car_are_said() {
    let folder = Folder::new("swapped");
    let log = folder.drives("log.csv", 1, None);
    assert!(!said(&estimate(&log, &["-o", &folder.path("out.csv")])).contains("warning"));
    let text = folder.read("log.csv").replacen("engine_speed_rad_s", "x", 1);
    let text =
        text.replacen("turbine_speed_rad_s", "engine_speed_rad_s", 1).replacen(",x,", ",turbine_speed_rad_s,", 1);
    let log = folder.write("swapped.csv", text);
    let said = said(&estimate(&log, &["-o", &folder.path("out.csv")]));
    assert!(said.contains("warning: engine_speed and turbine_speed may be swapped"), "{said}");
    assert!(said.contains("warning: turbine and output speed contradict the ratios of the vehicle file"), "{said}");
}

#[test]
fn a_shift_without_its_command_is_said() {
    let folder = Folder::new("command");
    let log = folder.drives("log.csv", 1, Some(("oncoming_current_a", 0.001)));
    let text = said(&estimate(&log, &["-o", &folder.path("out.csv")]));
    assert!(text.contains("1 shifts of the vehicle file are in the speeds and not in the estimate"), "{text}");
    assert!(rows(&folder.read("out_shifts.csv"))[0]["friction_work_j"].is_empty());
}

#[test]
fn several_logs_give_a_file_each_and_one_that_fails_does_not_stop_the_others() {
    let folder = Folder::new("several");
    let good = folder.drives("good.csv", 1, None);
    let other = folder.drives("other.csv", 2, None);
    let bad = folder.write("bad.csv", "time_s,x\n0,1\n");
    let out = folder.path("out");
    let several =
        |logs: &[&str], more: &[&str]| wetclutch(&[&["estimate"], logs, &["--vehicle", VEHICLE], more].concat());
    let output = several(&[&good, &bad, &other, "no-such.csv"], &["-o", &out]);
    let text = refused(&output);
    assert!(text.contains(&format!("2 of 4 logs have no estimate: {bad}, no-such.csv")), "{text}");
    for name in ["good", "other"] {
        said(&estimate(&folder.path(&format!("{name}.csv")), &["-o", &folder.path("alone.csv")]));
        assert!(folder.read(&format!("out/{name}.csv")) == folder.read("alone.csv"), "{name}");
    }
    assert!(!Path::new(&format!("{out}/bad.csv")).exists() && Path::new(&format!("{out}/other_report.html")).exists());
    said(&several(&[&good, &other], &["-o", &out, "--format", "mf4", "--threads", "1"]));
    assert!(Path::new(&format!("{out}/good.mf4")).exists());
    assert!(refused(&several(&[&good, &other], &[])).contains("several logs need a folder"));
    assert!(refused(&several(&[&good, &good], &["-o", &out])).contains("would both give"));
    let beside = folder.path("");
    assert!(refused(&several(&[&good, &other], &["-o", &beside])).contains("the output would replace this input"));
}

#[test]
fn no_output_replaces_an_input_or_another_output() {
    let folder = Folder::new("replaced");
    let (log, table) = (folder.drives("a.csv", 1, None), folder.drives("a_shifts.csv", 1, None));
    let map = folder.write("map.toml", "");
    let replaced = "the output would replace this input";
    assert!(refused(&estimate(&log, &["--map", &map, "-o", &map])).contains(replaced));
    assert!(refused(&estimate(&table, &["-o", &folder.path("a.csv")])).contains(replaced));
    let both = wetclutch(&["estimate", &log, &table, "--vehicle", VEHICLE, "-o", &folder.path("out")]);
    assert!(refused(&both).contains("would both give"));
    let fitted = wetclutch(&["fit", &log, "--vehicle", VEHICLE, "--map", &map, "-o", &map]);
    assert!(refused(&fitted).contains(replaced));
}

#[test]
fn an_estimate_without_a_shift_leaves_no_shifts_of_an_earlier_one() {
    let folder = Folder::new("earlier");
    let log = folder.drives("log.csv", 1, None);
    let output = folder.path("out.csv");
    said(&estimate(&log, &["-o", &output]));
    assert!(Path::new(&folder.path("out_shifts.csv")).exists());
    let rest: String = folder.read("log.csv").lines().take(200).map(|line| format!("{line}\n")).collect();
    let text = said(&estimate(&folder.write("rest.csv", rest), &["-o", &output]));
    assert!(text.contains("of an earlier estimate"), "{text}");
    for name in ["out_shifts.csv", "out_shifts.json", "out_report.html"] {
        assert!(!Path::new(&folder.path(name)).exists(), "{name}");
    }
}

#[test]
fn a_log_is_followed_through_a_pipe_to_its_end() {
    let folder = Folder::new("pipe");
    let log = folder.drives("log.csv", 1, None);
    let expected = estimate(&log, &[]).stdout;
    let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["estimate", "-", "--follow", "--vehicle", VEHICLE])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut feed = child.stdin.take().unwrap();
    let text = folder.read("log.csv");
    let feeder = std::thread::spawn(move || {
        // Pieces that end within a line.
        for piece in text.as_bytes().chunks(997) {
            feed.write_all(piece).unwrap();
        }
    });
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap();
    assert!(output.status.success() && output.stdout == expected);
    let mdf = folder.path("out.mf4");
    said(&estimate(&log, &["-o", &mdf]));
    let channel = "oncoming_current=oncoming_pressure_estimate_pa [A]";
    let text = refused(&estimate(&mdf, &["--follow", "--channel", channel]));
    assert!(text.contains("cannot be followed"), "{text}");
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_a_followed_file_with_all_its_whole_rows() {
    use std::io::{BufRead, BufReader};
    let folder = Folder::new("interrupt");
    folder.drives("log.csv", 1, None);
    let text = folder.read("log.csv");
    let (begin, rest) = text.split_at(text.len() / 2);
    let growing = folder.write("growing.csv", begin);
    let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["estimate", &growing, "--follow", "--vehicle", VEHICLE])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut rows = BufReader::new(child.stdout.take().unwrap()).lines();
    let first_half = begin.lines().count() - 1;
    for _ in 0..first_half {
        rows.next().unwrap().unwrap();
    }
    // What is written later comes too, but for a line that has no end.
    let mut file = std::fs::OpenOptions::new().append(true).open(&growing).unwrap();
    file.write_all(rest.trim_end().as_bytes()).unwrap();
    let all = text.lines().count() - 1;
    for _ in first_half..all {
        rows.next().unwrap().unwrap();
    }
    let interrupt = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(interrupt.success());
    assert!(rows.next().is_none());
    let output = child.wait_with_output().unwrap();
    assert!(said(&output).contains("rows: 950, from 0.000 to 9.490 s"), "{}", stderr(&output));
}
