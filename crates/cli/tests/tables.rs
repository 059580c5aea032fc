//! Tables with the names of the program: units of the wheel speed, local times, speeds that are not of the car.

use crate::any_car::{column, simulated, with_column};
use crate::support::{EXPERIMENT, Folder, VEHICLE, printed, refused, said, wetclutch};

/// The measured log of the two-speed car's first experiment.
fn two_speed(folder: &Folder) -> String {
    printed(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]));
    let names = std::fs::read_dir(folder.path("drive")).unwrap().map(|entry| entry.unwrap().path());
    let measured = |path: &std::path::PathBuf| path.to_str().unwrap().ends_with("measured.csv");
    std::fs::read_to_string(names.into_iter().find(measured).unwrap()).unwrap()
}

/// The cells of a column multiplied.
fn scaled(text: &str, name: &str, factor: f64) -> String {
    with_column(text, name, |cell| cell.parse::<f64>().map_or(cell.to_owned(), |value| format!("{}", factor * value)))
}

fn estimate(folder: &Folder, vehicle: &str, log: &str) -> std::process::Output {
    let log = folder.write("log.csv", log);
    wetclutch(&["estimate", &log, "--vehicle", vehicle, "-o", &folder.path("out.csv")])
}

#[test]
fn a_wheel_speed_of_the_tread_is_read_with_the_radius_of_the_wheels() {
    let folder = Folder::new("tread");
    let log = two_speed(&folder);
    let wheel = "wheel_speed_rad_s";
    assert!(said(&estimate(&folder, VEHICLE, &log)).contains("observer: gearbox"));
    let shafts = column(&folder.read("out.csv"), "shaft_torque_estimate_n_m");
    // The wheels of the two-speed car have a radius of 0.3 m.
    for (name, factor) in [("wheel_speed_m_s", 0.3), ("wheel_speed_km_h", 1.08), ("Wheel_Speed_kmh", 1.08)] {
        let other = scaled(&log, wheel, factor).replacen(wheel, name, 1);
        assert!(said(&estimate(&folder, VEHICLE, &other)).contains("observer: gearbox"), "{name}");
        let read = column(&folder.read("out.csv"), "shaft_torque_estimate_n_m");
        let off = |(a, b): (&String, &String)| a.parse::<f64>().unwrap_or(0.0) - b.parse::<f64>().unwrap_or(0.0);
        assert!(shafts.iter().zip(&read).all(|pair| off(pair).abs() < 1e-3), "{name}");
    }
    let both = log
        .lines()
        .enumerate()
        .map(|(at, row)| if at == 0 { row.to_owned() + ",wheel_speed_km_h\n" } else { row.to_owned() + ",0\n" });
    let error = refused(&estimate(&folder, VEHICLE, &both.collect::<String>()));
    assert!(error.contains("two columns of the wheel speed"), "{error}");
}

#[test]
fn a_wheel_speed_of_the_tread_is_read_in_the_drive_of_any_car() {
    let folder = simulated("tread-any");
    let text = folder.read("sim/short_measured.csv");
    let wheel = "wheel_speed_rad_s";
    let slow = scaled(&text, wheel, 0.5).replacen(wheel, "wheel_speed_km_h", 1);
    // Read as km/h, this wheel is far from that of the car.
    let error = refused(&crate::any_car::estimate(
        &folder,
        {
            folder.write("log.csv", slow);
            "log.csv"
        },
        &["-o", &folder.path("out.csv")],
    ));
    assert!(error.contains("output_speed over wheel_speed"), "{error}");
}

#[test]
fn an_output_speed_of_a_wrong_scale_is_told_by_the_wheels() {
    let folder = Folder::new("output-scale");
    let log = scaled(&two_speed(&folder), "output_speed_rad_s", 4.0 / 3.0);
    let error = refused(&estimate(&folder, VEHICLE, &log));
    assert!(error.contains("error: output_speed over wheel_speed is 3.99"), "{error}");
    assert!(error.contains("final ratio of the vehicle file is 3.00") && !error.contains("swapped"), "{error}");
    assert!(error.contains("output_speed is 1.3") && error.contains("turbine_speed and wheel_speed fit"), "{error}");
    // Without the wheels nothing tells which of the two is wrong.
    let error = refused(&estimate(&folder, VEHICLE, &log.replacen("wheel_speed_rad_s", "other", 1)));
    assert!(error.contains("error: turbine_speed over output_speed") && !error.contains("warning:"), "{error}");
}

/// A logger that repeats the newest value in rows of 10 ms, of a speed that comes every 20 ms: each value is one reading.
#[test]
fn a_speed_of_a_gearbox_that_a_table_holds_counts_once() {
    let folder = simulated("held-car");
    let log = folder.read("sim/short_measured.csv");
    let torques = |log: &str| -> (Vec<f64>, String) {
        folder.write("log.csv", log);
        let text = said(&crate::any_car::estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        let cells = column(&folder.read("out.csv"), "offgoing_torque_estimate_n_m");
        (cells.iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect(), text)
    };
    let (clean, _) = torques(&log);
    for name in ["turbine_speed_rad_s", "output_speed_rad_s"] {
        let (mut row, mut newest) = (0, String::new());
        let held = with_column(&log, name, |cell| {
            row += 1;
            if row % 2 == 1 {
                newest = cell.to_owned();
            }
            newest.clone()
        });
        let (held, text) = torques(&held);
        assert!(text.contains("are those of a row before, held until the next comes, and count once"), "{text}");
        let off: Vec<f64> = held.iter().zip(&clean).map(|(a, b)| (a - b).powi(2)).filter(|it| !it.is_nan()).collect();
        let rms = (off.iter().sum::<f64>() / off.len() as f64).sqrt();
        println!("{name}: {rms:.2} N m");
        assert!(off.len() > 300 && rms < 8.0, "{name}: {rms} N m in {} rows", off.len());
    }
}
