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
    ("_kmh", "_m_s", 1.0 / 3.6),
    ("_kph", "_m_s", 1.0 / 3.6),
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

/// What brings a value in a unit to SI. The size of a unit such as 0.001 is no binary fraction: a value over 1000 is the number as people write it,
/// 1.019 A for 1019 mA. Nor is 1.1, and 1.1 bar times 100000 is 110000.00000000001 in floating point. With a unit of ten or more, a result within
/// rounding of a multiple of 0.001 becomes that multiple: 110000 Pa.
///
/// ```
/// use trace::units::Scale;
///
/// assert_eq!(Scale::of(1e-3).of_value(1019.0), 1.019);
/// assert_eq!(Scale::of(1e5).of_value(1.1), 1.1e5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    times: f64,
    over: f64,
}

impl Scale {
    /// Of the size of a unit in SI.
    pub fn of(size: f64) -> Self {
        let over = size.recip().round();
        if size < 1.0 && over.recip() == size { Self { times: 1.0, over } } else { Self { times: size, over: 1.0 } }
    }

    /// The value in SI.
    #[inline]
    pub fn of_value(self, value: f64) -> f64 {
        if self.times == self.over {
            return value;
        }
        let si = value * self.times / self.over;
        if self.times < 10.0 || self.times.fract() != 0.0 {
            return si;
        }
        let near = (si * 1e3).round() / 1e3;
        if (near - si).abs() <= 2.0 * f64::EPSILON * si.abs() { near } else { si }
    }

    /// The size of the unit.
    pub fn size(self) -> f64 {
        self.of_value(1.0)
    }
}

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Speed of a shaft, rad/s.
    Rotation,
    /// Speed of the car or of a wheel's tread, m/s.
    Velocity,
    /// Acceleration of the car, m/s^2.
    Acceleration,
    /// Electric current, A.
    Current,
    /// A part of a whole, from 0 to 1.
    Fraction,
    /// Pressure, Pa.
    Pressure,
    /// Torque, N m.
    Torque,
    /// Time, s.
    Time,
    /// Temperature, degC.
    Temperature,
}

/// A unit as measured files write it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// The usual spelling.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Its size in the unit of the quantity.
    pub size: f64,
    /// What is added after the multiplication.
    pub zero: f64,
}

impl Unit {
    /// A value of this unit in the unit of the quantity.
    pub fn to_si(&self, value: f64) -> f64 {
        Scale::of(self.size).of_value(value) + self.zero
    }

    /// The unit with this name. Spaces, brackets and multiplication signs are ignored; capitals count only where two units
    /// differ by them.
    pub fn parse(text: &str) -> Option<Self> {
        let plain: String = text.chars().filter(|c| !" \t[](){}*·⋅".contains(*c)).collect();
        let plain = plain.replace('²', "2").replace("^", "").replace(['µ', 'μ'], "u");
        let find = |same: &dyn Fn(&str) -> bool| {
            UNITS.iter().find(|(_, spellings, ..)| spellings.iter().any(|spelling| same(spelling)))
        };
        let found =
            find(&|spelling| spelling == plain).or_else(|| find(&|spelling| spelling.eq_ignore_ascii_case(&plain)));
        found.map(|&(name, _, quantity, size, zero)| Self { name, quantity, size, zero })
    }

    /// The usual spellings of all units, for messages.
    pub fn known() -> String {
        UNITS.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(", ")
    }

    /// All units of a quantity.
    pub fn of_quantity(quantity: Quantity) -> impl Iterator<Item = Self> {
        let of = UNITS.iter().filter(move |(_, _, other, ..)| *other == quantity);
        of.map(|&(name, _, quantity, size, zero)| Self { name, quantity, size, zero })
    }

    /// The unit that the ending of a name says, such as `_rpm`.
    pub fn of_name(name: &str) -> Option<Self> {
        const SI: &[(&str, &str)] = &[
            ("_rad_s", "rad/s"),
            ("_m_s2", "m/s^2"),
            ("_m_s", "m/s"),
            ("_n_m", "N m"),
            ("_nm", "N m"),
            ("_pa", "Pa"),
            ("_degc", "degC"),
            ("_a", "A"),
            ("_s", "s"),
            ("_rpm", "rpm"),
            ("_bar", "bar"),
            ("_mpa", "MPa"),
            ("_kpa", "kPa"),
            ("_ms", "ms"),
            ("_us", "us"),
            ("_ns", "ns"),
            ("_ma", "mA"),
            ("_km_h", "km/h"),
            ("_kmh", "km/h"),
            ("_kph", "km/h"),
            ("_percent", "%"),
        ];
        let name = name.trim().to_lowercase();
        SI.iter().find(|(ending, _)| name.ends_with(ending)).and_then(|(_, unit)| Self::parse(unit))
    }
}

