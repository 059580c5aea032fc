//! Readings and steps: the rules for what cannot be a reading, the map, and the input of an observer.

use std::fmt::Write as _;

use crate::common::{Folder, data, read, with_dbc};
use logs::{ChannelMap, Log, LogError, OpenOptions, Quality, Reading, Readings, Role, RoleSummary, Steps};

/// A map of `SIGNAL=NAME` entries.
fn map(entries: &[&str]) -> ChannelMap {
    let mut map = ChannelMap::default();
    entries.iter().for_each(|entry| map.set(entry).unwrap());
    map
}

/// The readings of a table, what came of its samples, and the notes.
type Read = (Vec<Reading>, Vec<RoleSummary>, Vec<String>);

fn readings(text: &str, map: &ChannelMap) -> Result<Read, LogError> {
    let folder = Folder::new(&format!("readings-{:?}", std::thread::current().id()));
    let mut log = Log::open(&folder.write("log.csv", text), &map.open)?;
    let mut readings = Readings::new(&mut log, map)?;
    let read = readings.by_ref().collect::<Result<Vec<_>, _>>()?;
    readings.check()?;
    Ok((read, readings.summary(), readings.notes().to_vec()))
}

fn times(readings: &[Reading]) -> Vec<f64> {
    readings.iter().map(|reading| (reading.stamp_s * 1e3).round() / 1e3).collect()
}

fn count(summary: &[RoleSummary], quality: Quality) -> u64 {
    summary.iter().map(|entry| entry.counts.of(quality)).sum()
}

#[test]
fn repeated_and_backward_stamps_are_left_out_and_counted() {
    let text = "time_s,n_rpm\n0,600\n0.01,610\n0.01,999\n0.02,620\n0.015,999\n0.03,630\n";
    let (read, summary, notes) = readings(text, &map(&["turbine_speed=n_rpm"])).unwrap();
    assert_eq!(times(&read), [0.0, 0.01, 0.02, 0.03]);
    assert_eq!((count(&summary, Quality::Repeated), count(&summary, Quality::Backward)), (1, 1));
    assert!((read[3].value - 630.0 * std::f64::consts::PI / 30.0).abs() < 1e-12);
    assert!(notes.is_empty(), "{notes:?}");
}

#[test]
fn a_reset_of_the_clock_goes_on_one_second_later() {
    let mut text = "time_s,n_rpm\n".to_owned();
    for i in 0..200 {
        // The logger starts again after 100 rows.
        writeln!(text, "{},{}", f64::from(i % 100) * 0.01 + 5.0 * f64::from(u8::from(i < 100)), 1000 + i).unwrap();
    }
    let (read, summary, notes) = readings(&text, &map(&["turbine_speed=n_rpm"])).unwrap();
    // The first twenty rows after the reset could still be wrong stamps.
    assert_eq!((read.len(), count(&summary, Quality::Backward)), (180, 20));
    assert!((read[99].stamp_s - 5.99).abs() < 1e-9 && (read[100].stamp_s - 6.99).abs() < 1e-9);
    assert!((read[179].stamp_s - 7.78).abs() < 1e-9);
    assert_eq!(notes, ["the clock was reset 1 times: the time continues one second later"]);
}

#[test]
fn a_stamp_that_is_far_too_late_does_not_move_the_clock() {
    let mut text = "time_s,n_rpm\n".to_owned();
    for i in 0..200 {
        let time_s = if i == 100 { 1e6 } else { f64::from(i) * 0.01 };
        writeln!(text, "{time_s},{}", 1000 + i).unwrap();
    }
    let (read, _, notes) = readings(&text, &map(&["turbine_speed=n_rpm"])).unwrap();
    assert!((read.last().unwrap().stamp_s - 1.99).abs() < 1e-9, "{:?}", read.last());
    assert_eq!(notes, ["1 time stamps are far too late: the time continues without them"]);
}

