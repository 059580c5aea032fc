//! `fit`: from logs of shifts to a vehicle file, and to estimates with it.

#[path = "../../fit/tests/common/mod.rs"]
pub(crate) mod common;

use common::{Logs, TestCar};
use trace::signal;

use crate::any_car::with_column;
use crate::support::{BENCH, Folder, VEHICLE, printed, said, stderr, wetclutch};

/// RMS error of the torque that the valve maps of a vehicle file give, N m, over logs with their truth.
fn torque_error(folder: &Folder, vehicle: &str, logs: &[(String, trace::Trace)]) -> f64 {
    let (mut count, mut sum) = (0.0, 0.0);
    for (log, truth) in logs {
        let estimate = folder.path("estimate.csv");
        let arguments = ["estimate", log, "--vehicle", vehicle, "--observer", "open-loop-maps", "-o", &estimate];
        printed(&wetclutch(&arguments));
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
    arguments.extend(["--vehicle", VEHICLE, "--sensors", BENCH, "-o", &fitted]);
    let output = wetclutch(&arguments);
    let said = printed(&output);
    let valve_gain = said.lines().find(|line| line.starts_with("valve gain ")).unwrap();
    assert!(valve_gain.ends_with("not identified by these logs"), "{valve_gain}");
    assert!(said.contains("torque scale: not identified by these logs"), "{said}");
    assert!(said.contains("weigh the car"), "{said}");
    let text = std::fs::read_to_string(&fitted).unwrap();
    let given = std::fs::read_to_string(VEHICLE).unwrap();
    // Every line of the given file is there, but for those with new values.
    let lost = given.lines().filter(|line| !text.lines().any(|other| other == *line)).count();
    assert!(lost < 40, "{lost} lines changed");
    assert!(text.contains("# fit: x "), "{text}");
    printed(&wetclutch(&["check", &fitted]));
    let others: Vec<(String, trace::Trace)> = (100..103)
        .map(|number| {
            let [measured, truth] = car.logs(number, Logs::SpeedsAndCurrent);
            let path = folder.path(&format!("other_{number}.csv"));
            trace::write_csv(std::path::Path::new(&path), &measured).unwrap();
            (path, truth)
        })
        .collect();
    let [before, after] = [VEHICLE, &fitted].map(|vehicle| torque_error(&folder, vehicle, &others));
    assert!(after < 0.35 * before, "{before} {after}");
}

/// A table of one shift as text.
fn one_shift(seed: u64) -> String {
    let [measured, _] = TestCar::drawn(seed).logs(0, Logs::SpeedsAndCurrent);
    let mut text =
        format!("time_s,{}\n", measured.columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(","));
    for (i, time_s) in measured.time_s.iter().enumerate() {
        let cells = measured.columns.iter().map(|column| measured.get(&column.name).unwrap()[i].to_string());
        text += &format!("{time_s},{}\n", cells.collect::<Vec<_>>().join(","));
    }
    text
}

#[test]
fn what_a_log_lacks_is_said_and_no_file_is_written() {
    let folder = Folder::new("lacks");
    let text = one_shift(1);
    let head = |rows: usize| text.lines().take(rows).map(|line| format!("{line}\n")).collect::<String>();
    let lines = text.lines().count();
    let cases = [
        ("no rows", head(1), "there are no rows"),
        ("one row", head(2), "have no power-on upshift from ratio 2.500 to 1.000"),
        ("no shift", head(lines / 4), "have no power-on upshift"),
        ("no turbine", text.replace("turbine_speed_rad_s", "x"), "there is no turbine_speed"),
        ("no command", text.replace("oncoming_current_a", "x"), "--channel oncoming_current=NAME"),
        ("wrong unit", text.replace("engine_speed_rad_s", "engine_speed_rpm"), "it looks like rad/s"),
        ("ages", text.replace("offgoing_current_a", "engine_speed_age_s"), "has ages of readings"),
    ];
    let fitted = folder.path("fitted.toml");
    for (case, text, expected) in cases {
        let log = folder.write("log.csv", &text);
        let output = wetclutch(&["fit", &log, "--vehicle", VEHICLE, "-o", &fitted]);
        assert_eq!(output.status.code(), Some(2), "{case}: {}", stderr(&output));
        assert!(stderr(&output).contains(expected), "{case}: {}", stderr(&output));
        assert!(!std::path::Path::new(&fitted).exists(), "{case}");
    }
    // Nor is a measurement replaced.
    let (log, other) = (folder.write("log.csv", &text), folder.write("other.csv", &text));
    let output = wetclutch(&["fit", &log, "--vehicle", VEHICLE, "-o", &other]);
    assert!(stderr(&output).contains("exists and is no vehicle file"), "{}", stderr(&output));
    assert!(folder.read("other.csv") == text);
}

/// A current that is read three times too large asks for values that no car of the file can have.
#[test]
fn values_that_are_not_written_leave_the_given_file_with_the_reason_and_no_failure() {
    let folder = Folder::new("kept");
    let column = "oncoming_current_a";
    let log = folder.write(
        "log.csv",
        with_column(&one_shift(1), column, |cell| {
            cell.parse::<f64>().map_or(cell.to_owned(), |current_a| (3.0 * current_a).to_string())
        }),
    );
    let [fitted, again] = ["fitted.toml", "again.toml"].map(|name| folder.path(name));
    let output = wetclutch(&["fit", &log, "--vehicle", VEHICLE, "--sensors", BENCH, "-o", &fitted, "--json"]);
    let found: serde_json::Value = serde_json::from_str(&printed(&output)).unwrap();
    assert!((&found["json_version"], &found["shifts"]) == (&1.into(), &1.into()), "{found}");
    let reason = found["given_values_kept_because"].as_str().unwrap();
    assert!(reason.starts_with("at the limit of the prior (4 standard deviations): "), "{found}");
    for parameter in found["parameters"].as_array().unwrap() {
        let [lower, value, upper] = ["lower", "value", "upper"].map(|name| parameter[name].as_f64().unwrap());
        assert!(lower <= value && value <= upper && parameter["unit"].is_string(), "{parameter}");
    }
    assert!(
        said(&output)
            .contains("warning: the given values are kept: at the limit of the prior (4 standard deviations): "),
        "{}",
        stderr(&output)
    );
    let text = folder.read("fitted.toml");
    let (head, rest) = text.split_once('\n').unwrap();
    assert!(
        head.starts_with(
            "# fit: all values are those of the given file. at the limit of the prior (4 standard deviations): "
        ),
        "{head}"
    );
    assert_eq!(rest, std::fs::read_to_string(VEHICLE).unwrap());
    // A fit of that file says nothing of this one.
    let log = folder.write("right.csv", one_shift(1));
    said(&wetclutch(&["fit", &log, "--vehicle", &fitted, "--sensors", BENCH, "-o", &again]));
    let text = folder.read("again.toml");
    assert!(text.starts_with("# fit: values below lines like this one come from 1 shifts"), "{text}");
    assert!(!text.contains("all values are those of the given file"), "{text}");
    // Without a fit the file stays as it was, and the command fails.
    let log = folder.write("none.csv", "time_s\n");
    let output = wetclutch(&["fit", &log, "--vehicle", VEHICLE, "-o", &fitted]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(folder.read("fitted.toml").starts_with("# fit: all values"));
    // Nor does a result that cannot be written end well.
    let below_a_file = folder.path("right.csv/fitted.toml");
    let output = wetclutch(&["fit", &folder.path("right.csv"), "--vehicle", VEHICLE, "-o", &below_a_file]);
    assert!(matches!(output.status.code(), Some(1 | 2)), "{}", stderr(&output));
}

#[test]
fn one_shift_with_lost_readings_is_fitted_and_the_report_says_how_little_that_is() {
    let folder = Folder::new("one");
    // Every fifth engine speed and every seventh wheel speed are lost, and there is no command of the offgoing clutch.
    let whole = one_shift(1);
    let lossy = whole.lines().enumerate().map(|(i, line)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if i > 0 && i % 5 == 0 {
            cells[1] = "";
        }
        if i > 0 && i % 7 == 0 {
            cells[4] = "nan";
        }
        cells.pop();
        cells.join(",") + "\n"
    });
    let log = folder.write("log.csv", lossy.collect::<String>());
    let fitted = folder.path("fitted.toml");
    let output = wetclutch(&["fit", &log, "--vehicle", VEHICLE, "-o", &fitted]);
    let said = printed(&output);
    assert!(said.contains("one shift only"), "{said}");
    assert!(said.contains("no shift is held out"), "{said}");
    assert!(said.contains("shifts used: 1 of 1 power-on upshift\n"), "{said}");
    printed(&wetclutch(&["check", &fitted]));
    let output = wetclutch(&["fit", &log, "--vehicle", &fitted, "-o", &fitted]);
    assert!(stderr(&output).contains("the output would replace this input"), "{}", stderr(&output));
}

#[test]
fn a_new_vehicle_file_can_be_used_and_is_not_written_over() {
    let folder = Folder::new("init");
    let car = folder.path("car.toml");
    let numbers =
        ["--mass-kg", "1650", "--wheel-radius-m", "0.32", "--final-ratio", "3.2", "--engine-torque-n-m", "250"];
    let init = |ratios: &str| wetclutch(&[&["init", "--ratios", ratios, "-o", &car], &numbers[..]].concat());
    let output = init("2.34,4.17");
    assert!(stderr(&output).contains("which is no upshift"), "{}", stderr(&output));
    assert!(stderr(&init("4.17")).contains("two ratios"));
    assert!(!init("nan,2").status.success());
    printed(&init("4.17,2.34"));
    printed(&wetclutch(&["check", &car]));
    // The same once more changes nothing.
    printed(&init("4.17,2.34"));
    assert!(stderr(&init("4.17,2.35")).contains("is there already"));
    folder.write("car.toml", folder.read("car.toml") + "# mine\n");
    assert!(stderr(&init("4.17,2.34")).contains("is there already"));
}
