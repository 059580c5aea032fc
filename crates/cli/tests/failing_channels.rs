//! Logs of a drive in which a sensor fails or a channel ends, and commands that are sent on change: of the car of one shift and of a car
//! with a gearbox, in tables and by a channel map.

use crate::any_car::{column, numbers, simulated, with_column};
use crate::support::{EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, wetclutch};

const SPEEDS: [&str; 4] = ["engine_speed", "turbine_speed", "output_speed", "wheel_speed"];

/// The column of the torque that is estimated.
const TORQUE: &str = "oncoming_torque_estimate_n_m";

/// A car with a log of it.
struct Case {
    folder: Folder,
    vehicle: String,
    log: String,
    commands: Vec<String>,
    /// A time in the inertia phase of a shift and one between shifts, s.
    times_s: [f64; 2],
}

impl Case {
    fn one_shift() -> Self {
        let folder = Folder::new("fails-one");
        let places = printed(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]));
        let path = places.lines().find(|line| line.contains("measured")).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        // At 100 Hz, without the slip that would give the output speed.
        let rows: Vec<&str> = text.lines().take(1).chain(text.lines().skip(1).step_by(10)).collect();
        let text = rows.join("\n") + "\n";
        let log = text.replacen("oncoming_slip_rad_s", "slip", 1);
        let commands = ["oncoming_current", "offgoing_current"].map(str::to_owned).to_vec();
        Self { folder, vehicle: VEHICLE.to_owned(), log, commands, times_s: [8.1, 5.0] }
    }

    fn gearbox() -> Self {
        let folder = simulated("fails-car");
        let log = folder.read("sim/short_measured.csv");
        let [time, from, to] = ["time_s", "gear", "target_gear"].map(|name| column(&log, name));
        let begins = |row: &usize| *row > 0 && from[*row] != to[*row] && from[*row - 1] == to[*row - 1];
        // Of the second shift; the turbine follows its new gear in the second half of it.
        let begin = (0..time.len()).filter(begins).nth(1).unwrap();
        let begin_s: f64 = time[begin].parse().unwrap();
        let names = log.lines().next().unwrap().split(',');
        let of_element = names.filter_map(|name| name.strip_suffix("_a").filter(|name| name.starts_with("element_")));
        let commands = of_element.map(str::to_owned).collect();
        let vehicle = format!("{ROOT}vehicles/four_speed.toml");
        Self { folder, vehicle, log, commands, times_s: [begin_s + 0.4, begin_s + 2.0] }
    }

    fn both() -> [Self; 2] {
        [Self::one_shift(), Self::gearbox()]
    }

    /// The log with this value of a column from one time to another.
    fn with(&self, name: &str, [from_s, to_s]: [f64; 2], value: &str) -> String {
        let (times, mut row) = (numbers(&self.log, "time_s"), 0);
        with_column(&self.log, name, |cell| {
            row += 1;
            if times[row - 1] > from_s && times[row - 1] < to_s { value.to_owned() } else { cell.to_owned() }
        })
    }

    /// A channel map for the names of the log, with more lines for each command.
    fn map(&self, of_commands: &str) -> String {
        let of = |name: &str, unit: &str, more: &str| {
            let ending = if unit == "A" { "a" } else { "rad_s" };
            format!("[channel.{name}]\nname = \"{name}_{ending}\"\nunit = \"{unit}\"\n{more}")
        };
        let speeds = SPEEDS.map(|name| of(name, "rad/s", "")).concat();
        let commands: String = self.commands.iter().map(|name| of(name, "A", of_commands)).collect();
        if !self.log.contains(",target_gear") {
            return speeds + &commands;
        }
        let others =
            ["gear", "target_gear", "lock_up_applied"].map(|name| format!("[channel.{name}]\nname = \"{name}\"\n"));
        let torque = "[channel.engine_torque]\nname = \"reported_engine_torque_n_m\"\nunit = \"N m\"\n";
        speeds + &commands + &others.concat() + torque
    }

    fn run(&self, log: &str, more: &[&str]) -> std::process::Output {
        let (log, out) = (self.folder.write("log.csv", log), self.folder.path("out.csv"));
        wetclutch(&[&["estimate", &log, "--vehicle", &self.vehicle, "-o", &out], more].concat())
    }

    /// What is said, the estimate, and the table of shifts.
    fn estimate(&self, log: &str, more: &[&str]) -> (String, String, String) {
        let said = said(&self.run(log, more));
        // Without a shift there is no table of them.
        let has_shifts = self.folder.names().contains(&"out_shifts.csv".to_owned());
        let shifts = if has_shifts { self.folder.read("out_shifts.csv") } else { String::new() };
        (said, self.folder.read("out.csv"), shifts)
    }
}

