//! What the filter learns of a car with a gearbox, kept from log to log.

use std::process::Output;

use crate::support::{Folder, ROOT, VEHICLE, refused, said, stderr, wetclutch};

/// The page with an example of what is said.
const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/how-to/estimate-logs.md");

fn vehicle(name: &str) -> String {
    format!("{ROOT}vehicles/{name}.toml")
}

/// Simulates some minutes in town of the eight-speed car, or of the car of this file, into `sim` of the folder.
fn town(folder: &Folder, repetitions: u32, car: &str) {
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive = drive.replace("repetitions = 20", &format!("repetitions = {repetitions}"));
    let drive = folder.write("drive.toml", drive.replace("vehicle = ", "# vehicle = "));
    said(&wetclutch(&["simulate", &drive, "--vehicle", car, "-o", &folder.path("sim")]));
}

fn estimate(folder: &Folder, logs: &[&str], more: &[&str]) -> Output {
    let logs: Vec<String> = logs.iter().map(|log| folder.path(log)).collect();
    let logs: Vec<&str> = logs.iter().map(String::as_str).collect();
    wetclutch(&[&["estimate", "--vehicle", &vehicle("eight_speed")], &logs[..], more].concat())
}

/// The line that says what became of the file.
fn line(text: &str) -> String {
    text.lines().find(|line| line.starts_with("learnt: ")).unwrap_or_else(|| panic!("{text}")).to_owned()
}

/// The value that is said of an element, and its standard deviation.
fn of_element(text: &str, what: &str, element: &str) -> [f64; 2] {
    let said = text.lines().find(|line| line.starts_with(what)).unwrap_or_else(|| panic!("{text}"));
    let after = said.split_once(": ").unwrap().1.split(", ").find_map(|part| part.strip_prefix(&format!("{element} ")));
    let (value, std_dev) = after.unwrap().split_once(" +-").unwrap();
    [value, std_dev].map(|number| number.parse().unwrap())
}

#[test]
fn what_is_learnt_goes_from_log_to_log() {
    let folder = Folder::new("learnt");
    town(&folder, 1, &vehicle("eight_speed"));
    let (log, learnt) = ("sim/city_measured.csv", folder.path("learnt.toml"));
    let run =
        |output: &str, more: &[&str]| said(&estimate(&folder, &[log], &[&["-o", &folder.path(output)], more].concat()));
    run("without.csv", &[]);
    let first = run("first.csv", &["--learnt", &learnt]);
    let count: u32 = line(&first).split_whitespace().nth(3).unwrap().parse().unwrap();
    assert!(count > 10, "{first}");
    assert_eq!(line(&first), format!("learnt: {learnt}, after {count} shifts of this log ({count} in all)"));
    // The page shows the same words with the numbers of a longer drive.
    let words = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|line| line.starts_with("learnt"));
        lines
            .map(|line| line.replace(&learnt, "learnt.toml").replace(|c: char| "+-.0123456789".contains(c), ""))
            .collect()
    };
    assert_eq!(words(&std::fs::read_to_string(PAGE).unwrap()), words(&first));
    // Nothing was known before the first log.
    assert!(folder.read("first.csv") == folder.read("without.csv"));
    let after_first = folder.read("learnt.toml");
    let second = run("second.csv", &["--learnt", &learnt]);
    assert_eq!(line(&second), format!("learnt: {learnt}, after {count} shifts of this log ({} in all)", 2 * count));
    assert!(folder.read("second.csv") != folder.read("first.csv") && folder.read("learnt.toml") != after_first);
    // On standard output the same.
    folder.write("piped.toml", &after_first);
    let piped = estimate(&folder, &[log], &["--learnt", &folder.path("piped.toml")]);
    assert!(String::from_utf8(piped.stdout).unwrap() == folder.read("second.csv"));
    assert!(folder.read("piped.toml") == folder.read("learnt.toml"));

    // Several logs go one after the other, on any number of threads; one that fails leaves the file as it was.
    folder.write("one.csv", folder.read(log));
    folder.write("two.csv", folder.read(log));
    folder.write("bad.csv", "no log\n1\n");
    let (out, several) = (folder.path("out"), folder.path("several.toml"));
    let logs = ["one.csv", "bad.csv", "two.csv"];
    let text = refused(&estimate(&folder, &logs, &["-o", &out, "--learnt", &several, "--threads", "4"]));
    assert!(text.contains("1 of 3 logs have no estimate"), "{text}");
    assert!(folder.read("several.toml") == folder.read("learnt.toml"));
    assert!(folder.read("out/one.csv") == folder.read("first.csv"));
    assert!(folder.read("out/two.csv") == folder.read("second.csv"));

    // A log without a shift does not wear off what was learnt, and makes no file.
    let log: String = folder.read(log).lines().take(300).map(|line| format!("{line}\n")).collect();
    let log = folder.write("still.csv", log);
    for (file, end) in [("learnt.toml", "stays as it is"), ("other.toml", "is not written")] {
        let file = folder.path(file);
        let car = vehicle("eight_speed");
        let text = said(&wetclutch(&[
            "estimate",
            &log,
            "--vehicle",
            &car,
            "--learnt",
            &file,
            "-o",
            &folder.path("still_out.csv"),
        ]));
        let expected = format!("learnt: nothing, no shift of this log could be learnt from; {file} {end}");
        assert_eq!(line(&text), expected);
    }
    assert!(folder.read("several.toml") == folder.read("learnt.toml"));
    assert!(!folder.names().contains(&"other.toml".to_owned()));
}

