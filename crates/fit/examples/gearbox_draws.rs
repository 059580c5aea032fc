//! Cars with a whole gearbox whose parameters are off, fitted to a drive in town behind sensors: prints the statistics of many of them.
//!
//! `FIT_CARS=20 cargo run --release -p fit --example gearbox_draws`; `FIT_FIRST` is the first seed, `FIT_DRIVES` how often the drive of
//! three minutes is driven (5), `FIT_VEHICLE` the vehicle file (`eight_speed.toml`).
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and this one prints a table")]

#[path = "../tests/gearbox/drawn.rs"]
mod drawn;

use drawn::Drawn;
use fit::gearbox::{Quantity, ShiftLog};

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

fn main() {
    let vehicle = std::env::var("FIT_VEHICLE").unwrap_or("eight_speed.toml".to_owned());
    let (first, cars) = (number("FIT_FIRST", 0), number("FIT_CARS", 3));
    let drive = drawn::city(number("FIT_DRIVES", 5).try_into().unwrap());
    let mut all: Vec<Vec<(Quantity, String, f64, f64, f64)>> = Vec::new();
    let mut torques = Vec::new();
    for seed in first..first + cars {
        let drawn = Drawn::of(drawn::car(&vehicle), seed);
        let tables = drawn.tables();
        let (recorded, truth) = drawn.driven(&drive);
        let number = recorded.shifts.len();
        let (held_out, fitted): (Vec<(usize, ShiftLog)>, Vec<(usize, ShiftLog)>) =
            recorded.shifts.iter().cloned().enumerate().partition(|(at, _)| at % 5 == 4);
        let of = |some: Vec<(usize, ShiftLog)>| some.into_iter().map(|(_, log)| log).collect::<Vec<_>>();
        let (held_out, fitted) = (of(held_out), of(fitted));
        let begin = std::time::Instant::now();
        let mut iterations = 0;
        let fit = fit::gearbox::fit(&drawn.file, &tables, &fitted, &mut |_| iterations += 1).unwrap();
        let seconds = begin.elapsed().as_secs_f64();
        let file = fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a simulation").unwrap();
        let error = [&drawn.file, &file].map(|car| truth.squared_error(car, &held_out).sqrt());
        let checked = fit.validate((&drawn.file, &tables), (&file, &drawn::tables(&file)), &held_out).unwrap();
        println!(
            "car {seed}: {number} shifts, {} skipped, torque N m {:.2} -> {:.2} ({:.2}), turbine rad/s {:.2} -> {:.2} (better {}/{}), scale {:.3} g {:.2}, {iterations} iterations {seconds:.2} s, converged {}",
            recorded.skipped.len(),
            error[0],
            error[1],
            error[1] / error[0],
            checked.turbine_rad_s[0],
            checked.turbine_rad_s[1],
            checked.better,
            checked.shifts,
            fit.scale_and_gain[0],
            fit.scale_and_gain[1],
            fit.is_converged
        );
        torques.push(error);
        if seed == first {
            recorded.skipped.iter().take(8).for_each(|reason| println!("  skipped {reason}"));
            println!("  by pair {:?}", fit.by_pair);
        }
        let quantities = &fit.quantities;
        // The simulated drag is another in each shift.
        let known = quantities.all.iter().enumerate().filter(|(_, quantity)| **quantity != Quantity::Drag);
        let rows = known.map(|(place, quantity)| {
            let error = fit.unknowns[place] - drawn.true_unknown(&tables, quantities, *quantity);
            (
                *quantity,
                quantities.name(*quantity),
                error,
                fit.stated[(place, place)].sqrt(),
                quantities.sd_before(place),
            )
        });
        all.push(rows.collect());
    }
    let (mut inside, mut count) = (0, 0);
    let fewest = all.iter().map(Vec::len).min().unwrap();
    for at in 0..fewest {
        let of: Vec<_> = all.iter().map(|rows| &rows[at]).collect();
        let held = of.iter().filter(|row| row.2.abs() <= 1.96 * row.3).count();
        inside += held;
        count += of.len();
        let rms =
            |of: &dyn Fn(usize) -> f64| ((0..all.len()).map(|i| of(i).powi(2)).sum::<f64>() / all.len() as f64).sqrt();
        println!(
            "{:32} held {:.2} bias {:+.4} rms error {:.4} stated {:.4} before {:.4}",
            of[0].1,
            held as f64 / of.len() as f64,
            of.iter().map(|row| row.2).sum::<f64>() / of.len() as f64,
            rms(&|i| all[i][at].2),
            rms(&|i| all[i][at].3),
            of[0].4
        );
    }
    let rms =
        |which: usize| (torques.iter().map(|error| error[which].powi(2)).sum::<f64>() / torques.len() as f64).sqrt();
    let better = torques.iter().filter(|[given, fitted]| fitted < given).count();
    let mut ratios: Vec<f64> = torques.iter().map(|[given, fitted]| fitted / given).collect();
    ratios.sort_by(f64::total_cmp);
    println!(
        "all held {:.3}; torque N m {:.2} -> {:.2} ({:.3}), median ratio {:.2}, better in {better} of {}",
        inside as f64 / count as f64,
        rms(0),
        rms(1),
        rms(1) / rms(0),
        ratios[ratios.len() / 2],
        torques.len()
    );
}
