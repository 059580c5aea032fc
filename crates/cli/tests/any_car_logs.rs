//! Logs of cars with any gearbox: sensors, formats, maps, choices of shifts, several logs, pipes.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use trace::{Cell, ColumnKind, CsvRows, TableWriter};

use crate::any_car::column;
use crate::support::{BENCH, Folder, ROOT, printed, refused, said, wetclutch};

/// The toothed wheels of the bench, with a current sensor.
fn sensors() -> String {
    let bench = std::fs::read_to_string(BENCH).unwrap();
    let begin = bench.find("[sensors]").unwrap();
    let end = bench.find("# The observers, all at 100 Hz.").unwrap();
    bench[begin..end].to_owned()
}

fn vehicle(name: &str) -> String {
    format!("{ROOT}vehicles/{name}.toml")
}

/// A folder with a drive of the eight-speed car in town through sensors: an hour, or three minutes in a debug build, which is too
/// slow for more.
fn town(name: &str) -> Folder {
    let folder = Folder::new(name);
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let repetitions = if cfg!(debug_assertions) { "repetitions = 1" } else { "repetitions = 20" };
    let drive = drive.replace("repetitions = 20", repetitions).replace("vehicle = ", "# vehicle = ");
    let drive = folder.write("drive.toml", drive + &sensors());
    said(&wetclutch(&["simulate", &drive, "--vehicle", &vehicle("eight_speed"), "-o", &folder.path("sim")]));
    folder
}

fn estimate(folder: &Folder, log: &str, output: &str, more: &[&str]) -> std::process::Output {
    let (log, car, output) = (folder.path(log), vehicle("eight_speed"), folder.path(output));
    wetclutch(&[&["estimate", &log, "--vehicle", &car, "-o", &output], more].concat())
}

/// Writes a log in another format, with other names and sizes of its columns where `renamed` says so; gears become numbers, words
/// are left out.
fn convert(from: &str, to: &str, renamed: impl Fn(&str) -> (String, f64)) {
    let names: Vec<String> =
        std::fs::read_to_string(from).unwrap().lines().next().unwrap().split(',').skip(1).map(str::to_owned).collect();
    let is_word = |name: &str| ["shift_stage", "offgoing", "oncoming"].contains(&name);
    let names: Vec<String> = names.into_iter().filter(|name| !is_word(name)).collect();
    let mut rows = CsvRows::open(Path::new(from)).unwrap();
    let places: Vec<usize> = names.iter().map(|name| rows.find(name).unwrap()).collect();
    let others: Vec<(String, f64)> = names.iter().map(|name| renamed(name)).collect();
    let columns = others.iter().map(|(name, _)| (name.as_str(), ColumnKind::Number));
    let mut table = TableWriter::create(Path::new(to), columns).unwrap();
    while rows.advance().unwrap() {
        let cells =
            places.iter().zip(&others).map(|(place, (_, size))| Cell::Number(size * rows.number(*place).unwrap()));
        table.row(rows.time_s(), cells).unwrap();
    }
    table.finish().unwrap();
}

fn same(name: &str) -> (String, f64) {
    (name.to_owned(), 1.0)
}

