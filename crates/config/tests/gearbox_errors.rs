//! Gearbox files that are wrong: line, key, what is wrong and what to do.

use config::{GearboxFile, Kind, Source};
use geartrain::Change;

const EIGHT_SPEED: &str = include_str!("../../../gearboxes/8hp.toml");
const DUAL_CLUTCH: &str = include_str!("../../../gearboxes/dual_clutch_7.toml");
const SHARES: &str = include_str!("gearboxes/shares.toml");
const RATIOS: &str = include_str!("gearboxes/ratios.toml");

/// The error of a file with one piece of its text replaced, without the file and the line, which must be that of the piece.
fn error_in(text: &str, from: &str, to: &str) -> String {
    let at = text.find(from).unwrap_or_else(|| panic!("{from}"));
    let line = 1 + text[..at].matches('\n').count();
    let error =
        GearboxFile::from_source(Source::built_in("g.toml", &text.replacen(from, to, 1))).unwrap_err().to_string();
    let place = format!("g.toml:{line}: ");
    error.strip_prefix(&place).unwrap_or_else(|| panic!("line {line}: {error}")).to_owned()
}

#[test]
fn the_kind_of_a_gearbox_file_is_known_on_every_level() {
    for text in [EIGHT_SPEED, DUAL_CLUTCH, SHARES, RATIOS] {
        assert_eq!(Source::built_in("g.toml", text).kind().unwrap(), Kind::Gearbox);
    }
}

