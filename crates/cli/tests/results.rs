//! Results in JSON, and how much is said besides.

use serde_json::Value;

use crate::support::{
    EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, stderr, stdout, wetclutch, without_excerpts,
};

/// What a command has printed, as an object with its version.
fn object(output: &std::process::Output) -> Value {
    let object: Value = serde_json::from_str(&stdout(output)).unwrap_or_else(|_| panic!("{}", stderr(output)));
    assert_eq!(object["json_version"], 1);
    object
}

/// A simulated log and a channel map for it.
fn log(folder: &Folder) -> [String; 2] {
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("sim")]));
    let log = folder.path("sim/e1_measured.csv");
    let map = folder.write("map.toml", printed(&wetclutch(&["inspect", &log, "--suggest"])));
    [log, map]
}

#[test]
fn check_gives_kind_errors_and_defaults_of_each_file_in_json() {
    let folder = Folder::new("check-json");
    let text = std::fs::read_to_string(VEHICLE).unwrap();
    let wrong = text.replace("mass_kg = 1500", "mas_kg = 1500").replace("wheel_radius_m = ", "wheel_radius_m = 1000");
    let wrong = folder.write("wrong.toml", wrong);
    let missing = folder.path("missing.toml");
    let output = wetclutch(&["check", "--json", VEHICLE, &wrong, &missing]);
    assert!(refused(&output).contains("error: 2 of 3 files have errors"), "{}", stderr(&output));
    let files = object(&output)["files"].clone();
    assert_eq!(files[0]["describes"], "a vehicle file of one shift");
    assert!(files[0]["errors"].as_array().unwrap().is_empty());
    assert!(files[0]["defaults"].as_array().unwrap().iter().all(|default| default["key"].is_string()));
    let errors = files[1]["errors"].as_array().unwrap();
    assert_eq!(errors.len(), 2, "{errors:#?}");
    assert_eq!(errors[0]["hint"], "did you mean `mass_kg`, which is missing?");
    assert_eq!(errors[1]["key"], "vehicle.wheel_radius_m");
    assert_eq!(errors[1]["expected"], "0.1 to 1");
    assert!(errors.iter().all(|error| error["line"].is_u64() && error["file"] == wrong.as_str()), "{errors:#?}");
    assert!(files[2]["errors"][0]["message"].as_str().unwrap().contains("No such file"));
    assert!(wetclutch(&["check", "--json", VEHICLE]).status.success());
    refused(&wetclutch(&["check", "--json", "--all", VEHICLE]));
}

#[test]
fn check_names_all_errors_of_the_vehicle_that_a_drive_names() {
    let folder = Folder::new("drive-errors");
    let text = std::fs::read_to_string(format!("{ROOT}vehicles/eight_speed.toml")).unwrap();
    let text = text.replace("../gearboxes", &format!("{ROOT}gearboxes")).replace("mass_kg = ", "mas_kg = ");
    folder.write("car.toml", text.replace("wheel_radius_m = ", "wheel_radius_m = 1000"));
    let drive = "name = \"d\"\nvehicle = \"car.toml\"\n[[segment]]\nduration_s = 3\nthrottle = 0.2\n";
    let error = refused(&wetclutch(&["check", &folder.write("drive.toml", drive)]));
    assert!(error.contains("unknown key `mas_kg`") && error.contains("`vehicle.wheel_radius_m` is 1000"), "{error}");
}

#[test]
fn a_range_of_a_channel_map_is_apart_from_its_hint() {
    let folder = Folder::new("range-of-map");
    let map = folder.write("map.toml", "[channel.engine_speed]\nname = \"N\"\ndelay_s = 99\n");
    let checked: serde_json::Value = serde_json::from_str(&stdout(&wetclutch(&["check", "--json", &map]))).unwrap();
    let error = &checked["files"][0]["errors"][0];
    assert_eq!(
        (error["expected"].as_str(), error["hint"].as_str()),
        (Some("0 to 10"), Some("it is in s: 20 ms is 0.02"))
    );
}

