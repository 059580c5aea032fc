//! The text of a drawing, made short for a page.

use std::borrow::Cow;
use std::collections::HashMap;

/// The same figure with its curves to a tenth of a pixel, which is half of their text.
pub(crate) fn compact(svg: &str) -> String {
    let mut parts = svg.split(" d=\"");
    let mut compact = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (path, rest) = part.split_once('"').unwrap_or((part, ""));
        compact.push_str(" d=\"");
        for word in path.split(' ') {
            match tenth(word) {
                Some((whole, tenth)) => {
                    if compact.ends_with(|c: char| c.is_ascii_digit()) {
                        compact.push(' ');
                    }
                    compact.push_str(&whole);
                    if tenth != b'0' {
                        compact.extend(['.', char::from(tenth)]);
                    }
                }
                None => compact.push_str(word),
            }
        }
        compact.push('"');
        compact.push_str(rest);
    }
    compact
}

/// What the names of clip paths begin with.
const CLIP: &str = "kuva-clip-";

/// The same text with its clip paths numbered in their order. kuva counts them over all figures of a process, so that the same page would be other
/// bytes each time.
pub(crate) fn numbered(text: &str) -> String {
    let mut parts = text.split(CLIP);
    let mut numbered = parts.next().unwrap_or_default().to_owned();
    let mut known: HashMap<&str, usize> = HashMap::new();
    for part in parts {
        let digits = part.len() - part.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let (name, rest) = part.split_at(digits);
        let next = known.len();
        let number = known.entry(name).or_insert(next);
        numbered.extend([CLIP, &number.to_string(), rest]);
    }
    numbered
}

/// A number to a tenth: what stands before the point, and the digit after it. None for what is no number.
fn tenth(word: &str) -> Option<(Cow<'_, str>, u8)> {
    /// Whole numbers with so many digits are exact.
    const EXACT: usize = 15;
    let (whole, decimals) = word.split_once('.').unwrap_or((word, ""));
    let size = whole.strip_prefix('-').unwrap_or(whole);
    if (1..=EXACT).contains(&size.len()) && size.bytes().chain(decimals.bytes()).all(|byte| byte.is_ascii_digit()) {
        // The text of a figure has two decimals. It needs no more than its digits, but for a carry and for the middle between two.
        let digit = match *decimals.as_bytes() {
            [] => Some(b'0'),
            [digit] | [digit, b'0'..=b'4'] => Some(digit),
            [digit @ b'0'..=b'8', b'6'..=b'9'] => Some(digit + 1),
            _ => None,
        };
        if let Some(digit) = digit {
            return Some((Cow::Borrowed(whole), digit));
        }
    }
    let text = format!("{:.1}", word.parse::<f64>().ok()?);
    match text.split_once('.') {
        Some((whole, tenth)) => Some((Cow::Owned(whole.to_owned()), *tenth.as_bytes().first()?)),
        None => Some((Cow::Owned(text), b'0')),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_compact_figure_has_its_curves_to_a_tenth_of_a_pixel() {
        let svg =
            r#"<svg><path d="M 74.81 36.25 L 83.04 -35.000000004 Z" fill="none"/><text x="1.25">0.25</text></svg>"#;
        let expected = r#"<svg><path d="M74.8 36.2L83 -35Z" fill="none"/><text x="1.25">0.25</text></svg>"#;
        assert_eq!(compact(svg), expected);
        assert_eq!(compact("<svg></svg>"), "<svg></svg>");
    }

    #[test]
    fn clip_paths_are_numbered_in_their_order() {
        let text =
            r#"<i id="kuva-clip-907"/><i id="kuva-clip-12"/><i c="url(#kuva-clip-907)"/><i c="url(#kuva-clip-12)"/>"#;
        let expected =
            r#"<i id="kuva-clip-0"/><i id="kuva-clip-1"/><i c="url(#kuva-clip-0)"/><i c="url(#kuva-clip-1)"/>"#;
        assert_eq!(numbered(text), expected);
        assert_eq!(numbered("<svg></svg>"), "<svg></svg>");
    }

    #[test]
    fn a_tenth_from_the_digits_is_that_of_the_number() {
        let parts = ["0", "7", "99", "8123"].into_iter().flat_map(|whole| [whole.to_owned(), format!("-{whole}")]);
        for whole in parts {
            let decimals = (0..100).map(|i| format!(".{i:02}")).chain((0..10).map(|i| format!(".{i}")));
            let others = [".125", ".150000001", ".05e1", "e2", "", "."].map(str::to_owned);
            for word in decimals.chain(others).map(|decimals| whole.clone() + &decimals) {
                let number = format!("{:.1}", word.parse::<f64>().unwrap());
                let expected = number.strip_suffix(".0").unwrap_or(&number);
                assert_eq!(compact(&format!(" d=\"M {word} L\"")), format!(" d=\"M{expected}L\""), "{word}");
            }
        }
        assert_eq!(compact(" d=\"M NaN 1 inf A\""), " d=\"MNaN1 infA\"");
    }
}
