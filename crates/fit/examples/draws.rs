//! Cars whose parameters are all off, fitted to 20 shifts behind sensors: prints the statistics of many of them.
//!
//! `FIT_CARS=200 cargo run --release -p fit --example draws`; `FIT_CASE=lossy` takes those of a case of `car_of`. The seeds of the
//! cars are their numbers, from `FIT_FIRST` (0) on; `FIT_DRIVING=6` adds a log of so many minutes of driving, with another rolling
//! resistance and air drag than the file's; `FIT_WHEEL=off` leaves out the wheel speed; `FIT_SHIFTS=4` fits so many, `FIT_REPORT=1` prints each car's values; `FIT_LOGS=torque` or `speeds` takes one kind of logs only.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and this one prints a table")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::ops::ControlFlow::Continue;

use config::vehicle::short::{Facts, ValveKind, short_file};
use config::{Source, VehicleFile};

use common::{FittedFile as _, Logs, TestCar, TestShift, given};
use fit::{Map, Parameter};

/// Shifts that are held out: for the errors of the torque, and others with which the fit is checked as `wetclutch fit` does.
const HELD_OUT: u64 = 8;
const CHECKED: u64 = 4;

/// Relative tolerance with which the shifts are integrated: with the plant's usual one, 1e-5, the integration itself damps the oscillation of the
/// shafts, by 1 N m s/rad in place of 20.
const TOLERANCE: f64 = 1e-8;

/// What came of one car.
struct Outcome {
    fit: fit::Fit,
    /// RMS error of the open loop's torque on held-out shifts, N m: given file, fitted file.
    torque_n_m: [f64; 2],
    /// The same of the pressure, Pa.
    pressure_pa: [f64; 2],
    /// Of each parameter the error in stated standard deviations.
    errors: Vec<(String, f64)>,
    /// Error of the logarithm of mass over capacity of the converter, and its stated standard deviation.
    mass: [f64; 2],
    cpu_s: f64,
    iterations: u32,
    /// Why the given file would be kept.
    reason_against: Option<String>,
}

/// A car of a case: `sensors unknown`, `lossy`, `other car`, `other shape`, `hysteresis`, `other converter`, `right file`, `stroke`; all others are cars
/// of the two-speed file.
fn car_of(case: &str, seed: u64) -> TestCar {
    let mut car = match case {
        "other car" => {
            let facts = Facts {
                name: "another car".to_owned(),
                mass_kg: 1800.0,
                wheel_radius_m: 0.33,
                ratio_before: 4.17,
                ratio_after: 2.34,
                final_ratio: 3.2,
                engine_torque_n_m: 250.0,
                valve: ValveKind::Proportional,
            };
            let file = Source::built_in("another car", &short_file(&facts, false).unwrap());
            TestCar::of(VehicleFile::from_source(file).unwrap(), seed)
        }
        "other shape" => TestCar::drawn(seed).with_other_maps(),
        "other converter" => TestCar::drawn(seed).with_other_converter(),
        "right file" => TestCar::drawn(seed).with_the_right_file(),
        "hysteresis" => TestCar::drawn(seed).with_hysteresis(),
        "stroke" => TestCar::with_stroke(seed),
        _ => TestCar::drawn(seed),
    };
    car.tolerance = TOLERANCE;
    if case == "lossy" {
        for sensor in
            [&mut car.sensors.engine, &mut car.sensors.turbine, &mut car.sensors.output, &mut car.sensors.wheel]
        {
            sensor.errors.missing_share = 0.03;
            sensor.errors.outliers = 1.0;
        }
    }
    car
}

/// Time that this thread has run, s, which other programs on the machine do not lengthen; not a number where it is unknown.
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).map_or(f64::NAN, |ns| 1e-9 * ns)
}

