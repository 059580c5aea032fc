//! Logs and uses that once gave a wrong result in silence.

use std::fmt::Write as _;
use std::process::{Command, Stdio};

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, stderr, wetclutch};

/// The rows of a simulated drive at 100 Hz, names first.
fn rows(folder: &Folder) -> Vec<Vec<String>> {
    let places = printed(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]));
    let path = places.lines().find(|line| line.contains("measured")).unwrap();
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let names = lines.next().unwrap();
    std::iter::once(names).chain(lines.step_by(10)).collect()
}

fn text(rows: &[Vec<String>], delimiter: &str) -> String {
    rows.iter().fold(String::new(), |mut text, row| {
        writeln!(text, "{}", row.join(delimiter)).unwrap();
        text
    })
}

fn estimate(log: &str, more: &[&str]) -> std::process::Output {
    wetclutch(&[&["estimate", log, "--vehicle", VEHICLE], more].concat())
}

#[test]
fn a_speed_that_stops_is_found_in_a_table_without_a_map() {
    let folder = Folder::new("frozen");
    let good = rows(&folder);
    let frozen = |column: usize, from_s: f64, to_s: f64| {
        let mut rows = good.clone();
        let time = |row: &Vec<String>| row[0].parse::<f64>().unwrap_or(-1.0);
        let held = rows.iter().find(|row| time(row) >= from_s).unwrap()[column].clone();
        rows.iter_mut().filter(|row| (from_s..to_s).contains(&time(row))).for_each(|row| row[column] = held.clone());
        folder.write("log.csv", text(&rows, ","))
    };
    let clean = said(&estimate(&folder.write("log.csv", text(&good, ",")), &["-o", &folder.path("out.csv")]));
    assert!(!clean.contains("stand still"), "{clean}");
    for (name, column) in [("engine", 1), ("turbine", 2), ("output", 3), ("wheel", 4)] {
        assert!(good[0][column].starts_with(name));
        let text = said(&estimate(&frozen(column, 4.0, 7.0), &["-o", &folder.path("out.csv")]));
        let note = format!("readings of {name}_speed do not change while the car moves, and are not used");
        assert!(text.contains(&note), "{name}: {text}");
        // Of 300 equal readings the first is right; the others are withdrawn when it is known that they stand.
        let count: f64 =
            text.split(&format!(" of 951 {note}")).next().unwrap().rsplit(' ').next().unwrap().parse().unwrap();
        assert!((250.0..=299.0).contains(&count), "{name}: {count}");
        // No reading is a reason for the health; the range does not trust the frozen speed any more.
        assert!(!text.contains("health: good 100.0 %") || name == "engine", "{name}: {text}");
        // A log goes on without output and wheel speed.
        let output = estimate(&frozen(column, 4.0, 10.0), &["-o", &folder.path("out.csv")]);
        if ["engine", "turbine"].contains(&name) {
            let text = refused(&output);
            assert!(text.contains(&format!("hint: check the sensor of {name}_speed")), "{text}");
        } else {
            assert!(said(&output).contains(&note), "{name}");
        }
    }
}

#[test]
fn an_output_that_cannot_be_is_answered() {
    let folder = Folder::new("outputs");
    let log = folder.write("log.csv", text(&rows(&folder), ","));
    let out = |name: &str| folder.path(name);
    let cases: [(&[&str], &str); 5] = [
        (
            &["-o", &out("x.xlsx")],
            "no table is written as .xlsx\nhint: estimates are CSV (.csv), Parquet (.parquet) or MDF (.mf4)",
        ),
        (&["-o", "-"], "-o -: standard output is where an estimate goes without -o\nhint: leave -o out"),
        (&["-o", &out("x.csv"), "--format", "parquet"], "the name is not that of a file in --format parquet"),
        (&["-o", &out("x.mf4"), "--format", "csv"], "the name is not that of a file in --format csv"),
        (&["--format", "mf4"], "--format mf4 needs a file"),
    ];
    for (options, message) in cases {
        let text = refused(&estimate(&log, options));
        assert!(text.contains(message), "{options:?}: {text}");
    }
    for name in ["x.csv", "x.txt", "x.parquet", "x", "y.csv"] {
        let text = said(&estimate(&log, &["-o", &out(name)]));
        assert!(text.contains(&format!("estimate: {}", out(name))), "{text}");
    }
    said(&estimate(&log, &["-o", &out("z.parquet"), "--format", "parquet"]));
}