/// Name, spellings, quantity, size, zero. The first spelling that is the same to the letter counts.
#[rustfmt::skip]
const UNITS: &[(&str, &[&str], Quantity, f64, f64)] = &[
    ("rad/s", &["rad/s", "rad/sec", "1rad/s"], Quantity::Rotation, 1.0, 0.0),
    ("rpm", &["rpm", "1/min", "min-1", "/min", "U/min", "Umin", "r/min", "rev/min", "upm", "1/minute"], Quantity::Rotation, PI / 30.0, 0.0),
    ("Hz", &["Hz", "1/s", "rps", "U/s", "rev/s", "s-1"], Quantity::Rotation, 2.0 * PI, 0.0),
    ("km/h", &["km/h", "kmh", "kph", "km/hr", "kmph"], Quantity::Velocity, 1.0 / 3.6, 0.0),
    ("mph", &["mph", "mi/h"], Quantity::Velocity, 0.44704, 0.0),
    ("m/s", &["m/s", "mps"], Quantity::Velocity, 1.0, 0.0),
    ("m/s^2", &["m/s2", "m/s/s", "mps2"], Quantity::Acceleration, 1.0, 0.0),
    ("g", &["g", "g0"], Quantity::Acceleration, 9.806_65, 0.0),
    ("A", &["A", "amp", "ampere"], Quantity::Current, 1.0, 0.0),
    ("mA", &["mA", "milliampere"], Quantity::Current, 1e-3, 0.0),
    ("%", &["%", "percent", "prozent", "pct"], Quantity::Fraction, 1e-2, 0.0),
    ("1", &["1", "-", "ratio"], Quantity::Fraction, 1.0, 0.0),
    ("Pa", &["Pa"], Quantity::Pressure, 1.0, 0.0),
    ("hPa", &["hPa", "mbar"], Quantity::Pressure, 1e2, 0.0),
    ("kPa", &["kPa"], Quantity::Pressure, 1e3, 0.0),
    ("bar", &["bar"], Quantity::Pressure, 1e5, 0.0),
    ("MPa", &["MPa", "N/mm2"], Quantity::Pressure, 1e6, 0.0),
    ("psi", &["psi", "psig", "lbf/in2"], Quantity::Pressure, 6_894.757_293_168, 0.0),
    ("N m", &["Nm", "N.m", "N-m"], Quantity::Torque, 1.0, 0.0),
    ("lb ft", &["lbft", "ftlb", "lb-ft", "ft-lb", "lbfft", "ftlbf"], Quantity::Torque, 1.355_817_948_331_4, 0.0),
    ("s", &["s", "sec", "second", "seconds", "sek", "sekunden"], Quantity::Time, 1.0, 0.0),
    ("ms", &["ms", "msec", "millisec", "milliseconds"], Quantity::Time, 1e-3, 0.0),
    ("us", &["us", "usec", "microsec", "microseconds"], Quantity::Time, 1e-6, 0.0),
    ("ns", &["ns", "nsec"], Quantity::Time, 1e-9, 0.0),
    ("min", &["min", "minute", "minutes", "minuten"], Quantity::Time, 60.0, 0.0),
    ("h", &["h", "hr", "hour", "hours", "std"], Quantity::Time, 3600.0, 0.0),
    ("degC", &["degC", "°C", "C", "deg_C", "celsius", "gradC"], Quantity::Temperature, 1.0, 0.0),
    ("K", &["K", "kelvin"], Quantity::Temperature, 1.0, -273.15),
    ("degF", &["degF", "°F", "deg_F"], Quantity::Temperature, 5.0 / 9.0, -160.0 / 9.0),
];

