//! The gear trains of published gearboxes, against what is published of them.
//!
//! Ratios are printed by the makers; holding torques, transitions, masses and capacities stand in the project's notes on
//! gear trains, from where they are copied. None of these numbers comes from this program.

use config::{GearboxFile, Source};
use geartrain::{Change, Gearbox};

macro_rules! gearbox {
    ($path:literal) => {
        GearboxFile::from_source(Source::built_in($path, include_str!($path)))
            .unwrap_or_else(|error| panic!("{error}"))
            .gearbox
    };
}

fn two_speed() -> Gearbox {
    gearbox!("../../../gearboxes/two_speed.toml")
}
fn aode() -> Gearbox {
    gearbox!("../../../gearboxes/ravigneaux_4.toml")
}
fn fn4a() -> Gearbox {
    gearbox!("../../../gearboxes/fn4a.toml")
}
fn a340e() -> Gearbox {
    gearbox!("../../../gearboxes/a340e.toml")
}
fn zf_6hp26() -> Gearbox {
    gearbox!("../../../gearboxes/lepelletier_6.toml")
}
fn tf80sc() -> Gearbox {
    gearbox!("../../../gearboxes/tf80sc.toml")
}
fn zf_8hp70() -> Gearbox {
    gearbox!("../../../gearboxes/8hp.toml")
}
fn zf_8hp45() -> Gearbox {
    gearbox!("../../../gearboxes/8hp45.toml")
}
fn gm_8l90() -> Gearbox {
    gearbox!("gearboxes/8l90.toml")
}
fn mercedes_9g() -> Gearbox {
    gearbox!("../../../gearboxes/9g_tronic.toml")
}
fn ford_10r80() -> Gearbox {
    gearbox!("../../../gearboxes/10_speed.toml")
}
fn d7uf1() -> Gearbox {
    gearbox!("../../../gearboxes/dual_clutch_7.toml")
}
fn a8lr1() -> Gearbox {
    gearbox!("../../../gearboxes/a8lr1.toml")
}
fn a8lr1_v6() -> Gearbox {
    gearbox!("gearboxes/a8lr1_v6.toml")
}

fn planetary() -> Vec<Gearbox> {
    vec![
        aode(),
        fn4a(),
        a340e(),
        zf_6hp26(),
        tf80sc(),
        zf_8hp70(),
        zf_8hp45(),
        gm_8l90(),
        mercedes_9g(),
        ford_10r80(),
        a8lr1(),
        a8lr1_v6(),
    ]
}

/// How a maker shortens a number.
#[derive(Clone, Copy, PartialEq)]
enum Printed {
    Rounded,
    Truncated,
}

/// Whether the number is printed so, with as many digits after the point as the text has.
///
/// A star marks a number that the notes have rounded twice, first to one digit more: 0.9475 of 0.94748 became 0.948. Exact
/// fractions confirm these numbers; the star holds for them alone.
fn prints(value: f64, text: &str, how: Printed) -> bool {
    let (text, twice) = text.strip_suffix('*').map_or((text, false), |text| (text, true));
    let decimals = text.split_once('.').map_or(0, |(_, digits)| digits.len());
    let scale = 10f64.powi(i32::try_from(decimals).unwrap());
    let printed = (text.parse::<f64>().unwrap() * scale).round();
    match how {
        Printed::Rounded if twice => {
            (value * scale).round() != printed && ((value * scale * 10.0).round() / 10.0).round() == printed
        }
        Printed::Rounded => (value * scale).round() == printed,
        // Some printed numbers are exact.
        Printed::Truncated => (value * scale * (1.0 + 1e-12)).trunc() == printed,
    }
}

/// Compares gears and ratios in the order of the file; returns how many there were.
fn assert_ratios(gearbox: &Gearbox, gears: &str, ratios: &str, how: Printed) -> usize {
    let names: Vec<&str> = gearbox.gears.iter().map(|gear| gear.name.as_str()).collect();
    assert_eq!(names, gears.split_whitespace().collect::<Vec<_>>(), "{}", gearbox.name);
    let printed: Vec<&str> = ratios.split_whitespace().collect();
    assert_eq!(printed.len(), gearbox.gears.len());
    for (gear, text) in gearbox.gears.iter().zip(&printed) {
        assert!(prints(gear.ratio, text, how), "{} gear {}: {} is not {text}", gearbox.name, gear.name, gear.ratio);
    }
    printed.len()
}

