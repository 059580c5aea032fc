//! `wetclutch fit --adaptation-table`, and folders of logs.

use crate::fit_gearbox::{CAR, town};
use crate::support::{refused, said, wetclutch};

#[test]
fn a_folder_of_logs_gives_a_table_by_clutch_gears_and_oil_temperature() {
    let (folder, log) = town();
    std::fs::create_dir(folder.path("logs")).unwrap();
    let warm = folder.read("city_measured.csv");
    let with_oil = |text: &str, degc: &str| -> String {
        let rows = text.lines().enumerate().map(|(row, line)| match row {
            0 => format!("{line},oil_temperature_degc\n"),
            _ => format!("{line},{degc}\n"),
        });
        rows.collect()
    };
    folder.write("logs/a.csv", with_oil(&warm, "85"));
    folder.write("logs/notes.md", "# my drives\n");
    let (fitted, table) = (folder.path("fitted.toml"), folder.path("adaptations.csv"));
    let fit = |logs: &str, more: &[&str]| {
        wetclutch(&[&["fit", logs, "--vehicle", CAR, "-o", &fitted, "--adaptation-table", &table], more].concat())
    };
    let page = folder.path("fit.html");
    let notes = said(&fit(&folder.path("logs"), &["--oil-step", "10", "--page", &page]));
    let page = folder.read("fit.html");
    assert!(page.contains("Adaptation table") && page.contains("80 to 90") && page.contains("kiss point (kPa)"));
    assert!(notes.contains("adaptation table, oil of 80 to 90 degC: "), "{notes}");
    let is_kept = notes.contains("warning: the given values are kept");
    assert_eq!(notes.contains("the fit of all shifts is not accepted"), is_kept, "{notes}");
    let text = folder.read("adaptations.csv");
    let columns = text.lines().next().unwrap().split(',').count();
    assert!(text.starts_with(
        "element,from_gear,to_gear,role,oil_from_degc,oil_to_degc,shifts,quantity,unit,value,lower,upper,"
    ));
    for row in ["E,all,all,all,80,90,", "E,1,2,oncoming,80,90,", "C,1,2,offgoing,80,90,"] {
        for quantity in ["kiss point,Pa", "valve lag,s", "valve delay,s", "friction x valve gain,1"] {
            let found = text.lines().find(|line| line.starts_with(row) && line.contains(&format!(",{quantity},")));
            let found = found.unwrap_or_else(|| panic!("{row} {quantity}: {text}"));
            let numbers: Vec<f64> = found.split(',').take(columns).filter_map(|cell| cell.parse().ok()).collect();
            let [.., value, low, high, alone, _] = numbers[..] else { panic!("{found}") };
            assert!(low <= value && value <= high && value == alone, "{found}");
        }
    }
    // An offgoing clutch is not filled.
    assert!(!text.lines().any(|line| line.contains(",offgoing,") && line.contains(",fill time,")), "{text}");
    // What the program itself wrote is no log: tables of shifts, the truth of a simulation, this table.
    for name in ["city.csv", "city_measured.csv", "city_shifts.csv"] {
        std::fs::copy(folder.path(name), folder.path(&format!("logs/{name}"))).unwrap();
    }
    // Of the half of the drive that has no temperature in this log it has one in no other.
    let half: String = warm.lines().take(9000).map(|line| format!("{line}\n")).collect();
    folder.write("logs/a.csv", with_oil(&half, "85"));
    folder.write("logs/other_shifts.csv", "number,time_s,from_gear,to_gear,kind\n1,2,1,2,\n");
    let (in_folder, fitted_there) = (folder.path("logs/adaptations.csv"), folder.path("logs/fitted.toml"));
    for _ in 0..2 {
        let options = ["--vehicle", CAR, "-o", &fitted_there, "--adaptation-table", &in_folder];
        let notes = said(&wetclutch(&[&["fit", &folder.path("logs")], &options[..]].concat()));
        assert!(notes.contains("some shifts have no oil temperature between -60 and 200 degC"), "{notes}");
    }
    // It is written again, and over nothing else.
    said(&fit(&log, &["--json"]));
    assert!(folder.read("adaptations.csv").contains("E,all,all,all,,,"));
    folder.write("adaptations.csv", "time_s,a\n0,1\n");
    let error = refused(&fit(&log, &[]));
    assert!(error.contains("exists and is no adaptation table\nhint: "), "{error}");
    let same = folder.path("./fitted.toml");
    let error = refused(&wetclutch(&["fit", &log, "--vehicle", CAR, "-o", &fitted, "--adaptation-table", &same]));
    assert!(
        error.contains("this is another output of this command\nhint: choose another name after --adaptation-table"),
        "{error}"
    );
}

/// A table of shifts of a simulation replaces one of a simulation, and no table of estimates.
#[test]
fn a_simulation_keeps_tables_of_shifts_of_others() {
    let (folder, _) = town();
    let simulate = || wetclutch(&["simulate", &folder.path("city.toml"), "--vehicle", CAR, "-o", &folder.path("")]);
    said(&simulate());
    for other in ["number,time_s,from_gear,to_gear,worst_health\n1,2,1,2,good\n", "\nmy notes\n"] {
        folder.write("city_shifts.csv", other);
        let error = refused(&simulate());
        assert!(error.contains("city_shifts.csv: exists and is no table of shifts of a simulation\nhint: "), "{error}");
        assert_eq!(folder.read("city_shifts.csv"), other);
    }
}

#[test]
fn what_has_no_adaptation_table_is_refused() {
    let (folder, log) = town();
    let (fitted, table) = (folder.path("fitted.toml"), folder.path("adaptations.csv"));
    let two_speed = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_at.toml");
    let error =
        refused(&wetclutch(&["fit", &log, "--vehicle", two_speed, "-o", &fitted, "--adaptation-table", &table]));
    assert!(error.contains("an adaptation table is of a car with a gearbox\nhint: "), "{error}");
    std::fs::create_dir(folder.path("empty")).unwrap();
    let error = refused(&wetclutch(&["fit", &folder.path("empty"), "--vehicle", CAR, "-o", &fitted]));
    assert!(error.contains("empty: there is no log in this folder\nhint: its logs end in .csv, "), "{error}");
    for (step, words) in [("1", "expected a number from 2 to 200"), ("-5", "expected a number from 2 to 200")] {
        let output = wetclutch(&[
            "fit",
            &log,
            "--vehicle",
            CAR,
            "-o",
            &fitted,
            "--adaptation-table",
            &table,
            "--oil-step",
            step,
        ]);
        assert!(refused(&output).contains(words));
    }
    assert!(!std::path::Path::new(&table).exists());
}
