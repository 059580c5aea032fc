//! `--units`: what people read is in their units, what programs read is in SI.

use std::process::Command;

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, shown, stderr, wetclutch};

/// The first number behind these words.
fn number_behind(text: &str, words: &str) -> f64 {
    let rest = text.split(words).nth(1).unwrap_or_else(|| panic!("{words}: {text}"));
    rest.split_whitespace().next().unwrap().parse().unwrap()
}

#[test]
fn results_are_shown_in_the_units_that_are_wanted() {
    let car = format!("{ROOT}vehicles/eight_speed.toml");
    let plain = printed(&wetclutch(&["check", &car]));
    let text = printed(&wetclutch(&["check", &car, "--units", "bar,lb ft"]));
    let (mpa, bar) = (number_behind(&plain, "kiss point "), number_behind(&text, "kiss point "));
    assert!((10.0 * mpa - bar).abs() < 0.006, "{mpa} MPa, {bar} bar");
    let (n_m, lb_ft) = (number_behind(&plain, "MPa, holds "), number_behind(&text, "bar, holds "));
    assert!((n_m / 1.355_818 - lb_ft).abs() < 0.6, "{n_m} N m, {lb_ft} lb ft");
    assert!(text.contains("holds lb ft  needed lb ft") && !text.contains("N m  "), "{text}");
}

#[test]
fn files_and_json_do_not_depend_on_the_units() {
    let folder = Folder::new("units");
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("sim")]));
    let log = folder.path("sim/e1_measured.csv");
    let estimate = |name: &str, more: &[&str]| {
        let output = folder.path(name);
        shown(&wetclutch(&[&["estimate", &log, "--vehicle", VEHICLE, "-o", &output], more].concat()))
    };
    let (plain, other) = (estimate("si.csv", &[]), estimate("other.csv", &["--units", "rad/s,kPa"]));
    assert!(plain.contains("MPa") && plain.contains("rpm") && !plain.contains("kPa "), "{plain}");
    assert!(other.contains("kPa") && other.contains("rad/s") && !other.contains("MPa"), "{other}");
    for ending in [".csv", "_shifts.csv", "_shifts.json"] {
        assert_eq!(folder.read(&format!("si{ending}")), folder.read(&format!("other{ending}")), "{ending}");
    }
    // Axes and tables of the page.
    let page = folder.read("other_report.html");
    assert!(page.contains("\"name\":\"speed (rad/s)\"") && page.contains("clutch pressure (kPa)"));
    assert!(page.contains("<th scope=\"col\">flare rad&#x2f;s</th>") && !page.contains("(MPa)"));
    let json = |units: &str| printed(&wetclutch(&["sensitivity", "--json", "--units", units]));
    assert_eq!(json("bar"), json("psi"));
}

#[test]
fn units_come_from_the_environment_too_and_wrong_ones_are_named() {
    let inspect = |units: &str, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wetclutch"));
        command.env("WETCLUTCH_UNITS", units).args(["check", VEHICLE]).args(more).output().unwrap()
    };
    assert!(printed(&inspect("psi", &[])).contains(" psi"));
    assert!(printed(&inspect("", &[])).contains(" MPa"));
    assert!(printed(&inspect("psi", &["--units", "bar"])).contains(" bar"));
    for (units, words) in [("furlong", "rad/s, rpm"), ("bar,kPa", "the same quantity"), ("s", "expected some of")] {
        let text = refused(&wetclutch(&["check", VEHICLE, "--units", units]));
        assert!(text.contains(words) && text.contains("--units"), "{text}");
        assert!(refused(&inspect(units, &[])).contains(words));
    }
}

#[test]
fn units_and_force_that_change_nothing_are_said() {
    let folder = Folder::new("unused");
    let car = format!("{ROOT}vehicles/eight_speed.toml");
    let log = folder.write("log.csv", "time_s,turbine_speed_rad_s\n0,1\n0.1,2\n0.2,3\n");
    let table = folder.path("table.csv");
    let cases: [(&[&str], &str); 7] = [
        (&["sensitivity", "--json", "--units", "bar"], "--units has no effect: JSON has SI units"),
        (&["check", VEHICLE, "--json", "--units=bar"], "--units has no effect: JSON has SI units"),
        (&["convert", &log, "-o", &table, "--units", "bar"], "--units has no effect: files have SI units"),
        (&["compare", VEHICLE, VEHICLE, "--units", "bar"], "--units has no effect: keys of files have SI units"),
        (&["check", VEHICLE, "--force"], "--force has no effect: no file is written"),
        (&["inspect", &log, "--force"], "--force has no effect: no file is written"),
        (
            &["export", &car, "--all", "-o", &folder.path("export")],
            "--all has no effect: all shifts of the car are exported without it too",
        ),
    ];
    for (arguments, words) in cases {
        let text = said(&wetclutch(arguments));
        let warning = format!("warning: {words}\nhint: leave it out\n");
        assert!(text.contains(&warning) && text.matches("no effect").count() == 1, "{arguments:?}: {text}");
    }
    let page = folder.path("page.html");
    let used: [&[&str]; 3] = [
        &["check", VEHICLE, "--units", "bar"],
        &["check", VEHICLE, "--page", &page, "--force"],
        &["design", VEHICLE, "--json", "--page", &folder.path("design.html"), "--units", "bar"],
    ];
    for arguments in used {
        let text = stderr(&wetclutch(arguments));
        assert!(!text.contains("no effect"), "{arguments:?}: {text}");
    }
    // Those of the environment are for all commands alike.
    let mut command = Command::new(env!("CARGO_BIN_EXE_wetclutch"));
    let output = command.env("WETCLUTCH_UNITS", "psi").args(["check", VEHICLE, "--json"]).output().unwrap();
    assert!(!stderr(&output).contains("no effect"));
}
