//! What the engine gives is stored or dissipated, in every gearbox and every kind of shift.

use plant::car::{CarCalibration, CarModel, CarPowers, CarRun, CarShift, CarState, CarStep, Driver, stored_car_energy};

use super::{cars, neighbours, runs};

const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Energies, J.
#[derive(Default)]
struct Audit {
    engine: f64,
    sinks: Vec<(&'static str, f64)>,
    /// What passed in either direction.
    passed: f64,
    first: Option<CarState>,
    last: Option<CarState>,
}

impl Audit {
    /// The powers are integrated over a step by Gauss's rule with three points on the dense output.
    fn add(&mut self, model: &CarModel, step: &CarStep<'_>) {
        let length = step.end_s - step.start_s;
        for (at, weight) in GAUSS {
            let powers = CarPowers::of(model, step.contacts, &step.at(step.start_s + at * length), step.inputs);
            self.engine += weight * length * powers.engine_w;
            self.passed += weight * length * powers.engine_w.abs();
            self.sinks.resize(powers.sinks.len(), ("", 0.0));
            for (sum, (name, watts)) in self.sinks.iter_mut().zip(powers.sinks) {
                *sum = (name, sum.1 + weight * length * watts);
            }
        }
        self.first.get_or_insert(step.at(step.start_s));
        self.last = Some(step.at(step.end_s));
    }

