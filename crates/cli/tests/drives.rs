//! Drives from the command line.

use std::process::Output;

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, wetclutch};

const SHORT: &str = "name = \"Short\"\n[[segment]]\nduration_s = 15\nthrottle = [0.1, 0.4]\n";

/// A folder with a drive file.
fn with_drive(name: &str, drive: &str) -> Folder {
    let folder = Folder::new(name);
    folder.write("drive.toml", drive);
    folder
}

fn simulate(folder: &Folder, more: &[&str]) -> Output {
    let (drive, out) = (folder.path("drive.toml"), folder.path("out"));
    wetclutch(&[&["simulate", &drive, "-o", &out], more].concat())
}

#[test]
fn a_drive_writes_every_signal_and_those_that_a_car_measures() {
    let folder = with_drive("columns", SHORT);
    let vehicle = format!("{ROOT}vehicles/six_speed.toml");
    let output = simulate(&folder, &["--vehicle", &vehicle]);
    let text = said(&output);
    assert!(text.contains("drive: 15 s, "), "{text}");
    let (whole, measured) = (folder.read("out/short.csv"), folder.read("out/short_measured.csv"));
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
    let folder = with_drive("vehicle", SHORT);
    let none = refused(&simulate(&folder, &[]));
    assert!(none.contains("or the option --vehicle"), "{none}");
    let other = refused(&simulate(&folder, &["--vehicle", VEHICLE]));
    assert!(other.contains("two_speed_at.toml"), "{other}");
    let experiment = refused(&wetclutch(&["simulate", EXPERIMENT, "--vehicle", VEHICLE, "-o", &folder.path("out")]));
    assert!(experiment.contains("hint: --vehicle is for a drive file"), "{experiment}");
}

#[test]
fn a_shift_that_the_gearbox_does_not_have_is_named() {
    let drive = "name = \"d\"\nshift = [{ time_s = 1, gear = \"7\" }]\n[[segment]]\nduration_s = 3\nthrottle = 0.1\n";
    let folder = with_drive("shift", drive);
    let output = simulate(&folder, &["--vehicle", &format!("{ROOT}vehicles/six_speed.toml")]);
    let text = refused(&output);
    assert!(text.contains("gear") && text.contains("7"), "{text}");
}

#[test]
fn check_describes_a_car_and_a_drive() {
    let output = wetclutch(&["check", &format!("{ROOT}drives/city.toml")]);
    let printed = printed(&output);
    for part in ["drive city: 3600 s", "8 forward gears", "torque converter", "kiss point 0.114 MPa"] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
}

#[test]
fn an_engine_beyond_its_map_is_said() {
    let drive = |gear: &str| {
        format!(
            "name = \"d\"\nstart = {{ gear = \"6\", vehicle_m_s = 50 }}\nshift = [{{ time_s = 1, gear = \"{gear}\" }}]\n[[segment]]\nduration_s = 4\nthrottle = 0\n"
        )
    };
    let vehicle = format!("{ROOT}vehicles/six_speed.toml");
    let folder = with_drive("fast", &drive("2"));
    let text = said(&simulate(&folder, &["--vehicle", &vehicle]));
    assert!(text.contains("warning: the engine turns at ") && text.contains("its torque map ends at"), "{text}");
    let folder = with_drive("slow", &drive("5"));
    let text = said(&simulate(&folder, &["--vehicle", &vehicle]));
    assert!(!text.contains("warning"), "{text}");
}

#[test]
fn a_file_of_another_kind_is_named() {
    let folder = Folder::new("kinds");
    let (study, car_study) =
        (format!("{ROOT}experiments/combined.toml"), format!("{ROOT}experiments/eight_speed_ftp_75.toml"));
    let (drive, car) = (format!("{ROOT}drives/city.toml"), format!("{ROOT}vehicles/eight_speed.toml"));
    let (gearbox, map) = (format!("{ROOT}gearboxes/8hp.toml"), format!("{ROOT}maps/genesis_at8.toml"));
    let (out, table) = (folder.path("out"), folder.write("log.csv", "time_s,engine_speed_rad_s,turbine_speed_rad_s\n"));
    let binary = folder.write("binary.toml", [0x7f, b'E', b'L', b'F', 0, 0xff]);
    let cases: [(&[&str], &str); 13] = [
        (&["simulate", &study, "-o", &out], "this looks like a study file, expected an experiment file"),
        (&["simulate", &car_study, "-o", &out], "this looks like a study file of a car with a gearbox"),
        (&["simulate", &car, "-o", &out], "this looks like a vehicle file of a car with a gearbox"),
        (&["simulate", &drive, "--vehicle", &gearbox, "-o", &out], "this looks like a gearbox file"),
        (&["simulate", &drive, "--vehicle", &study, "-o", &out], "this looks like a study file"),
        (&["study", EXPERIMENT, "-o", &out], "this looks like an experiment file, expected a study file"),
        (&["estimate", &table, "--vehicle", &drive], "this looks like a drive file, expected a vehicle file"),
        (&["estimate", &table, "--vehicle", &map], "this looks like a channel map, expected a vehicle file\nhint: "),
        (&["estimate", &table, "--vehicle", &table], "this looks like a table, expected TOML"),
        (&["estimate", &car, "--vehicle", &car], "this is a TOML file, expected a log"),
        (&["estimate", &table, "--vehicle", VEHICLE, "--map", &car], "a gearbox, expected a channel map\nhint: "),
        (&["check", &binary], "this is no text file, expected TOML"),
        (&["check", env!("CARGO_BIN_EXE_wetclutch")], "the file is larger than 4 MiB"),
    ];
    for (arguments, words) in cases {
        let text = refused(&wetclutch(arguments));
        assert!(text.contains(words), "{arguments:?}: {text}");
    }
}