#[test]
fn a_speed_that_stands_still_while_another_moves_is_frozen() {
    let mut text = "time_s,e_rpm,t_rpm,o_rpm,w_rpm\n".to_owned();
    for i in 0..300 {
        // The turbine stands still from 1 to 2 s. So does the wheel, in a coarse unit, for as long as it always does; and the engine
        // may hold its speed for 0.4 s.
        let turbine = if (100..200).contains(&i) { 1500.0 } else { 1000.0 + 5.0 * f64::from(i) };
        let engine = if (20..60).contains(&i) { 1160 } else { 1000 + 8 * i };
        writeln!(text, "{},{engine},{turbine},{},{}", f64::from(i) * 0.01, 400 + 3 * i, 100 + 80 * (i / 70)).unwrap();
    }
    let map = map(&["engine_speed=e_rpm", "turbine_speed=t_rpm", "output_speed=o_rpm", "wheel_speed=w_rpm"]);
    let (read, summary, _) = readings(&text, &map).unwrap();
    let frozen = |role: Role| summary.iter().find(|entry| entry.role == role).unwrap().counts.of(Quality::Frozen);
    assert_eq!([Role::EngineSpeed, Role::OutputSpeed, Role::WheelSpeed].map(frozen), [0; 3]);
    // The first of the equal values is right; the others are withdrawn when it is known that they stand.
    assert_eq!(frozen(Role::TurbineSpeed), 99);
    let between =
        read.iter().filter(|reading| reading.role == Role::TurbineSpeed && (1.005..1.995).contains(&reading.stamp_s));
    assert_eq!(between.count(), 0);
    let after = read.iter().filter(|reading| reading.role == Role::TurbineSpeed && reading.stamp_s > 1.995).count();
    assert_eq!(after, 100);
}

#[test]
fn a_speed_is_frozen_by_its_own_quanta_and_more_than_the_slip_of_tyres() {
    // A turbine with this resolution stands still from 2 s on, while the output speed changes by so much in the second after.
    let frozen = |quantum: f64, change: f64| {
        let mut text = "time_s,t_rpm,o_rpm\n".to_owned();
        for i in 0..400 {
            let output = 1000.0 + change * f64::from((i - 200).max(0)) + 0.5 * f64::from(i % 2);
            let turbine =
                2000.0 + quantum * f64::from(u8::from(i < 200) * u8::try_from((i % 8).min(8 - i % 8)).unwrap());
            writeln!(text, "{},{turbine},{output}", f64::from(i) * 0.01).unwrap();
        }
        let (_, summary, _) = readings(&text, &map(&["turbine_speed=t_rpm", "output_speed=o_rpm"])).unwrap();
        count(&summary, Quality::Frozen)
    };
    // 1 % in a second is within the slip of tyres; 5 % is not, but hides in a resolution of 50 rpm for 2000 rpm until 3 quanta, 7.5 %.
    assert_eq!(frozen(1.0, 0.1), 0);
    assert!(frozen(1.0, 0.5) > 100, "{}", frozen(1.0, 0.5));
    assert_eq!(frozen(50.0, 0.3), 0);
    assert!(frozen(50.0, 0.8) > 50, "{}", frozen(50.0, 0.8));
}

#[test]
fn an_engine_at_idle_speed_is_not_frozen_while_the_car_comes_to_rest() {
    let frozen = |motion: &dyn Fn(f64) -> [f64; 2]| {
        let mut text = "time_s,e_rpm,t_rpm\n".to_owned();
        for i in 0..600 {
            let [engine, turbine] = motion(f64::from(i));
            writeln!(text, "{},{engine},{turbine}", f64::from(i) * 0.01).unwrap();
        }
        let (_, summary, _) = readings(&text, &map(&["engine_speed=e_rpm", "turbine_speed=t_rpm"])).unwrap();
        count(&summary, Quality::Frozen)
    };
    // The engine is braked to its idle speed, which the control holds to the digit while the turbine stops.
    let braked = |i: f64| {
        if i < 200.0 { [1600.0 - 4.0 * i, 1590.0 - 4.4 * i] } else { [800.0, (710.0 - 2.0 * (i - 200.0)).max(0.0)] }
    };
    assert_eq!(frozen(&braked), 0);
    // The turbine takes an engine along whose sensor has stopped.
    let stopped = |i: f64| [1600.0 + 8.0 * i.min(300.0), 1590.0 + 7.9 * i];
    assert!(frozen(&stopped) > 200, "{}", frozen(&stopped));
}

