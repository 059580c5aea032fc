//! What is said of a log of a drive that is not as it should be: channels, rows, gears.

use crate::any_car::{column, estimate, numbers, simulated, with_column};
use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, refused, said, stderr, stdout, wetclutch};

#[test]
fn a_log_that_does_not_fit_the_car_is_refused_and_nothing_is_written() {
    let folder = simulated("wrong-car");
    let text = folder.read("sim/short_measured.csv");
    let first = text.lines().take(2).collect::<Vec<_>>().join("\n") + "\n";
    let cases = [
        (text.replacen("turbine_speed_rad_s", "turbine_speed_rpm", 1), "turbine_speed cannot be in rpm: "),
        (text.replacen("element_int_current_a", "element_int_current_ma", 1), "element_int_current cannot be in mA: "),
        (with_column(&text, "turbine_speed_rad_s", |_| String::new()), "turbine_speed has no value in any of"),
        (
            with_column(&text, "output_speed_rad_s", |value| format!("-{value}")),
            "output_speed is negative and turbine_speed",
        ),
        (
            with_column(&text, "element_int_current_a", |value| format!("{value}e3")),
            "element_int_current cannot be in A: ",
        ),
        (text.replacen("output_speed_rad_s", "other_rad_s", 1), "there is no column `output_speed_rad_s`"),
        (text.replacen("target_gear", "goal", 1), "there is no column `target_gear`"),
        (
            first.replacen(",1,1,", ",9,1,", 1),
            "log.csv: 1 of 1 samples of gear are no gear of this gearbox (9) and are not used\nhint: its gears are",
        ),
        (first.replacen(",1,1,", ",,1,", 1), "log.csv: the gear is missing in all rows\nhint: its gears are"),
        (String::new(), "the file is empty"),
    ];
    for (log, words) in cases {
        folder.write("log.csv", log);
        let error = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        assert!(error.contains(words), "{words}: {error}");
        assert!(!folder.names().iter().any(|name| name.starts_with("out")), "{words}");
    }
    // One row is a log, without shifts.
    folder.write("log.csv", first);
    said(&estimate(&folder, "log.csv", &["-o", &folder.path("row.csv")]));
    assert_eq!(folder.read("row.csv").lines().count(), 2);
    let plain = stdout(&estimate(&folder, "log.csv", &[]));
    for option in [["--observer", "rigid"], ["--method", "iss"], ["--observer", "gearbox"]] {
        let output = estimate(&folder, "log.csv", &option);
        let warning = format!("warning: {} has no effect: a car with a gearbox has the gearbox filter", option[0]);
        assert!(stderr(&output).contains(&warning), "{}", stderr(&output));
        assert_eq!(stdout(&output), plain);
    }
}

/// A log with the names of two columns swapped.
fn swapped(text: &str, [one, other]: [&str; 2]) -> String {
    let (names, rows) = text.split_once('\n').unwrap();
    let names = names.split(',').map(|name| match name {
        _ if name == one => other,
        _ if name == other => one,
        _ => name,
    });
    names.collect::<Vec<_>>().join(",") + "\n" + rows
}

/// When the drive is in second gear for the first time, s.
fn second_gear_s(text: &str) -> f64 {
    let in_second = column(text, "gear")
        .iter()
        .zip(column(text, "target_gear"))
        .position(|(gear, target)| gear == "2" && target == "2");
    numbers(text, "time_s")[in_second.unwrap()]
}

