//! All errors of a file at once.

use config::{
    CarFile, ConfigError, DriveFile, ExperimentFile, GearboxFile, Source, VehicleFile, all_errors, check_learnt,
};

use super::{BENCH, EXPERIMENT, VEHICLE, line_of};

type Reader = dyn Fn(Source) -> Result<(), ConfigError>;

fn errors(text: &str, read: &Reader) -> Vec<String> {
    all_errors(&Source::built_in("f.toml", text), read).iter().map(ToString::to_string).collect()
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
    assert!(has(&found, &text, "mas_kg", "unknown field `mas_kg`"), "{found:#?}");
    let meant = "hint: did you mean `mass_kg`, which is missing?";
    assert!(found.iter().any(|error| error.ends_with(meant)), "{found:#?}");
    assert!(has(&found, &text, "wheel_radius_m = 1000", "`vehicle.wheel_radius_m` is 1000"), "{found:#?}");
    assert!(has(&found, &text, "more = ", "unknown field `more`"), "{found:#?}");
    assert!(has(&found, &text, "front_area_m2 = \"\"", "invalid type: string"), "{found:#?}");
    assert!(errors(VEHICLE, &vehicle).is_empty());
}

#[test]
fn a_key_that_is_missing_without_another_in_its_place_is_named_alone() {
    let text = VEHICLE.replacen("mass_kg = 1500", "", 1).replacen("drag_coefficient = ", "drag_coefficient = 5000", 1);
    let found = errors(&text, &vehicle);
    assert_eq!(found.len(), 2, "{found:#?}");
    assert!(has(&found, &text, "[vehicle]", "missing field `mass_kg`"), "{found:#?}");
    assert!(has(&found, &text, "drag_coefficient", "`vehicle.drag_coefficient` is 5000"), "{found:#?}");
}

/// A range that follows from a value that is not that of the file would be an error of none.
#[test]
fn what_follows_from_a_guess_is_no_error() {
    let text = EXPERIMENT.replacen("duration_s = ", "# ", 1);
    assert_eq!(errors(&text, &experiment).len(), 1, "{:#?}", errors(&text, &experiment));
}

#[test]
fn a_short_vehicle_file_names_the_unknown_keys_beside_the_missing_ones() {
    let text = "name = \"s\"\n[gear_train]\nratios = [4.17, 2.34]\n[engine]\nmax_torque_n_m = 1e9\n[driveline]\nfinal_ratio = 3.2\n\
                [vehicle]\nmas_kg = 1650.0\nwheel_radius_m = 0.32\n";
    let found = errors(text, &vehicle);
    assert_eq!(found.len(), 3, "{found:#?}");
    assert!(found.iter().any(|error| error.contains("`vehicle.mass_kg`: is missing")), "{found:#?}");
    assert!(has(&found, text, "mas_kg", "unknown field `mas_kg`"), "{found:#?}");
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
fn the_errors_of_a_file_that_another_one_names_are_said_once() {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed.toml"));
    let source = Source::read(path).unwrap();
    let read = |source| CarFile::from_source(source).map(drop);
    let text = source.text.replacen("mass_kg = ", "mas_kg = ", 1).replacen("8hp.toml", "none.toml", 1);
    let found = all_errors(&Source { text, ..source.clone() }, &read);
    assert_eq!(found.len(), 2, "{found:#?}");
    assert!(all_errors(&source, &read).is_empty());
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
            for error in all_errors(&Source::built_in("f.toml", &text), &vehicle) {
                assert!(error.line().is_some_and(|line| (1..=lines).contains(&line)), "{error}");
            }
        }
    }
}
