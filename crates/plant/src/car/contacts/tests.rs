//! Contacts and accelerations in published gearboxes.

use config::{CarFile, Source};
use drivetrain::{Engagement, ShiftTorques};
use geartrain::Change;
use rand_distr::Distribution;
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::car::model::MAX_PACKS;

/// Car models of these gearboxes.
macro_rules! models {
    ($($gearbox:literal),*) => {
        [$({
            let car = Source::built_in("car.toml", concat!("name = \"car\"\ngearbox = \"", $gearbox, "\"\n"));
            let gearbox = Source::built_in($gearbox, include_str!(concat!("../../../../../", $gearbox)));
            CarModel::new(CarFile::from_sources(car, gearbox).unwrap().car).unwrap()
        }),*]
    };
}

/// Every published gearbox with packs for its elements.
fn published() -> Vec<CarModel> {
    Vec::from(models!(
        "gearboxes/ravigneaux_4.toml",
        "gearboxes/lepelletier_6.toml",
        "gearboxes/8hp.toml",
        "gearboxes/10_speed.toml",
        "gearboxes/fn4a.toml",
        "gearboxes/a340e.toml",
        "gearboxes/9g_tronic.toml",
        "gearboxes/a8lr1.toml"
    ))
}

/// A motion of a car whose valves all hold this pressure.
fn state(model: &CarModel, shafts_rad_s: &[f64], pressure_pa: f64) -> CarState {
    let motion = model.motion_of(shafts_rad_s, 150.0).unwrap();
    let valves_pa = [pressure_pa; MAX_PACKS];
    CarState { twist_rad: 0.0, wheel_rad_s: 20.0, vehicle_m_s: 6.0, motion, valves_pa, volumes_m3: [0.0; MAX_PACKS] }
}

fn inputs(throttle: f64) -> CarInputs {
    CarInputs {
        throttle,
        engine_share: 1.0,
        brake_n_m: 0.0,
        grade_rad: 0.0,
        settled_pa: [0.0; MAX_PACKS],
        dogs: [false; MAX_ELEMENTS],
        lock_up_n_m: 0.0,
    }
}

fn accelerations(model: &CarModel, contacts: &Contacts, x: &CarState, u: &CarInputs) -> [f64; MAX_FREEDOMS] {
    let torques = model.applied(contacts, x, &model.acting(u));
    contacts.accelerations_rad_s2(&model.ends_n_m(&torques), &torques.elements_n_m)
}

#[test]
fn in_the_inertia_phase_the_train_accelerates_as_its_reduced_shift() {
    let (turbine_n_m, offgoing_n_m, oncoming_n_m, output_n_m) = (200.0, 70.0, 110.0, 300.0);
    for model in published() {
        for shift in &model.car.gearbox.shifts {
            let (Change::Single { offgoing, oncoming, held }, Some(reduced)) = (&shift.change, &shift.reduced) else {
                continue;
            };
            let mut states = [None; MAX_ELEMENTS];
            held.iter().for_each(|&element| states[element] = Some(Contact::Stuck));
            let mut elements_n_m = [0.0; MAX_ELEMENTS];
            (elements_n_m[*offgoing], elements_n_m[*oncoming]) = (offgoing_n_m, oncoming_n_m);
            let contacts = Contacts::new(&model, states).unwrap();
            let motion = contacts.accelerations_rad_s2(&[0.0, turbine_n_m, -output_n_m], &elements_n_m);
            let rows = reduced.coefficients(Engagement::BothSlipping);
            let torques = ShiftTorques { turbine_n_m, offgoing_n_m, oncoming_n_m, output_n_m };
            let expected = [rows.turbine.at(&torques), rows.output.at(&torques)];
            for (found, expected) in model.train.ends(&motion).into_iter().zip(expected) {
                let name = &model.car.gearbox.name;
                assert!((found - expected).abs() < 1e-5 * (1.0 + expected.abs()), "{name}: {found} {expected}");
            }
        }
    }
}

#[test]
fn in_random_states_accelerations_are_unique_and_friction_takes_power() {
    let mut rng = Pcg64Mcg::new(17);
    let mut random = |limit: f64| rand_distr::Uniform::new(-limit, limit).unwrap().sample(&mut rng);
    for model in published() {
        let gearbox = &model.car.gearbox;
        for case in 0..60 {
            // Some elements have no slip: all of them at standstill, those of a gear, or none.
            let shafts: Vec<f64> = match case % 3 {
                0 => vec![0.0; gearbox.train.as_ref().unwrap().shafts.len()],
                1 => gearbox.gears[case % gearbox.gears.len()]
                    .shaft_speeds
                    .iter()
                    .map(|speed| 150.0 * speed.unwrap_or(0.0))
                    .collect(),
                _ => gearbox.train.as_ref().unwrap().shafts.iter().map(|_| random(200.0)).collect(),
            };
            let mut x = state(&model, &shafts, 0.0);
            x.valves_pa.iter_mut().for_each(|pa| *pa = random(8e5).abs());
            x.twist_rad = random(0.05);
            let u = inputs(random(1.0).abs());
            let (contacts, x) = Contacts::settle(&model, &[None; MAX_ELEMENTS], None, &x, &u).unwrap();
            let torques = model.torques(&contacts, &x, &u).elements_n_m;
            let heat_w: f64 = (0..model.parts.len()).map(|element| torques[element] * model.slip(&x, element)).sum();
            assert!(heat_w >= -1e-6, "{}: {heat_w} W", gearbox.name);
            // The same question once more, from the answer.
            let first = accelerations(&model, &contacts, &x, &u);
            let (again, x) = Contacts::settle(&model, contacts.states(), None, &x, &u).unwrap();
            for (a, b) in first.into_iter().zip(accelerations(&model, &again, &x, &u)) {
                assert!((a - b).abs() < 1e-5 * (1.0 + a.abs()), "{}: {a} {b}", gearbox.name);
            }
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let [model] = models!("gearboxes/8hp.toml");
    let mut car = model.car.clone();
    car.engine.inertia_kg_m2 = f64::NAN;
    assert_eq!(CarModel::new(car).err(), Some(TrainError::NotFinite));
    let open = [None; MAX_ELEMENTS];
    let shafts = vec![0.0; model.car.gearbox.train.as_ref().unwrap().shafts.len()];
    for (x, u) in [
        (state(&model, &shafts, f64::NAN), inputs(0.2)),
        (state(&model, &vec![f64::NAN; shafts.len()], 5e5), inputs(0.2)),
        (state(&model, &shafts, 5e5), inputs(f64::NAN)),
    ] {
        let start = crate::car::CarIntegrator::new(&model, 0.0, x, &u);
        let run = start.and_then(|mut plant| plant.advance(&model, &u, 0.1, &mut |_| {}));
        assert!(run.is_err(), "{x:?} {u:?}");
    }
    assert!(Contacts::settle(&model, &open, None, &state(&model, &shafts, 5e5), &inputs(0.2)).is_ok());
}
