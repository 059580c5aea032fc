//! Whole drives: through all gears of every shipped gearbox.

use car::Car;
use car::ErrorBudget;
use config::CarFile;
use observer::Health;
use observer::{ShiftTables, gearbox_filter};
use plant::car::CarModel;
use study::gearbox::drive::{ScoredDrive, score_drive};
use study::gearbox::matrix::{Matrix, Pooled, drawn_car};
use study::gearbox::recording::Recording;
use study::gearbox::tour::{drive_tour, legs, not_driven};
use study::gearbox::{SAMPLE_S, TruePhase};

use super::cars::{cars, sensors};

fn driven(car: &Car, seed: u64) -> ScoredDrive {
    let model = CarModel::new(drawn_car(car, 0, 0, seed)).unwrap();
    let mut recording = Recording::default();
    let mut done = 0;
    drive_tour(&model, car, |sample| recording.push(sample), || done += 1).unwrap();
    let drive = score_drive(car, &model, &recording, &sensors(), seed).unwrap();
    assert_eq!(drive.shifts.len(), done);
    drive
}

/// Each shift between neighbouring gears once in every kind, by one filter for the whole drive.
#[test]
fn every_car_drives_through_all_its_gears_and_every_shift_is_estimated() {
    let mut rows = Vec::new();
    for car in cars() {
        let drive = driven(&car, 1);
        let name = &car.gearbox.name;
        let steps = car.gearbox.forward_gears().len() - 1;
        assert_eq!(drive.shifts.len(), 4 * steps, "{name}");
        for shift in &drive.shifts {
            let label = format!("{name} {} {:?}", shift.number, shift.gears);
            assert!(shift.quality.complete_s.is_some_and(|time_s| time_s < 2.0), "{label}: {:?}", shift.quality);
            assert!(shift.kind.is_some() && !shift.rows.is_empty(), "{label}");
            assert_eq!(shift.inside(), Some(1.0), "{label}: guaranteed");
            let under_way_s = shift.time_s[1] - shift.time_s[0];
            let phases_s = shift.length_s(TruePhase::Torque) + shift.length_s(TruePhase::Inertia);
            assert!(shift.length_s(TruePhase::Inertia) > 0.05 && phases_s <= under_way_s + SAMPLE_S, "{label}");
        }
        let kinds: std::collections::BTreeSet<_> =
            drive.shifts.iter().map(|shift| format!("{:?}", shift.kind)).collect();
        assert_eq!(kinds.len(), 4, "{name}: {kinds:?}");
        // After the first readings the filter has a gear.
        let restarts = drive.states.iter().skip(100).filter(|state| state.health == Health::Restarted).count();
        assert_eq!(restarts, 0, "{name}");
        rows.extend(Matrix::of_drive(&drive, &car).rows);
    }
    let [_, [inertia, _]] = Pooled::of(&rows, |_| true).torque;
    println!("controlling clutch, inertia phase, all shifts: {:.2}", inertia.ratio().unwrap());
    // The bars by kind are those of the matrix.
    assert!(inertia.ratio().unwrap() < 0.55, "{inertia:?}");
}

/// A car that cannot drive as fast as a shift is usually made shifts at the speed that it reaches.
#[test]
fn a_weak_car_drives_through_all_its_gears_too() {
    let mut weak = CarFile::eight_speed().unwrap().car;
    weak.engine.torque_n_m = weak.engine.torque_n_m.scaled(0.5);
    let drive = driven(&weak, 1);
    assert_eq!(drive.shifts.len(), 28);
    assert!(drive.shifts.iter().all(|shift| shift.quality.complete_s.is_some()));
}

/// A top gear so long that the engine cannot pull the car to its speed: all other shifts are made.
#[test]
fn shifts_that_a_car_is_too_slow_for_are_left_out_and_named() {
    let mut weak = CarFile::eight_speed().unwrap().car;
    weak.engine.torque_n_m = weak.engine.torque_n_m.scaled(0.25);
    let model = CarModel::new(weak.clone()).unwrap();
    let mut done = 0;
    let left_out = drive_tour(&model, &weak, |_| (), || done += 1).unwrap();
    let shifts: Vec<_> = left_out.iter().map(|left| (left.leg.from, left.leg.to, left.speeds_m_s.is_some())).collect();
    println!("{shifts:?}");
    assert!(!left_out.is_empty() && done >= 12 && done + left_out.len() == 28, "{done} {shifts:?}");
    // What is not reached is not shifted down from.
    for left in &left_out {
        match left.speeds_m_s {
            Some([wanted_m_s, reached_m_s]) => assert!(reached_m_s < wanted_m_s, "{left:?}"),
            None => assert!(
                left_out
                    .iter()
                    .any(|other| other.speeds_m_s.is_some() && other.leg.to <= left.leg.from.max(left.leg.to)),
                "{left:?}"
            ),
        }
    }
    weak.engine.torque_n_m = weak.engine.torque_n_m.scaled(0.05);
    let model = CarModel::new(weak.clone()).unwrap();
    let none = drive_tour(&model, &weak, |_| (), || ()).unwrap_err().to_string();
    assert!(none.contains("its first shift needs") || none.contains("stalls"), "{none}");
}

/// The budget of a car whose pistons have a stroke has limits of the stroke, too.
#[test]
fn the_ranges_hold_while_pistons_move() {
    let vehicles = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vehicles");
    let car = CarFile::read(&vehicles.join("eight_speed_stroke.toml")).unwrap().car;
    for shift in driven(&car, 1).shifts {
        assert_eq!(shift.inside(), Some(1.0), "{} {:?}", shift.number, shift.gears);
    }
}

