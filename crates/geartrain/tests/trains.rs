//! Gear trains against what is known of them otherwise.

use crate::describe::{described, element, gear, set, shaft, two_speed};
use drivetrain::ReducedShift;
use geartrain::{
    Change, Description, ElementKind, GearPair, Gearbox, Given, HOUSING, Ratio, Ratios, SharedGear, Shares, ShiftMass,
};

fn near(found: &ReducedShift<f64>, wanted: &ReducedShift<f64>) {
    let numbers = |shift: &ReducedShift<f64>| {
        [shift.mass_kg_m2.concat(), shift.slip_offgoing.to_vec(), shift.slip_oncoming.to_vec()].concat()
    };
    for (a, b) in numbers(found).into_iter().zip(numbers(wanted)) {
        assert!((a - b).abs() <= 1e-13 * (1.0 + b.abs()), "{found:?} {wanted:?}");
    }
}

#[test]
fn a_simpson_train_gives_its_textbook_ratios_and_the_mass_found_by_hand() {
    // A Simpson train with its forward clutch: shafts in, front ring, sun, output, rear carrier.
    let mut diagram = two_speed();
    diagram.shafts = [("in", 0.06), ("ring", 0.02), ("sun", 0.03), ("out", 0.1), ("rear", 0.05)]
        .map(|(name, j)| shaft(name, j))
        .to_vec();
    diagram.sets = vec![set(["sun", "out", "ring"], 33, 72), set(["sun", "rear", "out"], 33, 72)];
    diagram.elements = vec![element("F", "in", "ring"), element("L", HOUSING, "rear"), element("I", HOUSING, "sun")];
    (diagram.input, diagram.output) = ("in".to_owned(), "out".to_owned());
    diagram.gears = vec![gear("1", &["F", "L"]), gear("2", &["F", "I"])];
    let gearbox = Gearbox::new(&described(diagram)).unwrap();
    // Speeds per turbine and output speed by hand: the front set gives the sun's, then the rear set that of its carrier.
    let (zs, zr) = (33.0, 72.0);
    let sun = [-zr / zs, (zs + zr) / zs];
    let rear = [-zr / (zs + zr), (zs + 2.0 * zr) / (zs + zr)];
    let shafts = [(0.06 + 0.02, [1.0, 0.0]), (0.03, sun), (0.1, [0.0, 1.0]), (0.05, rear)];
    let mass = |i: usize, j: usize| shafts.iter().map(|(inertia, speed)| inertia * speed[i] * speed[j]).sum::<f64>();
    let wanted = ReducedShift {
        mass_kg_m2: [[mass(0, 0), mass(0, 1)], [mass(1, 0), mass(1, 1)]],
        slip_offgoing: rear.map(|speed| -speed),
        slip_oncoming: sun.map(|speed| -speed),
    };
    near(&gearbox.shift(0, 1).unwrap().reduced.unwrap(), &wanted);
    assert!((gearbox.gears[0].ratio - (2.0 * zr + zs) / zr).abs() < 1e-12);
    assert!((gearbox.gears[1].ratio - (zr + zs) / zr).abs() < 1e-12);
}

#[test]
fn an_idler_turns_the_output_the_other_way() {
    let pair = |idler: bool, dog: &str| GearPair {
        driver: "in".to_owned(),
        driven: "out".to_owned(),
        driver_teeth: 20,
        driven_teeth: 50,
        idler,
        dog: Some(dog.to_owned()),
    };
    let mut diagram = two_speed();
    diagram.shafts = vec![shaft("in", 0.05), shaft("out", 0.1)];
    (diagram.input, diagram.output) = ("in".to_owned(), "out".to_owned());
    (diagram.sets, diagram.elements) = (vec![], vec![]);
    diagram.pairs = vec![pair(false, "D1"), pair(true, "DR")];
    diagram.gears = vec![gear("1", &["D1"]), gear("R", &["DR"])];
    let gearbox = Gearbox::new(&described(diagram)).unwrap();
    assert!((gearbox.gears[0].ratio + 2.5).abs() < 1e-12 && (gearbox.gears[1].ratio - 2.5).abs() < 1e-12);
    assert!(matches!(gearbox.shift(0, 1).unwrap().change, Change::Interrupted { .. }));
}