#[test]
fn a_sensor_that_reads_zero_while_the_car_drives_is_refused_as_if_it_gave_nothing() {
    for case in Case::both() {
        let map = case.folder.write("map.toml", case.map(""));
        let (_, _, clean) = case.estimate(&case.log, &[]);
        let [in_shift_s, between_s] = case.times_s;
        for (speed, from_s, length_s) in SPEEDS.into_iter().flat_map(|speed| {
            [(in_shift_s, 0.1), (in_shift_s - 0.2, 0.6), (between_s, 1.0)].map(|(at, s)| (speed, at, s))
        }) {
            let at = format!("{speed} from {from_s} s for {length_s} s");
            let name = format!("{speed}_rad_s");
            let span_s = [from_s, from_s + length_s];
            let (zero, empty) = (case.with(&name, span_s, "0"), case.with(&name, span_s, ""));
            let (note, table, shifts) = case.estimate(&zero, &[]);
            assert!(note.contains(&format!("readings of {speed} are impossible, as a zero while")), "{at}: {note}");
            let readings = column(&table, &speed.replace("speed", "reading"));
            assert!(readings.iter().any(|reading| reading == "refused"), "{at}");
            assert_eq!(shifts.lines().count(), clean.lines().count(), "{at}: {note}");
            // Equal readings give equal estimates to the last bit.
            let (_, expected, _) = case.estimate(&empty, &[]);
            assert!(column(&table, TORQUE) == column(&expected, TORQUE), "{at}");
            let (note, mapped, _) = case.estimate(&zero, &["--map", &map]);
            assert!(note.contains(&format!("{speed} are not used: ")) && note.contains("impossible"), "{at}: {note}");
            assert!(column(&mapped, TORQUE) == column(&table, TORQUE), "{at}");
        }
    }
}

#[test]
fn a_speed_channel_that_shows_another_speed_is_refused() {
    for case in Case::both() {
        let [in_shift_s, between_s] = case.times_s;
        let outputs = column(&case.log, "output_speed_rad_s");
        let times = numbers(&case.log, "time_s");
        let (_, _, clean) = case.estimate(&case.log, &[]);
        for (speed, from_s) in [("turbine_speed", in_shift_s - 0.05), ("wheel_speed", between_s)] {
            let mut row = 0;
            let log = with_column(&case.log, &format!("{speed}_rad_s"), |cell| {
                row += 1;
                let is_wrong = times[row - 1] > from_s && times[row - 1] < from_s + 0.15;
                if is_wrong { outputs[row - 1].clone() } else { cell.to_owned() }
            });
            let (note, _, shifts) = case.estimate(&log, &[]);
            assert!(note.contains(&format!("readings of {speed} are impossible")), "{speed}: {note}");
            assert_eq!(shifts.lines().count(), clean.lines().count(), "{speed}: {note}");
        }
    }
}

/// Rows in which the speed given is further from that of the log than a sensor errs, and its reading is not refused.
fn believed(case: &Case, given: &str, table: &str, speed: &str) -> Vec<f64> {
    let name = format!("{speed}_rad_s");
    let [times, right, wrong] =
        [("time_s", &case.log), (&name, &case.log), (&name, &given.to_owned())].map(|(name, log)| numbers(log, name));
    let readings = column(table, &speed.replace("speed", "reading"));
    let rows = (0..times.len()).filter(|row| (right[*row] - wrong[*row]).abs() > 2.0 && readings[*row] != "refused");
    rows.map(|row| times[row]).collect()
}