#[test]
fn an_unknown_element_is_named_with_those_that_exist() {
    assert_eq!(
        error_in(EIGHT_SPEED, r#"name = "4", engaged = ["B", "D", "E"]"#, r#"name = "4", engaged = ["B", "D", "X"]"#),
        "`gear.4.engaged`: there is no element \"X\"\nhint: the elements are A, B, C, D, E"
    );
}

#[test]
fn a_gear_with_too_few_or_too_many_elements_says_how_many_it_needs() {
    let engaged = r#"name = "4", engaged = ["B", "D", "E"]"#;
    assert_eq!(
        error_in(EIGHT_SPEED, engaged, r#"name = "4", engaged = ["B", "D"]"#),
        "`gear.4.engaged`: \"4\" engages B, D: the ratio of input to output is not determined\n\
         hint: a gear of this gearbox engages 3 elements: add 1"
    );
    assert_eq!(
        error_in(EIGHT_SPEED, engaged, r#"name = "4", engaged = ["A", "B", "D", "E"]"#),
        "`gear.4.engaged`: \"4\" engages A, B, D, E: input and output cannot turn\n\
         hint: 3 engaged elements are enough for a gear of this gearbox: remove 1"
    );
}

#[test]
fn a_stated_ratio_is_compared_with_as_many_digits_as_it_has() {
    assert_eq!(
        error_in(
            EIGHT_SPEED,
            r#"{ name = "2", engaged = ["A", "B", "E"], stated_ratio = 3.1304"#,
            r#"{ name = "2", engaged = ["A", "B", "E"], stated_ratio = 3.1403"#
        ),
        "`gear.2.stated_ratio`: the ratio of \"2\" is 3.1304, but 3.1403 is stated\n\
         hint: check teeth, `planets` and the engaged elements; leave `stated_ratio` out if it is not known"
    );
    let shorter = EIGHT_SPEED.replacen("stated_ratio = 3.1304", "stated_ratio = 3.13", 1);
    assert!(GearboxFile::from_source(Source::built_in("g.toml", &shorter)).is_ok());
}

#[test]
fn numbers_in_wrong_units_get_the_right_one_as_hint() {
    assert_eq!(
        error_in(EIGHT_SPEED, "mean_radius_m = 0.085", "mean_radius_m = 85"),
        "`element.A.pack.mean_radius_m` is 85, expected 0.02 to 0.5\nhint: 85 mm is 0.085 m"
    );
    assert!(
        error_in(EIGHT_SPEED, "line_pressure_pa = 1.6e6", "line_pressure_pa = 1.6").contains("1.6 MPa is 1600000 Pa")
    );
    assert!(error_in(EIGHT_SPEED, "sun_teeth = 48", "sun_teeth = 48.5").contains("expected an integer"));
    let inertia = r#"{ name = "c1", inertia_kg_m2 = "#;
    assert!(error_in(EIGHT_SPEED, inertia, &format!("{inertia}nan, x = ")).contains("unknown key `x`"));
}

#[test]
fn an_element_that_slips_at_the_torque_asked_names_gear_and_torques() {
    let from = r#"stated_ratio = -3.2968, turbine_max_n_m = 400"#;
    let text = EIGHT_SPEED.replacen(from, "stated_ratio = -3.2968, turbine_max_n_m = 600", 1);
    let error = GearboxFile::from_source(Source::built_in("g.toml", &text)).unwrap_err().to_string();
    assert!(
        error.contains("`element.B.pack`: \"B\" slips in \"R\": it holds 1430 N m, 1585 N m are required"),
        "{error}"
    );
    assert!(error.contains("hint: with 1.1 times the friction faces"), "{error}");
}

/// A table with two columns of one name could not be read.
#[test]
fn elements_whose_columns_have_one_name_are_refused() {
    let hint = "hint: names of elements differ in more than capital letters, spaces and signs: rename one of them, in the gears too";
    let renamed = |text: &str, first: &str, second: &str| {
        text.replace("\"A\"", &format!("\"{first}\"")).replace("name = \"B\"", &format!("name = \"{second}\""))
    };
    for (first, second, column) in [("FWD", "fwd", "element_fwd"), ("C/1", "C 1", "element_c_1")] {
        for text in [EIGHT_SPEED, SHARES] {
            let error = error_in(&renamed(text, first, "B"), "name = \"B\"", &format!("name = \"{second}\""));
            assert!(
                error.contains(&format!(
                    "\"{first}\" and \"{second}\" have the same columns in a table: {column}_...\n{hint}"
                )),
                "{error}"
            );
        }
    }
    let dog = error_in(DUAL_CLUTCH, "dog = \"D2\"", "dog = \"d1\"");
    assert!(dog.starts_with("`gear_pair.dog`: \"D1\" and \"d1\" have"), "{dog}");
}

#[test]
fn the_level_must_be_given_and_known() {
    let missing = error_in(EIGHT_SPEED, "level = \"stick-diagram\"", "level = \"drawing\"");
    assert!(missing.contains("there is no such level\nhint: the levels are \"stick-diagram\""), "{missing}");
    let text = EIGHT_SPEED.replacen("level = \"stick-diagram\"\n", "", 1);
    let error = GearboxFile::from_source(Source::built_in("g.toml", &text)).unwrap_err().to_string();
    assert!(error.contains("missing `level`"), "{error}");
    let other = EIGHT_SPEED.replacen("level = \"stick-diagram\"", "level = \"ratios\"", 1);
    assert!(
        GearboxFile::from_source(Source::built_in("g.toml", &other)).unwrap_err().to_string().contains("unknown key")
    );
}

#[test]
fn parts_of_the_other_levels_have_their_places_too() {
    assert!(error_in(SHARES, "shares = { A = 1.5 }", "shares = { X = 1.5 }").contains("there is no element \"X\""));
    assert!(
        error_in(RATIOS, "ratio = 2.468", "ratio = 0.0").contains("is 0, expected turbine speed over output speed")
    );
    let text = RATIOS.replacen("coupling_kg_m2 = -0.05", "coupling_kg_m2 = -0.5", 1);
    let error = GearboxFile::from_source(Source::built_in("g.toml", &text)).unwrap_err().to_string();
    assert!(error.contains("`shift_mass.coupling_kg_m2`: the mass of the shift between \"1\" and \"2\""), "{error}");
    assert!(
        error_in(DUAL_CLUTCH, r#"driven_teeth = 51, dog = "D2""#, r#"driven_teeth = 51, dog = "D1""#)
            .contains("two entries have the name \"D1\"")
    );
}

#[test]
fn shares_and_ratios_give_their_shifts() {
    let gearbox = |text: &str| GearboxFile::from_source(Source::built_in("g.toml", text)).unwrap().gearbox;
    let shares = gearbox(SHARES);
    let up = shares.shift(0, 1).unwrap();
    assert_eq!(up.change, Change::Single { offgoing: 0, oncoming: 1, held: vec![] });
    let alpha = up.reduced.unwrap().slip_offgoing[0];
    assert!((alpha - 1.0 / 1.5).abs() < 1e-12, "{alpha}");
    assert_eq!(shares.capacities.len(), 1);
    let ratios = gearbox(RATIOS);
    let [first, second, third] = ["1", "2", "3"].map(|name| ratios.gear(name).unwrap());
    assert!(ratios.shift(first, second).unwrap().reduced.is_some());
    assert_eq!(ratios.shift(second, third).unwrap().reduced, None, "no mass is given");
}

#[test]
fn teeth_that_are_unusual_are_warned_of_with_their_line() {
    let file =
        GearboxFile::from_source(Source::built_in("g.toml", include_str!("../../../gearboxes/fn4a.toml"))).unwrap();
    assert_eq!(file.warnings.len(), 1);
    assert!(
        file.warnings[0].contains("61 teeth, which is odd") && file.warnings[0].starts_with("g.toml:"),
        "{:?}",
        file.warnings
    );
}

/// Every shaft of a gearbox with its inertia times a factor: ten times, a thousand times, and the other way.
#[test]
fn an_inertia_in_the_wrong_unit_is_questioned_with_the_likely_one() {
    let sun = "{ name = \"sun12\", inertia_kg_m2 = ";
    let warnings = |text: &str| GearboxFile::from_source(Source::built_in("g.toml", text)).unwrap().warnings;
    let with = |inertia: &str| warnings(&EIGHT_SPEED.replacen(&format!("{sun}0.004"), &format!("{sun}{inertia}"), 1));
    assert_eq!(with("0.004"), Vec::<String>::new());
    let line =
        "g.toml:30: `shaft.sun12.inertia_kg_m2`: is 8 kg m2; what turns with it usually has 0.0008 to 0.02 kg m2";
    assert_eq!(with("8"), [format!("{line}\nhint: 8 g m2 is 0.008 kg m2: check the unit")]);
    assert!(with("40")[0].ends_with("hint: 40 kg cm2 is 0.004 kg m2: check the unit"));
    assert!(with("0.1")[0].ends_with("hint: 0.1 lb ft2 is 0.0042 kg m2: check the unit"));
    assert!(with("4e-5")[0].contains("hint: it is the sum of m r2"));
    for name in ["in", "sun12", "ring1", "c1", "r2", "r3", "c3", "out"] {
        for factor in [0.1, 0.5, 2.0, 10.0] {
            let entry = format!("{{ name = \"{name}\", inertia_kg_m2 = ");
            let (before, rest) = EIGHT_SPEED.split_once(&entry).unwrap();
            let (number, after) = rest.split_once(' ').unwrap();
            let other = factor * number.parse::<f64>().unwrap();
            let said = warnings(&format!("{before}{entry}{other} {after}"));
            assert_eq!(said.len(), usize::from(!(0.2..=5.0).contains(&factor)), "{name} times {factor}: {said:?}");
        }
    }
    // Without torques the plates give the size, and without plates it may be any.
    let bare = |text: &str| text.replace(", turbine_max_n_m = 400", "").replace(", turbine_max_n_m = 250", "");
    let of_sun = |inertia: &str, text: &str| {
        warnings(&text.replacen(&format!("{sun}0.004"), &format!("{sun}{inertia}"), 1)).len()
    };
    let plates = bare(EIGHT_SPEED);
    let none: String =
        plates.lines().filter(|line| !line.starts_with("pack")).map(|line| format!("{line}\n")).collect();
    assert_eq!([of_sun("0.04", &plates), of_sun("0.04", &none), of_sun("8", &none)], [1, 0, 1]);
}

#[test]
fn the_examples_of_the_documentation_are_gearbox_files() {
    let page = include_str!("../../../docs/reference/gearbox-file.md");
    let examples: Vec<&str> = page.split("```toml").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert_eq!(examples.len(), 2);
    let gearboxes =
        examples.iter().map(|text| GearboxFile::from_source(Source::built_in("g.toml", text)).unwrap().gearbox);
    let shifts: Vec<_> = gearboxes.map(|gearbox| gearbox.shift(0, 1).unwrap().reduced.unwrap()).collect();
    // The same gearbox on two levels, to the digits that are written.
    for (a, b) in shifts[0].mass_kg_m2.concat().into_iter().zip(shifts[1].mass_kg_m2.concat()) {
        assert!((a - b).abs() < 6e-5, "{a} {b}");
    }
}
