//! The command as a user meets it: what it writes, prints, and exits with.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::any_car::column;
use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, stderr, stdout, wetclutch};

fn read(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn the_demo_writes_its_report_and_prints_its_table() {
    let folder = Folder::new("demo");
    let output = wetclutch(&["demo", "-o", &folder.path("out")]);
    assert!(output.status.success(), "{}", stderr(&output));
    let printed = stdout(&output);
    for part in ["torque phase", "inertia phase", "open loop", "report.html"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    let html = read(folder.path("out/report.html"));
    assert!(html.contains("<svg") && html.contains("certified band") && html.trim_end().ends_with("</html>"));
    // Nothing is loaded from elsewhere; the only addresses are the names of XML vocabularies.
    assert!(!html.contains("src=") && !html.contains("href=") && !html.contains("@import"));
    for name in ["shift.svg", "drive.svg", "trace.csv", "measured.csv", "estimate.csv"] {
        assert!(Path::new(&folder.path(&format!("out/{name}"))).exists(), "{name}");
    }
}

#[test]
fn estimate_gives_from_measured_signals_what_the_demo_showed() {
    let folder = Folder::new("estimate");
    wetclutch(&["demo", "-o", &folder.path("demo")]);
    let (log, out) = (folder.path("demo/measured.csv"), folder.path("out.csv"));
    let output = wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "-o", &out]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(read(&out) == read(folder.path("demo/estimate.csv")));
    assert!(!read(&log).lines().next().unwrap().contains("pressure"));
}

#[test]
fn simulate_writes_the_same_bytes_twice() {
    let folder = Folder::new("simulate");
    let run = |name: &str| {
        let output = wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path(name)]);
        assert!(output.status.success(), "{}", stderr(&output));
        read(folder.path(&format!("{name}/e1.csv")))
    };
    let (first, second) = (run("a"), run("b"));
    assert!(first.starts_with("time_s,engine_speed_rad_s,turbine_speed_rad_s,"));
    assert_eq!(first, second);
}

