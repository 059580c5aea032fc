//! Cars with any gearbox: demo, bench and estimate.

use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, stderr, wetclutch};

/// Two upshifts under power and one coasting downshift.
const DRIVE: &str = "name = \"short\"\n[[segment]]\nduration_s = 14\nthrottle = 0.3\n[[segment]]\nduration_s = 10\nthrottle = 0\nbrake = 0.1\n";

fn vehicle(name: &str) -> String {
    format!("{ROOT}vehicles/{name}.toml")
}

/// A folder with the signals of a simulated drive of the four-speed car.
pub(super) fn simulated(name: &str) -> Folder {
    of_drive(name, DRIVE)
}

/// The same drive twice.
pub(super) fn simulated_twice(name: &str) -> Folder {
    of_drive(name, &DRIVE.replacen("[[", "repetitions = 2\n[[", 1))
}

fn of_drive(name: &str, drive: &str) -> Folder {
    let folder = Folder::new(name);
    let drive = folder.write("drive.toml", drive);
    let (car, out) = (vehicle("four_speed"), folder.path("sim"));
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &out]));
    folder
}

pub(super) fn estimate(folder: &Folder, log: &str, more: &[&str]) -> std::process::Output {
    let (log, car) = (folder.path(log), vehicle("four_speed"));
    wetclutch(&[&["estimate", &log, "--vehicle", &car], more].concat())
}

/// The cells of a column.
pub(super) fn column(text: &str, name: &str) -> Vec<String> {
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let at = names.iter().position(|other| *other == name).unwrap_or_else(|| panic!("{name}: {names:?}"));
    text.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().to_owned()).collect()
}

pub(super) fn numbers(text: &str, name: &str) -> Vec<f64> {
    column(text, name).iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
}

#[test]
fn the_demo_of_a_car_drives_through_all_gears_and_shows_every_shift() {
    let folder = Folder::new("demo-car");
    let run = |name: &str, seed: &str| {
        let (car, out) = (vehicle("four_speed"), folder.path(name));
        printed(&wetclutch(&["demo", "--vehicle", &car, "--seed", seed, "-o", &out]))
    };
    let text = run("one", "1");
    assert!(text.contains("12 of 12 shifts were completed") && text.contains("report.html"), "{text}");
    let shifts = folder.read("one/shifts.csv");
    let gears: Vec<String> =
        column(&shifts, "from_gear").iter().zip(column(&shifts, "to_gear")).map(|(a, b)| format!("{a}-{b}")).collect();
    let up_and_down = ["1-2", "2-3", "3-4", "4-3", "3-2", "2-1"];
    assert_eq!(gears, [up_and_down, up_and_down].concat());
    for kind in ["power-on upshift", "coast downshift", "power-off upshift", "power-on downshift"] {
        assert_eq!(column(&shifts, "kind").iter().filter(|cell| *cell == kind).count(), 3, "{kind}");
    }
    assert!(numbers(&shifts, "inside_range").iter().all(|&fraction| fraction == 1.0), "{shifts}");
    // In most shifts the filter is better than the valve model alone.
    let [filter, valve] =
        ["rms_n_m", "open_loop_rms_n_m"].map(|what| numbers(&shifts, &format!("inertia_phase_controlling_{what}")));
    assert!(filter.iter().zip(&valve).filter(|(filter, valve)| filter < valve).count() >= 8, "{filter:?} {valve:?}");
    let page = folder.read("one/report.html");
    assert_eq!(page.matches("<figure>").count(), 13);
    for score in ["rating", "response s", "torque hole"] {
        assert!(page.contains(&format!("\">{score}</th>")), "{score}");
    }
    assert!(
        numbers(&shifts, "rating").iter().all(|rating| page.contains(&format!("<td>{rating:.1}</td>"))),
        "{shifts}"
    );
    assert!(!page.contains("src=") && !page.contains("@import") && page.trim_end().ends_with("</html>"));
    run("again", "1");
    run("other", "2");
    for name in ["report.html", "shifts.csv", "drive.csv"] {
        assert!(folder.read(&format!("one/{name}")) == folder.read(&format!("again/{name}")), "{name}");
        assert!(folder.read(&format!("one/{name}")) != folder.read(&format!("other/{name}")), "{name}");
    }
}

