//! The log of a day's drive with an eight-speed gearbox, as asammdf writes it, and tables that recorders leave with faults.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, stderr, wetclutch};

const DAY_LOG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/day_log.py");
/// The library that writes the log, in the version that the test was made with.
const ASAMMDF: &str = "asammdf==8.8.28";

/// Standard output and standard error of a command that must succeed.
fn said(output: &Output) -> [String; 2] {
    [printed(output), stderr(output)]
}

/// The simulated launch and upshift at 100 Hz.
fn shift_log(folder: &Folder) -> String {
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]));
    let text = folder.read("drive/e1_measured.csv");
    let row = |(i, line): (usize, &str)| (i == 0 || i % 10 == 1).then(|| format!("{line}\n"));
    text.lines().enumerate().filter_map(row).collect()
}

/// A Python with asammdf: that of `WETCLUTCH_PYTHON`, `python3`, or one that pip makes beside the build. None where there is no
/// pip or no network; where `CI` is set, that is an error.
fn python() -> Option<PathBuf> {
    let has = |python: &Path| {
        Command::new(python).args(["-c", "import asammdf"]).output().is_ok_and(|output| output.status.success())
    };
    let own = Path::new(env!("CARGO_TARGET_TMPDIR")).join("asammdf");
    let own_python = own.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    let named = std::env::var_os("WETCLUTCH_PYTHON").map(PathBuf::from);
    let known = named.into_iter().chain([PathBuf::from("python3"), own_python.clone()]);
    if let Some(python) = known.into_iter().find(|python| has(python)) {
        return Some(python);
    }
    let run = |program: &Path, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success())
    };
    let made = run(Path::new("python3"), &["-m", "venv", own.to_str().unwrap()])
        && run(&own_python, &["-m", "pip", "install", "--quiet", ASAMMDF]);
    if made && has(&own_python) {
        return Some(own_python);
    }
    assert!(std::env::var_os("CI").is_none(), "asammdf cannot be installed: `pip install {ASAMMDF}`");
    // Past the test runner, which keeps what a passing test prints.
    let skipped = format!("SKIPPED: no Python with asammdf (pip install {ASAMMDF}; WETCLUTCH_PYTHON names a Python)\n");
    std::io::stderr().write_all(skipped.as_bytes()).unwrap();
    None
}

