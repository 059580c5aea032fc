//! The checksum of images: CRC-32 as of Ethernet and ZIP (polynomial 0x04C11DB7, reflected).

/// Remainders of the 16 values of four bits.
const NIBBLES: [u32; 16] = nibbles();

const fn nibbles() -> [u32; 16] {
    let mut table = [0; 16];
    let mut at = 0;
    while at < table.len() {
        let (mut rest, mut bit) = (at as u32, 0);
        while bit < 4 {
            rest = if rest & 1 == 1 { (rest >> 1) ^ 0xedb8_8320 } else { rest >> 1 };
            bit += 1;
        }
        table[at] = rest;
        at += 1;
    }
    table
}

/// CRC-32 of words, each as four bytes, the lowest first.
pub fn crc32(words: impl Iterator<Item = u32>) -> u32 {
    let step = |crc: u32, nibble: u32| (crc >> 4) ^ NIBBLES[((crc ^ nibble) & 15) as usize];
    !words.fold(!0, |crc, word| (0..8).fold(crc, |crc, at| step(crc, word >> (4 * at))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_standard() {
        let digits = [*b"1234", *b"5678"].map(u32::from_le_bytes);
        // Of "12345678", as zlib computes it.
        assert_eq!(crc32(digits.into_iter()), 0x9ae0_daaf);
        assert_eq!(crc32(core::iter::empty()), 0);
    }
}