/// 1st gear on a one-way clutch, and the brake beside it for engine braking and reverse.
#[test]
fn a_brake_beside_a_one_way_clutch_holds_through_the_shift_to_reverse() {
    let gearbox = gearbox!("../../../gearboxes/ravigneaux_4_one_way.toml");
    let gear = |name: &str| gearbox.gear(name).unwrap();
    let element = |name: &str| gearbox.elements.iter().position(|element| element.name == name).unwrap();
    let change = |from: &str, to: &str| gearbox.shift(gear(from), gear(to)).unwrap().change.clone();
    let single = |off: &str, on: &str, held: &str| Change::Single {
        offgoing: element(off),
        oncoming: element(on),
        held: vec![element(held)],
    };
    assert_eq!(change("R", "1"), single("REV", "FWD", "LR"));
    assert_eq!(change("1", "R"), single("FWD", "REV", "LR"));
    assert_eq!(change("1", "2"), single("F1", "INT", "FWD"));
    assert_eq!(change("1", "L"), single("F1", "LR", "FWD"));
    assert_eq!(
        gearbox.shift(gear("R"), gear("1")).unwrap().reduced,
        gearbox.shift(gear("R"), gear("L")).unwrap().reduced
    );
    // Of the two gears of one ratio that of the one-way clutch is driven, wherever it stands in the table.
    assert_eq!(gearbox.forward_gears(), ["1", "2", "3", "4"].map(gear));
    assert_eq!(
        (gearbox.one_way_clutch_of(gear("1")), gearbox.one_way_clutch_of(gear("L"))),
        (Some(element("F1")), None)
    );
}

#[test]
fn all_102_published_ratios_come_out_to_the_published_digits() {
    use Printed::{Rounded, Truncated};
    let four = "R 1 2 3 4";
    let six = "R 1 2 3 4 5 6";
    let eight = "R 1 2 3 4 5 6 7 8";
    let mut count = 0;
    count += assert_ratios(&aode(), four, "-2.00 2.40 1.47 1.00 0.67", Rounded);
    count += assert_ratios(&fn4a(), four, "-2.648 2.816 1.497 1.000 0.725", Truncated);
    count += assert_ratios(&a340e(), four, "-2.393 2.804 1.531 1.000 0.705", Truncated);
    count += assert_ratios(&zf_6hp26(), six, "-3.403 4.171 2.340 1.521 1.143 0.867 0.691", Rounded);
    count += assert_ratios(&tf80sc(), six, "-3.394 4.148 2.370 1.556 1.155 0.859 0.686", Rounded);
    count +=
        assert_ratios(&zf_8hp70(), eight, "-3.2968 4.6957 3.1304 2.1039 1.6667 1.2845 1.0000 0.8392 0.6667", Rounded);
    count += assert_ratios(&zf_8hp45(), eight, "-3.295 4.714 3.143 2.106 1.667 1.285 1.000 0.839 0.667", Rounded);
    count +=
        assert_ratios(&gm_8l90(), eight, "-3.8176 4.5600 2.9709 2.0751 1.6876 1.2700 1.0000 0.8455 0.6515", Rounded);
    let nine = "-4.7983 5.3545 3.2432 2.2523 1.6356 1.2106 1.0000 0.8651 0.7167 0.6015";
    count += assert_ratios(&mercedes_9g(), "R 1 2 3 4 5 6 7 8 9", nine, Rounded);
    let ten = "-4.866 4.696 2.985 2.146 1.769 1.520 1.275 1.000 0.854 0.689 0.636";
    count += assert_ratios(&ford_10r80(), "R 1 2 3 4 5 6 7 8 9 10", ten, Rounded);
    count += assert_ratios(&a8lr1(), eight, "-2.273 3.964 2.468 1.610 1.176 1.000 0.832 0.652 0.565", Rounded);
    count += assert_ratios(&a8lr1_v6(), eight, "-2.273 3.665 2.396 1.610 1.190 1.000 0.826 0.643 0.556", Rounded);
    count += assert_ratios(&d7uf1(), "1 2 3 4 5 6 7", "16.87 9.95 6.49 4.59 3.53 2.80 2.29", Rounded);
    assert_eq!(count, 102);
}

#[test]
fn the_dual_clutch_has_the_published_ratios_of_gears_and_finals() {
    let finals = ["4.294", "4.294", "3.174", "4.294", "4.294", "3.174", "3.174"];
    let gears = "3.929 2.318 2.043 1.070 0.822 0.884 0.721";
    let of_final = |text: &str| if text == "4.294" { 73.0 / 17.0 } else { 73.0 / 23.0 };
    for ((gear, text), of) in d7uf1().gears.iter().zip(gears.split_whitespace()).zip(finals) {
        assert!(prints(of_final(of), of, Printed::Rounded));
        assert!(prints(gear.ratio / of_final(of), text, Printed::Rounded), "{} {text}", gear.name);
    }
}

