//! From a few numbers to an estimate: `init`, `check` and `estimate` with a short vehicle file of every template.

use std::path::Path;

use config::{CarFile, VehicleFile};

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, wetclutch, without_excerpts};

/// The numbers of the two-speed car.
const NUMBERS: [&str; 10] = [
    "--mass-kg",
    "1500",
    "--wheel-radius-m",
    "0.3",
    "--ratios",
    "2.5,1",
    "--final-ratio",
    "3",
    "--engine-torque-n-m",
    "190",
];

fn init(folder: &Folder, name: &str, more: &[&str]) -> String {
    let path = folder.path(name);
    said(&wetclutch(&[&["init"], &NUMBERS[..], more, &["-o", &path]].concat()));
    path
}

/// The signals of a simulated drive.
fn simulated(folder: &Folder, experiment: &str) -> String {
    let out = folder.path("drive");
    printed(&wetclutch(&["simulate", experiment, "-o", &out]))
        .lines()
        .find(|line| line.contains("measured"))
        .unwrap()
        .to_owned()
}

/// The value at a key of a file, as TOML writes it.
fn value(file: &toml::Table, key: &str) -> Option<toml::Value> {
    let mut value = toml::Value::Table(file.clone());
    for step in key.split('.') {
        value = match value {
            toml::Value::Table(table) => table.get(step)?.clone(),
            toml::Value::Array(items) => items.into_iter().find(|item| item["name"].as_str() == Some(step))?,
            _ => return None,
        };
    }
    Some(value)
}

#[test]
fn the_short_file_of_each_template_goes_through_check_and_estimate() {
    let pulse_width = format!("{ROOT}experiments/pulse_width.toml");
    let templates: [(&str, &[&str], &str); 4] = [
        ("plain", &[], EXPERIMENT),
        ("stroke", &["--stroke"], EXPERIMENT),
        ("pulses", &["--valve", "pulse-width"], &pulse_width),
        ("pulses_stroke", &["--valve", "pulse-width", "--stroke"], &pulse_width),
    ];
    for (name, options, experiment) in templates {
        let folder = Folder::new(&format!("own-{name}"));
        let short = init(&folder, "car.toml", options);
        let complete = init(&folder, "complete.toml", &[options, &["--complete"]].concat());
        let given = folder.read("car.toml");
        let keys = given.lines().filter(|line| line.contains(" = ")).count();
        assert!((20..=30).contains(&keys), "{name}: {keys} keys");

        // Every default that is named is the one that the complete file has.
        let listed = printed(&wetclutch(&["check", &short, "--all"]));
        let complete_file: toml::Table = folder.read("complete.toml").parse().unwrap();
        let vehicle = VehicleFile::read(Path::new(&short)).unwrap();
        assert!(listed.contains(&format!("{} values are not in the file", vehicle.defaults_taken.len())), "{listed}");
        for taken in &vehicle.defaults_taken {
            assert!(listed.contains(&taken.key), "{name}: {} is not named", taken.key);
            let expected = value(&complete_file, &taken.key).unwrap_or_else(|| panic!("{name}: {}", taken.key));
            let written: toml::Table = format!("v = {}", taken.value).parse().unwrap();
            assert_eq!(written["v"], expected, "{name}: {}", taken.key);
        }
        // The file of all keys is the same car, and takes no default.
        let nothing = printed(&wetclutch(&["check", &complete]));
        assert!(!nothing.contains("defaults"), "{nothing}");

        let log = simulated(&folder, experiment);
        let from_short = folder.path("short.csv");
        let text = said(&wetclutch(&["estimate", &log, "--vehicle", &short, "-o", &from_short]));
        assert!(text.contains("shifts: 1 ("), "{name}: {text}");
        let from_complete = folder.path("complete.csv");
        said(&wetclutch(&["estimate", &log, "--vehicle", &complete, "-o", &from_complete]));
        assert_eq!(folder.read("short.csv"), folder.read("complete.csv"), "{name}");
    }
}

#[test]
fn what_matters_most_is_what_the_estimate_depends_on() {
    let folder = Folder::new("own-influence");
    let short = init(&folder, "car.toml", &[]);
    let table = printed(&wetclutch(&["check", &short, "--all"]));
    let cells = |key: &str| -> Vec<f64> {
        let row = table.lines().find(|line| line.starts_with(key)).unwrap_or_else(|| panic!("{key}: {table}"));
        let words: Vec<&str> = row.split_whitespace().collect();
        words[words.len() - 4..].iter().map(|word| word.parse().unwrap()).collect()
    };
    // The open loop is the valve's maps and the clutch: 10 % of gain are 10 % of pressure, and nothing of the driveline counts.
    let [gain, friction, stiffness] =
        ["clutch.b.valve.gain.gain_pa_a ", "clutch.b.friction.coefficient ", "driveline.shaft_stiffness_n_m_rad "]
            .map(cells);
    assert!(gain[0] > 10.0 && friction[0] == 0.0 && friction[1] > 10.0, "{gain:?} {friction:?}");
    assert_eq!(stiffness[..2], [0.0, 0.0]);
    // The speeds correct the filter: a wrong gain does it less harm.
    assert!(gain[3] < 0.7 * gain[1] && gain[2] > 0.0 && stiffness[2] > 0.0, "{gain:?} {stiffness:?}");
    // A given value is no default any more.
    let with_gain = folder.read("car.toml").replace("# gain = ", "gain = ");
    let given = folder.write("given.toml", with_gain);
    let table = printed(&wetclutch(&["check", &given, "--all"]));
    assert!(!table.contains("clutch.b.valve.gain") && table.contains("clutch.a.valve.gain"), "{table}");
}

