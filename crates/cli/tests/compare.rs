//! `wetclutch compare`: two runs, or two files of cars, over each other.

use std::path::Path;

use serde_json::Value;

use crate::any_car::numbers;
use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, wetclutch};

fn vehicle(name: &str) -> String {
    format!("{ROOT}vehicles/{name}.toml")
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&printed(&wetclutch(&[&["compare"], arguments, &["--json"]].concat()))).unwrap()
}

/// A table of shifts of a car with a gearbox: begin, gears, kind, elements, jerk, worst health.
fn table(rows: &[&str]) -> String {
    let titles = "time_s,from_gear,to_gear,kind,offgoing,oncoming,jerk_m_s3,worst_health";
    std::iter::once(titles).chain(rows.iter().copied()).map(|row| row.to_owned() + "\n").collect()
}

#[test]
fn two_drives_are_compared_shift_by_shift_with_the_largest_difference_first() {
    let folder = Folder::new("compare-runs");
    for seed in ["1", "2"] {
        let out = folder.path(seed);
        said(&wetclutch(&["demo", "--vehicle", &vehicle("four_speed"), "--seed", seed, "-o", &out]));
    }
    let (a, b, page) = (folder.path("1"), folder.path("2"), folder.path("page.html"));
    let output = wetclutch(&["compare", &a, &b, "-o", &page]);
    let text = printed(&output);
    assert!(text.contains("12 shifts are in both runs, matched by their times and gears."), "{text}");
    assert!(said(&output).contains(&format!("page: {page}")));
    let html = folder.read("page.html");
    // One figure of all shifts, and the curves of eight.
    assert_eq!(html.matches("<div class=\"figure\">").count(), 9);
    assert!(html.find("number of the shift").unwrap() < html.find(">quantity</th>").unwrap());
    assert!(html.contains("\"range of A\"") || html.contains("torque of the oncoming clutch"), "{}", html.len());
    let found = json(&[&a, &b]);
    assert_eq!(found["shifts"].as_array().unwrap().len(), 12);
    let ratings = ["1", "2"].map(|run| numbers(&folder.read(&format!("{run}/shifts.csv")), "rating"));
    for shift in found["shifts"].as_array().unwrap() {
        let number = shift["a"]["number"].as_u64().unwrap() as usize;
        for (run, name) in ["a", "b"].iter().enumerate() {
            let rating = shift["differences"]["rating"][name].as_f64().unwrap();
            assert!((rating - ratings[run][number - 1]).abs() < 1e-12, "{shift}");
        }
        assert!(
            shift["curves"].as_array().unwrap().iter().any(|curve| curve["rms_difference"].as_f64().unwrap() > 0.1)
        );
    }
    let rating = found["quantities"].as_array().unwrap().iter().find(|of| of["name"] == "rating").unwrap();
    let mean = ratings[0].iter().sum::<f64>() / 12.0;
    assert!((rating["mean_a"].as_f64().unwrap() - mean).abs() < 1e-12, "{rating}");
}

