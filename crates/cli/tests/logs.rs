//! Logs and drives as files: whatever is read, and wherever it is written to.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use trace::{Cell, ColumnKind, TableWriter};

use crate::support::{EXPERIMENT, Folder, VEHICLE, refused, stderr, stdout, wetclutch};

const NAMES: &str = "time_s,engine_speed_rad_s,turbine_speed_rad_s,output_speed_rad_s,oncoming_current_a";

/// Runs an observer that needs no gains.
fn estimate(log: &str, more: &[&str]) -> Output {
    wetclutch(&[&["estimate", log, "--vehicle", VEHICLE, "--observer", "open-loop"], more].concat())
}

/// A log of this many rows, 10 ms apart.
fn log(rows: usize) -> String {
    let mut log = format!("{NAMES}\n");
    for i in 0..rows {
        writeln!(log, "{},200,190,76,0.1", i as f64 / 100.0).unwrap();
    }
    log
}

impl Folder {
    #[cfg(unix)]
    fn pipe(&self, name: &str) -> String {
        assert!(Command::new("mkfifo").arg(self.path(name)).status().unwrap().success());
        self.path(name)
    }
}

#[test]
fn a_log_that_is_wrong_is_refused_by_line_and_nothing_is_written() {
    let folder = Folder::new("wrong");
    let row = "200,190,76,0.1";
    let cases = [
        (String::new(), ": the file is empty"),
        (format!("{NAMES}\n"), ": there are no rows"),
        (
            format!("{NAMES}\n0,{row}\n0,{row}\n0,{row}\n"),
            ": 2 of 3 rows have the time of the row before and are not used\nhint: the time has too few digits",
        ),
        (
            format!("{NAMES}\n3,{row}\n2,{row}\n1,{row}\n"),
            ": 2 of 3 rows have a time before that of the row before and are not used\nhint: the rows are not in order of time: sort them",
        ),
        (
            "1.5,".repeat(9 << 20),
            ": line 1: the row that begins here is longer than 32 MiB\nhint: the file has no line breaks",
        ),
        (format!("{NAMES}\n0,{row}\ninf,{row}\n"), ":3: the time is inf"),
        (format!("{NAMES}\n0,{row}\n1,{row},\n"), ":3: the row has 6 cells, but the first line names 5 columns"),
        (
            format!("{NAMES}\n0,{row}\n0.1,200,n/a,76,0.1\n0.2,200,n/a,76,0.1\n"),
            ": 2 of 3 samples of turbine_speed_rad_s are text or infinite, and are not used\nhint: check this column",
        ),
        (
            format!("{NAMES}\n0,{row}\n0.1,200,\"1,076.5\",76,0.1\n0.2,200,1’076.5,76,0.1\n"),
            ": 2 of 3 samples of turbine_speed_rad_s are text or infinite, and are not used\nhint: write numbers without a sign between their",
        ),
        (format!("{}1,2\n", log(20_000)), ":20002: the row has 2 cells"),
        (
            format!("{NAMES},turbine_speed_rpm\n0,{row},1\n"),
            "columns 3 `turbine_speed_rad_s` and 6 `turbine_speed_rpm`",
        ),
        (NAMES.replace("oncoming_current_a", "current") + "\n0,1,1,1,1\n", "there is no column `oncoming_current_a`"),
    ];
    for (text, message) in cases {
        let path = folder.write("log.csv", text);
        let output = estimate(&path, &["-o", &folder.path("out.csv")]);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(stderr(&output).contains(message), "{message}: {}", stderr(&output));
        assert_eq!(folder.names(), ["log.csv"], "{message}");
    }
    assert_eq!(estimate(&folder.path(""), &[]).status.code(), Some(2), "a folder is no log");
}

