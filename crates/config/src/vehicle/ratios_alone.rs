//! A car of whose gearbox the ratios alone are known: what is assumed of its inertia.

use drivetrain::{Engine, ReducedShift};
use geartrain::Gearbox;

/// Least and greatest inertia `M11` of the turbine's side of a shift, kg m^2 \[chosen\]: those of all shifts between neighbouring gears of the
/// planetary gearboxes that ship lie between. It differs from shift to shift of one gearbox, by the drums that turn with the turbine.
pub const TURBINE_SIDE_INERTIA_KG_M2: [f64; 2] = [0.078, 0.382];
/// Greatest engine torque of a car with these gearboxes, N m: that of `vehicles/eight_speed.toml`.
const ENGINE_TORQUE_N_M: f64 = 190.0;
/// `M12` and `M22` beside it, kg m^2 \[chosen\]: in the middle of those of these gearboxes, 0.01 to -0.48 and 0.09 to 0.95.
const COUPLING_KG_M2: f64 = -0.2;
const OUTPUT_KG_M2: f64 = 0.4;

/// Gives shifts of which nothing but the ratios is known a mass, by the size of the engine. Returns the share of the true
/// inertia by which it may be off, where one was given.
pub(super) fn assume_masses(gearbox: &mut Gearbox, engine: &Engine<f64>) -> Option<f64> {
    let size = engine.largest_torque() / ENGINE_TORQUE_N_M;
    // The one that is off by the same share of either end.
    let [least, greatest] = TURBINE_SIDE_INERTIA_KG_M2;
    let middle = 2.0 * least * greatest / (least + greatest);
    let mass_kg_m2 =
        [[middle, COUPLING_KG_M2], [COUPLING_KG_M2, OUTPUT_KG_M2]].map(|row| row.map(|entry| size * entry));
    let ratios: Vec<f64> = gearbox.gears.iter().map(|gear| gear.ratio).collect();
    let slip = |gear: usize| [1.0, -ratios[gear]];
    let mut is_assumed = false;
    for shift in gearbox.shifts.iter_mut().filter(|shift| shift.reduced.is_none()) {
        is_assumed = true;
        let (slip_offgoing, slip_oncoming) = (slip(shift.from), slip(shift.to));
        shift.reduced = Some(ReducedShift { mass_kg_m2, slip_offgoing, slip_oncoming });
    }
    is_assumed.then(|| (greatest - least) / (greatest + least))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Car, GearboxFile, Source};
    use std::path::Path;

    #[test]
    fn the_inertia_of_every_shift_between_neighbours_lies_within_the_assumed_bounds() {
        let [least, greatest] = TURBINE_SIDE_INERTIA_KG_M2;
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../gearboxes");
        for name in ["ravigneaux_4", "lepelletier_6", "8hp", "10_speed"] {
            let gearbox = GearboxFile::read(&folder.join(format!("{name}.toml"))).unwrap().gearbox;
            for pair in gearbox.forward_gears().windows(2) {
                let inertia = gearbox.shift(pair[0], pair[1]).unwrap().reduced.unwrap().mass_kg_m2[0][0];
                assert!((least..=greatest).contains(&inertia), "{name} {pair:?} {inertia}");
            }
        }
        assert!((Car::eight_speed().unwrap().engine.largest_torque() - ENGINE_TORQUE_N_M).abs() < 0.5);
    }

    #[test]
    fn a_car_by_ratios_alone_has_masses_of_its_size_and_says_how_far_they_may_be_off() {
        let car = |vehicle: &str, gearbox: &str| {
            let vehicle = Source::built_in("car.toml", &format!("name = \"car\"\ngearbox = \"g.toml\"\n{vehicle}"));
            let gears = "gear = [{ name = \"1\", ratio = 3.0 }, { name = \"2\", ratio = 2.0 }]";
            let gearbox = format!("name = \"g\"\nlevel = \"ratios\"\n{gears}\n{gearbox}");
            Car::from_sources(vehicle, Source::built_in("g.toml", &gearbox)).unwrap()
        };
        let assumed = car("", "");
        let mass = |car: &Car| car.gearbox.shift(0, 1).unwrap().reduced.unwrap().mass_kg_m2[0][0];
        let share = assumed.error_bounds.inertia_share.unwrap();
        let [least, greatest] = TURBINE_SIDE_INERTIA_KG_M2;
        for (end, off) in [(least, 1.0 + share), (greatest, 1.0 - share)] {
            assert!((mass(&assumed) / (end * off) - 1.0).abs() < 1e-3, "{share}");
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
}
