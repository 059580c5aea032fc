//! Errors in files of every kind, with the line that is wrong: what is printed, to the byte.

use crate::support::{Folder, ROOT, refused, stderr, stdout, wetclutch};

/// The standard error of `check` of a file, whose folder is left out.
fn checked(name: &str, text: &str, options: &[&str]) -> String {
    let folder = Folder::new("excerpt");
    let file = folder.write(name, text);
    refused(&wetclutch(&[&["check", &file], options].concat())).replace(&folder.path(""), "")
}

/// A shipped file with a part replaced, and with absolute paths.
fn shipped(path: &str, old: &str, new: &str) -> String {
    let text = std::fs::read_to_string(format!("{ROOT}{path}")).unwrap();
    assert!(text.contains(old), "{path}: {old}");
    text.replacen(old, new, 1).replace("\"../", &format!("\"{ROOT}"))
}

/// The lines of an excerpt and what is before it, without the numbers of its lines.
fn marked(said: &str) -> Vec<&str> {
    let parts = said.lines().filter_map(|line| line.split_once(" | ").map(|(_, part)| part.trim_end()));
    parts.collect()
}

#[test]
fn a_value_out_of_range_is_shown_with_its_line_and_carets() {
    let said = checked("map.toml", "[channel.engine_speed]\nname = \"N\" # of the engine\ndelay_s = 99.5\n", &[]);
    let expected = "\
error: map.toml:3: `channel.engine_speed.delay_s` is 99.5, expected 0 to 10
 --> map.toml:3:11
  |
3 | delay_s = 99.5
  |           ^^^^
hint: it is in s: 20 ms is 0.02
";
    assert_eq!(said, expected);
}

#[test]
fn all_errors_of_a_file_have_their_lines_and_hints_come_last() {
    let text = "[channel.engine_speed]\nnaem = \"N\"\ndelay_s = 99\n";
    let expected = "\
error: map.toml:2: unknown key `naem`, expected one of `name`, `names`, `group`, `combine`, `unit`, `scale`, `offset`, `delay_s`, `late_s`, `sent_on_change`, `valid_range`
 --> map.toml:2:1
  |
2 | naem = \"N\"
  | ^^^^
hint: did you mean `name`, which is missing?
error: map.toml:3: `channel.engine_speed.delay_s` is 99, expected 0 to 10
 --> map.toml:3:11
  |
3 | delay_s = 99
  |           ^^
hint: it is in s: 20 ms is 0.02
";
    assert_eq!(checked("map.toml", text, &[]), expected);
}

#[test]
fn colours_come_when_they_are_asked_for_and_never_in_results() {
    let text = "\n\n\n\n\n\n\n\n[channel.engine_speed]\ndelay_s = \"soon\"\nname = \"N\"\n";
    let expected = "\
\u{1b}[1m\u{1b}[31merror:\u{1b}[0m map.toml:10: invalid type: the text \"soon\", expected a number
  \u{1b}[1m\u{1b}[34m-->\u{1b}[0m map.toml:10:11
   \u{1b}[1m\u{1b}[34m|\u{1b}[0m
\u{1b}[1m\u{1b}[34m10 |\u{1b}[0m delay_s = \"soon\"
   \u{1b}[1m\u{1b}[34m|\u{1b}[0m           \u{1b}[1m\u{1b}[31m^^^^^^\u{1b}[0m
";
    let coloured = checked("map.toml", text, &["--color", "always"]);
    assert_eq!(coloured, expected);
    let plain = checked("map.toml", text, &[]);
    assert!(!plain.contains('\u{1b}') && plain == checked("map.toml", text, &["--color=never"]));
    assert_eq!(plain_of(&coloured), plain);
    let folder = Folder::new("excerpt-json");
    let json = wetclutch(&["check", "--json", "--color", "always", &folder.write("map.toml", text)]);
    assert!(stdout(&json).contains("invalid type") && !stdout(&json).contains('\u{1b}'), "{}", stdout(&json));
    // Wrong arguments too.
    let wrong = wetclutch(&["check", "--nonsense", "--color", "always"]);
    assert!(stderr(&wrong).contains('\u{1b}'), "{}", stderr(&wrong));
    assert!(!stderr(&wetclutch(&["check", "--nonsense"])).contains('\u{1b}'));
}

/// A text without the sequences that give it colours.
fn plain_of(text: &str) -> String {
    let mut parts = text.split('\u{1b}');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |plain, part| plain + part.split_once('m').unwrap().1)
}

#[test]
fn an_error_of_every_kind_of_file_has_its_line() {
    let eight = "vehicles/eight_speed.toml";
    for (name, text, shown) in [
        ("car.toml", shipped(eight, "mass_kg = 1", "mass_kg = -1"), "mass_kg = -1"),
        ("car.toml", shipped(eight, "mass_kg = ", "mas_kg = "), "mas_kg = "),
        ("vehicle.toml", shipped("vehicles/two_speed_at.toml", "mass_kg = 1500", "mass_kg = [1]"), "mass_kg = [1]"),
        ("vehicle.toml", shipped("vehicles/two_speed_at.toml", "mass_kg = 1500", "mass_kg = = 1"), "mass_kg = = 1"),
        ("drive.toml", shipped("drives/city.toml", "throttle = ", "throtle = "), "throtle = "),
        ("experiment.toml", shipped("experiments/e1.toml", "duration_s = ", "duration_s = -"), "duration_s = -"),
        ("study.toml", shipped("experiments/settings.toml", "runs = ", "runs = -"), "runs = -"),
        ("gearbox.toml", shipped("gearboxes/8hp.toml", "ring_teeth = ", "ring_teeth = -"), "-"),
        ("sensors.toml", "[sensors]\nengine = { noise = -1 }\n".to_owned(), "noise = -1"),
        ("learnt.toml", "mean = [1, 2]\ncovariance = 3\n".to_owned(), ""),
    ] {
        let said = checked(name, &text, &[]);
        let lines = marked(&said);
        let is_shown =
            lines.chunks(2).any(|pair| pair[0].contains(shown) && pair.last().is_some_and(|line| line.contains('^')));
        assert!(lines.len() >= 2 && is_shown, "{name}: {said}");
        let line = said.split(" --> ").nth(1).and_then(|place| place.split(':').nth(1)).unwrap();
        assert!(said.contains(&format!("{name}:{line}: ")), "{said}");
    }
}

#[test]
fn a_file_that_is_not_there_or_of_another_kind_has_no_excerpt() {
    let folder = Folder::new("no-excerpt");
    for file in [folder.path("none.toml"), folder.write("empty.toml", ""), folder.write("log.csv", "a,b,c\n1,2,3\n")] {
        let said = refused(&wetclutch(&["check", &file]));
        assert!(said.starts_with("error: ") && !said.contains("-->"), "{said}");
    }
}
