//! Short vehicle files: a few numbers of a car, and defaults for everything else.
//!
//! A file with `gear_train.ratios` is short. Its defaults are those of `defaults.toml`, scaled to its numbers, and any key of a
//! vehicle file may stand in it in place of a default.

mod car;
mod complete;
mod facts;
mod first_file;
mod train;
mod uncertainty;

use ::car::one_shift::{
    ENGINE_TORQUE_N_M, FINAL_RATIO, MASS_ERROR, OFFGOING_N_M, OFFGOING_OPEN_N_M, OUTPUT_ERROR_N_M, PISTON_AREAS_M2,
    PLATE_RADII_M, RATIO_BEFORE, SHAFT_TORQUE_N_M, TORQUE_FRACTIONS,
};
use ::car::template::{MASS_KG, WHEEL_RADIUS_M};
use drivetrain::Real;
use drivetrain::cylinder::{CAPACITY_M3_PA, FLOW_MAX_M3_S, LEAK_M3_S_PA, PASSAGE};
use toml::de::DeValue;

use super::budget;
use crate::check::Check;
use crate::source::{Layers, misspelt};
use crate::{ConfigError, Source, VehicleFile, toml_number};
pub use car::{CarFacts, short_car_file, sized_gearbox};
pub(super) use car::{car_defaults, car_defaults_taken};
pub use complete::DefaultTaken;
use facts::located;
pub(super) use facts::refuse_facts;
pub use facts::{ENGINE_TORQUES_N_M, Facts, ValveKind};
pub use first_file::{complete_file, short_file};
pub use uncertainty::Uncertainty;

const DEFAULTS: &str = include_str!("defaults.toml");

/// What to do about a default that cannot be right.
const NUMBERS: &str = "check the maximum engine torque, the ratios, the mass and the wheel radius; if they are right, give this key a value of your own";

/// A short file with the defaults under it.
pub(super) struct Short {
    /// The defaults for its numbers, as a file.
    pub(super) defaults: Source,
}

impl Short {
    /// The defaults of a file; none if it is not short.
    ///
    /// # Errors
    /// A number that they need is missing or cannot be right.
    pub(super) fn of(source: &Source) -> Result<Option<Self>, ConfigError> {
        if !has_ratios(source)? {
            return Ok(None);
        }
        complete::check_lists(source)?;
        let facts = Facts::of_file(source)?;
        let path = format!("defaults of {}", source.path.to_string_lossy()).into();
        Ok(Some(Self { defaults: Source { path, text: text_of(&facts)? } }))
    }

    /// The file over its defaults.
    pub(super) fn layers<'a>(&'a self, source: &'a Source) -> Layers<'a> {
        Layers { source: &self.defaults, over: Some(source) }
    }

    /// The whole file, with the values of the short one in their places, and the defaults that it took.
    pub(super) fn complete(&self, source: &Source) -> Result<(Source, Vec<DefaultTaken>), ConfigError> {
        let (text, taken) = complete::complete(&self.defaults, source)?;
        let path = format!("{}, completed with defaults", source.path.to_string_lossy()).into();
        Ok((Source { path, text }, taken))
    }
}

/// The keys that a file which is not short leaves out, with the values that they have.
pub(super) fn left_out(source: &Source) -> Result<Vec<DefaultTaken>, ConfigError> {
    let table = source.table()?;
    let budget = complete::find(table.get_ref(), &["design", "error_bounds"]);
    let given = |key: &str| match budget {
        Some(DeValue::Table(budget)) => budget.contains_key(key),
        _ => false,
    };
    let taken = |(key, value): (&str, &[f64])| DefaultTaken {
        key: format!("design.error_bounds.{key}"),
        value: numbers(value),
        numbers: value.to_vec(),
    };
    Ok(budget::OPTIONAL.into_iter().filter(|(key, _)| !given(key)).map(taken).collect())
}

