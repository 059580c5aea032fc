//! The gear trains of published gearboxes in motion.

use config::{GearboxFile, Source};
use drivetrain::{Engagement, ShiftTorques};
use geartrain::{Change, ElementKind, Gearbox};
use plant::gear_train::{MAX_ELEMENTS, MAX_FREEDOMS};
use plant::{Contact, Limits, TrainInputs, TrainModel, TrainRun};

/// Rigid car of 1500 kg behind a final ratio of 3, on wheels of 0.3 m.
const CAR_KG_M2: f64 = 15.0;
const TURBINE_N_M: f64 = 200.0;
/// Capacity of an engaged element over the torque that it holds.
const MARGIN: f64 = 1.5;
/// Capacity of an engaged element that holds nothing, N m.
const IDLE_N_M: f64 = 20.0;
const SHIFT_S: f64 = 0.3;

macro_rules! gearboxes {
    ($($path:literal),*) => {
        vec![$(GearboxFile::from_source(Source::built_in($path, include_str!($path))).unwrap().gearbox),*]
    };
}

fn all() -> Vec<Gearbox> {
    gearboxes!(
        "../../../gearboxes/two_speed.toml",
        "../../../gearboxes/ravigneaux_4.toml",
        "../../../gearboxes/lepelletier_6.toml",
        "../../../gearboxes/8hp.toml",
        "../../../gearboxes/10_speed.toml",
        "../../../gearboxes/dual_clutch_7.toml",
        "../../config/tests/gearboxes/fn4a.toml",
        "../../config/tests/gearboxes/a340e.toml",
        "../../config/tests/gearboxes/tf80sc.toml",
        "../../config/tests/gearboxes/8hp45.toml",
        "../../config/tests/gearboxes/8l90.toml",
        "../../config/tests/gearboxes/9g.toml",
        "../../config/tests/gearboxes/a8lr1_2.0t.toml",
        "../../config/tests/gearboxes/a8lr1_v6.toml"
    )
}

/// Three trains with many elements.
fn three() -> Vec<Gearbox> {
    gearboxes!(
        "../../../gearboxes/8hp.toml",
        "../../../gearboxes/10_speed.toml",
        "../../config/tests/gearboxes/9g.toml"
    )
}

/// Numbers from -1 to 1.
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    #[expect(clippy::cast_precision_loss, reason = "31 bits")]
    let value = (*state >> 33) as f64;
    value / f64::from(1_u32 << 30) - 1.0
}

/// The motion of these shaft speeds.
fn motion_of(gearbox: &Gearbox, speeds: &[f64]) -> [f64; MAX_FREEDOMS] {
    let found = gearbox.train.as_ref().unwrap().motion(speeds).unwrap();
    let mut motion = [0.0; MAX_FREEDOMS];
    motion[..found.len()].copy_from_slice(&found);
    motion
}

/// The shaft speeds of these speeds of turbine and output.
fn speeds_of(gearbox: &Gearbox, held: &[usize], [turbine, output]: [f64; 2]) -> Vec<f64> {
    let per_end = gearbox.train.as_ref().unwrap().speeds_in_shift(held).unwrap();
    per_end.row_iter().map(|row| row[0] * turbine + row[1] * output).collect()
}

fn is_dog(gearbox: &Gearbox, element: usize) -> bool {
    gearbox.elements[element].kind == ElementKind::Dog
}

/// Capacity of an element that holds its torque in a gear with a margin, N m.
fn capacity(gearbox: &Gearbox, gear: usize, element: usize) -> f64 {
    let held = gearbox.gears[gear].holding.iter().find(|holding| holding.element == element);
    (MARGIN * TURBINE_N_M * held.map_or(0.0, |holding| holding.per_turbine_torque.abs())).max(IDLE_N_M)
}

/// Behind the final drive of a dual clutch the car is heavier.
fn load_kg_m2(gearbox: &Gearbox) -> f64 {
    if gearbox.train.as_ref().unwrap().sets.is_empty() { 9.0 * CAR_KG_M2 } else { CAR_KG_M2 }
}

