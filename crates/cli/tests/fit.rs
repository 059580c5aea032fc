//! `fit`: from logs of shifts to a vehicle file, and to estimates with it.

#![expect(clippy::unwrap_used, reason = "a test may")]

#[path = "../../fit/tests/common/mod.rs"]
mod common;

use std::path::PathBuf;
use std::process::{Command, Output};

use common::{Logs, TestCar};
use trace::signal;

const VEHICLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_at.toml");
const SENSORS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/bench.toml");

fn wetclutch(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wetclutch")).args(arguments).output().unwrap()
}

fn stdout(output: &Output) -> String {
    assert!(output.status.success(), "{}", stderr(output));
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A folder that goes away with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wetclutch-fit-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    fn write(&self, name: &str, text: &str) -> String {
        std::fs::write(self.0.join(name), text).unwrap();
        self.path(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if std::env::var_os("FIT_KEEP").is_none() {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }
}

/// RMS error of the torque that the valve maps of a vehicle file give, N m, over logs with their truth.
fn torque_error(folder: &Folder, vehicle: &str, logs: &[(String, trace::Trace)]) -> f64 {
    let (mut count, mut sum) = (0.0, 0.0);
    for (log, truth) in logs {
        let estimate = folder.path("estimate.csv");
        let arguments = ["estimate", log, "--vehicle", vehicle, "--observer", "open-loop-maps", "-o", &estimate];
        stdout(&wetclutch(&arguments));
        let estimate = trace::read_csv(std::path::Path::new(&estimate)).unwrap();
        let phases = study::true_phases(truth).unwrap();
        let [estimated, torque] = [(&estimate, signal::TORQUE_ESTIMATE), (truth, signal::ONCOMING_TORQUE)]
            .map(|(table, name)| table.get(name).unwrap());
        for i in 0..phases.len() {
            if matches!(phases[i], observer::Phase::TorquePhase | observer::Phase::InertiaPhase) {
                count += 1.0;
                sum += (estimated[i] - torque[i]).powi(2);
            }
        }
    }
    (sum / count).sqrt()
}

/// From logs to the fitted file, and with both files over logs that the fit has not seen. The bars of many cars are in the tests
/// of the crate `fit`; this is one car.
#[test]
fn a_fitted_file_estimates_the_torque_of_other_shifts_better() {
    let folder = Folder::new("path");
    let shifts: u64 = std::env::var("FIT_SHIFTS").map_or(5, |text| text.parse().unwrap());
    let mut car = TestCar::drawn(3);
    let logs: Vec<String> = (0..shifts)
        .map(|number| {
            let [measured, _] = car.logs(number, Logs::SpeedsAndCurrent);
            let path = folder.path(&format!("shift_{number:02}.csv"));
            trace::write_csv(std::path::Path::new(&path), &measured).unwrap();
            path
        })
        .collect();
    let fitted = folder.path("fitted.toml");
    let mut arguments = vec!["fit"];
    arguments.extend(logs.iter().map(String::as_str));
    arguments.extend(["--vehicle", VEHICLE, "--sensors", SENSORS, "-o", &fitted]);
    let output = wetclutch(&arguments);
    let said = stdout(&output);
    println!("{said}{}", stderr(&output));
    let valve_gain = said.lines().find(|line| line.starts_with("valve gain ")).unwrap();
    assert!(valve_gain.ends_with("not told by these logs"), "{valve_gain}");
    assert!(said.contains("torque scale: not told by these logs"), "{said}");
    assert!(said.contains("weigh the car"), "{said}");
    let text = std::fs::read_to_string(&fitted).unwrap();
    let given = std::fs::read_to_string(VEHICLE).unwrap();
    // Every line of the given file is there, but for those with new values.
    let lost = given.lines().filter(|line| !text.lines().any(|other| other == *line)).count();
    assert!(lost < 40, "{lost} lines changed");
    assert!(text.contains("# fit: x "), "{text}");
    stdout(&wetclutch(&["check", &fitted]));
    let others: Vec<(String, trace::Trace)> = (100..103)
        .map(|number| {
            let [measured, truth] = car.logs(number, Logs::SpeedsAndCurrent);
            let path = folder.path(&format!("other_{number}.csv"));
            trace::write_csv(std::path::Path::new(&path), &measured).unwrap();
            (path, truth)
        })
        .collect();
    let [before, after] = [VEHICLE, &fitted].map(|vehicle| torque_error(&folder, vehicle, &others));
    println!("torque of the valve maps: RMS error {before:.2} N m, fitted {after:.2} N m");
    assert!(after < 0.35 * before, "{before} {after}");
}
