//! From neutral to a gear at rest, and from one direction to the other.

use car::Car;
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, Driver};

use super::{HeldGear, calibrated, cars, with_stroke};

const STANDING: Driver = Driver { throttle: 0.0, brake: 0.6, grade_rad: 0.0 };

/// What happened in the seconds after a request.
struct Engaged {
    complete_s: Option<f64>,
    samples: Vec<CarSample>,
}

impl Engaged {
    fn after(car: &Car, run: &mut CarRun<'_>, duration_s: f64) -> Self {
        let begun_s = run.time_s();
        let mut held = HeldGear::default();
        let mut result = Self { complete_s: None, samples: Vec::new() };
        while run.time_s() < begun_s + duration_s {
            let record = |sample: &CarSample| {
                held.check(car, sample, "at rest");
                result.samples.push(*sample);
            };
            run.advance(STANDING, |_| {}, record).unwrap();
            if run.controller().shift().is_none() && run.time_s() > begun_s + 0.05 {
                result.complete_s = result.complete_s.or(Some(run.time_s() - begun_s));
            }
        }
        result
    }

    /// Largest torque at the gearbox output in the direction of that at the end, over it.
    fn overshoot(&self) -> f64 {
        let end = self.samples.last().map_or(1.0, |sample| sample.output_n_m);
        self.samples.iter().map(|sample| sample.output_n_m / end).fold(0.0, f64::max)
    }

    /// Largest change of the output torque in 10 ms, N m, over its end.
    fn jolt(&self) -> f64 {
        let change = |pair: &[CarSample]| (pair[1].output_n_m - pair[0].output_n_m).abs();
        let end = self.samples.last().map_or(1.0, |sample| sample.output_n_m.abs());
        self.samples.windows(2).map(change).fold(0.0, f64::max) / end
    }
}

#[test]
fn a_gear_is_engaged_from_neutral_and_from_the_other_direction() {
    let (mut longest, mut overshoot, mut jolt) = (0.0_f64, 0.0_f64, [0.0_f64; 2]);
    let automatics = || cars().into_iter().take(4).chain([super::one_way()]);
    for (calibration, car) in calibrated(automatics().chain(automatics().map(with_stroke))) {
        let model = CarModel::new(car.clone()).unwrap();
        let (first, reverse) = (car.gearbox.gear("1").unwrap(), car.gearbox.gear("R").unwrap());
        let state = model.in_gear(first, None, 0.0, 0.0).unwrap();
        let start = (STANDING, 0.01);
        let mut run = CarRun::new(&model, &car, calibration, first, state, start).unwrap();
        run.request_neutral().unwrap();
        let neutral = Engaged::after(&car, &mut run, 3.0);
        let last = neutral.samples.last().unwrap();
        // The open clutches drag.
        assert!(last.is_neutral && last.output_n_m.abs() < 15.0, "{}: {}", car.gearbox.name, last.output_n_m);
        let slip = last.torques.engine_rad_s - last.torques.turbine_rad_s;
        assert!(slip < 15.0, "{}: the turbine turns with the engine, slip {slip}", car.gearbox.name);
        // N-D, D-R, R-D.
        for (turns, gear, sign) in [(0, first, 1.0), (1, reverse, -1.0), (1, first, 1.0)] {
            run.request(gear).unwrap();
            let engaged = Engaged::after(&car, &mut run, 4.0);
            let label = format!("{} to gear {}", car.gearbox.name, car.gearbox.gears[gear].name);
            assert_eq!(run.controller().gear(), gear, "{label}");
            let last = engaged.samples.last().unwrap();
            assert!(!last.is_neutral && sign * last.output_n_m > 50.0, "{label}: {}", last.output_n_m);
            assert!(last.torques.turbine_rad_s.abs() < 1.0 && last.vehicle_m_s.abs() < 0.02, "{label}");
            longest = longest.max(engaged.complete_s.unwrap_or(f64::INFINITY));
            overshoot = overshoot.max(engaged.overshoot());
            jolt[turns] = f64::max(jolt[turns], engaged.jolt());
        }
        run.request_neutral().unwrap();
        assert!(Engaged::after(&car, &mut run, 2.0).samples.last().unwrap().output_n_m.abs() < 15.0);
    }
    println!(
        "engaged at rest: longest {longest:.2} s, overshoot {overshoot:.2}, largest change in 10 ms {jolt:.3?} of the end"
    );
    // From the other direction the change holds the release, too.
    assert!(longest < 2.0 && overshoot < 1.15 && jolt[0] < 0.15 && jolt[1] < 0.3);
}

#[test]
fn neutral_is_refused_where_it_is_not_reached_by_one_clutch() {
    let car = cars().swap_remove(0);
    let model = CarModel::new(car.clone()).unwrap();
    let third = car.gearbox.gear("3").unwrap();
    let state = model.in_gear(third, None, 10.0, 0.1).unwrap();
    let driver = Driver { throttle: 0.1, brake: 0.0, grade_rad: 0.0 };
    let mut run = CarRun::new(&model, &car, CarCalibration::STANDARD, third, state, (driver, 0.01)).unwrap();
    let error = run.request_neutral().unwrap_err().to_string();
    assert!(error.contains("no neutral from gear 3\nhint: it is reached from the lowest gear or reverse"), "{error}");
    run.advance(driver, |_| {}, |_| {}).unwrap();
    let reverse = run.request(car.gearbox.gear("R").unwrap()).unwrap_err().to_string();
    assert!(reverse.contains("only at rest"), "{reverse}");
    assert!(run.request(99).unwrap_err().to_string().contains("no gear number 99"));
}