fn outcome(case: &str, seed: u64, logs: Logs) -> Outcome {
    let mut car = car_of(case, seed);
    let minutes = std::env::var("FIT_DRIVING").ok().map(|text| text.parse().unwrap());
    if minutes.is_some() {
        car = car.on_another_road();
    }
    let driving = minutes.filter(|minutes| *minutes > 0).map(|minutes| car.driven(minutes));
    let ages = if case == "sensors unknown" { fit::ReadingAges::default() } else { car.ages() };
    let shifts = std::env::var("FIT_SHIFTS").map_or(20, |text| text.parse().unwrap());
    let mut records: Vec<_> = (0..shifts).map(|number| car.shift(number, logs).record).collect();
    if std::env::var("FIT_WHEEL").is_ok_and(|text| text == "off") {
        records.iter_mut().for_each(|record| record.wheel = fit::Series::default());
    }
    let driving = driving.map_or_else(Vec::new, |log| car.collected(&log, "draws").driving);
    let begin_s = cpu_s();
    let mut iterations = 0;
    let fit = fit::fit(&given(&car.file), &records, &driving, ages, &mut |_| {
        iterations += 1;
        Continue(())
    })
    .unwrap();
    let cpu_s = cpu_s() - begin_s;
    let fitted = fit.vehicle_file(&car.file, "a simulation").unwrap();
    let held_out: Vec<TestShift> = (100..100 + HELD_OUT).map(|number| car.shift(number, logs)).collect();
    let mean = |vehicle, at: usize| {
        (held_out.iter().map(|shift: &TestShift| shift.errors(vehicle)[at]).sum::<f64>() / HELD_OUT as f64).sqrt()
    };
    let checked: Vec<_> = (200..200 + CHECKED).map(|number| car.shift(number, logs).record).collect();
    let checked = fit.validate(&given(&car.file), &given(&fitted), &checked, ages).unwrap();
    let reason_against = fit.reason_against(checked.as_ref());
    let errors: Vec<_> = (fit.priors.iter().enumerate())
        .map(|(i, prior)| {
            let error = fit.unknowns[i] - car.true_value(prior.parameter);
            (prior.name.clone(), error / fit.precision.stated[(i, i)].sqrt())
        })
        .collect();
    if let Some(fill) = &fit.fill {
        let error = fill.log_volume - car.fill.ln();
        println!(
            "fill {:+.3}, true {:+.3}, sd {:.3} of {:.3}, off by {:+.1} sd, {}",
            fill.log_volume,
            car.fill.ln(),
            fill.sd[0],
            fill.sd[1],
            error / fill.sd[0],
            fill.verdict().name()
        );
    }
    let of_capacity = [(Parameter::Mass, 1.0), (Parameter::Capacity, -1.0)];
    let mass_error = of_capacity
        .map(|(parameter, power)| power * (fit.unknowns[fit.place(parameter).unwrap()] - car.true_value(parameter)));
    let mass = [mass_error.iter().sum(), fit.combination_sd(&of_capacity)[1]];
    let torque_n_m = [mean(&car.file, 0), mean(&fitted, 0)];
    let pressure_pa = [mean(&car.file, 1), mean(&fitted, 1)];
    Outcome { fit, torque_n_m, pressure_pa, errors, mass, cpu_s, iterations, reason_against }
}

fn print_car(seed: u64, o: &Outcome) {
    let worst = o.errors.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap();
    let freed: Vec<&str> = o.fit.freed.iter().map(|map| map.name()).collect();
    println!(
        "car {seed}: torque N m {:.2} -> {:.2}, pressure kPa {:.2} -> {:.2}, change {:.2} open {:.2}, {} iterations, CPU {:.2} s, worst {} {:+.1}, freed {freed:?}, misfits {:?}, kept {:?}",
        o.torque_n_m[0],
        o.torque_n_m[1],
        1e-3 * o.pressure_pa[0],
        1e-3 * o.pressure_pa[1],
        o.fit.torque_change.rms_n_m,
        2.0 * o.fit.torque_change.open_n_m,
        o.iterations,
        o.cpu_s,
        worst.0,
        worst.1,
        o.fit.misfits,
        o.reason_against
    );
    if std::env::var("FIT_REPORT").is_ok() {
        for (i, (name, error)) in o.errors.iter().enumerate() {
            let sd = o.fit.precision.stated[(i, i)].sqrt();
            println!(
                "  {name:34} {:+.4} sd {sd:.4} of {:.4}, off by {error:+.1}",
                o.fit.unknowns[i], o.fit.priors[i].sd
            );
        }
        println!("  channels {:?}", o.fit.channels);
        o.fit.statements().iter().for_each(|line| println!("  {line}"));
    }
}

