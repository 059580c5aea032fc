//! Logs of every format, from `inspect` to `estimate`.

use crate::support::{EXPERIMENT, Folder, VEHICLE, printed, stderr, wetclutch};

/// Files that other programs wrote.
const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../logs/tests/data");

#[test]
fn inspect_takes_several_logs_and_one_that_fails_does_not_stop_the_others() {
    let [plain, packed, none] = ["plain_410.mf4", "deflate.mf4", "none.mf4"].map(|name| format!("{DATA}/{name}"));
    let one = |log: &str, more: &[&str]| printed(&wetclutch(&[&["inspect", log], more].concat()));
    let both = printed(&wetclutch(&["inspect", &plain, &packed]));
    assert_eq!(both, format!("{}\n{}", one(&plain, &[]), one(&packed, &[])));
    let output = wetclutch(&["inspect", &none, &plain, "--json"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("error: 1 of 2 logs are not inspected: ") && stderr(&output).contains("none.mf4"));
    let of_all: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut of_one: serde_json::Value = serde_json::from_str(&one(&plain, &["--json"])).unwrap();
    of_one.as_object_mut().unwrap().remove("json_version");
    assert_eq!((&of_all["logs"][0], of_all["logs"].as_array().unwrap().len()), (&of_one, 1));
    let suggested = wetclutch(&["inspect", &plain, &packed, "--suggest"]);
    assert!(stderr(&suggested).contains("--suggest takes one log\nhint: "), "{}", stderr(&suggested));
    let shifts = wetclutch(&["inspect", &plain, &packed, "--shifts", "--channel", "gear=Gear"]);
    assert!(printed(&shifts).contains(&format!("{packed}:\n")), "{}", stderr(&shifts));
}

#[test]
fn inspect_lists_the_channels_of_every_format() {
    let bus = ["bus.log", "bus.asc", "bus.blf"].map(|name| (name, Some("bus.dbc")));
    let plain = ["plain_410.mf4", "deflate.mf4", "unsorted.mf4", "snappy.parquet"].map(|name| (name, None));
    for (name, dbc) in bus.into_iter().chain(plain) {
        let log = format!("{DATA}/{name}");
        let dbc = dbc.map(|dbc| format!("{DATA}/{dbc}"));
        let mut arguments = vec!["inspect", &log];
        if let Some(dbc) = &dbc {
            arguments.extend(["--dbc", dbc]);
        }
        let text = printed(&wetclutch(&arguments));
        let row = text.lines().find(|line| line.starts_with("N_Eng ")).unwrap_or_else(|| panic!("{name}: {text}"));
        let cells: Vec<&str> = row.split_whitespace().collect();
        // A bus has one more frame, and in the Parquet file six values are absent.
        let samples = match name {
            "snappy.parquet" => "34",
            _ if dbc.is_some() => "41",
            _ => "40",
        };
        assert!(cells.contains(&samples) && cells.contains(&"100"), "{name}: {row}");
    }
    let unnamed = wetclutch(&["inspect", &format!("{DATA}/bus.blf")]);
    assert_eq!(unnamed.status.code(), Some(2));
    assert!(stderr(&unnamed).contains("hint: give it with --dbc"), "{}", stderr(&unnamed));
}

#[test]
fn a_suggested_map_gives_the_same_estimate_as_the_names_of_the_program() {
    let folder = Folder::new("suggested");
    printed(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]));
    let log = folder.path("e1_measured.csv");
    let expected = printed(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE]));
    let map = folder.write("map.toml", printed(&wetclutch(&["inspect", &log, "--suggest"])));
    let mapped = wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "--map", &map]);
    assert!(printed(&mapped) == expected, "{}", stderr(&mapped));
    assert!(stderr(&mapped).contains("shifts: 1 (7.701 to 8.318 s)"), "{}", stderr(&mapped));
    // The same drive with other names, units and signs of decimals.
    let text = std::fs::read_to_string(&log).unwrap();
    let renamed = text.replacen("oncoming_current_a", "Strom [A]", 1).replace(',', ";").replace('.', ",");
    let other = folder.write("other.csv", &renamed);
    let arguments = ["estimate", &other, "--vehicle", VEHICLE, "--map", &map, "--channel", "oncoming_current=Strom"];
    let mapped = wetclutch(&arguments);
    assert!(printed(&mapped) == expected, "{}", stderr(&mapped));
    let shifts = printed(&wetclutch(&["inspect", &log, "--map", &map, "--shifts", "--ratios", "2.5,1.0"]));
    assert!(
        shifts.starts_with("1 shift from 0.00 to 9.50 s\n") && shifts.contains("\n1-2    power-on upshift"),
        "{shifts}"
    );
}

/// The rows of a table with another last column in place of one: its title, and what becomes of its cells.
fn with_other(text: &str, column: &str, title: &str, cell: impl Fn(f64) -> f64) -> String {
    let at = text.lines().next().unwrap().split(',').position(|name| name == column).unwrap();
    let row = |(number, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let other = cells.remove(at);
        cells.push(if number == 0 { title.to_owned() } else { other.parse().map_or(other, |x| cell(x).to_string()) });
        cells.join(",") + "\n"
    };
    text.lines().enumerate().map(row).collect()
}

