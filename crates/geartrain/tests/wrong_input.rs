//! Descriptions that are wrong: each gets its error, and none a panic.

use crate::describe::{described, element, gear, pack, set, shaft, two_speed};
use geartrain::{
    Description, ElementKind, EngagedGear, Fault, Finding, GearPair, Gearbox, Given, HOUSING, Part, Planets, Ratio,
    Ratios, SharedGear, Shares, ShiftMass, StatedRatio, StickDiagram,
};
use proptest::prelude::*;

fn wrong(change: impl FnOnce(&mut StickDiagram)) -> Finding {
    let mut diagram = two_speed();
    change(&mut diagram);
    Gearbox::new(&described(diagram)).unwrap_err()
}

/// Part, key and fault, with a message and, where there is something to do, a hint.
fn assert_finding(finding: &Finding, part: Part, key: &str, fault: &Fault) {
    assert_eq!((finding.part, finding.key, &finding.fault), (part, key, fault));
    assert!(!finding.to_string().is_empty() && finding.fault.hint().is_none_or(|hint| !hint.is_empty()));
}

#[test]
fn empty_lists_are_refused() {
    for (key, empty) in [
        ("shaft", (|d: &mut StickDiagram| d.shafts.clear()) as fn(&mut StickDiagram)),
        ("element", |d| d.elements.clear()),
        ("gear", |d| d.gears.clear()),
    ] {
        assert_finding(&wrong(empty), Part::Gearbox, key, &Fault::None);
    }
    // Without sets the input has nothing to do with the output.
    assert!(matches!(wrong(|d| d.sets.clear()).fault, Fault::Loose(_)));
}

#[test]
fn more_parts_than_a_gearbox_has_are_refused() {
    let too_many = Fault::TooMany { count: 50, maximum: 32 };
    let many = |d: &mut StickDiagram| d.shafts = (0..50).map(|i| shaft(&format!("s{i}"), 0.01)).collect();
    assert_finding(&wrong(many), Part::Gearbox, "shaft", &too_many);
    let many = |d: &mut StickDiagram| d.sets = vec![d.sets[0].clone(); 50];
    assert_finding(&wrong(many), Part::Gearbox, "planetary_set", &too_many);
    let many =
        |d: &mut StickDiagram| d.elements = (0..50).map(|i| element(&format!("e{i}"), HOUSING, "ring")).collect();
    assert_finding(&wrong(many), Part::Gearbox, "element", &too_many);
    let many = |d: &mut StickDiagram| d.gears = (0..50).map(|i| gear(&format!("g{i}"), &["A"])).collect();
    assert_finding(&wrong(many), Part::Gearbox, "gear", &too_many);
}

#[test]
fn numbers_that_are_no_inertia_and_no_teeth_are_refused() {
    for value in [f64::NAN, f64::INFINITY, 0.0, -0.01] {
        let finding = wrong(|d| d.shafts[1].inertia_kg_m2 = value);
        assert_eq!((finding.part, finding.key), (Part::Shaft(1), "inertia_kg_m2"));
    }
    let finding = wrong(|d| d.sets[0].sun_teeth = 0);
    assert_eq!((finding.part, finding.key), (Part::Set(0), "sun_teeth"));
    let finding = wrong(|d| d.sets[0].ring_teeth = u32::MAX);
    assert_eq!((finding.part, finding.key), (Part::Set(0), "ring_teeth"));
    assert_finding(
        &wrong(|d| d.sets[0].ring_teeth = 30),
        Part::Set(0),
        "ring_teeth",
        &Fault::RingInSun { ring: 30, sun: 40 },
    );
}

