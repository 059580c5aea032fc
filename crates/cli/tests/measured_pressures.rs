//! Logs of cars with any gearbox in which pressures of single elements are measured: errors, friction work and jerk of each shift.

use std::collections::BTreeMap;

use crate::support::{BENCH, Folder, ROOT, refused, said, wetclutch};

/// Rows of a table by the names of its columns.
fn rows(text: &str) -> Vec<BTreeMap<String, String>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells = line.split(',').map(str::to_owned);
        names.iter().map(|name| (*name).to_owned()).zip(cells).collect()
    };
    lines.map(row).collect()
}

fn number(row: &BTreeMap<String, String>, name: &str) -> f64 {
    row[name].parse().unwrap_or(f64::NAN)
}

/// A drive of three minutes of the eight-speed car in town behind sensors.
fn town(name: &str) -> Folder {
    let folder = Folder::new(name);
    let bench = std::fs::read_to_string(BENCH).unwrap();
    let (begin, end) = (bench.find("[sensors]").unwrap(), bench.find("# The observers, all at 100 Hz.").unwrap());
    let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let drive = drive.replace("repetitions = 20", "repetitions = 1").replace("vehicle = ", "# vehicle = ");
    let drive = folder.write("drive.toml", drive + &bench[begin..end]);
    let car = format!("{ROOT}vehicles/eight_speed.toml");
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
    folder
}

/// True pressure of an element in a row of the simulation, Pa, while it is a clutch of a shift.
fn pressure_of(row: &BTreeMap<String, String>, element: &str) -> Option<f64> {
    let of = |role: &str| (row[role] == element).then(|| number(row, &format!("{role}_pressure_pa")));
    of("offgoing").or_else(|| of("oncoming"))
}

/// The measured table with more columns, whose cells follow from the row of the simulation.
fn with_columns(folder: &Folder, name: &str, titles: &str, cells: impl Fn(usize, &BTreeMap<String, String>) -> String) {
    let measured = folder.read("sim/city_measured.csv");
    let mut lines = measured.lines();
    let mut text = format!("{},{titles}\n", lines.next().unwrap());
    for (at, (line, row)) in lines.zip(rows(&folder.read("sim/city.csv"))).enumerate() {
        text.push_str(&format!("{line},{}\n", cells(at, &row)));
    }
    folder.write(name, text);
}

fn shifts_of(folder: &Folder, log: &str, more: &[&str]) -> (Vec<BTreeMap<String, String>>, String) {
    let (car, log, out) = (format!("{ROOT}vehicles/eight_speed.toml"), folder.path(log), folder.path("out.csv"));
    let words = crate::support::shown(&wetclutch(&[&["estimate", &log, "--vehicle", &car, "-o", &out], more].concat()));
    (rows(&folder.read("out_shifts.csv")), words)
}

const ERROR: &str = "inertia_phase_controlling_rms_pa";
const INSIDE: &str = "measured_pressure_inside_range";