#[test]
fn a_drive_through_sensors_is_estimated_alike_from_every_format() {
    let folder = town("any-formats");
    let (whole, measured) = (folder.read("sim/city.csv"), folder.read("sim/city_measured.csv"));
    assert_eq!(whole.lines().count(), measured.lines().count());
    // Beside the gears nothing that is measured is exact.
    let cells = |text: &str, name: &str| -> Vec<f64> {
        let at = text.lines().next().unwrap().split(',').position(|other| other == name).unwrap();
        text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN)).collect()
    };
    for name in ["turbine_speed_rad_s", "wheel_speed_rad_s", "element_a_current_a"] {
        let (truth, read) = (cells(&whole, name), cells(&measured, name));
        let off: Vec<f64> = truth.iter().zip(&read).map(|(truth, read)| (truth - read).abs()).collect();
        assert!(off.iter().filter(|off| **off > 0.0).count() > off.len() / 2, "{name}");
        let maximum = if name.contains("current") { 0.02 } else { 15.0 };
        assert!(off.iter().all(|off| *off < maximum), "{name} {:?}", off.iter().copied().fold(0.0, f64::max));
    }
    said(&estimate(&folder, "sim/city_measured.csv", "csv.csv", &[]));
    let csv = folder.read("csv.csv");
    assert!(csv.lines().count() > 10_000 && folder.read("csv_shifts.csv").lines().count() > 15);
    let from = folder.path("sim/city_measured.csv");
    for ending in ["mf4", "parquet"] {
        convert(&from, &folder.path(&format!("log.{ending}")), same);
        said(&estimate(&folder, &format!("log.{ending}"), "out.csv", &[]));
        assert!(folder.read("out.csv") == csv, "{ending}");
        assert!(folder.read("out_shifts.csv") == folder.read("csv_shifts.csv"), "{ending}");
    }
    // Estimates go into other formats, too.
    for ending in ["mf4", "parquet"] {
        let out = folder.path("folder");
        std::fs::create_dir_all(&out).unwrap();
        said(&estimate(&folder, "sim/city_measured.csv", "folder", &["--format", ending]));
        assert!(std::fs::metadata(folder.path(&format!("folder/city_measured.{ending}"))).unwrap().len() > 10_000);
    }
}

/// A map for the names of [`foreign`].
fn foreign_map(without: &str) -> String {
    let entries = [
        ("engine_speed", "N_Eng", "unit = \"rpm\""),
        ("turbine_speed", "N_Turb", "unit = \"rpm\""),
        ("output_speed", "N_Out", "unit = \"rpm\""),
        ("wheel_speed", "wheel_speed_rad_s", "unit = \"rad/s\""),
        ("engine_torque", "reported_engine_torque_n_m", "unit = \"N m\""),
        ("gear", "gear", ""),
        ("target_gear", "target_gear", ""),
        ("lock_up_applied", "lock_up_applied", ""),
        ("element_a_current", "I_A", "unit = \"mA\""),
        ("element_b_current", "element_b_current_a", "unit = \"A\""),
        ("element_c_current", "element_c_current_a", "unit = \"A\""),
        ("element_d_current", "element_d_current_a", "unit = \"A\""),
        ("element_e_current", "element_e_current_a", "unit = \"A\""),
    ];
    let kept = entries.iter().filter(|(role, ..)| *role != without);
    kept.map(|(role, name, unit)| format!("[channel.{role}]\nname = \"{name}\"\n{unit}\n")).collect()
}

/// Names and units of a foreign log.
fn foreign(name: &str) -> (String, f64) {
    let rpm = 30.0 / std::f64::consts::PI;
    match name {
        "engine_speed_rad_s" => ("N_Eng".to_owned(), rpm),
        "turbine_speed_rad_s" => ("N_Turb".to_owned(), rpm),
        "output_speed_rad_s" => ("N_Out".to_owned(), rpm),
        "element_a_current_a" => ("I_A".to_owned(), 1e3),
        other => same(other),
    }
}

fn torques(text: &str) -> Vec<f64> {
    let at = text.lines().next().unwrap().split(',').position(|name| name == "oncoming_torque_estimate_n_m").unwrap();
    text.lines().skip(1).filter_map(|line| line.split(',').nth(at).unwrap().parse().ok()).collect()
}