/// Compares holding torques: for each gear in the order of the file, those of its elements.
fn assert_torques(gearbox: &Gearbox, gears: &[&str]) {
    assert_eq!(gears.len(), gearbox.gears.len());
    for (gear, printed) in gearbox.gears.iter().zip(gears) {
        let printed: Vec<&str> = printed.split_whitespace().collect();
        assert_eq!(2 * gear.holding.len(), printed.len(), "{} {}", gearbox.name, gear.name);
        assert!(gear.holding_is_unique);
        for pair in printed.chunks(2) {
            let named = |holding: &&geartrain::Holding| gearbox.elements[holding.element].name == pair[0];
            let found = gear.holding.iter().find(named).unwrap().per_turbine_torque;
            let is_printed = prints(found, pair[1], Printed::Rounded);
            assert!(is_printed, "{} {} {}: {found} is not {}", gearbox.name, gear.name, pair[0], pair[1]);
        }
    }
}

#[test]
fn all_holding_torques_of_the_four_and_six_speed_gearboxes_come_out() {
    assert_torques(
        &aode(),
        &[
            "REV 1.000 LR -3.000",
            "FWD 1.000 LR 1.400",
            "FWD 1.000 INT 0.467",
            "FWD 0.417 DIR 0.583",
            "DIR 1.000 INT -0.333",
        ],
    );
    assert_torques(
        &fn4a(),
        &[
            "REV 1.000 LR -3.649",
            "FWD 1.000 LR 1.816",
            "FWD 1.000 24 0.498",
            "FWD 0.355 34 0.645",
            "34 1.000 24 -0.274",
        ],
    );
    assert_torques(
        &zf_6hp26(),
        &[
            "B 1.521 D -4.924",
            "A 1.521 D 2.650",
            "A 1.521 C 0.819",
            "A 0.989 B 0.532",
            "A 0.417 E 0.726",
            "B -0.388 E 1.255",
            "C -0.309 E 1.000",
        ],
    );
}

fn mercedes_722_6() -> Gearbox {
    gearbox!("../../../gearboxes/722_6.toml")
}
fn c6() -> Gearbox {
    gearbox!("../../../gearboxes/c6.toml")
}
fn th400() -> Gearbox {
    gearbox!("../../../gearboxes/th400.toml")
}
fn gm_4l60e() -> Gearbox {
    gearbox!("../../../gearboxes/4l60e.toml")
}

#[test]
fn simpson_three_speeds_have_the_published_ratios_and_one_way_clutches_take_single_elements_over() {
    assert_ratios(&c6(), "R L 1 2 3", "-2.18 2.46 2.46 1.46 1.00", Printed::Rounded);
    assert_ratios(&th400(), "R 1 L 2 3", "-2.08 2.48 2.48 1.48 1.00", Printed::Rounded);
    // The sun of equal sets carries `ring over sun` of the turbine torque in 2nd, both sets together that of 1st.
    assert_torques(
        &c6(),
        &[
            "DIR 1.000 LR -3.182",
            "FWD 1.000 LR 1.458",
            "FWD 1.000 F1 1.458",
            "FWD 1.000 INT 0.458",
            "FWD 0.686 DIR 0.314",
        ],
    );
    assert_torques(
        &th400(),
        &[
            "DIR 1.000 LR -3.077 F2 0.000",
            "FWD 1.000 F1 1.481 F2 0.000",
            "FWD 1.000 LR 1.481 F2 0.000",
            "FWD 1.000 INT 0.481 F2 0.481",
            "FWD 0.675 INT 0.000 DIR 0.325",
        ],
    );
    for (gearbox, ups) in [(c6(), [["F1", "INT"], ["INT", "DIR"]]), (th400(), [["F1", "INT"], ["F2", "DIR"]])] {
        // A sprag behind a brake, which carries nothing in L, does not make it the gear of a one-way clutch.
        assert_eq!(gearbox.forward_gears(), ["1", "2", "3"].map(|name| gearbox.gear(name).unwrap()));
        for (pair, [off, on]) in gearbox.forward_gears().windows(2).zip(ups) {
            let element = |name: &str| gearbox.elements.iter().position(|element| element.name == name).unwrap();
            let up = gearbox.shift(pair[0], pair[1]).unwrap();
            assert_eq!(up.change.single(), Some([element(off), element(on)]), "{}", gearbox.name);
            assert_eq!(gearbox.shift(pair[1], pair[0]).unwrap().change.single(), Some([element(on), element(off)]));
        }
    }
}

