//! Rows of tables of frames as python-can writes them: `timestamp,arbitration_id,extended,remote,error,dlc,data`, with times in seconds and
//! the data in base 64.

use super::frame::{Frame, PAYLOAD};
use super::line::{Line, id_of, length_with};

/// What a row is.
pub(super) fn line(text: &str) -> Line {
    let text = text.trim();
    // The row of names.
    if text.is_empty() || text.starts_with("timestamp,") {
        return Line::Remark;
    }
    row(text).unwrap_or(Line::Unread)
}

fn row(text: &str) -> Option<Line> {
    let cells: Vec<&str> = text.split(',').map(str::trim).collect();
    let [stamp, id, extended, remote, error, length, data] = cells[..] else { return None };
    let time_s: f64 = stamp.parse().ok().filter(|time_s: &f64| time_s.is_finite())?;
    let (id, extended) = (id_of(id)?, flag(extended)?);
    // A remote frame asks for data and has none; an error frame is the state of the bus.
    if flag(remote)? || flag(error)? {
        return Some(Line::Remark);
    }
    let data = of_base64(data)?;
    (data.len() == length_with(length.parse().ok()?, data.len()))
        .then(|| Line::Frame(Frame::new(time_s, id, extended, &data)))
}

fn flag(cell: &str) -> Option<bool> {
    match cell {
        "0" => Some(false),
        "1" => Some(true),
        _ => None,
    }
}

/// The bytes of a text, RFC 4648; none if it is none or longer than a frame.
fn of_base64(text: &str) -> Option<Vec<u8>> {
    let digits = text.trim_end_matches('=').as_bytes();
    let is_padded = text.len().is_multiple_of(4) && text.len() - digits.len() < 3;
    if !is_padded || digits.len() % 4 == 1 || digits.len() > PAYLOAD.div_ceil(3) * 4 {
        return None;
    }
    let value = |digit: &u8| match digit {
        b'A'..=b'Z' => Some(u32::from(digit - b'A')),
        b'a'..=b'z' => Some(u32::from(digit - b'a') + 26),
        b'0'..=b'9' => Some(u32::from(digit - b'0') + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let mut data = Vec::with_capacity(PAYLOAD);
    for group in digits.chunks(4) {
        let bits = group.iter().try_fold(0, |bits, digit| Some(bits << 6 | value(digit)?))?;
        let bytes = (bits << (6 * (4 - group.len()))).to_be_bytes();
        data.extend_from_slice(&bytes[1..group.len()]);
    }
    Some(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        for (text, data) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmE=", "fooba")] {
            assert_eq!(of_base64(text).as_deref(), Some(data.as_bytes()), "{text}");
        }
        for wrong in ["Z", "Zg", "Zg=", "Z===", "Zm9*", "====", "Zm9vYg", &"Zm9v".repeat(23)] {
            assert_eq!(of_base64(wrong), None, "{wrong}");
        }
    }
}