/// Of each parameter how many truths lie in the stated 95 %, the mean and the spread of the errors in stated standard deviations.
fn print_parameters(outcomes: &[Outcome]) {
    let mut names: Vec<&String> = Vec::new();
    for (name, _) in outcomes.iter().flat_map(|o| &o.errors) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let (mut inside, mut all) = (0, 0);
    for name in names {
        let of_car = |o: &Outcome| {
            let (i, (_, error)) = o.errors.iter().enumerate().find(|(_, (other, _))| other == name)?;
            Some((*error, o.fit.precision.stated[(i, i)].sqrt(), o.fit.priors[i].sd))
        };
        let found: Vec<(f64, f64, f64)> = outcomes.iter().filter_map(of_car).collect();
        let count = found.len() as f64;
        let held = found.iter().filter(|(error, ..)| error.abs() <= 1.96).count();
        (inside, all) = (inside + held, all + found.len());
        println!(
            "{name:34} cars {count} held {:.2}  mean {:+.2}  spread {:.2}  sd {:.4} of {:.4}",
            held as f64 / count,
            found.iter().map(|(error, ..)| error).sum::<f64>() / count,
            (found.iter().map(|(error, ..)| error * error).sum::<f64>() / count).sqrt(),
            found.iter().map(|(_, sd, _)| sd).sum::<f64>() / count,
            found[0].2
        );
    }
    println!("all held {:.3}; torque scale {:.4}", inside as f64 / all as f64, outcomes[0].fit.torque_scale_sd());
}

fn print_all(outcomes: &[Outcome]) {
    let cars = outcomes.len();
    let rms = |of: &dyn Fn(&Outcome) -> f64| {
        (outcomes.iter().map(|outcome| of(outcome).powi(2)).sum::<f64>() / cars as f64).sqrt()
    };
    let torque = [0, 1].map(|i| rms(&|o| o.torque_n_m[i]));
    let pressure = [0, 1].map(|i| 1e-3 * rms(&|o| o.pressure_pa[i]));
    println!(
        "torque N m: file {:.2}, fitted {:.2}, ratio {:.3}; pressure kPa: file {:.2}, fitted {:.2}; CPU s mean {:.2}, most {:.2}; \
         iterations at most {}",
        torque[0],
        torque[1],
        torque[1] / torque[0],
        pressure[0],
        pressure[1],
        outcomes.iter().map(|o| o.cpu_s).sum::<f64>() / cars as f64,
        outcomes.iter().map(|o| o.cpu_s).fold(0.0, f64::max),
        outcomes.iter().map(|o| o.iterations).max().unwrap_or(0),
    );
    let outside = outcomes.iter().filter(|o| o.mass[0].abs() > 1.96 * o.mass[1]).count();
    println!(
        "mass over converter capacity: error {:.4}, stated {:.4}, outside of its 95 % {outside}; driving {:.0} s",
        rms(&|o| o.mass[0]),
        rms(&|o| o.mass[1]),
        rms(&|o| o.fit.driving_s),
    );
    let count = |is: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| is(o)).count();
    println!(
        "of {cars}: below the file {}, change within what is open {}, kept {}, worse and not kept {}, with a warning of a misfit {}, \
         not converged {}, freed: {:?}",
        count(&|o| o.torque_n_m[1] < o.torque_n_m[0]),
        count(&|o| o.fit.torque_change.rms_n_m <= 2.0 * o.fit.torque_change.open_n_m),
        count(&|o| o.reason_against.is_some()),
        count(&|o| o.reason_against.is_none() && o.torque_n_m[1] >= o.torque_n_m[0]),
        count(&|o| o.fit.statements().iter().any(|line| line.contains("warning: the"))),
        count(&|o| !o.fit.is_converged),
        Map::ALL.map(|map| (map.name(), count(&|o| o.fit.freed.contains(&map)))),
    );
}

fn main() {
    let cars: u64 = std::env::var("FIT_CARS").map_or(10, |text| text.parse().unwrap());
    let case = std::env::var("FIT_CASE").unwrap_or_default();
    let first: u64 = std::env::var("FIT_FIRST").map_or(0, |text| text.parse().unwrap());
    let only = std::env::var("FIT_LOGS").unwrap_or_default();
    for (word, title, logs) in [
        ("speeds", "speeds and current", Logs::SpeedsAndCurrent),
        ("torque", "with engine torque, and pressure in one shift", Logs::TorqueAndOnePressure),
    ] {
        if !only.is_empty() && only != word {
            continue;
        }
        println!("\n{title}: {cars} cars from {first} on");
        let outcomes: Vec<Outcome> = (first..first + cars)
            .map(|seed| {
                let outcome = outcome(&case, seed, logs);
                print_car(seed, &outcome);
                outcome
            })
            .collect();
        print_all(&outcomes);
        print_parameters(&outcomes);
        println!("channels {:?}", outcomes[0].fit.channels);
    }
}