#[test]
fn repeated_and_reserved_names_are_refused() {
    let repeated = |name: &str| Fault::Repeated(name.to_owned());
    assert_finding(&wrong(|d| d.shafts.push(shaft("ring", 0.1))), Part::Shaft(3), "name", &repeated("ring"));
    assert_finding(
        &wrong(|d| d.elements.push(element("A", "turbine", "ring"))),
        Part::Element(2),
        "name",
        &repeated("A"),
    );
    assert_finding(&wrong(|d| d.gears.push(gear("1", &["B"]))), Part::Gear(2), "name", &repeated("1"));
    assert_finding(&wrong(|d| d.shafts.push(shaft(HOUSING, 0.1))), Part::Shaft(3), "name", &Fault::HousingAsName);
}

fn pair(driver: &str, driven: &str, dog: Option<&str>) -> GearPair<String> {
    GearPair {
        driver: driver.to_owned(),
        driven: driven.to_owned(),
        driver_teeth: 20,
        driven_teeth: 30,
        idler: false,
        dog: dog.map(str::to_owned),
    }
}

#[test]
fn wrong_gear_pairs_are_refused() {
    let finding = wrong(|d| d.pairs.push(pair("ring", "carrier", Some("A"))));
    assert_finding(&finding, Part::Pair(0), "dog", &Fault::Repeated("A".to_owned()));
    let finding = wrong(|d| d.pairs.push(pair("ring", "ring", None)));
    assert_finding(&finding, Part::Pair(0), "driven", &Fault::SameSides("ring".to_owned()));
    let finding = wrong(|d| d.pairs.push(GearPair { driven_teeth: 0, ..pair("ring", "carrier", None) }));
    assert_eq!((finding.part, finding.key), (Part::Pair(0), "driven_teeth"));
    let finding = wrong(|d| d.pairs.push(pair("ring", HOUSING, None)));
    assert!(matches!(finding.fault, Fault::Unknown { what: "shaft", .. }), "{finding:?}");
}