#[test]
fn the_pressure_that_is_asked_of_the_clutch_stands_for_the_command_of_its_valve() {
    let folder = Folder::new("asked");
    printed(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]));
    let log = folder.path("e1_measured.csv");
    let map = printed(&wetclutch(&["inspect", &log, "--suggest"]));
    let valve = config::VehicleFile::built_in().unwrap().oncoming.valve;
    let asked_bar = |current_a: f64| 1e-5 * valve.settled_pressure(current_a);
    let text = with_other(&folder.read("e1_measured.csv"), "oncoming_current_a", "P_cmd [bar]", asked_bar);
    let other = folder.write("asked.csv", text);
    let at = map.find("[channel.oncoming_current]").unwrap();
    let end = map[at + 1..].find("\n[").map_or(map.len(), |end| at + 1 + end);
    let map = folder.write("map.toml", format!("{}{}", &map[..at], &map[end..]));
    let arguments = ["estimate", &other, "--vehicle", VEHICLE, "--map", &map];
    let missing = wetclutch(&arguments);
    assert!(stderr(&missing).contains("or oncoming_pressure_command if it has the pressure"), "{}", stderr(&missing));
    let of = |text: &str| -> Vec<f64> {
        let at =
            text.lines().next().unwrap().split(',').position(|name| name == "oncoming_pressure_estimate_pa").unwrap();
        text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect()
    };
    let expected = of(&printed(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE])));
    let entry = "oncoming_pressure_command=P_cmd [bar]";
    let asked = wetclutch(&[&arguments[..], &["--channel", entry]].concat());
    let found = of(&printed(&asked));
    assert!(found.len() == expected.len() && expected.iter().copied().fold(0.0, f64::max) > 3e5);
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found - expected).abs() < 50.0, "{found} {expected}");
    }
}

#[test]
fn what_an_estimate_lacks_is_said_before_anything_is_written() {
    let folder = Folder::new("lacks");
    let [mdf, bus] = ["plain_410.mf4", "bus.mf4"].map(|name| format!("{DATA}/{name}"));
    let out = folder.path("out.csv");
    let table =
        folder.write("log.csv", "time_s,e,t,o,i\n0,800,790,300,0.1\n0.01,900,890,310,0.1\n0.02,900,890,310,0.1\n");
    let complete = ["engine_speed=e [rpm]", "turbine_speed=t [rpm]", "output_speed=o [rpm]", "oncoming_current=i [A]"];
    let with = |changed: &[&'static str]| {
        let entries = complete.iter().copied().chain(changed.iter().copied());
        entries.flat_map(|entry| ["--channel", entry]).map(str::to_owned).collect::<Vec<_>>()
    };
    let cases = [
        (&mdf, vec![], "this log needs a channel map\nhint: `wetclutch inspect`"),
        (&bus, vec![], "there are frames of a CAN bus, whose signals are not read\nhint: a DBC defines the signals"),
        (
            &mdf,
            vec!["--channel".to_owned(), "engine_speed=N_Eng".to_owned()],
            "the channel map has no oncoming_current, the command of this vehicle's valve: without it no pressure",
        ),
        (&table, with(&["engine_speed=e [rad/s]"]), "engine_speed cannot be in rad/s"),
        (&table, with(&["oncoming_current=x [A]"]), "there is no channel `x`"),
        (&table, with(&["engine_speed=e [furlong]"]), "which is not known\nhint: the units are"),
    ];
    for (log, more, message) in cases {
        let mut arguments = vec!["estimate", log, "--vehicle", VEHICLE, "--observer", "open-loop", "-o", &out];
        arguments.extend(more.iter().map(String::as_str));
        let output = wetclutch(&arguments);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(stderr(&output).contains(message), "{message}: {}", stderr(&output));
        assert!(!std::path::Path::new(&out).exists(), "{message}");
    }
    let mut arguments = vec!["estimate", &table, "--vehicle", VEHICLE, "--observer", "open-loop"];
    let entries = with(&[]);
    arguments.extend(entries.iter().map(String::as_str));
    assert_eq!(printed(&wetclutch(&arguments)).lines().count(), 4);
}

#[test]
fn a_misspelt_channel_is_named_before_what_the_shift_finder_lacks() {
    let folder = Folder::new("misspelt");
    let log = folder.write("log.csv", "time_s,Gear,N\n0,1,800\n0.01,1,900\n");
    let output = wetclutch(&["inspect", &log, "--shifts", "--channel", "gear=Gaer"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("there is no channel `Gaer` for `channel.gear`\nhint: `Gear` has a similar name"),
        "{}",
        stderr(&output)
    );
    let output = wetclutch(&["inspect", &log, "--shifts", "--channel", "engine_speed=N [rpm]"]);
    assert!(stderr(&output).contains("no channel of the map shows a shift"), "{}", stderr(&output));
}

#[test]
fn the_map_of_the_public_drive_is_in_order() {
    let maps = concat!(env!("CARGO_MANIFEST_DIR"), "/../../maps");
    let folder = Folder::new("public");
    // One frame of each message: enough for the map, its units and its DBC.
    let frames = "(1.0) can0 316#353EAC173E0E1B72\n(1.0) can0 43F#834480FF77901700\n(1.0) can0 440#FFB31B00FF9C1753\n(1.01) can0 316#353EAC173E0E1B72\n(1.01) can0 43F#834480FF77901700\n(1.01) can0 440#FFB31B00FF9C1753\n";
    let log = folder.write("drive.log", frames);
    let output = wetclutch(&["inspect", &log, "--map", &format!("{maps}/genesis_at8.toml"), "--shifts"]);
    assert!(printed(&output).starts_with("0 shifts from 1.00 to 1.01 s"), "{}", stderr(&output));
    assert!(stderr(&output).contains("no valve command is mapped"), "{}", stderr(&output));
    let text = printed(&wetclutch(&["inspect", &log, "--dbc", &format!("{maps}/genesis_at8.dbc")]));
    // Bytes 5 and 6 of 0x43F: 0x1790 times 0.25 rpm.
    assert!(text.lines().any(|line| line.starts_with("TurbineSpeed ") && line.contains(" 1508 ")), "{text}");
}
