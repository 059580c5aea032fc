//! How every shift between neighbouring gears of the shipped cars feels, by kind.
//!
//! ```text
//! cargo run --release -p study --example shift_comfort -- comfort eight_speed six_speed
//! ```
//!
//! drives the nominal cars of these vehicle files with this calibration, without names all with a whole gearbox. Each line is a shift with what the occupants feel
//! ([`evaluate::shift_comfort`]); a star marks a quantity beyond its bar. Power-on upshifts are made with 30 % throttle, power-on downshifts
//! with 50 %.

#![expect(clippy::print_stdout, reason = "an example")]

use std::error::Error;
use std::path::Path;

use config::CarFile;
use drivetrain::ShiftKind;
use plant::car::{CarCalibration, CarModel};
use study::gearbox::shift_bars::{Bar, Felt, drive};

const CARS: [&str; 7] =
    ["eight_speed", "eight_speed_stroke", "six_speed", "four_speed", "four_speed_one_way", "ten_speed", "dual_clutch"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let calibration = match arguments.next().as_deref() {
        Some("comfort") => CarCalibration::COMFORT,
        None | Some("bench") => CarCalibration::STANDARD,
        Some(other) => return Err(format!("there is no calibration \"{other}\"; there are bench and comfort").into()),
    };
    let names: Vec<String> = arguments.collect();
    let names = if names.is_empty() { CARS.map(str::to_owned).to_vec() } else { names };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut all: Vec<(String, Felt)> = Vec::new();
    for name in &names {
        let car = CarFile::read(&root.join(format!("vehicles/{name}.toml")))?.car;
        let model = CarModel::new(car.clone())?;
        let gears = car.gearbox.forward_gears();
        for (kind, pair) in ShiftKind::ALL.into_iter().flat_map(|kind| gears.windows(2).map(move |pair| (kind, pair))) {
            let [from, to] = if matches!(kind, ShiftKind::PowerOnUp | ShiftKind::PowerOffUp) {
                [pair[0], pair[1]]
            } else {
                [pair[1], pair[0]]
            };
            let label = format!("{name} {}-{}", car.gearbox.gears[from].name, car.gearbox.gears[to].name);
            match drive(&model, &car, calibration, kind, [from, to]) {
                Ok(felt) => all.push((label, felt)),
                Err(error) => println!("{label}, {}: {error}", kind.name()),
            }
        }
    }
    for kind in ShiftKind::ALL {
        let bars = Bar::of(kind);
        println!("{}", kind.name());
        println!("  {:28}{}", "", titles(&bars));
        let shifts: Vec<&(String, Felt)> = all.iter().filter(|(_, felt)| felt.kind == kind).collect();
        for (label, felt) in &shifts {
            let cell = |bar: &Bar| format!("{:>12.2}{}", (bar.value)(felt), if bar.is_met(felt) { " " } else { "*" });
            let (dose, rating) = (felt.comfort.vibration_dose_m_s1_75, felt.rating().unwrap_or(f64::NAN));
            println!("  {label:28}{}{dose:>13.2}{rating:>13.1}", bars.iter().map(cell).collect::<String>());
        }
        let met = |bar: &Bar| shifts.iter().filter(|(_, felt)| bar.is_met(felt)).count();
        let counts = bars.iter().map(|bar| format!("{:>13}", format!("{}/{}", met(bar), shifts.len())));
        println!("  {:28}{}", "within the bar", counts.collect::<String>());
    }
    let is_good = |(_, felt): &&(String, Felt)| Bar::of(felt.kind).iter().all(|bar| bar.is_met(felt));
    println!("{} of {} shifts are within all bars", all.iter().filter(is_good).count(), all.len());
    Ok(())
}

fn titles(bars: &[Bar]) -> String {
    let names = bars.iter().map(|bar| bar.name).chain(["VDV, m/s1.75", "rating"]);
    names.map(|name| format!("{name:>13}")).collect()
}