#[test]
fn a_noisy_speed_that_stops_is_frozen_whether_another_one_moves_or_not() {
    // An engine that idles in a car that stands: with noise of this amplitude in rpm until 4 s, and from then on with this one.
    let frozen = |resolution: f64, [before, after]: [f64; 2]| {
        let mut text = "time_s,e_rpm\n".to_owned();
        for i in 0..600 {
            let amplitude = if i < 400 { before } else { after };
            let engine = 800.0 + amplitude * (f64::from(i * i % 613) / 306.0 - 1.0);
            writeln!(text, "{},{}", f64::from(i) * 0.01, (engine / resolution).round() * resolution).unwrap();
        }
        let (_, summary, _) = readings(&text, &map(&["engine_speed=e_rpm"])).unwrap();
        count(&summary, Quality::Frozen)
    };
    assert!((195..=199).contains(&frozen(0.01, [5.0, 0.0])), "{}", frozen(0.01, [5.0, 0.0]));
    assert!((190..=199).contains(&frozen(0.25, [5.0, 0.0])), "{}", frozen(0.25, [5.0, 0.0]));
    // Coarse readings of it stand now and then, and so do those of a noise that is small.
    assert_eq!([0.25, 1.0, 5.0].map(|resolution| frozen(resolution, [5.0, 5.0])), [0; 3]);
    assert_eq!([0.25, 1.0].map(|resolution| frozen(resolution, [0.3, 0.0])), [0; 2]);
}

#[test]
fn scale_offset_delay_and_range_of_the_map_count_in_this_order() {
    let folder = Folder::new("map");
    let text = "[channel.engine_speed]\nname = \"raw\"\nunit = \"rpm\"\nscale = 0.25\noffset = -10\ndelay_s = 0.02\nvalid_range = [0, 8000]\n";
    let map = ChannelMap::read(&folder.write("map.toml", text)).unwrap();
    let (read, summary, _) = readings("time_s,raw\n0,4000\n0.01,65535\n0.02,4400\n0.03,20\n0.04,4400\n", &map).unwrap();
    assert_eq!((read.len(), count(&summary, Quality::OutOfRange)), (3, 2));
    assert!((read[0].value - 990.0 * std::f64::consts::PI / 30.0).abs() < 1e-12);
    assert!((read[1].time_s - 0.0).abs() < 1e-12 && (read[1].stamp_s - 0.02).abs() < 1e-12);
}

/// A channel whose stamps are said to be late or early stands beside those of its time, and no reading is lost.
#[test]
fn stamps_that_are_late_or_early_are_moved() {
    let mut text = "time_s,n_rpm,m_rpm,k_rpm\n".to_owned();
    (0..50).for_each(|row| writeln!(text, "{1:.2},{0},{0},{0}", 1000 + row, 0.01 * f64::from(row)).unwrap());
    let channel =
        |role: &str, name: &str, late_s: f64| format!("[channel.{role}]\nname = \"{name}\"\nlate_s = {late_s}\n");
    let folder = Folder::new("late");
    let map = [
        channel("engine_speed", "n_rpm", 0.1),
        channel("turbine_speed", "m_rpm", 0.0),
        channel("wheel_speed", "k_rpm", -0.05),
    ];
    let map = ChannelMap::read(&folder.write("map.toml", map.concat())).unwrap();
    let (read, ..) = readings(&text, &map).unwrap();
    assert_eq!(read.len(), 150);
    assert!(read.windows(2).all(|pair| pair[0].stamp_s <= pair[1].stamp_s));
    let mut log = Log::open(&folder.write("log.csv", &text), &map.open).unwrap();
    let steps = Steps::new(Readings::new(&mut log, &map).unwrap()).collect::<Result<Vec<_>, _>>().unwrap();
    let row =
        |reading: Option<car::Reading<f64>>| reading.map(|reading| (reading.value / 0.104_719_755_119_659_77).round());
    let step = steps.iter().find(|step| (step.time_s - 0.2).abs() < 1e-6).unwrap();
    assert_eq!(
        [step.input.engine_rad_s, step.input.turbine_rad_s, step.input.wheel_rad_s].map(row),
        [Some(1030.0), Some(1020.0), Some(1015.0)]
    );
    assert!(step.input.engine_rad_s.is_some_and(|reading| reading.age_s.abs() < 1e-9));
}