#[test]
fn a_file_that_was_not_learnt_of_this_car_is_refused_before_anything_is_written() {
    let folder = Folder::new("learnt-refused");
    town(&folder, 1, &vehicle("eight_speed"));
    let log = "sim/city_measured.csv";
    let (learnt, out) = (folder.path("learnt.toml"), folder.path("out.csv"));
    said(&estimate(&folder, &[log], &["--learnt", &learnt, "-o", &folder.path("first.csv")]));
    let text = folder.read("learnt.toml");
    let learnt_before = text.clone();
    let refused_with = |text: &str| {
        let file = folder.write("wrong.toml", text);
        let message = refused(&estimate(&folder, &[log], &["--learnt", &file, "-o", &out]));
        assert!(message.contains("wrong.toml:") && message.contains("\nhint: "), "{message}");
        assert!(folder.read("wrong.toml") == text && !folder.names().contains(&"out.csv".to_owned()));
        message
    };
    assert!(refused_with(&text.replace("\"E\"", "\"F\"")).contains("was learnt of the gearbox"));
    let numbers = observer::gearbox::LEARNT;
    let one_more = format!("has {} numbers, expected {numbers}", numbers + 1);
    assert!(refused_with(&text.replace("mean = [", "mean = [9, ")).contains(&one_more));
    assert!(refused_with(&text.replace("mean = [", "mean = [9")).contains("not within the bounds"));
    assert!(refused_with(&text[..text.len() / 2]).contains("hint: --learnt takes a file that"));
    assert!(refused_with("").contains("missing key `gearbox`"));
    assert!(refused_with(&std::fs::read_to_string(vehicle("eight_speed")).unwrap()).contains("unknown key"));
    assert!(refused_with(&folder.read(log)).contains("this looks like a table"));
    let other = |name: &str| {
        let more = ["--vehicle", &vehicle(name), "--learnt", &learnt, "-o", &out];
        refused(&wetclutch(&[&["estimate", &folder.path(log)], &more[..]].concat()))
    };
    assert!(other("six_speed").contains("and the car has \"Lepelletier 6-speed (6HP26)\""));
    // The estimate and what was learnt cannot be one file, also where neither is there yet.
    for file in ["out.csv", "out_shifts.json", "out_report.html"] {
        let text = refused(&estimate(&folder, &[log], &["--learnt", &folder.path(file), "-o", &out]));
        assert!(text.contains("an estimate goes into this file\nhint: "), "{text}");
    }
    assert!(refused(&estimate(&folder, &[log], &["--learnt", &folder.path("")])).contains("this is a folder"));
    assert!(refused(&estimate(&folder, &[log], &["--learnt", "-"])).contains("hint: name one"));
    let of_one_shift = wetclutch(&["estimate", &folder.path(log), "--vehicle", VEHICLE, "--learnt", &learnt]);
    assert!(stderr(&of_one_shift).contains("warning: --learnt has no effect: "), "{}", stderr(&of_one_shift));
    assert!(folder.read("learnt.toml") == learnt_before);
}

