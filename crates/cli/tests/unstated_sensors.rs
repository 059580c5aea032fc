//! Speeds of toothed wheels that no sensor file describes, and speeds that end.

use crate::any_car::{column, numbers};
use crate::support::{Folder, ROOT, said, wetclutch};

/// A drive with the sensors of the bench, of which the estimate knows nothing.
fn drive(folder: &Folder, calibration: &str, segments: &str) -> String {
    let city = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let head = city.split("[[segment]]").next().unwrap().replacen("repetitions = 20", "repetitions = 1", 1);
    let head = head.replacen("controller = \"bench\"", &format!("controller = \"{calibration}\""), 1);
    let bench = std::fs::read_to_string(format!("{ROOT}experiments/bench.toml")).unwrap();
    let sensors = &bench[bench.find("[sensors]").unwrap()..bench.find("# The observers").unwrap()];
    folder.write("city.toml", format!("{head}{segments}{sensors}"))
}

/// Segments of these durations, s, throttles and brakes.
fn segments(of: &[(f64, f64, f64)]) -> String {
    let segment = |(duration_s, throttle, brake): &(f64, f64, f64)| {
        format!("[[segment]]\nduration_s = {duration_s}\nthrottle = {throttle}\nbrake = {brake}\n")
    };
    of.iter().map(segment).collect()
}

/// The errors of a quantity of an estimate by rows.
fn errors([truth, estimate]: [&str; 2], [of, by]: [&str; 2]) -> Vec<f64> {
    let [truth, found] = [numbers(truth, of), numbers(estimate, by)];
    assert_eq!(truth.len(), found.len());
    truth.iter().zip(found).map(|(truth, found)| (truth - found).abs()).collect()
}

/// A log without the values of a column from 60 s on.
fn ended(log: &str, column: &str) -> String {
    let at = log.lines().next().unwrap().split(',').position(|name| name == column).unwrap();
    let rows = log.lines().enumerate().map(|(row, line)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        if row > 0 && cells[0].parse::<f64>().unwrap() >= 60.0 {
            cells[at] = "";
        }
        cells.join(",") + "\n"
    });
    rows.collect()
}

/// The largest of them.
fn largest(errors: &[f64]) -> f64 {
    errors.iter().copied().filter(|error| !error.is_nan()).fold(0.0, f64::max)
}

/// The lag of the sensors shows in the gears. Without it the speeds seem to slip where they change fast, and a clutch that holds had all its capacity: the
/// shaft torque was up to 15,000 N m off.
#[test]
fn a_throttle_that_closes_at_an_upshift_is_no_slip_of_the_clutch_that_holds() {
    let folder = Folder::new("unstated-sensors");
    let tips = [(2.0, 0.0, 0.2), (15.0, 0.5, 0.0), (6.0, 0.0, 0.02), (10.0, 0.6, 0.0), (6.0, 0.0, 0.0)];
    for vehicle in ["eight_speed", "six_speed_tf80sc", "nine_speed_9g", "ten_speed"] {
        for calibration in ["bench", "comfort"] {
            let (car, out) = (format!("{ROOT}vehicles/{vehicle}.toml"), folder.path("out.csv"));
            let drive = drive(&folder, calibration, &segments(&tips));
            said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
            let found =
                said(&wetclutch(&["estimate", &folder.path("sim/city_measured.csv"), "--vehicle", &car, "-o", &out]));
            assert!(!found.contains("outside its error budget"), "{found}");
            let tables = [folder.read("sim/city.csv"), folder.read("out.csv")];
            let [off, shaft] = [
                ["offgoing_torque_n_m", "offgoing_torque_estimate_n_m"],
                ["shaft_torque_n_m", "shaft_torque_estimate_n_m"],
            ]
            .map(|names| largest(&errors([&tables[0], &tables[1]], names)));
            println!(
                "{vehicle}, {calibration}: at most {off:.0} N m of the offgoing clutch, {shaft:.0} N m of the shaft"
            );
            // A quarter above the most that was found.
            assert!(off < 73.0 && shaft < 840.0, "{vehicle}, {calibration}: {off} {shaft}");
        }
    }
}

