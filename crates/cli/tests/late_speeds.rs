//! Logs of cars with a gearbox whose speeds come later than their sensors are described.

use crate::any_car::numbers;
use crate::support::{Folder, ROOT, said, wetclutch};

const NAMES: [&str; 2] = ["oncoming_torque_n_m", "oncoming_torque_estimate_n_m"];

/// Sensors of which those of a channel come late by this time, s.
fn with_delay(sensors: &str, (channel, late_s): (&str, f64)) -> String {
    let at = sensors.find(&format!("[sensors.{channel}]")).unwrap();
    let (before, after) = sensors.split_at(at);
    format!("{before}{}", after.replacen("delay_s = 0.0", &format!("delay_s = {late_s}"), 1))
}

/// RMS error of the torque of the oncoming clutch, N m, over a drive in town whose sensors of a channel come late by this time, s, without the
/// estimate being told, and the delay that the estimate says to have found, ms.
fn error_n_m(folder: &Folder, sensors: &str, late: Option<(&str, f64)>) -> (f64, Option<f64>) {
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive = drive.replacen("repetitions = 20", "repetitions = 3", 1);
    let true_sensors = late.map_or(sensors.to_owned(), |late| with_delay(sensors, late));
    let car = format!("{ROOT}vehicles/eight_speed.toml");
    let drive = folder.write("city.toml", drive + &true_sensors);
    let stated = folder.write("sensors.toml", sensors);
    let (sim, out) = (folder.path("sim"), folder.path("out.csv"));
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &sim]));
    let log = folder.path("sim/city_measured.csv");
    let found = said(&wetclutch(&["estimate", &log, "--vehicle", &car, "--sensors", &stated, "-o", &out]));
    let delay_ms = found
        .split("_speed comes ")
        .nth(1)
        .and_then(|rest| rest.split(" ms later").next()?.trim_start_matches("at least ").parse().ok());
    assert_eq!(delay_ms.is_some(), found.contains("later than is stated"), "{found}");
    let [truth, estimate] =
        [("sim/city.csv", NAMES[0]), ("out.csv", NAMES[1])].map(|(file, name)| numbers(&folder.read(file), name));
    assert_eq!(truth.len(), estimate.len());
    let errors = truth.iter().zip(&estimate).map(|(truth, estimate)| estimate - truth).filter(|error| !error.is_nan());
    let (sum, count) = errors.fold((0.0, 0_u32), |(sum, count), error| (sum + error * error, count + 1));
    assert!(count > 1000);
    ((sum / f64::from(count)).sqrt(), delay_ms)
}

#[test]
fn speeds_that_come_late_are_found_in_the_gears() {
    let folder = Folder::new("late-speeds");
    let bench = std::fs::read_to_string(format!("{ROOT}experiments/bench.toml")).unwrap();
    let sensors = &bench[bench.find("[sensors]").unwrap()..bench.find("# The observers").unwrap()];
    let (on_time, said_ms) = error_n_m(&folder, sensors, None);
    assert!(on_time < 2.5 && said_ms.is_none(), "{on_time} {said_ms:?}");
    let (stated, _) = error_n_m(&folder, &with_delay(sensors, ("turbine", 0.04)), None);
    println!("turbine 0.04 s late and stated so: {stated:.2} N m");
    for (channel, late_s, times) in [
        ("turbine", 0.01, 1.8),
        // A quarter above what was found: beside a ratio that may be off as well it takes a gear more to be known.
        ("output", 0.01, 2.3),
        ("turbine", 0.02, 3.5),
        ("output", 0.02, 3.5),
        // A quarter above what was found; stated, such a delay has its price too: the filter is ahead of its readings by four rows.
        ("turbine", 0.04, 7.5),
        ("output", 0.04, 8.5),
        ("wheel", 0.03, 1.5),
    ] {
        let (late, said_ms) = error_n_m(&folder, sensors, Some((channel, late_s)));
        println!("{channel} {late_s} s late: {late:.2} N m, {on_time:.2} N m on time; said {said_ms:?} ms");
        if late_s >= 0.015 {
            assert!(said_ms.is_some_and(|ms| (ms - 1e3 * late_s).abs() < 0.2e3 * late_s), "{channel}: {said_ms:?} ms");
        }
        assert!(late < times * on_time, "{channel}: {late} N m, {on_time} on time");
    }
}
