//! Drives outside of the shifts from one clutch to another: neutral, reverse.

use crate::any_car::{column, with_column};
use crate::support::{Folder, ROOT, refused, said, wetclutch};

const GARAGE: &str = "name = \"garage\"\nstart = { gear = \"N\", vehicle_m_s = 0 }\nshift = [{ time_s = 1, gear = \"1\" }, \
                      { time_s = 3, gear = \"R\" }, { time_s = 6, gear = \"1\" }, { time_s = 9, gear = \"N\" }]\n[[segment]]\nduration_s = 10\n\
                      throttle = 0\nbrake = 0.3\n";
const REVERSE: &str = "name = \"reverse\"\nstart = { gear = \"R\", vehicle_m_s = 0 }\nshift = []\n[[segment]]\nduration_s = 12\nthrottle = 0.2\n";

/// A folder with the signals of a drive in `sim`, and what `simulate` said.
fn simulated(name: &str, drive: &str, car: &str) -> (Folder, String) {
    let folder = Folder::new(name);
    let (drive, out) = (folder.write("drive.toml", drive), folder.path("sim"));
    let said = said(&wetclutch(&["simulate", &drive, "--vehicle", &vehicle(car), "-o", &out]));
    (folder, said)
}

fn vehicle(name: &str) -> String {
    format!("{ROOT}vehicles/{name}.toml")
}

fn estimate(folder: &Folder, log: &str, car: &str) -> std::process::Output {
    wetclutch(&["estimate", &folder.path(log), "--vehicle", &vehicle(car), "-o", &folder.path("out.csv")])
}

#[test]
fn garage_shifts_have_their_gears_and_no_flare() {
    for car in ["four_speed", "six_speed", "eight_speed", "ten_speed"] {
        let (folder, _) = simulated("garage", GARAGE, car);
        let text = said(&estimate(&folder, "sim/garage_measured.csv", car));
        let shifts = folder.read("out_shifts.csv");
        let gears: Vec<String> = column(&shifts, "from_gear")
            .iter()
            .zip(column(&shifts, "to_gear"))
            .map(|(a, b)| format!("{a}-{b}"))
            .collect();
        assert_eq!(gears, ["N-1", "1-R", "R-1", "1-N"], "{car}");
        assert!(column(&shifts, "kind").iter().all(|kind| kind == "garage shift"), "{shifts}");
        for quality in ["flare_rad_s", "past_synchronous_rad_s"] {
            assert!(column(&shifts, quality).iter().all(String::is_empty), "{car}: {shifts}");
        }
        assert!(text.contains("4 of 4 shifts were completed") && !text.contains("warning"), "{car}: {text}");
        assert!(!text.contains("Largest flare") && text.contains("Of 2 garage shifts nothing is estimated"), "{text}");
        // Out of neutral no clutch opens.
        let log = folder.read("sim/garage_measured.csv");
        let offgoing = column(&log, "offgoing");
        let from_neutral = column(&log, "gear").into_iter().zip(column(&log, "target_gear")).zip(offgoing);
        let mut from_neutral = from_neutral.filter(|((gear, target), _)| gear == "N" && target == "1");
        assert!(from_neutral.all(|(_, offgoing)| offgoing.is_empty()));
    }
}

#[test]
fn a_drive_in_reverse_is_estimated_and_a_wrong_sign_in_a_forward_gear_is_not() {
    let car = "eight_speed";
    let (folder, text) = simulated("reverse", REVERSE, car);
    assert!(text.contains(" km (0.") && text.contains(" km of it backwards), 0 shifts, at most"), "{text}");
    assert!(!text.contains("-0.") && !text.contains("at most 0 km/h"), "{text}");
    let text = said(&estimate(&folder, "sim/reverse_measured.csv", car));
    assert!(text.contains("The drive has no shift."), "{text}");
    let log = folder.read("sim/reverse_measured.csv");
    let forward = with_column(&with_column(&log, "gear", |_| "1".to_owned()), "target_gear", |_| "1".to_owned());
    folder.write("forward.csv", forward);
    let error = refused(&estimate(&folder, "forward.csv", car));
    assert!(error.contains("output_speed is negative and turbine_speed positive"), "{error}");
}