#[test]
fn a_delay_in_the_channel_map_is_a_delay_of_the_sensor() {
    let folder = town("any-delay");
    convert(&folder.path("sim/city_measured.csv"), &folder.path("foreign.mf4"), foreign);
    let on_time = folder.write("on_time.toml", sensors());
    let late = folder.write("late.toml", sensors().replace("delay_s = 0.0", "delay_s = 0.02"));
    let mut map = foreign_map("");
    let stated = folder.write("map.toml", &map);
    for speed in ["engine", "turbine", "output", "wheel"] {
        let channel = format!("[channel.{speed}_speed]\n");
        assert!(map.contains(&channel), "{map}");
        map = map.replace(&channel, &format!("{channel}delay_s = 0.02\n"));
    }
    let delayed = folder.write("delayed.toml", &map);
    for (output, map, sensors) in
        [("sensors.csv", &stated, &late), ("map.csv", &delayed, &on_time), ("none.csv", &stated, &on_time)]
    {
        said(&estimate(&folder, "foreign.mf4", output, &["--map", map, "--sensors", sensors]));
    }
    assert!(folder.read("map.csv") == folder.read("sensors.csv"));
    assert!(folder.read("map.csv") != folder.read("none.csv"));
    // A speed of a second ago is none: it is not extrapolated.
    let old = folder.write(
        "old.toml",
        map.replace("[channel.wheel_speed]\ndelay_s = 0.02", "[channel.wheel_speed]\ndelay_s = 1.0"),
    );
    said(&estimate(&folder, "foreign.mf4", "old.csv", &["--map", &old, "--sensors", &on_time]));
    assert!(column(&folder.read("old.csv"), "wheel_reading").iter().all(|reading| reading != "good"));
}

#[test]
fn a_channel_map_and_a_choice_of_shifts_work_for_any_gearbox() {
    let folder = town("any-maps");
    said(&estimate(&folder, "sim/city_measured.csv", "csv.csv", &[]));
    convert(&folder.path("sim/city_measured.csv"), &folder.path("foreign.mf4"), foreign);
    let map = folder.write("map.toml", foreign_map(""));
    said(&estimate(&folder, "foreign.mf4", "mapped.csv", &["--map", &map]));
    let (csv, mapped) = (torques(&folder.read("csv.csv")), torques(&folder.read("mapped.csv")));
    assert!(csv.len() == mapped.len() && csv.len() > 1000, "{} {}", csv.len(), mapped.len());
    // Units that are changed twice differ in their last digits.
    assert!(csv.iter().zip(&mapped).all(|(a, b)| (a - b).abs() < 1e-3 * a.abs().max(1.0)));
    // The command of one element by an option, and missing.
    let without = folder.write("without.toml", foreign_map("element_a_current"));
    let option = ["--map", &without, "--channel", "element_a_current=I_A [mA]"];
    said(&estimate(&folder, "foreign.mf4", "option.csv", &option));
    assert!(folder.read("option.csv") == folder.read("mapped.csv"));
    let missing = said(&estimate(&folder, "foreign.mf4", "without.csv", &["--map", &without]));
    assert!(
        missing.contains("warning: the log has no command of A: torques there are by the speeds alone"),
        "{missing}"
    );
    let unknown =
        refused(&estimate(&folder, "foreign.mf4", "no.csv", &["--map", &map, "--channel", "element_z_current=I_A"]));
    assert!(unknown.contains("element_z_current, which is no clutch or brake of this gearbox"), "{unknown}");
    let duty =
        refused(&estimate(&folder, "foreign.mf4", "no.csv", &["--map", &map, "--channel", "element_a_duty=I_A"]));
    assert!(duty.contains("hint: it is element_a_current, in A"), "{duty}");
    let names = refused(&estimate(&folder, "foreign.mf4", "no.csv", &[]));
    assert!(names.contains("this log needs a channel map"), "{names}");
    let no_goal = |name: &str| (if name == "target_gear" { "goal" } else { name }.to_owned(), 1.0);
    convert(&folder.path("sim/city_measured.csv"), &folder.path("goal.mf4"), no_goal);
    let target = refused(&estimate(&folder, "goal.mf4", "no.csv", &[]));
    assert!(target.contains("none with numbers is `target_gear`"), "{target}");
    // Rows of the chosen shifts alone.
    let all = folder.read("csv_shifts.csv");
    let ups = all.lines().filter(|line| line.contains(",1,2,")).count();
    said(&estimate(&folder, "sim/city_measured.csv", "ups.csv", &["--shifts", "1-2"]));
    let chosen = folder.read("ups_shifts.csv");
    assert_eq!(chosen.lines().count(), ups + 1, "{chosen}");
    let whole = folder.read("csv.csv");
    let rows = folder.read("ups.csv");
    assert!(rows.lines().all(|line| whole.contains(line)) && rows.lines().count() < whole.lines().count() / 2);
    said(&estimate(&folder, "foreign.mf4", "second.csv", &["--map", &map, "--shift", "2"]));
    assert_eq!(folder.read("second_shifts.csv").lines().count(), 2);
    let none = refused(&estimate(&folder, "sim/city_measured.csv", "no.csv", &["--shifts", "1-8"]));
    assert!(none.contains("--shifts 1-8: the log has no such shift\nhint: it has"), "{none}");
    let none = refused(&estimate(&folder, "sim/city_measured.csv", "no.csv", &["--shift", "999999"]));
    assert!(none.contains("--shift 999999: the log has no such shift"), "{none}");
    assert!(!folder.names().iter().any(|name| name.starts_with("no")), "{:?}", folder.names());
}