#[test]
fn a_run_is_the_same_in_every_format_and_a_simulation_is_a_run() {
    let folder = Folder::new("compare-formats");
    let car = vehicle("four_speed");
    said(&wetclutch(&["demo", "--vehicle", &car, "-o", &folder.path("demo")]));
    let log = folder.path("demo/drive_measured.csv");
    let outputs = ["csv", "parquet", "mf4"].map(|ending| folder.path(&format!("{ending}/out.{ending}")));
    for (ending, output) in ["csv", "parquet", "mf4"].iter().zip(&outputs) {
        std::fs::create_dir(folder.path(ending)).unwrap();
        said(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", output]));
    }
    for other in [&outputs[1], &outputs[2], &folder.path("mf4"), &folder.path("parquet/out_shifts.csv")] {
        let found = json(&[&outputs[0], other]);
        for shift in found["shifts"].as_array().unwrap() {
            let curves = shift["curves"].as_array().unwrap();
            assert!(curves.len() > 2, "{other}: {shift}");
            assert!(curves.iter().all(|curve| curve["rms_difference"].as_f64().unwrap() < 1e-6), "{other}: {shift}");
        }
        let quantities = found["quantities"].as_array().unwrap();
        assert!(quantities.iter().all(|of| of["mean_absolute_difference"] == 0.0), "{other}");
    }
    // The signals of the simulation alone, without a table of its shifts: estimates against true values.
    let simulated = folder.write("drive.csv", folder.read("demo/drive.csv"));
    let found = json(&[&simulated, &outputs[0]]);
    assert_eq!((&found["matched_by"], found["shifts"].as_array().unwrap().len()), (&Value::from("time"), 12));
    let time = |shift: &Value, run: &str| shift["differences"]["complete_s"][run].as_f64().unwrap();
    let late = found["shifts"].as_array().unwrap().iter().map(|shift| (time(shift, "b") - time(shift, "a")).abs());
    assert!(late.fold(0.0, f64::max) < 0.035, "{found}");
    let torque = |shift: &Value| {
        let curves = shift["curves"].as_array().unwrap();
        let of = curves.iter().find(|curve| curve["signal"] == "torque of the oncoming clutch");
        of.map(|curve| curve["rms_difference"].as_f64().unwrap())
    };
    let errors: Vec<f64> = found["shifts"].as_array().unwrap().iter().filter_map(torque).collect();
    assert!(errors.len() == 12 && errors.iter().all(|error| (0.01..60.0).contains(error)), "{errors:?}");
}

#[test]
fn a_simulated_shift_of_one_shifts_file_is_compared_with_another() {
    let folder = Folder::new("compare-one-shift");
    for name in ["e1", "e2"] {
        let experiment = format!("{ROOT}experiments/{name}.toml");
        said(&wetclutch(&["simulate", &experiment, "-o", &folder.path(name)]));
    }
    let text = printed(&wetclutch(&["compare", &folder.path("e1"), &folder.path("e2")]));
    assert!(text.contains("1 shift is in both runs"), "{text}");
    let log = folder.path("e1/e1_measured.csv");
    said(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "-o", &folder.path("one.csv")]));
    let found = json(&[&folder.path("e1"), &folder.path("one.csv")]);
    let curves = found["shifts"][0]["curves"].as_array().unwrap();
    let error = curves.iter().find(|curve| curve["signal"] == "pressure of the oncoming clutch").unwrap();
    assert!((1.0..1e5).contains(&error["rms_difference"].as_f64().unwrap()), "{error}");
}