#[test]
fn channels_that_contradict_the_gear_are_named() {
    let folder = simulated("swapped-car");
    let text = folder.read("sim/short_measured.csv");
    let warnings = |log: &str| {
        folder.write("log.csv", log);
        let said = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        said.lines().filter(|line| line.starts_with("warning")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(warnings(&text), Vec::<String>::new());
    // INT holds the second gear, DIR the third.
    let commands = warnings(&swapped(&text, ["element_int_current_a", "element_dir_current_a"]));
    assert!(commands.iter().any(|line| line.contains("the channels of INT and DIR may be swapped")), "{commands:?}");
    assert!(folder.read("out_report.html").contains("the channels of INT and DIR may be swapped"));
    // A command that freezes while it holds the second gear.
    let (mut row, times) = (0, numbers(&text, "time_s"));
    let begin = second_gear_s(&text);
    let mut kept = String::new();
    let frozen = with_column(&text, "element_int_current_a", |cell| {
        row += 1;
        if times[row - 1] < begin + 0.5 {
            kept = cell.to_owned()
        }
        kept.clone()
    });
    let frozen = warnings(&frozen);
    assert!(
        frozen.iter().any(|line| line.contains("that apply or release INT, its command does not change")),
        "{frozen:?}"
    );
    assert!(!frozen.iter().any(|line| line.contains("release DIR, its command")), "{frozen:?}");
    folder.write("log.csv", swapped(&text, ["engine_speed_rad_s", "turbine_speed_rad_s"]));
    let speeds = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(speeds.contains("warning: engine_speed and turbine_speed may be swapped"), "{speeds}");
}

#[test]
fn a_hole_in_a_shift_ends_it_and_is_said() {
    let folder = simulated("hole-car");
    let text = folder.read("sim/short_measured.csv");
    let [time, gear, target] = ["time_s", "gear", "target_gear"].map(|name| column(&text, name));
    let begin = (0..gear.len()).find(|&row| gear[row] != target[row]).unwrap();
    let end = (begin..gear.len()).find(|&row| gear[row] == target[row]).unwrap();
    // From the middle of the first shift on, everything is a minute later.
    let from = time[(begin + end) / 2].parse::<f64>().unwrap();
    let later = with_column(&text, "time_s", |value| {
        let time_s: f64 = value.parse().unwrap();
        if time_s > from { format!("{}", time_s + 60.0) } else { value.to_owned() }
    });
    folder.write("log.csv", later);
    let said = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(said.contains("warning: 1 shifts have a hole of more than 0.5 s in the recording"), "{said}");
    let shifts = folder.read("out_shifts.csv");
    assert_eq!(column(&shifts, "complete_s")[0], "");
    assert!(numbers(&shifts, "complete_s")[1..].iter().all(|time_s| *time_s < 3.0), "{shifts}");
    // The rest of the shift after the hole is no other shift.
    assert_eq!(column(&shifts, "from_gear"), ["1", "2", "3", "4", "3"]);
}

#[test]
fn a_log_with_too_few_rows_is_told_once_and_its_rows_are_no_holes() {
    let folder = simulated("slow-car");
    let text = folder.read("sim/short_measured.csv");
    let (names, rows) = text.split_once('\n').unwrap();
    for (every, is_slow) in [(50, true), (20, true), (5, false)] {
        let thinned: Vec<&str> = std::iter::once(names).chain(rows.lines().step_by(every)).collect();
        folder.write("log.csv", thinned.join("\n") + "\n");
        let said = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        let slow = said.matches("too long for the estimate of a shift").count();
        assert_eq!(slow, usize::from(is_slow), "{every}: {said}");
        assert!(!said.contains("have a hole"), "{every}: {said}");
    }
}

#[test]
fn rows_of_a_drive_out_of_their_order_are_left_out_and_counted() {
    let folder = simulated("order-car");
    let text = folder.read("sim/short_measured.csv");
    let mut lines: Vec<&str> = text.lines().collect();
    lines.insert(500, lines[499]);
    lines.swap(800, 801);
    folder.write("log.csv", lines.join("\n") + "\n");
    let said = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(said.contains("1 of 2401 rows have the time of the row before and are not used"), "{said}");
    assert!(said.contains("1 of 2401 rows have a time before that of the row before"), "{said}");
    // A time in ns since 1970 is not one in seconds.
    let late = with_column(&text, "time_s", |value| format!("{:.0}", 1.7e18 + 1e9 * value.parse::<f64>().unwrap()));
    folder.write("log.csv", late);
    let error = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("ns.csv")]));
    assert!(error.contains("if the time is in ns, ") && error.contains("`unit = \"ns\"` under [time]"), "{error}");
}

#[test]
fn a_table_of_a_drive_with_another_delimiter_gets_a_hint() {
    let folder = simulated("semicolon");
    let table = folder.read("sim/short_measured.csv").replace(',', ";");
    folder.write("semicolon.csv", table);
    let text = refused(&estimate(&folder, "semicolon.csv", &[]));
    assert!(text.contains("separated by `;`") && text.contains("--map map.toml"), "{text}");
}

