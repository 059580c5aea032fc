//! Every shift between neighbouring gears of every gearbox that ships with the program, in all four kinds.

use car::Car;
use config::Source;
use plant::car::{CarCalibration, CarModel, CarShift, CarShiftQuality, simulate_car_shift};

use super::{HeldGear, calibrated, cars, neighbours, runs};

/// Without power, and from little to much.
const THROTTLES: [f64; 5] = [0.0, 0.1, 0.2, 0.4, 0.7];

/// The largest of each number of a shift that is accepted, in the order of [`numbers`].
type Limits = [f64; NUMBERS.len()];

/// Time, s; flare, slip beyond the new gear, rad/s; torque of the clutches against each other, N m; slip of a held element,
/// rad/s; jerk, m/s^3.
const NUMBERS: [&str; 6] =
    ["complete_s", "flare_rad_s", "past_synchronous_rad_s", "tie_up_n_m", "held_slip_rad_s", "jerk_m_s3"];

fn numbers(q: &CarShiftQuality) -> Limits {
    let complete_s = q.complete_s.unwrap_or(f64::INFINITY);
    [complete_s, q.flare_rad_s, q.past_synchronous_rad_s, q.tie_up_n_m, q.held_slip_rad_s, q.jerk_m_s3]
}

/// Simulates every shift of these cars whose clutches have this fraction of their nominal friction, prints the worst of each
/// number, and refuses those beyond the limits.
fn each_shift(title: &str, cars: Vec<Car>, friction: f64, limits: Limits) {
    let mut worst: [(f64, String); NUMBERS.len()] = std::array::from_fn(|_| (0.0, String::new()));
    let (mut shifts, mut beyond) = (0, Vec::new());
    for (calibration, nominal) in calibrated(cars) {
        let model = CarModel::new(nominal.clone().with_friction(friction)).unwrap();
        for (from, to) in runs(neighbours(&nominal)) {
            for throttle in THROTTLES {
                let shift = CarShift::usual(&nominal, from, to, throttle);
                let name = |gear: usize| nominal.gearbox.gears[gear].name.as_str();
                let more = if calibration == CarCalibration::COMFORT { ", comfort" } else { "" };
                let (from_name, to_name) = (name(from), name(to));
                let label = format!("{} {from_name}-{to_name}, throttle {throttle}{more}", nominal.gearbox.name);
                let mut held = HeldGear::default();
                let quality = simulate_car_shift(&model, &nominal, calibration, &shift, |sample| {
                    held.check(&nominal, sample, &label);
                });
                let quality = quality.unwrap_or_else(|error| panic!("{label}: {error}"));
                for (worst, number) in worst.iter_mut().zip(numbers(&quality)) {
                    if number > worst.0 {
                        *worst = (number, label.clone());
                    }
                }
                if numbers(&quality).iter().zip(&limits).any(|(number, limit)| number.is_nan() || number >= limit) {
                    beyond.push(format!("{label}: {quality:?}"));
                }
                shifts += 1;
            }
        }
    }
    println!("{title}, friction {friction}, {shifts} shifts, {} beyond the limits", beyond.len());
    for (name, (number, label)) in NUMBERS.iter().zip(&worst) {
        println!("  {name} {number:.2} ({label})");
    }
    assert!(beyond.is_empty(), "{}", beyond.join("\n"));
}

#[test]
fn every_shift_of_every_gearbox_is_good() {
    // The two clutches may work against each other with less than half of a small turbine torque.
    each_shift("nominal", cars(), 1.0, [1.6, 5.0, 10.0, 50.0, 0.1, 25.0]);
}

/// The pistons have a stroke: the controller fills the clutches.
#[test]
fn every_shift_with_pistons_that_have_a_stroke_is_good() {
    let cars = cars().into_iter().map(super::with_stroke).collect();
    each_shift("with stroke", cars, 1.0, [1.8, 5.0, 10.0, 50.0, 0.1, 25.0]);
}

/// The same maps over a mirrored current: the same pressures at the same times.
#[test]
fn normally_high_valves_shift_as_normally_low_ones() {
    let low = cars().swap_remove(0);
    let mut high = low.clone();
    for clutch in high.clutches.iter_mut().flatten() {
        let maps = *clutch.valve.maps().unwrap();
        clutch.valve = drivetrain::ClutchValve::NormallyHigh { maps, zero_pressure_a: 1.2 };
    }
    let recorded = |car: &Car| {
        let (model, mut samples) = (CarModel::new(car.clone()).unwrap(), Vec::new());
        let shift = CarShift::usual(car, 2, 3, 0.2);
        simulate_car_shift(&model, car, CarCalibration::STANDARD, &shift, |sample| samples.push(*sample)).unwrap();
        samples
    };
    for (low, high) in recorded(&low).iter().zip(&recorded(&high)) {
        for element in 0..5 {
            let of = |sample: &plant::car::CarSample| sample.pressures_pa[element];
            assert!((of(low) - of(high)).abs() < 1.0, "{}: {element}", low.time_s);
            assert!((low.commands[element] + high.commands[element] - 1.2).abs() < 1e-9);
        }
    }
}

/// Pulse-width valves answer to a duty cycle and have a lag that depends on the pressure drop.
#[test]
fn pulse_width_valves_shift_too() {
    let car = car!(
        "gearboxes/8hp.toml",
        "[valve]\nkind = \"pulse-width\"\nflow_sqrt_pa_s = 2e4\nline_pressure_pa = 1.7e6\n\
         delay = { duty_percent = [0.0, 100.0], delay_s = [0.01, 0.01] }\n"
    );
    let model = CarModel::new(car).unwrap();
    for (calibration, (from, to)) in calibrated(neighbours(&model.car)) {
        for throttle in [0.0, 0.2] {
            let shift = CarShift::usual(&model.car, from, to, throttle);
            let quality = simulate_car_shift(&model, &model.car, calibration, &shift, |_| {}).unwrap();
            assert!(quality.complete_s.is_some_and(|time_s| time_s < 2.0), "{from}-{to} {throttle}: {quality:?}");
            assert!(quality.flare_rad_s < 15.0, "{from}-{to} {throttle}: {quality:?}");
        }
    }
}

#[test]
fn with_friction_15_percent_off_every_shift_is_completed_and_flares_are_caught() {
    for friction in [0.85, 1.15] {
        each_shift("nominal", cars(), friction, [1.8, 5.0, 10.0, 70.0, 0.1, 25.0]);
    }
}

#[test]
fn with_a_stroke_and_friction_15_percent_off_every_shift_is_completed_and_flares_are_caught() {
    for friction in [0.85, 1.15] {
        let cars = cars().into_iter().map(super::with_stroke).collect();
        each_shift("with stroke", cars, friction, [2.0, 5.0, 10.0, 70.0, 0.1, 25.0]);
    }
}

/// Cold oil fills slowly, as the controller knows: up to 1 s longer than warm oil.
#[test]
fn with_cold_oil_the_fill_takes_longer_and_the_shift_is_good() {
    let cars = cars().into_iter().map(|mut car| {
        for clutch in car.clutches.iter_mut().flatten() {
            clutch.cylinder = clutch.cylinder.with_oil(0.0);
        }
        super::with_stroke(car)
    });
    each_shift("oil of 0 degC", cars.collect(), 1.0, [2.5, 5.0, 10.0, 50.0, 0.1, 25.0]);
}
