//! Logs of cars with a gearbox whose commands come late or early against the speeds.

use crate::any_car::{column, estimate, numbers, simulated_twice};
use crate::support::{Folder, ROOT, said, wetclutch};

/// The log with its commands so many rows late.
pub(crate) fn late(text: &str, rows: isize) -> String {
    let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let (names, lines) = lines.split_first().unwrap();
    let is_command = |name: &str| name.starts_with("element_") && name.ends_with("_current_a");
    let row = |at: usize| {
        let then = at.saturating_add_signed(-rows).min(lines.len() - 1);
        let cells = names.iter().zip(&lines[at]).zip(&lines[then]);
        cells.map(|((name, now), then)| if is_command(name) { *then } else { *now }).collect::<Vec<_>>().join(",")
    };
    names.join(",") + "\n" + &(0..lines.len()).map(|at| row(at) + "\n").collect::<String>()
}

/// A channel map for the names of the program, with this more in the entries of the commands.
pub(crate) fn map(text: &str, more: &str) -> String {
    let commands = text.lines().next().unwrap().split(',').filter_map(|name| name.strip_suffix("_current_a"));
    let commands = commands.filter(|name| name.starts_with("element_"));
    let entry = |key: &str, name: &str, more: &str| format!("[channel.{key}]\nname = \"{name}\"\n{more}\n");
    let speeds = ["engine_speed", "turbine_speed", "output_speed", "wheel_speed"]
        .map(|key| entry(key, &format!("{key}_rad_s"), ""));
    let others = ["gear", "target_gear", "lock_up_applied"].map(|key| entry(key, key, ""));
    let torque = entry("engine_torque", "reported_engine_torque_n_m", "");
    let commands = commands.map(|name| entry(&format!("{name}_current"), &format!("{name}_current_a"), more));
    speeds.into_iter().chain(others).chain([torque]).chain(commands).collect()
}

