//! What the engine gives is stored or dissipated, in every gearbox and every kind of shift.

use plant::car::{CarCalibration, CarModel, CarPowers, CarRun, CarShift, CarState, CarStep, Driver, stored_car_energy};

use crate::{cars, neighbours};

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
    let mut worst: f64 = 0.0;
    for car in cars().into_iter().chain(cars().into_iter().map(crate::with_stroke)) {
        let model = CarModel::new(car).unwrap();
        for pair in neighbours(&model.car) {
            for throttle in [0.15, 0.0] {
                let missing = audit(&model, pair, throttle, 1e-5).missing(&model, "");
                worst = worst.max(missing);
                assert!(missing < 1e-4, "{} {pair:?} {throttle}: {missing:e}", model.car.gearbox.name);
            }
        }
    }
    println!("most missing: {worst:.1e}");
}

#[test]
fn a_lock_up_clutch_that_closes_and_opens_loses_its_friction_only() {
    let mut car = crate::cars().swap_remove(0);
    car.lock_up = Some(config::LockUp {
        capacity_n_m: 300.0,
        first_gear: 3,
        on_rad_s: 120.0,
        off_rad_s: 100.0,
        ramp_s: 0.5,
        slip_rad_s: 0.0,
    });
    let model = CarModel::new(car).unwrap();
    let (with, pair) = (audit(&model, (3, 4), 0.15, 1e-5), audit(&model, (4, 3), 0.0, 1e-5));
    assert!(with.missing(&model, "") < 1e-4 && pair.missing(&model, "") < 1e-4);
}

#[test]
fn the_audit_notices_every_missing_sink() {
    let mut car = crate::cars().swap_remove(0);
    car.backlash_rad = 0.03;
    let model = CarModel::new(car).unwrap();
    let audit = audit(&model, (1, 2), 0.15, 1e-8);
    assert!(audit.missing(&model, "") < 1e-6);
    for (name, _) in &audit.sinks {
        assert!(audit.missing(&model, name) > 1e-5, "without {name}");
    }
}
