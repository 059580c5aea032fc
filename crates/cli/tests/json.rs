//! `--json`: every command prints one object with the version of its keys.

use serde_json::Value;

use crate::support::{BENCH, EXPERIMENT, Folder, ROOT, VEHICLE, printed, said, stderr, stdout, wetclutch};

const STUDY: &str = "name = \"small\"\ntitle = \"Small\"\nplan = \"latin-hypercube\"\nruns = 4\nseed = 3\nobservers = [\"peak-to-peak\", \"open loop\"]\n\
    [[factor]]\nkey = \"car.vehicle.mass_kg\"\nrange = [1300, 2000]\n";

/// The commands that are listed.
fn commands() -> Vec<String> {
    let help = printed(&wetclutch(&["--help"]));
    let listed = help.split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let names = listed.lines().filter_map(|line| line.split_whitespace().next());
    // Completions and manual pages are for a shell, a view is for people: no program reads them.
    names.filter(|name| !["help", "completions", "man", "watch"].contains(name)).map(str::to_owned).collect()
}

/// Arguments of each command, in the order in which they are run: one makes the log of the others.
fn cases(folder: &Folder) -> Vec<Vec<String>> {
    let path = |name: &str| folder.path(name);
    let log = path("sim/e1_measured.csv");
    let study = folder.write("study.toml", format!("experiment = '{BENCH}'\n{STUDY}"));
    let car = format!("{ROOT}vehicles/four_speed.toml");
    let with_folder = |arguments: &[&str], name: &str| -> Vec<String> {
        let out = ["-o".to_owned(), folder.path(name)];
        arguments.iter().map(|argument| (*argument).to_owned()).chain(out).collect()
    };
    let alone = |arguments: &[&str]| arguments.iter().map(|argument| (*argument).to_owned()).collect::<Vec<_>>();
    let own = ["--mass-kg", "1500", "--wheel-radius-m", "0.3", "--final-ratio", "3", "--engine-torque-n-m", "190"];
    vec![
        with_folder(&["simulate", EXPERIMENT], "sim"),
        with_folder(&["demo"], "demo"),
        alone(&["design", VEHICLE]),
        alone(&["inspect", &log]),
        with_folder(&["convert", &log], "converted.csv"),
        with_folder(&["estimate", &log, "--vehicle", VEHICLE], "estimate.csv"),
        alone(&["compare", &path("estimate.csv"), &path("sim")]),
        with_folder(&["fit", &log, "--vehicle", VEHICLE], "fitted.toml"),
        with_folder(&[&["init", "--gearbox", "8hp"], &own[..]].concat(), "own.toml"),
        with_folder(&["reproduce", "--settings", "1"], "reproduction"),
        alone(&["bench", "--vehicle", &car, "--draws", "1"]),
        with_folder(&["study", &study, "--shard", "1/1"], "study"),
        with_folder(&["merge", &study, &path("study")], "merged"),
        alone(&["error-bound", &study]),
        with_folder(&["worst-case", &study, "--starts", "1", "--iterations", "2"], "worst"),
        alone(&["sensitivity"]),
        alone(&["check", VEHICLE]),
        with_folder(&["export", &car], "export"),
    ]
}

#[test]
fn every_command_prints_one_object_with_the_version_of_its_keys() {
    let folder = Folder::new("json");
    let cases = cases(&folder);
    let page = std::fs::read_to_string(format!("{ROOT}docs/reference/json.md")).unwrap();
    for command in commands() {
        let help = printed(&wetclutch(&[&command, "--help"]));
        assert!(help.contains("--json"), "{command} has no --json");
        assert!(cases.iter().any(|arguments| arguments[0] == command), "no case for {command}");
    }
    for arguments in &cases {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).chain(["--json"]).collect();
        let output = wetclutch(&arguments);
        said(&output);
        let object: Value = serde_json::from_str(&stdout(&output))
            .unwrap_or_else(|error| panic!("{arguments:?}: {error}: {}", stdout(&output)));
        assert_eq!(object["json_version"], 1, "{arguments:?}");
        let page = page.split(&format!("\n| `{}` |", arguments[0])).nth(1).and_then(|rest| rest.lines().next());
        let page = page.unwrap_or_else(|| panic!("{} is not in docs/reference/json.md", arguments[0]));
        for key in object.as_object().unwrap().keys().filter(|key| *key != "json_version") {
            assert!(page.contains(&format!("`{key}`")), "{}: `{key}` is not in docs/reference/json.md", arguments[0]);
        }
    }
    // A suggested map, a drive of a car with a gearbox, and one run of a study.
    let drive = folder.write("drive.toml", "name = \"d\"\n[[segment]]\nduration_s = 3\nthrottle = 0.3\n");
    let car = format!("{ROOT}vehicles/four_speed.toml");
    let json = |arguments: &[&str]| -> Value {
        let output = wetclutch(&[arguments, &["--json"]].concat());
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{arguments:?}: {}", stderr(&output)))
    };
    let suggested = json(&["inspect", &folder.path("sim/e1_measured.csv"), "--suggest"]);
    assert!(suggested["channel_map"].as_str().unwrap().contains("[channel.engine_speed]"), "{suggested}");
    let driven = json(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("drive")]);
    assert!(driven["drive"]["duration_s"] == 3.0 && driven["files"].as_array().unwrap().len() == 3, "{driven}");
    let demo = json(&["demo", "--vehicle", &car, "--drive", &drive, "-o", &folder.path("demo_drive")]);
    assert!(demo["shifts"].is_array() && demo["files"].as_array().unwrap().len() == 4, "{demo}");
    let run = json(&["study", &folder.path("study.toml"), "--run", "1", "-o", &folder.path("run")]);
    assert!((1300.0..2000.0).contains(&run["values"]["mass_kg"].as_f64().unwrap()) && run["status"] == "ok", "{run}");
    for file in run["files"].as_array().unwrap() {
        assert!(std::path::Path::new(file.as_str().unwrap()).is_file(), "{file}");
    }
}
