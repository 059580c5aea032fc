//! How far off a default may be.

use car::{ErrorBounds, Vehicle};
use drivetrain::Table1;

use super::DefaultTaken;
use crate::tree::Change;
use crate::{ConfigError, VehicleFile};

/// By how much the right value of a key may differ from its default: what the two limits do to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertainty {
    /// What a limit does to the value.
    pub change: Change,
    /// The limits.
    pub limits: [f64; 2],
}

/// Fractions by which defaults of a car may be off, where the error budget has none [chosen]: what differs between cars of one size
/// and power, and between data sheet and car. `*` is any name.
const FRACTIONS: [(&str, f64); 26] = [
    ("engine.inertia_kg_m2", 0.2),
    ("converter.torque_ratio", 0.1),
    ("gear_train.shaft.*.inertia_kg_m2", 0.3),
    ("clutch.*.mean_radius_m", 0.1),
    ("clutch.*.piston_area_m2", 0.2),
    ("clutch.*.return_spring_n", 0.3),
    ("clutch.*.fill.home_capacity_m3_pa", 0.5),
    ("clutch.*.fill.capacity_m3_pa", 0.5),
    ("clutch.*.fill.laminar_pa_s2_m5", 0.25),
    ("clutch.*.fill.orifice_pa_s2_m6", 0.25),
    ("clutch.*.fill.flow_max_m3_s", 0.5),
    ("clutch.*.fill.leak_m3_s_pa", 0.5),
    ("clutch.*.valve.flow_sqrt_pa_s", 0.3),
    ("clutch.*.valve.line_pressure_pa", 0.1),
    ("driveline.shaft_damping_n_m_s_rad", 0.5),
    ("driveline.wheel_inertia_kg_m2", 0.2),
    ("tyre.max_force_n", 0.15),
    ("tyre.slip_scale", 0.25),
    ("tyre.floor_m_s", 0.5),
    ("vehicle.front_area_m2", 0.15),
    ("vehicle.drag_coefficient", 0.15),
    ("vehicle.air_density_kg_m3", 0.1),
    ("vehicle.rolling_moment_n_m", 0.5),
    ("observer.valve.time_constant_s", 0.5),
    ("observer.valve.gain_pa_a", 0.1),
    ("observer.valve.line_pressure_pa", 0.1),
];

/// Factor either way on a setting of the observers, or on a bound of the budget, that nothing else is known of [chosen].
const SETTING: f64 = 2.0;

impl DefaultTaken {
    /// How far off it may be: what the error budget allows, else a fraction; half and twice for the settings of the observers and for
    /// the budget itself. None for a list that only says where values stand, and where no estimate depends on the value.
    pub fn uncertainty(&self, budget: &ErrorBounds) -> Option<Uncertainty> {
        let scale = |limits: [f64; 2]| Some(Uncertainty { change: Change::Scale, limits });
        let fraction = |fraction: f64| scale([1.0 - fraction, 1.0 + fraction]);
        let key = without_names(&self.key);
        match key.as_str() {
            "clutch.*.friction.coefficient" | "clutch.*.static_friction" => scale(budget.friction_factor),
            "clutch.*.valve.lag.time_constant_s" => scale(budget.valve_lag_factor),
            "clutch.*.valve.gain.gain_pa_a" => scale(budget.valve_gain_factor),
            "clutch.*.valve.delay.delay_s" => {
                let [minimum, maximum] = budget.valve_delay_s;
                let half = 0.5 * (maximum - minimum);
                Some(Uncertainty { change: Change::Add, limits: [-half, half] })
            }
            // A plate more or less has two faces, a single-sided one has one.
            "clutch.*.friction_faces" => Some(Uncertainty { change: Change::Add, limits: [-1.0, 1.0] }),
            "converter.capacity_n_m_s2" => fraction(budget.turbine_torque_share),
            "driveline.shaft_stiffness_n_m_rad" => scale(budget.shaft_stiffness_factor),
            _ => match FRACTIONS.iter().find(|(pattern, _)| *pattern == key) {
                Some((_, off)) => fraction(*off),
                None if is_setting(&key) && self.numbers.len() == 1 && self.numbers != [0.0] => {
                    scale([1.0 / SETTING, SETTING])
                }
                None => None,
            },
        }
    }
}