/// An error of a default, as one of the file that leaves the value out.
pub(super) fn of_default(error: ConfigError, defaults: &Source, source: &Source) -> ConfigError {
    // The shipped file may itself be the one that is read.
    if error.path() != defaults.path || defaults.path == source.path {
        return error;
    }
    let (key, message, hint) = match error {
        ConfigError::Range { key, value, allowed, .. } => {
            (key, format!("its default for the numbers of this file is {value}, expected {allowed}"), None)
        }
        ConfigError::Meaning { key, message, hint, .. } => (key, format!("its default does not fit: {message}"), hint),
        other => return other,
    };
    let torque =
        source.table().ok().and_then(|table| located(table.get_ref(), &["engine", "max_torque_n_m"]).map(|(at, _)| at));
    let hint = hint.unwrap_or_else(|| NUMBERS.to_owned());
    Check::of(source).meaning(key, torque.unwrap_or(0), message, Some(hint))
}

/// Whether a file is short. A misspelt `ratios` is an error before all that a complete file would need.
fn has_ratios(source: &Source) -> Result<bool, ConfigError> {
    let table = source.table()?;
    let Some(DeValue::Table(train)) = complete::find(table.get_ref(), &["gear_train"]) else { return Ok(false) };
    match misspelt(train.keys().map(|key| key.get_ref().as_ref()), &["ratios"]) {
        Some((key, known)) => Err(source.unknown_key(key, known)),
        None => Ok(train.contains_key("ratios")),
    }
}

/// One number, or several as an array.
fn numbers(values: &[f64]) -> String {
    match values {
        [value] => toml_number(*value),
        values => format!("[{}]", values.iter().copied().map(toml_number).collect::<Vec<_>>().join(", ")),
    }
}

/// More of the car whose values are scaled: the built-in one.
const WHEEL_INERTIA_KG_M2: f64 = 2.4;
const TYRE_FORCE_N: f64 = 13_200.0;
const STIFFNESS_N_M_RAD: f64 = 13_000.0;
const DAMPING_N_M_S_RAD: f64 = 20.0;
const TURBINE_ERROR_N_M: f64 = 20.0;
const ENGINE_INERTIA_KG_M2: f64 = 0.17;
const TURBINE_INERTIA_KG_M2: f64 = 0.06;
const OUTPUT_INERTIA_KG_M2: f64 = 0.15;
const LOWER_GEAR: f64 = RATIO_BEFORE * FINAL_RATIO;
/// Its rolling resistance over the weight.
const ROLLING_FRACTION: f64 = 0.02;
/// Pressure at which its plates touch, Pa.
const KISS_PA: f64 = 60e3;