#[test]
fn parts_count_where_all_of_them_came() {
    let folder = Folder::new("parts");
    let text = "[channel.wheel_speed]\nnames = [\"rl_rpm\", \"rr_rpm\"]\ncombine = \"mean\"\n[channel.vehicle_speed]\nnames = [\"whole\", \"part\"]\ncombine = \"sum\"\nunit = \"km/h\"\n";
    let map = ChannelMap::read(&folder.write("map.toml", text)).unwrap();
    let log = "time_s,rl_rpm,rr_rpm,whole,part\n0,100,110,20,0.5\n1,100,,20,\n2,100,120,21,0.25\n3,100,130,21,0.5\n4,100,130,21,0.5\n";
    let (read, summary, _) = readings(log, &map).unwrap();
    let of = |role: Role| {
        read.iter().filter(move |reading| reading.role == role).map(|reading| reading.value).collect::<Vec<_>>()
    };
    assert!((of(Role::WheelSpeed)[0] - 105.0 * std::f64::consts::PI / 30.0).abs() < 1e-12);
    assert!((of(Role::VehicleSpeed)[1] - 21.25 / 3.6).abs() < 1e-12);
    assert_eq!((of(Role::WheelSpeed).len(), count(&summary, Quality::Missing)), (4, 2));
}

#[test]
fn what_does_not_fit_says_what_to_do() {
    let cases = [
        ("time_s,n\n0,1\n1,2\n", "engine_speed=n", "channel `n` (engine_speed) has no unit in the log\nhint: give it"),
        (
            "time_s,n [furlong]\n0,1\n1,2\n",
            "engine_speed=n",
            "has the unit `furlong`, which is not known\nhint: the units are rad/s, rpm, ",
        ),
        ("time_s,n [bar]\n0,1\n1,2\n", "engine_speed=n", "is in bar, expected a unit like rad/s\nhint: "),
        (
            "time_s,n [km/h]\n0,1\n1,2\n",
            "wheel_speed=n",
            "the radius of the wheels is not known\nhint: give `gearbox.wheel_radius_m`",
        ),
        (
            "time_s,N_Eng [rpm]\n0,1\n1,2\n",
            "engine_speed=Eng",
            "there is no channel `Eng` for `channel.engine_speed`\nhint: `N_Eng` has a similar name",
        ),
        (
            "time_s,gear,N_Eng [rpm]\n0,1,1\n1,2,1\n",
            "engine_speed=N_Egn",
            "there is no channel `N_Egn` for `channel.engine_speed`\nhint: `N_Eng` has a similar name",
        ),
        (
            "time_s,engine_share,engine_speed_rad_s\n0,1,1\n1,2,1\n",
            "engine_speed=engine_spd",
            "hint: `engine_speed_rad_s` has a similar name",
        ),
        (
            "time_s,n [rad/s]\n0,800\n1,2500\n",
            "engine_speed=n",
            "engine_speed cannot be in rad/s: most values would be about",
        ),
        (
            "time_s,n [rpm],m [rpm]\n0,,1\n1,,2\n",
            "engine_speed=n",
            "the channel of engine_speed has no samples\nhint: ",
        ),
        ("time_s,i [A]\n0,350\n1,700\n", "oncoming_current=i", "it looks like mA\nhint: "),
        (
            "time_s,n [rpm]\n0,800\n1,a\n2,b\n3,x\n",
            "engine_speed=n",
            "3 of 4 samples of engine_speed cannot be used: 3 missing\nhint: ",
        ),
    ];
    for (text, entry, message) in cases {
        let error = readings(text, &map(&[entry])).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(message), "{error} | {message}");
    }
}

