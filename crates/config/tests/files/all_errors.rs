//! All errors of a file at once.

use config::{
    CarFile, CarStudy, ConfigError, DriveFile, ExperimentFile, GearboxFile, Kind, Source, Study, VehicleFile,
    all_errors, check_learnt,
};

use super::{BENCH, EXPERIMENT, VEHICLE, line_of};

type Reader = dyn Fn(Source) -> Result<(), ConfigError>;

fn errors(text: &str, read: &Reader) -> Vec<String> {
    all_of(&Source::built_in("f.toml", text), read).iter().map(ToString::to_string).collect()
}

/// All errors by a reader that ends at the first one.
fn all_of(source: &Source, read: &(dyn Fn(Source) -> Result<(), ConfigError> + '_)) -> Vec<ConfigError> {
    all_errors(source, &|source| read(source).map_err(|error| vec![error]))
}

/// Whether one of the errors is at the line of a part of the text, and begins so.
fn has(errors: &[String], text: &str, part: &str, begin: &str) -> bool {
    let begin = format!("f.toml:{}: {begin}", line_of(text, part));
    errors.iter().any(|error| error.starts_with(&begin))
}

fn vehicle(source: Source) -> Result<(), ConfigError> {
    VehicleFile::from_source(source).map(drop)
}

fn experiment(source: Source) -> Result<(), ConfigError> {
    ExperimentFile::from_source(source).map(drop)
}

#[test]
fn every_unknown_key_and_every_value_out_of_range_of_a_vehicle_file_is_named_with_its_line() {
    let text = VEHICLE
        .replacen("mass_kg = 1500", "mas_kg = 1500", 1)
        .replacen("wheel_radius_m = ", "wheel_radius_m = 1000", 1)
        .replacen("[tyre]", "[tyre]\nmore = { a = [1,\n2], b = 2 }", 1)
        .replacen("front_area_m2 = ", "front_area_m2 = \"\" #", 1);
    let found = errors(&text, &vehicle);
    assert_eq!(found.len(), 4, "{found:#?}");
    assert!(has(&found, &text, "mas_kg", "unknown key `mas_kg`"), "{found:#?}");
    let meant = "hint: did you mean `mass_kg`, which is missing?";
    assert!(found.iter().any(|error| error.ends_with(meant)), "{found:#?}");
    assert!(has(&found, &text, "wheel_radius_m = 1000", "`vehicle.wheel_radius_m` is 1000"), "{found:#?}");
    assert!(has(&found, &text, "more = ", "unknown key `more`"), "{found:#?}");
    assert!(has(&found, &text, "front_area_m2 = \"\"", "invalid type: the text"), "{found:#?}");
    assert!(errors(VEHICLE, &vehicle).is_empty());
}

#[test]
fn a_key_that_is_missing_without_another_in_its_place_is_named_alone() {
    let text = VEHICLE.replacen("mass_kg = 1500", "", 1).replacen("drag_coefficient = ", "drag_coefficient = 5000", 1);
    let found = errors(&text, &vehicle);
    assert_eq!(found.len(), 2, "{found:#?}");
    assert!(has(&found, &text, "[vehicle]", "missing key `mass_kg`"), "{found:#?}");
    assert!(has(&found, &text, "drag_coefficient", "`vehicle.drag_coefficient` is 5000"), "{found:#?}");
}

/// The text of a car's file with other values.
fn changed(text: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(text.to_owned(), |text, (of, to)| {
        assert!(text.contains(of), "{of}");
        text.replacen(of, to, 1)
    })
}

#[test]
fn values_that_are_far_off_in_many_tables_are_all_named() {
    let car = format!("{}/../../vehicles/eight_speed.toml", env!("CARGO_MANIFEST_DIR"));
    let whole = std::fs::read_to_string(&car).unwrap();
    let read = |source: Source| CarFile::from_source(Source { path: car.clone().into(), ..source }).map(drop);
    let of_car = |text: &str| {
        let source = Source { path: car.clone().into(), text: text.to_owned() };
        all_of(&source, &|source| read(source)).iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let far = [
        ("mass_kg = 1500", "mass_kg = -1"),
        ("final_ratio = 3.0", "final_ratio = 900"),
        ("slip_scale = 0.1", "slip_scale = 99"),
        ("temperature_degc = 80", "temperature_degc = 999"),
        ("static_factor = 1.08", "static_factor = 0.1"),
    ];
    let found = of_car(&changed(&whole, &far));
    assert_eq!(found.len(), far.len(), "{found:#?}");
    for (_, to) in far {
        let (key, value) = to.split_once(" = ").unwrap();
        assert!(found.iter().any(|error| error.contains(&format!("{key}` is {value}, expected"))), "{to}: {found:#?}");
    }
    // One of another type is named once.
    let heavy = of_car(&changed(
        &whole,
        &[("mass_kg = 1500", "mass_kg = \"heavy\""), ("final_ratio = 3.0", "final_ratio = 900")],
    ));
    assert_eq!(heavy.len(), 2, "{heavy:#?}");
    // Intervals that do not contain what they must, in several tables.
    let bounds = "[error_bounds]\nconverter_share = 2\nmass_share = -1\n\
        [clutch.A.error_bounds]\nvalve_gain_factor = [1.1, 1.2]\nfriction_factor = [0.5, 0.9]\nduty_percent = 3\n\
        [clutch.E.error_bounds]\nvalve_delay_s = [0.02, 0.03]\nvalve_lag_factor = [1.2, 1.0]\n";
    let found = of_car(&format!("{whole}{bounds}"));
    let keys = [
        "converter_share",
        "mass_share",
        "valve_gain_factor",
        "friction_factor",
        "duty_percent",
        "valve_delay_s",
        "valve_lag_factor",
    ];
    for key in keys {
        assert!(found.iter().any(|error| error.contains(key)), "{key}: {found:#?}");
    }
    assert_eq!(found.len(), keys.len(), "{found:#?}");
    let three = [
        ("valve_gain_factor = [0.9, 1.1]", "valve_gain_factor = [1.05, 1.2]"),
        ("friction_factor = [0.8, 1.2]", "friction_factor = [1.1, 1.3]"),
        ("valve_lag_factor = [0.5, 1.5]", "valve_lag_factor = [0.1, 0.9]"),
    ];
    let found = errors(&changed(VEHICLE, &three), &vehicle);
    assert_eq!(found.len(), 3, "{found:#?}");
}

/// A range that follows from a value that is not that of the file would be an error of none.
#[test]
fn what_follows_from_a_guess_is_no_error() {
    let text = EXPERIMENT.replacen("duration_s = ", "# ", 1);
    assert_eq!(errors(&text, &experiment).len(), 1, "{:#?}", errors(&text, &experiment));
}

#[test]
fn a_short_vehicle_file_names_the_unknown_key_and_the_missing_one_that_is_meant() {
    let text = "name = \"s\"\n[gear_train]\nratios = [4.17, 2.34]\n[engine]\nmax_torque_n_m = 1e9\n[driveline]\nfinal_ratio = 3.2\n\
                [vehicle]\nmas_kg = 1650.0\nwheel_radius_m = 0.32\n";
    let found = errors(text, &vehicle);
    assert_eq!(found.len(), 2, "{found:#?}");
    let named = "unknown key `mas_kg`\nhint: did you mean `mass_kg`, which is missing?";
    assert!(has(&found, text, "mas_kg", named), "{found:#?}");
    assert!(has(&found, text, "max_torque_n_m", "`engine.max_torque_n_m` is 1000000000"), "{found:#?}");
}

#[test]
fn every_kind_of_file_names_all_of_its_errors() {
    let gearbox = include_str!("../../../../gearboxes/8hp.toml");
    let drive = include_str!("../../../../drives/city.toml");
    let learnt = "gearbox = \"x\"\nelements = []\nshifs = 1\nrefused = \"a\"\nmean = []\ncovariance = []\n";
    let sensors = BENCH[BENCH.find("[sensors]").unwrap()..BENCH.find("[[scenario]]").unwrap()].to_owned();
    let over = "[design.error_bounds]\nmass_kgg = 5\nturbine_torque_share = 40.0\nfriction_factor = [1e9, 1e9]\n";
    let cases: [(String, &Reader, &[&str]); 6] = [
        (gearbox.replacen("level", "lvel", 1), &|source| GearboxFile::from_source(source).map(drop), &["lvel"]),
        (
            drive.replacen("sample_time_s", "sample_tme_s", 1),
            &|source| DriveFile::from_source(source).map(drop),
            &["sample_tme_s"],
        ),
        (learnt.to_owned(), &|source| check_learnt(&source), &["shifs", "refused"]),
        (
            sensors.replacen("periods", "periodes", 1).replacen("seed", "sed", 1),
            &|source| config::sensors_of(&source).map(drop),
            &["periodes", "sed ="],
        ),
        (
            over.to_owned(),
            &|source| VehicleFile::check_overlay(&source),
            &["mass_kgg", "turbine_torque_share", "friction_factor"],
        ),
        (
            EXPERIMENT.replacen("duration_s", "duratin_s", 1).replacen("throttle", "throtle", 1),
            &experiment,
            &["duratin_s", "throtle"],
        ),
    ];
    for (text, read, parts) in cases {
        let found = errors(&text, read);
        for part in parts {
            assert!(has(&found, &text, part, ""), "{part}: {found:#?}");
        }
    }
}

#[test]
fn a_gearbox_file_names_all_that_is_wrong_with_its_parts() {
    let file = include_str!("../../../../gearboxes/8hp.toml");
    let of_gears = [
        ("engaged = [\"A\", \"B\", \"E\"]", "engaged = [\"A\"]"),
        ("stated_ratio = 2.1039", "stated_ratio = 2.3"),
        ("engaged = [\"B\", \"D\", \"E\"]", "engaged = [\"B\", \"D\", \"Q\"]"),
        ("sun_teeth = 69, ring_teeth = 111", "sun_teeth = 111, ring_teeth = 69"),
        (
            "kind = \"brake\"\ninput = \"housing\"\noutput = \"sun12\"",
            "kind = \"brake\"\ninput = \"c3\"\noutput = \"sun12\"",
        ),
        ("sun = \"sun12\", carrier = \"c1\"", "sun = \"sun13\", carrier = \"c1\""),
        ("inertia_kg_m2 = 0.0085", "inertia_kg_m2 = -1"),
        ("mean_radius_m = 0.095", "mean_radius_m = 95"),
        ("return_spring_n = 1500", "return_spring = 1500"),
    ];
    let read = |text: &str| {
        let errors = all_errors(&Source::built_in("f.toml", text), &|source| GearboxFile::checked(source).map(drop));
        errors.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let alone = |&(of, to): &(&str, &str)| {
        let found = read(&changed(file, &[(of, to)]));
        assert_eq!(found.len(), 1, "{to}: {found:#?}");
        found[0].clone()
    };
    let alone: Vec<String> = of_gears.iter().map(alone).collect();
    for (i, one) in of_gears.iter().enumerate() {
        for (k, other) in of_gears.iter().enumerate().take(i) {
            let found = read(&changed(file, &[*one, *other]));
            // The ratio of a gear is known only where its shafts and teeth are.
            let has_ratio = |nth: usize| nth != 1 || [i, k].iter().all(|nth| [0, 1, 2, 6, 7, 8].contains(nth));
            let expected: Vec<&String> =
                [i, k].into_iter().filter(|&nth| has_ratio(nth)).map(|nth| &alone[nth]).collect();
            assert!(expected.iter().all(|error| found.contains(error)), "{one:?} {other:?}: {found:#?}");
            assert_eq!(found.len(), expected.len(), "{one:?} {other:?}: {found:#?}");
        }
    }
}

#[test]
fn the_errors_of_a_file_that_another_one_names_are_said_once() {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed.toml"));
    let source = Source::read(path).unwrap();
    let read = |source| CarFile::from_source(source).map(drop);
    let text = source.text.replacen("mass_kg = ", "mas_kg = ", 1).replacen("8hp.toml", "none.toml", 1);
    let found = all_of(&Source { text, ..source.clone() }, &read);
    assert_eq!(found.len(), 2, "{found:#?}");
    assert!(all_of(&source, &read).is_empty());
}

/// Cut, doubled and garbled files end, and every error is of a line that the file has.
#[test]
fn files_with_any_damage_have_errors_at_their_lines() {
    for at in (0..VEHICLE.len()).step_by(997) {
        let (head, tail) = VEHICLE.split_at(at);
        for text in [
            head.to_owned(),
            format!("{head}[[{tail}"),
            format!("{head}\nx = 1\n{tail}"),
            format!("{head} 1e999 {tail}"),
        ] {
            let lines = text.lines().count().max(1);
            for error in all_of(&Source::built_in("f.toml", &text), &vehicle) {
                assert!(error.line().is_some_and(|line| (1..=lines).contains(&line)), "{error}");
            }
        }
    }
}

/// Reads a file of any kind, and the vehicle that an experiment names.
fn any_kind(source: Source) -> Result<(), ConfigError> {
    match source.kind()? {
        Kind::Vehicle => VehicleFile::from_source(source).map(drop),
        Kind::Car => CarFile::from_source(source).map(drop),
        Kind::Experiment => ExperimentFile::from_source(source)?.read_vehicle().map(drop),
        Kind::Drive => DriveFile::from_source(source)?.read_vehicle().map(drop),
        Kind::Study => Study::from_source(source).map(drop),
        Kind::CarStudy => CarStudy::from_source(source).map(drop),
        Kind::Overlay => VehicleFile::check_overlay(&source),
        Kind::Sensors => config::sensors_of(&source).map(drop),
        Kind::Gearbox => GearboxFile::from_source(source).map(drop),
        Kind::Learnt => check_learnt(&source),
        Kind::ChannelMap => unreachable!("no file of this crate"),
    }
}

/// The keys of a text that stand before `=` or in the name of a table, with their places; those of a few letters are names.
fn keys(text: &str) -> Vec<std::ops::Range<usize>> {
    let is_of_key = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut found = Vec::new();
    let mut begin = 0;
    for line in text.split_inclusive('\n') {
        let code = line.split('#').next().unwrap_or_default();
        let is_header = code.starts_with('[');
        for (at, _) in code.match_indices(is_of_key) {
            let rest = &code[at..];
            let key = &rest[..rest.find(|c| !is_of_key(c)).unwrap_or(rest.len())];
            let is_begun = at > 0 && code[..at].ends_with(is_of_key);
            let is_named = if is_header { !key.is_empty() } else { rest[key.len()..].trim_start().starts_with('=') };
            if !is_begun && is_named && key.len() > 3 && key.starts_with(|c: char| c.is_ascii_lowercase()) {
                found.push(begin + at..begin + at + key.len());
            }
        }
        begin += line.len();
    }
    found
}

/// A key with two of its letters in each other's place.
fn misspelt(key: &str) -> String {
    let letters = key.as_bytes();
    let at = (0..letters.len() - 1).rev().find(|&at| {
        let pair = &letters[at..at + 2];
        pair[0] != pair[1] && pair.iter().all(u8::is_ascii_lowercase) && at <= letters.len() / 2
    });
    let at = at.unwrap();
    let mut letters = letters.to_vec();
    letters.swap(at, at + 1);
    String::from_utf8(letters).unwrap()
}

/// A reader that misses the key that is meant, or takes the file for one of another kind, is not believed first.
#[test]
fn a_misspelt_key_is_the_only_error_of_a_file_of_any_kind() {
    let short = "name = \"s\"\n[gear_train]\nratios = [4.17, 2.34]\n[engine]\nmax_torque_n_m = 250.0\n[driveline]\nfinal_ratio = 3.2\n\
                 [vehicle]\nmass_kg = 1650.0\nwheel_radius_m = 0.32\n";
    let learnt = "gearbox = \"x\"\nelements = []\nshifts = 1\nrefused = 0\nmean = []\ncovariance = []\n";
    let sensors = &BENCH[BENCH.find("[sensors]").unwrap()..BENCH.find("[[observer]]").unwrap()];
    let over = "[design.error_bounds]\nmass_kg = 5.0\n[design.torque_phase]\nmodel_error_max_rad_s2 = 5.0\n";
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
    let file = |name: &str| (format!("{root}{name}"), std::fs::read_to_string(format!("{root}{name}")).unwrap());
    let texts = [("short.toml", short), ("learnt.toml", learnt), ("sensors.toml", sensors), ("over.toml", over)];
    let files = [
        "vehicles/two_speed_at.toml",
        "vehicles/eight_speed.toml",
        "gearboxes/8hp.toml",
        "drives/city.toml",
        "experiments/e1.toml",
        "experiments/settings.toml",
        "experiments/eight_speed_ftp_75.toml",
    ];
    let texts = texts.map(|(name, text)| (name.to_owned(), text.to_owned()));
    for (path, text) in texts.into_iter().chain(files.map(file)) {
        assert_eq!(errors_of(&path, &text), Vec::<String>::new(), "{path}");
        for place in keys(&text) {
            let key = &text[place.clone()];
            let wrong = misspelt(key);
            let line = 1 + text[..place.start].matches('\n').count();
            let found = errors_of(&path, &format!("{}{wrong}{}", &text[..place.start], &text[place.end..]));
            let is_named = |error: &String| {
                let is_unknown = |what: &str| error.starts_with(&format!("{path}:{line}: unknown {what} `{wrong}`"));
                is_unknown("field") || is_unknown("key")
            };
            assert!(found.first().is_some_and(is_named), "{path}: {wrong}: {found:#?}");
            let has_hint = found[0].contains(&format!("hint: did you mean `{key}`"));
            assert!(found.len() == 1 || !has_hint, "{path}: {wrong}: {found:#?}");
        }
    }
}

fn errors_of(path: &str, text: &str) -> Vec<String> {
    all_of(&Source::built_in(path, text), &any_kind).iter().map(ToString::to_string).collect()
}

#[test]
fn all_errors_of_a_file_that_another_one_names_are_said() {
    let folder = super::Folder::new("named");
    let wrong =
        VEHICLE.replacen("mass_kg = ", "mas_kg = ", 1).replacen("wheel_radius_m = ", "wheel_radius_m = 1000", 1);
    folder.with("v.toml", &wrong);
    let named = EXPERIMENT.replacen("../vehicles/two_speed_at.toml", "v.toml", 1);
    let path = folder.with("e.toml", &named);
    let found = errors_of(path.to_str().unwrap(), &named);
    assert_eq!(found.len(), 2, "{found:#?}");
    assert!(found[0].contains("v.toml:") && found[0].contains("unknown key `mas_kg`"), "{found:#?}");
    assert!(found[1].contains("v.toml:") && found[1].contains("`vehicle.wheel_radius_m` is 1000"), "{found:#?}");
    // Two files that name each other end.
    let car = include_str!("../../../../vehicles/eight_speed.toml");
    let circle = car.replacen("../gearboxes/8hp.toml", "other.toml", 1);
    let path = folder.with("car.toml", &circle);
    folder.with("other.toml", &car.replacen("../gearboxes/8hp.toml", "car.toml", 1));
    let found = errors_of(path.to_str().unwrap(), &circle);
    assert!(found.len() == 1 && found[0].contains("other.toml:1: this looks like"), "{found:#?}");
}

/// A shipped file with values exchanged, and the errors that it must have: no more, no fewer.
fn has_all(path: &str, changes: &[(&str, &str)], more: &str, wanted: &[&str]) {
    let path = format!("{}/../../{path}", env!("CARGO_MANIFEST_DIR"));
    let text = changed(&std::fs::read_to_string(&path).unwrap(), changes) + more;
    let found = errors_of(&path, &text);
    for part in wanted {
        assert!(found.iter().any(|error| error.contains(part)), "{part}: {found:#?}");
    }
    assert_eq!(found.len(), wanted.len(), "{found:#?}");
}

#[test]
fn errors_behind_a_value_that_is_wrong_beside_others_are_named() {
    let car = "vehicles/eight_speed.toml";
    let far = [("mass_kg = 1500", "mass_kg = -1"), ("final_ratio = 3.0", "final_ratio = 900")];
    let of_far = ["`vehicle.mass_kg` is -1", "`driveline.final_ratio` is 900"];
    let with = |change: (&'static str, &'static str)| [far[0], change, far[1]];
    let and = |part: &'static str| [of_far[0], of_far[1], part];
    has_all(
        car,
        &with(("slip_rad_s = [", "slip_rad_s = [90, ")),
        "",
        &and("`friction.slip_rad_s`: breakpoint 2 is not above"),
    );
    has_all(
        car,
        &with(("temperature_degc = 80", "temperature_degc = 2020-01-01")),
        "",
        &and("date or time, expected a number"),
    );
    has_all(car, &far, "\n[clutch.Z]\ndrag_n_m = 3\n", &and("no clutch or brake \"Z\""));
    let own_valve = "\n[clutch.C]\nvalve = { lag = { pressure_pa = [0, 3e5, 1e5], time_constant_s = [0.2, 0.1, 0.08] }, gain = { current_a = \
                     [0, 1], gain_pa_a = [1e6, 1.5e6] }, delay = { current_a = [0, 1], delay_s = [0.03, 0] } }\n";
    has_all(car, &far, own_valve, &and("`clutch.C.valve.lag.pressure_pa`: breakpoint 3 is not above"));
    let lock_up = "\n[lock_up]\ncapacity_n_m = -5\nfirst_gear = \"77\"\non_input_rad_s = 1e9\noff_input_rad_s = 110\nramp_s = 99\n";
    let of_lock_up = ["capacity_n_m` is -5", "no gear \"77\"", "on_input_rad_s` is 1000000000", "ramp_s` is 99"];
    has_all(car, &far, lock_up, &[&of_lock_up[..], &of_far].concat());
    let clutches = "\n[clutch.C]\ndrag_n_m = -5\nsteel_mass_kg = 900\n[clutch.A]\nstatic_friction = 9\n";
    let of_clutches = ["C.drag_n_m` is -5", "C.steel_mass_kg` is 900", "A.static_friction` is 9"];
    has_all(car, &far, clutches, &[&of_clutches[..], &of_far].concat());
    let number = [("ring_teeth = 96", "ring_teeth = -5"), ("inertia_kg_m2 = 0.004", "inertia_kg_m2 = -4")];
    has_all("gearboxes/8hp.toml", &number, "", &["`planetary_set.ring_teeth` is -5", "sun12.inertia_kg_m2` is -4"]);
    let names = [
        ("input = \"in\"", "input = \"nix\""),
        ("output = \"out\"", "output = \"zz\""),
        ("output = \"sun12\"", "output = \"s12\""),
        ("line_pressure_pa = 1.6e6", "line_pressure_pa = 1.6"),
    ];
    has_all("gearboxes/8hp.toml", &names, "", &["shaft \"nix\"", "shaft \"zz\"", "shaft \"s12\"", "is 1.6, expected"]);
    let kind = [("kind = \"brake\"", "kind = 5"), ("inertia_kg_m2 = 0.004", "inertia_kg_m2 = -4")];
    let words = "the number `5`, expected one of `clutch`, `brake`, `one-way-clutch`, `dog`";
    has_all("gearboxes/8hp.toml", &kind, "", &[words, "sun12.inertia_kg_m2` is -4"]);
    let faults =
        "\n[[fault]]\nkind = \"swapped-solenoids\"\nelements = [\"A\", \"Q\"]\nfrom_s = -4\n[start]\ngear = \"11\"\n";
    let of_faults =
        ["`fault.elements`: the gearbox has no clutch or brake \"Q\"", "`fault.from_s` is -4", "no gear \"11\""];
    has_all("drives/city.toml", &[], faults, &of_faults);
    let grade = [("grade_rad = 0.02", "grade_rad = [1, 2, 3]"), ("time_in_gear_s = 1.0", "time_in_gear_s = -1")];
    has_all("drives/city.toml", &grade, "", &["expected a number or [from, to]", "time_in_gear_s` is -1"]);
}

#[test]
fn what_is_said_of_a_wrong_value_does_not_follow_from_a_guess() {
    let far = ("valve_delay_s = [0.0, 0.03]", "valve_delay_s = [0.5, 0.6]");
    has_all("vehicles/two_speed_at.toml", &[far], "", &["valve_delay_s[1]` is 0.6, expected 0 to 0.5"]);
    // A word that is spelt nearly as another one is that one.
    let scaled = ("change = \"scale\"", "change = \"skale\"");
    has_all(
        "experiments/settings.toml",
        &[scaled],
        "",
        &["unknown variant `skale`, expected one of `set`, `scale`, `add`"],
    );
    // The tables that a valve misses are put in, and what they miss is none.
    let valve = "\n[clutch.A]\nvalve = { hysteresis_pa = {} }\n";
    has_all("vehicles/eight_speed.toml", &[], valve, &["invalid type: a table, expected a number"]);
    for duration in ["1e300", "-inf", "-7777"] {
        let far = format!("duration_s = {duration} #");
        let changes = [("duration_s = ", far.as_str()), ("position = [", "position = [7, ")];
        let wanted = ["duration_s` is ", "position[0]` is 7"];
        has_all("experiments/e1.toml", &changes, "", &wanted);
    }
    let huge = [("mass_kg = 1500", "mass_kg = 1e300")];
    has_all("vehicles/eight_speed.toml", &huge, "", &["`vehicle.mass_kg` is 1e300, expected 200 to 60000"]);
}