/// The first row of a table, and of the others every so many.
fn every(table: &str, nth: usize) -> String {
    let rows = table.lines().enumerate().filter(|(row, _)| *row == 0 || (row - 1).is_multiple_of(nth));
    rows.map(|(_, line)| format!("{line}\n")).collect()
}

#[test]
fn phases_last_as_long_and_ranges_hold_whatever_the_time_between_two_rows() {
    let folder = simulated("rates-car");
    let text = folder.read("sim/short.csv");
    let mut lengths_s = Vec::new();
    for nth in [1, 2, 5, 10] {
        folder.write("log.csv", every(&text, nth));
        let text = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        let line = text.lines().find(|line| line.contains("pressures and torques of the shift clutches")).unwrap();
        let words: Vec<&str> = line.split(' ').collect();
        assert!(words[0] == words[2] && words[0] != "0", "{nth}: {line}");
        lengths_s.push(numbers(&folder.read("out_shifts.csv"), "inertia_phase_s"));
    }
    assert!(lengths_s[0].len() == 5 && lengths_s[0].iter().all(|length_s| *length_s > 0.2), "{lengths_s:?}");
    for (nth, found) in [(2, &lengths_s[1]), (5, &lengths_s[2])] {
        assert_eq!(found.len(), 5);
        for (whole, found) in lengths_s[0].iter().zip(found) {
            let rows_s = 0.01 * f64::from(nth);
            assert!((whole - found).abs() <= 2.0 * rows_s + 1e-9, "{nth}: {whole} {found}");
        }
    }
}

#[test]
fn a_gear_that_changes_without_a_target_is_told() {
    let folder = simulated("untold-car");
    let text = folder.read("sim/short_measured.csv");
    let gears = column(&text, "gear");
    let mut row = 0;
    let log = with_column(&text, "target_gear", |_| {
        row += 1;
        gears[row - 1].clone()
    });
    folder.write("log.csv", log);
    let told = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(told.contains(" times without a change of target_gear before"), "{told}");
    let whole = said(&estimate(&folder, "sim/short_measured.csv", &["-o", &folder.path("whole.csv")]));
    assert!(!whole.contains("without a target_gear") && !whole.contains("output_speed over wheel_speed"), "{whole}");
}

#[test]
fn a_wheel_speed_of_another_scale_is_told_or_refused() {
    let folder = simulated("wheels-car");
    let text = folder.read("sim/short_measured.csv");
    let scaled = |factor: f64| {
        with_column(&text, "wheel_speed_rad_s", |cell| {
            cell.parse::<f64>().map_or(String::new(), |speed| (factor * speed).to_string())
        })
    };
    folder.write("log.csv", scaled(0.96));
    let told = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(told.contains("output_speed over wheel_speed is") && told.contains("from the final ratio"), "{told}");
    for (factor, expected) in [(2.8, "output_speed over wheel_speed is"), (-1.0, "wheel_speed is negative")] {
        folder.write("log.csv", scaled(factor));
        let error = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("refused.csv")]));
        assert!(error.contains(expected) && error.contains("hint: "), "{factor}: {error}");
    }
    // Within a bound that the file states it is a scale that the filter learns.
    let car = std::fs::read_to_string(format!("{ROOT}vehicles/four_speed.toml")).unwrap();
    let car = car.replace("\"../gearboxes/", &format!("\"{ROOT}gearboxes/"));
    let wide = folder.write("wide.toml", car + "\n[error_bounds]\nwheel_scale_share = 0.2\n");
    for factor in [0.81, 0.85, 1.18] {
        let log = folder.write("log.csv", scaled(factor));
        let estimate =
            |vehicle: &str| wetclutch(&["estimate", &log, "--vehicle", vehicle, "-o", &folder.path("wide.csv")]);
        said(&estimate(&wide));
        assert_eq!(estimate(&format!("{ROOT}vehicles/four_speed.toml")).status.code(), Some(2));
    }
}

#[test]
fn a_drive_whose_last_line_is_cut_is_estimated_up_to_there() {
    let folder = simulated("cut-car");
    let text = folder.read("sim/short_measured.csv");
    let end = text[..text.len() / 2].rfind('\n').unwrap();
    folder.write("log.csv", &text[..end + 3]);
    let told = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(told.contains("the last line has no end"), "{told}");
    assert_eq!(folder.read("out.csv").lines().count(), text[..=end].lines().count());
}