#[test]
fn a_delay_of_the_commands_is_said_and_moved_by_the_channel_map() {
    let folder = simulated_twice("late-commands");
    let text = folder.read("sim/short_measured.csv");
    let right = said(&estimate(&folder, "sim/short_measured.csv", &["-o", &folder.path("right.csv")]));
    assert!(
        !right.contains("the commands of the valves come") && !folder.read("right.csv").contains("commands_mistimed")
    );
    for (rows, words) in [(12, "ms too late"), (-12, "ms too early")] {
        let wrong = late(&text, rows);
        folder.write("wrong.csv", &wrong);
        let told = said(&estimate(&folder, "wrong.csv", &["-o", &folder.path("told.csv")]));
        let told = told.lines().find(|line| line.contains("the commands of the valves come about")).unwrap().to_owned();
        assert!(told.contains(words) && told.contains("`late_s = "), "{told}");
        assert!(folder.read("told_report.html").contains("the commands of the valves come about"));
        assert!(folder.read("told_report.html").contains("commands mistimed"));
        // From the shift on that shows it.
        let health = column(&folder.read("told.csv"), "health");
        assert!(health.first().unwrap() != "commands_mistimed" && health.last().unwrap() == "commands_mistimed");
        // The map moves them: the estimates are those of the right log.
        let map = folder.write("map.toml", map(&wrong, &format!("late_s = {}", 0.01 * rows as f64)));
        let moved = said(&estimate(&folder, "wrong.csv", &["--map", &map, "-o", &folder.path("moved.csv")]));
        assert!(!moved.contains("the commands of the valves come"), "{moved}");
        let torques = ["right.csv", "moved.csv"].map(|name| {
            let torques = numbers(&folder.read(name), "oncoming_torque_estimate_n_m");
            torques.into_iter().filter(|torque| !torque.is_nan()).collect::<Vec<_>>()
        });
        assert_eq!(torques[0].len(), torques[1].len());
        let maximum = torques[0].iter().zip(&torques[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(maximum < 0.5, "{maximum}");
    }
}

/// Friction, valve gain and lag of the car are wrong, and within the bounds that its file states.
#[test]
fn slow_valves_within_wide_bounds_are_no_delay_of_the_commands() {
    let folder = Folder::new("slow-valves");
    let file = std::fs::read_to_string(format!("{ROOT}vehicles/eight_speed.toml")).unwrap();
    let file = file.replacen("\"../gearboxes", &format!("\"{ROOT}gearboxes"), 1);
    let wide = ["A", "B", "C", "D", "E"].map(|name| {
        format!("\n[clutch.{name}.error_bounds]\nfriction_factor = [0.6, 1.5]\nvalve_gain_factor = [0.7, 1.35]\nvalve_lag_factor = [0.3, 2]\n")
    });
    let bounded = folder.write("bounded.toml", file.clone() + &wide.concat());
    let slower = scaled(&file, "time_constant_s", 1.9);
    let true_car = folder.write("true.toml", scaled(&slower, "gain_pa_a", 0.86));
    let city = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let sensors = std::fs::read_to_string(format!("{ROOT}experiments/bench.toml")).unwrap();
    let sensors = &sensors[sensors.find("[sensors]").unwrap()..sensors.find("# The observers").unwrap()];
    let sensors_file = folder.write("sensors.toml", sensors);
    let drive = folder.write("city.toml", city.replacen("repetitions = 20", "repetitions = 1", 1) + sensors);
    said(&wetclutch(&["simulate", &drive, "--vehicle", &true_car, "-o", &folder.path("sim")]));
    let (log, out) = (folder.path("sim/city_measured.csv"), folder.path("out.csv"));
    let said = said(&wetclutch(&["estimate", &log, "--vehicle", &bounded, "--sensors", &sensors_file, "-o", &out]));
    assert!(!said.contains("the commands of the valves come"), "{said}");
}

/// Plates that take their load late in the slow shifts of comfort, up and down alike: to the shifts they look like commands 70 to 100 ms early.
#[test]
fn weak_plates_in_slow_shifts_are_no_early_commands() {
    let folder = Folder::new("weak-plates");
    let drive = std::fs::read_to_string(format!("{ROOT}drives/faults.toml")).unwrap();
    let (drive, _) = drive.split_once("# From `from_s`").unwrap();
    let drive = drive.replacen("controller = \"bench\"", "controller = \"comfort\"", 1);
    assert!(drive.contains("controller = \"comfort\""));
    let drive = drive + "[[fault]]\nkind = \"wrong-fluid\"\nfriction_factor = 0.75\nfrom_s = 0\n";
    let drive = folder.write("weak.toml", drive.replacen("name = \"faults\"", "name = \"weak\"", 1));
    for vehicle in ["six_speed", "eight_speed_a8lr1"] {
        let car = format!("{ROOT}vehicles/{vehicle}.toml");
        said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
        let (log, out) = (folder.path("sim/weak_measured.csv"), folder.path("out.csv"));
        let weak = said(&wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &out]));
        assert!(!weak.contains("the commands of the valves come"), "{vehicle}: {weak}");
        // They still would be found.
        let early = folder.write("early.csv", late(&folder.read("sim/weak_measured.csv"), -20));
        let early = said(&wetclutch(&["estimate", &early, "--vehicle", &car, "-o", &out]));
        assert!(early.contains("the commands of the valves come"), "{vehicle}: {early}");
    }
}

/// A vehicle file with the values of a list times a factor.
fn scaled(file: &str, key: &str, factor: f64) -> String {
    let begin = file.find(key).unwrap();
    let begin = begin + file[begin..].find('[').unwrap() + 1;
    let end = begin + file[begin..].find(']').unwrap();
    let values = file[begin..end].split(',').map(|value| factor * value.trim().parse::<f64>().unwrap());
    let values: Vec<String> = values.map(|value| value.to_string()).collect();
    format!("{}{}{}", &file[..begin], values.join(", "), &file[end..])
}
