//! Gears that a one-way clutch in series with a clutch or brake holds, as the sprags of a TH400 and of a 4L60-E.

use car::Car;
use config::Source;
use drivetrain::PeakJerk;
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, CarShift, CarShiftQuality, Driver, simulate_car_shift};

use super::{HeldGear, neighbours};

fn series() -> [Car; 2] {
    [car!("gearboxes/th400.toml", ""), car!("gearboxes/4l60e.toml", "")]
}

fn driver(throttle: f64) -> Driver {
    Driver { throttle, brake: 0.0, grade_rad: 0.0 }
}

/// Simulates a shift between gears by their places. No one-way clutch pulls or slips in the direction in which it holds.
fn shift(model: &CarModel, (from, to): (usize, usize), throttle: f64) -> (CarShiftQuality, CarSample) {
    let gearbox = &model.car.gearbox;
    let shift = CarShift::usual(&model.car, from, to, throttle);
    let (mut last, mut held) = (None, HeldGear::default());
    let quality = simulate_car_shift(model, &model.car, CarCalibration::STANDARD, &shift, |sample| {
        held.check(&model.car, sample, &format!("{} {from}-{to}, throttle {throttle}", gearbox.name));
        for element in (0..gearbox.elements.len()).filter(|&element| gearbox.is_one_way(element)) {
            let (slip, torque) = (sample.slips_rad_s[element], sample.torques.elements_n_m[element]);
            assert!(slip < 1e-6 && torque > -1e-6, "{from}-{to}, {:.2} s: {slip} {torque}", sample.time_s);
        }
        last = Some(*sample);
    });
    (quality.unwrap(), last.unwrap())
}

/// In the limits of the shifts of other gearboxes.
#[test]
fn every_shift_through_a_sprag_in_series_is_good_with_any_friction() {
    let mut longest_s: f64 = 0.0;
    for nominal in series() {
        for friction in [0.85, 1.0, 1.15] {
            let model = CarModel::new(nominal.clone().with_friction(friction)).unwrap();
            for (pair, throttle) in
                neighbours(&nominal).into_iter().flat_map(|pair| [0.0, 0.1, 0.2, 0.4, 0.7].map(|t| (pair, t)))
            {
                let (q, _) = shift(&model, pair, throttle);
                let label = format!("{} {pair:?}, friction {friction}, throttle {throttle}: {q:?}", nominal.name);
                longest_s = longest_s.max(q.complete_s.unwrap_or_else(|| panic!("{label}")));
                assert!(q.flare_rad_s < 5.0 && q.past_synchronous_rad_s < 10.0 && q.tie_up_n_m < 50.0, "{label}");
                assert!(q.held_slip_rad_s < 0.1 && q.jerk_m_s3 < 25.0, "{label}");
            }
        }
    }
    println!("shifts through a sprag in series: longest {longest_s:.2} s");
    assert!(longest_s < 1.8);
}

#[test]
fn without_power_a_gear_with_a_sprag_in_series_is_neutral_and_the_others_brake() {
    for car in series() {
        let model = CarModel::new(car).unwrap();
        let gearbox = &model.car.gearbox;
        for (from, to) in neighbours(&model.car) {
            let last = shift(&model, (from, to), 0.0).1;
            let label = format!("{} {from}-{to}: {:?}", gearbox.name, last.torques);
            let slip = last.torques.turbine_rad_s - gearbox.gears[to].ratio * last.torques.output_rad_s;
            if gearbox.one_way_clutch_of(to).is_some() {
                assert!(last.torques.turbine_rad_s < 100.0 && last.output_n_m.abs() < 10.0, "{label}");
                assert!(slip < -10.0, "{label}");
            } else {
                assert!(slip.abs() < 1e-6 && last.output_n_m < -5.0, "{label}");
            }
        }
    }
}

#[test]
fn a_pedal_that_is_pressed_after_coasting_with_an_overrunning_sprag_is_answered_without_a_jolt() {
    for car in series() {
        let model = CarModel::new(car).unwrap();
        let second = model.car.gearbox.gear("2").unwrap();
        for throttle in [0.1, 0.3, 1.0] {
            let state = model.in_gear(second, None, 12.0, 0.0).unwrap();
            let start = (driver(0.0), 0.01);
            let mut run = CarRun::new(&model, &model.car, CarCalibration::STANDARD, second, state, start).unwrap();
            let (mut jerk, mut fell, mut slip) = (PeakJerk::default(), 0.0_f64, 0.0);
            while run.time_s() < 5.0 {
                let pedal = if run.time_s() < 2.0 { 0.0 } else { throttle };
                let record = |sample: &CarSample| {
                    let ratio = model.car.gearbox.gears[second].ratio;
                    slip = sample.torques.turbine_rad_s - ratio * sample.torques.output_rad_s;
                    fell = fell.min(slip);
                    jerk.acceleration(sample.time_s, sample.vehicle_m_s2);
                };
                run.advance(driver(pedal), |_| {}, record).unwrap();
            }
            let label = format!("{}, throttle {throttle}: fell by {fell}, slip {slip}", model.car.name);
            assert!(fell < -10.0 && slip.abs() < 1e-6 && jerk.peak_m_s3().unwrap() < 25.0, "{label}: {jerk:?}");
        }
    }
}

/// Back to the gear before at any time of the shift, with power and without.
#[test]
fn a_change_of_mind_in_a_shift_through_a_sprag_in_series_ends_well() {
    for car in series() {
        let model = CarModel::new(car).unwrap();
        for (from, to) in neighbours(&model.car) {
            for (throttle, back_s) in [0.0, 0.2, 0.5].into_iter().flat_map(|t| [0.1, 0.4, 0.7].map(|s| (t, s))) {
                let label = format!("{} {from}-{to}-{from} after {back_s} s, throttle {throttle}", model.car.name);
                let shift = CarShift::usual(&model.car, from, to, throttle);
                let state = model.in_gear(from, None, shift.vehicle_m_s, throttle).unwrap();
                let start = (driver(throttle), 0.01);
                let mut run = CarRun::new(&model, &model.car, CarCalibration::STANDARD, from, state, start).unwrap();
                let mut jerk = PeakJerk::default();
                while run.time_s() < 5.0 {
                    if run.time_s() > 1.0 {
                        run.request(if run.time_s() < 1.0 + back_s { to } else { from }).unwrap();
                    }
                    let record = |sample: &CarSample| jerk.acceleration(sample.time_s, sample.vehicle_m_s2);
                    run.advance(driver(throttle), |_| {}, record).unwrap();
                }
                assert!(run.controller().shift().is_none() && run.controller().gear() == from, "{label}");
                let peak = jerk.peak_m_s3().unwrap();
                assert!(peak < 25.0, "{label}: {peak}");
            }
        }
    }
}
