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
