//! The first vehicle file of a car, short or complete.

use super::complete::{complete, find};
use super::{Facts, Short, ValveKind, text_of};
use crate::{ConfigError, Source, VehicleFile, toml_number, toml_string};

/// Defaults of a table that stand in a short file as comments: what an estimate uses and somebody may know.
struct Shown {
    table: &'static str,
    keys: &'static [&'static str],
    /// The same with pulse-width valves.
    pulse_width: &'static [&'static str],
}

impl Shown {
    const fn of(table: &'static str, keys: &'static [&'static str]) -> Self {
        Self { table, keys, pulse_width: keys }
    }
}

const SHOWN: [Shown; 6] = [
    Shown::of("engine", &["inertia_kg_m2"]),
    Shown::of("converter", &["speed_ratio", "capacity_n_m_s2", "torque_ratio"]),
    Shown::of(
        "clutch.b",
        &["mean_radius_m", "friction_faces", "piston_area_m2", "return_spring_n", "static_friction", "friction"],
    ),
    Shown {
        table: "clutch.b.valve",
        keys: &["lag", "gain", "delay"],
        pulse_width: &["flow_sqrt_pa_s", "line_pressure_pa", "delay"],
    },
    Shown::of("driveline", &["shaft_stiffness_n_m_rad", "wheel_inertia_kg_m2"]),
    Shown::of("design.error_bounds", &["turbine_torque_share", "friction_factor", "valve_gain_factor", "mass_kg"]),
];

const HEAD: &str = "\
# A car and one of its upshifts, for `wetclutch estimate` and `wetclutch fit`. Units are SI; each key ends with its unit.
#
# What is not here is a default: that of a 2.0 L mid-size car, scaled to the numbers below. A line that begins with `# ` and a key is
# such a default: take the `# ` away and put in what you know. `wetclutch check` lists all defaults, and shows those that matter most
# for the estimate; `wetclutch init --complete` writes them all into the file.
";

/// A short file with these numbers, checked, and its text. With `has_stroke` the pistons of its clutches have a stroke.
///
/// # Errors
/// A number is outside the range of a vehicle file, or the ratios are no upshift.
pub fn short_file(facts: &Facts, has_stroke: bool) -> Result<String, ConfigError> {
    let defaults = Source::built_in("the defaults", &text_of(facts)?);
    let table = defaults.table()?;
    let shown = |of: &str| -> Result<String, ConfigError> {
        let mut lines = String::new();
        for Shown { table: name, keys, pulse_width } in SHOWN.iter().filter(|shown| shown.table == of) {
            let path: Vec<&str> = name.split('.').collect();
            let keys = if facts.valve == ValveKind::PulseWidth { pulse_width } else { keys };
            for key in *keys {
                let place = match find(table.get_ref(), &path) {
                    Some(toml::de::DeValue::Table(inner)) => inner.get(*key).map(toml::Spanned::span),
                    _ => None,
                };
                let value = place.map_or("", |place| &defaults.text[place]);
                lines += &format!("# {key} = {}\n", value.split_whitespace().collect::<Vec<_>>().join(" "));
            }
        }
        Ok(lines)
    };
    let kind = match facts.valve {
        ValveKind::Proportional => String::new(),
        other => format!("kind = \"{}\"\n", other.word()),
    };
    let strokes = if has_stroke {
        "\n# The pistons have a stroke: the fill takes time.\n[clutch.a.fill]\nenabled = true\n\n[clutch.b.fill]\nenabled = true\n"
    } else {
        ""
    };
    let text = format!(
        "{HEAD}\nname = {}\n\n[gear_train]\nratios = [{}, {}] # turbine over output speed, before and after the shift\n\n\
         [engine]\nmax_torque_n_m = {}\n{}\n[converter]\n{}\n\
         # The clutch that engages, whose pressure is estimated; clutch.a is the one that lets go.\n[clutch.b]\n{}\n\
         [clutch.b.valve]\n{kind}{}{strokes}\n[driveline]\nfinal_ratio = {} # from the gearbox output to the wheels\n{}\n\
         [vehicle]\nmass_kg = {} # with driver\nwheel_radius_m = {} # rolling radius of the driven wheels\n\n\
         # How far off the values may be.\n[design.error_bounds]\n{}",
        toml_string(&facts.name),
        exact(facts.ratio_before),
        exact(facts.ratio_after),
        exact(facts.engine_torque_n_m),
        shown("engine")?,
        shown("converter")?,
        shown("clutch.b")?,
        shown("clutch.b.valve")?,
        exact(facts.final_ratio),
        shown("driveline")?,
        exact(facts.mass_kg),
        exact(facts.wheel_radius_m),
        shown("design.error_bounds")?,
    );
    VehicleFile::from_source(Source::built_in("the new vehicle file", &text))?;
    Ok(text)
}

/// A number as it was given.
pub(super) fn exact(value: f64) -> String {
    let short = toml_number(value);
    if short.parse() == Ok(value) { short } else { format!("{value:?}") }
}

/// The complete file with these numbers, checked, and its text.
///
/// # Errors
/// As [`short_file`].
pub fn complete_file(facts: &Facts, has_stroke: bool) -> Result<String, ConfigError> {
    let source = Source::built_in("the new vehicle file", &short_file(facts, has_stroke)?);
    match Short::of(&source)? {
        Some(short) => complete(&short.defaults, &source).map(|(text, _)| text),
        None => Ok(source.text),
    }
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
            valve: ValveKind::Proportional,
        }
    }

    fn vehicle(facts: &Facts) -> Result<VehicleFile, ConfigError> {
        VehicleFile::from_source(Source::built_in("x.toml", &short_file(facts, false)?))
    }

    #[test]
    fn the_file_has_the_ratios_and_numbers_that_were_given() {
        for (before, after) in
            [(4.17, 2.34), (3.0, 2.0), (2.34, 1.52), (1.52, 1.14), (1.14, 1.0), (1.0, 0.87), (0.87, 0.69), (2.5, 1.0)]
        {
            let vehicle = vehicle(&facts(before, after)).unwrap();
            let found = [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()];
            for (found, expected) in found.into_iter().zip([before, after]) {
                assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
            }
            assert_eq!(vehicle.name, "car {mass} \"x\"");
            assert_eq!(vehicle.road.mass_kg, 1800.0);
            assert!(!vehicle.source.text.replace("{mass}", "").contains("{mass"), "{}", vehicle.source.text);
        }
    }

    #[test]
    fn a_file_with_the_numbers_of_the_built_in_car_has_its_bounds_and_cylinders() {
        let numbers = Facts {
            mass_kg: 1500.0,
            wheel_radius_m: 0.3,
            ratio_before: 2.5,
            ratio_after: 1.0,
            final_ratio: 3.0,
            engine_torque_n_m: 190.0,
            ..facts(2.5, 1.0)
        };
        let (short, shipped) = (vehicle(&numbers).unwrap(), VehicleFile::built_in().unwrap());
        assert_eq!((short.settings.filter, short.error_bounds), (shipped.settings.filter, shipped.error_bounds));
        assert_eq!(short.engine, shipped.engine);
        let supply = |vehicle: &VehicleFile| vehicle.offgoing.cylinder.supply;
        assert_eq!(supply(&short), supply(&shipped));
        assert_eq!(short.output_inertia_kg_m2, shipped.output_inertia_kg_m2);
    }

    /// With torques, inertias and clutches of twice the size a car has the same speeds, so that all bounds on torques are twice as
    /// large, and its cylinders fill in the same time.
    #[test]
    fn what_bounds_a_torque_grows_with_the_torques_of_the_car() {
        let one = vehicle(&facts(3.0, 2.0)).unwrap();
        let two = vehicle(&Facts { engine_torque_n_m: 700.0, mass_kg: 3600.0, ..facts(3.0, 2.0) }).unwrap();
        let twice = |a: f64, b: f64| assert!((b / a - 2.0).abs() < 1e-3, "{a} {b}");
        twice(one.engine.inertia_kg_m2, two.engine.inertia_kg_m2);
        twice(one.settings.filter.offgoing_n_m, two.settings.filter.offgoing_n_m);
        twice(one.error_bounds.offgoing_torque_n_m, two.error_bounds.offgoing_torque_n_m);
        twice(one.error_bounds.output_torque_n_m, two.error_bounds.output_torque_n_m);
        twice(one.error_bounds.shaft_torque_n_m, two.error_bounds.shaft_torque_n_m);
        for (a, b) in one.shift.mass_kg_m2.as_flattened().iter().zip(two.shift.mass_kg_m2.as_flattened()) {
            twice(*a, *b);
        }
        let fill_s = |vehicle: &VehicleFile| {
            let cylinder = &vehicle.oncoming.cylinder;
            cylinder.stroke_m3 / cylinder.supply.flow(0.15e6, cylinder.viscosity_m2_s)
        };
        assert!((fill_s(&two) / fill_s(&one) - 1.0).abs() < 1e-3, "{} {}", fill_s(&one), fill_s(&two));
    }

    /// A car has the same drive shafts whichever of its shifts the file describes.
    #[test]
    fn the_drive_shafts_do_not_depend_on_the_gears_of_the_shift() {
        let [low, high] = [(4.7, 3.13), (0.84, 0.67)].map(|(before, after)| vehicle(&facts(before, after)).unwrap());
        assert_eq!(low.driveline, high.driveline);
    }

    #[test]
    fn what_is_no_upshift_or_no_car_is_refused() {
        assert!(vehicle(&facts(1.0, 2.0)).unwrap_err().to_string().contains("no upshift"));
        assert!(vehicle(&facts(2.0, f64::NAN)).is_err());
        assert!(vehicle(&facts(2.0, 0.1)).is_err());
        assert!(vehicle(&Facts { mass_kg: -3.0, ..facts(2.5, 1.5) }).is_err());
        assert!(vehicle(&Facts { engine_torque_n_m: f64::INFINITY, ..facts(2.5, 1.5) }).is_err());
    }

    #[test]
    fn a_file_is_written_for_a_small_car_and_for_a_heavy_truck() {
        let cars =
            [(20.0, 200.0, 0.2, 4.0), (100.0, 800.0, 0.26, 4.3), (1000.0, 5e3, 0.45, 3.9), (2000.0, 60e3, 0.55, 5.0)];
        for (engine_torque_n_m, mass_kg, wheel_radius_m, final_ratio) in cars {
            for (before, after) in [(4.0, 2.3), (1.52, 1.14), (0.87, 0.69)] {
                let facts = Facts { engine_torque_n_m, mass_kg, wheel_radius_m, final_ratio, ..facts(before, after) };
                let found = vehicle(&facts);
                assert!(found.is_ok(), "{engine_torque_n_m} {before} {:?}", found.err());
            }
        }
    }

    #[test]
    fn a_default_that_cannot_be_right_names_the_numbers_that_it_follows_from() {
        let message = vehicle(&Facts { engine_torque_n_m: 2000.0, ..facts(20.0, 0.6) }).unwrap_err().to_string();
        assert!(message.starts_with("the new vehicle file:"), "{message}");
        assert!(
            message.contains("`clutch.a.mean_radius_m`: its default for the numbers of this file is "),
            "{message}"
        );
        assert!(message.contains("hint: check the maximum engine torque, the ratios"), "{message}");
    }

    #[test]
    fn a_short_file_is_the_complete_one_with_all_that_was_given() {
        for valve in [ValveKind::Proportional, ValveKind::PulseWidth] {
            for has_stroke in [false, true] {
                let facts = Facts { valve, ..facts(4.17, 2.34) };
                let short =
                    VehicleFile::from_source(Source::built_in("x", &short_file(&facts, has_stroke).unwrap())).unwrap();
                let text = complete_file(&facts, has_stroke).unwrap();
                assert_eq!(text, short.source.text);
                let complete = VehicleFile::from_source(Source::built_in("x", &text)).unwrap();
                assert!(complete.defaults_taken.is_empty(), "{:?}", complete.defaults_taken);
                assert!(short.defaults_taken.len() > 50, "{}", short.defaults_taken.len());
                assert_eq!(short.oncoming.has_stroke, has_stroke);
                let same = VehicleFile {
                    source: short.source.clone(),
                    defaults_taken: short.defaults_taken.clone(),
                    ..complete
                };
                assert_eq!(same, short);
            }
        }
    }
}