#[test]
fn design_prints_the_chapters_gain_and_json_holds_the_certificate() {
    let output = wetclutch(&["design", VEHICLE]);
    assert!(stdout(&output).contains("L = (-783.7, -1310.8) Pa s/rad"), "{}", stdout(&output));
    let output = wetclutch(&["design", VEHICLE, "--phase", "inertia", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let certificate = &json["inertia_phase"];
    assert!((certificate["offset_pa"].as_f64().unwrap() - 49.9e3).abs() < 100.0);
    assert_eq!(certificate["vertices"].as_array().unwrap().len(), 2);
    assert_eq!(certificate["vehicle_sha256"].as_str().unwrap().len(), 64);
}

#[test]
fn a_requirement_that_cannot_be_met_exits_with_1_and_names_it() {
    let output = wetclutch(&["design", VEHICLE, "--phase", "inertia", "--offset-max", "10000"]);
    assert_eq!(output.status.code(), Some(1));
    let message = stderr(&output);
    for part in ["inertia phase: --offset-max requires an offset of at most 0.01000 MPa", "0.04988 MPa", "hint:"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    // The best certified gain is shown beside what it misses.
    assert!(stdout(&output).contains("offset bound 0.0499 MPa (required 0.0100 MPa, not met)"), "{}", stdout(&output));
}

#[test]
fn numbers_of_the_command_line_have_ranges() {
    for (option, bad, allowed) in [
        ("--sample-time", "20", "0.0001 to 0.2"),
        ("--kappa1", "nan", "0.01 to 10000"),
        ("--kappa2", "-1", "0.4 to 800"),
        ("--offset-max", "1e300", "1000 to 10000000"),
        ("--error-bound", "inf", "0 to 1000000"),
    ] {
        let output = wetclutch(&["design", VEHICLE, option, bad]);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(allowed) && stderr(&output).contains(option), "{}", stderr(&output));
    }
    for (command, option, bad) in
        [("study", "--threads", "-1"), ("worst-case", "--iterations", "0"), ("worst-case", "--starts", "-4")]
    {
        let output = wetclutch(&[command, "study.toml", option, bad]);
        assert_eq!(output.status.code(), Some(2));
        let text = stderr(&output);
        assert!(
            text.contains(&format!("invalid value '{bad}'")) && text.contains("expected a whole number from 1 to"),
            "{text}"
        );
    }
}

#[test]
fn a_scenario_is_simulated_by_its_name() {
    let folder = Folder::new("scenario");
    let bench = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/bench.toml");
    let out = folder.path("out");
    let simulate = |more: &[&str]| wetclutch(&[&["simulate", bench, "-o", &out], more].concat());
    let plain = simulate(&[]);
    assert!(plain.status.success() && stderr(&plain).contains("without a scenario"), "{}", stderr(&plain));
    let hot = simulate(&["--scenario", "hot oil"]);
    assert!(hot.status.success() && !stderr(&hot).contains("without a scenario"), "{}", stderr(&hot));
    assert_ne!(read(folder.path("out/bench.csv")), read(folder.path("out/bench.hot_oil.csv")));
    let none = simulate(&["--scenario", "hot"]);
    assert_eq!(none.status.code(), Some(2));
    let said = stderr(&none);
    assert!(
        said.contains("there is no scenario \"hot\"\nhint: the scenarios are") && said.contains("cold oil"),
        "{said}"
    );
}

#[test]
fn check_warns_of_given_gains_that_let_an_error_grow() {
    let folder = Folder::new("gains");
    let gains = "kind = \"rigid\"\ngains = { torque_phase_pa_s_rad = -1e7, inertia_phase_pa_s_rad = [-320, -540] }";
    let text = read(EXPERIMENT).replacen("kind = \"rigid\"\nsample_time_s = 0.001", gains, 1);
    std::fs::write(folder.path("e.toml"), text.replace("../vehicles/two_speed_at.toml", VEHICLE)).unwrap();
    let output = wetclutch(&["check", &folder.path("e.toml")]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("warning: observer \"rigid ISS\", torque phase, friction"), "{}", stderr(&output));
    assert!(stderr(&wetclutch(&["check", EXPERIMENT])).is_empty());
}

#[test]
fn check_warns_of_a_sample_time_for_which_the_certificate_does_not_hold() {
    let folder = Folder::new("steps");
    let text = read(EXPERIMENT).replace("../vehicles/two_speed_at.toml", VEHICLE);
    let slow = text.replacen("kind = \"rigid\"\nsample_time_s = 0.001", "kind = \"rigid\"\nsample_time_s = 0.026", 1);
    std::fs::write(folder.path("e.toml"), slow).unwrap();
    let output = wetclutch(&["check", &folder.path("e.toml")]);
    let said = stderr(&output);
    for part in ["certified for steps of at most 25.2 ms, but its sample time is 26.0 ms", "hint: use `method ="] {
        assert!(output.status.success() && said.contains(part), "{part}: {said}");
    }
}

#[test]
fn design_says_that_a_gain_without_effect_is_the_open_loop() {
    // The valve alone decays with 25/s.
    for kappa2 in ["20", "24.0001"] {
        let output = wetclutch(&["design", VEHICLE, "--kappa1", "1", "--kappa2", kappa2]);
        let printed = stdout(&output);
        assert_eq!(
            printed.matches("the gain is the open loop: the valve alone has the required decay").count(),
            2,
            "{printed}"
        );
        assert!(printed.contains("steady-state bound 0.1294 MPa") && !printed.contains("offset bound"), "{printed}");
    }
    assert!(!stdout(&wetclutch(&["design", VEHICLE])).contains("open loop"));
}

#[test]
fn estimate_goes_on_with_the_best_certified_gain_and_says_so() {
    let folder = Folder::new("best-gain");
    wetclutch(&["demo", "-o", &folder.path("demo")]);
    let vehicle = read(VEHICLE).replace("model_error_max_rad_s2 = 36.7", "model_error_max_rad_s2 = 84.5");
    std::fs::write(folder.path("v.toml"), vehicle).unwrap();
    let (log, vehicle, out) = (folder.path("demo/measured.csv"), folder.path("v.toml"), folder.path("out.csv"));
    let output = wetclutch(&["estimate", &log, "--vehicle", &vehicle, "--observer", "rigid", "-o", &out]);
    assert!(output.status.success(), "{}", stderr(&output));
    let said = stderr(&output);
    for part in ["warning: continuing with the best certified gain", "`design.torque_phase.offset_max_pa` of", "hint:"]
    {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(read(&out).lines().count(), 9502);
}

#[test]
fn wrong_input_exits_with_2_and_says_where_it_is_wrong() {
    let folder = Folder::new("wrong");
    let path = folder.path("vehicle.toml");
    std::fs::write(&path, read(VEHICLE).replace("piston_area_m2 = 0.01 ", "piston_area_m2 = 117 ")).unwrap();
    let output = wetclutch(&["check", &path]);
    assert_eq!(output.status.code(), Some(2));
    let message = stderr(&output);
    assert!(message.contains(&format!("{path}:")) && message.contains("hint: 117 cm2 is 0.0117 m2"), "{message}");

    std::fs::write(folder.path("log.csv"), "time_s,turbine_speed_rpm\n0,1000\n").unwrap();
    let output = wetclutch(&["estimate", &folder.path("log.csv"), "--vehicle", VEHICLE, "-o", &folder.path("out.csv")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(!Path::new(&folder.path("out.csv")).exists(), "no output appears beside an error");

    for arguments in
        [&["design"][..], &["estimate", "x.csv"], &["no-such-command"], &["design", VEHICLE, "--kappa1", "-3"]]
    {
        assert_eq!(wetclutch(arguments).status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn check_says_what_a_good_file_describes() {
    let output = wetclutch(&["check", EXPERIMENT]);
    assert!(output.status.success());
    let printed = stdout(&output);
    assert!(printed.contains("experiment E1") && printed.contains("ratio 2.500 to 1.000"), "{printed}");
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let folder = Folder::new("pipe");
    wetclutch(&["demo", "-o", &folder.path("demo")]);
    let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["estimate", &folder.path("demo/measured.csv"), "--vehicle", VEHICLE])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(!stderr(&output).contains("panicked"));
}

#[test]
fn messages_are_plain_where_nobody_can_see_colours() {
    let output = wetclutch(&["check", "no-such-file.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).starts_with("error: no-such-file.toml: "), "{}", stderr(&output));
}

#[test]
fn lost_samples_are_counted_and_do_not_stop_the_estimate() {
    let folder = Folder::new("lost");
    wetclutch(&["demo", "-o", &folder.path("demo")]);
    let log = read(folder.path("demo/measured.csv"));
    let lossy: Vec<String> = (log.lines().enumerate())
        .map(|(i, line)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if i > 0 && i % 100 == 0 {
                cells[2] = "";
            }
            cells.join(",")
        })
        .collect();
    std::fs::write(folder.path("lossy.csv"), lossy.join("\n")).unwrap();
    let out = folder.path("out.csv");
    let output = wetclutch(&["estimate", &folder.path("lossy.csv"), "--vehicle", VEHICLE, "-o", &out]);
    assert!(output.status.success());
    // The filter goes on without a reading that did not come.
    let readings = column(&read(&out), "turbine_reading");
    let lost: Vec<&String> = readings.iter().skip(99).step_by(100).collect();
    assert!(lost.len() == 95 && lost.iter().all(|reading| *reading == "absent"), "{}", stderr(&output));
    // Where the clutch grips, a slip is in doubt for some rows, and no reading is taken.
    assert!(readings.iter().filter(|reading| *reading == "absent").count() <= 100);
    assert!(!read(&out).contains("NaN"));
}

#[test]
fn every_observer_runs_on_a_log() {
    let folder = Folder::new("observers");
    wetclutch(&["demo", "-o", &folder.path("demo")]);
    let log = folder.path("demo/measured.csv");
    let mut outputs = Vec::new();
    let estimate = |options: &str| {
        let options: Vec<&str> = options.split(' ').collect();
        wetclutch(&[&["estimate", &log, "--vehicle", VEHICLE, "--observer"], options.as_slice()].concat())
    };
    let mut observers: Vec<String> = ["sliding", "kalman", "super-twisting", "open-loop"].map(String::from).to_vec();
    for method in ["iss", "iss-discrete", "peak-to-peak", "scheduled", "interval"] {
        observers.extend(["rigid", "compliant"].map(|observer| format!("{observer} --method {method}")));
    }
    for observer in &observers {
        let output = estimate(observer);
        assert!(output.status.success(), "{observer}: {}", stderr(&output));
        let text = stdout(&output);
        let tells_shaft = observer.starts_with("compliant") || observer == "kalman";
        assert_eq!(text.lines().next().unwrap().contains("shaft_torque_estimate_n_m"), tells_shaft);
        assert_eq!(text.lines().count(), 9502);
        outputs.push(text);
    }
    outputs.sort();
    outputs.dedup();
    // At 1 ms too every method has a gain of its own in the inertia phase.
    assert_eq!(outputs.len(), observers.len());
    let output = estimate("kalman --method interval");
    assert!(output.status.success());
    assert!(stderr(&output).contains("warning: --method has no effect: "), "{}", stderr(&output));
}

#[test]
fn the_filter_can_be_told_of_the_sensors() {
    let folder = Folder::new("sensors");
    wetclutch(&["demo", "-o", &folder.path("demo")]);
    let log = folder.path("demo/measured.csv");
    let estimate = |more: &[&str]| wetclutch(&[&["estimate", &log, "--vehicle", VEHICLE], more].concat());
    let experiments = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments");
    let told = estimate(&["--sensors", &format!("{experiments}/bench.toml")]);
    assert!(told.status.success(), "{}", stderr(&told));
    assert_ne!(stdout(&told), stdout(&estimate(&[])));
    let output = estimate(&["--observer", "rigid", "--sensors", &format!("{experiments}/bench.toml")]);
    assert!(output.status.success());
    assert!(stderr(&output).contains("warning: --sensors has no effect: "), "{}", stderr(&output));
    let output = estimate(&["--sensors", &format!("{experiments}/e1.toml")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("there is no [sensors] table"), "{}", stderr(&output));
}

#[test]
fn the_compliant_observer_asks_for_the_wheel_speed() {
    let folder = Folder::new("wheel");
    std::fs::write(
        folder.path("log.csv"),
        "time_s,engine_speed_rpm,turbine_speed_rpm,output_speed_rpm,oncoming_current_a\n0,2000,1900,760,0\n",
    )
    .unwrap();
    let run =
        |observer| wetclutch(&["estimate", &folder.path("log.csv"), "--vehicle", VEHICLE, "--observer", observer]);
    assert!(run("rigid").status.success());
    let output = run("compliant");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("there is no column `wheel_speed_rad_s`"), "{}", stderr(&output));
}

#[test]
fn reproduce_writes_page_markdown_numbers_and_figures() {
    let folder = Folder::new("reproduce");
    let output = wetclutch(&["reproduce", "-o", &folder.path("a"), "--settings", "2", "--json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let mut printed: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(printed.as_object_mut().unwrap().remove("json_version"), Some(1.into()));
    let numbers: serde_json::Value = serde_json::from_str(&read(folder.path("a/reproduction.json"))).unwrap();
    assert_eq!(printed, numbers);
    assert_eq!(numbers["settings"]["drawn"], 2);
    let rows = numbers["statements"].as_array().unwrap();
    assert!(rows.len() >= 30);
    for row in rows {
        assert!(row["ours"].is_number() && row["unit"].is_string(), "{row}");
        assert!(row["agrees"].is_boolean() || row["bound"]["holds_at_start"].is_boolean(), "{row}");
    }
    let peak = &rows[0];
    assert_eq!((&peak["id"], &peak["chapter"]), (&"rigid_peak_change".into(), &(-0.35).into()));
    assert!(peak["share_of_settings"]["agrees"].is_number());
    for name in ["reproduction.html", "e1.svg", "e2.svg", "e3.svg", "e4.svg", "map_engine.svg", "map_f1_f2.svg"] {
        assert!(Path::new(&folder.path(&format!("a/{name}"))).exists(), "{name}");
    }
    let html = read(folder.path("a/reproduction.html"));
    assert!(html.contains("certified band") && html.contains("Sliding 1 (large)") && html.contains("after decay"));
}

/// A line of the documentation without what depends on the number of settings: their fractions and their count.
fn without_settings(line: &str) -> String {
    let is_fraction = |cell: &str| {
        cell.trim().strip_suffix(" %").is_some_and(|fraction| fraction.bytes().all(|byte| byte.is_ascii_digit()))
    };
    if line.contains(" settings sampled: ") {
        return String::new();
    }
    line.split('|').filter(|cell| !is_fraction(cell)).collect::<Vec<_>>().join("|")
}

/// The settings themselves take minutes in a build for tests; CI compares their fractions in a release build.
#[test]
fn the_reproduction_in_the_documentation_is_what_the_program_writes() {
    let folder = Folder::new("stale");
    wetclutch(&["reproduce", "-o", &folder.path("a"), "--settings", "1"]);
    let committed = read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/reproduction.md"));
    let lines = |text: &str| text.lines().map(without_settings).collect::<Vec<_>>();
    assert_eq!(
        lines(&read(folder.path("a/reproduction.md"))),
        lines(&committed),
        "docs/reference/reproduction.md is stale: run `cargo run --release -- reproduce` and copy reproduction.md there"
    );
}

#[test]
fn the_figure_in_the_documentation_has_the_labels_that_the_demo_writes() {
    let folder = Folder::new("stale-figure");
    wetclutch(&["demo", "-o", &folder.path("demo")]);
    // The last digit of a coordinate may follow from the machine's mathematical functions; the words do not.
    let labels = |path: &str| -> Vec<String> {
        let svg = read(path);
        let texts = svg.split("<text").skip(1).filter_map(|rest| rest.split_once('>')?.1.split_once('<'));
        texts.map(|(label, _)| label.to_owned()).collect()
    };
    let committed = labels(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/figures/shift.svg"));
    assert!(committed.iter().any(|label| label.starts_with("Kalman")), "{committed:?}");
    assert!(
        labels(&folder.path("demo/shift.svg")) == committed,
        "docs/figures/shift.svg is stale: run `cargo run --release -- demo` and copy shift.svg there"
    );
}

#[test]
fn design_serves_every_observer() {
    let printed = |observer| {
        let output = wetclutch(&["design", VEHICLE, "--observer", observer]);
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    assert!(printed("compliant").contains("offset bound 0.1769 MPa"), "{}", printed("compliant"));
    assert!(printed("sliding").contains("1923"), "{}", printed("sliding"));
    let output = wetclutch(&["design", VEHICLE, "--observer", "compliant", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(json["torque_phase"]["gain_normalised"].as_array().unwrap().len(), 2);
}

#[test]
fn a_discrete_design_says_when_the_open_loop_serves() {
    let design = |more: &[&str]| wetclutch(&[&["design", VEHICLE, "--observer", "compliant"], more].concat());
    let output = design(&["--method", "peak-to-peak", "--json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(json["torque_phase"]["uses_open_loop"], true);
    assert_eq!(json["inertia_phase"]["uses_open_loop"], false);
    let bound = |phase: &str, name: &str| json[phase][name].as_f64().unwrap();
    assert!(bound("inertia_phase", "bound_pa") < bound("inertia_phase", "open_loop_bound_pa"));
    assert!(bound("torque_phase", "best_gain_bound_pa") > bound("torque_phase", "open_loop_bound_pa"));
    assert!(
        stdout(&design(&["--method", "iss-discrete"])).contains("the gain is the open loop: no gain reduces the bound")
    );
    for unused in [&["--bound-on", "pressure"][..], &["--method", "scheduled", "--kappa2", "40"]] {
        let output = design(unused);
        let option = unused.iter().rfind(|word| word.starts_with("--")).unwrap();
        assert!(output.status.success());
        assert!(
            stderr(&output).contains(&format!("warning: {option} has no effect: it is for ")),
            "{}",
            stderr(&output)
        );
        let without: Vec<&str> = unused.iter().copied().take_while(|word| word != option).collect();
        assert_eq!(stdout(&output), stdout(&design(&without)));
    }
    // Friction spoils the pressure and not the torque: on the pressure no gain beats the open loop by this budget.
    let output = design(&["--method", "scheduled", "--bound-on", "pressure"]);
    assert!(
        stdout(&output).contains("inertia phase: the gain is the open loop: no gain reduces the bound"),
        "{}",
        stdout(&output)
    );
    let output = wetclutch(&["design", VEHICLE, "--method", "scheduled"]);
    assert!(stdout(&output).contains("at friction 0.16") && stdout(&output).contains("of the clutch torque"));
    let output = wetclutch(&["design", VEHICLE, "--method", "interval"]);
    assert!(stdout(&output).contains("smallest entry"), "{}", stdout(&output));
}

#[test]
fn sensitivity_of_a_car_with_a_gearbox_says_which_shifts_hide_their_torque() {
    let folder = Folder::new("car-sensitivity");
    let car = format!("{ROOT}vehicles/four_speed.toml");
    let output = wetclutch(&["sensitivity", &car, "-o", &folder.path("out")]);
    let text = printed(&output);
    assert!(text.contains("hidden: ") && text.contains("converter capacity 10 %"), "{text}");
    let both = "`design` and `sensitivity` may call different phases hidden";
    assert!(text.contains(both) && text.contains("four_speed.toml`."), "{text}");
    assert_eq!(
        text.lines().filter(|line| line.contains("upshift") || line.contains("downshift")).count(),
        12,
        "{text}"
    );
    let page = read(folder.path("out/sensitivity.html"));
    assert!(
        page.contains("Both are learnt from shift to shift") && page.contains("with both known it is 1.7 N m"),
        "{page}"
    );
    assert!(page.contains("Torque phase") && page.contains("AODE") && page.contains("bound, either way"));
    assert!(page.contains(&both.replace('`', "")));
    assert!(page.find("<div class=\"figure\">").unwrap() < page.find("<table").unwrap());
    let apart = page.split_once("<h2>What cannot be separated</h2>").unwrap().1;
    for errors in ["Friction and valve gain", "kiss point and gain", "stiffness of the drive shafts", "Lag and delay"] {
        assert!(apart.contains(errors), "{errors}");
    }
    let json: serde_json::Value = serde_json::from_str(&printed(&wetclutch(&["sensitivity", &car, "--json"]))).unwrap();
    assert_eq!(json["shifts"].as_array().unwrap().len(), 12);
    assert!(json["shifts"][0]["inertia_phase"]["deviation_n_m"][0].as_f64().unwrap() > 0.0, "{json}");
}

#[test]
fn sensitivity_shows_what_cannot_be_told_apart() {
    let folder = Folder::new("sensitivity");
    let output = wetclutch(&["sensitivity", VEHICLE, "-o", &folder.path("out")]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).contains("turbine torque, error before the shift") && stdout(&output).contains("0.1 deg"));
    let page = read(folder.path("out/sensitivity.html"));
    assert!(page.contains("Inertia phase, with the shaft torque known"));
    // Figures first: a bar for each error, the widest over the whole width, with a mark at the valve model.
    let charts = page.split_once("<div class=\"charts\">").unwrap().1.split_once("</div>").unwrap().0;
    assert_eq!(charts.matches("<table class=\"chart\">").count(), 4);
    assert!(charts.contains("style=\"width: 100.0%\"") && charts.contains("<i style=\"left: "), "{charts}");
    assert_eq!(charts.matches("<th scope=\"row\">").count(), charts.matches("class=\"effect\"").count());
}

#[test]
fn bench_ranks_the_observers_and_an_experiment_without_scenarios_is_told_so() {
    let output = wetclutch(&["bench", "--json"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let json: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert!(json["rows"].as_array().unwrap().len() >= 22);
    assert_eq!(json["ranking"].as_array().unwrap().len(), 13);
    let output = wetclutch(&["bench", EXPERIMENT]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("there is no [[scenario]]"), "{}", stderr(&output));
}

#[test]
fn a_log_too_slow_for_the_gains_is_said_to_be() {
    let folder = Folder::new("slow");
    let current_a = |row| if row < 10 { 0.0 } else { 0.1 };
    let rows: String = (0..30).map(|i| format!("{},2000,1900,760,{}\n", f64::from(i) * 0.1, current_a(i))).collect();
    let names = "time_s,engine_speed_rpm,turbine_speed_rpm,output_speed_rpm,oncoming_current_a\n";
    std::fs::write(folder.path("log.csv"), format!("{names}{rows}")).unwrap();
    let run = |method| {
        let log = folder.path("log.csv");
        wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "--observer", "rigid", "--method", method])
    };
    assert!(stderr(&run("iss")).contains("the sample time is 100 ms, and this observer corrects over at most 25 ms"));
    let said = stderr(&run("peak-to-peak"));
    assert!(!said.contains("sample time is"), "{said}");
    // At a small current that has risen, the valve that the observers are told is beyond the budget of the maps, and that is
    // said.
    assert!(said.contains("18 of 30 samples have an estimate outside its guaranteed range"), "{said}");
}

#[test]
fn an_output_over_an_input_is_refused_and_the_input_stays() {
    let folder = Folder::new("over");
    let (vehicle, log) = (folder.path("car.toml"), folder.path("log.csv"));
    std::fs::copy(VEHICLE, &vehicle).unwrap();
    let names = "time_s,engine_speed_rpm,turbine_speed_rpm,output_speed_rpm,oncoming_current_a\n";
    std::fs::write(&log, format!("{names}0,2000,1900,760,0.1\n")).unwrap();
    let before = read(&vehicle);
    let output = wetclutch(&["estimate", &log, "--vehicle", &vehicle, "-o", &vehicle]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("the output would replace this input"), "{}", stderr(&output));
    assert_eq!(read(&vehicle), before);
    // A measurement cannot be made again.
    let before = read(&log);
    let output = wetclutch(&["estimate", &log, "--vehicle", &vehicle, "-o", &log]);
    assert!(refused(&output).contains("the output would replace this input"), "{}", stderr(&output));
    assert_eq!(read(&log), before);
}

#[test]
fn an_output_that_is_a_folder_is_found_before_the_work() {
    let folder = Folder::new("page");
    std::fs::create_dir_all(folder.path("out/bench.html")).unwrap();
    let output = wetclutch(&["bench", "-o", &folder.path("out")]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("bench.html") && !stderr(&output).contains("running"), "{}", stderr(&output));
    // What looks whether a folder can be written to leaves nothing behind.
    assert_eq!(std::fs::read_dir(folder.path("out")).unwrap().count(), 1);
}

#[test]
fn a_column_with_another_meaning_is_not_proposed() {
    let folder = Folder::new("hint");
    let log = folder.path("log.csv");
    std::fs::write(
        &log,
        "time_s,engine_speed,turbine_speed_rpm,output_speed_rpm,wheel_speed_rpm,oncoming_current_a\n0,1,1,1,1,1\n",
    )
    .unwrap();
    let said = stderr(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE]));
    assert!(said.contains("`engine_speed` has a similar name") && !said.contains("`wheel_speed"), "{said}");
}

const GEARBOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../gearboxes/8hp.toml");

#[test]
fn check_prints_the_gears_and_shifts_of_a_gearbox_and_draws_them() {
    let folder = Folder::new("gearbox");
    let output = wetclutch(&["check", GEARBOX, "-o", &folder.path("out")]);
    assert!(output.status.success(), "{}", stderr(&output));
    let printed = stdout(&output);
    // Third gear: ratio, step and the torques of B, C and E; the shift 2-3; those that change two elements.
    for part in
        ["2.1039  1.488", "-0.656", "2-3    A    C   B E", "double transition: R-3 R-6 1-4", "torque phase, then"]
    {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    for file in ["out/train.svg", "out/gear_R.svg", "out/gear_8.svg"] {
        assert!(read(folder.path(file)).ends_with("</svg>"), "{file}");
    }
    let refused = wetclutch(&["check", VEHICLE, "-o", &folder.path("out")]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("only a gearbox is drawn"));
}

#[test]
fn a_gearbox_of_ratios_alone_is_told_what_pressure_needs() {
    let folder = Folder::new("ratios");
    let path = folder.path("ratios.toml");
    let text = "name = \"ratios\"\nlevel = \"ratios\"\ngear = [{ name = \"1\", ratio = 3.0 }, { name = \"2\", ratio = 2.0 }]\n";
    std::fs::write(&path, text).unwrap();
    let output = wetclutch(&["check", &path]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stdout(&output).contains("pressures need their plates and pistons"), "{}", stdout(&output));
    let refused = wetclutch(&["check", &path, "-o", &folder.path("out")]);
    assert!(stderr(&refused).contains("only a stick diagram can be drawn"));
}
