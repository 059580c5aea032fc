//! Short vehicle files of cars with a whole gearbox: few numbers, and defaults for everything else.
//!
//! The defaults are those of `vehicles/eight_speed.toml`. A file with `engine.max_torque_n_m` has them scaled to its numbers.

use drivetrain::Real;
use std::ops::Range;

use ::car::CarSize;
use ::car::one_shift::{ENGINE_TORQUE_N_M, FINAL_RATIO};
use ::car::template::{LOWEST_RATIO, MASS_KG, Scales, WHEEL_RADIUS_M};
use geartrain::Gearbox;
use toml::Spanned;
use toml::de::DeValue;

use super::complete::{DefaultTaken, Leaf, leaves, number_of, taken_of};
use super::facts::{ENGINE_TORQUES_N_M, located};
use super::first_file::exact;
use crate::check::Check;
use crate::vehicle::car::CarFile;
use crate::vehicle::{FINAL_RATIOS, MASSES_KG, WHEEL_RADII_M};
use crate::{ConfigError, GearboxFile, Source, toml_number, toml_string};

/// Ratio from engine to wheels that no car's lowest gear has \[chosen\]: trucks have 60 with 16 gears, cars 8 to 25.
const MAX_RATIO: f64 = 40.0;

/// What is known of a car with a gearbox without a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct CarFacts {
    /// Its name.
    pub name: String,
    /// Path of its gearbox file, from the folder of the vehicle file.
    pub gearbox: String,
    /// Whether it has a torque converter; without one the engine turns the gearbox input.
    pub has_converter: bool,
    /// The table `[converter]`, where its maps are known; `None` for those of a usual converter, as comments.
    pub converter: Option<String>,
    /// Whether the pistons of its clutches have a stroke.
    pub has_stroke: bool,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Rolling radius of the driven wheels, m.
    pub wheel_radius_m: f64,
    /// Ratio of the differential, with any ratio between it and the gearbox output.
    pub final_ratio: f64,
    /// Maximum engine torque, N m.
    pub engine_torque_n_m: f64,
}

/// The factor on a default; `None` where it does not depend on the size of a car.
fn factor(scales: &Scales, key: &str) -> Option<f64> {
    match key {
        "engine.inertia_kg_m2" | "engine.torque.torque_n_m" | "converter.capacity_n_m_s2" => Some(scales.engine),
        "driveline.shaft_stiffness_n_m_rad" | "driveline.shaft_damping_n_m_s_rad" => Some(scales.shafts),
        "driveline.wheel_inertia_kg_m2" => Some(scales.wheels),
        "tyre.max_force_n" => Some(scales.tyres),
        "vehicle.rolling_moment_n_m" => Some(scales.rolling),
        _ => None,
    }
}

/// The defaults of a vehicle file with this gearbox: scaled to its numbers, if it has `engine.max_torque_n_m`.
///
/// # Errors
/// One of these numbers cannot be right.
pub(in super::super) fn car_defaults(
    source: &Source,
    shipped: Source,
    gearbox: &Gearbox,
) -> Result<Source, ConfigError> {
    let check = Check::of(source);
    let table = source.table()?;
    let number = |path: &[&str], range| -> Result<Option<f64>, ConfigError> {
        let Some((at, value)) = located(table.get_ref(), path) else { return Ok(None) };
        // What is no number is refused where the whole file is read.
        let Some(value) = number_of(value) else { return Ok(None) };
        check.number(path.join("."), &Spanned::new(at..at, value), range).map(Some)
    };
    let Some(engine_torque_n_m) = number(&["engine", "max_torque_n_m"], ENGINE_TORQUES_N_M)? else {
        return Ok(shipped);
    };
    let size = CarSize {
        engine_torque_n_m,
        final_ratio: number(&["driveline", "final_ratio"], FINAL_RATIOS)?.unwrap_or(FINAL_RATIO),
        mass_kg: number(&["vehicle", "mass_kg"], MASSES_KG)?.unwrap_or(MASS_KG),
        wheel_radius_m: number(&["vehicle", "wheel_radius_m"], WHEEL_RADII_M)?.unwrap_or(WHEEL_RADIUS_M),
    };
    let scales = size.scales(lowest_ratio(gearbox));
    let text = scaled(&shipped, |key| factor(&scales, key))?;
    Ok(Source { path: format!("defaults of {}", source.path.to_string_lossy()).into(), text })
}

