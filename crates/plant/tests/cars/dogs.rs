//! Shifts in which a dog takes or gives up the load.

use car::Car;
use config::Source;
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, CarShift, CarShiftQuality, Driver, simulate_car_shift};

use super::calibrated;

/// The shifts of the nine-speed gearbox in which a dog changes, each with the dog.
const SHIFTS: [([&str; 2], &str); 4] = [(["4", "5"], "F"), (["5", "4"], "F"), (["7", "8"], "A"), (["8", "7"], "A")];

fn nine_speed() -> Car {
    car!("gearboxes/9hp48.toml", "")
}

fn element(car: &Car, name: &str) -> usize {
    car.gearbox.elements.iter().position(|element| element.name == name).unwrap()
}

/// A shift between two gears with this friction of the plates over the nominal one: how it went, and its samples.
fn shift(
    calibration: CarCalibration,
    gears: [&str; 2],
    [throttle, friction]: [f64; 2],
) -> (CarShiftQuality, Vec<CarSample>) {
    let car = nine_speed();
    let model = CarModel::new(car.clone().with_friction(friction)).unwrap();
    let [from, to] = gears.map(|gear| car.gearbox.gear(gear).unwrap());
    let shift = CarShift { duration_s: 5.0, ..CarShift::usual(&car, from, to, throttle) };
    let mut samples = Vec::new();
    let quality = simulate_car_shift(&model, &car, calibration, &shift, |sample| samples.push(*sample)).unwrap();
    (quality, samples)
}

#[test]
fn every_shift_of_a_dog_is_good_with_any_friction_and_throttle() {
    let mut worst = [0.0_f64; 4];
    for (calibration, (gears, _)) in calibrated(SHIFTS) {
        for throttle in [0.0, 0.05, 0.1, 0.3, 0.6] {
            for friction in [0.85, 1.0, 1.15] {
                let (quality, _) = shift(calibration, gears, [throttle, friction]);
                let label = format!("{gears:?}, throttle {throttle}, friction {friction}: {quality:?}");
                let time_s = quality.complete_s.unwrap_or_else(|| panic!("{label}"));
                let numbers = [time_s, quality.flare_rad_s, quality.past_synchronous_rad_s, quality.held_slip_rad_s];
                worst.iter_mut().zip(numbers).for_each(|(worst, number)| *worst = worst.max(number));
            }
        }
    }
    let [longest_s, flare, overshoot, held] = worst;
    println!(
        "shifts of dogs: longest {longest_s:.2} s, flare {flare:.1}, overshoot {overshoot:.1}, held slip {held:.2} rad/s"
    );
    assert!(longest_s < 2.0 && flare < 3.5 && overshoot < 5.0 && held < 0.01);
}

#[test]
fn a_dog_comes_out_without_load_and_goes_in_at_synchronous_speed() {
    let car = nine_speed();
    for (calibration, (gears, dog)) in calibrated(SHIFTS) {
        let at = element(&car, dog);
        for throttle in [0.0, 0.2] {
            let (_, samples) = shift(calibration, gears, [throttle, 1.0]);
            let slips = |sample: &CarSample| sample.slips_rad_s[at].abs() > 0.1;
            let label = format!("{gears:?}, throttle {throttle}");
            if gears[0] < gears[1] {
                let out = samples.iter().position(slips).unwrap();
                // Between two samples the torque goes on.
                let held_n_m = samples[out - 1].torques.elements_n_m[at];
                assert!(held_n_m.abs() < 12.0, "{label}: {held_n_m}");
            } else {
                let inside = samples.iter().rposition(slips).unwrap();
                let sample = &samples[inside];
                let per_turbine =
                    car.gearbox.shift(sample.gears().from.place().unwrap(), sample.gears().to.place().unwrap());
                let alpha = per_turbine.unwrap().reduced.unwrap().slip_oncoming[0];
                let slip_rad_s = sample.slips_rad_s[at] / alpha;
                assert!(
                    slip_rad_s.abs() < 8.0 && sample.turbine_n_m > 0.0,
                    "{label}: {slip_rad_s}, {}",
                    sample.turbine_n_m
                );
            }
        }
    }
}

#[test]
fn neutral_is_reached_from_the_lowest_gears_and_reverse_is_refused_with_the_reason() {
    let car = nine_speed();
    let model = CarModel::new(car.clone()).unwrap();
    let first = car.gearbox.gear("1").unwrap();
    let standing = Driver { throttle: 0.0, brake: 0.6, grade_rad: 0.0 };
    let state = model.in_gear(first, None, 0.0, 0.0).unwrap();
    let mut run = CarRun::new(&model, &car, CarCalibration::COMFORT, first, state, (standing, 0.01)).unwrap();
    run.request_neutral().unwrap();
    let mut last = None;
    for _ in 0..200 {
        run.advance(standing, |_| {}, |sample| last = Some(*sample)).unwrap();
    }
    let neutral = last.unwrap();
    assert!(
        neutral.is_neutral && neutral.torques.turbine_rad_s > 50.0 && neutral.output_n_m.abs() < 25.0,
        "{}",
        neutral.output_n_m
    );
    let error = run.request(car.gearbox.gear("R").unwrap()).unwrap_err().to_string();
    assert!(error.contains("gear R does not follow from neutral by one clutch"), "{error}");
    run.request(first).unwrap();
    for _ in 0..300 {
        run.advance(standing, |_| {}, |sample| last = Some(*sample)).unwrap();
    }
    let engaged = last.unwrap();
    assert!(
        !engaged.is_neutral && engaged.torques.turbine_rad_s.abs() < 1.0 && engaged.output_n_m > 50.0,
        "{engaged:?}"
    );
}
