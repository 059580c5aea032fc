//! Logs in other formats: what is converted is read and estimated as the log is.

use std::fmt::Write as _;

use serde_json::Value;

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, stdout, wetclutch};

const FORMATS: [&str; 3] = ["csv", "parquet", "mf4"];

/// A simulated drive whose channels have other names, units and rates, with a map for them.
fn log(folder: &Folder) -> [String; 2] {
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("sim")]));
    let text = std::fs::read_to_string(folder.path("sim/e1_measured.csv")).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &str| names.iter().position(|own| *own == name).unwrap();
    let wanted =
        ["time_s", "engine_speed_rad_s", "turbine_speed_rad_s", "output_speed_rad_s", "oncoming_current_a"].map(at);
    let mut log =
        "t [ms],N_Eng [rpm],\"N_Turb, left [rpm]\",\"N_Turb, right [rpm]\",N_Out [rpm],I_B [mA],Odd [parsec]\n"
            .to_owned();
    for (row, line) in lines.enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
        let [time_s, engine, turbine, output, current] = wanted.map(|place| cells[place]);
        let rpm = 30.0 / std::f64::consts::PI;
        // The output speed comes in every second row.
        let output = if row % 2 == 0 { format!("{}", rpm * output) } else { String::new() };
        let turbine = rpm * turbine;
        writeln!(
            log,
            "{},{},{},{},{output},{},7",
            1e3 * time_s,
            rpm * engine / 0.25,
            turbine - 1.0,
            turbine + 1.0,
            1e3 * current
        )
        .unwrap();
    }
    let map = "\
[channel.engine_speed]
name = \"N_Eng\"
scale = 0.25
delay_s = 0.004
valid_range = [0, 7000]
[channel.turbine_speed]
names = [\"N_Turb, left\", \"N_Turb, right\"]
combine = \"mean\"
[channel.output_speed]
name = \"N_Out\"
late_s = 0.002
[channel.oncoming_current]
name = \"I_B\"
[gearbox]
ratios = [2.5, 1.5]
";
    [folder.write("log.csv", log), folder.write("map.toml", map)]
}

fn estimate(folder: &Folder, log: &str, map: &str, name: &str) -> String {
    let output = folder.path(name);
    said(&wetclutch(&["estimate", log, "--map", map, "--vehicle", VEHICLE, "-o", &output]));
    std::fs::read_to_string(output).unwrap()
}

#[test]
fn a_log_that_is_converted_by_a_map_has_the_estimates_of_the_log_to_the_byte() {
    let folder = Folder::new("convert");
    let [log, map] = log(&folder);
    let expected = estimate(&folder, &log, &map, "expected.csv");
    assert!(expected.lines().count() > 100);
    for format in FORMATS {
        let output = folder.path(&format!("{format}.{format}"));
        let said = said(&wetclutch(&["convert", &log, "--map", &map, "-o", &output]));
        assert!(said.contains("rows of 4 channels") && said.contains(&format!("{format}_map.toml")), "{said}");
        let of_output = folder.path(&format!("{format}_map.toml"));
        let found = estimate(&folder, &output, &of_output, &format!("{format}.estimate.csv"));
        assert!(found == expected, "{format}");
    }
    let header = folder.read("csv.csv").lines().next().unwrap().to_owned();
    assert_eq!(header, "time_s,engine_speed_rad_s,oncoming_current_a,output_speed_rad_s,turbine_speed_rad_s");
}