#[test]
fn the_4l60e_has_the_published_ratios_and_its_sprag_carries_the_torque_of_the_forward_clutch() {
    let gearbox = gm_4l60e();
    assert_ratios(&gearbox, "R 1 2 3 4", "-2.294 3.059 1.625 1.000 0.696", Printed::Rounded);
    // Sun and ring of the input set share the turbine torque in 3rd by their teeth, 34 and 70.
    assert_torques(
        &gearbox,
        &[
            "REV 1.000 LR -3.294 F2 0.000",
            "FWD 1.000 F2 1.000 F1 2.059",
            "FWD 1.000 F2 1.000 24 0.625",
            "FWD 0.327 F2 0.327 34 0.673",
            "FWD 0.000 34 1.000 24 -0.304",
        ],
    );
}

#[test]
fn an_element_is_one_sided_where_a_one_way_clutch_that_is_held_holds_its_gear_too() {
    let one_sided = |gearbox: &Gearbox, from: &str, to: &str| {
        let shift = gearbox.shift(gearbox.gear(from).unwrap(), gearbox.gear(to).unwrap()).unwrap();
        shift.change.single().unwrap().map(|element| shift.is_one_sided(gearbox, element))
    };
    // The sprag is held from 1st to 2nd, opens from 2nd to 3rd, and carries nothing in L and R.
    let th400 = th400();
    assert_eq!(one_sided(&th400, "1", "2"), [false, true]);
    assert_eq!(one_sided(&th400, "2", "1"), [true, false]);
    assert_eq!(one_sided(&th400, "2", "3"), [false, false]);
    assert_eq!(one_sided(&th400, "L", "2"), [false, true]);
    assert_eq!(one_sided(&th400, "R", "1"), [false, false]);
    let gearbox = gm_4l60e();
    assert_eq!(one_sided(&gearbox, "1", "2"), [true, true]);
    assert_eq!(one_sided(&gearbox, "3", "2"), [true, true]);
    assert_eq!(one_sided(&gearbox, "3", "4"), [false, false]);
    let ravigneaux = gearbox!("../../../gearboxes/ravigneaux_4_one_way.toml");
    assert_eq!(one_sided(&ravigneaux, "1", "2"), [false, false]);
    assert_eq!(one_sided(&ravigneaux, "R", "1"), [false, false]);
}

#[test]
fn the_722_6_has_the_published_ratios_and_changes_one_element_from_gear_to_gear() {
    let gearbox = mercedes_722_6();
    assert_ratios(&gearbox, "R R2 1 2 3 4 5", "-3.167 -1.926 3.595 2.186 1.405 1.000 0.831", Printed::Rounded);
    assert_torques(
        &gearbox,
        &[
            "B1 0.644 B3 -4.812 K3 -0.914",
            "B3 -2.926 K1 0.644 K3 -0.556",
            "B1 0.644 B2 1.951 K3 -0.914",
            "B2 1.186 K1 0.644 K3 -0.556",
            "B2 0.405 K1 0.000 K2 1.000",
            "K1 -0.335 K2 1.519 K3 0.288",
            "B1 -0.169 K2 1.262 K3 0.240",
        ],
    );
    assert_eq!(several(&gearbox, "double"), ["1-3", "1-4", "2-5", "3-5"]);
}

/// Not published: the element released and the output held, its slip is the reciprocal of its torque, in exact fractions.
#[test]
fn holding_torques_are_those_of_virtual_work() {
    assert_torques(
        &a340e(),
        &[
            "C0 -0.418 C2 1.000 B3 -3.394",
            "C0 -0.418 C1 1.000 B3 1.804",
            "C0 -0.418 C1 1.000 B2 0.532",
            "C0 -0.418 C1 0.653 C2 0.347",
            "B0 -0.295 C1 0.461 C2 0.245",
        ],
    );
    assert_torques(
        &tf80sc(),
        &[
            "B 1.556 D -4.949",
            "A 1.556 D 2.593",
            "A 1.556 C 0.815",
            "A 1.021 B 0.535",
            "A 0.433 E 0.722",
            "B -0.394 E 1.253",
            "C -0.314 E 1.000",
        ],
    );
    assert_torques(
        &zf_8hp45(),
        &[
            "A -1.654 B -2.641 D 1.733",
            "A 1.238 B 2.476 C 1.000",
            "A 0.492 B 1.651 E 0.667",
            "B 1.106 C -0.660 E 1.106",
            "B 0.667 D 0.397 E 0.514",
            "B 0.285 C 0.572 D 0.742",
            "C 1.000 D 1.000 E -0.385",
            "A -0.161 C 0.516 D 0.839",
            "A -0.333 D 0.667 E 0.410",
        ],
    );
}

