//! Cars with a whole gearbox whose parameters are off, fitted to a drive in town behind sensors: prints the statistics of many of them.
//!
//! `FIT_CARS=20 cargo run --release -p fit --example gearbox_draws`; `FIT_FIRST` is the first seed, `FIT_DRIVES` how often the drive of
//! three minutes is driven (5), on a road with hills unless `FIT_ROAD=level`; with `FIT_TORQUE=1` the engine torque is reported, with
//! `FIT_WEIGHED=1` the mass is known to a percent, with `FIT_BACKLASH=1` each car has a backlash of its own, with `FIT_CHANNELS=1` the channels of the speeds have delays and a scale, with `FIT_COMMANDS_MS=100` all commands are so late, with `FIT_TIPS=1` each drive has a minute of
//! pressing and releasing the accelerator, and with `FIT_DRIVING=off` driving between shifts is not fitted; `FIT_VEHICLE` the vehicle file (`eight_speed.toml`), `FIT_PRESSURE` the name of an element with a pressure
//! sensor; `FIT_HYSTERESIS=none` says in the error bounds of the file that no valve has a hysteresis; `FIT_CASE=timing` draws lag, delay and hysteresis of each valve too, and with `FIT_CASE=right` the file is the car. With `FIT_ESTIMATE=1` the filter of `estimate` then drives through
//! the WLTC with the given file, with the fitted one without its error bounds, without the check of its valves, and with all of it.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and this one prints a table")]

#[path = "../tests/gearbox/drawn.rs"]
mod drawn;
#[path = "../tests/gearbox/estimated.rs"]
mod estimated;

use std::ops::ControlFlow::Continue;

use car::{Car, Drive, DriveSegment};
use config::DriveFile;
use drawn::{Case, Drawn, FittedFile as _, every_fifth};
use estimated::{Estimated, estimated};
use fit::Known;
use fit::gearbox::{Driving, GearboxFit, Quantity};

/// Of a quantity the error of the fit, and the standard deviations stated and before, in its unknown.
struct Identified {
    name: String,
    error: f64,
    stated: f64,
    before: f64,
}