#[test]
fn a_drive_file_can_be_driven_by_the_demo() {
    let folder = Folder::new("demo-drive");
    let (drive, car, out) = (folder.write("drive.toml", DRIVE), vehicle("four_speed"), folder.path("out"));
    let text = printed(&wetclutch(&["demo", "--vehicle", &car, "--drive", &drive, "-o", &out]));
    assert!(text.contains("1-2    power-on upshift"), "{text}");
    let none = folder.write("none.toml", "name = \"n\"\n[[segment]]\nduration_s = 2\nthrottle = 0.1\n");
    let text = printed(&wetclutch(&["demo", "--vehicle", &car, "--drive", &none, "-o", &out]));
    assert!(text.contains("The drive has no shift."), "{text}");
}

#[test]
fn the_bench_of_a_gearbox_has_every_shift_in_every_kind_on_any_number_of_threads() {
    let folder = Folder::new("bench-car");
    let run = |name: &str, more: &[&str]| {
        let (car, out) = (vehicle("four_speed"), folder.path(name));
        wetclutch(&[&["bench", "--vehicle", &car, "--draws", "2", "-o", &out], more].concat())
    };
    let text = printed(&run("one", &["--threads", "1"]));
    assert!(text.contains("outside their guaranteed ranges: 0 of "), "{text}");
    let rows = |text: &str| text.lines().filter(|line| line.contains("upshift") || line.contains("downshift")).count();
    // Twelve shifts, and the kinds by class.
    assert!(rows(&text) > 12, "{text}");
    let table = folder.read("one/bench.csv");
    assert_eq!(table.lines().count(), 13);
    assert!(numbers(&table, "failed_runs").iter().all(|&failed| failed == 0.0));
    let json = printed(&run("three", &["--threads", "3", "--json"]));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let objects = json["shifts"].as_array().unwrap();
    let name = "inertia_phase_controlling_torque_rms_n_m";
    let in_json: Vec<f64> = objects.iter().map(|object| object[name].as_f64().unwrap()).collect();
    assert_eq!(in_json, numbers(&table, name));
    for name in ["bench.csv", "bench.html"] {
        assert!(folder.read(&format!("one/{name}")) == folder.read(&format!("three/{name}")), "{name}");
    }
    let page = folder.read("one/bench.html");
    assert!(page.find("<div class=\"figure\">").unwrap() < page.find("<table").unwrap());
    assert!(page.contains("<td>12</td><td>4-3</td>") && !page.contains("<td>13</td>"));
    printed(&run("other", &["--seed", "9"]));
    assert!(folder.read("other/bench.csv") != table);
}

/// Every element has the range of its pressure in every row; in a shift it is that of the clutch.
fn ranges_of_elements(estimates: &str) {
    let header = estimates.lines().next().unwrap();
    let elements: Vec<&str> =
        header.split(',').filter_map(|name| name.strip_suffix("_valve_model_pressure_pa")).collect();
    let elements: Vec<&str> = elements.into_iter().filter(|name| name.starts_with("element_")).collect();
    assert!(elements.len() >= 4, "{header}");
    for element in elements {
        let [valve, minimum, maximum] = ["valve_model_pressure_pa", "pressure_least_pa", "pressure_greatest_pa"]
            .map(|name| numbers(estimates, &format!("{element}_{name}")));
        for row in 0..valve.len() {
            // Once the first command has had its time.
            let valve_pa = if row > 100 { valve[row] } else { minimum[row] };
            assert!(minimum[row] <= valve_pa && valve_pa <= maximum[row], "{element} {row}");
        }
        for clutch in ["offgoing", "oncoming"] {
            let own = column(estimates, clutch);
            let [in_shift_min, in_shift_max] = ["pressure_least_pa", "pressure_greatest_pa"]
                .map(|name| numbers(estimates, &format!("{clutch}_{name}")));
            let rows = (0..own.len()).filter(|&row| format!("element_{}", own[row].to_lowercase()) == element);
            for row in rows {
                assert_eq!([minimum[row], maximum[row]], [in_shift_min[row], in_shift_max[row]], "{element} {row}");
            }
        }
    }
}

