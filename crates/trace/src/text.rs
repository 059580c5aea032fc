//! The text of files: UTF-8 or UTF-16, with a byte order mark or without, or Latin-1.

use std::io::{self, Read};

/// Bytes that are read at once.
const AT_ONCE: usize = 8 << 10;
/// Bytes that show UTF-16 without a mark: four letters of ASCII, each with a zero.
const WITHOUT_MARK: usize = 8;
/// The byte order mark of UTF-8.
pub const BYTE_ORDER_MARK: &[u8] = &[0xef, 0xbb, 0xbf];
/// The same as a letter.
const MARK: char = '\u{feff}';

/// Whether a text is UTF-16, by its first bytes: it begins with a mark, or with four letters of ASCII.
pub fn is_utf16(head: &[u8]) -> bool {
    utf16(head).is_some()
}

/// The order of both bytes of a unit of UTF-16.
#[derive(Debug, Clone, Copy)]
enum ByteOrder {
    LowFirst,
    HighFirst,
}

impl ByteOrder {
    /// The units in these bytes, without half a one at their end.
    fn units(self, bytes: &[u8]) -> impl DoubleEndedIterator<Item = u16> {
        let pairs = bytes.as_chunks::<2>().0.iter();
        pairs.map(move |pair| match self {
            Self::LowFirst => u16::from_le_bytes(*pair),
            Self::HighFirst => u16::from_be_bytes(*pair),
        })
    }
}

/// The order of the bytes of a text in UTF-16; none if it is no such text.
fn utf16(head: &[u8]) -> Option<ByteOrder> {
    if head.starts_with(&[0xff, 0xfe]) {
        return Some(ByteOrder::LowFirst);
    }
    if head.starts_with(&[0xfe, 0xff]) {
        return Some(ByteOrder::HighFirst);
    }
    let letters = head.get(..WITHOUT_MARK)?.as_chunks::<2>().0;
    let is_ascii = |byte: u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    match () {
        () if letters.iter().all(|[low, high]| is_ascii(*low) && *high == 0) => Some(ByteOrder::LowFirst),
        () if letters.iter().all(|[high, low]| is_ascii(*low) && *high == 0) => Some(ByteOrder::HighFirst),
        () => None,
    }
}

/// The text in the bytes of a whole file in UTF-8 or UTF-16, without its mark; none if it is neither.
pub fn unicode_of(bytes: &[u8]) -> Option<String> {
    match utf16(bytes) {
        Some(order) => {
            let letters = char::decode_utf16(order.units(bytes)).collect::<Result<String, _>>();
            let text = letters.ok().filter(|_| bytes.len().is_multiple_of(2))?;
            Some(text.strip_prefix(MARK).unwrap_or(&text).to_owned())
        }
        None => std::str::from_utf8(bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes)).ok().map(str::to_owned),
    }
}

/// The text in the bytes of a whole file, without its mark. What is neither UTF-16 nor UTF-8 is Latin-1, in which every byte is a letter.
pub fn text_of(bytes: &[u8]) -> String {
    if is_utf16(bytes) {
        let mut text = Vec::new();
        // Reading from memory does not fail.
        let _ = Utf16::new(bytes.to_vec(), Box::new(io::empty())).read_to_end(&mut text);
        return String::from_utf8_lossy(&text).into_owned();
    }
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    std::str::from_utf8(bytes).map_or_else(|_| bytes.iter().map(|&byte| char::from(byte)).collect(), str::to_owned)
}

/// The same text in UTF-8, if it is UTF-16; every other text as it is.
///
/// # Errors
/// The first bytes cannot be read.
pub fn as_utf8(mut input: Box<dyn Read + Send>) -> io::Result<Box<dyn Read + Send>> {
    let mut head = Vec::with_capacity(WITHOUT_MARK);
    (&mut input).take(WITHOUT_MARK as u64).read_to_end(&mut head)?;
    Ok(if is_utf16(&head) { Box::new(Utf16::new(head, input)) } else { Box::new(io::Cursor::new(head).chain(input)) })
}

/// Reads a text in UTF-16, without its mark, as UTF-8. What is no letter becomes U+FFFD.
pub struct Utf16 {
    input: Box<dyn Read + Send>,
    order: ByteOrder,
    /// What was read and not decoded yet: parts of a letter.
    bytes: Vec<u8>,
    /// What was decoded, of which `given` bytes were given.
    text: String,
    given: usize,
    has_begun: bool,
    has_ended: bool,
}

