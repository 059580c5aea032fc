//! What to do about elements that slip at full throttle.

use std::fmt::Write as _;

use geartrain::Capacity;

use super::CarFile;

/// Line pressure that is not proposed, Pa: no supply of a passenger car gives it \[chosen\].
const MAX_LINE_PRESSURE_PA: f64 = 3e6;

impl CarFile {
    /// Says which closed elements slip at full throttle, with a hint; nothing where all of them hold.
    pub fn slipping_elements(&self) -> Option<String> {
        let slipping: Vec<Capacity> = self.capacities().into_iter().filter(|capacity| !capacity.holds()).collect();
        let minimum = slipping.iter().map(Capacity::ratio).reduce(f64::min)?;
        let mut said = format!("closed elements slip at full throttle, at {:.2} MPa: ", 1e-6 * self.line_pressure_pa);
        for (at, capacity) in slipping.iter().enumerate() {
            // Writing to a text cannot fail.
            let _ = write!(
                said,
                "{}{} holds {:.0} N m, {:.0} N m are required in gear {}",
                if at == 0 { "" } else { "; " },
                self.gearbox.elements[capacity.element].name,
                capacity.capacity_n_m,
                capacity.wanted_n_m,
                self.gearbox.gears[capacity.gear].name
            );
        }
        let pressure_pa = slipping.iter().map(|capacity| self.holding_pressure(capacity)).fold(0.0, f64::max);
        Some(format!("{said}\nhint: {}", self.how_to_hold(minimum, pressure_pa)))
    }

    /// What to change where elements hold the fraction `minimum` of what is asked of them, and all of it at this line pressure.
    fn how_to_hold(&self, minimum: f64, pressure_pa: f64) -> String {
        let map = "engine.torque.torque_n_m";
        let is_default = self.defaults_taken.iter().any(|taken| taken.key == map);
        let key = if is_default { "engine.max_torque_n_m" } else { map };
        let max_n_m = self.engine.largest_torque();
        let pressure = if pressure_pa <= MAX_LINE_PRESSURE_PA {
            format!("they hold with `hydraulics.line_pressure_pa = {:.2}e6`; or ", 1e-2 * (1e-4 * pressure_pa).ceil())
        } else {
            String::new()
        };
        format!(
            "{pressure}with an engine of {:.0} N m in place of {max_n_m:.0} N m (`{key}`); or with {:.1} times the friction faces or \
             piston areas (`friction_faces`, `piston_area_m2` in `pack`) in the gearbox file; for a gearbox that comes with the program \
             `wetclutch init --gearbox` writes them sized for the engine",
            (minimum * max_n_m).floor(),
            (10.0 / minimum).ceil() / 10.0
        )
    }
}

#[cfg(test)]
mod tests {
    use car::Car;

    use super::*;
    use crate::Source;
    use crate::vehicle::short::{CarFacts, short_car_file, sized_gearbox};

    const GEARBOX: &str = include_str!("../../../../gearboxes/8hp.toml");

    fn car(more: &str) -> CarFile {
        let text = format!("name = \"car\"\ngearbox = \"8hp.toml\"\n{more}");
        CarFile::from_sources(Source::built_in("car.toml", &text), Source::built_in("8hp.toml", GEARBOX)).unwrap()
    }

    #[test]
    fn a_converter_multiplies_the_torque_of_a_gear_in_which_the_car_starts() {
        let car = CarFile::eight_speed().unwrap();
        let torque = |gear: &str| car.max_turbine_torque(car.gearbox.gear(gear).unwrap());
        // At 177.8 rad/s the engine has 147.4 N m, 8.4 N m of drag, and the pump takes 4.3976e-3 N m s^2 times the square of it: 139.0 N m,
        // of which the turbine at rest has twice that.
        assert!((torque("1") - 278.0).abs() < 0.1, "{}", torque("1"));
        assert_eq!(torque("R"), torque("1"));
        // With the turbine at 100 rad/s the engine turns at 203.3 rad/s. It has 150.7 N m, 9.6 N m of drag, and the torque ratio is 1.440.
        assert!((torque("2") - 203.2).abs() < 0.1, "{}", torque("2"));
        let without = Car { converter: None, ..car.car.clone() };
        assert_eq!(without.max_turbine_torque(1), 190.0);
    }

    #[test]
    fn elements_that_slip_at_full_throttle_are_named_with_numbers_and_keys() {
        assert_eq!(car("").slipping_elements(), None);
        let said = car("[engine]\nmax_torque_n_m = 900\n").slipping_elements().unwrap();
        for part in ["at 1.60 MPa: A holds 1190 N m, ", "C holds 582 N m, ", "in gear 1", "(`engine.max_torque_n_m`)"] {
            assert!(said.contains(part), "{part}: {said}");
        }
        // Far above what a supply gives.
        assert!(!said.contains("line_pressure_pa"), "{said}");
        let said = car("[hydraulics]\nline_pressure_pa = 0.4e6\n").slipping_elements().unwrap();
        for part in ["at 0.40 MPa: ", "C holds 112 N m, ", "`hydraulics.line_pressure_pa = "] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }

    #[test]
    fn with_what_the_hint_says_the_elements_hold() {
        let pressure = "[hydraulics]\nline_pressure_pa = 0.4e6\n";
        let said = car(pressure).slipping_elements().unwrap();
        let enough = said.split("line_pressure_pa = ").nth(1).and_then(|rest| rest.split('`').next()).unwrap();
        assert_eq!(car(&pressure.replace("0.4e6", enough)).slipping_elements(), None, "{said}");
        let torque = "[engine]\nmax_torque_n_m = 900\n";
        let said = car(torque).slipping_elements().unwrap();
        let enough = said.split("an engine of ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        assert_eq!(car(&torque.replace("900", enough)).slipping_elements(), None, "{said}");
        // It holds for a gearbox file of one's own too, which `init` does not size.
        assert!(
            said.contains("`piston_area_m2` in `pack`") && said.contains("for a gearbox that comes with the program"),
            "{said}"
        );
    }

    #[test]
    fn a_first_file_of_a_small_and_of_a_large_engine_has_clutches_that_hold() {
        for engine_torque_n_m in [50.0, 900.0] {
            let facts = CarFacts {
                name: "car".to_owned(),
                gearbox: "8hp.toml".to_owned(),
                has_converter: true,
                converter: None,
                has_stroke: false,
                mass_kg: 10.0 * engine_torque_n_m,
                wheel_radius_m: 0.3,
                final_ratio: 3.0,
                engine_torque_n_m,
            };
            let gearbox = sized_gearbox(&Source::built_in("8hp.toml", GEARBOX), engine_torque_n_m).unwrap();
            let gearbox = Source::built_in("8hp.toml", &gearbox);
            let text = short_car_file(&facts, &gearbox).unwrap();
            let car = CarFile::from_sources(Source::built_in("car.toml", &text), gearbox).unwrap();
            assert_eq!(car.slipping_elements(), None);
        }
    }
}