#[test]
fn all_channels_of_a_log_are_converted_with_names_and_units() {
    let folder = Folder::new("convert-all");
    let [log, map] = log(&folder);
    let channels = |log: &str, more: &[&str]| {
        let json: Value =
            serde_json::from_str(&printed(&wetclutch(&[&["inspect", log, "--json"], more].concat()))).unwrap();
        let keys = ["name", "unit", "minimum", "maximum", "samples", "from_s", "to_s"];
        let of = |channel: &Value| keys.map(|key| channel[key].to_string());
        json["channels"].as_array().unwrap().iter().map(of).collect::<Vec<_>>()
    };
    let expected = estimate(&folder, &log, &map, "expected.csv");
    for format in FORMATS {
        let output = folder.path(&format!("{format}.{format}"));
        said(&wetclutch(&["convert", &log, "-o", &output]));
        assert_eq!(channels(&output, &[]), channels(&log, &[]), "{format}");
        // The map of the log is one of the table too.
        assert!(estimate(&folder, &output, &map, &format!("{format}.out.csv")) == expected, "{format}");
    }
    let [bus, dbc] = ["bus.blf", "bus.dbc"].map(|name| format!("{ROOT}crates/logs/tests/data/{name}"));
    let output = folder.path("bus.csv");
    let json = stdout(&wetclutch(&["convert", &bus, "--dbc", &dbc, "-o", &output, "--json"]));
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["json_version"], &json["logs"][0]["map"]), (&Value::from(1), &Value::Null));
    let names =
        |channels: Vec<[String; 7]>| channels.into_iter().map(|[name, unit, ..]| (name, unit)).collect::<Vec<_>>();
    assert_eq!(names(channels(&output, &[])), names(channels(&bus, &["--dbc", &dbc])));
}

#[test]
fn a_table_that_is_estimated_without_a_map_stays_one_through_all_formats() {
    let folder = Folder::new("convert-names");
    said(&wetclutch(&["simulate", crate::support::EXPERIMENT, "-o", &folder.path("drive")]));
    let mut log = folder.path("drive/e1_measured.csv");
    let estimate = |log: &str| {
        let output = folder.path("out.csv");
        said(&wetclutch(&["estimate", log, "--vehicle", crate::support::VEHICLE, "-o", &output]));
        folder.read("out.csv")
    };
    let expected = estimate(&log);
    for name in ["a.parquet", "b.mf4", "c.csv"] {
        let output = folder.path(name);
        said(&wetclutch(&["convert", &log, "-o", &output]));
        log = output;
    }
    assert!(estimate(&log) == expected);
}

#[test]
fn no_file_is_replaced_and_no_name_is_guessed() {
    let folder = Folder::new("convert-refused");
    let log = folder.write("log.csv", "time_s,a [bar]\n0,1\n1,2\n");
    let map = folder.write("map.toml", "[channel.oncoming_pressure]\nname = \"a\"\n");
    let there = folder.write("there.csv", "time_s,a [bar]\n0,1\n");
    folder.write("other_map.toml", "[channel.engine_speed]\nname = \"N\"\n");
    let empty = folder.write("empty.csv", "time_s,a\n0,\n");
    for (arguments, message) in [
        (vec![log.as_str(), "-o", there.as_str()], "exists, and a log is never replaced"),
        (vec![&log, "-o", &log], "the output would replace this input"),
        (vec![&log, "--map", &map, "-o", &folder.path("other.csv")], "exists and is no channel map of a converted log"),
        (vec![&log, "-o", &folder.path("x.xlsx")], "this is no name of a table"),
        (vec![&log, "--format", "mf4", "-o", &folder.path("x.csv")], "this is no name of a table in --format mf4"),
        (vec![&log, &log, "-o", &folder.path("both")], "two logs would give this file"),
        (vec![&empty, "-o", &folder.path("x.csv")], "there are no values in it"),
    ] {
        let error = refused(&wetclutch(&[&["convert"], arguments.as_slice()].concat()));
        assert!(error.contains(message), "{message}: {error}");
    }
    assert!(!folder.names().contains(&"x.csv".to_owned()));
    said(&wetclutch(&["convert", &log, &there, "--format", "parquet", "-o", &folder.path("both")]));
    let both = std::fs::read_dir(folder.path("both")).unwrap().count();
    assert_eq!(both, 2);
    // A map that the command wrote goes with its table.
    let (output, mapped) =
        (folder.path("mapped.csv"), ["convert", &log, "--map", &map, "-o", &folder.path("mapped.csv")]);
    said(&wetclutch(&mapped));
    assert_eq!(folder.read("mapped.csv"), "time_s,oncoming_pressure_pa\n0,100000\n1,200000\n");
    std::fs::remove_file(output).unwrap();
    said(&wetclutch(&mapped));
}