impl Utf16 {
    /// The text of an input that begins with this head, of which [`is_utf16`] holds.
    pub fn new(head: Vec<u8>, rest: Box<dyn Read + Send>) -> Self {
        Self {
            order: utf16(&head).unwrap_or(ByteOrder::LowFirst),
            input: Box::new(io::Cursor::new(head).chain(rest)),
            bytes: Vec::new(),
            text: String::new(),
            given: 0,
            has_begun: false,
            has_ended: false,
        }
    }

    /// Decodes the whole letters in the bytes, at the end of the input all.
    fn decode(&mut self) {
        let units = || self.order.units(&self.bytes);
        let is_cut = !self.has_ended && units().next_back().is_some_and(|unit| (0xd800..0xdc00).contains(&unit));
        let whole = self.bytes.len() / 2 - usize::from(is_cut);
        self.text.clear();
        self.given = 0;
        let letters = char::decode_utf16(units().take(whole));
        self.text.extend(letters.map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER)));
        if !self.has_begun && self.text.starts_with(MARK) {
            self.given = MARK.len_utf8();
        }
        self.has_begun |= whole > 0;
        self.bytes.drain(..2 * whole);
        if self.has_ended && !self.bytes.is_empty() {
            self.text.push(char::REPLACEMENT_CHARACTER);
        }
    }
}

impl Read for Utf16 {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        while self.given == self.text.len() && !self.has_ended {
            let mut read = [0; AT_ONCE];
            let count = self.input.read(&mut read)?;
            self.has_ended = count == 0;
            self.bytes.extend_from_slice(&read[..count]);
            self.decode();
        }
        let left = &self.text.as_bytes()[self.given..];
        let count = left.len().min(bytes.len());
        bytes[..count].copy_from_slice(&left[..count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives one byte at a time.
    struct Slow(io::Cursor<Vec<u8>>);

    impl Read for Slow {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            let maximum = bytes.len().min(1);
            self.0.read(&mut bytes[..maximum])
        }
    }

    #[test]
    fn a_text_is_the_same_in_both_orders_of_its_bytes_and_however_it_comes() {
        let text: String = "time;Öl °C;😀\r\n".repeat(400);
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes: Vec<u8> = std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(order).collect();
            for head in [2, 3, 1000, bytes.len()] {
                let rest = Box::new(Slow(io::Cursor::new(bytes[head..].to_vec())));
                let mut read = String::new();
                Utf16::new(bytes[..head].to_vec(), rest).read_to_string(&mut read).unwrap();
                assert!(read == text, "{head}");
            }
            // Half a letter at the end.
            let mut read = String::new();
            Utf16::new(bytes[..5].to_vec(), Box::new(io::empty())).read_to_string(&mut read).unwrap();
            assert_eq!(read, "t\u{fffd}");
        }
    }
    #[test]
    fn a_whole_text_is_the_same_in_every_encoding() {
        let text = "name = \"Öl °C\"\r\n";
        let wide = |order: fn(u16) -> [u8; 2], mark: bool| {
            let mark = mark.then_some(0xfeff);
            mark.into_iter().chain(text.encode_utf16()).flat_map(order).collect::<Vec<u8>>()
        };
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            assert_eq!(text_of(&wide(order, true)), text);
            assert_eq!(text_of(&wide(order, false)), text);
            let mut read = String::new();
            as_utf8(Box::new(Slow(io::Cursor::new(wide(order, false))))).unwrap().read_to_string(&mut read).unwrap();
            assert_eq!(read, text);
        }
        assert_eq!(text_of(text.as_bytes()), text);
        assert_eq!(text_of(&[BYTE_ORDER_MARK, text.as_bytes()].concat()), text);
        let latin: Vec<u8> = text.chars().map(|letter| letter as u8).collect();
        assert_eq!(text_of(&latin), text);
        // Bytes of other formats, and texts that end early.
        for other in [&b"MDF     4.10"[..], b"LOGG\x90\0\0\0", b"PAR1\x15\0\x15\0", b"a\0b\0", b"", b"\xff"] {
            assert!(!is_utf16(other), "{other:?}");
        }
    }
}
