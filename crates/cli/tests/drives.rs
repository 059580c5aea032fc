//! Drives from the command line.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::path::PathBuf;
use std::process::{Command, Output};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
const SHORT: &str = "name = \"Short\"\n[[segment]]\nduration_s = 15\nthrottle = [0.1, 0.4]\n";

fn wetclutch(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wetclutch")).args(arguments).output().unwrap()
}

fn said(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A folder with a short drive, which goes away with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str, drive: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wetclutch-drives-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        std::fs::write(path.join("drive.toml"), drive).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    fn simulate(&self, more: &[&str]) -> Output {
        let (drive, out) = (self.path("drive.toml"), self.path("out"));
        wetclutch(&[&["simulate", &drive, "-o", &out], more].concat())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn a_drive_writes_every_signal_and_those_that_a_car_measures() {
    let folder = Folder::new("columns", SHORT);
    let vehicle = format!("{ROOT}vehicles/six_speed.toml");
    let output = folder.simulate(&["--vehicle", &vehicle]);
    assert!(output.status.success(), "{}", said(&output.stderr));
    assert!(said(&output.stderr).contains("drive: 15 s, "), "{}", said(&output.stderr));
    let whole = std::fs::read_to_string(folder.path("out/short.csv")).unwrap();
    let measured = std::fs::read_to_string(folder.path("out/short_measured.csv")).unwrap();
    assert_eq!((whole.lines().count(), measured.lines().count()), (1501, 1501));
    let names: Vec<&str> = whole.lines().next().unwrap().split(',').collect();
    for name in ["gear", "target_gear", "offgoing_current_a", "oncoming_pressure_pa", "shaft_torque_n_m"] {
        assert!(names.contains(&name), "{name}");
    }
    assert!(!measured.lines().next().unwrap().contains("pressure"));
    let column = |name: &str| names.iter().position(|other| *other == name).unwrap();
    let cell = |line: &str, name: &str| line.split(',').nth(column(name)).unwrap().to_owned();
    let shift = whole.lines().find(|line| cell(line, "target_gear") == "2" && cell(line, "gear") == "1").unwrap();
    assert_eq!((cell(shift, "offgoing"), cell(shift, "oncoming")), ("D".to_owned(), "C".to_owned()));
    assert!(cell(shift, "oncoming_pressure_pa").parse::<f64>().is_ok());
    // Between shifts there is no shift clutch.
    assert_eq!(cell(whole.lines().nth(1).unwrap(), "oncoming_pressure_pa"), "");
}

#[test]
fn a_drive_needs_a_vehicle_with_a_gearbox() {
    let folder = Folder::new("vehicle", SHORT);
    let none = folder.simulate(&[]);
    assert_eq!(none.status.code(), Some(2));
    assert!(said(&none.stderr).contains("or the option --vehicle"), "{}", said(&none.stderr));
    let two_speed = format!("{ROOT}vehicles/two_speed_at.toml");
    let other = folder.simulate(&["--vehicle", &two_speed]);
    assert_eq!(other.status.code(), Some(2));
    assert!(said(&other.stderr).contains("two_speed_at.toml"), "{}", said(&other.stderr));
    let experiment = format!("{ROOT}experiments/e1.toml");
    let refused = wetclutch(&["simulate", &experiment, "--vehicle", &two_speed, "-o", &folder.path("out")]);
    assert!(said(&refused.stderr).contains("hint: --vehicle is for a drive file"), "{}", said(&refused.stderr));
}

#[test]
fn a_shift_that_the_gearbox_does_not_have_is_named() {
    let drive = "name = \"d\"\nshift = [{ time_s = 1, gear = \"6\" }]\n[[segment]]\nduration_s = 3\nthrottle = 0.1\n";
    let folder = Folder::new("shift", drive);
    let output = folder.simulate(&["--vehicle", &format!("{ROOT}vehicles/six_speed.toml")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output.stderr).contains("shift 1-6 is not between two clutches"), "{}", said(&output.stderr));
}

#[test]
fn check_describes_a_car_and_a_drive() {
    let output = wetclutch(&["check", &format!("{ROOT}drives/city.toml")]);
    assert!(output.status.success(), "{}", said(&output.stderr));
    let printed = said(&output.stdout);
    for part in ["drive city: 3600 s", "8 forward gears", "torque converter", "kiss point 0.114 MPa"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
}