/// The text of a file with some of its numbers times a factor.
fn scaled(source: &Source, factor: impl Fn(&str) -> Option<f64>) -> Result<String, ConfigError> {
    let table = source.table()?;
    let edit = |leaf: Leaf<'_, '_>| -> Option<(Range<usize>, String)> {
        let factor = factor(&leaf.key).filter(|factor| *factor != 1.0)?;
        Some((leaf.place.clone(), times(leaf.value, factor)?))
    };
    let mut edits: Vec<_> = leaves(table.get_ref()).into_iter().filter_map(edit).collect();
    edits.sort_by_key(|(place, _)| std::cmp::Reverse(place.start));
    let mut text = source.text.clone();
    for (place, value) in edits {
        text.replace_range(place, &value);
    }
    Ok(text)
}

/// A number, or an array of numbers or of arrays, times a factor.
fn times(value: &DeValue<'_>, factor: f64) -> Option<String> {
    match value {
        DeValue::Array(items) => {
            let items = items.iter().map(|item| times(item.get_ref(), factor)).collect::<Option<Vec<_>>>()?;
            Some(format!("[{}]", items.join(", ")))
        }
        value => number_of(value).map(|number| toml_number(factor * number)),
    }
}

/// What a car's file leaves out, with the defaults that stand for it.
pub(in super::super) fn car_defaults_taken(
    source: &Source,
    defaults: &Source,
    has_converter: bool,
) -> Result<Vec<DefaultTaken>, ConfigError> {
    let (own, below) = (source.table()?, defaults.table()?);
    let given = leaves(own.get_ref());
    // A valve of one's own has nothing of the shipped one.
    let of_another = |key: &str| key.starts_with("valve.") && given.iter().any(|leaf| leaf.key.starts_with("valve."));
    let is_taken = |leaf: &Leaf<'_, '_>| {
        !given.iter().any(|given| given.key == leaf.key)
            && !of_another(&leaf.key)
            && (has_converter || !leaf.key.starts_with("converter."))
    };
    let taken = leaves(below.get_ref()).into_iter().filter(is_taken);
    Ok(taken.filter_map(|leaf| taken_of(&leaf, &defaults.text)).collect())
}

/// A gearbox file that is made for the engine of the defaults, with clutches, springs, inertias and torques for an engine of another torque.
///
/// Inertias of the shafts grow with the torque, as that of the engine does: so a shift takes as long. A pack that is larger in all directions has a radius by the third root of its torque and an area by the square of that root; its
/// plates touch at the same pressure.
///
/// # Errors
/// The file is no TOML.
pub fn sized_gearbox(gearbox: &Source, engine_torque_n_m: f64) -> Result<String, ConfigError> {
    let torque = engine_torque_n_m / ENGINE_TORQUE_N_M;
    let length = Real::cbrt(torque);
    let text = scaled(gearbox, |key| match key.rsplit_once('.') {
        Some((table, "turbine_max_n_m")) if table.starts_with("gear.") => Some(torque),
        Some((table, "inertia_kg_m2")) if table.starts_with("shaft.") => Some(torque),
        Some((table, field)) if table.starts_with("element.") && table.ends_with(".pack") => match field {
            "mean_radius_m" => Some(length),
            "piston_area_m2" | "return_spring_n" => Some(length * length),
            _ => None,
        },
        _ => None,
    })?;
    Ok(format!(
        "# `turbine_max_n_m`, the torques that clutches hold and the inertias of the shafts are scaled by {} from those for {} N m, to an engine\n\
         # of {} N m: radii by the third root of it, piston areas and return springs by its square.\n#\n{text}",
        toml_number(torque),
        exact(ENGINE_TORQUE_N_M),
        exact(engine_torque_n_m)
    ))
}

/// Defaults that stand in a short file as comments: what an estimate uses and somebody may know.
const SHOWN: [(&str, &[&str]); 6] = [
    ("engine", &["inertia_kg_m2"]),
    ("converter", &["speed_ratio", "capacity_n_m_s2", "torque_ratio"]),
    ("hydraulics", &["line_pressure_pa"]),
    ("friction", &["slip_rad_s", "factor", "static_factor", "drag_n_m"]),
    ("valve", &["lag", "gain", "delay"]),
    ("driveline", &["shaft_stiffness_n_m_rad", "wheel_inertia_kg_m2"]),
];

const HEAD: &str = "\
# A car with all gears of its gearbox, for `wetclutch simulate`, `estimate` and `fit`. Units are SI; each key ends with its unit.
#
# What is not here is a default: that of a 2.0 L mid-size car, scaled to the numbers below. A line that begins with `# ` and a key is
# such a default: take the `# ` away and put in what you know. `wetclutch check` lists all defaults, and shows the values that matter most
# for the estimate.
";

