//! Names and paths in messages. They come from other people's files: a control character in one must not reach the terminal.

use std::borrow::Cow;
use std::fmt::{self, Display, Write};
use std::path::Path;

/// Whether a character does something else than to be printed: it controls the terminal, ends the line, is invisible or turns
/// the direction of writing.
pub fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
        || matches!(c, '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

/// A text on one line in which every character is printed, the others as `\n` or `\u{1b}`.
pub fn printable(text: &str) -> Cow<'_, str> {
    if text.chars().any(is_unprintable) { Cow::Owned(Printable(text).to_string()) } else { Cow::Borrowed(text) }
}

/// A text as a TOML file holds it: in double quotes, on one line, with everything else escaped.
pub fn toml_string(text: &str) -> String {
    let escaped = text.chars().map(|c| match c {
        '"' | '\\' => format!("\\{c}"),
        _ if is_unprintable(c) && u32::from(c) > 0xffff => format!("\\U{:08x}", u32::from(c)),
        _ if is_unprintable(c) => format!("\\u{:04x}", u32::from(c)),
        _ => c.to_string(),
    });
    format!("\"{}\"", escaped.collect::<String>())
}

/// A path in a message. Use it in place of `Path::display`, which prints what a terminal obeys.
pub trait ShownPath {
    /// The path on one line, every character printed; `-` is standard input.
    fn shown(&self) -> impl Display + '_;
}

impl ShownPath for Path {
    fn shown(&self) -> impl Display + '_ {
        Lossy(if self == Self::new("-") { Self::new("standard input") } else { self })
    }
}

/// What the parser of TOML says of a value of a wrong type, in plain words and printable, with how to write it where that is known:
/// `invalid type: string "8", expected f64` becomes `invalid type: the text "8", expected a number`. Other messages stay as they are.
pub fn plain_type(message: &str) -> String {
    let message = printable(message);
    for (of_parser, plain) in [("unknown field ", "unknown key "), ("missing field ", "missing key ")] {
        if let Some(rest) = message.strip_prefix(of_parser) {
            return format!("{plain}{rest}");
        }
    }
    if ["invalid float", "invalid integer", "invalid mantissa", "invalid exponent"]
        .iter()
        .any(|of| message.starts_with(of))
    {
        return "this is no number\nhint: write it with one decimal point, as 3.0 or 1.5e6".to_owned();
    }
    let Some((kind, (found, expected))) = ["invalid type: ", "invalid value: "]
        .into_iter()
        .find_map(|kind| Some((kind, message.strip_prefix(kind)?.rsplit_once(", expected ")?)))
    else {
        return message.into_owned();
    };
    const FOUND: [(&str, &str); 6] = [
        ("string ", "the text "),
        ("integer ", "the number "),
        ("floating point ", "the number "),
        ("boolean ", "the word "),
        ("sequence", "a list"),
        ("map", "a table"),
    ];
    let of_type = FOUND.iter().find_map(|(name, plain)| Some((*plain, found.strip_prefix(name)?)));
    let (plain, value) = of_type.unwrap_or(("", found));
    let wanted = match expected {
        "f64" | "f32" => "a number",
        "usize" | "u8" | "u16" | "u32" | "u64" => "a whole number from 0 on",
        "integer" | "isize" | "i8" | "i16" | "i32" | "i64" => "a whole number",
        "a string" | "string" | "path string" | "a character" => "text in quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list in brackets",
        "a map" => "a table",
        _ if expected.starts_with("struct ") => "a table",
        other => other,
    };
    let bare = value.trim_matches(['"', '`']);
    let hint = match (plain, wanted) {
        ("the number " | "the word ", "text in quotes") => format!("\nhint: write it in quotes: \"{bare}\""),
        ("the text ", "a number" | "a whole number" | "a whole number from 0 on") if bare.parse::<f64>().is_ok() => {
            format!("\nhint: write it without quotes: {bare}")
        }
        ("the text ", "true or false") if matches!(bare, "true" | "false") => {
            format!("\nhint: write it without quotes: {bare}")
        }
        _ => String::new(),
    };
    format!("{kind}{plain}{value}, expected {wanted}{hint}")
}

struct Printable<'a>(&'a str);

impl Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            if is_unprintable(c) { write!(f, "{}", c.escape_default())? } else { f.write_char(c)? }
        }
        Ok(())
    }
}

struct Lossy<'a>(&'a Path);

impl Display for Lossy<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        Printable(&self.0.to_string_lossy()).fmt(f)
    }
}