/// `DAY_REPETITIONS=20` is the whole hour of the drive file, better in a release build.
#[test]
fn a_day_with_an_eight_speed_gearbox_gives_the_same_from_mdf_and_from_csv() {
    let Some(python) = python() else { return };
    let folder = Folder::new("city");
    let repetitions: u32 = std::env::var("DAY_REPETITIONS").map_or(2, |text| text.parse().unwrap());
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive = drive.replace("repetitions = 20", &format!("repetitions = {repetitions}"));
    let drive = drive.replace("sample_time_s = 0.01", "sample_time_s = 0.005");
    let drive = folder.write("city.toml", drive.replace("../vehicles", &format!("{ROOT}vehicles")));
    said(&wetclutch(&["simulate", &drive, "-o", &folder.path("")]));
    let made = Command::new(python).args([DAY_LOG, &folder.path("city_measured.csv"), &folder.path("log")]).output();
    said(&made.unwrap());

    let [suggested, _] = said(&wetclutch(&["inspect", &folder.path("log.mf4"), "--suggest"]));
    let gearbox = "ratios = [4.6957, 3.1304, 2.1039, 1.6667, 1.2845, 1.0, 0.8392, 0.6667]\noutput_rad_per_m = 10.0\n";
    let valves = "[channel.oncoming_current]\nname = \"I_E\"\n[channel.offgoing_current]\nname = \"I_C\"\n";
    let map = folder.write("map.toml", format!("{suggested}\n[gearbox]\n{gearbox}{valves}"));
    // The currents of the elements are found by their names.
    for name in 'A'..='E' {
        let table = format!("[channel.element_{}_current]\nname = \"I_{name}\"\n", name.to_ascii_lowercase());
        assert!(suggested.contains(&table), "{suggested}");
    }
    let of_elements = folder.write("elements.toml", &suggested);
    let eight_speed = format!("{ROOT}vehicles/eight_speed.toml");
    let car = folder.path("car.toml");
    let numbers = ["--mass-kg", "1500", "--wheel-radius-m", "0.3", "--final-ratio", "3", "--engine-torque-n-m", "190"];
    said(&wetclutch(&[&["init", "--ratios", "4.6957,3.1304", "-o", &car], &numbers[..]].concat()));

    let of = |ending: &str| {
        let log = folder.path(&format!("log.{ending}"));
        let [channels, _] = said(&wetclutch(&["inspect", &log]));
        // Groups have names in MDF only.
        let word =
            |line: &str| line.replace("TCU_fast", "").replace("TCU ", "").replace("Brakes", "").replace("Slow", "");
        let channels: Vec<Vec<String>> =
            (channels.lines().skip(2)).map(|line| word(line).split_whitespace().map(str::to_owned).collect()).collect();
        let shifts = said(&wetclutch(&["inspect", &log, "--map", &map, "--shifts"]));
        // Under one name, which stands in the files.
        let (out, fitted) = (folder.path("out.csv"), folder.path("fitted.toml"));
        let fit = wetclutch(&["fit", &log, "--map", &map, "--vehicle", &car, "-o", &fitted]);
        let fit = said(&fit).map(|text| text.replace(&log, "LOG"));
        let estimate = said(&wetclutch(&["estimate", &log, "--map", &map, "--vehicle", &car, "-o", &out]));
        // The car with its whole gearbox.
        let (whole, whole_fitted) = (folder.path("whole.csv"), folder.path("whole.toml"));
        let whole_fit =
            wetclutch(&["fit", &log, "--map", &of_elements, "--vehicle", &eight_speed, "-o", &whole_fitted]);
        let whole_fit = said(&whole_fit).map(|text| text.replace(&log, "LOG"));
        let vehicle = ["--vehicle", &whole_fitted];
        let estimated = wetclutch(&[&["estimate", &log, "--map", &of_elements, "-o", &whole], &vehicle[..]].concat());
        let estimate = (estimate, whole_fit, said(&estimated));
        let files = ["out.csv", "out_shifts.csv", "out_shifts.json", "fitted.toml", "whole.csv", "whole.toml"];
        let files = files.map(|name| folder.read(name).replace(&log, "LOG"));
        (channels, shifts, fit, estimate, files)
    };
    let (mdf, csv) = (of("mf4"), of("csv"));
    assert_eq!(mdf.0, csv.0);
    assert_eq!(mdf.1, csv.1);
    assert_eq!((&mdf.2, &mdf.3), (&csv.2, &csv.3));
    let (estimate, whole_fit, whole_estimate) = &mdf.3;
    // The simulated car is that of the file, and the fit does not take it for another.
    assert!(
        whole_fit[0].contains("shifts held out: ") && !whole_fit[0].contains("the shifts ask for"),
        "{whole_fit:?}"
    );
    assert!(whole_estimate[1].contains("whole_shifts.csv"), "{whole_estimate:?}");
    for (one, other) in mdf.4.iter().zip(&csv.4) {
        assert!(one == other, "the files differ");
    }

    // What a browser opens at once, however long the day was.
    let page = std::fs::metadata(folder.path("out_report.html")).unwrap().len();
    assert!(page < 5_000_000, "{page}");
    // Of the shifts of the simulated drive, all but those at walking speed are found by their ratio; no sample is called frozen.
    let found = mdf.1[0]
        .lines()
        .filter(|line| line.contains(" to ") && (line.contains("upshift") || line.contains("downshift")))
        .count();
    assert!(found >= 15 * repetitions as usize, "{}", mdf.1[0]);
    assert!(!estimate[1].contains("frozen"), "{}", estimate[1]);
    // In other gears there is no estimate, and what an observer meets there does not spoil the next shift: all of them are alike.
    assert!(estimate[1].contains("samples are in gears that the vehicle file does not describe"), "{}", estimate[1]);
    let shifts: Vec<Vec<String>> = mdf.4[1].lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
    let column = |name: &str| shifts[0].iter().position(|title| title == name).unwrap();
    let of_vehicle = column("of_vehicle");
    let [work, minimum, maximum] = ["friction_work_j", "friction_work_least_j", "friction_work_greatest_j"].map(column);
    let works: Vec<[f64; 3]> = (shifts[1..].iter().filter(|row| row[of_vehicle] == "yes"))
        .map(|row| [work, minimum, maximum].map(|at| row[at].parse().unwrap_or(f64::NAN)))
        .filter(|[work, ..]| !work.is_nan())
        .collect();
    assert!(works.len() as u32 >= repetitions, "{works:?}");
    // The simulated clutch takes 1149 J in each; the vehicle file has never seen this car. What the log lost of a shift, up to half a second of both
    // speeds, makes single values worse than the others, which the middle one does not feel.
    const TRUE_WORK_J: f64 = 1149.0;
    let mut values: Vec<f64> = works.iter().map(|[work, ..]| *work).collect();
    values.sort_by(f64::total_cmp);
    let middle = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
    assert!((middle / TRUE_WORK_J - 1.0).abs() < 0.1, "{values:?}");
    assert!(values.iter().all(|work| (750.0..1300.0).contains(work)), "{values:?}");
    assert!(works.iter().all(|[_, minimum, maximum]| (*minimum..=*maximum).contains(&TRUE_WORK_J)), "{works:?}");
}