#[test]
fn a_pressure_that_is_measured_at_one_element_is_compared_in_the_shifts_of_that_element() {
    let folder = town("measured-pressures");
    let pressure = |row: &BTreeMap<String, String>, offset_pa: f64, unit: f64| {
        pressure_of(row, "C").map_or(String::new(), |pa| format!("{}", (pa + offset_pa) * unit))
    };
    with_columns(&folder, "truth.csv", "offgoing_pressure_pa,oncoming_pressure_pa", |_, row| {
        format!("{},{}", row["offgoing_pressure_pa"], row["oncoming_pressure_pa"])
    });
    let (both, _) = shifts_of(&folder, "truth.csv", &[]);
    assert!(both.len() > 12 && both.iter().all(|shift| number(shift, INSIDE) > 0.99));
    with_columns(&folder, "c.csv", "element_c_pressure_kpa", |_, row| pressure(row, 0.0, 1e-3));
    let (only_c, words) = shifts_of(&folder, "c.csv", &[]);
    assert!(words.contains("pressure") && words.contains("in range"), "{words}");
    let mut compared = 0;
    for (both, only) in both.iter().zip(&only_c) {
        let changes = ["offgoing", "oncoming"].map(|role| only[role] == "C");
        assert_eq!(number(only, INSIDE).is_finite(), changes != [false; 2], "{only:?}");
        if number(only, ERROR).is_finite() {
            assert!((number(only, ERROR) / number(both, ERROR) - 1.0).abs() < 1e-9);
            compared += 1;
        }
        assert!(only["inside_range"].is_empty() && only["inertia_phase_controlling_rms_n_m"].is_empty());
    }
    assert!(compared == 4, "{compared}");

    // A sensor that reads 200 kPa too much is seen.
    with_columns(&folder, "wrong.csv", "element_c_pressure_pa", |_, row| pressure(row, 2e5, 1.0));
    assert!(!words.contains("are outside their"), "{words}");
    let (wrong, words) = shifts_of(&folder, "wrong.csv", &[]);
    assert!(words.contains("warning: measured pressures are outside") && words.contains(": C ("), "{words}");
    for (wrong, right) in wrong.iter().zip(&only_c).filter(|(_, right)| number(right, ERROR).is_finite()) {
        assert!((number(wrong, ERROR) - 2e5).abs() < 2e4 && number(wrong, INSIDE) < 0.5, "{right:?}");
    }

    // What is not read is named.
    assert!(!words.contains("not read"), "{words}");
    with_columns(&folder, "names.csv", "element_c_pressure_psi,element_q_pressure_pa", |_, _| "3,4".to_owned());
    let (_, words) = shifts_of(&folder, "names.csv", &[]);
    assert!(words.contains("not read: `element_c_pressure_psi`, `element_q_pressure_pa`."), "{words}");

    // Nor can pressures in Pa be some in bar.
    with_columns(&folder, "bar.csv", "element_c_pressure_bar", |_, row| pressure(row, 0.0, 1.0));
    let (car, log) = (format!("{ROOT}vehicles/eight_speed.toml"), folder.path("bar.csv"));
    let text = refused(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &folder.path("no.csv")]));
    assert!(text.contains("element_c_pressure") && text.contains("MPa"), "{text}");

    // By a channel map, with a clock of its own.
    let map: String = ["engine", "turbine", "output", "wheel"]
        .map(|name| format!("[channel.{name}_speed]\nname = \"{name}_speed_rad_s\"\nunit = \"rad/s\"\n"))
        .into_iter()
        .chain(["a", "b", "c", "d", "e"].map(|element| {
            format!("[channel.element_{element}_current]\nname = \"element_{element}_current_a\"\nunit = \"A\"\n")
        }))
        .chain(["gear", "target_gear", "lock_up_applied"].map(|name| format!("[channel.{name}]\nname = \"{name}\"\n")))
        .collect();
    let entry = "[channel.element_c_pressure]\nname = \"P_C\"\nunit = \"bar\"\n";
    let with_map = folder.write("map.toml", format!("{map}{entry}"));
    // Every other row brings a reading. Where a clutch is pressed on at once, as at the end of 2-1, single rows decide; of the upshifts the even
    // and the odd rows together have the errors of all.
    let mut pooled = [0.0; 2];
    for first in [0, 1] {
        with_columns(&folder, "slow.csv", "P_C", |at, row| match at % 2 == first {
            true => pressure(row, 0.0, 1e-5),
            false => String::new(),
        });
        let (slow, _) = shifts_of(&folder, "slow.csv", &["--map", &with_map]);
        let upshifts = slow.iter().zip(&only_c).filter(|(slow, _)| slow["kind"].contains("upshift"));
        let errors = upshifts.map(|(slow, right)| (number(slow, ERROR), number(right, ERROR)));
        for (slow, right) in errors.filter(|(_, right)| right.is_finite()) {
            pooled = [pooled[0] + slow.powi(2), pooled[1] + right.powi(2)];
        }
    }
    assert!((0.7..1.4).contains(&(pooled[0] / pooled[1])), "{pooled:?}");
    let unknown = folder.write("unknown.toml", format!("{map}{}", entry.replace("element_c", "element_q")));
    let (car, log) = (format!("{ROOT}vehicles/eight_speed.toml"), folder.path("slow.csv"));
    let text =
        refused(&wetclutch(&["estimate", &log, "--vehicle", &car, "--map", &unknown, "-o", &folder.path("no.csv")]));
    assert!(text.contains("element_q_pressure") && text.contains("element_c_pressure"), "{text}");
}