/// In a gear the range follows from the commands as in a shift, of elements that hold, fill or rest.
#[test]
fn the_pressure_of_every_element_is_within_its_range_in_gears_too() {
    let vehicles = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vehicles");
    let with_strokes = CarFile::read(&vehicles.join("eight_speed_stroke.toml")).unwrap().car;
    for known in cars().into_iter().chain([with_strokes]) {
        let name = &known.gearbox.name;
        let model = CarModel::new(drawn_car(&known, 0, 0, 1)).unwrap();
        let mut recording = Recording::default();
        drive_tour(&model, &known, |sample| recording.push(sample), || ()).unwrap();
        let (errors, sensors) = (ErrorBudget::of_car(&known), sensors());
        let tables = ShiftTables::of_car(&known, &errors).unwrap();
        let filter = gearbox_filter(&known, &tables, &errors, Some(&sensors));
        let (mut state, mut in_gear, mut widths_pa) = (filter.start(), 0, Vec::new());
        for (sample, input) in recording.samples.iter().zip(recording.inputs(&known, &tables, &sensors, 1)) {
            let estimate = filter.step(&mut state, &input);
            in_gear += u32::from(estimate.clutches.is_none());
            for (element, pressure_pa) in sample.pressures_pa.iter().enumerate() {
                let Some(place) = tables.place(element) else { continue };
                let [low, high] = filter.pressure_range_pa(&state, place).unwrap();
                let label = format!("{name} {:.2} s, element {element}", sample.time_s);
                assert!((low - 1.0..=high + 1.0).contains(pressure_pa), "{label}: {low} {pressure_pa} {high}");
                widths_pa.push(high - low);
                let shifts =
                    estimate.clutches.into_iter().flatten().find(|clutch| clutch.element.place() == Some(place));
                assert!(shifts.is_none_or(|clutch| clutch.pressure_range_pa == Some([low, high])), "{label}");
            }
        }
        widths_pa.sort_by(f64::total_cmp);
        let middle_pa = widths_pa[widths_pa.len() / 2];
        println!(
            "{name}: {in_gear} of {} samples in a gear, width in the middle {middle_pa:.0} Pa",
            recording.samples.len()
        );
        assert!(in_gear > 1000 && filter.pressure_range_pa(&state, usize::MAX).is_none());
    }
}

/// Without its second and third gear the 8HP goes from 1st to 4th by two elements off and two on.
#[test]
fn a_shift_between_neighbouring_gears_that_is_not_driven_is_named_with_its_reason() {
    let without = |names: &[&str]| {
        let mut car = CarFile::eight_speed().unwrap().car;
        car.gearbox.gears.iter_mut().filter(|gear| names.contains(&&*gear.name)).for_each(|gear| gear.ratio *= -1.0);
        car
    };
    let car = without(&["2", "3"]);
    let pairs = not_driven(&car).unwrap();
    let [one, four] = ["1", "4"].map(|name| car.gearbox.gear(name).unwrap());
    assert_eq!(pairs, [[one, four], [four, one]]);
    let double = "double transition, A C off and D E on: a shift needs one clutch or brake off and one on";
    assert_eq!(car.why_no_shift([one, four]), double);
    assert_eq!(not_driven(&without(&[])).unwrap(), Vec::<[usize; 2]>::new());
    // An element without plates.
    let mut bare = without(&[]);
    let element = bare.gearbox.elements.iter().position(|element| element.name == "E").unwrap();
    (bare.gearbox.elements[element].pack, bare.clutches[element]) = (None, None);
    let two = bare.gearbox.gear("2").unwrap();
    assert_eq!(not_driven(&bare).unwrap()[0], [one, two]);
    assert_eq!(bare.why_no_shift([one, two]), "E has no plates (`pack`) in the gearbox file");
    // Gears of one clutch of a dual clutch.
    let dual = cars().pop().unwrap();
    let [one, three] = ["1", "3"].map(|name| dual.gearbox.gear(name).unwrap());
    assert_eq!(
        dual.why_no_shift([one, three]),
        "only dogs change, D1 off and D3 on: no clutch takes the load over from another"
    );
    // A dog that would have to go in while the car stands.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/nine_speed_9hp.toml");
    let nine = CarFile::read(path.as_ref()).unwrap().car;
    assert_eq!(not_driven(&nine).unwrap(), Vec::<[usize; 2]>::new());
    let [reverse, one] = ["R", "1"].map(|name| nine.gearbox.gear(name).unwrap());
    assert_eq!(
        nine.why_no_shift([reverse, one]),
        "B off and A on: a dog goes in only in a downshift, and comes out only in an upshift"
    );
}

/// A gearbox whose third gear can only be reached by two changes at once is driven without it.
#[test]
fn a_gear_without_a_shift_between_two_clutches_is_passed_over() {
    let mut car = cars().swap_remove(0);
    let gear = |name: &str| car.gearbox.gear(name).unwrap();
    let (two, three, four) = (gear("2"), gear("3"), gear("4"));
    car.gearbox.shifts.retain(|shift| ![[two, three], [three, two]].contains(&[shift.from, shift.to]));
    let tables = observer::ShiftTables::of_car(&car, &ErrorBudget::of_car(&car)).unwrap();
    let legs = legs(&car, &tables);
    let has = |from: usize, to: usize| legs.iter().any(|leg| (leg.from, leg.to) == (from, to));
    assert!(!has(two, three) && has(two, four), "{legs:?}");
    // Every leg begins where the one before has ended.
    assert!(legs.windows(2).all(|pair| pair[0].to == pair[1].from), "{legs:?}");
}