/// The defaults as the text of a vehicle file.
fn text_of(facts: &Facts) -> Result<String, ConfigError> {
    let given = VehicleFile::built_in()?;
    let torque = facts.engine_torque_n_m / ENGINE_TORQUE_N_M;
    let lower_gear = torque * facts.ratio_before * facts.final_ratio / LOWER_GEAR;
    let mass = facts.mass_kg / MASS_KG;
    let radius = facts.wheel_radius_m / WHEEL_RADIUS_M;
    // Drive shafts are made for what the tyres transmit: that of the lowest gear is not known from a shift between two others.
    let adhesion = mass * radius;
    let scaled = |values: Vec<f64>| numbers(&values.into_iter().map(|value| torque * value).collect::<Vec<_>>());
    let map = &given.engine.torque_n_m;
    let row = |speed: &f64| scaled(map.columns().iter().map(|throttle| map.at(*speed, *throttle)).collect());
    let rows = map.rows().iter().map(|speed| format!("  {},\n", row(speed))).collect::<String>();
    let elements =
        train::elements([facts.ratio_before, facts.ratio_after], torque).map_err(|wrong| facts.wrong_ratios(wrong))?;
    let carried = [0, 1].map(|i| torque * elements[i].torque_fraction / TORQUE_FRACTIONS[i]);
    let weight_n = facts.mass_kg * drivetrain::road::GRAVITY_M_S2;
    let mut fields = vec![
        ("before", toml_number(facts.ratio_before)),
        ("after", toml_number(facts.ratio_after)),
        ("engine_inertia", toml_number(torque * ENGINE_INERTIA_KG_M2)),
        ("turbine_inertia", toml_number(torque * TURBINE_INERTIA_KG_M2)),
        ("output_inertia", toml_number(torque * OUTPUT_INERTIA_KG_M2)),
        ("engine_torque", toml_number(facts.engine_torque_n_m)),
        ("engine_map", format!("[\n{rows}]")),
        ("capacity", scaled(given.converter.capacity_n_m_s2.values().to_vec())),
        ("train", elements.iter().map(|element| element.text.as_str()).collect()),
        ("sides_a", elements[0].sides.clone()),
        ("sides_b", elements[1].sides.clone()),
        ("final_ratio", toml_number(facts.final_ratio)),
        ("stiffness", toml_number(adhesion * STIFFNESS_N_M_RAD)),
        ("damping", toml_number(adhesion * DAMPING_N_M_S_RAD)),
        ("wheel_inertia", toml_number(mass * radius * radius * WHEEL_INERTIA_KG_M2)),
        ("max_force", toml_number(mass * TYRE_FORCE_N)),
        ("mass", toml_number(facts.mass_kg)),
        ("radius", toml_number(facts.wheel_radius_m)),
        ("rolling", toml_number(ROLLING_FRACTION * weight_n * facts.wheel_radius_m)),
        ("turbine_torque", toml_number(torque * TURBINE_ERROR_N_M)),
        ("mass_error", toml_number(MASS_ERROR * facts.mass_kg)),
        ("shaft_torque", toml_number(lower_gear * SHAFT_TORQUE_N_M)),
        ("output_torque", toml_number(torque * facts.ratio_before / RATIO_BEFORE * OUTPUT_ERROR_N_M)),
        ("offgoing", toml_number(carried[0] * OFFGOING_N_M)),
        ("offgoing_torque", toml_number(carried[0] * OFFGOING_OPEN_N_M)),
    ];
    fields.extend(clutch_fields(carried));
    let of_valve = facts.valve.fields();
    let is_of_valve = |key: &str| of_valve.iter().any(|(name, _)| *name == key);
    fields.extend(
        budget::OPTIONAL.iter().filter(|(key, _)| !is_of_valve(key)).map(|(key, value)| (*key, numbers(value))),
    );
    fields.extend(of_valve.iter().map(|(key, value)| (*key, (*value).to_owned())));
    // The name goes in last, so that braces in it stay what they are.
    fields.push(("name", crate::toml_string(&facts.name)));
    Ok(fields.into_iter().fold(DEFAULTS.to_owned(), |text, (key, value)| text.replace(&format!("{{{key}}}"), &value)))
}

/// Plates, piston, spring and fill of both clutches, which carry torques over those of the car that is scaled.
fn clutch_fields(carried: [f64; 2]) -> [(&'static str, String); 8] {
    // A clutch that is larger in all directions has a torque by the third power of its length.
    let length = carried.map(Real::cbrt);
    let plates = |i: usize| toml_number(length[i] * PLATE_RADII_M[i]);
    let area = |i: usize| Real::powi(length[i], 2) * PISTON_AREAS_M2[i];
    let spring = |i: usize| toml_number(KISS_PA * area(i));
    let fill = |i: usize| fill_text(Real::powi(length[i], 2));
    [
        ("plates_a", plates(0)),
        ("plates_b", plates(1)),
        ("area_a", toml_number(area(0))),
        ("area_b", toml_number(area(1))),
        ("spring_a", spring(0)),
        ("spring_b", spring(1)),
        ("fill_a", fill(0)),
        ("fill_b", fill(1)),
    ]
}

/// How a cylinder fills whose piston has this area over that of the car that is scaled: passages, pump, leak and what yields in
/// proportion to the area, so that the fill takes the same time.
fn fill_text(area: f64) -> String {
    let passage = PASSAGE.with_flow_factor(area);
    [
        ("home_capacity_m3_pa", area * CAPACITY_M3_PA),
        ("capacity_m3_pa", area * CAPACITY_M3_PA),
        ("laminar_pa_s2_m5", passage.laminar_pa_s2_m5),
        ("orifice_pa_s2_m6", passage.orifice_pa_s2_m6),
        ("flow_max_m3_s", area * FLOW_MAX_M3_S),
        ("leak_m3_s_pa", area * LEAK_M3_S_PA),
    ]
    .map(|(key, value)| format!("{key} = {}\n", toml_number(value)))
    .concat()
}
