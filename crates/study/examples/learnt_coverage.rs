//! What the gearbox filter learns of sampled cars over a drive, against what they truly are.
//!
//! ```text
//! cargo run --release -p study --example learnt_coverage -- 40 20 2 eight_speed six_speed
//! ```
//!
//! are forty cars of each of two vehicle files, sampled within the whole error budget, twenty repetitions of `drives/city.toml` (an hour), counted
//! after each half; without names, all shipped cars with a whole gearbox. With zero cars the car is that of the file. A name that ends with `.toml` is
//! another drive, as in `-- 40 2 2 eight_speed drives/wltc_3b.toml`, two repetitions of which are an hour. Each line has, for each part
//! of the drive, mean and root mean square of the errors, the mean of the stated standard deviations, and the fraction of the true values
//! within 1.96 of them.

#![expect(clippy::print_stdout, reason = "an example")]

use std::error::Error;
use std::path::Path;

use car::Drive;
use car::ErrorBudget;
use config::{CarFile, DriveFile};
use study::gearbox::learnt_coverage::{Coverage, LearntDrive, Quantity, Sampled, SampledCar, TorqueErrors, learn};

const CARS: [&str; 5] = ["eight_speed", "six_speed", "four_speed", "ten_speed", "dual_clutch"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: u32| arguments.next().map_or(Ok(default), |text| text.parse::<u32>());
    let (cars, repetitions, parts) = (number(40)?, number(20)?, number(2)? as usize);
    let (drives, names): (Vec<String>, Vec<String>) = arguments.partition(|name| name.ends_with(".toml"));
    let names = if names.is_empty() { CARS.map(str::to_owned).to_vec() } else { names };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let sensors = config::read_sensors(&root.join("experiments/bench.toml"))?.ok_or("the bench has no sensors")?;
    let drive = Drive {
        repetitions,
        ..DriveFile::read(&root.join(drives.first().map_or("drives/city.toml", String::as_str)))?.drive
    };
    let what = if cars == 0 { Sampled::Nothing } else { Sampled::Budget };
    for name in names {
        let car = CarFile::read(&root.join(format!("vehicles/{name}.toml")))?;
        let drives = (1..=u64::from(cars.max(1))).map(|seed| {
            let sampled = SampledCar::new(&car, &ErrorBudget::of_car(&car), what, seed);
            learn(&car, &sampled, &drive, &sensors, (parts, seed))
        });
        print(&name, &drives.collect::<Result<Vec<_>, _>>()?, parts);
    }
    Ok(())
}

fn print(name: &str, drives: &[LearntDrive], parts: usize) {
    println!("{name}: {} cars, {} shifts", drives.len(), drives.iter().map(|drive| drive.shifts).sum::<u32>());
    for quantity in Quantity::ALL {
        let (words, per_unit) = quantity.name();
        let part = |part: usize| {
            let errors = drives.iter().filter_map(|drive| drive.learnt.get(part)).flatten();
            let Some(of) = Coverage::of(quantity, errors) else { return format!(" |{:36}", " not learnt") };
            let [mean, rms, stated] = [of.mean, of.rms, of.standard_deviation].map(|value| per_unit * value);
            format!(" | {mean:+7.2} {rms:7.2} {stated:7.2} {:7.0} % ", 100.0 * of.inside)
        };
        println!("  {words:17}{}", (0..parts).map(part).collect::<String>());
    }
    let torque = |part: usize| {
        let mut all = TorqueErrors::default();
        drives.iter().filter_map(|drive| drive.torques.get(part)).for_each(|errors| all.add(errors));
        format!(" | {:7.2}{:29}", all.rms_n_m(), "")
    };
    println!("  {:17}{}", "torques, N m", (0..parts).map(torque).collect::<String>());
}