#[test]
fn sets_and_elements_that_connect_a_shaft_with_itself_are_refused() {
    let same = |members: [&'static str; 3]| wrong(|d| d.sets[0] = set(members, 40, 60));
    assert_finding(&same(["ring", "ring", "turbine"]), Part::Set(0), "carrier", &Fault::SameMembers("sun and carrier"));
    assert_finding(&same(["ring", "carrier", "ring"]), Part::Set(0), "ring", &Fault::SameMembers("sun and ring"));
    assert_finding(&same(["turbine", HOUSING, HOUSING]), Part::Set(0), "ring", &Fault::SameMembers("carrier and ring"));
    let finding = wrong(|d| d.elements[1] = element("B", "ring", "ring"));
    assert_finding(&finding, Part::Element(1), "output", &Fault::SameSides("ring".to_owned()));
    let finding = wrong(|d| d.elements[0] = element("A", HOUSING, HOUSING));
    assert_finding(&finding, Part::Element(0), "output", &Fault::SameSides(HOUSING.to_owned()));
}

#[test]
fn brakes_have_a_housing_and_clutches_have_none() {
    let finding = wrong(|d| d.elements[1].kind = ElementKind::Brake);
    assert_finding(&finding, Part::Element(1), "input", &Fault::BrakeWithoutHousing);
    let finding = wrong(|d| d.elements[0].kind = ElementKind::Clutch);
    assert_finding(&finding, Part::Element(0), "kind", &Fault::ClutchToHousing);
}

#[test]
fn unknown_names_are_refused_with_those_that_are_known() {
    let known = || ["turbine", "ring", "carrier"].map(str::to_owned).to_vec();
    let unknown = || Fault::Unknown { what: "shaft", name: "x".to_owned(), known: known() };
    assert_finding(&wrong(|d| d.sets[0].sun = "x".to_owned()), Part::Set(0), "sun", &unknown());
    assert_finding(&wrong(|d| d.elements[1].input = "x".to_owned()), Part::Element(1), "input", &unknown());
    assert_finding(&wrong(|d| d.input = "x".to_owned()), Part::Gearbox, "input", &unknown());
    let finding = wrong(|d| d.gears[1] = gear("2", &["C"]));
    assert_eq!((finding.part, finding.key), (Part::Gear(1), "engaged"));
    assert_eq!(finding.fault.hint().unwrap(), "the elements are A, B");
    assert_finding(
        &wrong(|d| d.input = "carrier".to_owned()),
        Part::Gearbox,
        "output",
        &Fault::InputIsOutput("carrier".to_owned()),
    );
    assert_finding(&wrong(|d| d.shafts.push(shaft("x", 0.1))), Part::Shaft(3), "name", &Fault::Loose("x".to_owned()));
}

#[test]
fn gears_with_too_many_too_few_or_wrong_elements_are_refused() {
    let named = |gear: &str, engaged: &str| (gear.to_owned(), engaged.to_owned());
    let (gear_name, engaged) = named("1", "A, B");
    let finding = wrong(|d| d.gears[0] = gear("1", &["A", "B"]));
    assert_finding(
        &finding,
        Part::Gear(0),
        "engaged",
        &Fault::Locked { gear: gear_name, engaged, count: 2, wanted: Some(1) },
    );
    assert!(finding.fault.hint().unwrap().contains("remove 1"));
    let finding = wrong(|d| d.gears[0] = gear("1", &[]));
    assert!(finding.to_string().contains("engages no element") && finding.fault.hint().unwrap().contains("add 1"));
    let finding = wrong(|d| d.gears[0] = gear("1", &["A", "A"]));
    assert_finding(&finding, Part::Gear(0), "engaged", &Fault::Repeated("A".to_owned()));
    let finding = wrong(|d| d.elements[0] = element("A", HOUSING, "turbine"));
    assert!(matches!(finding.fault, Fault::Held { held: "input", .. }), "{finding:?}");
    let finding = wrong(|d| d.elements[0] = element("A", HOUSING, "carrier"));
    assert!(matches!(finding.fault, Fault::Held { held: "output", .. }), "{finding:?}");
}

#[test]
fn sets_that_follow_from_each_other_or_leave_no_gears_are_refused() {
    assert_finding(&wrong(|d| d.sets.push(d.sets[0].clone())), Part::Gearbox, "planetary_set", &Fault::DependentSets);
    let finding = wrong(|d| d.sets[0].ring = HOUSING.to_owned());
    assert!(matches!(finding.fault, Fault::NoNeutral(ratio) if (ratio - 2.5).abs() < 1e-12), "{finding:?}");
    assert_finding(&wrong(|d| d.pairs.push(pair("turbine", "ring", None))), Part::Gearbox, "shaft", &Fault::Freedom(1));
}

#[test]
fn a_stated_ratio_that_does_not_come_out_is_refused() {
    let stated = |value: f64, decimals| wrong(|d| d.gears[0].stated_ratio = Some(StatedRatio { value, decimals }));
    assert!(matches!(stated(2.4, 1).fault, Fault::StatedRatio { .. }));
    assert!(stated(-2.5, 1).fault.hint().unwrap().contains("sign"));
    assert!(matches!(stated(f64::NAN, 1).fault, Fault::StatedRatio { .. }));
    let prints = |value, decimals, ratio| StatedRatio { value, decimals }.prints(ratio);
    assert!(prints(0.705, 3, 0.7054) && prints(0.705, 3, 0.7059) && prints(-2.39, 2, -2.3939) && prints(2.5, 1, 2.5));
    assert!(!prints(0.705, 3, 0.7061) && !prints(0.705, 3, 0.7044) && !prints(-2.39, 2, 2.39));
}

#[test]
fn an_element_that_slips_at_the_torque_asked_is_refused() {
    let with = |torque: Option<f64>, line_pressure_pa: Option<f64>| {
        let mut diagram = two_speed();
        diagram.elements[0].pack = Some(pack());
        diagram.gears[0].turbine_max_n_m = torque;
        Gearbox::new(&Description { line_pressure_pa, ..described(diagram) })
    };
    // 1 MPa: 0.048 m (10000 N - 500 N) = 456 N m; in 1st it holds 1.5 times the turbine torque.
    let capacity = with(Some(300.0), Some(1e6)).unwrap().capacities[0];
    assert!((capacity.capacity_n_m - 456.0).abs() < 1e-9 && (capacity.wanted_n_m - 450.0).abs() < 1e-9);
    let finding = with(Some(305.0), Some(1e6)).unwrap_err();
    assert_eq!((finding.part, finding.key), (Part::Element(0), "pack"));
    assert!(matches!(finding.fault, Fault::Capacity { .. }) && finding.fault.hint().is_some());
    assert!(matches!(with(Some(300.0), None).unwrap_err().fault, Fault::Missing(_)));
    assert!(with(None, None).unwrap().capacities.is_empty());
    for value in [f64::NAN, 0.0, -1.0, f64::INFINITY] {
        assert_eq!(with(Some(300.0), Some(value)).unwrap_err().key, "line_pressure_pa");
        assert_eq!(with(Some(value), Some(1e6)).unwrap_err().key, "turbine_max_n_m");
    }
}

#[test]
fn a_one_way_clutch_that_would_have_to_pull_is_refused() {
    // In 1st the ring is held against turning backwards: the housing drives it.
    let one_way = |input: &'static str, output: &'static str| {
        let mut diagram = two_speed();
        diagram.elements[0] = geartrain::Element { kind: ElementKind::OneWayClutch, ..element("A", input, output) };
        Gearbox::new(&described(diagram))
    };
    assert!(one_way(HOUSING, "ring").is_ok());
    let fault = Fault::OneWay { element: "A".to_owned(), gear: "1".to_owned() };
    assert_finding(&one_way("ring", HOUSING).unwrap_err(), Part::Gear(0), "engaged", &fault);
}

#[test]
fn a_one_way_clutch_that_would_hold_in_another_gear_is_refused() {
    // B drives the ring in 2nd; in 1st the ring stands, and the turbine would turn it.
    let mut diagram = two_speed();
    diagram.elements[1] = geartrain::Element { kind: ElementKind::OneWayClutch, ..element("B", "turbine", "ring") };
    let fault = Fault::OneWayBlocks { element: "B".to_owned(), gear: "1".to_owned() };
    assert_finding(&Gearbox::new(&described(diagram)).unwrap_err(), Part::Gear(0), "engaged", &fault);
    assert!(fault.hint().is_some());
}

fn shares(change: impl FnOnce(&mut Shares)) -> Finding {
    let gear = |name: &str, ratio: f64, element: &str| SharedGear {
        name: name.to_owned(),
        ratio,
        shares: vec![(element.to_owned(), 1.0)],
        turbine_max_n_m: None,
    };
    let mass = |a: &str, b: &str| ShiftMass {
        gears: [a.to_owned(), b.to_owned()],
        turbine_kg_m2: 0.06,
        coupling_kg_m2: -0.01,
        output_kg_m2: 0.2,
    };
    let mut shares = Shares {
        elements: vec![("A".to_owned(), ElementKind::Brake, None), ("B".to_owned(), ElementKind::Clutch, None)],
        gears: vec![gear("1", 2.5, "A"), gear("2", 1.0, "B")],
        masses: vec![mass("1", "2")],
    };
    change(&mut shares);
    Gearbox::new(&Description { name: String::new(), line_pressure_pa: None, given: Given::Shares(shares) })
        .unwrap_err()
}

#[test]
fn wrong_shares_and_masses_are_refused() {
    let at = |finding: Finding| (finding.part, finding.key);
    assert_eq!(at(shares(|s| s.gears.clear())), (Part::Gearbox, "gear"));
    assert_eq!(at(shares(|s| s.elements.clear())), (Part::Gearbox, "element"));
    assert_eq!(at(shares(|s| s.gears[0].shares[0].0 = "X".to_owned())), (Part::Gear(0), "engaged"));
    assert_eq!(at(shares(|s| s.gears[1].shares[0].1 = f64::NAN)), (Part::Gear(1), "shares"));
    for ratio in [0.0, f64::NAN, f64::INFINITY] {
        assert_eq!(at(shares(|s| s.gears[1].ratio = ratio)), (Part::Gear(1), "ratio"));
    }
    assert_eq!(at(shares(|s| s.masses[0].gears[1] = "3".to_owned())), (Part::Mass(0), "gears"));
    assert_eq!(at(shares(|s| s.masses[0].gears[1] = "1".to_owned())), (Part::Mass(0), "gears"));
    assert_eq!(at(shares(|s| s.masses.push(s.masses[0].clone()))), (Part::Mass(1), "gears"));
    assert_eq!(at(shares(|s| s.masses[0].turbine_kg_m2 = f64::NAN)), (Part::Mass(0), "turbine_kg_m2"));
    for coupling in [0.12, f64::NAN] {
        assert_eq!(at(shares(|s| s.masses[0].coupling_kg_m2 = coupling)), (Part::Mass(0), "coupling_kg_m2"));
    }
    // A share of zero has no alpha.
    let mut gears = None;
    let _ = shares(|s| {
        s.gears[0].shares[0].1 = 0.0;
        gears = Some(s.clone());
        s.gears.clear();
    });
    let given = Given::Shares(gears.unwrap());
    let gearbox = Gearbox::new(&Description { name: String::new(), line_pressure_pa: None, given }).unwrap();
    assert_eq!(gearbox.shift(0, 1).unwrap().reduced, None);
}

#[test]
fn wrong_ratios_are_refused() {
    let ratios = |gears: Vec<(&str, f64)>| {
        let gears = gears.into_iter().map(|(name, ratio)| Ratio { name: name.to_owned(), ratio }).collect();
        let given = Given::Ratios(Ratios { gears, masses: vec![] });
        Gearbox::new(&Description { name: String::new(), line_pressure_pa: None, given })
    };
    assert_eq!(ratios(vec![]).unwrap_err().fault, Fault::None);
    assert_eq!(ratios(vec![("1", f64::NAN)]).unwrap_err().key, "ratio");
    assert!(ratios(vec![("1", 2.0), ("2", 2.0)]).is_ok());
}

/// Names that are in part those of shafts.
fn name() -> impl Strategy<Value = String> {
    prop::sample::select(vec!["a", "b", "c", "d", "e", HOUSING, "x"]).prop_map(str::to_owned)
}

fn diagram() -> impl Strategy<Value = StickDiagram> {
    let shafts = prop::collection::vec((prop::sample::select(vec!["a", "b", "c", "d", "e"]), 1e-3..1.0), 0..6);
    let sets = prop::collection::vec((name(), name(), name(), 0_u32..90, 0_u32..120, any::<bool>()), 0..4);
    let pairs = prop::collection::vec((name(), name(), any::<bool>()), 0..2);
    let elements = prop::collection::vec((name(), name(), 0_usize..4), 0..6);
    let gears = prop::collection::vec(prop::collection::vec(0_usize..7, 0..4), 0..4);
    (shafts, sets, pairs, elements, gears).prop_map(|(mut shafts, sets, pairs, elements, gears)| {
        shafts.sort_by_key(|shaft| shaft.0);
        shafts.dedup_by_key(|shaft| shaft.0);
        let kinds = [ElementKind::Clutch, ElementKind::Brake, ElementKind::OneWayClutch, ElementKind::Dog];
        StickDiagram {
            input: "a".to_owned(),
            output: "b".to_owned(),
            shafts: shafts.into_iter().map(|(name, inertia)| shaft(name, inertia)).collect(),
            sets: (sets.into_iter())
                .map(|(sun, carrier, ring, sun_teeth, ring_teeth, is_double)| {
                    let planets = if is_double { Planets::Double } else { Planets::Single };
                    geartrain::PlanetarySet {
                        sun,
                        carrier,
                        ring,
                        sun_teeth,
                        ring_teeth,
                        planets,
                        planet_count: Some(sun_teeth % 5),
                        planet_teeth: vec![],
                    }
                })
                .collect(),
            pairs: pairs
                .into_iter()
                .map(|(driver, driven, has_dog)| pair(&driver, &driven, has_dog.then_some("e0")))
                .collect(),
            elements: (elements.into_iter().enumerate())
                .map(|(i, (input, output, kind))| geartrain::Element {
                    kind: if input == HOUSING { ElementKind::Brake } else { kinds[kind] },
                    ..element(&format!("e{}", i + 1), &input, &output)
                })
                .collect(),
            gears: (gears.into_iter().enumerate())
                .map(|(i, engaged)| EngagedGear {
                    engaged: engaged.iter().map(|e| format!("e{e}")).collect(),
                    ..gear(&format!("{i}"), &[])
                })
                .collect(),
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn no_description_panics_and_what_is_accepted_is_finite(diagram in diagram()) {
        match Gearbox::new(&described(diagram)) {
            Err(finding) => prop_assert!(!finding.to_string().is_empty()),
            Ok(gearbox) => {
                for gear in &gearbox.gears {
                    prop_assert!(gear.ratio.is_finite() && gear.ratio != 0.0);
                    prop_assert!(gear.holding.iter().all(|holding| holding.per_turbine_torque.is_finite()));
                }
                for shift in gearbox.shifts.iter().filter_map(|shift| shift.reduced) {
                    let [[a, b], [c, d]] = shift.mass_kg_m2;
                    prop_assert!(a > 0.0 && d > 0.0 && (b - c).abs() < 1e-9 * (1.0 + b.abs()), "{shift:?}");
                    prop_assert!(shift.ratio_offgoing().is_finite() && shift.ratio_oncoming().is_finite());
                }
            }
        }
    }
}

#[test]
fn what_is_possible_and_seldom_meant_is_a_warning() {
    assert_eq!(Gearbox::new(&described(two_speed())).unwrap().warnings, []);
    let mut diagram = two_speed();
    diagram.elements.push(element("C", HOUSING, "carrier"));
    diagram.gears.push(gear("3", &["A"]));
    let warnings = Gearbox::new(&described(diagram)).unwrap().warnings;
    assert_eq!(warnings.len(), 3, "{warnings:?}");
    assert_finding(&warnings[0], Part::Element(2), "name", &Fault::Unused("C".to_owned()));
    let same = Fault::SameElements { gear: "3".to_owned(), other: "1".to_owned() };
    assert_finding(&warnings[1], Part::Gear(2), "engaged", &same);
    let is_order = |fault: &Fault| matches!(fault, Fault::Order { gear, before, .. } if gear == "3" && before == "2");
    assert!(is_order(&warnings[2].fault) && warnings[2].fault.hint().is_some(), "{warnings:?}");
}

#[test]
fn a_gearbox_without_a_forward_gear_is_refused() {
    let ratios = |all: [f64; 2]| {
        let gears = all.map(|ratio| Ratio { name: format!("{ratio}"), ratio }).to_vec();
        let given = Given::Ratios(Ratios { gears, masses: vec![] });
        Gearbox::new(&Description { name: String::new(), line_pressure_pa: None, given })
    };
    assert!(ratios([-3.0, 2.0]).is_ok());
    let finding = ratios([-3.0, -2.0]).unwrap_err();
    assert_finding(&finding, Part::Gearbox, "gear", &Fault::NoForward);
    assert!(finding.fault.hint().unwrap().contains("`idler = true`"));
}