#[test]
fn an_estimate_of_a_drive_has_both_clutches_of_every_shift_and_does_not_read_the_truth() {
    let folder = simulated("estimate-car");
    let text = said(&estimate(&folder, "sim/short.csv", &["-o", &folder.path("whole.csv")]));
    assert!(text.contains("pressures and torques of the shift clutches are within"), "{text}");
    said(&estimate(&folder, "sim/short_measured.csv", &["-o", &folder.path("measured.csv")]));
    assert!(folder.read("whole.csv") == folder.read("measured.csv"));
    let (estimates, truth) = (folder.read("whole.csv"), folder.read("sim/short.csv"));
    for clutch in ["offgoing", "oncoming"] {
        assert_eq!(column(&estimates, clutch), column(&truth, clutch), "{clutch}");
        let [found, minimum, maximum] = ["pressure_estimate_pa", "pressure_least_pa", "pressure_greatest_pa"]
            .map(|name| numbers(&estimates, &format!("{clutch}_{name}")));
        let [torque_min, torque_max] =
            ["torque_least_n_m", "torque_greatest_n_m"].map(|name| numbers(&estimates, &format!("{clutch}_{name}")));
        let torque = numbers(&truth, &format!("{clutch}_torque_n_m"));
        let truth = numbers(&truth, &format!("{clutch}_pressure_pa"));
        let rows = (0..truth.len()).filter(|&row| truth[row].is_finite());
        assert!(rows.clone().count() > 150);
        for row in rows {
            assert!(minimum[row] - 1.0 <= truth[row] && truth[row] <= maximum[row] + 1.0, "{clutch} {row}");
            assert!(0.0 <= minimum[row] && maximum[row] < 2e6, "{clutch} {row}: {} {}", minimum[row], maximum[row]);
            // Beside the drag of an open clutch.
            let within = torque_min[row] - 1.2 <= torque[row] && torque[row] <= torque_max[row] + 1.2;
            assert!(within, "{clutch} {row}: {}", torque[row]);
            assert!((found[row] - truth[row]).abs() < 0.2e6, "{clutch} {row}: {} {}", found[row], truth[row]);
        }
    }
    ranges_of_elements(&estimates);
    // Of a clutch of a shift it is said whether the speeds show its torque; in a gear there is none.
    for clutch in ["offgoing", "oncoming"] {
        let [names, hidden] = ["", "_hidden"].map(|end| column(&estimates, &format!("{clutch}{end}")));
        assert!(names.iter().zip(&hidden).all(|(name, hidden)| name.is_empty() == hidden.is_empty()), "{clutch}");
        let count = |cell: &str| hidden.iter().filter(|hidden| *hidden == cell).count();
        assert!(count("0") > 100 && count("1") > 3, "{clutch}: {} {}", count("0"), count("1"));
        assert_eq!(count("0") + count("1") + count(""), hidden.len());
    }
    let shifts = folder.read("whole_shifts.csv");
    assert!(shifts.lines().count() >= 4, "{shifts}");
    assert!(numbers(&shifts, "complete_s").iter().all(|time_s| (0.4..2.0).contains(time_s)), "{shifts}");
    let json: Vec<serde_json::Value> = serde_json::from_str(&folder.read("whole_shifts.json")).unwrap();
    assert_eq!(json.len(), shifts.lines().count() - 1);
    assert!(folder.read("whole_report.html").contains("Kinds of shift"));
    let page = folder.read("measured_report.html");
    assert!(!page.contains("Kinds of shift") && !page.contains(">true<") && page.contains("<figure>"));
    said(&estimate(&folder, "sim/short.csv", &["-o", &folder.path("few.csv"), "--columns", "health,gear"]));
    assert_eq!(folder.read("few.csv").lines().next(), Some("time_s,health,gear"));
    // The readings too, where they are asked for; a table with them is an estimate that may be replaced.
    let log = folder.read("sim/short.csv");
    let is_command = |name: &&str| name.starts_with("element_") && name.ends_with("_current_a");
    let command = log.lines().next().unwrap().split(',').find(is_command).unwrap();
    let measured = ["turbine_speed_rad_s", command, "reported_engine_torque_n_m"];
    for _ in 0..2 {
        let columns = format!("health,{}", measured.join(","));
        said(&estimate(&folder, "sim/short.csv", &["-o", &folder.path("with.csv"), "--columns", &columns]));
    }
    let with = folder.read("with.csv");
    for name in measured {
        assert!(column(&with, name) == column(&log, name) && column(&with, name).len() > 1000, "{name}");
    }
    for name in ["e.parquet", "e.mf4"] {
        said(&estimate(&folder, "sim/short.csv", &["-o", &folder.path(name)]));
        assert!(std::fs::metadata(folder.path(name)).unwrap().len() > 10_000, "{name}");
        // The gears can be plotted: they are there as numbers, too.
        let channels = printed(&wetclutch(&["inspect", &folder.path(name)]));
        let numbers = channels.lines().find(|line| line.trim_start().starts_with("gear_number "));
        assert!(numbers.is_some_and(|line| line.contains('4')), "{channels}");
    }
}