/// Endings of keys in SI with their units; one that ends with another stands before it.
const OF_KEYS: &[(&str, &str)] = &[
    ("_n_m_s_rad", "N m s/rad"),
    ("_m3_s_pa", "m^3/(s Pa)"),
    ("_pa_s_rad", "Pa s/rad"),
    ("_pa_s2_m5", "Pa s^2/m^5"),
    ("_pa_s2_m6", "Pa s^2/m^6"),
    ("_n_m_rad", "N m/rad"),
    ("_kg_m2", "kg m^2"),
    ("_kg_m3", "kg/m^3"),
    ("_n_m_s2", "N m s^2"),
    ("_n_m_s", "N m s"),
    ("_n_m", "N m"),
    ("_rad_s2", "rad/s^2"),
    ("_rad_s", "rad/s"),
    ("_m_s1_75", "m/s^1.75"),
    ("_m_s3", "m/s^3"),
    ("_m_s2", "m/s^2"),
    ("_m_s", "m/s"),
    ("_m3_pa", "m^3/Pa"),
    ("_m3_s", "m^3/s"),
    ("_m2_s", "m^2/s"),
    ("_sqrt_pa_s", "sqrt(Pa)/s"),
    ("_pa_a", "Pa/A"),
    ("_pa_s", "Pa/s"),
    ("_per_s", "1/s"),
    ("_percent", "%"),
    ("_degc", "degC"),
    ("_rad", "rad"),
    ("_m3", "m^3"),
    ("_m2", "m^2"),
    ("_kg", "kg"),
    ("_pa", "Pa"),
    ("_n", "N"),
    ("_a", "A"),
    ("_j", "J"),
    ("_w", "W"),
    ("_m", "m"),
    ("_s", "s"),
];

/// The SI unit of a key of a file, such as `mass_kg`; places of a list stand behind it, as in `torque_n_m.0.3`.
pub fn of_key(key: &str) -> Option<&'static str> {
    let is_place = |part: &&str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let name = key.rsplit('.').find(|part| !is_place(part))?;
    OF_KEYS.iter().find(|(ending, _)| name.ends_with(ending)).map(|&(_, unit)| unit)
}

/// How the name of a key of this unit ends, such as `_kg`.
pub fn key_ending(unit: &str) -> Option<&'static str> {
    OF_KEYS.iter().find(|(_, of)| *of == unit).map(|&(ending, _)| ending)
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
    fn keys_have_the_units_of_their_endings() {
        for (key, unit) in [
            ("vehicle.mass_kg", Some("kg")),
            ("engine.torque.torque_n_m.0.3", Some("N m")),
            ("clutch.A.damping_n_m_s_rad", Some("N m s/rad")),
            ("turbine.inertia_kg_m2", Some("kg m^2")),
            ("clutch.C", None),
            ("throttle.position.2", None),
        ] {
            assert_eq!(of_key(key), unit, "{key}");
        }
        // An ending that ends with another one is found before it.
        for (at, (ending, _)) in OF_KEYS.iter().enumerate() {
            assert!(OF_KEYS[..at].iter().all(|(before, _)| !ending.ends_with(before)), "{ending}");
        }
    }

    #[test]
    fn units_are_read_as_files_write_them() {
        for (text, name) in [
            ("[1/min]", "rpm"),
            ("U/min", "rpm"),
            ("RPM", "rpm"),
            ("N·m", "N m"),
            ("Nm", "N m"),
            ("mA", "mA"),
            ("MPa", "MPa"),
            ("km/h", "km/h"),
            ("m/s²", "m/s^2"),
            ("°C", "degC"),
            ("%", "%"),
            (" rad / s ", "rad/s"),
        ] {
            assert_eq!(Unit::parse(text).unwrap().name, name, "{text}");
        }
        // One pound-force per square inch is 0.45359237 kg times 9.80665 m/s^2 on 0.0254 m squared.
        let psi = 0.453_592_37 * 9.806_65 / (0.0254 * 0.0254);
        assert!((Unit::parse("psi").unwrap().to_si(1.0) - psi).abs() < 1e-6);
        assert!((Unit::parse("degF").unwrap().to_si(212.0) - 100.0).abs() < 1e-12);
        assert!(Unit::parse("furlong").is_none() && Unit::parse("").is_none());
        assert_eq!(Unit::of_name("Turbine_Speed_rpm").unwrap().name, "rpm");
        assert_eq!(Unit::of_name("vehicle_acceleration_m_s2").unwrap().name, "m/s^2");
        assert!(Unit::of_name("gear").is_none());
    }

    #[test]
    fn names_in_other_units_become_si_names() {
        assert_eq!(to_si("turbine_speed_rpm"), ("turbine_speed_rad_s".to_owned(), PI / 30.0));
        assert_eq!(to_si("Throttle_percent"), ("throttle".to_owned(), 0.01));
        assert_eq!(to_si("oncoming_duty_percent"), ("oncoming_duty_percent".to_owned(), 1.0));
        assert_eq!(to_si("time_ms"), ("time_s".to_owned(), 1e-3));
        assert_eq!(to_si("oncoming_current_a"), ("oncoming_current_a".to_owned(), 1.0));
    }
}