#[test]
fn all_holding_torques_of_the_8hp70_come_out() {
    assert_torques(
        &zf_8hp70(),
        &[
            "A -1.655* B -2.642 D 1.739",
            "A 1.232 B 2.464 C 1.000",
            "A 0.488 B 1.643 E 0.667",
            "B 1.104 C -0.656 E 1.104",
            "B 0.667 D 0.396 E 0.515",
            "B 0.285 C 0.573 D 0.742",
            "C 1.000 D 1.000 E -0.383",
            "A -0.161 C 0.518* D 0.839",
            "A -0.333 D 0.667 E 0.411",
        ],
    );
}

#[test]
fn all_holding_torques_of_the_9g_come_out() {
    assert_torques(
        &mercedes_9g(),
        &[
            "B2 0.651 B3 -3.319 B1 -3.130",
            "B2 0.651 B3 3.704 C2 3.130",
            "B3 2.243 C2 1.000 C1 1.000",
            "B2 -0.306 B3 1.558 C1 1.469",
            "B2 0.000 B3 0.636 C3 0.717",
            "B2 0.211 C3 1.211 C1 -1.013",
            "C3 1.000 C2 -0.395 C1 -0.395",
            "B2 -0.135 C3 0.865 C2 -0.649",
            "B1 -0.283 C3 0.717 C2 -0.283",
            "B2 0.105 B1 -0.503 C3 0.601",
        ],
    );
}

#[test]
fn all_holding_torques_of_the_10r80_come_out() {
    assert_torques(
        &ford_10r80(),
        &[
            "A -3.733 B -2.133 D 1.036 F -1.036",
            "A 2.508 B 1.188 D 0.000 E 1.000",
            "A 1.594 B 0.391 C 0.636 D -0.636",
            "A 1.146 C 0.948* D -0.948* E -0.490",
            "A 0.769 C 0.537 D -0.377 F -0.161",
            "A 0.520 C 0.267* E 0.324 F -0.267*",
            "A 0.275 D 0.371 E 0.642 F -0.371",
            "C -0.299 D 0.787 E 1.000 F -0.488",
            "B -0.146 D 0.416 E 0.598 F -0.416",
            "B -0.311 C 0.336 E 0.147 F -0.336",
            "B -0.364 C 0.446* D -0.135 F -0.310",
        ],
    );
}

#[test]
fn all_holding_torques_of_the_a8lr1_and_the_dual_clutch_come_out() {
    assert_torques(
        &a8lr1(),
        &[
            "35R 1.483 8LR -3.273",
            "UD 2.586 8LR 1.985",
            "UD 1.610 27 0.858",
            "UD 1.610 35R 0.560",
            "UD 0.465 4OD 0.711",
            "35R -0.227 4OD 1.000",
            "6 -0.445 4OD 1.276",
            "27 -0.348 4OD 1.000",
            "8LR -0.435 4OD 0.867",
        ],
    );
    for gear in d7uf1().gears {
        assert!((gear.holding[0].per_turbine_torque - 1.0).abs() < 1e-12, "{}", gear.name);
    }
}

#[test]
fn the_output_gets_the_torques_of_the_turbine_and_of_the_housing() {
    for gearbox in planetary() {
        let train = gearbox.train.as_ref().unwrap();
        // A set with the housing as a member takes torque from it as well.
        if train.sets.iter().any(|set| [set.sun, set.carrier, set.ring].contains(&geartrain::Member::Housing)) {
            continue;
        }
        for gear in &gearbox.gears {
            let is_brake = |element: usize| gearbox.elements[element].kind == geartrain::ElementKind::Brake;
            let brakes = gear.holding.iter().filter(|holding| is_brake(holding.element));
            let housing: f64 = brakes.map(|holding| holding.per_turbine_torque).sum();
            assert!((gear.ratio - 1.0 - housing).abs() < 1e-9, "{} {}", gearbox.name, gear.name);
            // Without a brake everything turns at one speed.
            if housing == 0.0 && !gear.holding.iter().any(|holding| is_brake(holding.element)) {
                assert!(gear.shaft_speeds.iter().all(|speed| (speed.unwrap() - 1.0).abs() < 1e-9), "{}", gearbox.name);
            }
        }
    }
}

#[test]
fn in_every_gear_the_speeds_of_a_set_lie_on_its_lever() {
    for gearbox in planetary().into_iter().chain([two_speed()]) {
        let train = gearbox.train.as_ref().unwrap();
        for gear in &gearbox.gears {
            let speed = |member: geartrain::Member| match member {
                geartrain::Member::Housing => 0.0,
                geartrain::Member::Shaft(shaft) => gear.shaft_speeds[shaft].unwrap(),
            };
            for set in &train.sets {
                let planets = if set.planets == geartrain::Planets::Double { -1.0 } else { 1.0 };
                let [sun, ring] = [set.sun_teeth, set.ring_teeth].map(f64::from);
                // Along the lever: sun at 1/Z_s, carrier at 0, ring at -1/Z_r, or 1/Z_r with pairs of planets.
                let to_sun = (speed(set.sun) - speed(set.carrier)) * sun;
                let to_ring = (speed(set.carrier) - speed(set.ring)) * ring;
                assert!((to_sun - planets * to_ring).abs() < 1e-7, "{} {}", gearbox.name, gear.name);
            }
        }
    }
}

