//! Maps that do not fit their log, times in another unit, and outputs that are no place for a result.

use std::fmt::Write as _;
use std::process::Command;

use crate::support::{Folder, VEHICLE, printed, refused, said, stderr, wetclutch};

/// Files that other programs wrote.
const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../logs/tests/data");

/// Two speeds of a car in 1st gear, whose ratio is 2.5, and the command, 10 ms apart; `stamp` gives the time of a row.
fn log(rows: u32, stamp: impl Fn(f64) -> f64) -> String {
    let mut log = "time,N_Eng,N_Turb,N_Out,I\n".to_owned();
    for i in 0..rows {
        let time_s = 0.01 * f64::from(i);
        let turbine = 190.0 + 10.0 * time_s.sin();
        writeln!(log, "{},{},{turbine},{},0.1", stamp(time_s), turbine + 10.0, turbine / 2.5).unwrap();
    }
    log
}

const CHANNELS: [&str; 4] = [
    "engine_speed=N_Eng [rad/s]",
    "turbine_speed=N_Turb [rad/s]",
    "output_speed=N_Out [rad/s]",
    "oncoming_current=I [A]",
];

/// The arguments of a command over a log with these channels and `changed` in their place.
fn with<'a>(command: &[&'a str], changed: &[&'a str]) -> Vec<&'a str> {
    let channels = CHANNELS.iter().chain(changed).flat_map(|channel| ["--channel", channel]);
    command.iter().copied().chain(channels).collect()
}

#[test]
fn a_page_and_an_estimate_replace_no_measurement() {
    let folder = Folder::new("precious");
    let path = folder.write("log.csv", log(300, |time_s| time_s));
    let precious = folder.write("precious.csv", log(3, |time_s| time_s));
    let inspect = |page: &str| wetclutch(&with(&["inspect", &path, "--shifts", "--ratios", "2.5,1", "-o", page], &[]));
    let estimate = |out: &str, more: &[&str]| {
        let command = ["estimate", &path, "--vehicle", VEHICLE, "--observer", "open-loop", "-o", out];
        wetclutch(&[with(&command, &[]), more.to_vec()].concat())
    };
    let mf4 = folder.write("precious.mf4", std::fs::read(format!("{DATA}/plain_410.mf4")).unwrap());
    let parquet = folder.write("precious.parquet", std::fs::read(format!("{DATA}/snappy.parquet")).unwrap());
    let gears = folder.write("gears.csv", "time_s,gear,target_gear\n0,1,1\n");
    for there in [&precious, &mf4, &parquet, &gears] {
        let before = std::fs::read(there).unwrap();
        assert!(refused(&inspect(there)).contains("exists and is no page in HTML\nhint: choose another name after -o"));
        assert!(refused(&estimate(there, &[])).contains("exists and is no estimate of this program\nhint: choose"));
        assert!(std::fs::read(there).unwrap() == before, "{there}");
    }
    // An earlier result is replaced, whatever its columns; so is an empty file.
    let page = folder.write("page.html", "");
    for _ in 0..2 {
        said(&inspect(&page));
    }
    for ending in ["csv", "parquet", "mf4"] {
        let out = folder.path(&format!("out.{ending}"));
        for columns in ["oncoming_pressure_estimate_pa,phase", "health,oncoming_torque_estimate_n_m"] {
            said(&estimate(&out, &["--columns", columns]));
        }
    }
    assert!(refused(&inspect(&folder.path("out.csv"))).contains("exists and is no page in HTML"));
}

#[test]
fn a_time_in_a_smaller_unit_than_its_own_is_refused() {
    let folder = Folder::new("fast");
    let path = folder.write("log.csv", log(400, |time_s| time_s));
    let out = folder.path("out.csv");
    let map = |unit: &str| folder.write("map.toml", format!("[time]\nname = \"time\"\nunit = \"{unit}\"\n"));
    let command = |map: &str| {
        wetclutch(&with(
            &["estimate", &path, "--vehicle", VEHICLE, "--observer", "open-loop", "--map", map, "-o", &out],
            &[],
        ))
    };
    for unit in ["ms", "us"] {
        let error = refused(&command(&map(unit)));
        assert!(error.contains("hint: the times suggest a larger unit than the one given"), "{error}");
        assert!(!std::path::Path::new(&out).exists());
        let plain = said(&wetclutch(&["inspect", &path, "--map", &folder.path("map.toml")]));
        assert!(plain.contains("warning: the middle time between two rows is 1.0e-"), "{plain}");
    }
    said(&command(&map("s")));
}

#[test]
fn inspect_compares_the_values_with_the_units_of_the_map() {
    let folder = Folder::new("values");
    let path = folder.write("log.csv", log(300, |time_s| time_s));
    let said_of = said(&wetclutch(&with(&["inspect", &path], &[])));
    assert!(said_of.contains("the channel map fits the log"), "{said_of}");
    for (channel, expected) in [
        ("engine_speed=N_Eng [rpm]", "engine_speed cannot be in rpm: "),
        ("engine_speed=N_Eng [1/s]", "engine_speed cannot be in Hz: "),
        ("oncoming_current=I [mA]", "oncoming_current cannot be in mA: "),
        ("engine_speed=N_Turb [rad/s]", "channel `N_Turb` is both turbine_speed and engine_speed"),
    ] {
        for shifts in [&[][..], &["--shifts", "--ratios", "2.5,1"]] {
            let error = refused(&wetclutch(&[with(&["inspect", &path], &[channel]), shifts.to_vec()].concat()));
            assert!(error.contains(expected) && error.contains("\nhint: "), "{error}");
        }
    }
}

#[test]
fn times_in_a_smaller_unit_that_the_log_does_not_name_are_named_with_it() {
    let folder = Folder::new("slow");
    let path = folder.write("log.csv", log(300, |time_s| 1e3 * time_s));
    let text = said(&wetclutch(&["inspect", &path]));
    assert!(text.contains("more often than once in a second: the times suggest ms\nhint: set its `name`"), "{text}");
}

#[test]
fn a_drive_in_no_gear_says_so_and_a_clock_that_jumps_ends() {
    let folder = Folder::new("no-gear");
    let path = folder.write("log.csv", log(300, |time_s| time_s));
    let shifts = ["inspect", &path, "--shifts", "--ratios", "2.5,1"];
    assert!(!said(&wetclutch(&with(&shifts, &[]))).contains("no gear"));
    let output = wetclutch(&with(&shifts, &["output_speed=N_Out [Hz]"]));
    let note = said(&output);
    // 2.5 over 2 pi.
    assert!(
        printed(&output).starts_with("0 shifts") && note.contains("are in no gear, the middle one of them 0.39"),
        "{note}"
    );
    let jump = |time_s: f64| if time_s < 1.5 { time_s } else { time_s + 1.7e9 };
    let path = folder.write("jump.csv", log(600, jump));
    let page = folder.path("jump.html");
    said(&wetclutch(&with(&["inspect", &path, "--shifts", "--ratios", "2.5,1", "-o", &page], &[])));
    assert!(std::fs::metadata(&page).unwrap().len() < 1_000_000);
}

#[test]
fn a_suggested_map_leads_to_its_dbc_from_any_folder() {
    let folder = Folder::new("dbc");
    let output = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .current_dir(DATA)
        .args(["inspect", "bus.log", "--dbc", "bus.dbc", "--suggest"])
        .output()
        .unwrap();
    let map = folder.write("map.toml", printed(&output));
    let log = format!("{DATA}/bus.log");
    let inspected = wetclutch(&["inspect", &log, "--map", &map]);
    assert!(!stderr(&inspected).contains("dbc"), "{}", stderr(&inspected));
    let map = folder.write("map.toml", "dbc = \"elsewhere.dbc\"\n[channel.engine_speed]\nname = \"N_Eng\"\n");
    let error = refused(&wetclutch(&["inspect", &log, "--map", &map]));
    assert!(error.contains("map.toml: `dbc` names ") && error.contains("counts from the folder of the map"), "{error}");
    said(&wetclutch(&["inspect", &log, "--map", &map, "--dbc", &format!("{DATA}/bus.dbc")]));
}

#[test]
fn check_names_the_wrong_units_of_a_map_and_a_database_that_is_not_there() {
    let folder = Folder::new("map_units");
    let text = "dbc = \"not_there.dbc\"\n[channel.engine_speed]\nname = \"N\"\nunit = \"furlong\"\n[channel.gear]\nname = \"G\"\nunit = \"A\"\n\
                [channel.wheel_speed]\nname = \"V\"\nunit = \"km/h\"\n[channel.turbine_speed]\nunit = \"kPa\"\nname = \"T\"\n";
    let map = folder.write("map.toml", text);
    let message = refused(&wetclutch(&["check", &map]));
    let errors: Vec<&str> = message.lines().filter(|line| line.starts_with("error: ")).collect();
    let parts = [
        ":1: `dbc`: ",
        ":4: channel `N` (engine_speed) has the unit `furlong`, which is not known",
        ":7: channel `G` (gear) is in A, expected a number without a unit",
        ":12: channel `T` (turbine_speed) is in kPa, expected a unit like rad/s",
    ];
    assert!(errors.len() == 4 && errors.iter().zip(parts).all(|(error, part)| error.contains(part)), "{message}");
    // Behind an unknown key and a value of another type as well.
    let behind = text.replace("name = \"N\"\n", "colour = 1\nname = \"N\"\nscale = \"x\"\n");
    let message = refused(&wetclutch(&["check", &folder.write("map.toml", &behind)]));
    let errors: Vec<&str> = message.lines().filter(|line| line.starts_with("error: ")).collect();
    let all = [
        ":3: unknown key `colour`",
        ":1: `dbc`: ",
        ":5: invalid type: the text \"x\"",
        ":6: channel `N`",
        ":9: channel `G`",
        ":14: channel `T`",
    ];
    assert!(all.iter().all(|part| errors.iter().any(|error| error.contains(part))), "{message}");
    assert_eq!(errors.len(), all.len(), "{message}");
    folder.write("not_there.dbc", "VERSION \"\"\n");
    let right = text.replace("furlong", "rpm").replace("\"A\"", "\"-\"").replace("kPa", "1/min");
    assert!(printed(&wetclutch(&["check", &folder.write("map.toml", &right)])).contains("a channel map"));
}
