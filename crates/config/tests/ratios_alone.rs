//! Cars of whose gearbox the ratios alone are known.

use std::path::Path;

use car::ratios_alone::ASSUMED_OF_N_M;
use car::{Car, TURBINE_SIDE_INERTIA_KG_M2};
use config::{CarFile, GearboxFile, Source};

#[test]
fn the_inertia_of_every_shift_between_neighbours_lies_within_the_assumed_bounds() {
    let [minimum, maximum] = TURBINE_SIDE_INERTIA_KG_M2;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../gearboxes");
    for name in ["ravigneaux_4", "lepelletier_6", "8hp", "10_speed"] {
        let gearbox = GearboxFile::read(&folder.join(format!("{name}.toml"))).unwrap().gearbox;
        for pair in gearbox.forward_gears().windows(2) {
            let inertia = gearbox.shift(pair[0], pair[1]).unwrap().reduced.unwrap().mass_kg_m2[0][0];
            assert!((minimum..=maximum).contains(&inertia), "{name} {pair:?} {inertia}");
        }
    }
    assert!((CarFile::eight_speed().unwrap().engine.largest_torque() - ASSUMED_OF_N_M).abs() < 0.5);
}

#[test]
fn a_car_by_ratios_alone_has_masses_of_its_size_and_says_how_far_they_may_be_off() {
    let car = |vehicle: &str, gearbox: &str| {
        let vehicle = Source::built_in("car.toml", &format!("name = \"car\"\ngearbox = \"g.toml\"\n{vehicle}"));
        let gears = "gear = [{ name = \"1\", ratio = 3.0 }, { name = \"2\", ratio = 2.0 }]";
        let gearbox = format!("name = \"g\"\nlevel = \"ratios\"\n{gears}\n{gearbox}");
        CarFile::from_sources(vehicle, Source::built_in("g.toml", &gearbox)).unwrap()
    };
    let assumed = car("", "");
    let mass = |car: &Car| car.gearbox.shift(0, 1).unwrap().reduced.unwrap().mass_kg_m2[0][0];
    let fraction = assumed.error_bounds.inertia_share.unwrap();
    let [minimum, maximum] = TURBINE_SIDE_INERTIA_KG_M2;
    for (end, off) in [(minimum, 1.0 + fraction), (maximum, 1.0 - fraction)] {
        assert!((mass(&assumed) / (end * off) - 1.0).abs() < 1e-3, "{fraction}");
    }
    let large = car("[engine]\nmax_torque_n_m = 380\n", "");
    assert!((mass(&large) / mass(&assumed) - 2.0).abs() < 1e-2);
    let given =
        "[[shift_mass]]\ngears = [\"1\", \"2\"]\nturbine_kg_m2 = 0.1\ncoupling_kg_m2 = -0.05\noutput_kg_m2 = 0.2\n";
    let known = car("", given);
    assert_eq!((mass(&known), known.error_bounds.inertia_share), (0.1, None));
    let own = car("[error_bounds]\ninertia_share = 0.3\n", "");
    assert_eq!(own.error_bounds.inertia_share, Some(0.3));
}