#[test]
fn friction_work_and_jerk_of_a_measured_drive_are_those_of_the_simulation() {
    let folder = town("measured-quality");
    let truth = rows(&folder.read("sim/city.csv"));
    // Work of the torque, and of one newton metre against the slip.
    let work_j = |role: &str, [from_s, to_s]: [f64; 2]| -> [f64; 2] {
        let in_shift = truth.iter().filter(|row| (from_s - 1e-6..to_s + 1e-6).contains(&number(row, "time_s")));
        let of = |row, what: &str| number(row, &format!("{role}_{what}"));
        let powers =
            in_shift.map(|row| (of(row, "torque_n_m"), of(row, "slip_rad_s"))).filter(|(torque, _)| torque.is_finite());
        powers.fold([0.0; 2], |[work, one], (torque, slip)| [work + 0.01 * torque * slip, one + 0.01 * slip.abs()])
    };
    let (shifts, words) = shifts_of(&folder, "sim/city_measured.csv", &[]);
    assert!(words.contains("rating") && words.contains("friction"), "{words}");
    let (mut all, mut off) = (0.0, 0.0);
    for shift in &shifts {
        let from_s = number(shift, "time_s");
        for role in ["offgoing", "oncoming"] {
            let of = |end: &str| number(shift, &format!("{role}_friction_work{end}_j"));
            let [true_j, one_n_m] = work_j(role, [from_s, from_s + number(shift, "complete_s")]);
            // The range leaves out the drag of an open clutch.
            let drag_j = 1.2 * one_n_m + 1.0;
            assert!(of("_least") - drag_j < true_j && true_j < of("_greatest") + drag_j, "{role} {true_j} {shift:?}");
            (all, off) = (all + true_j, off + (of("") - true_j).abs());
        }
    }
    assert!(all > 5e3 && off < 0.15 * all, "{off} of {all} J");

    // Without the speed of the car and of the wheels there is none: the output swings.
    let text = folder.read("sim/city_measured.csv");
    let wheel = text.lines().next().unwrap().split(',').position(|name| name == "wheel_speed_rad_s").unwrap();
    let without = |line: &str| {
        let cells = line.split(',').enumerate().filter(|(at, _)| *at != wheel).map(|(_, cell)| cell);
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    folder.write("output.csv", text.lines().map(without).collect::<String>());
    let (by_output, _) = shifts_of(&folder, "output.csv", &[]);
    assert!(
        by_output.iter().all(|shift| shift["jerk_m_s3"].is_empty() && shift["acceleration_source"] == "output_speed")
    );
    // Jerk and score by the wheels, of the exact speed, and of one as a bus has it.
    let simulated = rows(&folder.read("sim/city_shifts.csv"));
    let mut ratings = Vec::new();
    for (shift, simulated) in shifts.iter().zip(&simulated) {
        assert_eq!(shift["acceleration_source"], "wheel_speed");
        let [measured, truth] = [shift, simulated].map(|shift| number(shift, "rating"));
        ratings.push((measured - truth).abs());
        let [measured, truth] = [shift, simulated].map(|shift| number(shift, "oncoming_plates_degc"));
        assert!(truth > 80.0 && (measured - truth).abs() < 3.0 + 0.2 * (truth - 80.0), "{measured} {truth} degC");
    }
    assert!(ratings.iter().sum::<f64>() < 0.4 * ratings.len() as f64, "{ratings:?}");
    let speed = |row: &BTreeMap<String, String>| number(row, "vehicle_speed_m_s");
    with_columns(&folder, "speed.csv", "vehicle_speed_m_s", |_, row| format!("{}", speed(row)));
    let (exact, words) = shifts_of(&folder, "speed.csv", &[]);
    assert!(words.contains("rating"), "{words}");
    with_columns(&folder, "bus.csv", "vehicle_speed_km_h", |at, row| match at % 2 {
        0 => format!("{:.2}", (72.0 * speed(row)).round() / 20.0),
        _ => String::new(),
    });
    let (bus, _) = shifts_of(&folder, "bus.csv", &[]);
    for (bus, exact) in bus.iter().zip(&exact) {
        let [bus, exact] = [bus, exact].map(|shift| number(shift, "jerk_m_s3"));
        assert!((0.4..8.0).contains(&exact) && (bus - exact).abs() < 0.5 + 0.1 * exact, "{bus} {exact}");
    }
    with_columns(&folder, "frozen.csv", "vehicle_speed_m_s", |_, _| "13.5".to_owned());
    let (frozen, _) = shifts_of(&folder, "frozen.csv", &[]);
    assert!(frozen.iter().all(|shift| shift["jerk_m_s3"].is_empty()));
}

#[test]
fn gear_signals_that_are_lost_in_a_shift_are_said_and_have_no_friction_work() {
    let folder = town("lost-gears");
    let (shifts, words) = shifts_of(&folder, "sim/city_measured.csv", &[]);
    assert!(!words.contains("of the shifts take longer"), "{words}");
    let measured = folder.read("sim/city_measured.csv");
    let names: Vec<&str> = measured.lines().next().unwrap().split(',').collect();
    let gears = ["gear", "target_gear"].map(|name| names.iter().position(|other| *other == name).unwrap());
    // The signals are lost in 1-2, until 2-3 is over; or in 5-6, for half a minute.
    for (number, lost_s) in [(1, 9.0..11.2), (5, 21.3..55.0)] {
        let row = |line: &str| {
            let mut cells: Vec<&str> = line.split(',').collect();
            if cells[0].parse().is_ok_and(|time_s: f64| lost_s.contains(&time_s)) {
                gears.iter().for_each(|at| cells[*at] = "");
            }
            cells.join(",") + "\n"
        };
        folder.write("lost.csv", measured.lines().map(row).collect::<String>());
        let (lost, words) = shifts_of(&folder, "lost.csv", &[]);
        assert!(words.contains(&format!("1 of the shifts take longer than 10 s, or the turbine is 30 rad/s and more below the speeds of both gears (number {number})")), "{words}");
        let work = |shifts: &[BTreeMap<String, String>]| shifts[number - 1]["oncoming_friction_work_j"].clone();
        assert!(work(&lost).is_empty() && !work(&shifts).is_empty());
    }
}
