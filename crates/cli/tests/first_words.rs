//! The first words of the program: all errors of files, options without effect, and where the table of shifts goes.

use crate::support::{BENCH, EXPERIMENT, Folder, ROOT, VEHICLE, stderr, stdout, wetclutch};

fn read(path: &str) -> String {
    std::fs::read_to_string(path).unwrap()
}

fn gearbox() -> String {
    format!("{ROOT}gearboxes/8hp.toml")
}

#[test]
fn check_takes_several_files_and_names_all_errors_of_each() {
    let folder = Folder::new("several");
    let text =
        read(VEHICLE).replace("mass_kg = 1500", "mas_kg = 1500").replace("wheel_radius_m = ", "wheel_radius_m = 1000");
    let wrong = folder.write("wrong.toml", text);
    let map = folder.write("map.toml", "[channel.engine_speed]\nnam = \"N\"\ndelay_s = 99\n");
    let output = wetclutch(&["check", &wrong, VEHICLE, &map]);
    let (printed, said) = (stdout(&output), stderr(&output));
    assert_eq!(output.status.code(), Some(2), "{said}");
    // The good one is described.
    assert!(printed.contains(&format!("{VEHICLE}:\nvehicle \"")), "{printed}");
    for part in [
        "unknown key `mas_kg`",
        "did you mean `mass_kg`",
        "`vehicle.wheel_radius_m` is 1000",
        "unknown key `nam`",
        "`channel.engine_speed.delay_s` is 99, expected 0 to 10",
        "error: 2 of 3 files have errors: ",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let good = folder.write("good.toml", "[channel.engine_speed]\nname = \"N\"\n");
    assert!(wetclutch(&["check", VEHICLE, &good]).status.success());
    assert_eq!(wetclutch(&["check", VEHICLE, &gearbox(), "-o", &folder.path("out")]).status.code(), Some(2));
    assert_eq!(wetclutch(&["check"]).status.code(), Some(2));
}

#[test]
fn an_option_without_effect_is_said() {
    let folder = Folder::new("without-effect");
    wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]);
    let log = folder.path("e1_measured.csv");
    let dbc = folder.write("bus.dbc", "VERSION \"\"\nNS_ :\nBS_:\nBU_:\n");
    let estimate = folder.path("out.csv");
    let without_shift = read(&log).lines().take(1500).map(|line| format!("{line}\n")).collect::<String>();
    let without_shift = folder.write("short_log.csv", without_shift);
    let study = "name = \"s\"\ntitle = \"S\"\nplan = \"latin-hypercube\"\nruns = 1\nseed = 1\nobservers = [\"open loop\"]\n[[factor]]\nkey = \"car.vehicle.mass_kg\"\nrange = [1300, 2000]\n";
    let study = folder.write("study.toml", format!("experiment = '{BENCH}'\n{study}"));
    for arguments in [
        &["check", &gearbox(), "--all"][..],
        &["inspect", &log, "--dbc", &dbc],
        &["inspect", &log, "--dbc", &dbc, "--suggest"],
        &["estimate", &log, "--vehicle", VEHICLE, "--dbc", &dbc, "-o", &estimate],
        &["estimate", &log, "--vehicle", VEHICLE, "--format", "csv", "-o", &estimate],
        &["estimate", &without_shift, "--vehicle", VEHICLE, "-o", &folder.path("short.csv"), "--open"],
        &["convert", &log, "--format", "csv", "-o", &folder.path("converted.csv")],
        &["study", &study, "--run", "0", "--threads", "2", "-o", &folder.path("run")],
    ] {
        let output = wetclutch(arguments);
        let said = stderr(&output);
        assert!(output.status.success(), "{said}");
        assert!(
            said.matches("has no effect: ").count() == 1 && said.contains("hint: leave it out"),
            "{arguments:?}: {said}"
        );
        assert!(!stdout(&output).contains("bus.dbc"), "a map without frames names no DBC");
    }
    let quiet = wetclutch(&["inspect", &log]);
    assert!(!stderr(&quiet).contains("no effect"), "{}", stderr(&quiet));
}

#[test]
fn the_table_of_shifts_is_on_standard_output_where_the_estimates_have_a_file() {
    let folder = Folder::new("table");
    wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]);
    let log = folder.path("e1_measured.csv");
    let map = folder.write("map.toml", stdout(&wetclutch(&["inspect", &log, "--suggest"])));
    let arguments = ["estimate", &log, "--vehicle", VEHICLE, "--map", &map];
    let is_row = |line: &str| line.starts_with("1  1-2 ");
    let is_table = |text: &str| text.lines().any(is_row);
    let into_file = wetclutch(&[&arguments[..], &["-o", &folder.path("out.csv")]].concat());
    assert!(is_table(&stdout(&into_file)) && !is_table(&stderr(&into_file)), "{}", stderr(&into_file));
    assert!(!stdout(&into_file).contains("observer: "), "{}", stdout(&into_file));
    let to_stdout = wetclutch(&arguments);
    assert!(is_table(&stderr(&to_stdout)) && stdout(&to_stdout).starts_with("time_s,"), "{}", stderr(&to_stdout));
    // Of several logs each table has the name of its log.
    let copy = folder.write("copy.csv", read(&log));
    std::fs::create_dir_all(folder.path("both")).unwrap();
    let both = wetclutch(&["estimate", &log, &copy, "--vehicle", VEHICLE, "--map", &map, "-o", &folder.path("both")]);
    let printed = stdout(&both);
    for log in [&log, &copy] {
        assert!(printed.contains(&format!("{log}:\n")), "{printed}");
    }
    assert_eq!(printed.lines().filter(|line| is_row(line)).count(), 2, "{printed}");
}
