//! Temperature of the steel plates of clutches by a lumped model.
//!
//! The linings are paper, which conducts little: the friction work `W` of a shift goes into the steel, and within a shift nothing of it
//! reaches the oil. Between shifts the excess over the oil falls with one time constant:
//!
//! ```text
//! dT = W / (m c) at the end of each shift,   dT(t) = dT(0) exp(-t / tau)
//! ```
//!
//! Left out: the temperature within a plate, where the faces are hotter for some tenths of a second, and the drag of an open clutch.

use std::collections::BTreeMap;

use car::Car;
use drivetrain::Real;

/// Specific heat of steel, J/(kg K).
const SPECIFIC_HEAT_J_KG_K: f64 = 480.0;
/// Time constant of the cooling by the oil, s \[chosen\].
const COOLING_S: f64 = 10.0;

/// How much hotter than the oil the plates of each element are.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct PlateTemperatures {
    /// By element: excess, K, and since when, s.
    excess_k: BTreeMap<usize, (f64, f64)>,
}

impl PlateTemperatures {
    /// Takes the friction work of an element in a shift that ends at this time, s; the temperature of its plates then, degC, in oil of
    /// this temperature. `None` of an element without plates, and where the work is not known.
    pub(crate) fn heated(&mut self, car: &Car, element: usize, work_j: f64, end_s: f64, oil_degc: f64) -> Option<f64> {
        let mass_kg = car.clutches.get(element)?.as_ref()?.steel_kg();
        let (before_k, since_s) = self.excess_k.get(&element).copied().unwrap_or((0.0, end_s));
        let cooled_k = before_k * Real::exp(-(end_s - since_s).max(0.0) / COOLING_S);
        let excess_k = cooled_k + work_j / (mass_kg * SPECIFIC_HEAT_J_KG_K);
        if !excess_k.is_finite() {
            return None;
        }
        self.excess_k.insert(element, (excess_k, end_s));
        Some(oil_degc + excess_k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plates_take_the_work_as_heat_and_cool_down_to_the_oil() {
        let mut car = config::CarFile::eight_speed().unwrap().car;
        let mut plates = PlateTemperatures::default();
        // Without a mass it follows from faces and piston.
        let clutch = car.clutches[1].as_ref().unwrap().clutch;
        let steel_kg = 0.5 * clutch.friction_faces * clutch.piston_area_m2 * 1.8e-3 * 7850.0;
        assert!((0.3..3.0).contains(&steel_kg), "{steel_kg}");
        let degc = plates.heated(&car, 1, 5e3, 1.0, 80.0).unwrap();
        assert!((degc - 80.0 - 5e3 / (480.0 * steel_kg)).abs() < 1e-9, "{degc}");
        car.clutches[0].as_mut().unwrap().steel_mass_kg = Some(0.5);
        // 4.8 kJ in 0.5 kg of steel are 20 K.
        let near = |found: Option<f64>, degc: f64| assert!((found.unwrap() - degc).abs() < 1e-9, "{found:?} {degc}");
        near(plates.heated(&car, 0, 4.8e3, 1.0, 80.0), 100.0);
        near(plates.heated(&car, 0, 4.8e3, 11.0, 80.0), 100.0 + 20.0 * Real::exp(-1.0));
        near(plates.heated(&car, 0, 0.0, 1e6, 80.0), 80.0);
        assert_eq!(plates.heated(&car, 0, f64::NAN, 1e6, 80.0), None);
        near(plates.heated(&car, 0, 0.0, 1e6, 80.0), 80.0);
        assert_eq!(plates.heated(&car, 99, 1.0, 1.0, 80.0), None);
    }
}
