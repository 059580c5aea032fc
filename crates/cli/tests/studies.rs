//! Studies from the command line: the same bytes however they are made, and no run lost.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const EXPERIMENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/bench.toml");

fn wetclutch(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wetclutch")).args(arguments).output().unwrap()
}

fn done(arguments: &[&str]) -> String {
    let output = wetclutch(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = wetclutch(arguments);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stdout));
    String::from_utf8(output.stderr).unwrap()
}

/// A folder with a study file, which goes away with the test.
struct Study(PathBuf);

impl Study {
    fn new(name: &str, text: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wetclutch-study-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        let head = format!("name = \"small\"\ntitle = \"Small\"\nexperiment = '{EXPERIMENT}'\n");
        std::fs::write(path.join("study.toml"), head + text).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    fn file(&self) -> String {
        self.path("study.toml")
    }
}

impl Drop for Study {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn bytes(path: impl AsRef<Path>) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

const FACTORS: &str = r#"
plan = "latin-hypercube"
runs = 48
seed = 3
observers = ["peak-to-peak", "open loop"]
[[factor]]
key = "car.vehicle.mass_kg"
range = [1300, 2000]
[[factor]]
key = "experiment.off_nominal.friction_factor"
normal = { mean = 1.0, deviation = 0.1 }
[[factor]]
key = "car.clutch.b.valve.gain.gain_pa_a"
change = "scale"
values = [0.9, 1.0, 1.1]
"#;

fn same_study(one: &str, other: &str) {
    for name in ["runs.csv", "runs.parquet", "study.html"] {
        assert!(bytes(Path::new(one).join(name)) == bytes(Path::new(other).join(name)), "{name} differs");
    }
}

#[test]
fn a_study_is_the_same_on_one_thread_and_on_three_in_shards_and_whole() {
    let study = Study::new("same", FACTORS);
    let (one, three, merged) = (study.path("one"), study.path("three"), study.path("merged"));
    let printed = done(&["study", &study.file(), "-o", &one, "--threads", "1"]);
    assert!(printed.contains("48 ok") && printed.contains("peak-to-peak"), "{printed}");
    done(&["study", &study.file(), "-o", &three, "--threads", "3"]);
    same_study(&one, &three);
    let shards = [1, 2, 3].map(|i| study.path(&format!("shard{i}")));
    for (i, shard) in shards.iter().enumerate() {
        done(&["study", &study.file(), "-o", shard, "--shard", &format!("{}/3", i + 1)]);
    }
    let [a, b, c] = &shards;
    let error = refused(&["merge", &study.file(), a, c, "-o", &merged]);
    assert!(error.contains("in their order") && !Path::new(&merged).exists(), "{error}");
    done(&["merge", &study.file(), a, b, c, "-o", &merged]);
    same_study(&one, &merged);
}

#[test]
fn a_study_that_was_killed_goes_on_to_the_same_bytes() {
    let study = Study::new("killed", &FACTORS.replace("runs = 48", "runs = 400"));
    let (whole, broken) = (study.path("whole"), study.path("broken"));
    done(&["study", &study.file(), "-o", &whole]);
    let partial = Path::new(&broken).join("runs.csv.partial");
    let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["study", &study.file(), "-o", &broken, "--threads", "1"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // Killed as soon as some rows are on the disk.
    while std::fs::metadata(&partial).map_or(0, |file| file.len()) < 20_000 {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        std::thread::yield_now();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!Path::new(&broken).join("runs.csv").exists());
    let error = refused(&["study", &study.file(), "-o", &broken]);
    assert!(error.contains("--resume completes it"), "{error}");
    let output = wetclutch(&["study", &study.file(), "-o", &broken, "--resume"]);
    assert!(output.status.success());
    assert!(String::from_utf8(output.stderr).unwrap().contains("resuming after"));
    same_study(&whole, &broken);
}

#[test]
fn a_run_can_be_made_again_with_all_its_signals() {
    let study = Study::new("again", FACTORS);
    let (all, again) = (study.path("all"), study.path("again"));
    done(&["study", &study.file(), "-o", &all]);
    let page = String::from_utf8(bytes(Path::new(&all).join("study.html"))).unwrap();
    let number = page.split(" --run ").nth(1).unwrap().split('<').next().unwrap().to_owned();
    let printed = done(&["study", &study.file(), "--run", &number, "-o", &again]);
    let rows = String::from_utf8(bytes(Path::new(&all).join("runs.csv"))).unwrap();
    let mut lines = rows.lines();
    let header = lines.next().unwrap();
    let row = lines.nth(number.parse().unwrap()).unwrap();
    for (name, cell) in header.split(',').zip(row.split(',')).filter(|(_, cell)| !cell.is_empty()) {
        assert!(printed.contains(&format!("{name} {cell}\n")), "{name} {cell}: {printed}");
    }
    assert!(Path::new(&again).join(format!("run_{number}.svg")).exists());
    assert!(Path::new(&again).join(format!("run_{number}_peak-to-peak.csv")).exists());
}

#[test]
fn a_run_that_fails_is_a_row_with_its_status() {
    // The later request leaves no time to lock up.
    let text = r#"
plan = "full-factorial"
observers = ["open loop"]
[[factor]]
key = "experiment.shift.request_s"
values = [7.43, 9.3]
[[factor]]
key = "experiment.off_nominal.friction_factor"
values = [1.0, 1.1]
"#;
    let study = Study::new("fails", text);
    let out = study.path("out");
    let printed = done(&["study", &study.file(), "-o", &out]);
    assert!(printed.contains("2 ok, 2 no_lock_up"), "{printed}");
    let rows = String::from_utf8(bytes(Path::new(&out).join("runs.csv"))).unwrap();
    let statuses: Vec<&str> = rows.lines().skip(1).map(|row| row.split(',').nth(4).unwrap()).collect();
    assert_eq!(statuses, ["ok", "ok", "no_lock_up", "no_lock_up"]);
}

#[test]
fn a_factor_that_cannot_be_is_refused_before_the_first_run() {
    let text =
        |key: &str, values: &str| format!("plan = \"random\"\nruns = 5\n[[factor]]\nkey = \"{key}\"\n{values}\n");
    let cases = [
        ("car.vehicle.mas_kg", "range = [1300, 2000]", "unknown field `mas_kg`"),
        ("car.vehicle.mass_kg", "range = [13, 2000]", "`vehicle.mass_kg` is 13"),
        ("mass", "range = [1300, 2000]", "begins with `car.`"),
        ("car.engine.torque.torque_n_m", "range = [0.9, 1.1]", "change = \"scale\""),
        ("car.vehicle.mass_kg", "range = [2000, 1300]", "two rising numbers"),
        ("car.vehicle.mass_kg", "", "one of `values`, `range`"),
        ("car.vehicle.mass_kg", "name = \"torque_phase_s\"\nrange = [1300, 2000]", "a column of the table of runs"),
    ];
    for (key, values, part) in cases {
        let study = Study::new("refused", &text(key, values));
        let error = refused(&["study", &study.file(), "-o", &study.path("out")]);
        assert!(error.contains(part) && error.contains("study.toml:"), "{part}: {error}");
        assert!(!study.0.join("out").exists());
    }
}

const MODEL_ERRORS: &str = r#"
plan = "sobol"
runs = 16
[[factor]]
key = "experiment.off_nominal.converter_capacity_factor"
range = [0.85, 1.15]
"#;

#[test]
fn error_bounds_are_found_and_read_by_the_design() {
    let study = Study::new("bound", MODEL_ERRORS);
    let bounds = study.path("bounds.toml");
    let printed = done(&["error-bound", &study.file(), "-o", &bounds]);
    assert!(printed.contains("rigid |w|") && printed.contains("turbine torque (engine, converter)"), "{printed}");
    let page = String::from_utf8(bytes(study.path("bounds.html"))).unwrap();
    assert!(page.contains("Inertia phase") && page.contains("error_matrix"));
    let vehicle = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_at.toml");
    let with = done(&["design", vehicle, "--bounds", &bounds, "--phase", "inertia"]);
    let without = done(&["design", vehicle, "--phase", "inertia"]);
    assert!(without.contains("for model errors up to 1600.0 rad/s^2") && !with.contains("1600.0"), "{with}");
}

#[test]
fn the_worst_case_is_a_study_that_can_be_run() {
    let study = Study::new("worst", &FACTORS.replace("runs = 48", "runs = 12"));
    let out = study.path("out");
    let printed = done(&[
        "worst-case",
        &study.file(),
        "--observer",
        "peak-to-peak",
        "--phase",
        "inertia",
        "--starts",
        "1",
        "--iterations",
        "10",
        "-o",
        &out,
    ]);
    let found = printed.split("RMS error ").nth(1).unwrap().split(' ').next().unwrap().parse::<f64>().unwrap();
    let case = study.path("out/worst_inertia_phase.toml");
    let again = done(&["study", &case, "--run", "0", "-o", &study.path("again")]);
    let row = again.lines().find(|line| line.starts_with("peak-to-peak.inertia_phase.pressure_rms_pa")).unwrap();
    let rms = row.split(' ').nth(1).unwrap().parse::<f64>().unwrap();
    assert!((rms / 1e6 - found).abs() < 1e-4, "{rms} {found}");
    assert!(refused(&["worst-case", &study.file(), "--observer", "none"]).contains("its observers are peak-to-peak"));
}
