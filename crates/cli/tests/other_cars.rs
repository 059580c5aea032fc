//! Estimates of cars with other parts than a converter that is open and a gearbox whose train is known.

use crate::any_car::numbers;
use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, stderr, stdout, wetclutch};

/// Two shifts of a car with the two-speed gearbox.
const TWO_SHIFTS: &str = "name = \"d\"\n[[shift]]\ntime_s = 6\ngear = \"2\"\n[[shift]]\ntime_s = 14\ngear = \"1\"\n\
    [[segment]]\nduration_s = 12\nthrottle = 0.15\n[[segment]]\nduration_s = 8\nthrottle = 0.0\n";

/// The two-speed gearbox by what `check gearboxes/two_speed.toml` prints of it.
const FRACTIONS: &str = r#"
name = "two-speed gearbox by its shares"
level = "shares"
line_pressure_pa = 1.0e6
gear = [
  { name = "1", ratio = 2.5, shares = { A = 1.5 }, turbine_max_n_m = 300 },
  { name = "2", ratio = 1.0, shares = { B = 0.6 }, turbine_max_n_m = 300 },
]

[[element]]
name = "A"
kind = "brake"
pack = { friction_faces = 4, mean_radius_m = 0.14, piston_area_m2 = 0.012, return_spring_n = 600, friction_coefficient = 0.13 }

[[element]]
name = "B"
kind = "clutch"
pack = { friction_faces = 3, mean_radius_m = 0.13, piston_area_m2 = 0.01, return_spring_n = 600, friction_coefficient = 0.13 }

[[shift_mass]]
gears = ["1", "2"]
turbine_kg_m2 = 0.0644
coupling_kg_m2 = -0.0111
output_kg_m2 = 0.1778
"#;

/// A vehicle file with a gearbox file.
fn vehicle(folder: &Folder, name: &str, gearbox: &str, more: &str) -> String {
    folder.write(&format!("{name}.toml"), format!("name = \"{name}\"\ngearbox = \"{gearbox}\"\n{more}"))
}

/// Simulates a drive of a car; the true and the measured signals.
fn simulated(folder: &Folder, drive: &str, car: &str) -> [String; 2] {
    let drive = folder.write("drive.toml", drive);
    said(&wetclutch(&["simulate", &drive, "--vehicle", car, "-o", &folder.path("sim")]));
    ["sim/d.csv", "sim/d_measured.csv"].map(|name| folder.path(name))
}

fn estimate(folder: &Folder, log: &str, car: &str, output: &str) -> String {
    said(&wetclutch(&["estimate", log, "--vehicle", car, "-o", &folder.path(output)]));
    folder.read(output)
}

/// A row whose time is no number ends a log with the same error.
#[test]
fn a_log_has_the_same_estimate_on_any_number_of_threads() {
    let folder = Folder::new("stages");
    let pressure = "[hydraulics]\nline_pressure_pa = 1.0e6\n";
    let car = vehicle(&folder, "car", &format!("{ROOT}gearboxes/two_speed.toml"), pressure);
    let [_, log] = simulated(&folder, TWO_SHIFTS, &car);
    let whole = folder.read("sim/d_measured.csv");
    let commas = whole.lines().next().unwrap().matches(',').count();
    let broken = folder.write("broken.csv", format!("{whole}soon{}\n", ",".repeat(commas)));
    let one_shift = folder.path("e1");
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &one_shift]));
    let of_one_shift = folder.path("e1/e1_measured.csv");
    for (log, vehicle) in [(&log, car.as_str()), (&broken, &car), (&of_one_shift, VEHICLE)] {
        let estimate = |threads: &str| wetclutch(&["estimate", log, "--vehicle", vehicle, "--threads", threads]);
        let (one, three) = (estimate("1"), estimate("3"));
        assert_eq!(one.status.success(), log != &broken);
        assert!(log == &broken || stdout(&one).lines().count() > 500, "{log}");
        assert!((stdout(&one), stderr(&one)) == (stdout(&three), stderr(&three)), "{log}: {}", stderr(&three));
        assert_eq!(one.status, three.status);
    }
}