/// Forward gears in ascending order between which several elements change, as "1-4".
fn several(gearbox: &Gearbox, name: &str) -> Vec<String> {
    let is = |from: usize, to: usize| {
        let change = &gearbox.shift(from, to).unwrap().change;
        matches!(change, Change::Several { .. }) && change.name() == name
    };
    let gears = gearbox.forward_gears();
    let named = |gear: usize| gearbox.gears[gear].name.as_str();
    let mut pairs = Vec::new();
    for (at, &low) in gears.iter().enumerate() {
        for &high in &gears[at + 1..] {
            assert_eq!(is(low, high), is(high, low), "both directions");
            if is(low, high) {
                pairs.push(format!("{}-{}", named(low), named(high)));
            }
        }
    }
    pairs
}

#[test]
fn the_double_and_triple_transitions_are_those_listed() {
    let list = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let expected = [
        (vec![aode(), fn4a()], "1-4"),
        (vec![a340e()], "1-4 2-4"),
        (vec![zf_6hp26(), tf80sc()], "1-5 1-6 2-5 3-6"),
        (vec![zf_8hp70(), zf_8hp45(), gm_8l90()], "1-4 1-6 1-8 2-5 2-6 2-7 3-7 3-8 4-7 5-8"),
        (vec![ford_10r80()], "1-4 1-5 1-7 1-9 1-10 2-5 2-6 2-7 2-8 2-9 3-8 3-9 3-10 4-8 4-9 5-8 5-10 6-9 6-10"),
        (vec![mercedes_9g()], "1-5 1-6 1-8 1-9 2-4 2-5 2-7 2-8 3-6 3-7 3-9 4-6 4-8 5-8 6-9"),
        (vec![a8lr1(), a8lr1_v6()], "1-5 1-6 1-7 2-5 2-6 2-8 3-6 3-7 3-8"),
    ];
    for (gearboxes, pairs) in &expected {
        for gearbox in gearboxes {
            assert_eq!(several(gearbox, "double"), list(pairs), "{}", gearbox.name);
            let triple = if gearbox.name.starts_with("9-speed") { "2-9 3-8" } else { "" };
            assert_eq!(several(gearbox, "triple"), list(triple), "{}", gearbox.name);
        }
    }
}

#[test]
fn every_shift_between_neighbours_is_a_single_transition() {
    for gearbox in planetary().into_iter().chain([d7uf1(), two_speed()]) {
        for pair in gearbox.forward_gears().windows(2) {
            for (from, to) in [(pair[0], pair[1]), (pair[1], pair[0])] {
                let shift = gearbox.shift(from, to).unwrap();
                assert!(matches!(shift.change, Change::Single { .. }) && shift.reduced.is_some(), "{}", gearbox.name);
            }
        }
    }
}

#[test]
fn kind_and_order_of_a_shift_follow_from_its_gears_and_the_turbine_torque() {
    use drivetrain::{PhaseOrder, ShiftKind};
    let gearbox = zf_8hp70();
    let kind = |from: &str, to: &str, torque: f64| {
        let [from, to] = [from, to].map(|name| gearbox.gear(name).unwrap());
        gearbox.shift(from, to).unwrap().kind(&gearbox.gears, torque)
    };
    assert_eq!(kind("1", "2", 200.0), Some(ShiftKind::PowerOnUp));
    assert_eq!(kind("8", "5", 200.0), Some(ShiftKind::PowerOnDown));
    assert_eq!(kind("3", "4", -20.0), Some(ShiftKind::PowerOffUp));
    assert_eq!(kind("3", "2", -20.0).unwrap().order(), PhaseOrder::TorqueFirst);
    assert_eq!(kind("R", "1", 50.0), None);
}

#[test]
fn in_all_single_transitions_turbine_and_output_speed_determine_the_others() {
    let mut count = 0;
    for gearbox in planetary() {
        for shift in &gearbox.shifts {
            let Change::Single { offgoing, oncoming, .. } = shift.change else { continue };
            count += 1;
            let reduced = shift.reduced.unwrap();
            // The clutches of the shift have the ratios of its gears, and `1/alpha` is the holding torque.
            for (gear, element, ratio, alpha) in [
                (shift.from, offgoing, reduced.ratio_offgoing(), reduced.slip_offgoing[0]),
                (shift.to, oncoming, reduced.ratio_oncoming(), reduced.slip_oncoming[0]),
            ] {
                let gear = &gearbox.gears[gear];
                let torque = gear.holding.iter().find(|holding| holding.element == element).unwrap().per_turbine_torque;
                assert!((ratio - gear.ratio).abs() < 1e-9 * gear.ratio.abs(), "{} {}", gearbox.name, gear.name);
                assert!((1.0 / alpha - torque).abs() < 1e-9, "{} {}", gearbox.name, gear.name);
            }
        }
    }
    assert_eq!(count, 438);
}

