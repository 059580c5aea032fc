//! `wetclutch fit --write-map`: the channel map with what a fit has found of the channels.

use crate::any_car::{numbers, simulated_twice};
use crate::fit_gearbox::{CAR, town};
use crate::late_commands::{late, map};
use crate::support::{refused, said, stderr, wetclutch};

/// Rows that the commands come late, each of 10 ms.
const ROWS: isize = 12;

#[test]
fn the_map_that_a_fit_writes_moves_late_commands_as_a_map_by_hand() {
    let (folder, _) = town();
    let log = folder.write("late.csv", late(&folder.read("city_measured.csv"), ROWS));
    let text = folder.read("late.csv");
    let given = folder.write("given.toml", format!("# my map\n{}", map(&text, "# a current")));
    std::fs::create_dir(folder.path("maps")).unwrap();
    let (new, fitted) = (folder.path("maps/new.toml"), folder.path("fitted.toml"));
    let options = ["--vehicle", CAR, "-o", &fitted, "--map", &given, "--write-map", &new];
    let output = wetclutch(&[&["fit", &log][..], &options].concat());
    let notes = said(&output);
    assert!(notes.contains("channel map, with the delays, scales and zero offsets that were found: "), "{notes}");
    let written = folder.read("maps/new.toml");
    assert!(written.starts_with("# Written by `wetclutch fit`, ") && written.contains("\n# my map\n"), "{written}");
    // Everything but the first line and the new lines is as it was.
    let is_new =
        |line: &&str| line.starts_with("# fit: ") || ["late_s", "delay_s"].contains(&line.split(' ').next().unwrap());
    let kept: Vec<&str> = written.lines().skip(1).filter(|line| !is_new(line)).collect();
    assert_eq!(kept, folder.read("given.toml").lines().collect::<Vec<_>>());
    let late_s: Vec<f64> = written.lines().filter_map(|line| line.strip_prefix("late_s = ")?.parse().ok()).collect();
    assert!(late_s.len() == 5 && late_s.iter().all(|late_s| (late_s - 0.01 * ROWS as f64).abs() < 0.01), "{late_s:?}");
    // The estimates are those of the map by hand, and no command is late any more.
    let by_hand = folder.write("by_hand.toml", map(&text, &format!("late_s = {}", 0.01 * ROWS as f64)));
    let estimated = |map: &str, name: &str| {
        let output = wetclutch(&["estimate", &log, "--vehicle", CAR, "--map", map, "-o", &folder.path(name)]);
        assert_eq!(stderr(&output).contains("the commands of the valves come"), map == given, "{}", stderr(&output));
        said(&output);
        let table = folder.read(name);
        [numbers(&table, "oncoming_torque_estimate_n_m"), numbers(&table, "time_s")]
    };
    let [new_n_m, hand_n_m, given_n_m] =
        [(&new, "new.csv"), (&by_hand, "hand.csv"), (&given, "given.csv")].map(|(map, name)| estimated(map, name));
    let off = |one: &[Vec<f64>; 2]| {
        let at = |time_s: f64| one[1].iter().position(|time| (time - time_s).abs() < 2e-3);
        let pairs = hand_n_m[1].iter().zip(&hand_n_m[0]).filter_map(|(time_s, hand)| Some(one[0][at(*time_s)?] - hand));
        let errors: Vec<f64> = pairs.filter(|error| error.is_finite()).map(f64::abs).collect();
        errors.iter().sum::<f64>() / errors.len() as f64
    };
    let (new, given) = (off(&new_n_m), off(&given_n_m));
    assert!(new < 0.25 * given && given > 1.0, "{new} {given}");
}

#[test]
fn a_map_of_other_make_is_not_replaced_and_the_option_needs_a_map() {
    let folder = simulated_twice("write-map-refused");
    let log = folder.path("sim/short_measured.csv");
    let given = folder.write("given.toml", map(&folder.read("sim/short_measured.csv"), ""));
    let mine = folder.write("mine.toml", "[channel.engine_speed]\nname = \"N\"\n");
    let fitted = folder.path("fitted.toml");
    let fit =
        |more: &[&str]| refused(&wetclutch(&[&["fit", &log, "--vehicle", CAR, "-o", &fitted][..], more].concat()));
    assert!(fit(&["--write-map", &mine]).contains("--map"), "{}", fit(&["--write-map", &mine]));
    let with_map = ["--map", &given, "--write-map"];
    for (new, expected) in [
        (&mine, "exists and is no channel map of a fit"),
        (&given, "the output would replace this input"),
        (&fitted, "another output of this command"),
    ] {
        let said = fit(&[&with_map[..], &[new]].concat());
        assert!(said.contains(expected), "{said}");
    }
    assert!(!std::path::Path::new(&fitted).exists());
}