#[test]
fn a_gearbox_by_its_fractions_has_the_estimates_of_its_stick_diagram() {
    let folder = Folder::new("shares");
    folder.write("box.toml", FRACTIONS);
    let pressure = "[hydraulics]\nline_pressure_pa = 1.0e6\n";
    let train = vehicle(&folder, "train", &format!("{ROOT}gearboxes/two_speed.toml"), pressure);
    let fractions = vehicle(&folder, "shares", "box.toml", pressure);
    let [_, log] = simulated(&folder, TWO_SHIFTS, &train);
    let [by_train, by_fractions] =
        [(&train, "train.csv"), (&fractions, "shares.csv")].map(|(car, output)| estimate(&folder, &log, car, output));
    for (name, maximum) in [("oncoming_torque_estimate_n_m", 0.1), ("oncoming_pressure_estimate_pa", 100.0)] {
        let pairs: Vec<_> = numbers(&by_train, name).into_iter().zip(numbers(&by_fractions, name)).collect();
        let compared = pairs.iter().filter(|(one, other)| one.is_finite() && other.is_finite());
        assert!(compared.clone().count() > 100, "{name}");
        assert!(compared.clone().all(|(one, other)| (one - other).abs() < maximum), "{name}");
    }
    // What cannot be simulated says so.
    let output =
        wetclutch(&["simulate", &folder.path("drive.toml"), "--vehicle", &fractions, "-o", &folder.path("no")]);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && error.contains("no stick diagram: it can be estimated"), "{error}");
    assert!(error.contains("hint: describe it with level"), "{error}");
}

#[test]
fn a_gearbox_by_its_ratios_alone_has_torques_at_the_turbine() {
    const RATIOS: &str =
        "name = \"g\"\nlevel = \"ratios\"\ngear = [{ name = \"1\", ratio = 2.5 }, { name = \"2\", ratio = 1.0 }]\n";
    let folder = Folder::new("ratios-alone");
    let mass = FRACTIONS.split_once("[[shift_mass]]").unwrap().1;
    folder.write("masses.toml", format!("{RATIOS}[[shift_mass]]{mass}"));
    folder.write("ratios.toml", RATIOS);
    let train = vehicle(&folder, "train", &format!("{ROOT}gearboxes/two_speed.toml"), "");
    let [masses, alone] =
        ["masses", "ratios"].map(|name| vehicle(&folder, &format!("by_{name}"), &format!("{name}.toml"), ""));
    let [truth, log] = simulated(&folder, TWO_SHIFTS, &train);
    let truth = std::fs::read_to_string(truth).unwrap();
    // `alpha` is one over the fraction.
    let sum: Vec<f64> = [("offgoing", [1.0 / 1.5, 1.0 / 0.6]), ("oncoming", [1.0 / 0.6, 1.0 / 1.5])]
        .map(|(role, alphas)| {
            let gears = numbers(&truth, "gear").into_iter().zip(numbers(&truth, &format!("{role}_torque_n_m")));
            gears.map(|(gear, torque)| torque * alphas[usize::from(gear > 1.5)]).collect::<Vec<f64>>()
        })
        .into_iter()
        .reduce(|a, b| a.iter().zip(&b).map(|(a, b)| a + b).collect())
        .unwrap();
    for (car, maximum) in [(&masses, 8.0), (&alone, 60.0)] {
        let text = estimate(&folder, &log, car, "out.csv");
        assert!(!text.lines().next().unwrap().contains("pressure"), "no pressure");
        assert!(!text.lines().next().unwrap().contains("command"), "no command");
        let found = numbers(&text, "clutches_at_turbine_estimate_n_m");
        let column = |name: &str| text.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
        let (phase, health) = (column("phase"), column("health"));
        let cells = |at: usize| text.lines().skip(1).map(move |line| line.split(',').nth(at).unwrap());
        let phases: Vec<&str> = cells(phase).collect();
        let rows = sum.iter().zip(&found).zip(&phases).filter(|(_, phase)| **phase == "both_slip");
        let errors: Vec<f64> = rows.map(|((truth, found), _)| found - truth).collect();
        let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        assert!(errors.len() > 40 && rms < maximum, "{car}: {rms} N m in {} rows", errors.len());
        assert!(cells(phase).zip(cells(health)).all(|(phase, health)| phase != "both_slip" || health == "good"));
    }
    let said_of =
        crate::support::shown(&wetclutch(&["estimate", &log, "--vehicle", &alone, "-o", &folder.path("out.csv")]));
    assert!(
        said_of.contains("2 of 2 shifts were completed") && said_of.contains(" turbine") && said_of.contains("(+-"),
        "{said_of}"
    );
    assert!(said_of.contains("Of this gearbox the ratios alone are known"), "{said_of}");
    assert!(!said_of.contains("hidden") && !said_of.contains("no tables"), "{said_of}");
    assert!(folder.read("out_report.html").contains("torque at the turbine"));
    // The log needs no command of a valve.
    let without: Vec<String> = std::fs::read_to_string(&log)
        .unwrap()
        .lines()
        .map(|line| line.split(',').take(12).collect::<Vec<_>>().join(","))
        .collect();
    let bare = folder.write("bare.csv", without.join("\n"));
    estimate(&folder, &bare, &alone, "bare_out.csv");
    let checked = printed(&wetclutch(&["check", &alone]));
    assert!(
        checked.contains("ratios alone: `wetclutch estimate` gives") && checked.contains("converter.torque_ratio"),
        "{checked}"
    );
    // What needs clutches says so.
    let learnt = folder.path("learnt.toml");
    let output = wetclutch(&["estimate", &log, "--vehicle", &alone, "--learnt", &learnt]);
    assert!(stderr(&output).contains("warning: --learnt has no effect: "), "{}", stderr(&output));
    assert!(!std::path::Path::new(&learnt).exists());
    let error =
        refused(&wetclutch(&["simulate", &folder.path("drive.toml"), "--vehicle", &alone, "-o", &folder.path("no")]));
    assert!(error.contains("no stick diagram: it can be estimated"), "{error}");
    let clutch = vehicle(&folder, "clutch", "ratios.toml", "[clutch.A]\ndrag_n_m = 1.0\n");
    let error = refused(&wetclutch(&["check", &clutch]));
    assert!(error.contains("no clutch or brake \"A\"") && error.contains("has ratios alone"), "{error}");
}