/// Compares a row of the table of upshifts: gears, elements, `alpha` of both (`-`: not given), ratios, `M11 M12 M22`, turbine
/// acceleration per torque at the turbine in the inertia phase and in the torque phase with this inertia of a rigid car at the
/// output, the one over the other.
fn assert_upshift(gearbox: &Gearbox, car_kg_m2: f64, row: &str) {
    let [gears, elements, alphas, ratios, masses, accelerations, over] = row
        .split('|')
        .map(|group| group.split_whitespace().collect::<Vec<_>>())
        .collect::<Vec<_>>()
        .try_into()
        .unwrap();
    let [from, to] = [0, 1].map(|at: usize| gearbox.gear(gears[at]).unwrap());
    let shift = gearbox.shift(from, to).unwrap();
    let Change::Single { offgoing, oncoming, .. } = shift.change else { panic!("{}", gearbox.name) };
    assert_eq!([offgoing, oncoming].map(|at| gearbox.elements[at].name.as_str()), elements[..]);
    let reduced = shift.reduced.unwrap();
    let near = |values: &[f64], texts: &[&str]| {
        assert_eq!(values.len(), texts.len(), "{row}");
        for (&value, text) in values.iter().zip(texts).filter(|(_, text)| **text != "-") {
            assert!(prints(value, text, Printed::Rounded), "{} {row}: {value} is not {text}", gearbox.name);
        }
    };
    near(&[reduced.slip_offgoing[0], reduced.slip_oncoming[0]], &alphas);
    near(&[reduced.ratio_offgoing(), reduced.ratio_oncoming()], &ratios);
    let mass = reduced.mass_kg_m2;
    near(&[mass[0][0], mass[0][1], mass[1][1]], &masses);
    let with_car = reduced.with_output_inertia(car_kg_m2);
    let per_torque = |engagement: drivetrain::Engagement| {
        let row = with_car.coefficients(engagement).turbine;
        row.per_oncoming_torque.abs() / with_car.slip_oncoming[0].abs()
    };
    let inertia = per_torque(drivetrain::Engagement::BothSlipping);
    let torque = per_torque(drivetrain::Engagement::OffgoingStuck);
    near(&[inertia, torque], &accelerations);
    near(&[inertia / torque], &over);
}

#[test]
fn masses_and_accelerations_are_those_of_the_table_of_upshifts() {
    // 1500 kg on wheels of 0.3 m behind a final ratio of 3; of the chapter, 15 kg m^2 in all.
    let car = 1500.0 * 0.3 * 0.3 / 9.0;
    let table = [
        (two_speed(), car - 0.15, "1 2 | A B | - 1.67 | 2.5 1 | 0.0644 -0.011 0.178 | 15.5 0.244 | 64"),
        (aode(), car, "1 2 | LR INT | 0.714 2.143 | 2.40 1.47 | 0.108 -0.057 0.151 | 9.2 0.145 | 64"),
        (zf_6hp26(), car, "2 3 | C B | 1.222 1.879 | 2.34 1.52 | 0.082* -0.029 0.134 | 12.3* 0.124 | 99"),
        (zf_8hp70(), car, "1 2 | C E | 1.000 1.500 | 4.70 3.13 | 0.080 0.009 0.289 | 12.6 0.429 | 29"),
        (zf_8hp70(), car, "2 3 | A C | 2.050 -1.525 | 3.13 2.10 | 0.209 -0.217 0.441 | 4.7 0.199 | 24"),
        (zf_8hp70(), car, "7 8 | C E | 1.932 2.432 | 0.84 0.67 | 0.086 -0.010 0.094 | 11.6 0.010 | 1212"),
        (mercedes_9g(), car, "6 7 | C1 B2 | -2.529 -7.415 | 1.00 0.87 | 0.589 -0.422 0.412 | 1.7 0.009 | 190"),
        (ford_10r80(), car, "9 10 | E D | 6.813 -7.386 | 0.69 0.64 | 0.378 -0.177 0.196 | 2.6 0.002 | 1085"),
        (a8lr1(), car, "1 2 | 8LR 27 | 0.504 1.166 | 3.96 2.47 | 0.090 -0.050* 0.193 | 11.1 0.366 | 30"),
        (a8lr1(), car, "2 3 | 27 35R | 1.166 1.787 | 2.47 1.61 | 0.090 -0.050* 0.193 | 11.1 0.137 | 81"),
        (a8lr1(), car, "3 4 | 35R 4OD | 1.787 1.406 | 1.61 1.18 | 0.090 -0.050* 0.193 | 11.1 0.046 | 244"),
        // The final drive is inside.
        (d7uf1(), 9.0 * car, "3 4 | K1 K2 | 1 1 | 6.49 4.59 | 0.066 0 0.68 | 15.2 0.089 | 171"),
    ];
    for (gearbox, car_kg_m2, row) in &table {
        assert_upshift(gearbox, *car_kg_m2, row);
    }
}

