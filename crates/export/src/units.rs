//! Units of parameters, by the endings of their names.

/// Endings and units, the longer ending first.
const ENDINGS: [(&str, &str); 27] = [
    ("_n_m_s_rad", "N m s/rad"),
    ("_sqrt_pa_s", "sqrt(Pa)/s"),
    ("_pa_s2_m5", "Pa s^2/m^5"),
    ("_pa_s2_m6", "Pa s^2/m^6"),
    ("_n_m_rad", "N m/rad"),
    ("_m3_s_pa", "m^3/(s Pa)"),
    ("_n_m_s2", "N m s^2"),
    ("_rad_s2", "rad/s^2"),
    ("_kg_m2", "kg m^2"),
    ("_m3_pa", "m^3/Pa"),
    ("_rad_s", "rad/s"),
    ("_m3_s", "m^3/s"),
    ("_m2_s", "m^2/s"),
    ("_pa_a", "Pa/A"),
    ("_rad", "rad"),
    ("_n_m", "N m"),
    ("_m3", "m^3"),
    ("_m2", "m^2"),
    ("_pa", "Pa"),
    ("_n", "N"),
    ("_m", "m"),
    ("_a", "A"),
    ("_s", "s"),
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
        "command" | "command_max" | "command_error" => "A or %",
        name => ENDINGS.iter().find(|(ending, _)| name.ends_with(ending)).map_or("1", |(_, unit)| unit),
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