struct Outcome {
    run_speeds: [f64; 2],
    stuck: Vec<bool>,
    /// Largest slip of an element that sticks, rad/s.
    slip_rad_s: f64,
    /// Energy that is not accounted for, over the energy that passed.
    audit: f64,
    lowest_friction_w: f64,
    events: usize,
}

/// One power-on shift: the capacities of the two elements cross over.
fn shift(gearbox: &Gearbox, from: usize, to: usize) -> Outcome {
    let train = gearbox.train.as_ref().unwrap();
    let Change::Single { offgoing, oncoming, ref held } = gearbox.shift(from, to).unwrap().change else { panic!() };
    let model = TrainModel::new(train, load_kg_m2(gearbox)).unwrap();
    let inputs = |time_s: f64, [_, output]: [f64; 2]| {
        let share = (time_s / SHIFT_S).clamp(0.0, 1.0);
        let mut limits = [None; MAX_ELEMENTS];
        for &element in held {
            let [a, b] = [from, to].map(|gear| capacity(gearbox, gear, element));
            limits[element] = Some(if is_dog(gearbox, element) { Limits::DOG } else { Limits::capacity(a.max(b)) });
        }
        limits[offgoing] = Some(Limits::capacity((1.0 - share) * capacity(gearbox, from, offgoing)));
        limits[oncoming] = Some(Limits::capacity(share * capacity(gearbox, to, oncoming)));
        TrainInputs { turbine_n_m: TURBINE_N_M, output_n_m: 60.0 + 1e-3 * output * output.abs(), limits }
    };
    let motion = motion_of(gearbox, &speeds_of(gearbox, held, [200.0, 200.0 / gearbox.gears[from].ratio]));
    let mut run = TrainRun::new(&model, motion, &inputs(0.0, model.ends(&motion))).unwrap();
    let start_j = model.kinetic_energy(&run.motion);
    let (mut lowest_friction_w, mut events, mut contacts) = (f64::INFINITY, 0, run.contacts);
    let mut record = |run: &TrainRun<'_>| {
        let now = inputs(run.time_s, run.ends());
        lowest_friction_w = lowest_friction_w.min(run.friction_w(&run.balance(&now).unwrap()));
        events += usize::from(contacts != run.contacts);
        contacts = run.contacts;
    };
    run.advance(SHIFT_S, &inputs, &mut record).unwrap();
    run.advance(SHIFT_S + 0.5, &inputs, &mut record).unwrap();
    let stored = model.kinetic_energy(&run.motion) - start_j;
    let rest = stored + run.delivered_j + run.dissipated_j - run.supplied_j;
    let engaged = gearbox.gears[to].holding.iter().map(|holding| run.contacts[holding.element] == Contact::Stuck);
    let sticking = (0..gearbox.elements.len()).filter(|&element| run.contacts[element] == Contact::Stuck);
    let slips = sticking.map(|element| model.slip(&run.motion, element).abs());
    Outcome {
        run_speeds: run.ends(),
        stuck: engaged.collect(),
        slip_rad_s: slips.fold(0.0, f64::max),
        audit: rest.abs() / run.supplied_j.abs().max(run.dissipated_j),
        lowest_friction_w,
        events,
    }
}

#[test]
fn every_shift_between_neighbours_ends_in_its_gear_and_accounts_for_its_energy() {
    let mut worst = 0.0_f64;
    for gearbox in all() {
        for pair in gearbox.forward_gears().windows(2) {
            for (from, to) in [(pair[0], pair[1]), (pair[1], pair[0])] {
                let outcome = shift(&gearbox, from, to);
                let name = format!("{} {}-{}", gearbox.name, gearbox.gears[from].name, gearbox.gears[to].name);
                let [turbine, output] = outcome.run_speeds;
                assert!((turbine / output - gearbox.gears[to].ratio).abs() < 1e-6, "{name}: {turbine} {output}");
                assert!(outcome.stuck.iter().all(|&stuck| stuck), "{name}: {:?}", outcome.stuck);
                assert!(outcome.slip_rad_s < 1e-8, "{name}: {}", outcome.slip_rad_s);
                assert!(outcome.audit < 1e-4, "{name}: {}", outcome.audit);
                assert!(outcome.lowest_friction_w > -1e-3, "{name}: {}", outcome.lowest_friction_w);
                assert!((2..200).contains(&outcome.events), "{name}: {} events", outcome.events);
                worst = worst.max(outcome.audit);
            }
        }
    }
    // Runge-Kutta's error; the events lose nothing.
    assert!(worst < 1e-8, "{worst:.1e}");
}