/// A log without the speed of the wheels, whose output speed has another factor.
fn slow_output(text: &str, factor: f64) -> String {
    let slow = |value: &str| value.parse::<f64>().map_or(value.to_owned(), |value| format!("{}", factor * value));
    with_column(&text.replacen("wheel_speed_rad_s", "other", 1), "output_speed_rad_s", slow)
}

#[test]
fn a_drive_of_which_no_estimate_can_be_used_is_refused() {
    let folder = simulated("slow-output");
    let text = folder.read("sim/short_measured.csv");
    // In rad/s, and called rpm: the output is too slow for its own rows to count.
    folder.write("log.csv", slow_output(&text, 0.104_72));
    let error = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(error.contains("the turbine speed is not the output speed times the ratio of that gear"), "{error}");
    assert!(error.contains("check unit and scale of output_speed, which would fit with `scale` times"), "{error}");
    assert!(!folder.names().iter().any(|name| name.starts_with("out")));
    // Of a car without a converter the turbine turns at a standstill, too: there the health of the estimates tells.
    let (drive, car) = (folder.path("drive.toml"), format!("{ROOT}vehicles/dual_clutch.toml"));
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
    folder.write("log.csv", slow_output(&folder.read("sim/short_measured.csv"), 0.104_72));
    let error =
        refused(&wetclutch(&["estimate", &folder.path("log.csv"), "--vehicle", &car, "-o", &folder.path("out.csv")]));
    assert!(error.contains("with the car moving, can the estimate be used; most of them have"), "{error}");
    assert!(!folder.names().iter().any(|name| name.starts_with("out")));
}

/// The estimate of a log in which some rows of a column have another cell.
fn with_cells(
    folder: &Folder,
    text: &str,
    name: &str,
    cell: &str,
    rows: impl Fn(usize) -> bool,
) -> std::process::Output {
    let mut row = 0;
    let other = with_column(text, name, |value| {
        row += 1;
        if rows(row) { cell.to_owned() } else { value.to_owned() }
    });
    folder.write("log.csv", other);
    estimate(folder, "log.csv", &["-o", &folder.path("out.csv")])
}

#[test]
fn cells_that_are_no_numbers_are_counted_and_most_of_them_are_an_error() {
    let folder = simulated("no-numbers");
    let text = folder.read("sim/short_measured.csv");
    for (name, cell) in
        [("turbine_speed_rad_s", "garbage"), ("element_int_current_a", "inf"), ("reported_engine_torque_n_m", "n/a")]
    {
        let few = said(&with_cells(&folder, &text, name, cell, |row| row == 700));
        let note = format!("warning: 1 of 2400 samples of {name} are text or infinite, and are not used");
        assert!(few.contains(&note), "{few}");
        let maximum = refused(&with_cells(&folder, &text, name, cell, |row| row % 5 > 1));
        let note =
            format!("log.csv: 1440 of 2400 samples of {name} are text or infinite, and are not used\nhint: check");
        assert!(maximum.contains(&note), "{maximum}");
    }
}

/// `N` and 0 are no gear, `R` and -1 reverse, and all are read by a table and by a channel map.
#[test]
fn letters_and_numbers_of_no_gear_mean_the_same_with_and_without_a_map() {
    let folder = simulated("gear-letters");
    let text = folder.read("sim/short_measured.csv");
    let is_neutral = |row: usize| (300..400).contains(&row);
    let written = |cell: &str| {
        let mut rows = [0; 2];
        let both = ["gear", "target_gear"].into_iter().zip(&mut rows).fold(text.clone(), |text, (name, row)| {
            with_column(&text, name, |value| {
                *row += 1;
                if is_neutral(*row) { cell.to_owned() } else { value.to_owned() }
            })
        });
        folder.write("log.csv", both)
    };
    let numbers_of = |more: &[&str]| {
        let out = folder.path("out.csv");
        let all = [&["-o", &out], more].concat();
        let said = said(&estimate(&folder, "log.csv", &all));
        assert!(!said.contains("no gear of this gearbox") && !said.contains("are not numbers"), "{said}");
        let found = numbers(&folder.read("out.csv"), "gear_number");
        (found[300], found.iter().filter(|number| **number <= 0.0).count(), found)
    };
    written("N");
    let of_neutral = numbers_of(&[]);
    written("R");
    let of_reverse = numbers_of(&[]);
    assert_eq!([&of_neutral, &of_reverse].map(|found| (found.0, found.1)), [(0.0, 100), (-1.0, 100)]);
    let map = folder.path("map.toml");
    std::fs::write(&map, wetclutch(&["inspect", &folder.path("log.csv"), "--suggest"]).stdout).unwrap();
    let cells = [("N", &of_neutral), ("P", &of_neutral), ("0", &of_neutral), ("R", &of_reverse), ("-1", &of_reverse)];
    for (cell, expected) in cells {
        written(cell);
        assert!(numbers_of(&[]) == *expected && numbers_of(&["--map", &map]) == *expected, "{cell}");
    }
}