#[test]
fn faults_of_time_stamps_in_a_table_are_counted_and_read_as_with_a_map() {
    let folder = Folder::new("times");
    let clean = shift_log(&folder);
    let lines: Vec<&str> = clean.lines().collect();
    let (mut text, mut resets) = (format!("{}\n", lines[0]), String::new());
    for (i, line) in lines.iter().enumerate().skip(1) {
        writeln!(text, "{line}").unwrap();
        let (time, rest) = line.split_once(',').unwrap();
        match i {
            // The same time again with other values, and rows that come too late.
            300 => writeln!(text, "{time},1,1,1,1,0.5,0.5,0").unwrap(),
            400 | 500 => writeln!(text, "{}", lines[i - 3]).unwrap(),
            _ => {}
        }
        let time: f64 = time.parse().unwrap();
        writeln!(resets, "{},{rest}", if i > 850 { time - 8.0 } else { time }).unwrap();
    }
    let columns = lines[0].split(',').count();
    let text = text.replace(",1,1,1,1,0.5,0.5,0\n", &format!("{}\n", ",1".repeat(columns - 1)));
    let estimate = |name: &str, text: &str, more: &[&str]| {
        let log = folder.write(name, text);
        said(&wetclutch(&[&["estimate", &log, "--vehicle", VEHICLE], more].concat()))
    };
    let [expected, _] = estimate("clean.csv", &clean, &[]);
    let [found, notes] = estimate("faulty.csv", &text, &[]);
    assert!(found == expected);
    let rows = lines.len() + 2;
    for note in [
        "1 of ROWS rows have the time of the row before and",
        "2 of ROWS rows have a time before that of the row before and",
    ] {
        assert!(notes.contains(&note.replace("ROWS", &rows.to_string())), "{notes}");
    }
    let map = folder.path("map.toml");
    std::fs::write(&map, wetclutch(&["inspect", &folder.path("faulty.csv"), "--suggest"]).stdout).unwrap();
    let [mapped, _] = estimate("faulty.csv", &text, &["--map", &map]);
    assert!(mapped == expected);

    // A clock that starts again.
    let [found, notes] = estimate("reset.csv", &format!("{}\n{resets}", lines[0]), &[]);
    assert!(notes.contains("the clock was reset 1 times: the time continues one second later"), "{notes}");
    let last = |text: &str| text.lines().last().unwrap().split(',').next().unwrap().parse::<f64>().unwrap();
    // Twenty rows tell the reset.
    assert!((last(&found) - (last(&expected) + 1.0 - 0.21)).abs() < 1e-6, "{} {}", last(&found), last(&expected));
    let [mapped, _] = estimate("reset.csv", &format!("{}\n{resets}", lines[0]), &["--map", &map]);
    assert!(mapped == found);

    // One time stamp that is far too late. What comes after it is not lost for that, and the shift is estimated.
    let far: String = (lines.iter().enumerate())
        .map(|(i, line)| match line.split_once(',') {
            Some((_, rest)) if i == 300 => format!("1000000,{rest}\n"),
            _ => format!("{line}\n"),
        })
        .collect();
    let [found, notes] = estimate("far.csv", &far, &[]);
    assert!(notes.contains("1 time stamps are far too late") && notes.contains("shifts: 1 ("), "{notes}");
    assert!(!notes.contains("not in the command"), "{notes}");
    let [mapped, _] = estimate("far.csv", &far, &["--map", &map]);
    assert!(mapped == found && mapped.lines().count() == lines.len() - 20);
}

