//! Logs of cars with a gearbox that have the pressures asked of the elements in place of the commands of their valves.

use crate::any_car::{estimate, numbers, simulated};
use crate::support::{Folder, ROOT, refused, said};

/// The log with the commands of these elements as pressures in this unit of so many Pa.
fn with_pressures(text: &str, elements: &[&str], (unit, size): (&str, f64)) -> String {
    let car = config::CarFile::read(std::path::Path::new(&format!("{ROOT}vehicles/four_speed.toml"))).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let valves: Vec<_> = (names.iter())
        .map(|name| {
            let element = name.strip_prefix("element_")?.strip_suffix("_current_a")?;
            let at = car.gearbox.elements.iter().position(|known| known.name.to_lowercase() == element)?;
            Some(car.clutches[at].as_ref().unwrap().valve).filter(|_| elements.contains(&element))
        })
        .collect();
    let rows = text.lines().enumerate().map(|(row, line)| {
        let cells = line.split(',').zip(&valves).map(|(cell, valve)| match (valve, row) {
            (None, _) => cell.to_owned(),
            (Some(_), 0) => cell.replace("current_a", &format!("pressure_command_{unit}")),
            (Some(valve), _) => format!("{:.6}", valve.settled_pressure(cell.parse().unwrap()) / size),
        });
        cells.collect::<Vec<_>>().join(",") + "\n"
    });
    rows.collect()
}

/// Elements of the four-speed car that have a valve.
fn elements(text: &str) -> Vec<&str> {
    let names = text.lines().next().unwrap().split(',');
    names.filter_map(|name| name.strip_prefix("element_")?.strip_suffix("_current_a")).collect()
}

/// How far the torques of two estimates are apart, N m.
fn apart(folder: &Folder, names: [&str; 2]) -> f64 {
    let [one, other] = names.map(|name| numbers(&folder.read(name), "oncoming_torque_estimate_n_m"));
    assert!(one.len() == other.len() && one.iter().any(|torque| torque.abs() > 50.0));
    assert!(one.iter().zip(&other).all(|(a, b)| a.is_nan() == b.is_nan()));
    one.iter().zip(&other).filter(|(a, _)| !a.is_nan()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_pressure_that_is_asked_of_an_element_stands_for_the_command_of_its_valve() {
    let folder = simulated("pressure-commands");
    let text = folder.read("sim/short_measured.csv");
    let elements = elements(&text);
    assert!(elements.len() > 3, "{elements:?}");
    said(&estimate(&folder, "sim/short_measured.csv", &["-o", &folder.path("currents.csv")]));
    for (which, unit) in [(&elements[..], ("bar", 1e5)), (&elements[..1], ("kpa", 1e3))] {
        folder.write("log.csv", with_pressures(&text, which, unit));
        said(&estimate(&folder, "log.csv", &["-o", &folder.path("pressures.csv")]));
        let apart = apart(&folder, ["currents.csv", "pressures.csv"]);
        assert!(apart < 0.1, "{unit:?}: {apart}");
    }
    // A channel map with names of its own.
    let bar = with_pressures(&text, &elements, ("bar", 1e5));
    let (names, rows) = bar.split_once('\n').unwrap();
    let renamed = names.replace("_pressure_command_bar", "").replace("element_", "P_cmd_");
    folder.write("own.csv", format!("{renamed}\n{rows}"));
    let mut map: String = ["engine_speed", "turbine_speed", "output_speed", "wheel_speed"]
        .map(|key| format!("[channel.{key}]\nname = \"{key}_rad_s\"\n"))
        .concat();
    map += "[channel.gear]\nname = \"gear\"\n[channel.target_gear]\nname = \"target_gear\"\n[channel.lock_up_applied]\nname = \"lock_up_applied\"\n";
    map += "[channel.engine_torque]\nname = \"reported_engine_torque_n_m\"\n";
    let entries = elements
        .iter()
        .map(|name| format!("[channel.element_{name}_pressure_command]\nname = \"P_cmd_{name}\"\nunit = \"bar\"\n"));
    map += &entries.collect::<String>();
    let path = folder.write("map.toml", &map);
    said(&estimate(&folder, "own.csv", &["--map", &path, "-o", &folder.path("mapped.csv")]));
    assert!(apart(&folder, ["currents.csv", "mapped.csv"]) < 0.1);
    // Wrong units, and two commands of one valve.
    let path = folder.write("wrong.toml", map.replacen("unit = \"bar\"", "unit = \"Pa\"", 1));
    let error = refused(&estimate(&folder, "own.csv", &["--map", &path, "-o", &folder.path("no.csv")]));
    assert!(error.contains("_pressure_command cannot be in Pa"), "{error}");
    folder.write("wrong.csv", bar.replacen("_pressure_command_bar", "_pressure_command_pa", 1));
    let error = refused(&estimate(&folder, "wrong.csv", &["-o", &folder.path("no.csv")]));
    assert!(error.contains("_pressure_command cannot be in Pa"), "{error}");
    folder.write("wrong.csv", bar.replacen("_pressure_command_bar", "_pressure_command_mpa", 1));
    let error = refused(&estimate(&folder, "wrong.csv", &["-o", &folder.path("no.csv")]));
    assert!(error.contains("were refused: its valve cannot have them\nhint: check unit, scale and sign"), "{error}");
    let both = format!("{map}[channel.element_{}_current]\nname = \"engine_speed_rad_s\"\nunit = \"A\"\n", elements[0]);
    let path = folder.write("both.toml", both);
    let error = refused(&estimate(&folder, "own.csv", &["--map", &path, "-o", &folder.path("no.csv")]));
    assert!(error.contains("which are commands of one valve\nhint: leave element_"), "{error}");
    assert!(!folder.names().iter().any(|name| name.starts_with("no")));
}
