//! Numbers and names as C has them.

/// A name that C allows: letters, digits and underscores, in lower case.
pub(crate) fn identifier(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let name: String = name.chars().map(plain).collect();
    if name.is_empty() { "car".to_owned() } else { name }
}

/// A name for a macro.
pub(crate) fn upper(name: &str) -> String {
    identifier(name).to_ascii_uppercase()
}

/// Macro names of several things, each another one: where two would have the same, or one no letter, its place is in it.
pub(crate) fn distinct_upper<'n>(names: impl Iterator<Item = &'n str>) -> Vec<String> {
    let plain: Vec<String> = names.map(upper).collect();
    let mut distinct: Vec<String> = Vec::new();
    for (at, name) in plain.iter().enumerate() {
        let is_plain = name.chars().any(|c| c != '_') && plain.iter().filter(|other| *other == name).count() == 1;
        let mut macro_name = if is_plain { name.clone() } else { format!("{name}_{at}") };
        while distinct.contains(&macro_name) || (!is_plain && plain.contains(&macro_name)) {
            macro_name.push('_');
        }
        distinct.push(macro_name);
    }
    distinct
}

/// Text that may stand in a comment of C.
pub(crate) fn comment(text: &str) -> String {
    text.replace("*/", "* /").replace("/*", "/ *").replace(|c: char| c.is_control(), " ").replace("??", "? ?")
}

/// A number as a hexadecimal constant of C99: every digit of it, and none that is rounded.
pub(crate) fn hex_float(value: f32) -> String {
    let sign = if value.is_sign_negative() { "-" } else { "" };
    let size = value.abs();
    if size == 0.0 {
        return format!("{sign}0x0p+0f");
    }
    if size.is_infinite() {
        return format!("{sign}INFINITY");
    }
    // A number below the normal ones is scaled to one.
    let (normal, below) = if size < f32::MIN_POSITIVE { (size * 16_777_216.0, 24) } else { (size, 0) };
    let bits = normal.to_bits();
    let exponent = (bits >> 23).cast_signed() - 127 - below;
    let digits = format!("{:06x}", (bits & 0x7f_ffff) << 1);
    let digits = digits.trim_end_matches('0');
    let point = if digits.is_empty() { "" } else { "." };
    format!("{sign}0x1{point}{digits}p{exponent:+}f")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_c_cannot_tell_apart_have_their_places() {
        let distinct = |names: &[&str]| distinct_upper(names.iter().copied());
        assert_eq!(distinct(&["B1", "c 2"]), ["B1", "C_2"]);
        assert_eq!(distinct(&["ü", "ö", "B1"]), ["__0", "__1", "B1"]);
        assert_eq!(distinct(&["Bä", "Bö", "B__0"]), ["B__0_", "B__1", "B__0"]);
    }

    #[test]
    fn a_number_in_hexadecimal_has_all_of_its_digits() {
        for (value, text) in [
            (0.1_f32, "0x1.99999ap-4f"),
            (-1.0, "-0x1p+0f"),
            (0.0, "0x0p+0f"),
            (-0.0, "-0x0p+0f"),
            (f32::INFINITY, "INFINITY"),
            (f32::MAX, "0x1.fffffep+127f"),
            (f32::from_bits(1), "0x1p-149f"),
            (1.5e6, "0x1.6e36p+20f"),
        ] {
            assert_eq!(hex_float(value), text);
        }
    }

    #[test]
    fn a_name_from_anywhere_is_one_of_c() {
        assert_eq!(identifier("My car-8HP (2024)"), "my_car_8hp__2024_");
        assert_eq!((identifier(""), upper("8HP")), ("car".to_owned(), "8HP".to_owned()));
        assert_eq!(comment("a */ b\nc"), "a * / b c");
    }
}