#[test]
fn a_friction_above_the_file_is_said_in_words() {
    let folder = Folder::new("learnt-friction");
    let car = std::fs::read_to_string(vehicle("eight_speed")).unwrap();
    let factor = "factor = [1.0, 1.025, 1.08, 1.15, 1.21]\nstatic_factor = 1.08";
    assert!(car.contains(factor));
    let more = "factor = [1.12, 1.148, 1.2096, 1.288, 1.3552]\nstatic_factor = 1.2096";
    let car = car.replace(factor, more).replace("../gearboxes", &format!("{ROOT}gearboxes"));
    town(&folder, 2, &folder.write("car.toml", car));
    let learnt = folder.path("learnt.toml");
    let text =
        said(&estimate(&folder, &["sim/city_measured.csv"], &["--learnt", &learnt, "-o", &folder.path("out.csv")]));
    // All five have 12 %; B shifts once in a while only.
    for element in ["A", "C", "D", "E"] {
        let [torque, std_dev] = of_element(&text, "learnt torque at the same pressure", element);
        assert!((torque - 12.0).abs() < 12.0 && (torque - 12.0).abs() < 2.0 * std_dev, "{element}: {text}");
        let [kiss_kpa, std_dev] = of_element(&text, "learnt kiss points", element);
        assert!(kiss_kpa.abs() < 3.0 * std_dev, "{element}: {text}");
    }
    let again = ["--learnt", &folder.path("again.toml"), "-o", &folder.path("again.csv"), "--units", "bar"];
    let in_bar = said(&estimate(&folder, &["sim/city_measured.csv"], &again));
    assert!(in_bar.contains("learnt kiss points in bar, ") && !in_bar.contains("kPa"), "{in_bar}");
    let [kpa, bar] = [&text, &in_bar].map(|text| of_element(text, "learnt kiss points", "C")[1]);
    assert!((0.01 * kpa - bar).abs() < 0.001, "{kpa} kPa, {bar} bar");
    assert!(text.contains("\nlearnt scale of the wheel speed: it reads "), "{text}");
    // The converter is that of the file, and the simulated engine reports its torque as it is.
    for name in ["learnt torque at the gearbox input: ", "learnt reported engine torque: "] {
        let number = |text: &str| text.split(' ').next().unwrap().trim_start_matches("+-").parse::<f64>().unwrap();
        let said = text.split_once(name).unwrap().1;
        let std_dev = number(said.split_once(' ').unwrap().1);
        assert!(number(said).abs() < 3.0 * std_dev && std_dev < 5.0, "{name}: {text}");
    }
}

/// The log with a column of the oil's temperature, degC.
fn with_oil(text: &str, degc: &str) -> String {
    let mut lines = text.lines();
    let head = format!("{},oil_temperature_degc\n", lines.next().unwrap());
    head + &lines.map(|line| format!("{line},{degc}\n")).collect::<String>()
}

#[test]
fn a_log_with_colder_oil_forgets_what_depends_on_it() {
    let folder = Folder::new("learnt-oil");
    town(&folder, 1, &vehicle("eight_speed"));
    let text = folder.read("sim/city_measured.csv");
    for degc in ["80", "82", "20", ""] {
        folder.write(&format!("oil_{degc}.csv"), with_oil(&text, degc));
    }
    let warm = folder.path("warm.toml");
    said(&estimate(&folder, &["oil_80.csv"], &["-o", &folder.path("first.csv"), "--learnt", &warm]));
    assert!(folder.read("warm.toml").contains("\noil_temperature_degc = 80.0\n"));
    let again = |degc: &str| {
        let learnt = folder.write("again.toml", folder.read("warm.toml"));
        said(&estimate(
            &folder,
            &[&format!("oil_{degc}.csv")],
            &["-o", &folder.path("again.csv"), "--learnt", &learnt],
        ));
        folder.read("again.csv")
    };
    let (same, near, cold, unknown) = (again("80"), again("82"), again("20"), again(""));
    assert!(
        same == near && same == unknown,
        "two kelvin are the noise of a sensor, and without a reading time alone counts"
    );
    assert!(same != cold);
    // Without a file the temperature changes nothing.
    said(&estimate(&folder, &["oil_20.csv"], &["-o", &folder.path("cold.csv")]));
    assert!(folder.read("cold.csv") == folder.read("first.csv"));
}