#[test]
fn a_gear_that_the_gearbox_does_not_have_is_counted_and_the_gear_before_stands() {
    let folder = simulated("no-gear");
    let text = folder.read("sim/short_measured.csv");
    said(&with_cells(&folder, &text, "gear", "", |_| false));
    let whole = folder.read("out.csv");
    for name in ["gear", "target_gear"] {
        let few = said(&with_cells(&folder, &text, name, "255", |row| row == 300));
        let note = format!(
            "warning: 1 of 2400 samples of {name} are no gear of this gearbox (255) and are not used: the gear before is kept"
        );
        assert!(few.contains(&note) && few.contains("`valid_range` of `channel."), "{few}");
        assert!(folder.read("out.csv") == whole, "{name}");
        let maximum = refused(&with_cells(&folder, &text, name, "255", |row| row % 5 > 1));
        assert!(
            maximum.contains("are no gear of this gearbox (255) and are not used\nhint: its gears are"),
            "{maximum}"
        );
    }
    // By a channel map, too.
    let map = folder.path("map.toml");
    std::fs::write(&map, wetclutch(&["inspect", &folder.path("log.csv"), "--suggest"]).stdout).unwrap();
    let mapped = |rows: fn(usize) -> bool| {
        with_cells(&folder, &text, "gear", "255", rows);
        estimate(&folder, "log.csv", &["--map", &map, "-o", &folder.path("mapped.csv")])
    };
    let few = said(&mapped(|row| row == 300));
    assert!(few.contains("warning: 1 of 2400 samples of gear are no gear of this gearbox (255)"), "{few}");
    // A count of a command names its element.
    with_cells(&folder, &text, "element_int_current_a", "inf", |row| row == 300);
    let few = said(&estimate(&folder, "log.csv", &["--map", &map, "-o", &folder.path("mapped.csv")]));
    assert!(few.contains("1 of 2,400 samples of element_int_current are not used: 1 missing"), "{few}");
    assert!(refused(&mapped(|row| row % 5 > 1)).contains("hint: gears are numbers from 1 to 4"));
}

#[cfg(unix)]
#[test]
fn a_followed_drive_that_becomes_shorter_ends_there_and_says_so() {
    use std::io::{BufRead, BufReader};
    let folder = simulated("followed-cut");
    let text = folder.read("sim/short_measured.csv");
    let growing = folder.write("growing.csv", &text);
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_wetclutch"))
        .args(["estimate", &growing, "--follow", "--vehicle", &format!("{ROOT}vehicles/four_speed.toml")])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut rows = BufReader::new(child.stdout.take().unwrap()).lines();
    text.lines().for_each(|_| drop(rows.next().unwrap().unwrap()));
    std::fs::OpenOptions::new().write(true).open(&growing).unwrap().set_len(1000).unwrap();
    assert!(rows.next().is_none());
    let said = said(&child.wait_with_output().unwrap());
    assert!(said.contains("warning: the log became shorter or was replaced by another file"), "{said}");
}

/// Without commands of the valves the torques are by the speeds alone; a map still needs the speeds and the gear.
#[test]
fn a_log_without_commands_of_the_valves_is_estimated_by_its_speeds() {
    let folder = simulated("no-commands");
    let text = folder.read("sim/short_measured.csv");
    for (log, names) in [
        (text.replace("_current_a", "_x"), "FWD, DIR, REV, INT, LR"),
        (text.replacen("element_int_current_a", "x", 1), "INT"),
    ] {
        folder.write("log.csv", log);
        let output = estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]);
        let said = said(&output);
        assert!(said.contains("warning: the log has no command of ") && said.contains(names), "{said}");
        assert!(!said.contains("below its kiss point"), "{said}");
        assert_eq!(folder.read("out.csv").lines().count(), text.lines().count());
    }
    let map = ["engine_speed", "turbine_speed"].map(|role| format!("[channel.{role}]\nname = \"{role}_rad_s\"\n"));
    let map = folder.write("map.toml", map.concat());
    let error = refused(&estimate(&folder, "sim/short_measured.csv", &["--map", &map]));
    assert!(
        error.contains("the channel map has no output_speed, gear, target_gear\nhint: an estimate of this car needs"),
        "{error}"
    );
}