#[test]
fn what_is_wrong_with_a_short_file_is_said_with_its_line() {
    let folder = Folder::new("own-wrong");
    init(&folder, "car.toml", &[]);
    let good = folder.read("car.toml");
    let cases = [
        ("max_torque_n_m = 190.0\n", "\n", "`engine.max_torque_n_m`: is missing\nhint: "),
        (
            "mass_kg = 1500.0",
            "mass_kg = 1.5",
            "`vehicle.mass_kg` is 1.5, expected 200 to 60000\nhint: 1.5 t is 1500 kg",
        ),
        ("ratios = [2.5, 1.0]", "ratios = [1.0, 2.5]", "which is no upshift"),
        ("ratios = [2.5, 1.0]", "ratios = 2.5", "expected [before, after]"),
        ("ratios = [2.5, 1.0]", "ratios = [2.5, 1.02]", "no planetary set has the ratio 1.02"),
        (
            "ratios = [2.5, 1.0]",
            "ratios = [2.5, 1.0]\ninput = \"turbine\"",
            "`gear_train.ratios` replaces the whole gear train",
        ),
        (
            "# speed_ratio = [0.0, ",
            "speed_ratio = [0.0, ",
            "belongs to `capacity_n_m_s2`, which this file leaves out\nhint: give all of them",
        ),
        ("# piston_area_m2 = ", "piston_area_m2 = 900", "`clutch.b.piston_area_m2` is "),
        ("[converter]", "[converter]\nmu = 1", "unknown key `mu`"),
    ];
    for (old, new, message) in cases {
        assert!(good.contains(old), "{old}");
        let output = wetclutch(&["check", &folder.write("wrong.toml", good.replacen(old, new, 1))]);
        let text = without_excerpts(&refused(&output));
        assert!(text.contains(message), "{new}: {text}");
        let line = text.split("wrong.toml:").nth(1).and_then(|rest| rest.split(':').next()?.parse::<usize>().ok());
        assert!(line.is_some() || message.contains("no planetary set"), "{text}");
    }
    // A file that is not short may not have the numbers of short ones.
    let whole = std::fs::read_to_string(crate::support::VEHICLE).unwrap();
    let text = whole.replacen("[engine]\n", "[engine]\nmax_torque_n_m = 190\n", 1);
    let text = refused(&wetclutch(&["check", &folder.write("whole.toml", text)]));
    assert!(text.contains("`engine.max_torque_n_m`: scales the defaults of a file with `gear_train.ratios`"), "{text}");
}

#[test]
fn a_negative_number_is_outside_its_range_and_no_option() {
    let folder = Folder::new("negative");
    let mut numbers = NUMBERS;
    numbers[1] = "-5";
    let error = refused(&wetclutch(&[&["init"], &numbers[..], &["-o", &folder.path("car.toml")]].concat()));
    assert!(error.contains("invalid value '-5' for '--mass-kg <KG>': expected a number from 200 to 60000"), "{error}");
}

/// The numbers of a large car with a gearbox.
const CAR: [&str; 8] =
    ["--mass-kg", "1900", "--wheel-radius-m", "0.33", "--final-ratio", "2.8", "--engine-torque-n-m", "400"];

fn init_car(folder: &Folder, name: &str, more: &[&str]) -> std::process::Output {
    wetclutch(&[&["init"], &CAR[..], more, &["-o", &folder.path(name)]].concat())
}