#[test]
fn a_speed_that_sticks_or_shows_the_speed_next_to_it_is_refused_from_its_first_wrong_reading_on() {
    for case in Case::both() {
        let [in_shift_s, between_s] = case.times_s;
        let map = case.folder.write("map.toml", case.map(""));
        let (_, _, clean) = case.estimate(&case.log, &[]);
        let times = numbers(&case.log, "time_s");
        let stuck = |speed: &str, [from_s, to_s]: [f64; 2]| {
            let name = format!("{speed}_rad_s");
            let last = times.iter().rposition(|time_s| *time_s <= from_s).unwrap();
            case.with(&name, [from_s, to_s], &column(&case.log, &name)[last])
        };
        let shows = |speed: &str, other: &str, [from_s, to_s]: [f64; 2]| {
            let (values, mut row) = (column(&case.log, &format!("{other}_rad_s")), 0);
            with_column(&case.log, &format!("{speed}_rad_s"), |cell| {
                row += 1;
                let is_wrong = times[row - 1] > from_s && times[row - 1] < to_s;
                if is_wrong { values[row - 1].clone() } else { cell.to_owned() }
            })
        };
        let (in_shift, between) = ([in_shift_s - 0.1, in_shift_s + 0.2], [between_s, between_s + 1.0]);
        for (speed, log) in [
            ("turbine_speed", stuck("turbine_speed", in_shift)),
            ("turbine_speed", stuck("turbine_speed", between)),
            ("output_speed", stuck("output_speed", between)),
            ("wheel_speed", stuck("wheel_speed", between)),
            ("engine_speed", shows("engine_speed", "turbine_speed", between)),
            ("output_speed", shows("output_speed", "wheel_speed", between)),
        ] {
            for more in [&[][..], &["--map", &map]] {
                let (note, table, shifts) = case.estimate(&log, more);
                assert_eq!(believed(&case, &log, &table, speed), [0.0; 0], "{speed}: {note}");
                assert!(note.contains(&format!("{speed} ")) && note.contains("not used"), "{speed}: {note}");
                assert_eq!(shifts.lines().count(), clean.lines().count(), "{speed}: {note}");
            }
        }
    }
}

/// Friction work of the first shift, J: the value and its range; and the worst health.
fn work_of_first(shifts: &str) -> ([f64; 3], String) {
    let of = |name: &str| column(shifts, name)[0].parse().unwrap_or(f64::NAN);
    (
        ["friction_work_j", "friction_work_least_j", "friction_work_greatest_j"].map(of),
        column(shifts, "worst_health")[0].clone(),
    )
}

#[test]
fn a_shift_in_which_a_speed_fails_keeps_its_friction_work_and_says_what_failed() {
    let case = Case::one_shift();
    let (_, _, clean) = case.estimate(&case.log, &[]);
    let ([work_j, ..], _) = work_of_first(&clean);
    // From before the shift into it, and over all of it.
    for (from_s, to_s) in [(7.43, 8.13), (7.43, 8.93)] {
        let log = case.with("turbine_speed_rad_s", [from_s, to_s], "0");
        let (note, _, shifts) = case.estimate(&log, &[]);
        assert_eq!(shifts.lines().count(), clean.lines().count(), "{note}");
        let ([_, least_j, greatest_j], health) = work_of_first(&shifts);
        assert!(least_j < work_j && work_j < greatest_j, "{least_j} {work_j} {greatest_j}");
        assert!(!["", "good"].contains(&&*health), "{shifts}");
    }
    // From within the shift to the end of the log, and from before it until shortly before that end.
    let end_s = f64::INFINITY;
    let to_the_end =
        [("turbine", 7.75, end_s), ("turbine", 8.1, end_s), ("output", 7.75, end_s), ("output", 8.25, end_s)];
    let nearly = [("turbine", 7.6, 9.4), ("output", 7.6, 9.4), ("turbine", 7.43, 9.42)];
    for (speed, from_s, to_s) in to_the_end.into_iter().chain(nearly) {
        let log = case.with(&format!("{speed}_speed_rad_s"), [from_s, to_s], "0");
        let (note, _, shifts) = case.estimate(&log, &[]);
        assert_eq!(shifts.lines().count(), clean.lines().count(), "{speed} {from_s}: {note}");
        let ([_, least_j, greatest_j], health) = work_of_first(&shifts);
        assert!(least_j < work_j && work_j < greatest_j, "{least_j} {work_j} {greatest_j}");
        assert!(!["", "good"].contains(&&*health), "{shifts}");
    }
}