#[test]
fn several_logs_and_a_pipe_work_for_any_gearbox() {
    let folder = town("any-several");
    said(&estimate(&folder, "sim/city_measured.csv", "one.csv", &[]));
    let text = folder.read("sim/city_measured.csv");
    for name in ["a.csv", "b.csv"] {
        folder.write(name, &text);
    }
    folder.write("broken.csv", text.replacen("target_gear", "goal", 1));
    let (car, out) = (vehicle("eight_speed"), folder.path("out"));
    let logs = ["a.csv", "b.csv", "broken.csv"].map(|name| folder.path(name));
    let output = wetclutch(&["estimate", &logs[0], &logs[1], &logs[2], "--vehicle", &car, "-o", &out]);
    let error = refused(&output);
    assert!(error.contains("1 of 3 logs have no estimate") && error.contains("target_gear"), "{error}");
    for name in ["out/a.csv", "out/b.csv"] {
        assert!(folder.read(name) == folder.read("one.csv"), "{name}");
    }
    assert!(folder.read("out/a_shifts.csv") == folder.read("one_shifts.csv"));
    // A log that is written while it is read.
    let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["estimate", "-", "--follow", "--vehicle", &car])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let begun = text.lines().take(2000).collect::<Vec<_>>().join("\n") + "\n";
    let writer = std::thread::spawn(move || stdin.write_all(begun.as_bytes()));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let followed = String::from_utf8(output.stdout).unwrap();
    let one = folder.read("one.csv");
    assert_eq!(followed.lines().count(), 2000);
    assert!(followed.lines().eq(one.lines().take(2000)));
}