#[test]
fn a_misspelt_key_of_a_channel_map_is_named_alone() {
    let folder = Folder::new("map-errors");
    let map = folder.write("map.toml", "[channel.engine_speed]\nnaem = \"N\"\n");
    let error = refused(&wetclutch(&["check", &map]));
    assert!(error.starts_with(&format!("error: {map}:2: unknown key `naem`")), "{error}");
    assert_eq!(error.matches("error: ").count(), 1, "{error}");
    let map = folder.write("map.toml", "[chanel.engine_speed]\nname = \"N\"\n");
    let error = without_excerpts(&refused(&wetclutch(&["check", &map])));
    assert!(
        error.starts_with(&format!("error: {map}:1: unknown key `chanel`\nhint: did you mean `channel`?")),
        "{error}"
    );
}

#[test]
fn inspect_gives_channels_and_shifts_in_json() {
    let folder = Folder::new("inspect-json");
    let [log, map] = log(&folder);
    let channels = object(&wetclutch(&["inspect", &log, "--json"]));
    assert_eq!(channels["log"], log.as_str());
    let turbine =
        channels["channels"].as_array().unwrap().iter().find(|of| of["name"] == "turbine_speed_rad_s").unwrap();
    assert_eq!((&turbine["unit"], &turbine["samples"]), (&Value::from("rad/s"), &Value::from(9501)));
    assert!((turbine["rate_hz"].as_f64().unwrap() - 1000.0).abs() < 1e-6 && turbine["to_s"] == 9.5, "{turbine}");
    let shifts = object(&wetclutch(&["inspect", &log, "--map", &map, "--shifts", "--ratios", "2.8,1.55", "--json"]));
    assert!(shifts["to_s"] == 9.5 && shifts["shifts"].is_array(), "{shifts}");
    refused(&wetclutch(&["inspect", &log, "--suggest", "--ratios", "2.5,1"]));
}

#[test]
fn estimate_gives_the_shifts_of_its_logs_in_json() {
    let folder = Folder::new("estimate-json");
    let [log, map] = log(&folder);
    let out = folder.path("out.csv");
    let one = object(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "--map", &map, "-o", &out, "--json"]));
    assert_eq!(
        (&one["logs"][0]["log"], &one["logs"][0]["estimate"]),
        (&Value::from(log.as_str()), &Value::from(out.as_str()))
    );
    let written: Value = serde_json::from_str(&folder.read("out_shifts.json")).unwrap();
    assert!(one["logs"][0]["shifts"] == written && written.as_array().unwrap().len() == 1, "{one}");
    let copy = folder.write("copy.csv", std::fs::read(&log).unwrap());
    std::fs::create_dir_all(folder.path("both")).unwrap();
    let arguments =
        ["estimate", &log, &copy, "--vehicle", VEHICLE, "--map", &map, "-o", &folder.path("both"), "--json"];
    let both = object(&wetclutch(&arguments));
    let logs: Vec<&Value> = both["logs"].as_array().unwrap().iter().map(|of| &of["log"]).collect();
    assert_eq!(logs, [&Value::from(log.as_str()), &Value::from(copy.as_str())]);
    refused(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "--json"]));
}

#[test]
fn a_quiet_command_says_warnings_and_errors_alone() {
    let folder = Folder::new("quiet");
    let [log, map] = log(&folder);
    let out = folder.path("out.csv");
    let arguments = ["estimate", &log, "--vehicle", VEHICLE, "--map", &map, "-o", &out];
    let loud = wetclutch(&arguments);
    let quiet = wetclutch(&[&["-q"], &arguments[..]].concat());
    assert_eq!(printed(&quiet), printed(&loud));
    let warnings = |text: &str| text.lines().filter(|line| line.starts_with("warning: ")).count();
    assert_eq!(warnings(&stderr(&quiet)), warnings(&stderr(&loud)));
    assert!(stderr(&loud).contains("estimate: ") && !stderr(&quiet).contains("estimate: "), "{}", stderr(&quiet));
    let wrong = wetclutch(&["check", "--quiet", &format!("{ROOT}gearboxes/8hp.toml"), "--all"]);
    assert!(stderr(&wrong).starts_with("warning: --all has no effect"), "{}", stderr(&wrong));
    let none = refused(&wetclutch(&["estimate", "none.csv", "--vehicle", VEHICLE, "-q"]));
    assert!(none.starts_with("error: none.csv: "), "{none}");
}

