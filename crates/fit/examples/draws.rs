//! Cars whose parameters are all off, fitted to 20 shifts behind sensors: prints the statistics of many of them.
//!
//! `FIT_CARS=200 cargo run --release -p fit --example draws`; `FIT_CASE=lossy` takes those of a case of `car_of`.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and this one prints a table")]

#[path = "../tests/common/mod.rs"]
mod common;

use config::vehicle::short::{Facts, ValveKind, short_file};
use config::{Source, Vehicle};

use common::{Logs, TestCar, TestShift};

/// What came of one car.
struct Outcome {
    /// RMS error of the open loop's torque on held-out shifts, N m: given file, fitted file.
    torque_n_m: [f64; 2],
    /// The same of the pressure, Pa.
    pressure_pa: [f64; 2],
    /// Of each parameter the error in stated standard deviations.
    errors: Vec<(String, f64)>,
    seconds: f64,
    iterations: u32,
}

/// A car of a case: `sensors unknown`, `lossy`, `other car`, `other shape`; all others are cars of the two-speed file.
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
            TestCar::of(Vehicle::from_source(file).unwrap(), seed)
        }
        _ => TestCar::drawn(seed),
    };
    if case == "lossy" {
        for sensor in
            [&mut car.sensors.engine, &mut car.sensors.turbine, &mut car.sensors.output, &mut car.sensors.wheel]
        {
            sensor.errors.missing_share = 0.03;
            sensor.errors.outliers = 1.0;
        }
    }
    if case == "other shape" {
        let friction = &mut car.car.oncoming.clutch.friction;
        let values: Vec<f64> = friction
            .axis()
            .iter()
            .zip(friction.values())
            .map(|(slip, mu)| mu * (1.0 - 0.25 * (slip / 150.0).min(1.0).sqrt()))
            .collect();
        *friction = drivetrain::Table1::new(friction.axis(), &values).unwrap();
    }
    car
}

fn outcome(case: &str, seed: u64, logs: Logs, count: u64) -> (fit::Fit, Outcome) {
    let mut car = car_of(case, seed);
    let ages = if case == "sensors unknown" { fit::ReadingAges::default() } else { car.ages() };
    let shifts: Vec<TestShift> = (0..count).map(|number| car.shift(number, logs)).collect();
    let records: Vec<_> = shifts.iter().map(|shift| shift.record.clone()).collect();
    let begin = std::time::Instant::now();
    let mut iterations = 0;
    let fit = fit::fit(&car.file, &records, ages, &mut |_| iterations += 1).unwrap();
    let seconds = begin.elapsed().as_secs_f64();
    let fitted = fit.vehicle_file(&car.file, "a simulation").unwrap();
    let held_out: Vec<TestShift> = (100..108).map(|number| car.shift(number, logs)).collect();
    let mean = |vehicle, at: usize| {
        (held_out.iter().map(|shift: &TestShift| shift.errors(vehicle)[at]).sum::<f64>() / 8.0).sqrt()
    };
    let errors = (fit.priors.iter().enumerate())
        .map(|(i, prior)| {
            let truth = car.truth.iter().find(|(parameter, _)| *parameter == prior.parameter).unwrap().1;
            (prior.name.clone(), (fit.unknowns[i] - truth) / fit.precision.stated[(i, i)].sqrt())
        })
        .collect();
    let outcome = Outcome {
        torque_n_m: [mean(&car.file, 0), mean(&fitted, 0)],
        pressure_pa: [mean(&car.file, 1), mean(&fitted, 1)],
        errors,
        seconds,
        iterations,
    };
    (fit, outcome)
}

fn main() {
    let cars: u64 = std::env::var("FIT_CARS").map_or(10, |text| text.parse().unwrap());
    let case = std::env::var("FIT_CASE").unwrap_or_default();
    let first: u64 = std::env::var("FIT_FIRST").map_or(0, |text| text.parse().unwrap());
    for (title, logs) in [
        ("speeds and current", Logs::SpeedsAndCurrent),
        ("with engine torque, and pressure in one shift", Logs::TorqueAndOnePressure),
    ] {
        let outcomes: Vec<(fit::Fit, Outcome)> =
            (first..first + cars).map(|seed| outcome(&case, seed, logs, 20)).collect();
        let rms = |of: &dyn Fn(&Outcome) -> f64| {
            (outcomes.iter().map(|(_, outcome)| of(outcome).powi(2)).sum::<f64>() / cars as f64).sqrt()
        };
        println!("\n{title}: {cars} cars");
        for (seed, (_, o)) in outcomes.iter().enumerate() {
            let worst = o.errors.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())).unwrap();
            println!(
                "car {seed}: torque N m {:.2} -> {:.2}, pressure kPa {:.2} -> {:.2}, {} iterations, worst {} {:+.1}",
                o.torque_n_m[0],
                o.torque_n_m[1],
                1e-3 * o.pressure_pa[0],
                1e-3 * o.pressure_pa[1],
                o.iterations,
                worst.0,
                worst.1
            );
        }
        println!(
            "torque N m: file {:.2}, fitted {:.2}; pressure kPa: file {:.2}, fitted {:.2}; seconds {:.2}, iterations {}",
            rms(&|o| o.torque_n_m[0]),
            rms(&|o| o.torque_n_m[1]),
            1e-3 * rms(&|o| o.pressure_pa[0]),
            1e-3 * rms(&|o| o.pressure_pa[1]),
            outcomes.iter().map(|(_, o)| o.seconds).sum::<f64>() / cars as f64,
            outcomes.iter().map(|(_, o)| o.iterations).max().unwrap_or(0),
        );
        let better = outcomes.iter().filter(|(_, o)| o.torque_n_m[1] < o.torque_n_m[0]).count();
        println!("below the file: {better} of {cars}");
        let (mut inside, mut all) = (0, 0);
        for (i, prior) in outcomes[0].0.priors.iter().enumerate() {
            let errors: Vec<f64> = outcomes.iter().map(|(_, o)| o.errors[i].1).collect();
            let held = errors.iter().filter(|error| error.abs() <= 1.96).count();
            (inside, all) = (inside + held, all + errors.len());
            let sd = outcomes.iter().map(|(fit, _)| fit.precision.stated[(i, i)].sqrt()).sum::<f64>() / cars as f64;
            let mean = errors.iter().sum::<f64>() / cars as f64;
            println!(
                "{:34} held {:.2}  mean {mean:+.2}  spread {:.2}  sd {sd:.4} of {:.4}",
                prior.name,
                held as f64 / cars as f64,
                (errors.iter().map(|e| e * e).sum::<f64>() / cars as f64).sqrt(),
                prior.sd
            );
        }
        let scale = outcomes[0].0.torque_scale_sd();
        println!("all held {:.3}; torque scale {scale:.4}", inside as f64 / all as f64);
        println!("channels {:?}", outcomes[0].0.channels);
    }
}
