//! Text in UTF-16 as UTF-8.

use std::io::{self, Read};

use encoding_rs::{Decoder, UTF_16BE, UTF_16LE};

/// Bytes that are read at once.
const AT_ONCE: usize = 8 << 10;

/// Whether a text begins with the mark of UTF-16.
pub(crate) fn is_utf16(head: &[u8]) -> bool {
    head.starts_with(&[0xff, 0xfe]) || head.starts_with(&[0xfe, 0xff])
}

/// Reads a text in UTF-16, without its mark, as UTF-8. What is no letter becomes U+FFFD.
pub(crate) struct Utf16 {
    input: Box<dyn Read>,
    decoder: Decoder,
    /// What was decoded: up to `filled`, of which `given` bytes were given.
    text: Vec<u8>,
    filled: usize,
    given: usize,
    has_ended: bool,
}

impl Utf16 {
    /// The text of an input that begins with this head.
    pub(crate) fn new(head: Vec<u8>, rest: Box<dyn Read>) -> Self {
        let encoding = if head.starts_with(&[0xff, 0xfe]) { UTF_16LE } else { UTF_16BE };
        Self {
            input: Box::new(io::Cursor::new(head).chain(rest)),
            decoder: encoding.new_decoder_with_bom_removal(),
            // Two bytes make at most three, and what the decoder holds back comes with them.
            text: vec![0; 2 * AT_ONCE],
            filled: 0,
            given: 0,
            has_ended: false,
        }
    }
}

impl Read for Utf16 {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        while self.given == self.filled && !self.has_ended {
            let mut read = [0; AT_ONCE];
            let count = self.input.read(&mut read)?;
            self.has_ended = count == 0;
            let (_, _, written, _) = self.decoder.decode_to_utf8(&read[..count], &mut self.text, self.has_ended);
            (self.filled, self.given) = (written, 0);
        }
        let left = &self.text[self.given..self.filled];
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
            let most = bytes.len().min(1);
            self.0.read(&mut bytes[..most])
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
}