#[test]
fn a_time_in_milliseconds_another_delimiter_and_a_missing_wheel_speed_get_a_hint() {
    let folder = Folder::new("hints");
    let good = rows(&folder);
    let mut late = good.clone();
    late.iter_mut().skip(1).for_each(|row| row[0] = format!("{}", 1000.0 * row[0].parse::<f64>().unwrap()));
    let text_of = |output| refused(&output);
    let said = text_of(estimate(&folder.write("ms.csv", text(&late, ",")), &[]));
    assert!(
        said.contains("the middle time between two rows is 10 s") && said.contains("hint: if the time is in ms"),
        "{said}"
    );
    let said = text_of(estimate(&folder.write("semicolon.csv", text(&good, ";")), &[]));
    assert!(said.contains("separated by `;`") && said.contains("--map map.toml"), "{said}");
    let without: Vec<Vec<String>> = good
        .iter()
        .map(|row| row.iter().enumerate().filter(|(i, _)| *i != 4).map(|(_, cell)| cell.clone()).collect())
        .collect();
    let sensors = format!("{ROOT}experiments/bench.toml");
    let output = estimate(&folder.write("no_wheel.csv", text(&without, ",")), &["--sensors", &sensors]);
    let said = crate::support::said(&output);
    assert!(said.contains("observer: gearbox, because the log has no wheel_speed_rad_s"), "{said}");
}

#[test]
fn a_last_line_without_an_end_is_not_used_silently() {
    let folder = Folder::new("cut");
    let whole = text(&rows(&folder), ",");
    let cut = |bytes: usize| {
        let log = folder.write("log.csv", &whole[..whole.len() - bytes]);
        said(&estimate(&log, &["-o", &folder.path("out.csv")]))
    };
    assert!(!cut(0).contains("has no end"));
    let within_last_cell = cut(2);
    assert!(
        within_last_cell.contains("rows: 951,") && within_last_cell.contains("the last line has no end"),
        "{within_last_cell}"
    );
    let within_first_cells = cut(60);
    assert!(
        within_first_cells.contains("rows: 950,") && within_first_cells.contains("the last line has no end"),
        "{within_first_cells}"
    );
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_does_not_cost_the_files() {
    let folder = Folder::new("closed");
    let gearbox = format!("{ROOT}gearboxes/8hp.toml");
    let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["check", &gearbox, "-o", &folder.path("figures")])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    assert!(std::path::Path::new(&folder.path("figures/train.svg")).exists());
}

/// An estimate that waits for the rest of its log, with its unfinished file, and what it reads.
#[cfg(unix)]
fn waiting(folder: &Folder, before: &[&str]) -> (std::process::Child, std::process::ChildStdin) {
    use std::io::Write as _;
    let program = env!("CARGO_BIN_EXE_wetclutch");
    let out = folder.path("out.csv");
    let arguments = ["estimate", "-", "--vehicle", VEHICLE, "--observer", "open-loop", "-o", &out];
    let all = [before, &[program], &arguments].concat();
    let mut child = Command::new(all[0])
        .args(&all[1..])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut feed = child.stdin.take().unwrap();
    // More rows than are looked at before the first estimate.
    let log = text(&rows(folder), ",");
    let (names, rows) = log.split_once('\n').unwrap();
    writeln!(feed, "{names}").unwrap();
    for repeat in 0..12 {
        for row in rows.lines() {
            let (time, rest) = row.split_once(',').unwrap();
            writeln!(feed, "{},{rest}", time.parse::<f64>().unwrap() + 9.51 * f64::from(repeat)).unwrap();
        }
    }
    feed.flush().unwrap();
    for _ in 0..500 {
        if is_unfinished(folder) {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(is_unfinished(folder));
    (child, feed)
}

#[cfg(unix)]
fn is_unfinished(folder: &Folder) -> bool {
    folder.names().iter().any(|name| name.ends_with(".partial"))
}

#[cfg(unix)]
fn send(signal: &str, child: &std::process::Child) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

/// The signals that this process, and so a child of it, ignores.
#[cfg(target_os = "linux")]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    u64::from_str_radix(mask.trim(), 16).unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn a_signal_leaves_no_unfinished_file() {
    use std::os::unix::process::ExitStatusExt;
    let folder = Folder::new("signal");
    for (signal, number) in [("-HUP", 1), ("-INT", 2), ("-QUIT", 3), ("-TERM", 15)] {
        // A test that is run in the background or by `nohup` ignores some of them.
        if ignored() >> (number - 1) & 1 == 1 && number != 2 {
            continue;
        }
        let (mut child, feed) = waiting(&folder, &[]);
        send(signal, &child);
        assert_eq!(child.wait().unwrap().signal(), Some(number));
        drop(feed);
        assert!(!is_unfinished(&folder), "{signal}: {:?}", folder.names());
    }
}

/// `nohup` starts a program that ignores SIGHUP, to go on when its terminal ends.
#[cfg(target_os = "linux")]
#[test]
fn a_program_that_was_started_to_ignore_the_end_of_its_terminal_goes_on() {
    let folder = Folder::new("nohup");
    let (mut child, feed) = waiting(&folder, &["nohup"]);
    send("-HUP", &child);
    drop(feed);
    assert!(child.wait().unwrap().success());
    assert!(folder.names().contains(&"out.csv".to_owned()) && !is_unfinished(&folder), "{:?}", folder.names());
}