/// A short file with these numbers, checked with its gearbox file, and its text.
///
/// # Errors
/// A number is outside the range of a vehicle file, or the gearbox is none of a simulated car.
pub fn short_car_file(facts: &CarFacts, gearbox: &Source) -> Result<String, ConfigError> {
    refuse_ratio(facts, gearbox)?;
    // The file without its comments says what the defaults are.
    let bare = CarFile::from_sources(
        Source::built_in("the new vehicle file", &text(facts, |_| String::new())),
        gearbox.clone(),
    )?;
    let shown = |table: &str| -> String {
        let keys = SHOWN.iter().filter(|(name, _)| *name == table).flat_map(|(_, keys)| *keys);
        keys.map(|key| commented(&bare.defaults_taken, table, key)).collect()
    };
    let text = text(facts, shown);
    CarFile::from_sources(Source::built_in("the new vehicle file", &text), gearbox.clone())?;
    Ok(text)
}

/// A default as a comment, one line: a value, or a table of values that belong together.
fn commented(taken: &[DefaultTaken], table: &str, key: &str) -> String {
    let whole = format!("{table}.{key}");
    if let Some(taken) = taken.iter().find(|taken| taken.key == whole) {
        return format!("# {key} = {}\n", taken.value);
    }
    let part = |taken: &DefaultTaken| {
        let name = taken.key.strip_prefix(&whole)?.strip_prefix('.')?;
        Some(format!("{name} = {}", taken.value))
    };
    let parts: Vec<String> = taken.iter().filter_map(part).collect();
    if parts.is_empty() { String::new() } else { format!("# {key} = {{ {} }}\n", parts.join(", ")) }
}

/// Refuses a final ratio that the gearbox already contains.
fn refuse_ratio(facts: &CarFacts, gearbox: &Source) -> Result<(), ConfigError> {
    let lowest = lowest_ratio(&GearboxFile::from_source(gearbox.clone())?.gearbox);
    let whole = lowest * facts.final_ratio;
    if whole <= MAX_RATIO {
        return Ok(());
    }
    let message = format!(
        "is {}: in the lowest gear, {lowest:.2}, the wheels turn {whole:.0} times slower than the engine",
        facts.final_ratio
    );
    let hint = "the ratios of a dual clutch or front-wheel drive may contain the final ratio: then it is 1".to_owned();
    let new_file = Source::built_in("the new vehicle file", "");
    Err(Check::of(&new_file).meaning("driveline.final_ratio", 0, message, Some(hint)))
}

/// Ratio of the lowest gear.
fn lowest_ratio(gearbox: &Gearbox) -> f64 {
    gearbox.forward_gears().first().map_or(LOWEST_RATIO, |&gear| gearbox.gears[gear].ratio)
}

/// The file with what `shown` says of each table.
fn text(facts: &CarFacts, shown: impl Fn(&str) -> String) -> String {
    let converter = match &facts.converter {
        _ if !facts.has_converter => String::new(),
        Some(table) => format!("{table}\n"),
        None => format!("[converter]\n{}\n", shown("converter")),
    };
    let stroke = if facts.has_stroke { "# The pistons have a stroke: the fill takes time.\n[fill]\n\n" } else { "" };
    format!(
        "{HEAD}\nname = {}\ngearbox = {} # from the folder of this file; plates, pistons and springs are in it\n\
         launch = \"{}\"\n\n[engine]\nmax_torque_n_m = {}\n{}\n{converter}[hydraulics]\n{}\n\
         # Times the friction coefficient of each element in the gearbox file.\n[friction]\n{}\n\
         # The valve of every element. One of your own is given whole, with the line of the table; [clutch.NAME.valve] is that of one\n\
         # element.\n# [valve]\n{}\n{stroke}[driveline]\nfinal_ratio = {} # from the gearbox output to the wheels\n{}\n\
         [vehicle]\nmass_kg = {} # with driver\nwheel_radius_m = {} # rolling radius of the driven wheels\n",
        toml_string(&facts.name),
        toml_string(&facts.gearbox),
        if facts.has_converter { "converter" } else { "clutch" },
        exact(facts.engine_torque_n_m),
        shown("engine"),
        shown("hydraulics"),
        shown("friction"),
        shown("valve"),
        exact(facts.final_ratio),
        shown("driveline"),
        exact(facts.mass_kg),
        exact(facts.wheel_radius_m),
    )
}
