//! A vehicle file from a few numbers.

mod train;

use config::{Source, Vehicle, toml_string};

use crate::FitError;
use crate::vehicle_text::{VehicleText, keys, number};

/// What is known of a car without a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    /// Its name.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Rolling radius of the driven wheels, m.
    pub wheel_radius_m: f64,
    /// Ratio of the gear before the shift.
    pub ratio_before: f64,
    /// Ratio of the gear after the shift.
    pub ratio_after: f64,
    /// Ratio of the differential, with any ratio between it and the gearbox output.
    pub final_ratio: f64,
    /// Greatest engine torque, N m.
    pub engine_torque_n_m: f64,
}

const TEMPLATE: &str = include_str!("template.toml");

/// The car whose values are scaled: that of the two-speed vehicle file.
const ENGINE_TORQUE_N_M: f64 = 190.0;
const MASS_KG: f64 = 1500.0;
const WHEEL_RADIUS_M: f64 = 0.3;
const WHEEL_INERTIA_KG_M2: f64 = 2.4;
const TYRE_FORCE_N: f64 = 13_200.0;
const STIFFNESS_N_M_RAD: f64 = 13_000.0;
const DAMPING_N_M_S_RAD: f64 = 20.0;
const SHAFT_TORQUE_N_M: f64 = 800.0;
const TURBINE_ERROR_N_M: f64 = 20.0;
const ENGINE_INERTIA_KG_M2: f64 = 0.17;
const LOWER_GEAR: f64 = 2.5 * 3.0;
/// Its mass error over the mass, and its rolling resistance over the weight.
const MASS_SHARE: f64 = 0.15;
const ROLLING_SHARE: f64 = 0.02;
/// Piston area per share of the turbine torque that the clutch carries, m^2, offgoing and oncoming clutch.
const AREAS_M2: [f64; 2] = [0.012 / 1.5, 0.01 / 0.6];
/// Pressure at which its plates touch, Pa.
const KISS_PA: f64 = 60e3;

/// The vehicle file of these numbers, checked.
///
/// # Errors
/// A number is outside the range of a vehicle file, or the ratios are no upshift.
pub fn vehicle_file(facts: &Facts) -> Result<Vehicle, FitError> {
    let (before, after) = (facts.ratio_before, facts.ratio_after);
    if before < 1.02 * after || after.is_nan() {
        return Err(FitError::input(format!(
            "the ratio before the shift is {before} and after it {after}, which is no upshift\n\
             hint: the ratio is turbine over output speed, such as 4.17 in 1st gear and 2.34 in 2nd"
        )));
    }
    let given = Vehicle::two_speed_at()?;
    let base = VehicleText::new(&given.source.text)?;
    let torque = facts.engine_torque_n_m / ENGINE_TORQUE_N_M;
    let lower_gear = torque * before * facts.final_ratio / LOWER_GEAR;
    let mass = facts.mass_kg / MASS_KG;
    let radius = facts.wheel_radius_m / WHEEL_RADIUS_M;
    let scaled = |path: &[&str]| -> Result<String, FitError> {
        let values = base.numbers(&keys(path))?;
        Ok(array(values.into_iter().map(|value| torque * value)))
    };
    let rows = (given.engine.torque_n_m.rows().iter())
        .map(|speed| {
            let columns = given.engine.torque_n_m.columns().iter();
            format!("  {},\n", array(columns.map(|throttle| torque * given.engine.torque_n_m.at(*speed, *throttle))))
        })
        .collect::<String>();
    let elements = train::elements([before, after])?;
    let area = |i: usize| torque * AREAS_M2[i] * elements[i].torque_share;
    let fields = [
        ("before", number(before)),
        ("after", number(after)),
        ("name", toml_string(&facts.name)),
        ("engine_inertia", number(torque * ENGINE_INERTIA_KG_M2)),
        ("engine_torque", number(facts.engine_torque_n_m)),
        ("engine_map", format!("[\n{rows}]")),
        ("capacity", scaled(&["converter", "capacity_n_m_s2"])?),
        ("train", elements.iter().map(|element| element.text.as_str()).collect()),
        ("sides_a", elements[0].sides.clone()),
        ("sides_b", elements[1].sides.clone()),
        ("area_a", number(area(0))),
        ("area_b", number(area(1))),
        ("spring_a", number(KISS_PA * area(0))),
        ("spring_b", number(KISS_PA * area(1))),
        ("final_ratio", number(facts.final_ratio)),
        ("stiffness", number(lower_gear * STIFFNESS_N_M_RAD)),
        ("damping", number(lower_gear * DAMPING_N_M_S_RAD)),
        ("wheel_inertia", number(mass * radius * radius * WHEEL_INERTIA_KG_M2)),
        ("max_force", number(mass * TYRE_FORCE_N)),
        ("mass", number(facts.mass_kg)),
        ("radius", number(facts.wheel_radius_m)),
        ("rolling", number(ROLLING_SHARE * facts.mass_kg * drivetrain::road::GRAVITY_M_S2 * facts.wheel_radius_m)),
        ("turbine_torque", number(torque * TURBINE_ERROR_N_M)),
        ("mass_error", number(MASS_SHARE * facts.mass_kg)),
        ("shaft_torque", number(lower_gear * SHAFT_TORQUE_N_M)),
    ];
    // The name goes in last, so that braces in it stay what they are.
    let (names, others): (Vec<_>, Vec<_>) = fields.into_iter().partition(|(key, _)| *key == "name");
    let text = others
        .into_iter()
        .chain(names)
        .fold(TEMPLATE.to_owned(), |text, (key, value)| text.replacen(&format!("{{{key}}}"), &value, 1));
    Ok(Vehicle::from_source(Source::built_in("the new vehicle file", &text))?)
}

fn array(values: impl Iterator<Item = f64>) -> String {
    format!("[{}]", values.map(number).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(ratio_before: f64, ratio_after: f64) -> Facts {
        Facts {
            name: "car {mass} \"x\"".to_owned(),
            mass_kg: 1800.0,
            wheel_radius_m: 0.33,
            ratio_before,
            ratio_after,
            final_ratio: 3.2,
            engine_torque_n_m: 350.0,
        }
    }

    #[test]
    fn the_file_has_the_ratios_and_numbers_that_were_given() {
        for (before, after) in
            [(4.17, 2.34), (3.0, 2.0), (2.34, 1.52), (1.52, 1.14), (1.14, 1.0), (1.0, 0.87), (0.87, 0.69), (2.5, 1.0)]
        {
            let vehicle = vehicle_file(&facts(before, after)).unwrap();
            let found = [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()];
            for (found, expected) in found.into_iter().zip([before, after]) {
                assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
            }
            assert_eq!(vehicle.name, "car {mass} \"x\"");
            assert_eq!(vehicle.road.mass_kg, 1800.0);
            assert!(!vehicle.source.text.contains("{before}"));
        }
    }

    #[test]
    fn what_is_no_upshift_or_no_car_is_refused() {
        assert!(vehicle_file(&facts(1.0, 2.0)).unwrap_err().to_string().contains("no upshift"));
        assert!(vehicle_file(&facts(2.0, f64::NAN)).is_err());
        assert!(vehicle_file(&facts(2.0, 0.1)).is_err());
        assert!(vehicle_file(&Facts { mass_kg: -3.0, ..facts(2.5, 1.5) }).is_err());
        assert!(vehicle_file(&Facts { engine_torque_n_m: f64::INFINITY, ..facts(2.5, 1.5) }).is_err());
    }
}