/// The torque ratio of a converter: what is above 1 may be off, at the coupling point it is 1.
const TORQUE_RATIO: &str = "converter.torque_ratio";

impl DefaultTaken {
    /// The vehicle with this value at a limit of its uncertainty.
    ///
    /// # Errors
    /// A vehicle file cannot have that value.
    pub fn at_limit(&self, vehicle: &VehicleFile, change: Change, limit: f64) -> Result<Vehicle, ConfigError> {
        if self.key == TORQUE_RATIO {
            let given = &vehicle.converter.torque_ratio;
            let values: Vec<f64> = given.values().iter().map(|ratio| 1.0 + limit * (ratio - 1.0)).collect();
            let mut changed = vehicle.vehicle.clone();
            // The axis is that of the map.
            changed.converter.torque_ratio = Table1::new(given.axis(), &values).unwrap_or(*given);
            return Ok(changed);
        }
        // A key that the file leaves out altogether has no value to change.
        vehicle.changed(&self.key, change, limit).or_else(|refused| match (change, self.numbers.as_slice()) {
            (Change::Scale, [value]) => vehicle.changed(&self.key, Change::Set, limit * value),
            _ => Err(refused),
        })
    }
}

fn is_setting(key: &str) -> bool {
    ["observer.filter.", "observer.supervisor.", "observer.shaft_settling_s", "design.error_bounds."]
        .iter()
        .any(|table| key.starts_with(table))
}

/// The key with `*` for the names of clutches and shafts.
fn without_names(key: &str) -> String {
    let mut steps: Vec<&str> = key.split('.').collect();
    match steps.as_mut_slice() {
        ["clutch", name, ..] | ["gear_train", "shaft", name, ..] => *name = "*",
        _ => {}
    }
    steps.join(".")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;
    use crate::vehicle::short::{Facts, ValveKind, short_file};

    fn short(valve: ValveKind) -> VehicleFile {
        let facts = Facts {
            name: "x".to_owned(),
            mass_kg: 1650.0,
            wheel_radius_m: 0.32,
            ratio_before: 4.17,
            ratio_after: 2.34,
            final_ratio: 3.2,
            engine_torque_n_m: 250.0,
            valve,
        };
        VehicleFile::from_source(Source::built_in("x.toml", &short_file(&facts, false).unwrap())).unwrap()
    }

    #[test]
    fn every_fraction_belongs_to_a_default_and_every_default_of_the_car_has_an_uncertainty() {
        let cars = [short(ValveKind::Proportional), short(ValveKind::PulseWidth)];
        for (pattern, _) in FRACTIONS {
            let has = |car: &VehicleFile| car.defaults_taken.iter().any(|taken| without_names(&taken.key) == pattern);
            assert!(cars.iter().any(has), "{pattern}");
        }
        // Axes of maps, the engine's map, requirements of designs, limits of signals: no estimate changes with them.
        let without =
            ["speed_ratio", "slip_rad_s", "pressure_pa", "current_a", "duty_percent", "throttle", "speed_rad_s"];
        for car in &cars {
            for taken in &car.defaults_taken {
                let name = taken.key.rsplit('.').next().unwrap();
                let is_of_car = ["engine.", "converter.", "clutch.", "driveline.", "tyre.", "vehicle.", "gear_train."]
                    .iter()
                    .any(|table| taken.key.starts_with(table));
                let needs = is_of_car && !without.contains(&name) && !taken.key.starts_with("engine.torque");
                let known = ["drag_n_m_s", "grade_rad"].contains(&name);
                let is_known = taken.uncertainty(&car.error_bounds).is_some();
                assert!(is_known || !needs || known, "{}", taken.key);
            }
        }
    }

    #[test]
    fn the_file_can_be_changed_at_every_default_with_an_uncertainty_at_least_one_way() {
        for car in [short(ValveKind::Proportional), short(ValveKind::PulseWidth)] {
            for taken in &car.defaults_taken {
                let Some(off) = taken.uncertainty(&car.error_bounds) else { continue };
                let changed = off.limits.map(|limit| taken.at_limit(&car, off.change, limit));
                assert!(changed.iter().any(Result::is_ok), "{}: {}", taken.key, changed[0].as_ref().unwrap_err());
            }
        }
    }
}