/// A shift takes both speeds to be seen: without one of them the torques are those of the valve models.
#[test]
fn after_a_speed_has_ended_the_estimate_is_about_as_good_as_the_valve_models() {
    let folder = Folder::new("ended-speeds");
    let city = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let city = city[city.find("[[segment]]").unwrap()..].to_owned();
    for vehicle in ["six_speed", "eight_speed_a8lr1", "four_speed_fn4a"] {
        let (car, out) = (format!("{ROOT}vehicles/{vehicle}.toml"), folder.path("out.csv"));
        let drive = drive(&folder, "bench", &city);
        said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
        let (truth, log) = (folder.read("sim/city.csv"), folder.read("sim/city_measured.csv"));
        for speed in ["output_speed_rad_s", "turbine_speed_rad_s"] {
            let log = folder.write("log.csv", ended(&log, speed));
            said(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &out]));
            let found = folder.read("out.csv");
            for clutch in ["offgoing", "oncoming"] {
                let (times_s, slips) = (numbers(&truth, "time_s"), numbers(&truth, &format!("{clutch}_slip_rad_s")));
                // While it slips.
                let of = |by: &str| {
                    let names = [format!("{clutch}_torque_n_m"), format!("{clutch}_{by}_n_m")];
                    let errors =
                        errors([&truth, &found], [&names[0], &names[1]]).into_iter().zip(times_s.iter().zip(&slips));
                    let errors =
                        errors.filter(|(error, (time_s, slip))| **time_s > 61.0 && slip.abs() > 1.0 && !error.is_nan());
                    let (sum, count) =
                        errors.fold((0.0, 0_u32), |(sum, count), (error, _)| (sum + error * error, count + 1));
                    assert!(count > 50, "{vehicle}, {clutch}: {count} rows");
                    (sum / f64::from(count)).sqrt()
                };
                let [estimate, valve] = ["torque_estimate", "valve_model_torque"].map(of);
                println!("{vehicle} without {speed}: {clutch} {estimate:.1} N m, by the valve models {valve:.1}");
                // With what was learnt before the speed had ended.
                assert!(estimate < 1.5 * valve + 1.0, "{vehicle}, {speed}, {clutch}: {estimate} {valve}");
            }
        }
    }
}

/// A channel that ends is named, and nothing else is said in its place.
#[test]
fn a_channel_that_ends_is_named() {
    let folder = Folder::new("ended-channels");
    let car = format!("{ROOT}vehicles/eight_speed.toml");
    let city = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive = drive(&folder, "bench", &city[city.find("[[segment]]").unwrap()..]);
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
    let log = folder.read("sim/city_measured.csv");
    for (column, words) in [
        ("reported_engine_torque_n_m", "reported_engine_torque has no usable reading from "),
        ("element_a_current_a", "the command of A has no usable reading from "),
    ] {
        let log = folder.write("log.csv", ended(&log, column));
        let found = said(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &folder.path("out.csv")]));
        let warnings: Vec<&str> = found.lines().filter(|line| line.starts_with("warning")).collect();
        assert!(warnings.len() == 1 && warnings[0].contains(words), "{found}");
    }
}

/// Toothed wheels do not tell which way they turn.
#[test]
fn a_drive_in_reverse_is_estimated_with_and_without_the_signs_of_its_speeds() {
    let folder = Folder::new("reverse-without-sign");
    let car = format!("{ROOT}vehicles/six_speed.toml");
    let drive = "name = \"back\"\nvehicle = \"x\"\nsample_time_s = 0.01\nrepetitions = 1\ncontroller = \"bench\"\n\
                 [[shift]]\ntime_s = 0.5\ngear = \"R\"\n";
    let of = [(3.0, 0.0, 0.3), (12.0, 0.25, 0.0), (6.0, 0.0, 0.05)];
    let drive = folder.write("back.toml", format!("{drive}{}", segments(&of)));
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
    let log = folder.read("sim/back_measured.csv");
    assert!(numbers(&log, "output_speed_rad_s").iter().any(|speed| *speed < -20.0), "it goes back");
    let names: Vec<&str> = log.lines().next().unwrap().split(',').collect();
    let shafts =
        ["output_speed_rad_s", "wheel_speed_rad_s"].map(|name| names.iter().position(|of| *of == name).unwrap());
    let without = log.lines().map(|line| {
        let cells = line.split(',').enumerate();
        let cells = cells.map(|(at, cell)| if shafts.contains(&at) { cell.trim_start_matches('-') } else { cell });
        cells.collect::<Vec<_>>().join(",") + "\n"
    });
    let without = folder.write("without.csv", without.collect::<String>());
    let [signed, unsigned] = [folder.path("sim/back_measured.csv"), without].map(|log| {
        let out = folder.path("out.csv");
        said(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &out]));
        folder.read("out.csv")
    });
    let health = column(&unsigned, "health");
    assert!(health.iter().filter(|word| *word == "good").count() > 800, "{health:?}");
    let [a, b] = [&signed, &unsigned].map(|table| numbers(table, "shaft_torque_estimate_n_m"));
    assert_eq!(a.len(), b.len());
    let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).filter(|apart| !apart.is_nan()).fold(0.0, f64::max);
    assert!(apart < 1.0, "{apart}");
    let mut errors =
        errors([&folder.read("sim/back.csv"), &unsigned], ["shaft_torque_n_m", "shaft_torque_estimate_n_m"]);
    errors.retain(|error| !error.is_nan());
    errors.sort_by(f64::total_cmp);
    let middle = errors[errors.len() / 2];
    println!("in reverse the shaft torque is off by {middle:.1} N m in the middle of {} rows", errors.len());
    // A quarter above what was found.
    assert!(middle < 13.0, "{middle}");
}