#[test]
fn in_the_inertia_phase_the_train_accelerates_as_its_reduced_shift() {
    for gearbox in all() {
        let train = gearbox.train.as_ref().unwrap();
        let load = load_kg_m2(&gearbox);
        let model = TrainModel::new(train, load).unwrap();
        for shift in &gearbox.shifts {
            let (Change::Single { offgoing, oncoming, held }, Some(reduced)) = (&shift.change, &shift.reduced) else {
                continue;
            };
            let mut limits = [None; MAX_ELEMENTS];
            held.iter().for_each(|&element| limits[element] = Some(Limits::DOG));
            let (off_n_m, on_n_m) = (70.0, 110.0);
            limits[*offgoing] = Some(Limits::capacity(off_n_m));
            limits[*oncoming] = Some(Limits::capacity(on_n_m));
            let inputs = TrainInputs { turbine_n_m: TURBINE_N_M, output_n_m: 300.0, limits };
            let ends = [211.0, 97.0];
            let run = TrainRun::new(&model, motion_of(&gearbox, &speeds_of(&gearbox, held, ends)), &inputs).unwrap();
            let found = model.ends(&run.balance(&inputs).unwrap().motion_rad_s2);
            let torques = ShiftTorques {
                turbine_n_m: TURBINE_N_M,
                offgoing_n_m: off_n_m * reduced.offgoing_slip(ends[0], ends[1]).signum(),
                oncoming_n_m: on_n_m * reduced.oncoming_slip(ends[0], ends[1]).signum(),
                output_n_m: 300.0,
            };
            let rows = reduced.with_output_inertia(load).coefficients(Engagement::BothSlipping);
            for (a, b) in found.into_iter().zip([rows.turbine.at(&torques), rows.output.at(&torques)]) {
                assert!((a - b).abs() < 1e-5 * (1.0 + b.abs()), "{} {found:?} {b}", gearbox.name);
            }
        }
    }
}

#[test]
fn in_random_states_accelerations_are_unique_and_friction_takes_power() {
    let mut state = 17;
    for gearbox in three() {
        let train = gearbox.train.as_ref().unwrap();
        let model = TrainModel::new(train, CAR_KG_M2).unwrap();
        for case in 0..150 {
            // Some elements have no slip: those of a gear, all of them at standstill, or none.
            let gear = case % gearbox.gears.len();
            let speeds: Vec<f64> = match case % 3 {
                0 => vec![0.0; train.shafts.len()],
                1 => gearbox.gears[gear].shaft_speeds.iter().map(|speed| 150.0 * speed.unwrap()).collect(),
                _ => (0..train.shafts.len()).map(|_| 200.0 * random(&mut state)).collect(),
            };
            let mut limits = [None; MAX_ELEMENTS];
            for limit in limits.iter_mut().take(train.elements.len()) {
                *limit = Some(Limits::capacity(300.0 * random(&mut state).abs()));
            }
            let inputs =
                TrainInputs { turbine_n_m: 300.0 * random(&mut state), output_n_m: 900.0 * random(&mut state), limits };
            let mut run = TrainRun::new(&model, motion_of(&gearbox, &speeds), &inputs).unwrap();
            let balance = run.balance(&inputs).unwrap();
            assert!(run.friction_w(&balance) >= -1e-6);
            // The same question once more, from the answer.
            run.settle(&inputs).unwrap();
            let again = run.balance(&inputs).unwrap();
            for (a, b) in balance.motion_rad_s2.iter().zip(again.motion_rad_s2) {
                assert!((a - b).abs() < 1e-5 * (1.0 + a.abs()), "{}: {a} {b}", gearbox.name);
            }
            let soon = |_: f64, _: [f64; 2]| inputs;
            let before = model.kinetic_energy(&run.motion);
            run.advance(1e-3, &soon, &mut |_| ()).unwrap();
            let rest = model.kinetic_energy(&run.motion) - before + run.delivered_j + run.dissipated_j - run.supplied_j;
            let passed = run.supplied_j.abs() + run.delivered_j.abs() + run.dissipated_j + 1e-3;
            // Rounding of the kinetic energy itself.
            assert!(rest.abs() < 1e-6 * passed + 1e-12 * before, "{}: {rest} of {passed}", gearbox.name);
            assert!(run.dissipated_j >= -1e-9);
        }
    }
}