/// A table with rows every 10 ms of speeds that come every 20 ms: a logger repeats them, or leaves the cells empty.
#[test]
fn a_speed_that_a_table_holds_counts_once() {
    let folder = Folder::new("held");
    let clean = shift_log(&folder);
    let with_turbine = |other_rows: fn(&str) -> &str| {
        let names = clean.lines().next().unwrap();
        let at = names.split(',').position(|name| name == "turbine_speed_rad_s").unwrap();
        let mut newest = String::new();
        let row = |(i, line): (usize, &str)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if i % 2 == 0 {
                newest.clone_from(&cells[at]);
            } else {
                cells[at] = other_rows(&newest).to_owned();
            }
            cells.join(",") + "\n"
        };
        format!("{names}\n{}", clean.lines().skip(1).enumerate().map(row).collect::<String>())
    };
    let logs = [("held.csv", with_turbine(|newest| newest)), ("empty.csv", with_turbine(|_| ""))];
    let map = folder.path("map.toml");
    std::fs::write(&map, wetclutch(&["inspect", &folder.write("clean.csv", &clean), "--suggest"]).stdout).unwrap();
    for more in [&[][..], &["--map", &map]] {
        let [held, empty] = logs.each_ref().map(|(name, text)| {
            let log = folder.write(name, text);
            said(&wetclutch(&[&["estimate", &log, "--vehicle", VEHICLE], more].concat()))
        });
        let said = if more.is_empty() { "readings of turbine_speed are those of a row before, held" } else { " held" };
        assert!(held[1].contains(said), "{}", held[1]);
        // In the first tenths of a second it is not yet known.
        let moving = |text: &str| -> Vec<String> {
            let late = |line: &&str| line.split(',').next().unwrap().parse().is_ok_and(|time: f64| time > 5.0);
            text.lines().filter(late).map(str::to_owned).collect()
        };
        let pressures = |text: &str| -> Vec<f64> {
            moving(text).iter().map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect()
        };
        assert_eq!(moving(&held[0]).len(), moving(&empty[0]).len());
        let off = pressures(&held[0]).iter().zip(pressures(&empty[0])).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 500.0, "{off} Pa");
    }
}

/// The drive with one column changed.
fn changed(drive: &str, column: &str, change: impl Fn(f64) -> f64) -> String {
    let names = drive.lines().next().unwrap();
    let at = names.split(',').position(|name| name == column).unwrap();
    let row = |line: &str| {
        let cells = line.split(',').enumerate().map(|(i, cell)| match i == at {
            true => change(cell.parse().unwrap()).to_string(),
            false => cell.to_owned(),
        });
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    format!("{names}\n{}", drive.lines().skip(1).map(row).collect::<String>())
}

#[test]
fn a_channel_that_cannot_be_the_signal_is_an_error() {
    let folder = Folder::new("channels");
    let drive = shift_log(&folder);
    let map = folder.path("map.toml");
    for (column, value) in [("turbine_speed_rad_s", 190.0), ("output_speed_rad_s", 70.0), ("wheel_speed_rad_s", 25.0)] {
        let log = folder.write("log.csv", changed(&drive, column, |_| value));
        let out = folder.path("out.csv");
        let text = refused(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "-o", &out]));
        let name = column.trim_end_matches("_rad_s");
        assert!(text.contains(&format!("{name} is {value:.3} rad/s in all samples, and ")), "{text}");
        assert!(text.contains("hint: its column may have another signal") && !Path::new(&out).exists(), "{text}");
        std::fs::write(&map, wetclutch(&["inspect", &log, "--suggest"]).stdout).unwrap();
        refused(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "-o", &out, "--map", &map]));
    }
    for (column, factor) in [("turbine_speed_rad_s", 1.5), ("output_speed_rad_s", 0.7), ("wheel_speed_rad_s", 1.4)] {
        let log = folder.write("log.csv", changed(&drive, column, |value| factor * value));
        let text = refused(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "-o", &folder.path("out.csv")]));
        assert!(text.contains("hint: ") && text.contains("scale"), "{column}: {text}");
    }
}