/// Compares element, friction faces, torque asked in N m, the gear and the capacity over it, "FWD 6 400 1 1.35"; "-" where
/// the gear is not given.
fn assert_capacities(gearbox: &Gearbox, expected: &[&str]) {
    assert_eq!(gearbox.capacities.len(), expected.len(), "{}", gearbox.name);
    for (capacity, row) in gearbox.capacities.iter().zip(expected) {
        let element = &gearbox.elements[capacity.element];
        let [name, faces, torque, gear, ratio] = row.split_whitespace().collect::<Vec<_>>()[..] else {
            panic!("{row}")
        };
        assert_eq!(element.name, name, "{}", gearbox.name);
        assert_eq!(element.pack.unwrap().friction_faces, faces.parse::<f64>().unwrap());
        if gear != "-" {
            // Two gears may ask for the same torque.
            let gear = &gearbox.gears[gearbox.gear(gear).unwrap()];
            let holding = gear.holding.iter().find(|holding| holding.element == capacity.element).unwrap();
            let asked = holding.per_turbine_torque.abs() * gear.turbine_max_n_m.unwrap();
            assert!((asked - capacity.wanted_n_m).abs() < 1e-9 * asked, "{} {row}", gearbox.name);
        }
        assert!(
            prints(capacity.wanted_n_m, torque, Printed::Rounded),
            "{} {row}: {}",
            gearbox.name,
            capacity.wanted_n_m
        );
        assert!(prints(capacity.ratio(), ratio, Printed::Rounded), "{} {row}: {}", gearbox.name, capacity.ratio());
    }
}

#[test]
fn capacities_are_those_of_the_table_of_sizes() {
    assert_capacities(
        &aode(),
        &["FWD 6 400 1 1.35", "DIR 4 250 4 1.44", "REV 6 400 R 1.35", "INT 4 187 2 2.95", "LR 8 1200 R 1.59"],
    );
    assert_capacities(
        &fn4a(),
        &["FWD 6 400 - 1.35", "34 4 250 - 1.44", "REV 6 400 - 1.35", "24 4 199 - 2.77", "LR 8 1459 R 1.31"],
    );
    assert_capacities(
        &a340e(),
        &[
            "C0 4 167 - 2.15",
            "B0 4 74 - 7.5",
            "C1 6 400 - 1.35",
            "C2 6 400 R 1.35",
            "B2 4 213 - 2.59",
            "B3 8 1358 R 1.40",
        ],
    );
    assert_capacities(
        &zf_6hp26(),
        &["A 10 608 1 1.48", "B 10 608 R 1.48", "C 4 327 2 1.68", "D 12 1969 R 1.45", "E 6 314 5 1.72"],
    );
    assert_capacities(
        &zf_8hp70(),
        &["A 8 662 R 1.66", "B 6 1057 R 1.35", "C 6 400 1 1.35", "D 12 696 R 1.55", "E 4 276 3 1.30"],
    );
    assert_capacities(
        &mercedes_9g(),
        &[
            "B1 8 1252 R 1.52",
            "B2 4 260 1 2.12",
            "B3 10 1481 1 1.61",
            "C1 6 400 2 1.35",
            "C2 12 1252 1 1.46",
            "C3 6 303 5 1.78",
        ],
    );
    assert_capacities(
        &ford_10r80(),
        &[
            "A 10 1493 R 1.60",
            "B 10 853 R 1.61",
            "C 4 254 2 1.41",
            "D 6 415 R 1.30",
            "E 6 400 1 1.35",
            "F 6 415 R 1.30",
        ],
    );
    assert_capacities(
        &a8lr1(),
        &[
            "UD 10 1034 1 1.47",
            "35R 10 593 R 1.52",
            "4OD 6 319 6 1.69",
            "6 4 111 6 3.23",
            "27 4 343 2 1.60",
            "8LR 8 1309 R 1.46",
        ],
    );
    assert_capacities(&d7uf1(), &["K1 4 250 - 1.44", "K2 4 250 - 1.44"]);
}