#[test]
fn a_log_as_spreadsheets_and_loggers_write_it_gives_the_same_estimate() {
    let folder = Folder::new("dialects");
    let plain = log(5);
    let expected = estimate(&folder.write("plain.csv", &plain), &[]).stdout;
    assert_eq!(expected.iter().filter(|&&byte| byte == b'\n').count(), 6);
    let quoted: String = plain.lines().map(|line| format!("\"{}\"\n", line.replace(',', "\",\""))).collect();
    let dialects = [
        format!("\u{feff}{plain}"),
        plain.replace('\n', "\r\n"),
        plain.replace('\n', ",\n"),
        plain.replace('\n', ",a note\n").replacen("a note", "", 1),
        quoted,
        plain.replace(',', " , "),
        plain.replace("output_speed_rad_s", "Output_Speed_rad_s"),
    ];
    for text in dialects {
        let output = estimate(&folder.write("log.csv", &text), &[]);
        assert!(output.stdout == expected, "{text}: {}", stderr(&output));
    }
}

#[test]
fn numbers_that_cannot_be_readings_are_lost_samples() {
    let folder = Folder::new("numbers");
    let rows =
        ["0,200,190,76,0.1", "0.5,inf,190,76,0.1", "1,200,1e400,76,0.1", "1.5,200,190,NaN,0.1", "2.5,200,190,76,"];
    let output = estimate(&folder.write("log.csv", format!("{NAMES}\n{}\n", rows.join("\n"))), &[]);
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let at = text.lines().next().unwrap().split(',').position(|name| name == "health").unwrap();
    let health: Vec<&str> = text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap()).collect();
    // A command that stays away for a second is lost.
    assert_eq!(health, ["good", "good", "speeds_rejected", "speeds_rejected", "command_rejected"]);
    assert!(!text.contains("inf") && !text.contains("NaN"), "{text}");
    assert!(stderr(&output).contains("health: good 40.0 %, speeds_rejected 40.0 %, command_rejected 20.0 %"));
}

#[test]
fn an_estimate_ends_with_what_was_done() {
    let folder = Folder::new("summary");
    assert!(wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]).status.success());
    let (log, out) = (folder.path("drive/e1_measured.csv"), folder.path("out.csv"));
    let output = wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "-o", &out]);
    let said = stderr(&output);
    for line in ["rows: 9,501, from 0.000 to 9.500 s", "health: too_slow 11.1 %, good 88.9 %", "observer: gearbox"] {
        assert!(said.lines().any(|said| said.starts_with(line)), "{line}: {said}");
    }
    // The valve maps pass the kiss point when the load transfer begins that `simulate` names.
    assert!(said.contains("shifts: 1 (7.701 to 8.318 s)"), "{said}");
    let stem = out.strip_suffix(".csv").unwrap();
    let places = [
        format!("estimate: {out}"),
        format!("table of shifts: {stem}_shifts.csv, {stem}_shifts.json"),
        format!("report: {stem}_report.html"),
    ];
    assert_eq!(said.lines().rev().take(3).collect::<Vec<_>>(), [&*places[2], &places[1], &places[0]]);
    let is_row = |line: &str| line.split_whitespace().take(5).eq(["1", "1-2", "power-on", "upshift", "7.70"]);
    assert!(stdout(&output).lines().any(is_row), "{said}");
}

#[test]
fn a_log_is_not_replaced_by_its_own_estimate() {
    let folder = Folder::new("own");
    let text = log(200);
    let path = folder.write("log.csv", &text);
    let output = estimate(&path, &["-o", &path]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("the output would replace this input"), "{}", stderr(&output));
    assert_eq!(folder.read("log.csv"), text);
    assert_eq!(folder.names(), ["log.csv"]);
}