#[test]
fn a_verbose_command_says_files_assumptions_and_times() {
    let folder = Folder::new("verbose");
    let [log, map] = log(&folder);
    let out = folder.path("out.csv");
    let arguments = ["estimate", &log, "--vehicle", VEHICLE, "--map", &map, "-o", &out];
    let usual = said(&wetclutch(&arguments));
    let verbose = said(&wetclutch(&[&arguments[..], &["-v"]].concat()));
    let details: Vec<&str> = verbose.lines().filter_map(|line| line.split_once(" s: ").map(|(_, what)| what)).collect();
    let once = |what: &str| details.iter().filter(|detail| detail.starts_with(what)).count() == 1;
    for what in [
        &format!("read {VEHICLE}"),
        &format!("read {map}"),
        &format!("read {log}"),
        "engine_speed: engine_speed_rad_s",
        "end",
    ] {
        assert!(once(what), "{what}: {verbose}");
    }
    assert!(once(&format!("wrote {out}")), "{verbose}");
    // All other messages stay.
    assert!(usual.lines().all(|line| verbose.contains(line)), "{usual}\n{verbose}");
    refused(&wetclutch(&["-q", "-v", "check", VEHICLE]));
    // A short file: its defaults.
    let own = ["--mass-kg", "1500", "--wheel-radius-m", "0.3", "--final-ratio", "3", "--engine-torque-n-m", "190"];
    let short = folder.path("short.toml");
    said(&wetclutch(&[&["init", "--ratios", "2.8,1.55"], &own[..], &["-o", &short]].concat()));
    // Whether the log is of this car is another matter.
    let assumed = stderr(&wetclutch(&["estimate", &log, "--vehicle", &short, "--map", &map, "-o", &out, "-v"]));
    assert!(assumed.contains("assumed: defaults of the vehicle file for "), "{assumed}");
}

#[test]
fn a_package_finds_version_completions_and_manual_pages() {
    let folder = Folder::new("package");
    assert!(printed(&wetclutch(&["--version"])).starts_with(concat!("wetclutch ", env!("CARGO_PKG_VERSION"))));
    for (shell, part) in [("bash", "_wetclutch()"), ("zsh", "#compdef wetclutch"), ("fish", "complete -c wetclutch")] {
        let text = printed(&wetclutch(&["completions", shell]));
        assert!(text.contains(part) && ["estimate", "compare"].iter().all(|command| text.contains(command)), "{shell}");
    }
    printed(&wetclutch(&["man", &folder.path("man")]));
    let page = folder.read("man/wetclutch-estimate.1");
    assert!(page.contains(".TH wetclutch-estimate 1") && page.contains("LEARNT.toml"), "{page}");
    assert!(folder.read("man/wetclutch.1").contains("wetclutch\\-estimate(1)"));
    let help = printed(&wetclutch(&["--help"]));
    assert!(["completions", "man", "--quiet"].iter().all(|word| help.contains(word)), "{help}");
}

#[test]
fn a_study_beyond_the_error_bounds_of_its_vehicle_is_warned_of() {
    let folder = Folder::new("exceeded");
    let study = |errors: &str| {
        let text = format!(
            "name = \"s\"\ntitle = \"S\"\nvehicle = \"{ROOT}vehicles/four_speed.toml\"\nshifts = [\"1-2\"]\nruns = 2\nseed = 1\n[errors]\n{errors}"
        );
        wetclutch(&["check", &folder.write("study.toml", text)])
    };
    let wide = study("friction = 0.23\nvalve_gain = 0.1\nconverter = 0.1\n");
    assert!(printed(&wide).contains("friction within 23 %, gain of the valves 10 %"), "{}", stdout(&wide));
    let warning = said(&wide);
    assert!(
        warning.contains("warning: [errors] of the study exceeds the error bounds of the vehicle file: "),
        "{warning}"
    );
    assert!(warning.contains("friction 0.77 to 1.23 (bounds ") && !warning.contains("valve gain"), "{warning}");
    assert!(!said(&study("friction = 0\nvalve_gain = 0\nconverter = 0\n")).contains("exceeds"));
}