/// An observer that needs the engine speed sees nothing of the shift without it.
#[test]
fn the_range_of_friction_work_holds_where_the_observer_did_not_see_the_begin() {
    let case = Case::one_shift();
    for observer in ["rigid", "best", "open-loop"] {
        let more = ["--observer", observer];
        let (_, _, clean) = case.estimate(&case.log, &more);
        let ([work_j, ..], _) = work_of_first(&clean);
        for (from_s, to_s) in [(7.24, 8.24), (7.24, 8.05), (7.0, 9.0)] {
            let (note, _, shifts) = case.estimate(&case.with("engine_speed_rad_s", [from_s, to_s], "0"), &more);
            let ([_, least_j, greatest_j], _) = work_of_first(&shifts);
            assert!(
                least_j < work_j && work_j < greatest_j,
                "{observer} {from_s}: {least_j} {work_j} {greatest_j} {note}"
            );
        }
    }
}

/// The wheels show the gears where the output does not.
#[test]
fn a_shift_over_which_the_output_fails_is_found_by_the_wheels() {
    let case = Case::one_shift();
    for (value, from_s, to_s) in [("0", 7.49, 9.49), ("0", 7.38, 8.39), ("", 7.49, 9.4), ("130", 7.53, 9.45)] {
        let log = case.with("output_speed_rad_s", [from_s, to_s], value);
        for observer in ["best", "rigid", "open-loop"] {
            let (note, _, shifts) = case.estimate(&log, &["--observer", observer]);
            assert_eq!(shifts.lines().count(), 2, "{value} {observer}: {note}");
            assert_eq!((column(&shifts, "from_gear")[0].as_str(), column(&shifts, "to_gear")[0].as_str()), ("1", "2"));
            let begin_s = numbers(&shifts, "time_s")[0];
            assert!((7.4..8.2).contains(&begin_s), "{value} {observer}: {begin_s}");
        }
    }
}

/// Of the car with a gearbox too: while the turbine speed is lost its clutches may slip by anything between both gears.
#[test]
fn the_range_of_friction_work_holds_the_work_of_the_log_without_faults() {
    let case = Case::gearbox();
    let (_, _, clean) = case.estimate(&case.log, &[]);
    let works = |table: &str, name: &str| numbers(table, name);
    for (value, length_s) in [("0", 1.0), ("", 1.0), ("0", 0.4)] {
        let begin_s = case.times_s[0] - 0.3;
        let log = case.with("turbine_speed_rad_s", [begin_s, begin_s + length_s], value);
        let (note, _, shifts) = case.estimate(&log, &[]);
        assert_eq!(shifts.lines().count(), clean.lines().count(), "{note}");
        for clutch in ["offgoing", "oncoming"] {
            let [work, least, greatest] =
                ["", "_least", "_greatest"].map(|end| format!("{clutch}_friction_work{end}_j"));
            let ends = works(&shifts, &least).into_iter().zip(works(&shifts, &greatest));
            for (work_j, (least_j, greatest_j)) in works(&clean, &work).into_iter().zip(ends) {
                assert!(work_j.is_nan() || (least_j <= work_j && work_j <= greatest_j), "{clutch} {work_j}: {shifts}");
            }
        }
    }
}

#[test]
fn a_command_that_its_valve_cannot_have_refuses_the_log_of_either_car() {
    for case in Case::both() {
        let name = format!("{}_a", case.commands[0]);
        let log = with_column(&case.log, &name, |cell| {
            cell.parse::<f64>().map_or(String::new(), |current| (5.0 * current + 2.0).to_string())
        });
        let error = refused(&case.run(&log, &[]));
        assert!(error.contains("were refused: ") && error.contains("hint: check "), "{error}");
    }
}

#[test]
fn a_channel_that_ends_in_the_drive_does_not_refuse_the_log() {
    for case in Case::both() {
        let (_, between_s) = (case.times_s[0], case.times_s[1] - 1.0);
        let map = case.folder.write("map.toml", case.map(""));
        for (speed, value) in [("output_speed", ""), ("wheel_speed", ""), ("output_speed", "0"), ("wheel_speed", "0")] {
            let log = case.with(&format!("{speed}_rad_s"), [between_s, f64::INFINITY], value);
            for more in [&[][..], &["--map", &map]] {
                let (note, table, _) = case.estimate(&log, more);
                assert_eq!(table.lines().count(), case.log.lines().count(), "{speed} `{value}`: {note}");
            }
        }
    }
}

