//! Estimates over whole drives, every row of them, also where the car hardly moves and the filter does not run.

use crate::any_car::{column, numbers};
use crate::support::{Folder, ROOT, said, wetclutch};

/// RMS error of the torque of the offgoing and the oncoming clutch over all rows, N m, by the estimate and by the valve models alone.
fn errors_n_m(truth: &str, estimates: &str) -> [[f64; 2]; 2] {
    ["offgoing", "oncoming"].map(|clutch| {
        let true_n_m = numbers(truth, &format!("{clutch}_torque_n_m"));
        ["torque_estimate_n_m", "valve_model_torque_n_m"].map(|name| {
            let found_n_m = numbers(estimates, &format!("{clutch}_{name}"));
            let errors = true_n_m.iter().zip(&found_n_m).map(|(a, b)| a - b).filter(|error| !error.is_nan());
            let (sum, count) = errors.fold((0.0, 0_u32), |(sum, count), error| (sum + error * error, count + 1));
            assert!(count > 500);
            (sum / f64::from(count)).sqrt()
        })
    })
}

/// Near a standstill a clutch holds far less than its pressure lets it: without the load as a limit the worst of these is off by 50 N m.
#[test]
fn torques_are_good_in_every_row_of_a_drive_in_town() {
    let folder = Folder::new("whole-drives");
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive = drive.replacen("repetitions = 20", "repetitions = 2", 1);
    for vehicle in ["six_speed", "eight_speed_a8lr1", "nine_speed_9hp", "dual_clutch"] {
        let car = format!("{ROOT}vehicles/{vehicle}.toml");
        for calibration in ["bench", "comfort"] {
            let drive = drive.replacen("controller = \"bench\"", &format!("controller = \"{calibration}\""), 1);
            let drive = folder.write("city.toml", drive);
            said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
            let (log, out) = (folder.path("sim/city_measured.csv"), folder.path("out.csv"));
            said(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &out]));
            let errors = errors_n_m(&folder.read("sim/city.csv"), &folder.read("out.csv"));
            println!("{vehicle}, {calibration}: RMS error by the estimate and by the valve models {errors:.1?} N m");
            assert!(errors.iter().all(|[estimate, valve]| *estimate < 7.2 && *estimate < 0.3 * valve), "{errors:?}");
        }
    }
}

/// The head of the drive in town with these segments: duration, s, throttle and brake.
fn drive_of(segments: impl IntoIterator<Item = (f64, f64, f64)>) -> String {
    let city = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let (head, _) = city.split_once("[[segment]]").unwrap();
    let head = head.replacen("repetitions = 20", "repetitions = 1", 1);
    let segment = |(duration_s, throttle, brake): (f64, f64, f64)| {
        format!("[[segment]]\nduration_s = {duration_s}\nthrottle = {throttle}\nbrake = {brake}\n")
    };
    head + &segments.into_iter().map(segment).collect::<String>()
}