#[test]
fn a_one_way_clutch_opens_by_itself_when_the_oncoming_clutch_takes_over() {
    let gearbox = &all()[0];
    let model = TrainModel::new(gearbox.train.as_ref().unwrap(), CAR_KG_M2).unwrap();
    let inputs = |time_s: f64, _: [f64; 2]| {
        let mut limits = [None; MAX_ELEMENTS];
        limits[0] = Some(Limits::ONE_WAY);
        limits[1] = Some(Limits::capacity(500.0 * (time_s / SHIFT_S).clamp(0.0, 1.0)));
        TrainInputs { turbine_n_m: TURBINE_N_M, output_n_m: 60.0, limits }
    };
    let motion = motion_of(gearbox, &speeds_of(gearbox, &[], [200.0, 80.0]));
    let mut run = TrainRun::new(&model, motion, &inputs(0.0, [200.0, 80.0])).unwrap();
    assert_eq!(run.contacts[0], Contact::Stuck);
    let mut opened_s = None;
    let mut record = |run: &TrainRun<'_>| {
        if run.contacts[0] != Contact::Stuck && opened_s.is_none() {
            opened_s = Some(run.time_s);
        }
    };
    run.advance(SHIFT_S + 0.6, &inputs, &mut record).unwrap();
    // It opens when B alone accelerates the car.
    let reduced = gearbox.shift(0, 1).unwrap().reduced.unwrap().with_output_inertia(CAR_KG_M2);
    let held = reduced.coefficients(Engagement::OffgoingStuck).holding_offgoing;
    let without_b = held.per_turbine_torque * TURBINE_N_M + held.per_output_torque * 60.0;
    let expected_s = SHIFT_S * (-without_b / held.per_oncoming_torque) / 500.0;
    assert!((opened_s.unwrap() - expected_s).abs() < 1e-6, "{opened_s:?} {expected_s}");
    assert_eq!(run.contacts[1], Contact::Stuck);
    assert!((run.ends()[0] - run.ends()[1]).abs() < 1e-6);
}

#[test]
fn inputs_that_are_no_numbers_are_refused() {
    let gearbox = &all()[0];
    let train = gearbox.train.as_ref().unwrap();
    assert!(TrainModel::new(train, f64::NAN).is_err());
    let model = TrainModel::new(train, CAR_KG_M2).unwrap();
    let whole = Limits::capacity(100.0);
    for (turbine_n_m, limit, motion) in [
        (f64::INFINITY, whole, 0.0),
        (f64::NAN, whole, 10.0),
        (1.0, Limits::capacity(f64::NAN), 0.0),
        (1.0, Limits::capacity(f64::NAN), 10.0),
        (1.0, whole, f64::NAN),
    ] {
        let inputs = TrainInputs { turbine_n_m, output_n_m: 0.0, limits: [Some(limit); MAX_ELEMENTS] };
        let run = TrainRun::new(&model, [motion; MAX_FREEDOMS], &inputs);
        let run = run.and_then(|mut run| run.advance(0.1, &|_, _| inputs, &mut |_| ()));
        assert!(run.is_err(), "{turbine_n_m} {limit:?} {motion}");
    }
}