#[test]
fn shifts_of_one_run_alone_and_other_kinds_and_healths_are_listed() {
    let folder = Folder::new("compare-alone");
    let a = folder.write(
        "a_shifts.csv",
        table(&["2.0,1,2,power-on upshift,A,B,5,good", "9,2,3,power-on upshift,B,C,3,good", "20,3,2,coast,C,B,1,good"]),
    );
    let b = folder.write(
        "b_shifts.csv",
        table(&["2.1,1,2,power-off upshift,A,B,4,flare", "9.0,2,3,power-on upshift,B,C,3,good", "30,1,2,x,A,B,5,good"]),
    );
    let text = printed(&wetclutch(&["compare", &a, &b]));
    for words in [
        "2 shifts are in both runs, matched by their times and gears.",
        "In A alone: 3-2 at 20.00 s.",
        "In B alone: 1-2 at 30.00 s.",
        "are not there: no curves are compared.",
        "power-on upshift -> power-off upshift",
        "good -> flare",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    // The shift with the larger difference stands first, and its difference has the unit.
    let first = text.lines().position(|line| line.contains("power-off upshift")).unwrap();
    let second = text.lines().position(|line| line.contains("2-3")).unwrap();
    assert!(first < second && text.contains("5.0 m/s^3  4.0 m/s^3"), "{text}");
    // Other times: by gears and kind.
    let later = folder.write("later_shifts.csv", table(&["102,1,2,power-on upshift,A,B,6,good"]));
    let text = printed(&wetclutch(&["compare", &a, &later]));
    assert!(text.contains("1 shift is in both runs, matched by gears and kind"), "{text}");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = Folder::new("compare-refused");
    let row = "2,1,2,power-on upshift,A,B,5,good";
    let (car, run) = (vehicle("eight_speed"), folder.write("run_shifts.csv", table(&[row])));
    let provokes = |a: &str, b: &str, words: &str| {
        let text = refused(&wetclutch(&["compare", a, b]));
        assert!(text.starts_with("error: ") && text.contains(words) && text.contains("\nhint: "), "{words}: {text}");
    };
    provokes(&car, &run, "a file of a car is not compared with a run");
    provokes(&run, &car, "a file of a car is not compared with a run");
    provokes(&car, &format!("{ROOT}gearboxes/8hp.toml"), "is a vehicle file of a car with a gearbox, and ");
    provokes(&car, EXPERIMENT, "this is an experiment file, expected a vehicle file or a gearbox file");
    let none = folder.write("none.csv", "time_s,gear,target_gear\n0,1,1\n1,1,1\n");
    provokes(&run, &none, "the run has no shift");
    let down = folder.write("down_shifts.csv", table(&["2,2,1,coast downshift,B,A,5,good"]));
    provokes(&run, &down, "has 1-2 power-on upshift, ");
    provokes(&run, &down, "the runs have no shift in common");
    let other = folder.write("other_shifts.csv", table(&[&row.replace("A,B", "D,E")]));
    provokes(&run, &other, "the shift 1-2 is one of A and B in ");
    provokes(&run, &other, "the runs are of cars with different gearboxes");
    let one = folder.write("one_shifts.csv", "time_s,number,from_gear,to_gear,load\n2,1,1,2,power_on\n");
    provokes(&run, &one, " is a run of a car with a gearbox, and ");
    provokes(&run, &one, " one of a vehicle file of one shift");
    let log = folder.write("log.csv", "time_s,engine_speed_rad_s\n0,1\n");
    provokes(&run, &log, "there is no table of shifts beside it, and it is no simulated drive");
    provokes(&run, &folder.write("odd_shifts.csv", "time_s,x\n0,1\n"), "this is no table of shifts");
    provokes(&run, &folder.path(""), "there are 5 runs in this folder: ");
    std::fs::create_dir(folder.path("empty")).unwrap();
    provokes(&run, &folder.path("empty"), "and no simulated drive in this folder");
    assert!(refused(&wetclutch(&["compare", &run, &run, "--open"])).contains("--output"));
    assert!(refused(&wetclutch(&["compare", &run, &run, "-o", &log])).contains("exists and is no page in HTML"));
    assert!(!Path::new(&folder.path("page.html")).exists());
}

#[test]
fn two_vehicle_files_show_the_keys_that_differ_with_defaults_and_gearbox() {
    let folder = Folder::new("compare-files");
    let text = std::fs::read_to_string(vehicle("eight_speed")).unwrap();
    std::fs::create_dir(folder.path("gearboxes")).unwrap();
    std::fs::create_dir(folder.path("vehicles")).unwrap();
    let (_, rest) = text.split_once("gearbox = \"../gearboxes/").unwrap();
    let (gearbox, _) = rest.split_once('"').unwrap();
    let train = std::fs::read_to_string(format!("{ROOT}gearboxes/{gearbox}")).unwrap();
    folder.write(&format!("gearboxes/{gearbox}"), train.replacen("name = \"", "name = \"another ", 1));
    let mass = text.lines().find(|line| line.starts_with("mass_kg")).unwrap();
    let other = folder.write("vehicles/other.toml", text.replace(mass, "mass_kg = 4000"));
    let same = printed(&wetclutch(&["compare", &vehicle("eight_speed"), &vehicle("eight_speed")]));
    assert!(same.contains(" keys have the same values."), "{same}");
    let found = json(&[&vehicle("eight_speed"), &other]);
    let differences = found["differences"].as_array().unwrap();
    // Words stand before numbers.
    let keys: Vec<&str> = differences.iter().map(|of| of["key"].as_str().unwrap()).collect();
    assert_eq!(keys, ["gearbox: name", "vehicle.mass_kg"]);
    assert_eq!((&differences[1]["unit"], &differences[1]["b"]["value"]), (&Value::from("kg"), &Value::from("4000")));
    assert!(differences[1]["relative"].as_f64().unwrap() > 0.5);
    let text = printed(&wetclutch(&["compare", &vehicle("eight_speed"), &other]));
    assert!(text.contains("2 keys differ, and ") && text.contains("vehicle.mass_kg"), "{text}");
    // A short file against the file that its defaults are from.
    let short = folder.write(
        "short.toml",
        format!("name = \"s\"\ngearbox = '{ROOT}gearboxes/{gearbox}'\n[vehicle]\nmass_kg = 1700\n"),
    );
    let found = json(&[&short, &vehicle("eight_speed")]);
    let differences = found["differences"].as_array().unwrap();
    let mass = differences.iter().find(|of| of["key"] == "vehicle.mass_kg").unwrap();
    assert_eq!((&mass["a"]["value"], &mass["a"]["default"]), (&Value::from("1700"), &Value::from(false)));
    // Nothing but what the short file says differs: its defaults are those of the other.
    let keys: Vec<&str> = differences.iter().map(|of| of["key"].as_str().unwrap()).collect();
    assert_eq!(keys, ["launch", "name", "vehicle.mass_kg"], "{found}");
}

#[test]
fn names_on_the_page_are_text() {
    let folder = Folder::new("compare-names");
    let row = "2,1,2,<script>alert(1)</script>,A,B,5,good";
    let a = folder.write("<img src=x onerror=alert(1)>_shifts.csv", table(&[row]));
    let page = folder.path("page.html");
    said(&wetclutch(&["compare", &a, &a, "-o", &page]));
    let html = folder.read("page.html");
    assert!(
        !html.contains("<script>alert") && !html.contains("<img") && html.contains("&lt;script&gt;alert(1)"),
        "{html}"
    );
}