/// A driver who changes his mind: the offgoing clutch of a shift that is withdrawn slips, and its command is right. Before, it was refused in hundreds of
/// rows, and the torques of the gear behind it were wrong for seconds.
#[test]
fn commands_of_a_shift_that_is_withdrawn_are_believed() {
    let folder = Folder::new("withdrawn-shifts");
    let tips = |count: u32, duration_s: f64, throttle: f64| {
        (0..count).map(move |at| (duration_s, if at % 2 == 1 { throttle } else { 0.0 }, 0.0))
    };
    let segments = [(2.0, 0.0, 0.3), (8.0, 0.3, 0.0)].into_iter().chain(tips(30, 0.9, 0.6));
    let segments = segments.chain([(4.0, 0.3, 0.0)]).chain(tips(40, 0.35, 0.9)).chain([(15.0, 0.0, 0.15)]);
    let drive = drive_of(segments).replacen("controller = \"bench\"", "controller = \"comfort\"", 1);
    assert!(drive.contains("controller = \"comfort\""));
    let drive = folder.write("city.toml", drive);
    for vehicle in ["eight_speed", "six_speed_tf80sc", "nine_speed_9g"] {
        let car = format!("{ROOT}vehicles/{vehicle}.toml");
        said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
        let (log, out) = (folder.path("sim/city_measured.csv"), folder.path("out.csv"));
        said(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &out]));
        let (truth, found) = (folder.read("sim/city.csv"), folder.read("out.csv"));
        for reading in ["offgoing_command_reading", "oncoming_command_reading"] {
            assert!(column(&found, reading).iter().all(|word| word != "refused"), "{vehicle}: {reading}");
        }
        let gears: Vec<[String; 2]> = column(&found, "gear")
            .into_iter()
            .zip(column(&found, "target_gear"))
            .map(|(from, to)| [from, to])
            .collect();
        let is_withdrawn = |of: &[[String; 2]]| of[0] != of[1] && of[0][0] == of[1][1] && of[0][1] == of[1][0];
        assert!(gears.windows(2).filter(|of| is_withdrawn(of)).count() > 2, "{vehicle}");
        let torques =
            [(truth, "shaft_torque_n_m"), (found, "shaft_torque_estimate_n_m")].map(|(of, name)| numbers(&of, name));
        let errors = torques[0].iter().zip(&torques[1]).map(|(a, b)| (a - b).abs());
        let errors: Vec<f64> = errors.filter(|error| !error.is_nan()).collect();
        assert!(errors.len() > 4000, "{vehicle}: {} rows", errors.len());
        let far = errors.iter().filter(|error| **error > 200.0).count();
        println!("{vehicle}: shaft torque off by more than 200 N m in {far} rows");
        assert!(far < 10, "{vehicle}: {far} rows");
    }
}

/// A hard stop behind toothed wheels: their old teeth show a slip that is none, by which a clutch that locks had its whole capacity, up to 1,950 N m off.
#[test]
fn a_clutch_that_locks_in_a_hard_stop_carries_the_load_alone() {
    let folder = Folder::new("hard-stops");
    let drive = drive_of([(3.0, 0.0, 0.3), (18.0, 1.0, 0.0), (12.0, 0.0, 0.3), (10.0, 0.4, 0.0), (8.0, 0.0, 0.3)]);
    let bench = std::fs::read_to_string(format!("{ROOT}experiments/bench.toml")).unwrap();
    let sensors = &bench[bench.find("[sensors]").unwrap()..bench.find("# The observers").unwrap()];
    let stated = folder.write("sensors.toml", sensors);
    let drive = folder.write("city.toml", drive + sensors);
    for vehicle in ["six_speed", "nine_speed_9hp", "ten_speed", "eight_speed"] {
        let car = format!("{ROOT}vehicles/{vehicle}.toml");
        said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
        for more in [&[][..], &["--sensors", stated.as_str()]] {
            let (log, out) = (folder.path("sim/city_measured.csv"), folder.path("out.csv"));
            said(&wetclutch(&[&["estimate", &log, "--vehicle", &car, "-o", &out], more].concat()));
            let (truth, found) = (folder.read("sim/city.csv"), folder.read("out.csv"));
            let health = column(&found, "health");
            let [true_n_m, found_n_m] = [(truth, "oncoming_torque_n_m"), (found, "oncoming_torque_estimate_n_m")]
                .map(|(table, name)| numbers(&table, name));
            let rows = health.iter().zip(true_n_m.iter().zip(&found_n_m)).filter(|(health, _)| *health == "too_slow");
            let errors: Vec<f64> = rows.map(|(_, (a, b))| (a - b).abs()).filter(|error| !error.is_nan()).collect();
            let maximum = errors.iter().copied().fold(0.0, f64::max);
            println!("{vehicle}, stated: {}: {maximum:.0} N m at most in {} rows", !more.is_empty(), errors.len());
            assert!(errors.len() > 40, "{vehicle}: {} rows", errors.len());
            assert!(maximum < 370.0, "{vehicle}: {maximum} N m");
        }
    }
}
