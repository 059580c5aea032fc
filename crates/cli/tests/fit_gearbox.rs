//! `wetclutch fit` of a car with a whole gearbox.

use std::path::Path;

use crate::support::{Folder, ROOT, printed, refused, said, shown, stderr, wetclutch};

pub(crate) const CAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed.toml");

/// The factor of a quantity in the table of a fit, and its interval.
fn factor(table: &str, name: &str) -> [f64; 3] {
    let line = table.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name}: {table}"));
    let numbers = line[name.len()..].split_whitespace().filter_map(|word| word.parse().ok()).take(3);
    numbers.collect::<Vec<f64>>().try_into().unwrap_or_else(|_| panic!("{line}"))
}

/// A folder with three minutes of town by a car whose clutch E has 15 % more friction, and whose converter 8 % less capacity.
pub(crate) fn town() -> (Folder, String) {
    let folder = Folder::new("fit-gearbox");
    let text = std::fs::read_to_string(CAR).unwrap().replace("../gearboxes", &format!("{ROOT}gearboxes"));
    let friction =
        "friction = { slip_rad_s = [0, 10, 50, 150, 450], coefficient = [0.138, 0.14145, 0.14904, 0.1587, 0.16698] }";
    let car = folder.write("true.toml", format!("{text}\n[clutch.E]\n{friction}\nstatic_friction = 0.149\n"));
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive =
        folder.write("city.toml", drive.replace("repetitions = 20", "repetitions = 1").replace("vehicle = ", "# "));
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("")]));
    let log = folder.path("city_measured.csv");
    (folder, log)
}

