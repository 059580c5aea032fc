//! The nine-speed gearbox with two dog clutches.

use config::{GearboxFile, Source};
use geartrain::{Change, Gearbox};

fn gearbox() -> Gearbox {
    let text = include_str!("../../../gearboxes/9hp48.toml");
    GearboxFile::from_source(Source::built_in("9hp48.toml", text)).unwrap().gearbox
}

#[test]
fn the_9hp_has_the_published_ratios_and_holding_torques_of_its_teeth() {
    let gearbox = gearbox();
    let printed = [-3.805, 4.700, 2.842, 1.909, 1.382, 1.000, 0.808, 0.699, 0.580, 0.479];
    for (gear, ratio) in gearbox.gears.iter().zip(printed) {
        assert!((gear.ratio - ratio).abs() <= 0.0005, "{}: {}", gear.name, gear.ratio);
        // The housing and the input take what the output has.
        let sum: f64 = gear
            .holding
            .iter()
            .filter(|of| "CDF".contains(&*gearbox.elements[of.element].name))
            .map(|of| of.per_turbine_torque)
            .sum();
        assert!((1.0 + sum - gear.ratio).abs() < 1e-9, "{}: {sum}", gear.name);
    }
    let torque = |gear: &str, element: &str| {
        let gear = &gearbox.gears[gearbox.gear(gear).unwrap()];
        let of = gear.holding.iter().find(|of| gearbox.elements[of.element].name == element).unwrap();
        of.per_turbine_torque
    };
    // 1st: the sun of set 2 is driven and its ring held. 4th: the ring of set 4 is driven and its sun held.
    assert!((torque("1", "D") - 133.0 / 91.0).abs() < 1e-12);
    assert!((torque("4", "F") - 42.0 / 110.0).abs() < 1e-12 && torque("4", "A").abs() < 1e-12);
    assert!((torque("8", "E") - 1.0).abs() < 1e-12);
}

#[test]
fn a_dog_changes_in_4_5_and_7_8_and_is_put_in_in_downshifts_alone() {
    let gearbox = gearbox();
    let of = |from: &str, to: &str| {
        let shift = gearbox.shift(gearbox.gear(from).unwrap(), gearbox.gear(to).unwrap()).unwrap();
        let Change::Single { offgoing, oncoming, .. } = shift.change else { panic!("{shift:?}") };
        let names = [offgoing, oncoming].map(|element| gearbox.elements[element].name.clone()).join(" ");
        (names, [offgoing, oncoming].map(|element| gearbox.is_dog(element)), shift.changes_dog_under_power(&gearbox))
    };
    assert_eq!(of("4", "5"), ("F B".into(), [true, false], true));
    assert_eq!(of("5", "4"), ("B F".into(), [false, true], true));
    assert_eq!(of("7", "8"), ("A C".into(), [true, false], true));
    assert_eq!(of("8", "7"), ("C A".into(), [false, true], true));
    for (from, to) in [("1", "2"), ("2", "3"), ("3", "4"), ("5", "6"), ("6", "7"), ("8", "9")] {
        let (names, dogs, _) = of(from, to);
        assert_eq!(dogs, [false; 2], "{from}-{to}: {names}");
    }
    // From one direction to the other the turbine is not at synchronous speed.
    assert_eq!(of("R", "1"), ("B A".into(), [false, true], false));
    assert_eq!(of("1", "R"), ("A B".into(), [true, false], false));
}
