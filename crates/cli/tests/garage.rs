//! Drives outside of the shifts from one clutch to another: neutral, reverse.

use crate::any_car::{column, numbers, with_column};
use crate::support::{BENCH, Folder, ROOT, refused, said, wetclutch};

const GARAGE: &str = "name = \"garage\"\nstart = { gear = \"N\", vehicle_m_s = 0 }\nshift = [{ time_s = 1, gear = \"1\" }, \
                      { time_s = 3, gear = \"R\" }, { time_s = 6, gear = \"1\" }, { time_s = 9, gear = \"N\" }]\n[[segment]]\nduration_s = 10\n\
                      throttle = 0\nbrake = 0.3\n";
const REVERSE: &str = "name = \"reverse\"\nstart = { gear = \"R\", vehicle_m_s = 0 }\nshift = []\n[[segment]]\nduration_s = 12\nthrottle = 0.2\n";

const LAUNCH: &str = "name = \"launch\"\n[[segment]]\nduration_s = 2\nthrottle = 0\nbrake = 0.3\n[[segment]]\nduration_s = 14\nthrottle = 0.5\n\
                      [[segment]]\nduration_s = 22\nthrottle = 0\nbrake = 0.15\n";

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
        assert!(!text.contains("Largest flare") && text.contains("2 garage shifts are not estimated"), "{text}");
        // The gears as numbers: none is 0, reverse -1.
        let estimates = folder.read("out.csv");
        for [name, number] in [["gear", "gear_number"], ["target_gear", "target_gear_number"]] {
            let pairs = column(&estimates, name).into_iter().zip(column(&estimates, number));
            let pairs: std::collections::BTreeSet<_> = pairs.collect();
            let expected =
                [("", "0"), ("1", "1"), ("R", "-1")].map(|(name, number)| (name.to_owned(), number.to_owned()));
            assert_eq!(pairs, expected.into(), "{car}");
        }
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

/// The healths of a log's rows in which this holds.
fn healths(table: &str, log: &str, holds: impl Fn(&str, &str, f64) -> bool) -> Vec<String> {
    let (gear, target) = (column(log, "gear"), column(log, "target_gear"));
    let rows = gear.iter().zip(&target).zip(numbers(log, "output_speed_rad_s")).zip(column(table, "health"));
    rows.filter(|(((gear, target), output), _)| holds(gear, target, *output)).map(|(_, health)| health).collect()
}

#[test]
fn an_open_clutch_is_no_held_clutch_and_a_dog_change_no_shift() {
    let (folder, _) = simulated("launch", LAUNCH, "dual_clutch");
    let log = "sim/launch_measured.csv";
    for sensors in [None, Some(BENCH)] {
        let (log, car, out) = (folder.path(log), vehicle("dual_clutch"), folder.path("out.csv"));
        let sensors = sensors.map(|file| vec!["--sensors", file]).unwrap_or_default();
        let text = said(&wetclutch(&[&["estimate", &log, "--vehicle", &car, "-o", &out][..], &sensors].concat()));
        assert!(!text.contains("without a target_gear"), "{text}");
        let (table, log) = (folder.read("out.csv"), folder.read("sim/launch_measured.csv"));
        let slow = healths(&table, &log, |_, _, output| output.abs() < 14.5);
        assert!(slow.len() > 200 && slow.iter().all(|health| health == "too_slow"), "{slow:?}");
        let in_gear = healths(&table, &log, |gear, target, output| gear == target && output > 15.5);
        assert!(in_gear.iter().any(|health| health == "clutch_open"));
        let wrong = in_gear.iter().filter(|health| *health == "held_clutch_slips" || *health == "speeds_rejected");
        assert_eq!(wrong.count(), 0);
    }
    // A clutch that is commanded to hold and slips is said: the engine turns faster than the gear.
    let text = folder.read(log);
    let (gear, output) = (column(&text, "gear"), numbers(&text, "output_speed_rad_s"));
    let mut row = 0;
    let slips = with_column(&text, "turbine_speed_rad_s", |cell| {
        row += 1;
        let is_fast = output[row - 1] > 40.0 && gear[row - 1] == "4";
        if is_fast { (cell.parse::<f64>().unwrap() + 30.0).to_string() } else { cell.to_owned() }
    });
    folder.write("slips.csv", &slips);
    said(&estimate(&folder, "slips.csv", "dual_clutch"));
    let slipping =
        healths(&folder.read("out.csv"), &slips, |gear, target, output| gear == target && gear == "4" && output > 40.0);
    let said = slipping.iter().filter(|health| *health == "held_clutch_slips").count();
    assert!(2 * said > slipping.len() && slipping.len() > 20, "{said} of {}: {slipping:?}", slipping.len());
}

#[test]
fn standing_and_neutral_have_their_words() {
    let (folder, _) = simulated("words", GARAGE, "eight_speed");
    said(&estimate(&folder, "sim/garage_measured.csv", "eight_speed"));
    let (table, log) = (folder.read("out.csv"), folder.read("sim/garage_measured.csv"));
    let neutral = healths(&table, &log, |gear, target, _| gear == "N" && target == "N");
    assert!(neutral.len() > 100 && neutral.iter().all(|health| health == "clutch_open"), "{neutral:?}");
    let others = healths(&table, &log, |_, target, _| target != "N");
    assert!(others.iter().all(|health| health == "too_slow"), "{others:?}");
}