    /// What is unaccounted for, over what passed, if one sink is left out.
    fn missing(&self, model: &CarModel, without: &str) -> f64 {
        let lost: f64 = self.sinks.iter().filter(|(name, _)| *name != without).map(|(_, joules)| joules).sum();
        let stored = stored_car_energy(model, &self.last.unwrap()) - stored_car_energy(model, &self.first.unwrap());
        (self.engine - lost - stored).abs() / self.passed
    }
}

fn audit(model: &CarModel, (from, to): (usize, usize), throttle: f64, tolerance: f64) -> Audit {
    let shift = CarShift::usual(&model.car, from, to, throttle);
    let driver = Driver { throttle, brake: 0.02, grade_rad: 0.02 };
    let state = model.in_gear(from, Some(to), shift.vehicle_m_s, throttle).unwrap();
    let calibration = CarCalibration::STANDARD;
    let mut run = CarRun::new(model, &model.car, calibration, from, state, (driver, 0.01)).unwrap();
    run = run.with_tolerance(tolerance);
    run.preselect(Some(to));
    let mut audit = Audit::default();
    while run.time_s() < 2.5 {
        if run.time_s() > 0.3 {
            run.request(to).unwrap();
        }
        run.advance(driver, |step| audit.add(model, step), |_| {}).unwrap();
    }
    assert_eq!(run.controller().gear(), to);
    audit
}

#[test]
fn power_in_is_stored_or_dissipated_in_every_gearbox_and_kind_of_shift() {
    let mut worst = (0.0, String::new());
    for car in cars().into_iter().chain(cars().into_iter().map(super::with_stroke)) {
        let model = CarModel::new(car).unwrap();
        for pair in runs(neighbours(&model.car)) {
            for throttle in [0.15, 0.0] {
                let missing = audit(&model, pair, throttle, 2e-6).missing(&model, "");
                let label = format!("{} {pair:?}, throttle {throttle}", model.car.gearbox.name);
                assert!(missing < 1e-4, "{label}: {missing:e}");
                if missing > worst.0 {
                    worst = (missing, label);
                }
            }
        }
    }
    println!("most missing: {:.1e} ({})", worst.0, worst.1);
}

/// It lets go, catches and overruns; the brake beside it takes its load and leaves it.
#[test]
fn power_is_accounted_for_in_shifts_of_a_one_way_clutch() {
    let model = CarModel::new(super::one_way()).unwrap();
    let mut worst: f64 = 0.0;
    for names in [["1", "2"], ["2", "1"], ["3", "1"], ["1", "L"], ["L", "1"], ["2", "L"]] {
        let [from, to] = names.map(|name| model.car.gearbox.gear(name).unwrap());
        for throttle in [0.15, 0.0] {
            let missing = audit(&model, (from, to), throttle, 2e-6).missing(&model, "");
            assert!(missing < 1e-4, "{names:?}, throttle {throttle}: {missing:e}");
            worst = worst.max(missing);
        }
    }
    println!("shifts of a one-way clutch, most missing: {worst:.1e}");
}

#[test]
fn a_lock_up_clutch_that_closes_and_opens_loses_its_friction_only() {
    let mut car = super::cars().swap_remove(0);
    car.lock_up = Some(car::LockUp {
        capacity_n_m: 300.0,
        first_gear: 3,
        on_rad_s: 120.0,
        off_rad_s: 100.0,
        ramp_s: 0.5,
        slip_rad_s: 0.0,
    });
    let model = CarModel::new(car).unwrap();
    let (with, pair) = (audit(&model, (3, 4), 0.15, 2e-6), audit(&model, (4, 3), 0.0, 2e-6));
    assert!(with.missing(&model, "") < 1e-4 && pair.missing(&model, "") < 1e-4);
}

/// Launch and creep of the dual clutch, a gear from neutral, a withdrawn shift, a lock-up clutch that keeps a slip.
#[test]
fn power_is_accounted_for_in_launches_garage_shifts_and_withdrawn_shifts() {
    let mut worst: f64 = 0.0;
    let mut run = |car: car::Car, vehicle_m_s: f64, driver: Driver, asked: &dyn Fn(&mut CarRun<'_>)| {
        let model = CarModel::new(car).unwrap();
        let gear = model.car.gearbox.forward_gears()[0];
        let state = model.in_gear(gear, None, vehicle_m_s, driver.throttle).unwrap();
        let calibration = CarCalibration::STANDARD;
        let mut run = CarRun::new(&model, &model.car, calibration, gear, state, (driver, 0.01)).unwrap();
        run = run.with_tolerance(2e-6);
        let mut audit = Audit::default();
        while run.time_s() < 5.0 {
            asked(&mut run);
            run.advance(driver, |step| audit.add(&model, step), |_| {}).unwrap();
        }
        worst = worst.max(audit.missing(&model, ""));
    };
    let driver = |throttle: f64, brake: f64| Driver { throttle, brake, grade_rad: 0.0 };
    for throttle in [0.0, 0.2, 0.5] {
        run(super::dual_clutch(), 0.0, driver(throttle, 0.0), &|_| {});
    }
    for car in cars().into_iter().take(4).chain([super::one_way()]) {
        let reverse = car.gearbox.gear("R").unwrap();
        run(car.clone(), 0.0, driver(0.0, 0.6), &|run| {
            if run.time_s() > 1.0 {
                run.request(reverse).unwrap()
            }
        });
        let forward = car.gearbox.forward_gears();
        let (first, second) = (forward[0], forward[1]);
        run(super::with_stroke(car), 6.0, driver(0.2, 0.0), &|run| {
            let wanted = if run.time_s() > 1.0 && run.time_s() < 1.7 { second } else { first };
            run.request(wanted).unwrap();
        });
    }
    let mut slipping = cars().swap_remove(0);
    let (on_rad_s, off_rad_s) = (60.0, 50.0);
    slipping.lock_up =
        Some(car::LockUp { capacity_n_m: 300.0, first_gear: 1, on_rad_s, off_rad_s, ramp_s: 0.5, slip_rad_s: 4.0 });
    run(slipping, 6.0, driver(0.2, 0.0), &|_| {});
    println!("launches, garage and withdrawn shifts, most missing: {worst:.1e}");
    assert!(worst < 1e-4, "{worst:e}");
}

#[test]
fn the_audit_notices_every_missing_sink() {
    let mut car = super::cars().swap_remove(0);
    car.backlash_rad = 0.03;
    let model = CarModel::new(car).unwrap();
    let audit = audit(&model, (1, 2), 0.15, 1e-8);
    assert!(audit.missing(&model, "") < 1e-6);
    for (name, _) in &audit.sinks {
        assert!(audit.missing(&model, name) > 1e-5, "without {name}");
    }
}