#[test]
fn a_speed_that_ends_before_the_first_shift_leaves_the_open_loop() {
    let case = Case::gearbox();
    let [gear, target] = ["gear", "target_gear"].map(|name| column(&case.log, name));
    let begin = (1..gear.len()).find(|row| gear[*row] != target[*row] && gear[row - 1] == target[row - 1]).unwrap();
    let before_s = numbers(&case.log, "time_s")[begin] - 0.5;
    let map = case.folder.write("map.toml", case.map(""));
    for (speed, from_s) in
        ["engine_speed", "turbine_speed", "output_speed"].map(|speed| [(speed, before_s), (speed, 0.5)]).as_flattened()
    {
        let column_name = format!("{speed}_rad_s");
        let row = numbers(&case.log, "time_s").iter().position(|time_s| time_s >= from_s).unwrap();
        let stuck = column(&case.log, &column_name)[row].to_owned();
        for value in ["", "0", &stuck] {
            let log = case.with(&column_name, [*from_s, f64::INFINITY], value);
            for more in [&[][..], &["--map", &map]] {
                let (note, table, shifts) = case.estimate(&log, more);
                assert_eq!(table.lines().count(), case.log.lines().count(), "{speed} `{value}`: {note}");
                if *speed != "engine_speed" {
                    // Nothing is known of the slips.
                    assert!(column(&shifts, "flare_rad_s").iter().all(|flare| flare.is_empty()), "{speed}: {shifts}");
                    let work = column(&shifts, "oncoming_friction_work_j");
                    assert_eq!(work.last().map(String::as_str), Some(""), "{speed}: {shifts}");
                }
                assert!(note.contains("is missing or refused in "), "{speed} from {from_s} s `{value}`: {note}");
                assert!(
                    !note.contains("units of both speeds") && !note.contains("lock-up"),
                    "{speed} `{value}`: {note}"
                );
            }
        }
    }
}

#[test]
fn the_choice_of_the_observer_looks_at_the_values_of_the_speeds() {
    let case = Case::one_shift();
    let map = case.folder.write("map.toml", case.map(""));
    let without = |speed: &str| case.with(&format!("{speed}_rad_s"), [-1.0, f64::INFINITY], "");
    for more in [&[][..], &["--map", &map]] {
        let (note, ..) = case.estimate(&without("wheel_speed"), more);
        assert!(note.contains("observer: gearbox, because the log has no wheel_speed_rad_s"), "{note}");
        let (note, ..) = case.estimate(&without("engine_speed"), more);
        assert!(note.contains("observer: open-loop-maps") && !note.contains("channel_lost"), "{note}");
        let named = |observer: &'static str| [more, &["--observer", observer]].concat();
        let error = refused(&case.run(&without("wheel_speed"), &named("kalman")));
        assert!(error.contains("wheel_speed has no value in any of the first") && error.contains("hint: "), "{error}");
        let error = refused(&case.run(&without("engine_speed"), &named("rigid")));
        assert!(error.contains("engine_speed has no value in any of the first") && error.contains("hint: "), "{error}");
        let (note, ..) = case.estimate(&without("engine_speed"), &named("open-loop"));
        assert!(note.contains("health: good 100.0 %"), "{note}");
    }
}

#[test]
fn the_open_loop_does_without_an_engine_speed() {
    for case in Case::both() {
        let is_one = case.vehicle == VEHICLE;
        let observer: &[&str] = if is_one { &["--observer", "open-loop"] } else { &[] };
        let column_of = if is_one { "oncoming_pressure_estimate_pa" } else { "element_int_valve_model_pressure_pa" };
        let (_, clean, _) = case.estimate(&case.log, observer);
        let mut expected = is_one.then(|| column(&clean, column_of));
        let absent = case.log.replacen("engine_speed_rad_s", "other", 1);
        let empty = case.with("engine_speed_rad_s", [-1.0, f64::INFINITY], "");
        let map =
            case.map("").replacen("[channel.engine_speed]\nname = \"engine_speed_rad_s\"\nunit = \"rad/s\"\n", "", 1);
        let map = case.folder.write("map.toml", map);
        // One that ends, or reads zero from then on: the open loop of the car of one shift does without it alike.
        let ends = ["", "0"].map(|value| case.with("engine_speed_rad_s", [2.0, f64::INFINITY], value));
        let ends = ends.iter().filter(|_| is_one).map(|log| (log, vec![]));
        for (log, more) in [(&absent, vec![]), (&empty, vec![]), (&absent, vec!["--map", &map])].into_iter().chain(ends)
        {
            let (note, table, _) = case.estimate(log, &[observer, more.as_slice()].concat());
            // What a filter learns of its valves takes a shift with all speeds.
            let found = column(&table, column_of);
            assert!(found.iter().all(|cell| !cell.is_empty()), "{note}");
            assert!(*expected.get_or_insert_with(|| found.clone()) == found, "{note}");
            assert!(
                is_one || note.contains("warning: there is no engine speed, which gives the turbine torque"),
                "{note}"
            );
        }
        // A column that was meant is named.
        let error = refused(&case.run(&case.log.replacen("engine_speed_rad_s", "engine_speed", 1), observer));
        assert!(error.contains("`engine_speed` has a similar name"), "{error}");
    }
}