#[test]
fn times_of_a_clock_since_1970_are_shown_from_the_first_one_on() {
    let folder = simulated("epoch");
    let text = folder.read("sim/short_measured.csv");
    let later = |text: &str| {
        with_column(text, "time_s", |value| format!("{:.3}", 1_700_000_000.0 + value.parse::<f64>().unwrap()))
    };
    let lines = |text: &str, kept: &str| -> Vec<String> {
        text.lines().filter(|line| line.contains(kept)).map(str::to_owned).collect()
    };
    let begins_s = |name: &str, column: &str| numbers(&folder.read(name), column);
    // Of the car with a gearbox.
    let near = crate::support::shown(&estimate(&folder, "sim/short_measured.csv", &["-o", &folder.path("near.csv")]));
    folder.write("log.csv", later(&text));
    let far = crate::support::shown(&estimate(&folder, "log.csv", &["-o", &folder.path("far.csv")]));
    let sentence = "times from 1700000000 s of the log's clock on; the tables in files keep that clock";
    assert!(far.matches(sentence).count() == 1 && !near.contains("times from"), "{far}");
    let shifts = lines(&near, "-on upshift");
    assert!(shifts.len() > 1 && lines(&far, "-on upshift").len() == shifts.len(), "{far}");
    for (near, far) in shifts.iter().zip(lines(&far, "-on upshift")) {
        assert_eq!(near.split_whitespace().nth(4), far.split_whitespace().nth(4));
    }
    for (near, far) in begins_s("near_shifts.csv", "time_s").iter().zip(begins_s("far_shifts.csv", "time_s")) {
        assert!((far - 1_700_000_000.0 - near).abs() < 1e-3, "{near} {far}");
    }
    // The labels of axes and the cells of tables.
    let page = folder.read("far_report.html");
    assert!(page.contains("times from 1700000000 s") && !page.contains(">17000000"));
    // Of the two-speed car.
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]));
    folder.write("log.csv", later(&folder.read("drive/e1_measured.csv")));
    let out = folder.path("two.csv");
    let far =
        crate::support::shown(&wetclutch(&["estimate", &folder.path("log.csv"), "--vehicle", VEHICLE, "-o", &out]));
    assert!(far.matches(sentence).count() == 1 && far.contains("from 0.000 to 9.500 s"), "{far}");
    assert!(!far.replace(sentence, "").contains("17000000"), "{far}");
    assert!(begins_s("two_shifts.csv", "time_s")[0] > 1_700_000_000.0);
    let page = folder.read("two_report.html");
    assert!(page.contains("times from 1700000000 s") && !page.contains(">17000000"));
}

#[test]
fn an_empty_gear_is_the_one_before() {
    let folder = simulated("empty-gears");
    let text = folder.read("sim/short_measured.csv");
    let shifts = |log: String| {
        folder.write("log.csv", log);
        let said = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        assert!(!said.contains("warning"), "{said}");
        folder.read("out_shifts.csv")
    };
    let every = |name: &str, full: fn(usize) -> bool| {
        let mut row = 0;
        with_column(&text, name, |cell| {
            row += 1;
            if full(row - 1) { cell.to_owned() } else { String::new() }
        })
    };
    let whole = shifts(text.clone());
    for signal in ["gear", "target_gear"] {
        // A slow channel has its first value late; before the first gear there is none, before the first target gear it is the gear.
        let slow = shifts(every(signal, |row| row % 2 == 1));
        assert_eq!(whole.lines().count(), slow.lines().count(), "{signal}: {slow}");
        for name in ["from_gear", "to_gear"] {
            assert_eq!(column(&whole, name), column(&slow, name), "{signal}");
        }
        assert!(column(&slow, "complete_s").iter().all(|time_s| !time_s.is_empty()), "{signal}: {slow}");
    }
    folder.write("log.csv", every("gear", |_| false));
    let error = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(error.contains("the gear is missing in all rows\nhint: its gears are"), "{error}");
}

