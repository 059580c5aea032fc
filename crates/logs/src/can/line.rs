//! What the lines of bus logs have in common.

use super::frame::{Frame, PAYLOAD};

/// What a line is.
pub(super) enum Line {
    /// A frame with data.
    Frame(Frame),
    /// A header, a comment, an error or remote frame.
    Remark,
    /// Anything else.
    Unread,
}

/// Bytes of a classic frame by its length code, a digit of base 16: codes above eight are eight bytes too.
pub(super) fn classic_length(code: &str) -> Option<usize> {
    usize::from_str_radix(code, 16).ok().filter(|code| *code <= 0xf).map(|code| code.min(8))
}

/// Bytes by the length code of CAN FD.
pub(super) const FD_LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// Bytes of a frame by its length code or length, of which so many are there: with a code from 9 to 15 a classic frame has eight bytes, and one of CAN FD
/// up to 64.
pub(super) fn length_with(length: usize, bytes: usize) -> usize {
    let by_code = FD_LENGTHS.get(length).copied().filter(|_| length > 8);
    if by_code.is_some_and(|by_code| bytes == 8 || bytes == by_code) { bytes } else { length }
}

/// An identifier in base 16, of at most 29 bits.
pub(super) fn id_of(digits: &str) -> Option<u32> {
    let digits = digits.strip_prefix("0x").unwrap_or(digits);
    u32::from_str_radix(digits, 16).ok().filter(|id| *id <= 0x1fff_ffff)
}

/// The bytes of words in base 16, and how many they are.
pub(super) fn payload(words: &[&str]) -> Option<([u8; PAYLOAD], usize)> {
    let mut data = [0; PAYLOAD];
    for (byte, word) in data.iter_mut().zip(words) {
        *byte = u8::from_str_radix(word, 16).ok()?;
    }
    (words.len() <= PAYLOAD).then_some((data, words.len()))
}
