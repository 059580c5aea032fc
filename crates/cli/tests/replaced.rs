//! Outputs replace files that this program wrote, and others with `--force` alone.

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, refused, said, wetclutch};

const CAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/four_speed.toml");

#[test]
fn files_of_others_are_replaced_by_force_alone() {
    let folder = Folder::new("replaced");
    let out = folder.path("");
    let own = ["--mass-kg", "1500", "--wheel-radius-m", "0.3", "--final-ratio", "3", "--engine-torque-n-m", "190"];
    let own_file = folder.path("own.toml");
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("sim")]));
    let log = folder.path("sim/e1_measured.csv");
    let converted = folder.path("converted.csv");
    let gearbox = format!("{ROOT}gearboxes/8hp.toml");
    let cases: [(&str, Vec<&str>); 8] = [
        ("e1_measured.csv", vec!["simulate", EXPERIMENT, "-o", &out]),
        ("measured.csv", vec!["demo", "-o", &out]),
        ("README.md", vec!["export", CAR, "-o", &out]),
        ("sensitivity.html", vec!["sensitivity", "-o", &out]),
        ("bench.csv", vec!["bench", "--vehicle", CAR, "--draws", "1", "-o", &out]),
        ("own.toml", [&["init", "--ratios", "2.8,1.55"], &own[..], &["-o", &own_file]].concat()),
        ("converted.csv", vec!["convert", &log, "-o", &converted]),
        ("train.svg", vec!["check", &gearbox, "-o", &out]),
    ];
    for (name, arguments) in cases {
        let mine = "time_s,engine_speed_rad_s\n0,1\n1,2\n";
        folder.write(name, mine);
        if name.ends_with(".svg") {
            // A figure of that name is one of this program.
            said(&wetclutch(&arguments));
            continue;
        }
        let error = refused(&wetclutch(&arguments));
        assert!(error.contains(name) && error.contains("--force replaces it"), "{name}: {error}");
        assert_eq!(folder.read(name), mine, "{name}");
        said(&wetclutch(&[&arguments[..], &["--force"]].concat()));
        assert_ne!(folder.read(name), mine, "{name}");
        // What this program wrote is replaced, but for tables of logs and files that are meant to be filled in.
        if !["own.toml", "converted.csv"].contains(&name) {
            said(&wetclutch(&arguments));
        }
    }
}

#[test]
fn a_demo_removes_what_an_earlier_one_left() {
    let folder = Folder::new("demos");
    let drive = folder.write("drive.toml", "name = \"d\"\n[[segment]]\nduration_s = 3\nthrottle = 0.3\n");
    let out = folder.path("out");
    said(&wetclutch(&["demo", "-o", &out]));
    folder.write("out/mine.txt", "mine");
    let notes = said(&wetclutch(&["demo", "--vehicle", CAR, "--drive", &drive, "-o", &out]));
    assert!(notes.contains("trace.csv, of an earlier demo"), "{notes}");
    let mut names: Vec<String> =
        std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["drive.csv", "drive_measured.csv", "mine.txt", "report.html", "shifts.csv"]);
    // The same demo again removes nothing.
    let again = said(&wetclutch(&["demo", "--vehicle", CAR, "--drive", &drive, "-o", &out]));
    assert!(!again.contains("of an earlier demo"), "{again}");
    refused(&wetclutch(&["check", VEHICLE, "--force=yes"]));
}