/// RMS of estimate minus truth, N m, and how many rows have both.
fn rms(truth: &str, estimate: &str, clutch: &str) -> (f64, usize) {
    let (truth, estimate) =
        (numbers(truth, &format!("{clutch}_torque_n_m")), numbers(estimate, &format!("{clutch}_torque_estimate_n_m")));
    let errors: Vec<f64> = truth.iter().zip(&estimate).map(|(a, b)| b - a).filter(|error| error.is_finite()).collect();
    ((errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt(), errors.len())
}

#[test]
fn lock_up_and_launch_clutch_have_a_torque() {
    const DRIVE: &str =
        "name = \"d\"\n[[segment]]\nduration_s = 14\nthrottle = 0.2\n[[segment]]\nduration_s = 6\nthrottle = 0.1\n";
    let folder = Folder::new("input-clutch");
    let lock_up = "[lock_up]\ncapacity_n_m = 300\nfirst_gear = \"3\"\non_input_rad_s = 140\noff_input_rad_s = 110\nramp_s = 0.6\n";
    let eight = vehicle(&folder, "eight", &format!("{ROOT}gearboxes/8hp.toml"), lock_up);
    let dual = format!("{ROOT}vehicles/dual_clutch.toml");
    for (car, clutch) in [(&eight, "lock_up"), (&dual, "launch_clutch")] {
        let [truth, log] = simulated(&folder, DRIVE, car);
        let found = estimate(&folder, &log, car, "out.csv");
        let (error, rows) = rms(&std::fs::read_to_string(truth).unwrap(), &found, clutch);
        assert!(error < 8.0 && rows > 400, "{clutch}: {error} N m in {rows} rows");
        let std_devs = numbers(&found, &format!("{clutch}_torque_deviation_n_m"));
        assert!(std_devs.iter().filter(|std_dev| std_dev.is_finite()).all(|std_dev| *std_dev > 0.0));
    }
}