#[test]
fn a_log_without_a_command_in_most_rows_is_refused() {
    let folder = Folder::new("command");
    let cut = |kept: usize| {
        let rows = log(1000);
        let rows = rows.lines().enumerate();
        rows.map(|(row, line)| if row > kept { line.replace(",0.1", ",") + "\n" } else { format!("{line}\n") })
            .collect::<String>()
    };
    let path = folder.write("log.csv", cut(700));
    assert!(estimate(&path, &[]).status.success());
    let path = folder.write("log.csv", cut(300));
    let output = estimate(&path, &["-o", &folder.path("out.csv")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("of 1,000 samples have no command of the valve"), "{}", stderr(&output));
    assert_eq!(folder.names(), ["log.csv"]);
}

#[test]
fn a_file_that_no_estimate_wrote_is_neither_replaced_nor_removed() {
    let folder = Folder::new("foreign");
    let path = folder.write("log.csv", log(20));
    for name in ["out_report.html", "out_shifts.csv", "out_shifts.json"] {
        let mine = folder.write(name, "mine\n");
        let output = estimate(&path, &["-o", &folder.path("out.csv")]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains("no estimate wrote this file"), "{}", stderr(&output));
        assert_eq!(folder.read(name), "mine\n");
        std::fs::remove_file(mine).unwrap();
    }
    // A page of an earlier estimate is not of this log, which has no shift.
    folder.write("out_report.html", "<title>log.csv: estimate | wetclutch</title>");
    assert!(estimate(&path, &["-o", &folder.path("out.csv")]).status.success());
    assert_eq!(folder.names(), ["log.csv", "out.csv"]);
}

#[test]
fn an_existing_folder_takes_the_estimate_under_the_name_of_its_log() {
    let folder = Folder::new("target");
    let path = folder.write("log.csv", log(20));
    let expected = estimate(&path, &[]).stdout;
    std::fs::create_dir(folder.path("out")).unwrap();
    assert!(estimate(&path, &["-o", &folder.path("out")]).status.success());
    assert!(std::fs::read(folder.path("out/log.csv")).unwrap() == expected);
    // In its own folder the log would be lost.
    let output = estimate(&path, &["-o", &folder.path("")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("the output would replace this input"), "{}", stderr(&output));
    let output = estimate("-", &["-o", &folder.path("out")]);
    assert!(stderr(&output).contains("standard input: this is no file"), "{}", stderr(&output));
}

#[cfg(unix)]
#[test]
fn pipes_and_links_serve_on_both_sides() {
    use std::os::unix::fs::FileTypeExt;
    let folder = Folder::new("pipes");
    let plain = folder.write("log.csv", log(20_000));
    let expected = estimate(&plain, &[]).stdout;
    let (from, to, link) = (folder.pipe("from"), folder.pipe("to"), folder.path("link"));
    let feeder = std::thread::spawn({
        let (from, text) = (from.clone(), log(20_000));
        move || std::fs::write(from, text).unwrap()
    });
    let reader = std::thread::spawn({
        let to = to.clone();
        move || std::fs::read(to).unwrap()
    });
    let output = estimate(&from, &["-o", &to]);
    assert!(output.status.success(), "{}", stderr(&output));
    feeder.join().unwrap();
    assert!(reader.join().unwrap() == expected);
    assert!([&from, &to].iter().all(|path| std::fs::metadata(path).unwrap().file_type().is_fifo()));

    std::os::unix::fs::symlink("out.csv", &link).unwrap();
    assert!(estimate(&plain, &["-o", &link]).status.success());
    assert!(Path::new(&link).is_symlink() && std::fs::read(folder.path("out.csv")).unwrap() == expected);
}

#[cfg(unix)]
#[test]
fn what_a_killed_command_leaves_goes_with_the_next_and_a_running_one_keeps_its_own() {
    use std::io::Write as _;
    let folder = Folder::new("killed");
    let out = folder.path("out.csv");
    let partials = || folder.names().into_iter().filter(|name| name.ends_with(".partial")).collect::<Vec<_>>();
    // A command that waits for the rest of its log. Each has a pipe of its own: a process that another test starts may keep the writing end
    // of an earlier pipe for a moment, and its end would look like the end of the log.
    let begin = |pipe: &str| {
        let pipe = folder.pipe(pipe);
        let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
            .args(["estimate", &pipe, "--vehicle", VEHICLE, "--observer", "open-loop", "-o", &out])
            .stderr(std::fs::File::create(folder.path("said")).unwrap())
            .spawn()
            .unwrap();
        let mut feed = std::fs::OpenOptions::new().write(true).open(&pipe).unwrap();
        if let Err(error) = feed.write_all(log(20_000).as_bytes()) {
            panic!("{error}: {:?}: {}", child.wait(), folder.read("said"));
        }
        let own = format!("out.csv.{}.partial", child.id());
        while !partials().contains(&own) {
            std::thread::yield_now();
        }
        (child, feed, own)
    };
    let (mut killed, feed, dead) = begin("first");
    killed.kill().unwrap();
    killed.wait().unwrap();
    drop(feed);
    assert_eq!(partials(), [dead]);
    let (mut running, feed, own) = begin("second");
    assert_eq!(partials(), [own.as_str()], "the dead one went");
    assert!(estimate(&folder.write("log.csv", log(3)), &["-o", &out]).status.success());
    assert_eq!(partials(), [own], "the running one stays");
    drop(feed);
    assert!(running.wait().unwrap().success());
    assert_eq!(std::fs::read_to_string(&out).unwrap().lines().count(), 20_001);
    assert!(partials().is_empty());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_said_and_is_no_fault_of_the_input() {
    let folder = Folder::new("full");
    let path = folder.write("log.csv", log(20_000));
    let output = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["estimate", &path, "--vehicle", VEHICLE, "--observer", "open-loop"])
        .stdout(std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap())
        .stderr(Stdio::piped())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("No space left"), "{}", stderr(&output));
}

#[test]
fn an_experiments_name_stays_in_the_folder() {
    let folder = Folder::new("name");
    let text = std::fs::read_to_string(EXPERIMENT).unwrap().replace("../vehicles/two_speed_at.toml", VEHICLE);
    let line = 1 + text.lines().position(|line| line.starts_with("name = ")).unwrap();
    for name in ["../escaped", "/escaped", "a/b", "..", ".hidden", "", "a\\\\b", "c:x", "x\\n", &"x".repeat(81)] {
        let path = folder.write("e.toml", text.replacen("name = \"E1\"", &format!("name = \"{name}\""), 1));
        let output = wetclutch(&["simulate", &path, "-o", &folder.path("out")]);
        assert_eq!(output.status.code(), Some(2), "{name}");
        let said = stderr(&output);
        assert!(said.contains(&format!("e.toml:{line}: `name`: ")) && said.contains("hint: use letters"), "{said}");
        assert_eq!(folder.names(), ["e.toml"]);
    }
}

#[test]
fn a_drive_of_absurd_size_is_announced_before_it_is_written() {
    use std::io::{BufRead as _, BufReader};
    let folder = Folder::new("size");
    let text = std::fs::read_to_string(EXPERIMENT).unwrap().replace("../vehicles/two_speed_at.toml", VEHICLE);
    let text = text.replace("duration_s = 9.5", "duration_s = 600").replacen("= 0.001", "= 0.00001", 1);
    let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["simulate", &folder.write("e.toml", text), "-o", &folder.path("out")])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut said).unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(said, "600 s with a sample time of 0.00001 s are 60,000,000 rows, about 27 GB in two files\n");
}

