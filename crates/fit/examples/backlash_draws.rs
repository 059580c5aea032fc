//! The backlash of cars whose parameters are all off, from drives in which the pedal is pressed and released: prints what was found.
//!
//! `FIT_CARS=16 cargo run --release -p fit --example backlash_draws`; `FIT_DRIVING=3` (2) takes logs of so many minutes.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and this one prints a table")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::ops::ControlFlow::Continue;

use common::{Logs, TestCar, given};

fn main() {
    let number = |name: &str, usual: u32| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (cars, minutes) = (number("FIT_CARS", 16), number("FIT_DRIVING", 2));
    let (mut squares, mut stated, mut outside, mut identified) = (0.0, 0.0, 0, 0);
    for seed in 0..u64::from(cars) {
        let mut car = TestCar::drawn(seed).on_another_road().with_reversals();
        let driving = car.collected(&car.driven(minutes), "backlash").driving;
        let shifts = vec![car.shift(0, Logs::SpeedsAndCurrent).record];
        let fit = fit::fit(&given(&car.file), &shifts, &driving, car.ages(), &mut |_| Continue(())).unwrap();
        let truth = car.car.backlash_rad;
        match &fit.backlash {
            Err(reason) => println!("car {seed}: true {truth:.4}: {reason}"),
            Ok(found) => {
                let error = found.rad - truth;
                println!(
                    "car {seed}: true {truth:.4} rad, found {:.4}, off by {error:+.4}, stated {:.4} ({:+.1}), {} reversals, {}",
                    found.rad,
                    found.sd_rad,
                    error / found.sd_rad,
                    found.reversals,
                    found.verdict().name()
                );
                identified += 1;
                squares += error * error;
                stated += found.sd_rad * found.sd_rad;
                outside += u32::from(error.abs() > 1.96 * found.sd_rad);
            }
        }
    }
    let rms = |sum: f64| (sum / f64::from(identified)).sqrt();
    println!(
        "found in {identified} of {cars}: RMS error {:.4} rad, stated {:.4}, outside of the 95 % {outside}",
        rms(squares),
        rms(stated)
    );
}