#[test]
fn a_channel_is_the_speed_of_one_shaft() {
    let text = "time_s,n [rad/s],l [rad/s],r [rad/s],v [km/h]\n0,300,20,21,22\n0.01,301,20,21,22\n";
    for (one, other) in [
        ("engine_speed=n", "turbine_speed=n"),
        ("turbine_speed=n", "output_speed=n"),
        ("output_speed=l", "wheel_speed=l"),
    ] {
        let error = readings(text, &map(&[one, other])).map(|_| ()).unwrap_err().to_string();
        let [one, other] = [one, other].map(|entry| entry.split('=').next().unwrap());
        assert!(
            error.contains(&format!(" is both {one} and {other}\nhint: these are speeds of two shafts")),
            "{error}"
        );
    }
    // Two wheels are one signal, and the speed of the car may be that of its wheels.
    let mut wheels = map(&["output_speed=n", "wheel_speed=l", "vehicle_speed=v"]);
    wheels.channels[1].names.push("r".to_owned());
    let mut by_wheels = map(&["wheel_speed=v", "vehicle_speed=v"]);
    by_wheels.gearbox.wheel_radius_m = Some(0.3);
    for map in [wheels, by_wheels] {
        assert!(!readings(text, &map).unwrap().0.is_empty());
    }
}

#[test]
fn a_wrong_map_is_refused_with_its_key() {
    let folder = Folder::new("maps");
    for (text, message) in [
        ("[channel.speed]\nname = \"a\"\n", "there is no signal `speed`\nhint: the signals are"),
        ("[channel.gear]\n", "`channel.gear.name` or `channel.gear.names` must name the channel"),
        ("[channel.gear]\nnames = [\"a\", \"b\"]\n", "`channel.gear.combine` is missing"),
        ("[channel.gear]\nname = \"a\"\nscale = 0\n", "`channel.gear.scale` is 0"),
        ("[channel.gear]\nname = \"a\"\nlate_s = -11\n", "`channel.gear.late_s` is -11, expected -10 to 10"),
        ("[channel.gear]\nname = \"a\"\ndelay_s = 100\n", "`channel.gear.delay_s` is 100, expected 0 to 10"),
        ("[channel.gear]\nname = \"a\"\nvalid_range = [1, nan]\n", "`channel.gear.valid_range` is [1, NaN]"),
        ("[gearbox]\nratios = [1.0, 2.0]\n", "`gearbox.ratios`: 1 is followed by 2, expected falling ratios"),
        ("[gearbox]\nwheel_radius_m = -1\n", "`gearbox.wheel_radius_m` is -1"),
        ("[chanel.gear]\nname = \"a\"\n", "unknown key `chanel`"),
    ] {
        let error = ChannelMap::read(&folder.write("map.toml", text)).unwrap_err().to_string();
        assert!(error.contains("map.toml:") && error.contains(message), "{error} | {message}");
    }
}

#[test]
fn every_reading_reaches_the_observer_once_with_its_age() {
    let map = map(&["engine_speed=N_Eng", "turbine_speed=N_Turb"]);
    let mut log = Log::open(&data("bus.log"), &with_dbc()).unwrap();
    let steps: Vec<_> = Steps::new(Readings::new(&mut log, &map).unwrap()).collect::<Result<Vec<_>, _>>().unwrap();
    // Engine at 0, 10, 20 ms ..., turbine 2 ms later: a step has both and is as new as the turbine.
    let engines = steps.iter().filter(|step| step.input.engine_rad_s.is_some()).count();
    let turbines = steps.iter().filter(|step| step.input.turbine_rad_s.is_some()).count();
    // One more frame of the engine comes at the end.
    assert_eq!((engines, turbines, steps.len()), (41, 40, 41));
    for step in &steps[1..40] {
        assert!((step.input.dt_s - 0.01).abs() < 1e-6);
        let age = |reading: Option<car::Reading<f64>>| reading.unwrap().age_s;
        assert!((age(step.input.engine_rad_s) - 0.002).abs() < 1e-6 && age(step.input.turbine_rad_s).abs() < 1e-9);
        assert!(step.input.output_rad_s.is_none() && step.input.command.is_none());
    }
}