#[test]
fn lost_repeated_and_late_readings_of_a_drive_are_no_error() {
    let folder = simulated("lost-car");
    let text = folder.read("sim/short_measured.csv");
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let at = |name: &str| names.iter().position(|other| *other == name).unwrap();
    let lost = |row: usize, cell: usize| match row % 7 {
        0 => cell == at("turbine_speed_rad_s"),
        1 => cell == at("engine_speed_rad_s"),
        2 => cell == at("element_int_current_a") || cell == at("gear"),
        // A tenth of a second without any speed.
        _ => (600..610).contains(&row) && (1..=4).contains(&cell),
    };
    let mut log = format!("{}\n", names.join(","));
    for (row, line) in text.lines().skip(1).enumerate() {
        let cells = line.split(',').enumerate().map(|(cell, value)| match value {
            _ if row > 0 && lost(row, cell) => String::new(),
            // As some loggers write a gear.
            gear if cell == at("gear") => format!("{gear}.0"),
            value => value.to_owned(),
        });
        log += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    folder.write("lost.csv", log);
    said(&estimate(&folder, "lost.csv", &["-o", &folder.path("lost_out.csv")]));
    let shifts = folder.read("lost_out_shifts.csv");
    assert!(shifts.lines().count() >= 4, "{shifts}");
    let estimates = folder.read("lost_out.csv");
    assert_eq!(estimates.lines().count(), text.lines().count());
    assert!(!estimates.contains("NaN") && !estimates.contains("inf"));
    // What became of each reading is said in every row.
    let absent = |name: &str, rest: usize| {
        let readings = column(&estimates, name);
        let rows =
            readings.iter().enumerate().filter(|(row, _)| *row > 0 && row % 7 == rest && !(600..650).contains(row));
        rows.map(|(_, reading)| reading == "absent").collect::<Vec<_>>()
    };
    for (name, rest) in [("turbine_reading", 0), ("engine_reading", 1), ("element_int_command_reading", 2)] {
        assert!(absent(name, rest).iter().all(|absent| *absent), "{name}");
        assert!(absent(name, 4).iter().all(|absent| !absent), "{name}");
    }
    assert!(column(&estimates, "wheel_reading").iter().filter(|reading| *reading == "good").count() > 1000);
    // Of the clutches of a shift, that of their elements; none in a gear.
    for role in ["offgoing", "oncoming"] {
        let (elements, readings) = (column(&estimates, role), column(&estimates, &format!("{role}_command_reading")));
        for (row, (element, reading)) in elements.iter().zip(&readings).enumerate() {
            assert_eq!(element.is_empty(), reading.is_empty(), "{role} in row {row}");
        }
        assert!(readings.iter().any(|reading| reading == "good"));
    }
}

#[test]
fn a_drive_without_a_wheel_speed_has_not_lost_it() {
    let folder = simulated("no-wheel-car");
    let text = folder.read("sim/short_measured.csv");
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let at = names.iter().position(|name| *name == "wheel_speed_rad_s").unwrap();
    let without = |line: &str| {
        let cells: Vec<&str> =
            line.split(',').enumerate().filter(|(cell, _)| *cell != at).map(|(_, cell)| cell).collect();
        cells.join(",") + "\n"
    };
    folder.write("log.csv", text.lines().map(without).collect::<String>());
    // It stays away from the middle on.
    let half = text.lines().count() / 2;
    let stays_away = |(row, line): (usize, &str)| match row < half {
        true => format!("{line}\n"),
        false => {
            line.split(',')
                .enumerate()
                .map(|(cell, value)| if cell == at { "" } else { value })
                .collect::<Vec<_>>()
                .join(",")
                + "\n"
        }
    };
    folder.write("away.csv", text.lines().enumerate().map(stays_away).collect::<String>());
    for (log, is_lost) in [("log.csv", false), ("away.csv", true)] {
        said(&estimate(&folder, log, &["-o", &folder.path("out.csv")]));
        assert_eq!(folder.read("out.csv").contains("channel_lost"), is_lost, "{log}");
        assert_eq!(folder.read("out_shifts.csv").contains("lost"), is_lost, "{log}");
    }
}

/// A table with the cells of a column changed.
pub(super) fn with_column(table: &str, column: &str, mut change: impl FnMut(&str) -> String) -> String {
    let at = table.lines().next().unwrap().split(',').position(|name| name == column).unwrap();
    let changed = |(row, line): (usize, &str)| {
        let cells = line.split(',').enumerate();
        let cells = cells.map(|(cell, value)| if row > 0 && cell == at { change(value) } else { value.to_owned() });
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    table.lines().enumerate().map(changed).collect()
}

#[test]
fn commands_for_a_gearbox_say_so_where_a_file_has_none() {
    for command in [vec!["demo", "--vehicle", VEHICLE], vec!["bench", "--vehicle", VEHICLE]] {
        let error = refused(&wetclutch(&command));
        assert!(error.contains("this vehicle file describes one shift") && error.contains("hint: "), "{error}");
    }
    let both = refused(&wetclutch(&["bench", EXPERIMENT, "--vehicle", VEHICLE]));
    assert!(both.contains("cannot be used with"), "{both}");
}

#[test]
fn a_log_may_be_in_neutral() {
    let folder = simulated("neutral-car");
    let text = folder.read("sim/short_measured.csv");
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let gears = ["gear", "target_gear"].map(|name| names.iter().position(|other| *other == name).unwrap());
    let mut log = format!("{}\n", names.join(","));
    // Selected in the last second, while the car rolls.
    for (row, line) in text.lines().skip(1).enumerate() {
        let is_neutral = row >= 2300;
        let cells = line.split(',').enumerate();
        let cells = cells.map(|(cell, value)| if is_neutral && gears.contains(&cell) { "N" } else { value });
        log += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    folder.write("log.csv", log);
    said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    let estimates = folder.read("out.csv");
    let [health, phase] = ["health", "phase"].map(|name| column(&estimates, name));
    assert!(health[2300..].iter().all(|health| health != "good") && phase[2300..].iter().all(String::is_empty));
    assert!(health[2200..2300].iter().any(|health| health == "good"));
}

#[test]
fn a_reading_that_is_refused_is_no_flare() {
    let folder = simulated("spike-car");
    let text = folder.read("sim/short_measured.csv");
    let [gear, target] = ["gear", "target_gear"].map(|name| column(&text, name));
    let begin = (0..gear.len()).find(|&row| gear[row] != target[row]).unwrap();
    for name in ["turbine_speed_rad_s", "output_speed_rad_s"] {
        for spike in ["1e300", "-1e300", "3000"] {
            let mut row = 0;
            let spoilt = with_column(&text, name, |value| {
                row += 1;
                if row == begin + 30 { spike.to_owned() } else { value.to_owned() }
            });
            folder.write("log.csv", spoilt);
            said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
            let shifts = folder.read("out_shifts.csv");
            for column in ["flare_rad_s", "past_synchronous_rad_s"] {
                let values = numbers(&shifts, column);
                assert!(values.iter().all(|rad_s| *rad_s < 10.0), "{name} {spike} {column}: {values:?}");
            }
            assert!(folder.read("out.csv").contains("reading_refused"), "{name} {spike}");
        }
    }
}

/// The gearbox of a shipped file with more of the same brake.
fn with_brakes(more: usize) -> String {
    let gearbox = std::fs::read_to_string(format!("{ROOT}gearboxes/8hp.toml")).unwrap();
    let brake = |i: usize| {
        format!(
            "\n[[element]]\nname = \"X{i}\"\nkind = \"brake\"\ninput = \"housing\"\noutput = \"ring1\"\npack = {{ friction_faces = 6, \
             mean_radius_m = 0.095, piston_area_m2 = 0.014, return_spring_n = 1500, friction_coefficient = 0.12 }}\n"
        )
    };
    gearbox + &(0..more).map(brake).collect::<String>()
}

#[test]
fn check_of_a_car_that_cannot_be_simulated_goes_on_and_says_why() {
    let folder = Folder::new("unsimulated");
    for (brakes, why) in [
        (2, "the gearbox has 7 clutches and brakes, and a simulated car has room for 6"),
        (4, "the gearbox has 9 clutches and brakes, and the filter has room for 8"),
    ] {
        folder.write("many.toml", with_brakes(brakes));
        let car = folder.write("car.toml", "name = \"x\"\ngearbox = \"many.toml\"\n");
        let text = printed(&wetclutch(&["check", &car]));
        assert!(text.contains("their influence is not known: ") && text.contains(why), "{text}");
        // The defaults are listed nevertheless.
        assert!(text.contains("vehicle.mass_kg = 1500"), "{text}");
        assert!(refused(&wetclutch(&["sensitivity", &car])).contains(why));
    }
}

#[test]
fn the_sensors_of_check_and_sensitivity_can_be_those_of_a_file() {
    let folder = Folder::new("own-sensors");
    let bench = std::fs::read_to_string(format!("{ROOT}experiments/bench.toml")).unwrap();
    let sensors = folder.write("sensors.toml", sensors_of(&bench, "noise_rad_s", "1.0"));
    let same = folder.write("same.toml", &bench);
    // A car with few shifts.
    folder.write("two_speed.toml", std::fs::read_to_string(format!("{ROOT}gearboxes/two_speed.toml")).unwrap());
    let car = folder.write("car.toml", "name = \"x\"\ngearbox = \"two_speed.toml\"\n");
    let check = |more: &[&str]| printed(&wetclutch(&[&["check", &car, "--all"], more].concat()));
    let of_bench = check(&[]);
    assert_eq!(of_bench, check(&["--sensors", &same]));
    assert_ne!(of_bench, check(&["--sensors", &sensors]));
    let shifts = |more: &[&str]| printed(&wetclutch(&[&["sensitivity", &car], more].concat()));
    assert_ne!(shifts(&[]), shifts(&["--sensors", &sensors]));
    for command in ["check", "sensitivity"] {
        let output = wetclutch(&[command, VEHICLE, "--sensors", &sensors]);
        let warning = "warning: --sensors has no effect: it is for the vehicle file of a car with a gearbox";
        assert!(output.status.success() && stderr(&output).contains(warning), "{}", stderr(&output));
    }
}

/// A file with another value of all keys of this name.
fn sensors_of(text: &str, key: &str, value: &str) -> String {
    let line = |line: &str| match line.split_once(" = ") {
        Some((name, _)) if name == key => format!("{key} = {value}\n"),
        _ => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

#[test]
fn a_gearbox_whose_first_gear_is_held_by_a_one_way_clutch_is_driven_through_all_gears() {
    let folder = Folder::new("one-way");
    let car = vehicle("four_speed_one_way");
    let text = printed(&wetclutch(&["demo", "--vehicle", &car, "-o", &folder.path("out")]));
    assert!(text.contains("12 of 12 shifts were completed"), "{text}");
    assert_eq!(column(&folder.read("out/shifts.csv"), "from_gear")[..4], ["1", "2", "3", "4"]);
    assert!(!text.contains("NaN"), "{text}");
    let page = folder.read("out/report.html");
    assert!(page.contains("torque of F1,") && page.contains("pressure of INT,") && !page.contains("pressure of F1"));
    // The gear for engine braking follows in a list of shifts, and coasting in 1st gear is said to be that.
    let drive = "name = \"short\"\nstart = { gear = \"1\", vehicle_m_s = 9 }\n\
                 segment = [{ duration_s = 2, throttle = 0.2 }, { duration_s = 8, throttle = 0 }, { duration_s = 4, throttle = 0.2 }]\n\
                 shift = [{ time_s = 5, gear = \"L\" }, { time_s = 7, gear = \"1\" }, { time_s = 12, gear = \"2\" }]\n";
    let drive = folder.write("drive.toml", drive);
    printed(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
    let text = said(&wetclutch(&[
        "estimate",
        &folder.path("sim/short_measured.csv"),
        "--vehicle",
        &car,
        "-o",
        &folder.path("e.csv"),
    ]));
    assert!(
        text.contains("3 of 3 shifts were completed")
            && text.contains("2 shifts are not estimated: the filter has no equations"),
        "{text}"
    );
    let estimate = folder.read("e.csv");
    let (health, offgoing) = (column(&estimate, "health"), column(&estimate, "offgoing"));
    let said = |word: &str| health.iter().filter(|health| *health == word).count();
    assert!(said("one_way_overruns") > 300 && said("held_clutch_slips") == 0 && said("clutch_open") == 0);
    // Between 1 and L, gears of one ratio, there are no equations.
    assert!(said("shift_not_modelled") > 20 && said("speeds_rejected") == 0);
    // Its torque is estimated, and it has no pressure.
    let (torque, pressure) =
        (column(&estimate, "offgoing_torque_estimate_n_m"), column(&estimate, "offgoing_pressure_estimate_pa"));
    let rows: Vec<usize> = (0..offgoing.len()).filter(|&row| offgoing[row] == "F1").collect();
    assert!(rows.len() > 30 && rows.iter().all(|&row| !torque[row].is_empty() && pressure[row].is_empty()));
}

/// Friction and gain that are stated as known leave the filter errors of map and kiss point.
#[test]
fn a_car_whose_friction_and_valve_gains_are_known_exactly_is_estimated() {
    let folder = simulated("known-exactly");
    let mut text = std::fs::read_to_string(vehicle("four_speed")).unwrap().replace("../", ROOT);
    for name in ["FWD", "DIR", "REV", "INT", "LR"] {
        text +=
            &format!("\n[clutch.{name}.error_bounds]\nfriction_factor = [1.0, 1.0]\nvalve_gain_factor = [1.0, 1.0]\n");
    }
    let (known, log, out) =
        (folder.write("known.toml", text), folder.path("sim/short_measured.csv"), folder.path("o.csv"));
    said(&wetclutch(&["estimate", &log, "--vehicle", &known, "-o", &out]));
    let table = folder.read("o.csv");
    let health = column(&table, "health");
    assert!(health.iter().all(|health| health != "restarted"), "{health:?}");
    let in_shift = column(&table, "offgoing_torque_estimate_n_m").iter().filter(|cell| !cell.is_empty()).count();
    for of in ["torque_deviation_n_m", "pressure_deviation_pa"] {
        let known = column(&table, &format!("oncoming_{of}")).iter().filter(|cell| !cell.is_empty()).count();
        assert!(known == in_shift && known > 100, "{of}: {known} of {in_shift}");
    }
}