#[test]
fn the_measured_signals_of_an_experiment_go_through_its_sensors_and_those_of_its_scenario() {
    let folder = Folder::new("scenario-sensors");
    let run = |name: &str, more: &[&str]| {
        let out = folder.path(name);
        said(&wetclutch(&[&["simulate", BENCH, "-o", &out], more].concat()));
    };
    run("none", &[]);
    let exact = folder.read("none/bench.csv");
    let read = folder.read("none/bench_measured.csv");
    // The bus has 100 Hz, the truth 1 kHz.
    assert!(read.lines().count() < exact.lines().count() / 8, "{}", read.lines().count());
    assert!(!read.lines().next().unwrap().contains("pressure"));
    let bench = std::fs::read_to_string(BENCH).unwrap();
    let with = bench.clone() + "\n[[scenario]]\nname = \"worn tyre\"\n[scenario.sensors.wheel]\nscale = 1.02\n";
    let with = with.replace("vehicle = \"../vehicles", &format!("vehicle = \"{ROOT}vehicles"));
    let file = folder.write("with.toml", with);
    said(&wetclutch(&["simulate", &file, "--scenario", "worn tyre", "-o", &folder.path("worn")]));
    let names =
        std::fs::read_dir(folder.path("worn")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let name = names.into_iter().find(|name| name.ends_with("_measured.csv")).unwrap();
    let worn = folder.read(&format!("worn/{name}"));
    let column = |text: &str, name: &str| -> Vec<f64> {
        let at = text.lines().next().unwrap().split(',').position(|other| other == name).unwrap();
        text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect()
    };
    let (before, after) = (column(&read, "wheel_speed_rad_s"), column(&worn, "wheel_speed_rad_s"));
    let fast = before.iter().zip(&after).filter(|(before, _)| **before > 5.0);
    assert!(fast.clone().count() > 100 && fast.clone().all(|(before, after)| (after / before - 1.02).abs() < 0.01));
    assert!(column(&read, "turbine_speed_rad_s") == column(&worn, "turbine_speed_rad_s"));
}

#[test]
fn a_study_of_drawn_cars_is_resumed_and_merged_to_the_same_rows() {
    let folder = Folder::new("car-study");
    let text = format!(
        "name = \"shifts\"\ntitle = \"Shifts\"\nvehicle = \"{ROOT}vehicles/four_speed.toml\"\nshifts = [\"1-2\", \"2-1\"]\nruns = 3\nseed = 3\n"
    );
    let file = folder.write("study.toml", &text);
    let run = |out: &str, more: &[&str]| wetclutch(&[&["study", &file, "-o", &folder.path(out)], more].concat());
    let whole = printed(&run("whole", &["--threads", "2"]));
    assert!(whole.contains("3 cars, 12 shifts, 0 cars failed") && whole.contains("power-on upshift"), "{whole}");
    let rows = folder.read("whole/runs.csv");
    assert_eq!(rows.lines().count(), 4);
    // The same, killed in its second row.
    let cut = rows.match_indices('\n').nth(1).unwrap().0 + 100;
    std::fs::create_dir_all(folder.path("cut")).unwrap();
    folder.write("cut/study.json", folder.read("whole/study.json"));
    folder.write("cut/runs.csv.partial", &rows[..cut]);
    let again = refused(&run("cut", &[]));
    assert!(again.contains("use --resume to complete it"), "{again}");
    assert_eq!(printed(&run("cut", &["--resume"])).replace("/cut/", "/whole/"), whole);
    assert!(folder.read("cut/runs.csv") == rows);
    for shard in ["1/2", "2/2"] {
        printed(&run(&shard.replace('/', "of"), &["--shard", shard]));
    }
    let (one, two, merged) = (folder.path("1of2"), folder.path("2of2"), folder.path("merged"));
    printed(&wetclutch(&["merge", &file, &one, &two, "-o", &merged]));
    assert!(folder.read("merged/runs.csv") == rows);
    // Cars without differences are better known than drawn ones.
    let exact = folder.write("exact.toml", text + "[errors]\nfriction = 0\nvalve_gain = 0\nconverter = 0\n");
    printed(&wetclutch(&["study", &exact, "-o", &folder.path("exact")]));
    let column = |text: &str, name: &str| -> f64 {
        let at = text.lines().next().unwrap().split(',').position(|other| other == name).unwrap();
        let cells = text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse::<f64>().unwrap().powi(2));
        cells.sum::<f64>()
    };
    let open_loop = "power_on_upshift.gain_from_0.inertia_phase.controlling.torque_open_loop_rms_n_m";
    assert!(column(&folder.read("exact/runs.csv"), open_loop) < 0.25 * column(&rows, open_loop));
    for (wrong, words) in [
        ("shifts = [\"1-9\"]", "`1-9` is no shift of the gearbox"),
        ("shifts = \"all\"", "hint: \"neighbouring\""),
        ("shifts = []", "there is no shift"),
        ("", "expected either `drive` or `shifts`"),
    ] {
        let text = folder.read("study.toml").replace("shifts = [\"1-2\", \"2-1\"]", wrong);
        let error = refused(&wetclutch(&["study", &folder.write("wrong.toml", text), "-o", &folder.path("no")]));
        assert!(error.contains(words), "{words}: {error}");
    }
    assert!(printed(&wetclutch(&["check", &file])).contains("study shifts \"Shifts\": 3 cars, each 2 shifts"));
}
