//! Estimates over whole drives, every row of them, also where the car hardly moves and the filter does not run.

use crate::any_car::numbers;
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