#[test]
fn a_log_with_nothing_in_it_and_one_that_is_cut_are_refused() {
    let folder = Folder::new("nothing");
    let table = |name: &str, rows: u32| {
        let (path, columns) = (folder.path(name), [("a", ColumnKind::Number)]);
        let mut table = TableWriter::create(Path::new(&path), columns).unwrap();
        (0..rows).for_each(|row| table.row(f64::from(row), [Cell::Number(1.0)]).unwrap());
        table.finish().unwrap();
        path
    };
    let error = refused(&wetclutch(&["inspect", &table("none.mf4", 0)]));
    assert!(error.contains("none.mf4: there are no samples in it\nhint: check that the recorder"), "{error}");
    // Of another bus.
    let dbc = folder
        .write("other.dbc", "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\nBO_ 256 M: 8 A\n SG_ S : 0|16@1+ (1,0) [0|0] \"\" A\n");
    let frames = folder.write("frames.log", "(1.000000) can0 123#0102\n(1.010000) can0 124#0102\n");
    let error = refused(&wetclutch(&["inspect", &frames, "--dbc", &dbc]));
    assert!(
        error.contains("none of its frames is of a message of the DBC; 2 of 2 frames, of 2 identifiers, are not in the DBC: 0x123, 0x124\nhint: give"),
        "{error}"
    );
    let whole = std::fs::read(table("whole.parquet", 100)).unwrap();
    let cut = folder.write("cut.parquet", &whole[..whole.len() / 2]);
    let error = refused(&wetclutch(&["inspect", &cut]));
    let length = format!("the file of {} bytes begins as Parquet and does not end as one (", whole.len() / 2);
    assert!(error.contains(&length) && error.contains("\nhint: it is cut"), "{error}");
}