#[test]
fn torques_that_are_not_unique_are_the_smallest_that_hold() {
    let mut diagram = two_speed();
    // A second brake on the ring shares the torque with the first.
    diagram.elements.push(element("A2", HOUSING, "ring"));
    diagram.gears[0] = gear("1", &["A", "A2"]);
    let gearbox = Gearbox::new(&described(diagram)).unwrap();
    let first = &gearbox.gears[0];
    assert!(!first.holding_is_unique);
    assert!(first.holding.iter().all(|holding| (holding.per_turbine_torque - 0.75).abs() < 1e-12), "{first:?}");
}

/// The two-speed gearbox by its shares and masses.
fn two_speed_shares() -> Shares {
    let gear = |name: &str, ratio: f64, element: &str, share: f64| SharedGear {
        name: name.to_owned(),
        ratio,
        shares: vec![(element.to_owned(), share)],
        turbine_max_n_m: None,
    };
    let mass = Gearbox::new(&described(two_speed())).unwrap().shift(0, 1).unwrap().reduced.unwrap().mass_kg_m2;
    Shares {
        elements: vec![("A".to_owned(), ElementKind::Brake, None), ("B".to_owned(), ElementKind::Clutch, None)],
        gears: vec![gear("1", 2.5, "A", 1.5), gear("2", 1.0, "B", 0.6)],
        masses: vec![ShiftMass {
            gears: ["2".to_owned(), "1".to_owned()],
            turbine_kg_m2: mass[0][0],
            coupling_kg_m2: mass[0][1],
            output_kg_m2: mass[1][1],
        }],
    }
}

#[test]
fn shares_and_masses_give_the_shift_of_the_stick_diagram() {
    let description = |given| Description { name: "test".to_owned(), line_pressure_pa: None, given };
    let drawn = Gearbox::new(&described(two_speed())).unwrap();
    let shared = Gearbox::new(&description(Given::Shares(two_speed_shares()))).unwrap();
    near(&shared.shift(0, 1).unwrap().reduced.unwrap(), &drawn.shift(0, 1).unwrap().reduced.unwrap());
    near(&shared.shift(1, 0).unwrap().reduced.unwrap(), &drawn.shift(1, 0).unwrap().reduced.unwrap());
    let without = Shares { masses: vec![], ..two_speed_shares() };
    assert_eq!(Gearbox::new(&description(Given::Shares(without))).unwrap().shift(0, 1).unwrap().reduced, None);
}

#[test]
fn ratios_alone_give_torques_at_the_turbine() {
    let gear = |name: &str, ratio: f64| Ratio { name: name.to_owned(), ratio };
    let ratios =
        Ratios { gears: vec![gear("R", -3.0), gear("2", 1.0), gear("1", 2.5)], masses: two_speed_shares().masses };
    let gearbox =
        Gearbox::new(&Description { name: "test".to_owned(), line_pressure_pa: None, given: Given::Ratios(ratios) })
            .unwrap();
    assert_eq!(gearbox.shifts.len(), 2, "only between neighbours that turn forward");
    let up = gearbox.shift(2, 1).unwrap();
    let reduced = up.reduced.unwrap();
    assert_eq!(
        (up.change.clone(), reduced.slip_offgoing, reduced.slip_oncoming),
        (Change::Unknown, [1.0, -2.5], [1.0, -1.0])
    );
    // The same acceleration for the same torque at the turbine.
    let drawn = Gearbox::new(&described(two_speed())).unwrap().shift(0, 1).unwrap().reduced.unwrap();
    let per_torque = |shift: &ReducedShift<f64>| {
        let row = shift.coefficients(drivetrain::Engagement::BothSlipping).turbine;
        (row.per_turbine_torque, row.per_oncoming_torque / shift.slip_oncoming[0])
    };
    let ((a, b), (c, d)) = (per_torque(&reduced), per_torque(&drawn));
    assert!((a - c).abs() < 1e-9 && (b - d).abs() < 1e-9);
}
