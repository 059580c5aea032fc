//! Conversion of common units to and from SI. The only place with such conversions.

use std::f64::consts::PI;

/// Endings of names in other units: ending, its SI ending, size of the unit in SI.
const ENDINGS: &[(&str, &str, f64)] = &[
    ("_rpm", "_rad_s", PI / 30.0),
    ("_bar", "_pa", 1e5),
    ("_mpa", "_pa", 1e6),
    ("_kpa", "_pa", 1e3),
    ("_ms", "_s", 1e-3),
    ("_ma", "_a", 1e-3),
    ("_km_h", "_m_s", 1.0 / 3.6),
    ("_deg", "_rad", PI / 180.0),
    // A duty cycle is in % inside too, as in the valve's law.
    ("_duty_percent", "_duty_percent", 1.0),
    ("_percent", "", 1e-2),
];

/// A name as it is used inside, and the factor that brings its values to SI. Upper case becomes lower.
pub fn to_si(name: &str) -> (String, f64) {
    let name = name.trim().to_lowercase();
    for &(ending, si, size) in ENDINGS {
        if let Some(stem) = name.strip_suffix(ending) {
            return (format!("{stem}{si}"), size);
        }
    }
    (name, 1.0)
}

/// Pascal in megapascal.
pub fn mpa(pascal: f64) -> f64 {
    pascal * 1e-6
}

/// Radian per second in revolutions per minute.
pub fn rpm(rad_s: f64) -> f64 {
    rad_s * 30.0 / PI
}

/// Metre per second in kilometres per hour.
pub fn km_h(m_s: f64) -> f64 {
    m_s * 3.6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_other_units_become_si_names() {
        assert_eq!(to_si("turbine_speed_rpm"), ("turbine_speed_rad_s".to_owned(), PI / 30.0));
        assert_eq!(to_si("Throttle_percent"), ("throttle".to_owned(), 0.01));
        assert_eq!(to_si("oncoming_duty_percent"), ("oncoming_duty_percent".to_owned(), 1.0));
        assert_eq!(to_si("time_ms"), ("time_s".to_owned(), 1e-3));
        assert_eq!(to_si("oncoming_current_a"), ("oncoming_current_a".to_owned(), 1.0));
    }
}
