//! Units of parameters, by the endings of their names.

use trace::units::of_key;

/// Of the walk of a state: its unit over the root of time. Endings, with their units.
const WALKS: [(&str, &str); 4] = [
    ("rate_walk", "rad/s^1.5"),
    ("load_walk", "N m/s^0.5"),
    ("acceleration_walk", "rad/s^2.5"),
    ("scale_walk", "1/s^0.5"),
];

/// The unit of a parameter by its path, the outermost name first; an axis and values of a map by the name of the map.
pub(crate) fn unit_of(path: &[impl AsRef<str>]) -> &'static str {
    let Some((name, above)) = path.split_last() else { return "" };
    // Places in an array have the unit of the array.
    match name.as_ref() {
        "axis" => of_axis(above.last().map_or("", AsRef::as_ref)),
        "values" => unit_of(above),
        name if name.bytes().all(|c| c.is_ascii_digit()) => unit_of(above),
        "per_torque" => "m/s^2/(N m)",
        "command" | "command_max" | "command_error" => "A or %",
        name => {
            let walk = WALKS.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, unit)| *unit);
            walk.or_else(|| of_key(name)).unwrap_or("1")
        }
    }
}

/// The unit of the axis of a map.
fn of_axis(map: &str) -> &'static str {
    match map {
        "friction" => "rad/s",
        "time_constant_s" => "Pa",
        "gain_pa_a" => "A",
        "delay_s" => "A or %",
        _ => "1",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parameter_has_the_unit_of_its_name() {
        for (path, unit) in [
            (vec!["driveline", "shaft_stiffness_n_m_rad"], "N m/rad"),
            (vec!["elements", "0", "valve", "maps", "gain_pa_a", "values"], "Pa/A"),
            (vec!["elements", "0", "valve", "maps", "gain_pa_a", "axis"], "A"),
            (vec!["shifts", "3", "mass_kg_m2", "1"], "kg m^2"),
            (vec!["final_ratio"], "1"),
            (vec!["uncertainty", "load_walk"], "N m/s^0.5"),
        ] {
            assert_eq!(unit_of(&path), unit, "{path:?}");
        }
    }
}