#[test]
fn a_drive_of_a_car_with_a_gearbox_gives_a_file_that_estimate_takes() {
    let (folder, log) = town();
    let fitted = folder.path("fitted.toml");
    // The valves are known to have no hysteresis: one of 10 kPa could do what these few shifts show of a friction.
    let text = std::fs::read_to_string(CAR).unwrap().replace("../gearboxes", &format!("{ROOT}gearboxes"));
    let known =
        ["A", "B", "C", "D", "E"].map(|name| format!("[clutch.{name}.error_bounds]\nvalve_hysteresis_pa = 0\n"));
    let given = folder.write("given.toml", format!("{text}\n{}", known.concat()));
    let output = wetclutch(&["fit", &log, "--vehicle", &given, "-o", &fitted, "--page", &folder.path("fit.html")]);
    let (table, notes) = (printed(&output), stderr(&output));
    let [clutch_e, clutch_c] = ["E", "C"].map(|name| factor(&table, &format!("{name}: friction x valve gain")));
    for ([_, minimum, maximum], truth) in [(clutch_e, 1.15), (clutch_c, 1.0)] {
        assert!(minimum < truth && truth < maximum, "{truth}: {table}");
    }
    // The ratio of two frictions does not contain the common factor of all torques; in the given file it is 15 % low.
    let ratio = clutch_e[0] / clutch_c[0];
    assert!((ratio / 1.15 - 1.0).abs() < 0.12, "{ratio}: {table}");
    assert!(!table.contains("these logs do not contradict the file"), "{table}");
    let page = folder.read("fit.html");
    assert!(page.matches("class=\"interval\"").count() > 10 && page.contains("E: friction x valve gain"));
    for words in [
        "converter capacity",
        "M11 of 1-2",
        "torque scale: not identified by these logs",
        "correlated: ",
        "shifts held out",
        "which is better in ",
        "mass and road load from ",
        "the reported engine torque is used in ",
    ] {
        assert!(table.contains(words), "{words}: {table}");
    }
    assert!(notes.contains("shifts: ") && notes.contains(&fitted), "{notes}");
    let text = folder.read("fitted.toml");
    for words in
        ["# fit: values below", "[clutch.E]", "[turbine_inertia_kg_m2]", "drag_n_m_s = 0.047   # C_e, [chapter]"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
    said(&wetclutch(&["check", &fitted]));
    said(&wetclutch(&["estimate", &log, "--vehicle", &fitted, "-o", &folder.path("estimate.csv")]));
    // A fitted file can be fitted again.
    let again = wetclutch(&["fit", &log, "--vehicle", &fitted, "-o", &folder.path("again.toml")]);
    let [again_e, ..] = factor(&printed(&again), "E: friction x valve gain");
    assert!((again_e - 1.0).abs() < 0.06, "{}", printed(&again));
    // A first file, whose tables hold comments alone, is fitted in the same way.
    let first = folder.path("first.toml");
    let numbers = ["--mass-kg", "1500", "--wheel-radius-m", "0.3", "--final-ratio", "3", "--engine-torque-n-m", "190"];
    said(&wetclutch(&[&["init", "--gearbox", "8hp"], &numbers[..], &["-o", &first]].concat()));
    let output = wetclutch(&["fit", &log, "--vehicle", &first, "-o", &folder.path("own.toml"), "--units", "rpm,bar"]);
    let text = printed(&output);
    assert!(text.contains(" rpm with the given file") && !text.contains("rad/s") && !text.contains("kPa"), "{text}");
    let own = factor(&printed(&output), "E: friction x valve gain");
    assert!((own[0] / clutch_e[0] - 1.0).abs() < 0.01, "{own:?} {clutch_e:?}");
    assert!(folder.read("own.toml").contains("[converter]\n# fit: "), "{}", folder.read("own.toml"));
    // Pistons with a stroke: nothing was measured of how long they move.
    let stroke = format!("{ROOT}vehicles/eight_speed_stroke.toml");
    let output = wetclutch(&["fit", &log, "--vehicle", &stroke, "-o", &folder.path("stroke.toml")]);
    let text = printed(&output);
    assert!(
        text.contains("E: fill volume") && text.contains("not identified by these logs, measure the pressure"),
        "{text}"
    );
    assert!(folder.read("stroke.toml").contains("[clutch.E.fill]\n"), "{}", folder.read("stroke.toml"));
}

#[test]
fn commands_in_each_others_place_are_not_fitted() {
    let (folder, log) = town();
    let text = std::fs::read_to_string(&log).unwrap();
    let (names, rows) = text.split_once('\n').unwrap();
    let names = names
        .replace("element_c_", "element_x_")
        .replace("element_e_", "element_c_")
        .replace("element_x_", "element_e_");
    let exchanged = folder.write("exchanged.csv", format!("{names}\n{rows}"));
    let output = wetclutch(&["fit", &exchanged, "--vehicle", CAR, "-o", &folder.path("fitted.toml")]);
    let notes = said(&output);
    assert!(notes.contains("the given values are kept: the turbine does not turn as any car"), "{notes}");
    assert!(
        folder
            .read("fitted.toml")
            .starts_with("# fit: all values are those of the given file. the turbine does not turn")
    );
    assert!(notes.contains("the commands of two elements may be exchanged"), "{notes}");
}

#[test]
fn logs_that_cannot_be_fitted_are_refused_with_a_reason() {
    let (folder, log) = town();
    let text = std::fs::read_to_string(&log).unwrap();
    let lines = |count: usize| text.lines().take(count).map(|line| format!("{line}\n")).collect::<String>();
    let by_ratios = "name = \"ratios\"\nlevel = \"ratios\"\ngear = [{ name = \"1\", ratio = 3.0 }, { name = \"2\", ratio = 2.0 }]\n";
    folder.write("box.toml", by_ratios);
    let ratios = folder.write("ratios.toml", "name = \"r\"\ngearbox = \"box.toml\"\n");
    let fitted = folder.path("fitted.toml");
    for (case, text, vehicle, expected) in [
        ("no shift", lines(600), CAR.to_owned(), "have no shift between two gears that can be fitted"),
        ("no command", text.replace("_current_a", "_x"), CAR.to_owned(), "commands of its elements are missing"),
        ("no turbine", text.replace("turbine_speed_rad_s", "x"), CAR.to_owned(), "turbine_speed"),
        (
            "wrong ratios",
            scaled(&text, "turbine_speed_rad_s", 1.5),
            CAR.to_owned(),
            "is not the output speed times the ratio",
        ),
        ("ratios alone", text.clone(), ratios, "the ratios alone are known"),
    ] {
        let log = folder.write("log.csv", &text);
        let said = refused(&wetclutch(&["fit", &log, "--vehicle", &vehicle, "-o", &fitted]));
        assert!(said.contains(expected), "{case}: {said}");
        assert!(!Path::new(&fitted).exists(), "{case}");
    }
}

#[test]
fn shifts_of_one_way_clutches_are_fitted_and_those_of_dogs_are_left_out_with_their_reason() {
    let folder = Folder::new("fit-one-way");
    let fitted = |name: &str, drive: &str, vehicle: &str| {
        let drive = folder.write(&format!("{name}.toml"), format!("name = \"{name}\"\n{drive}"));
        let car = format!("{ROOT}vehicles/{vehicle}.toml");
        said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
        let log = folder.path(&format!("sim/{name}_measured.csv"));
        wetclutch(&["fit", &log, "--vehicle", &car, "-o", &folder.path(&format!("{name}_fitted.toml"))])
    };
    let up = "[[segment]]\nduration_s = 25\nthrottle = 0.3\n";
    let text = shown(&fitted("sprag", up, "three_speed_th400"));
    assert!(!text.contains("not used: ") && text.contains("DIR: kiss point") && text.contains("INT: kiss"), "{text}");
    assert!(text.contains("no fitted shift uses FWD, LR"), "{text}");
    // From the fourth to the fifth gear a dog of this gearbox opens.
    let dog = "[start]\ngear = \"4\"\nvehicle_m_s = 14\n[[segment]]\nduration_s = 6\nthrottle = 0.2\n[[shift]]\ntime_s = 2\ngear = \"5\"\n";
    let text = refused(&fitted("dog", dog, "nine_speed_9hp"));
    assert!(text.contains("not used: 4-5 at ") && text.contains("s: one of its elements is a dog"), "{text}");
    assert!(text.contains("none of the 1 shifts of the logs can be fitted\nhint: the lines `not used` have"), "{text}");
}

/// A table with one column multiplied.
fn scaled(text: &str, column: &str, factor: f64) -> String {
    let names = text.lines().next().unwrap();
    let at = names.split(',').position(|name| name == column).unwrap();
    let row = |line: &str| {
        let cells = line.split(',').enumerate().map(|(i, cell)| match cell.parse::<f64>() {
            Ok(value) if i == at => (factor * value).to_string(),
            _ => cell.to_owned(),
        });
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    format!("{names}\n{}", text.lines().skip(1).map(row).collect::<String>())
}