#[test]
fn a_first_file_of_a_whole_gearbox_goes_through_check_and_loses_nothing() {
    let folder = Folder::new("own-gearbox");
    let text = said(&init_car(&folder, "car.toml", &["--gearbox", "ravigneaux_4", "--name", "large"]));
    assert!(text.contains("gearbox file: ") && text.contains("next: "), "{text}");
    assert!(folder.read("ravigneaux_4.toml").starts_with("# `turbine_max_n_m`"));
    let car = folder.path("car.toml");
    let table = printed(&wetclutch(&["check", &car, "--all"]));
    let cells = |key: &str| -> Vec<f64> {
        let row = table.lines().find(|line| line.starts_with(key)).unwrap_or_else(|| panic!("{key}: {table}"));
        let words: Vec<&str> = row.split_whitespace().collect();
        words[words.len() - 4..].iter().map(|word| word.parse().unwrap()).collect()
    };
    let [as_it_is, gain, stiffness] =
        ["no change", "valve.gain.gain_pa_a", "driveline.shaft_stiffness_n_m_rad"].map(cells);
    // The valve model alone knows nothing of the driveline; the speeds correct a wrong gain.
    assert!(gain[1] > as_it_is[1] && gain[0] > as_it_is[0] && gain[0] < gain[1], "{table}");
    assert!(stiffness[0] > as_it_is[0] && stiffness[1] == as_it_is[1], "{table}");
    assert!(table.contains("\n  oil.temperature_degc = 80\n"), "{table}");
    // A second call loses nothing that was filled in.
    assert!(refused(&init_car(&folder, "car.toml", &["--gearbox", "ravigneaux_4"])).contains("there already"));
    said(&init_car(&folder, "second.toml", &["--gearbox", "ravigneaux_4"]));
    folder.write("ravigneaux_4.toml", folder.read("ravigneaux_4.toml") + "\n# mine\n");
    assert!(refused(&init_car(&folder, "third.toml", &["--gearbox", "ravigneaux_4"])).contains("another gearbox"));
    assert!(folder.read("ravigneaux_4.toml").ends_with("# mine\n"));
    let own = folder.path("ravigneaux_4.toml");
    said(&init_car(&folder, "third.toml", &["--gearbox", &own, "--stroke"]));
    let third = CarFile::read(Path::new(&folder.path("third.toml"))).unwrap();
    assert!(third.clutches.iter().flatten().all(|clutch| clutch.has_stroke));
}

#[test]
fn a_first_file_of_a_gearbox_that_is_none_is_refused() {
    let folder = Folder::new("own-no-gearbox");
    let message = refused(&init_car(&folder, "car.toml", &["--gearbox", "9hp"]));
    assert!(message.contains("no such file") && message.contains("lepelletier_6"), "{message}");
    let vehicle = format!("{ROOT}vehicles/eight_speed.toml");
    refused(&init_car(&folder, "car.toml", &["--gearbox", &vehicle]));
    refused(&init_car(&folder, "car.toml", &["--gearbox", "8hp", "--ratios", "4,2"]));
    refused(&init_car(&folder, "car.toml", &[]));
    refused(&init_car(&folder, "car.toml", &["--ratios", "4,2", "--launch", "clutch"]));
    assert!(!std::path::Path::new(&folder.path("car.toml")).exists());
    assert!(!std::path::Path::new(&folder.path("8hp.toml")).exists());
}

#[test]
fn check_warns_of_values_that_no_car_has_and_refuses_an_engine_without_torque() {
    let folder = Folder::new("implausible");
    let shipped = std::fs::read_to_string(VEHICLE).unwrap();
    let check = |text: &str| {
        std::fs::write(folder.path("car.toml"), text).unwrap();
        wetclutch(&["check", &folder.path("car.toml")])
    };
    assert_eq!(said(&check(&shipped)), "");
    // Stiffness for each degree, mass of a truck.
    let wrong = shipped.replace("rad = 13000", "rad = 227").replace("mass_kg = 1500 ", "mass_kg = 15000 ");
    let warned = said(&check(&wrong));
    assert!(warned.contains("warning: `driveline.shaft_stiffness_n_m_rad`: twist of the drive shafts"), "{warned}");
    assert!(warned.contains("warning: `tyre.max_force_n`") && warned.matches("hint: ").count() >= 3, "{warned}");
    let (before, map) = shipped.split_once("torque_n_m = [\n").unwrap();
    let (_, after) = map.split_once("\n]").unwrap();
    let rows = "  [0, 0, 0, 0, 0, 0, 0, 0, 0],\n".repeat(12);
    let message = refused(&check(&format!("{before}torque_n_m = [\n{rows}]{after}")));
    assert!(
        message.contains("car.toml:20: `engine.torque.torque_n_m`: no torque of the map is above zero"),
        "{message}"
    );

    let gearbox = std::fs::read_to_string(format!("{ROOT}gearboxes/8hp.toml")).unwrap();
    let idle = gearbox.replace(
        "  { name = \"5\", engaged = [\"B\", \"C\", \"D\"], stated_ratio = 1.2845",
        "  { name = \"5\", engaged = [\"B\", \"C\", \"E\"], stated_ratio = 2.1039",
    );
    assert_ne!(idle, gearbox);
    std::fs::write(folder.path("8hp.toml"), idle).unwrap();
    let warned = said(&wetclutch(&["check", &folder.path("8hp.toml")]));
    assert!(warned.contains("\"5\" engages the same elements as \"3\""), "{warned}");
    let warned = said(&check("name = \"car\"\ngearbox = \"8hp.toml\"\n"));
    assert!(warned.contains("8hp.toml:20: `gear.5.engaged`: \"5\" engages the same elements as \"3\""), "{warned}");
}