/// What came of one car.
struct Outcome {
    /// RMS error of the torques by the valve models on held-out shifts, N m: given file, fitted file.
    torque_n_m: [f64; 2],
    identified: Vec<Identified>,
    channels: Vec<Identified>,
    estimates: Vec<Estimated>,
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

fn outcome(drawn: &Drawn, case: Case, drive: &Drive) -> Outcome {
    let tables = drawn.tables();
    let (recorded, truth) = drawn.driven(drive);
    let is_left_out = std::env::var("FIT_DRIVING").is_ok();
    let driving = if is_left_out { Driving::default() } else { recorded.driving };
    let number = recorded.shifts.len();
    let [mut fitted, held_out] = every_fifth(recorded.shifts);
    // The torques are those with a right channel map.
    let mut in_time = held_out.clone();
    let commands = in_time.iter_mut().flat_map(|log| &mut log.commands).flat_map(|commands| &mut commands.time_s);
    commands.for_each(|time_s| *time_s -= drawn.channels.commands_s);
    if let Ok(name) = std::env::var("FIT_PRESSURE") {
        let at = drawn.file.gearbox.elements.iter().position(|element| element.name == name).unwrap();
        truth.measure(&mut fitted, &tables, tables.place(at).unwrap(), !drawn.seed);
    }
    let begin = std::time::Instant::now();
    let mut iterations = 0;
    let fit = fit::gearbox::fit(&drawn.file, &tables, &fitted, &driving, &mut |_| {
        iterations += 1;
        Continue(())
    })
    .unwrap();
    let seconds = begin.elapsed().as_secs_f64();
    let file = |checked| fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a simulation", checked).unwrap();
    let unchecked = file(None);
    let torque_n_m = [&drawn.file, &unchecked].map(|car| truth.squared_error(car, &in_time).sqrt());
    let checked = fit.validate((&drawn.file, &tables), (&unchecked, &drawn::tables(&unchecked)), &held_out).unwrap();
    let file = file(Some(&checked));
    println!(
        "car {}: {number} shifts, {} skipped, torque N m {:.2} -> {:.2} ({:.2}), turbine rad/s {:.2} -> {:.2} (better {}/{}), valve errors {:.2}, g {:.2}, misfit {:.2}, \
         {iterations} iterations, {seconds:.1} s, converged {}, given file possible {}, kept {}",
        drawn.seed,
        recorded.skipped.len(),
        torque_n_m[0],
        torque_n_m[1],
        torque_n_m[1] / torque_n_m[0],
        checked.turbine_rad_s[0].value,
        checked.turbine_rad_s[1].value,
        checked.better,
        checked.shifts,
        checked.valve_error_scale,
        fit.one_step.gain,
        fit.torque_misfit,
        fit.is_converged,
        fit.statements().iter().any(|line| line.contains("do not ask for another file")),
        fit.reason_against(Some(&checked)).is_some()
    );
    for (place, fill) in fit.fills.iter().enumerate() {
        let Some(fill) = fill.filter(|fill| fill.shifts > 0) else { continue };
        let at = (0..drawn.fill.len()).find(|at| tables.place(*at) == Some(place)).unwrap();
        let truth = drawn.fill[at].ln();
        println!(
            "{}: fill {:+.3}, true {truth:+.3}, sd {:.3} of {:.3}, off by {:+.1} sd, {} shifts",
            fit.quantities.elements[place],
            fill.log_volume,
            fill.sd[0],
            fill.sd[1],
            (fill.log_volume - truth) / fill.sd[0],
            fill.shifts
        );
    }
    let truth = drawn.truth.backlash_rad;
    match &fit.backlash {
        Ok(found) => println!(
            "backlash {:.4} rad, true {truth:.4}, sd {:.4}, off by {:+.1} sd, {} reversals",
            found.rad,
            found.sd_rad,
            (found.rad - truth) / found.sd_rad,
            found.reversals
        ),
        Err(reason) => println!("backlash: {reason}"),
    }
    let channels = of_channels(drawn, &fit);
    let quantities = &fit.quantities;
    // The sensor's scale is none of the car, and a gain that is not measured is not fitted.
    let is_known = |quantity: Quantity| match quantity {
        Quantity::PressureScale | Quantity::PressureOffset(_) | Quantity::InputDelay | Quantity::EngineDelay => false,
        Quantity::Gain(place) => quantities.measured[place],
        // Drawn delays are constant, those of the file depend on the command.
        Quantity::Delay(_) => case != Case::WithTiming,
        _ => true,
    };
    let known = quantities.all.iter().enumerate().filter(|(_, quantity)| is_known(**quantity));
    let identified = known.map(|(place, quantity)| Identified {
        name: quantities.name(*quantity),
        error: fit.unknowns[place] - drawn.true_unknown(&tables, quantities, *quantity),
        stated: fit.sd(*quantity),
        before: quantities.sd_before(place),
    });
    let identified = identified.collect();
    let estimates = match std::env::var("FIT_ESTIMATE") {
        Ok(_) => {
            let without = Car { error_bounds: drawn.file.error_bounds.clone(), ..file.car.clone() };
            let cycle = DriveFile::read(&drawn::root().join("drives/wltc_3b.toml")).unwrap();
            estimated(drawn, &cycle, &[drawn.file.car.clone(), without, unchecked.car, file.car])
        }
        Err(_) => Vec::new(),
    };
    Outcome { torque_n_m, identified, channels, estimates }
}

/// What was found of the channels of the speeds and the drive shafts.
fn of_channels(drawn: &Drawn, fit: &GearboxFit) -> Vec<Identified> {
    let identified = |name: &str, known: &Known, truth: f64| {
        let error = known.value - truth;
        println!(
            "{name}: {:+.5}, true {truth:+.5}, sd {:.5}, off by {:+.1} sd",
            known.value,
            known.sd,
            error / known.sd
        );
        Identified { name: name.to_owned(), error, stated: known.sd, before: known.before }
    };
    let channels = drawn.channels;
    let stiffness = |car: &Car| car.driveline.shaft_stiffness_n_m_rad;
    let mut all = Vec::new();
    if let Some(late_s) = fit.commands_late_s() {
        let [late_ms, half_ms] = [late_s.value, 2.0 * late_s.sd].map(|time_s| 1e3 * time_s);
        println!("commands are {late_ms:+.0} +- {half_ms:.0} ms late, true {:+.0} ms", 1e3 * channels.commands_s);
    }
    match &fit.wheel {
        Ok(found) => all.extend([
            identified("wheel speed: scale", &found.scale, channels.wheel_scale),
            identified("wheel speed: delay s", &found.late_s, channels.late_s[3] - channels.late_s[2]),
            identified("drive shafts", &found.stiffness, (stiffness(&drawn.truth) / stiffness(&drawn.file)).ln()),
        ]),
        Err(reason) => println!("wheel speed: {reason}"),
    }
    match &fit.channels.output {
        Ok(found) => all.extend([
            identified("output speed: scale", &found.scale, 0.0),
            identified("output speed: delay s", &found.late_s, channels.late_s[2]),
        ]),
        Err(reason) => println!("output speed: {reason}"),
    }
    let engine = fit.engine_late_s();
    all.extend(engine.map(|found| identified("engine speed: delay s", &found, channels.late_s[0])));
    all
}

/// A drive on a level road.
fn level(drive: &Drive) -> Drive {
    let segments = drive.segments.iter().map(|segment| DriveSegment { grade_rad: [0.0; 2], ..*segment });
    Drive { segments: segments.collect(), ..drive.clone() }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    sum / count
}

/// Of each quantity how many truths lie in the stated 95 %, bias and spread of the errors.
fn print_quantities(outcomes: &[Outcome], identified: fn(&Outcome) -> &[Identified]) {
    let is_inside = |identified: &&Identified| identified.error.abs() <= 1.96 * identified.stated;
    let all = || outcomes.iter().flat_map(identified);
    let mut names: Vec<&str> = Vec::new();
    for identified in all() {
        if !names.contains(&identified.name.as_str()) {
            names.push(&identified.name);
        }
    }
    for name in names {
        let of = || all().filter(|identified| identified.name == name);
        println!(
            "{name:32} cars {} held {:.2} bias {:+.4} rms error {:.4} stated {:.4} before {:.4}",
            of().count(),
            of().filter(is_inside).count() as f64 / of().count() as f64,
            mean(of().map(|identified| identified.error)),
            mean(of().map(|identified| identified.error.powi(2))).sqrt(),
            mean(of().map(|identified| identified.stated.powi(2))).sqrt(),
            mean(of().map(|identified| identified.before))
        );
    }
    println!("all held {:.3}", all().filter(is_inside).count() as f64 / all().count() as f64);
}

fn print_estimates(outcomes: &[Outcome]) {
    let names =
        ["given file", "fitted file, bounds of the given one", "fitted file, valves not checked", "fitted file"];
    for (at, name) in names.into_iter().enumerate() {
        let of = |value: fn(&Estimated) -> f64| -> f64 {
            outcomes.iter().filter_map(|outcome| outcome.estimates.get(at)).map(value).sum()
        };
        let rows = of(|sum| sum.rows);
        if rows > 0.0 {
            println!(
                "{name}: torque estimated {:.2} N m RMS, by the valves alone {:.2}, range {:.1} N m and {:.1} kPa wide, pressure outside in {} and torque in {} of {rows} rows",
                (of(|sum| sum.square) / rows).sqrt(),
                (of(|sum| sum.square_of_valves) / rows).sqrt(),
                of(|sum| sum.width_n_m) / rows,
                1e-3 * of(|sum| sum.width_pa) / rows,
                of(|sum| sum.outside[0]),
                of(|sum| sum.outside[1])
            );
        }
    }
}

fn main() {
    let vehicle = std::env::var("FIT_VEHICLE").unwrap_or("eight_speed.toml".to_owned());
    let (first, cars) = (number("FIT_FIRST", 0), number("FIT_CARS", 3));
    let count = number("FIT_DRIVES", 5).try_into().unwrap();
    let drive = if std::env::var("FIT_TIPS").is_ok() { drawn::with_tip_ins(count) } else { drawn::city(count) };
    let case = match std::env::var("FIT_CASE").as_deref() {
        Err(_) => Case::Usual,
        Ok("timing") => Case::WithTiming,
        Ok("right") => Case::Right,
        Ok(other) => panic!("FIT_CASE={other}"),
    };
    let (is_hilly, is_reported) = (std::env::var("FIT_ROAD").is_err(), std::env::var("FIT_TORQUE").is_ok());
    let has_hysteresis = std::env::var("FIT_HYSTERESIS").is_err();
    let has_backlash = std::env::var("FIT_BACKLASH").is_ok();
    let commands_ms: f64 = std::env::var("FIT_COMMANDS_MS").map_or(0.0, |text| text.parse().unwrap());
    let has_channels = std::env::var("FIT_CHANNELS").is_ok();
    let is_weighed = std::env::var("FIT_WEIGHED").is_ok();
    let of_car = |seed: u64| {
        let drawn = Drawn::of(drawn::car(&vehicle), seed, case);
        let drawn = if is_reported { drawn.with_reported(case) } else { drawn };
        let drawn = if is_weighed { drawn.weighed() } else { drawn };
        let drawn = if has_hysteresis { drawn } else { drawn.without_hysteresis() };
        let drawn = if has_backlash { drawn.with_backlash() } else { drawn };
        let mut drawn = if has_channels { drawn.with_channels() } else { drawn };
        drawn.channels.commands_s = 1e-3 * commands_ms;
        let drive = if is_hilly { drawn::hilly(&drive, seed) } else { level(&drive) };
        outcome(&drawn, case, &drive)
    };
    let outcomes: Vec<Outcome> = (first..first + cars).map(of_car).collect();
    print_quantities(&outcomes, |outcome| &outcome.identified);
    print_quantities(&outcomes, |outcome| &outcome.channels);
    print_estimates(&outcomes);
    let rms = [0, 1].map(|which| mean(outcomes.iter().map(|outcome| outcome.torque_n_m[which].powi(2))).sqrt());
    let mut ratios: Vec<f64> = outcomes.iter().map(|outcome| outcome.torque_n_m[1] / outcome.torque_n_m[0]).collect();
    ratios.sort_by(f64::total_cmp);
    println!(
        "torque N m {:.2} -> {:.2} ({:.3}), median ratio {:.2}, better in {} of {}",
        rms[0],
        rms[1],
        rms[1] / rms[0],
        ratios[ratios.len() / 2],
        ratios.iter().filter(|ratio| **ratio < 1.0).count(),
        ratios.len()
    );
}