/// A number of a table of summaries with twelve digits, so that a difference of two times is 0.8 and not 0.8000000000000007; a size below 1e-9, which no
/// quantity in SI has that is not zero, is zero. One above ten million stays: it is a time on a clock.
///
/// ```
/// assert_eq!([0.8000000000000007, 1413999.9999999995, 5.7e-14, 1715883410.0123].map(trace::rounded), [0.8, 1414000.0, 0.0, 1715883410.0123]);
/// ```
pub fn rounded(value: f64) -> f64 {
    const SMALLEST: f64 = 1e-9;
    const LARGEST: f64 = 1e7;
    match value.abs() {
        size if size < SMALLEST => 0.0,
        size if size < LARGEST => format!("{value:.11e}").parse().unwrap_or(value),
        _ => value,
    }
}

/// A number with five digits as TOML has it.
pub fn toml_number(value: f64) -> String {
    const DIGITS: i32 = 5;
    if value == 0.0 || !value.is_finite() {
        return format!("{value:.1}");
    }
    let scientific = format!("{value:e}");
    let exponent = scientific.rsplit_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0);
    if (-3..6).contains(&exponent) {
        let decimals = usize::try_from((DIGITS - 1 - exponent).max(1)).unwrap_or(1);
        return without_zeros(&format!("{value:.decimals$}"));
    }
    let text = format!("{value:.4e}");
    text.split_once('e').map_or_else(|| text.clone(), |(digits, power)| format!("{}e{power}", without_zeros(digits)))
}

/// A decimal number without the zeros at its end, but for one behind the point.
fn without_zeros(digits: &str) -> String {
    let trimmed = digits.trim_end_matches('0');
    if trimmed.ends_with('.') { format!("{trimmed}0") } else { trimmed.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_five_digits() {
        let cases =
            [(0.123_456_7, "0.12346"), (13_000.0, "13000.0"), (1.0e6, "1.0e6"), (2.5e-4, "2.5e-4"), (0.0, "0.0")];
        for (value, text) in cases {
            assert_eq!(toml_number(value), text);
            assert!((text.parse::<f64>().unwrap() - value).abs() <= 1e-4 * value.abs());
        }
    }

    #[test]
    fn the_type_of_a_value_is_told_in_plain_words() {
        for (message, plain) in [
            (
                "invalid type: string \"8\", expected f64",
                "invalid type: the text \"8\", expected a number\nhint: write it without quotes: 8",
            ),
            ("invalid type: string \"soon\", expected f64", "invalid type: the text \"soon\", expected a number"),
            (
                "invalid type: integer `5`, expected a string",
                "invalid type: the number `5`, expected text in quotes\nhint: write it in quotes: \"5\"",
            ),
            (
                "invalid type: floating point `2.5`, expected u32",
                "invalid type: the number `2.5`, expected a whole number from 0 on",
            ),
            (
                "invalid type: string \"a, expected b\", expected struct RawClutch",
                "invalid type: the text \"a, expected b\", expected a table",
            ),
            (
                "invalid value: integer `-1`, expected usize",
                "invalid value: the number `-1`, expected a whole number from 0 on",
            ),
            ("invalid type: map, expected a sequence", "invalid type: a table, expected a list in brackets"),
            (
                "invalid float, expected nothing",
                "this is no number\nhint: write it with one decimal point, as 3.0 or 1.5e6",
            ),
            ("unknown field `a\u{1b}`, expected `b`", r"unknown key `a\u{1b}`, expected `b`"),
        ] {
            assert_eq!(plain_type(message), plain);
        }
    }

    #[test]
    fn what_is_not_printed_is_escaped_and_the_rest_stays() {
        let plain = "C:\\logs\\Fahrt ü 离合器 'a' \"b\".csv";
        assert!(matches!(printable(plain), Cow::Borrowed(text) if text == plain));
        let hostile = "a\u{1b}[2J\nhint: b\t\u{9b}31m\u{202e}gpj.\u{7f}\u{feff}";
        let escaped = r"a\u{1b}[2J\nhint: b\t\u{9b}31m\u{202e}gpj.\u{7f}\u{feff}";
        assert_eq!(printable(hostile), escaped);
        assert_eq!(Path::new(hostile).shown().to_string(), escaped);
        assert_eq!(Path::new("-").shown().to_string(), "standard input");
        assert_eq!(Path::new("./-").shown().to_string(), "./-");
    }
}