#[test]
fn a_number_that_stands_for_no_value_is_no_wrong_unit() {
    let folder = simulated("no-value");
    let text = folder.read("sim/short_measured.csv");
    let mut row = 0;
    let log = with_column(&text, "engine_speed_rad_s", |cell| {
        row += 1;
        if row % 50 == 7 { "65535".to_owned() } else { cell.to_owned() }
    });
    folder.write("log.csv", log);
    said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    let health = column(&folder.read("out.csv"), "health");
    let refused = health.iter().filter(|health| *health == "reading_refused").count();
    assert!((row / 50..row / 20).contains(&refused), "{refused} of {row}");
}

#[test]
fn a_late_gear_makes_no_shifts_that_were_not_driven() {
    let folder = Folder::new("late-gear");
    let drive = folder.write(
        "drive.toml",
        "name = \"late\"\n[[segment]]\nduration_s = 20\nthrottle = 0.3\n[[segment]]\nduration_s = 6\nthrottle = 0\nbrake = 0.3\n",
    );
    let car = format!("{ROOT}vehicles/eight_speed.toml");
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("sim")]));
    let text = folder.read("sim/late_measured.csv");
    let map = folder.path("map.toml");
    std::fs::write(&map, wetclutch(&["inspect", &folder.path("sim/late_measured.csv"), "--suggest"]).stdout).unwrap();
    // Two rows late, of 10 ms.
    let mut before = ["1".to_owned(), "1".to_owned()];
    let late = with_column(&text, "gear", |gear| {
        before.rotate_left(1);
        std::mem::replace(&mut before[1], gear.to_owned())
    });
    let shifts = |log: &str, more: &[&str], is_late: bool| {
        let (log, out) = (folder.write("log.csv", log), folder.path("out.csv"));
        let said = said(&wetclutch(&[&["estimate", &log, "--vehicle", &car, "-o", &out], more].concat()));
        assert_eq!(said.contains("warning: gear is late (1 times): target_gear changed"), is_late, "{said}");
        let shifts = folder.read("out_shifts.csv");
        ["from_gear", "to_gear"].map(|name| column(&shifts, name))
    };
    let driven = shifts(&text, &[], false);
    assert_eq!(driven[0][5..], ["6", "8", "7", "6"]);
    assert_eq!(driven[1][5..], ["8", "7", "6", "4"]);
    assert_eq!(shifts(&late, &[], true), driven);
    assert_eq!(shifts(&late, &["--map", &map], true), driven);
}

/// Of a wrong scale the speed is named, with the factor: by the wheels, or by the engine where there are none.
#[test]
fn an_output_speed_of_another_scale_is_named() {
    let folder = simulated("output-scale");
    let text = folder.read("sim/short_measured.csv");
    let scaled = |factor: f64| {
        with_column(&text, "output_speed_rad_s", |value| {
            value.parse::<f64>().map_or(value.to_owned(), |value| format!("{:.6}", factor * value))
        })
    };
    for factor in [3.0, 0.5, 0.25] {
        folder.write("log.csv", scaled(factor));
        let error = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        assert!(
            error.contains("hint: turbine_speed is ") && error.contains("output_speed is off against wheel_speed"),
            "{error}"
        );
        let (_, found) = error.split_once("which would fit with `scale` times ").unwrap();
        let found: f64 = found.split([';', '\n']).next().unwrap().trim().parse().unwrap();
        assert!((found * factor - 1.0).abs() < 0.01, "{factor}: {error}");
        folder.write("log.csv", with_column(&scaled(factor), "wheel_speed_rad_s", |_| String::new()));
        let error = refused(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
        assert!(error.contains("check unit and scale of output_speed"), "{error}");
    }
    // So little off that the log is not refused: the wheels are not blamed.
    folder.write("log.csv", scaled(1.06));
    let told = said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")]));
    assert!(
        told.contains("check unit and scale of output_speed") && !told.contains("Correct the scale of wheel_speed"),
        "{told}"
    );
    // Of a right log nothing is said.
    folder.write("log.csv", scaled(1.0));
    assert!(!said(&estimate(&folder, "log.csv", &["-o", &folder.path("out.csv")])).contains("check unit and scale"));
}