#[test]
fn channels_at_several_rates_are_neither_thinned_nor_repeated() {
    let map = map(&["engine_speed=N_Eng", "turbine_speed=N_Turb"]);
    let mut log = Log::open(&data("plain_410.mf4"), &OpenOptions::default()).unwrap();
    let steps: Vec<_> = Steps::new(Readings::new(&mut log, &map).unwrap()).collect::<Result<Vec<_>, _>>().unwrap();
    let engine: Vec<f64> =
        steps.iter().filter_map(|step| step.input.engine_rad_s.map(|reading| step.time_s - reading.age_s)).collect();
    let turbine: Vec<f64> =
        steps.iter().filter_map(|step| step.input.turbine_rad_s.map(|reading| step.time_s - reading.age_s)).collect();
    assert_eq!((engine.len(), turbine.len()), (40, 20));
    for (i, time_s) in (0_u32..).zip(&engine) {
        assert!((time_s - f64::from(i) * 0.01).abs() < 1e-9);
    }
    for (i, time_s) in (0_u32..).zip(&turbine) {
        assert!((time_s - 0.005 - f64::from(i) * 0.025).abs() < 1e-9);
    }
    assert!(steps.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
}

#[test]
fn a_table_with_empty_cells_gives_the_steps_of_channels_with_clocks_of_their_own() {
    // The fast and the slow group of the MDF file by the formulas of `make.py`, in one table.
    let fast = (0..40_u32).map(|i| (f64::from(i) * 0.01, format!("{},", 800 + 10 * i)));
    let slow = (0..20_u32).map(|i| (0.005 + f64::from(i) * 0.025, format!(",{}", 700 + 3 * i)));
    let mut rows: Vec<(f64, String)> = fast.chain(slow).collect();
    rows.sort_by(|one, other| one.0.total_cmp(&other.0));
    let mut text = "time_s,N_Eng [1/min],N_Turb [1/min]\n".to_owned();
    for (time_s, cells) in rows {
        writeln!(text, "{time_s},{cells}").unwrap();
    }
    let folder = Folder::new("clocks");
    let map = map(&["engine_speed=N_Eng", "turbine_speed=N_Turb"]);
    let steps = |path: &std::path::Path| {
        let mut log = Log::open(path, &OpenOptions::default()).unwrap();
        let readings = Readings::new(&mut log, &map).unwrap();
        let mut steps = Steps::new(readings);
        let all = steps.by_ref().collect::<Result<Vec<_>, _>>().unwrap();
        steps.readings().check().unwrap();
        all
    };
    assert_eq!(steps(&folder.write("log.csv", text)), steps(&data("plain_410.mf4")));
}

#[test]
fn rows_of_a_table_make_one_step_each() {
    let folder = Folder::new("rows");
    let text = "time_s,e_rpm,t_rpm,i_ma\n0,900,800,100\n0.01,901,,110\n0.02,902,802,\n";
    let map = map(&["engine_speed=e_rpm", "turbine_speed=t_rpm", "oncoming_current=i_ma"]);
    let mut log = Log::open(&folder.write("log.csv", text), &map.open).unwrap();
    let steps: Vec<_> = Steps::new(Readings::new(&mut log, &map).unwrap()).collect::<Result<Vec<_>, _>>().unwrap();
    let have: Vec<[bool; 3]> = steps
        .iter()
        .map(|step| {
            [step.input.engine_rad_s.is_some(), step.input.turbine_rad_s.is_some(), step.input.command.is_some()]
        })
        .collect();
    assert_eq!(have, [[true, true, true], [true, false, true], [true, true, false]]);
    assert!((steps[0].input.command.unwrap().value - 0.1).abs() < 1e-12);
    assert_eq!(steps.iter().map(|step| step.input.dt_s).collect::<Vec<_>>(), [0.0, 0.01, 0.01]);
}

#[test]
fn a_saturated_signal_of_a_bus_is_not_a_reading() {
    let folder = Folder::new("saturated");
    let path = folder.write("bus.log", "(1.0) can0 100#FFFF000000000000\n(1.1) can0 100#800C000000000000\n");
    let (log, samples, _) = read(&path, &with_dbc()).unwrap();
    let found = crate::common::channel(&log, &samples, "N_Eng");
    assert_eq!((found[0].2, found[1].2, found[1].1), (Quality::Saturated, Quality::Good, 800.0));
}

#[test]
fn an_output_speed_is_negative_in_reverse_and_nowhere_else() {
    let text = |gear: i32| {
        let mut text = "time_s,gear,turbine,output\n".to_owned();
        for i in 0..400 {
            writeln!(text, "{},{gear},{},{}", 0.01 * f64::from(i), 200 + i, -100 - i).unwrap();
        }
        text
    };
    let map = map(&["gear=gear", "turbine_speed=turbine [rad/s]", "output_speed=output [rad/s]"]);
    assert!(readings(&text(-1), &map).is_ok());
    let error = readings(&text(1), &map).unwrap_err().to_string();
    assert!(error.contains("output_speed is negative and turbine_speed positive"), "{error}");
}

/// A drive in a gear of ratio 1.6, row by row at 100 Hz, in which these channels read zero in these rows.
fn with_zeros(zeros: &[(usize, std::ops::Range<u32>)]) -> String {
    let mut text = "time_s,e_rpm,t_rpm,o_rpm,w_rpm\n".to_owned();
    for row in 0..600 {
        let output = 1000.0 + 0.5 * f64::from(row);
        let mut speeds = [1.7 * output, 1.6 * output, output, output / 3.5];
        zeros.iter().filter(|(_, rows)| rows.contains(&row)).for_each(|(at, _)| speeds[*at] = 0.0);
        let [e, t, o, w] = speeds;
        writeln!(text, "{:.2},{e:.1},{t:.1},{o:.1},{w:.2}", 0.01 * f64::from(row)).unwrap();
    }
    text
}

const SPEED_MAP: [&str; 4] = ["engine_speed=e_rpm", "turbine_speed=t_rpm", "output_speed=o_rpm", "wheel_speed=w_rpm"];

#[test]
fn a_zero_while_the_car_drives_is_no_reading_and_its_step_says_that_one_came() {
    let map = map(&SPEED_MAP);
    for at in 0..4 {
        let text = with_zeros(&[(at, 200..350)]);
        let (read, summary, _) = readings(&text, &map).unwrap();
        assert_eq!((count(&summary, Quality::Impossible), read.len()), (150, 2250), "{at}");
        assert!(read.iter().all(|reading| reading.value > 20.0), "{at}");
        let folder = Folder::new("zero");
        let mut log = Log::open(&folder.write("log.csv", &text), &map.open).unwrap();
        let steps: Vec<_> = Steps::new(Readings::new(&mut log, &map).unwrap()).collect::<Result<_, _>>().unwrap();
        assert_eq!(steps.len(), 600);
        for (row, step) in steps.iter().enumerate() {
            let input = &step.input;
            let speeds = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
            let is_refused = speeds.map(|speed| speed.unwrap().value.is_nan());
            assert_eq!(is_refused, std::array::from_fn(|speed| speed == at && (200..350).contains(&row)), "{row}");
        }
    }
}

#[test]
fn a_sensor_that_fails_for_most_of_the_log_does_not_refuse_it() {
    let (_, summary, _) = readings(&with_zeros(&[(3, 100..600)]), &map(&SPEED_MAP)).unwrap();
    assert_eq!(count(&summary, Quality::Impossible), 500);
    // All at once: a bus that sends zeros, for as long as no sensor contradicts it.
    let all: Vec<_> = (0..4).map(|at| (at, 100..300)).collect();
    let (_, summary, _) = readings(&with_zeros(&all), &map(&SPEED_MAP)).unwrap();
    assert_eq!(count(&summary, Quality::Impossible), 800);
}

#[test]
fn a_speed_that_moved_and_stops_is_frozen_from_its_first_equal_sample_on() {
    let mut text = "time_s,t_rpm,o_rpm\n".to_owned();
    for row in 0..400 {
        // Slow at first, where the speeds show how fine they are.
        let output = 1000.0 + if row < 50 { 0.1 * f64::from(row) } else { f64::from(row - 45) };
        let turbine = if (200..230).contains(&row) { 2425.5 } else { 2.1 * output };
        writeln!(text, "{:.2},{turbine:.2},{output:.2}", 0.01 * f64::from(row)).unwrap();
    }
    let (_, summary, _) = readings(&text, &map(&["turbine_speed=t_rpm", "output_speed=o_rpm"])).unwrap();
    let frozen = count(&summary, Quality::Frozen);
    assert_eq!(frozen, 29);
}

#[test]
fn a_smooth_speed_that_sticks_for_a_tenth_of_a_second_is_frozen() {
    // It never changes by less than a third of what it does when it sticks, and the output hardly changes.
    let mut text = "time_s,t_rpm,o_rpm\n".to_owned();
    for row in 0..400 {
        let time = f64::from(row);
        let turbine = 2000.0 + if row < 50 { 1.4 * time } else { 70.0 + 4.1 * (time - 50.0) };
        let turbine = if (300..310).contains(&row) { 3095.0 } else { turbine };
        writeln!(text, "{:.2},{turbine:.6},{:.6}", 0.01 * time, 800.0 + 0.01 * time).unwrap();
    }
    let (_, summary, _) = readings(&text, &map(&["turbine_speed=t_rpm", "output_speed=o_rpm"])).unwrap();
    assert_eq!(count(&summary, Quality::Frozen), 9);
}

#[test]
fn a_fast_engine_that_stops_changing_behind_a_converter_is_frozen() {
    let frozen = |idle_rpm: f64, stands: std::ops::Range<u32>| {
        let mut text = "time_s,e_rpm,t_rpm,o_rpm\n".to_owned();
        for row in 0..600 {
            // It idles for a second, and goes on with a slip of a tenth.
            let output = 800.0 + 2.0 * f64::from(row.max(100) - 100);
            let engine = if row < 100 { idle_rpm } else { 2.2 * output };
            let engine = if stands.contains(&row) { 1760.0 + 4.4 * f64::from(stands.start - 100) } else { engine };
            writeln!(text, "{:.2},{engine:.2},{:.2},{output:.2}", 0.01 * f64::from(row), 1.98 * output).unwrap();
        }
        let roles = ["engine_speed=e_rpm", "turbine_speed=t_rpm", "output_speed=o_rpm"];
        let (_, summary, _) = readings(&text, &map(&roles)).unwrap();
        count(&summary, Quality::Frozen)
    };
    assert_eq!(frozen(800.0, 300..400), 99);
    assert_eq!(frozen(800.0, 0..0), 0);
}

#[test]
fn a_channel_that_shows_the_speed_next_to_it_is_refused_from_its_first_sample_on() {
    let mut text = "time_s,e_rpm,t_rpm,o_rpm\n".to_owned();
    for row in 0..400 {
        let time = f64::from(row);
        // The turbine shows the output, which is a little slower.
        let output = 600.0 + 0.4 * time + 0.3 * (7.3 * time).sin();
        let turbine = 700.0 + 0.4 * time + 0.3 * (5.1 * time).sin();
        let shown = if (200..300).contains(&row) { output } else { turbine };
        writeln!(text, "{:.2},{:.2},{shown:.2},{output:.2}", 0.01 * time, 900.0 + 0.3 * (3.9 * time).sin()).unwrap();
    }
    let roles = ["engine_speed=e_rpm", "turbine_speed=t_rpm", "output_speed=o_rpm"];
    let (read, summary, _) = readings(&text, &map(&roles)).unwrap();
    assert_eq!(count(&summary, Quality::Impossible), 100);
    let wrong =
        read.iter().filter(|reading| reading.role == Role::TurbineSpeed && (1.995..2.995).contains(&reading.stamp_s));
    assert_eq!(wrong.count(), 0);
}