#[test]
fn a_current_that_is_measured_about_zero_is_accepted() {
    for case in Case::both() {
        let map = case.folder.write("map.toml", case.map(""));
        // 3 mA too low, and 4 mA up and down.
        let log = case.commands.iter().fold(case.log.clone(), |log, name| {
            let mut row = 0;
            with_column(&log, &format!("{name}_a"), |cell| {
                row += 1;
                let read = cell.parse::<f64>().unwrap() - 0.003 + if row % 2 == 0 { 0.004 } else { -0.004 };
                format!("{read:.6}")
            })
        });
        assert!(log.contains(",-0.007000"));
        for more in [&[][..], &["--map", &map]] {
            let (note, table, _) = case.estimate(&log, more);
            assert_eq!(table.lines().count(), case.log.lines().count(), "{note}");
            if case.vehicle == VEHICLE {
                assert!(!note.contains("command_rejected") && !note.contains("reading_refused"), "{note}");
            }
        }
    }
}

/// The log with a value in a column where it differs from the row before only.
fn on_change(log: &str, commands: &[String]) -> String {
    commands.iter().fold(log.to_owned(), |log, name| {
        let mut before = String::new();
        with_column(&log, &format!("{name}_a"), |cell| {
            let is_same = cell == before;
            before = cell.to_owned();
            if is_same { String::new() } else { cell.to_owned() }
        })
    })
}

#[test]
fn a_command_that_is_sent_on_change_stands_between_its_samples() {
    for case in Case::both() {
        let log = on_change(&case.log, &case.commands);
        let by_map = case.folder.write("by_map.toml", case.map("sent_on_change = true\n"));
        let plain = case.folder.write("plain.toml", case.map(""));
        let observers: &[&[&str]] = if case.vehicle == VEHICLE { &[&[], &["--observer", "open-loop"]] } else { &[&[]] };
        for observer in observers {
            for (more, clean) in [
                (vec![], vec![]),
                (vec!["--map", &plain], vec!["--map", &plain]),
                (vec!["--map", &by_map], vec!["--map", &plain]),
            ] {
                let (_, clean, _) = case.estimate(&case.log, &[*observer, clean.as_slice()].concat());
                let (note, table, _) = case.estimate(&log, &[*observer, more.as_slice()].concat());
                assert!(column(&table, TORQUE) == column(&clean, TORQUE), "{more:?}: {note}");
                let is_said = note.contains("are sent on change, as their samples show");
                assert_eq!(is_said, !more.contains(&by_map.as_str()), "{more:?}: {note}");
            }
        }
    }
    let case = Case::one_shift();
    // One that is sampled at a rate and ends is lost, for each observer alike.
    let ends = case.with("oncoming_current_a", [3.0, f64::INFINITY], "");
    for observer in ["best", "open-loop"] {
        let error = refused(&case.run(&ends, &["--observer", observer]));
        assert!(
            error.contains("have no command of the valve that can be used\nhint: if it is sent on change"),
            "{error}"
        );
    }
    // It is for commands alone.
    let map = case.map("").replacen("unit", "sent_on_change = true\nunit", 1);
    let error = refused(&case.run(&case.log, &["--map", &case.folder.write("map.toml", map)]));
    assert!(error.contains("`channel.engine_speed.sent_on_change` is for the commands of valves"), "{error}");
}
