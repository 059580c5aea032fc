//! Numbers in the plain form that tables mostly have: a sign or none, up to seven digits, and a point with digits behind it or none.
//!
//! Eight digits are read at once: each byte of a word holds one of them, the first one the lowest. What has another form is left to
//! a library, which gives the very same number for this form too.

/// The number in a cell of the plain form; none in any other form.
#[inline]
pub(super) fn plain(cell: &[u8]) -> Option<f64> {
    let (is_negative, text) = match cell {
        [b'-', text @ ..] => (true, text),
        text => (false, text),
    };
    let (first, last) = ends(text)?;
    let whole = first_point(first).min(text.len());
    // None behind the point, or behind a whole number.
    let places = text.len() - (whole + 1).min(text.len());
    if !(1..=7).contains(&whole) || places > 16 || whole + places > MAX_DIGITS {
        return None;
    }
    let digits = if places == 0 {
        beginning(first, whole)?
    } else if places <= 8 {
        let (power, last) = (POWERS[places], ending(last, places)?);
        beginning(first, whole)? * power + last
    } else {
        // What the last eight leave of the places.
        let between = places - 8;
        let middle = beginning(word(text.get(whole + 1..)?.first_chunk()?), between)?;
        (beginning(first, whole)? * POWERS[between] + middle) * POWERS[8] + ending(last, 8)?
    };
    let size = quotient(digits, places);
    Some(if is_negative { -size } else { size })
}

/// As many digits never make a number that is too large for 64 bits.
const MAX_DIGITS: usize = 19;

/// Powers of ten.
const POWERS: [u64; MAX_DIGITS] = {
    let mut powers = [1; MAX_DIGITS];
    let mut at = 1;
    while at < MAX_DIGITS {
        powers[at] = 10 * powers[at - 1];
        at += 1;
    }
    powers
};

/// A byte in each place of a word.
const EACH: u64 = 0x0101_0101_0101_0101;

#[inline(always)]
fn word(bytes: &[u8; 8]) -> u64 {
    u64::from_le_bytes(*bytes)
}

/// The first eight letters and the last eight. Of a shorter text, zeros stand behind it and before it.
#[inline(always)]
fn ends(text: &[u8]) -> Option<(u64, u64)> {
    if let (Some(first), Some(last)) = (text.first_chunk(), text.last_chunk()) {
        return Some((word(first), word(last)));
    }
    let first = if let (Some(first), Some(last)) = (text.first_chunk(), text.last_chunk()) {
        u64::from(u32::from_le_bytes(*first)) | u64::from(u32::from_le_bytes(*last)) << (8 * (text.len() - 4))
    } else {
        let (middle, last) = (text.len() / 2, text.len().checked_sub(1)?);
        let at = |place: usize| u64::from(text[place]) << (8 * place);
        at(0) | at(middle) | at(last)
    };
    Some((first, first << (8 * (8 - text.len()))))
}

/// The place of the first point among eight letters; 8 without one.
#[inline(always)]
fn first_point(letters: u64) -> usize {
    let differs = letters ^ (EACH * b'.' as u64);
    // The lowest mark is of a byte that is zero; higher ones need not be.
    let marks = differs.wrapping_sub(EACH) & !differs & (0x80 * EACH);
    (marks.trailing_zeros() / 8) as usize
}

/// The number of the first so many of eight letters, at most 8; none if they are not all digits.
#[inline(always)]
fn beginning(letters: u64, count: usize) -> Option<u64> {
    // Zeros stand before them; what is behind them leaves the word. In two steps, as there may be nothing to keep.
    let half = 32 - 4 * count;
    number(letters.wrapping_sub(EACH * b'0' as u64) << half << half)
}

/// The number of the last so many of eight letters, from 1 to 8; none if they are not all digits.
#[inline(always)]
fn ending(letters: u64, count: usize) -> Option<u64> {
    let kept = u64::MAX << (64 - 8 * count);
    number((letters ^ (EACH * b'0' as u64)) & kept)
}

/// The number of eight digits, each a byte; none if a byte is none.
#[inline(always)]
fn number(digits: u64) -> Option<u64> {
    if (digits.wrapping_add(EACH * (0x80 - 10)) | digits) & (0x80 * EACH) != 0 {
        return None;
    }
    const PAIR: u64 = 0x0000_00ff_0000_00ff;
    let pairs = digits * 10 + (digits >> 8);
    let [even, odd] = [pairs & PAIR, (pairs >> 16) & PAIR];
    let sum = even.wrapping_mul(100 + (1_000_000 << 32)).wrapping_add(odd.wrapping_mul(1 + (10_000 << 32)));
    Some(sum >> 32)
}

/// The digits over a power of ten, rounded once to the nearest number.
#[inline(always)]
// Whole, or rounded once.
fn quotient(digits: u64, places: usize) -> f64 {
    let power = POWERS[places];
    if digits >> f64::MANTISSA_DIGITS == 0 {
        return digits.cast_signed() as f64 / power.cast_signed() as f64;
    }
    // The highest bit of both is set. Their quotient times 2^62 has from 61 to 63 bits: more than a number keeps. The lowest one says, too,
    // whether something is left over.
    let (above, below) = (digits << digits.leading_zeros(), power << power.leading_zeros());
    let (whole, rest) = divided(above >> 2, above << 62, below, RECIPROCALS[places]);
    let shift = 62 + digits.leading_zeros() - power.leading_zeros();
    (whole | u64::from(rest != 0)).cast_signed() as f64 * f64::from_bits(u64::from(1023 - shift) << 52)
}

/// Reciprocals of the powers of ten whose highest bit was moved to the highest place: of each, what is above `2^64` of the whole part of
/// `(2^128 - 1) / power`.
const RECIPROCALS: [u64; MAX_DIGITS] = {
    let mut reciprocals = [0; MAX_DIGITS];
    let mut at = 0;
    while at < MAX_DIGITS {
        let power = POWERS[at] << POWERS[at].leading_zeros();
        // The part above 2^64 is 1.
        let above = (u128::MAX / power as u128) as u64;
        reciprocals[at] = above;
        at += 1;
    }
    reciprocals
};

/// Whole part and rest of `2^64 high + low` over a number with its highest bit set, of which `high` is less. With the number's reciprocal
/// it takes two multiplications in place of a division: N. Moeller and T. Granlund, "Improved division by invariant integers" (2011),
/// algorithm 4.
#[inline(always)]
fn divided(high: u64, low: u64, by: u64, reciprocal: u64) -> (u64, u64) {
    let guess = u128::from(reciprocal) * u128::from(high) + (u128::from(high) << 64 | u128::from(low));
    // Its two halves.
    let (whole, fraction) = (((guess >> 64) as u64).wrapping_add(1), guess as u64);
    let rest = low.wrapping_sub(whole.wrapping_mul(by));
    // The guess is too large by one more often than not, and very seldom too small.
    let is_large = rest > fraction;
    let (whole, rest) = (whole.wrapping_sub(u64::from(is_large)), rest.wrapping_add(if is_large { by } else { 0 }));
    if rest >= by { (whole.wrapping_add(1), rest - by) } else { (whole, rest) }
}

#[cfg(test)]
mod tests {
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::Rng as _;

    use super::*;

    #[test]
    fn a_number_is_that_of_the_library_to_the_last_bit() {
        let mut random_bits = Pcg64Mcg::new(1);
        let mut plain_ones = 0;
        for i in 0..400_000_u64 {
            let random = random_bits.next_u64();
            let number = f64::from_bits(random >> 12 | 0x3ff0_0000_0000_0000) - 1.0;
            let size = [0.001, 0.1, 1.0, 70.0, 5e3, 1e6][(random % 6) as usize];
            let places = (random >> 8) as usize % 18;
            let text = if i % 2 == 0 { format!("{}", number * size) } else { format!("-{:.places$}", number * size) };
            let Some(found) = plain(text.as_bytes()) else { continue };
            plain_ones += 1;
            assert_eq!(found.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{text}");
        }
        assert!(plain_ones > 200_000, "{plain_ones}");
    }

    #[test]
    fn all_digits_near_the_middle_between_two_numbers_round_to_the_right_one() {
        // Numbers from 2^53 times a power of ten on: the digits of a middle between two of them, more, and less.
        let mut random_bits = Pcg64Mcg::new(1);
        for _ in 0..100_000 {
            let places = random_bits.next_u64() % 11 + 1;
            let number = 4096.0 * f64::from_bits(random_bits.next_u64() >> 12 | 0x3ff0_0000_0000_0000);
            let middle = format!("{:.1$}", number + 0.5 * f64::EPSILON * 4096.0, 3 + places as usize);
            for digit in ["", "1", "9"] {
                let text = format!("{middle}{digit}");
                if let Some(found) = plain(text.as_bytes()) {
                    assert_eq!(found.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{text}");
                }
            }
        }
        // The most digits, and the first ones that are more than a number keeps. No middle between two numbers has so few digits.
        for text in [
            "123.4567890123456789",
            "9999999.999999999999",
            "1.0000000000000000",
            "-0.000000000000000",
            "9.0071992547409935",
        ] {
            assert_eq!(plain(text.as_bytes()).unwrap().to_bits(), text.parse::<f64>().unwrap().to_bits(), "{text}");
        }
    }

    #[test]
    fn a_quotient_by_a_reciprocal_is_that_of_a_division() {
        let mut random_bits = Pcg64Mcg::new(3);
        for i in 0..400_000 {
            let at = i % MAX_DIGITS;
            let by = POWERS[at] << POWERS[at].leading_zeros();
            let random = random_bits.next_u64();
            // Near the ends and near multiples too.
            let high = [0, by - 1, random % by, (by - 1) & random][i / MAX_DIGITS % 4];
            let low = [0, u64::MAX, random_bits.next_u64(), random << 62][i / 7 % 4];
            let number = u128::from(high) << 64 | u128::from(low);
            let expected = (number / u128::from(by), number % u128::from(by));
            let (whole, rest) = divided(high, low, by, RECIPROCALS[at]);
            assert_eq!((u128::from(whole), u128::from(rest)), expected, "{number} over {by}");
        }
    }

    #[test]
    fn short_numbers_are_plain_too() {
        let cases = [
            ("0", 0.0),
            ("7.", 7.0),
            ("-1", -1.0),
            ("1.5", 1.5),
            ("123", 123.0),
            ("0.003", 0.003),
            ("9999999", 9_999_999.0),
            ("1234567.", 1_234_567.0),
        ];
        for (text, number) in cases {
            assert_eq!(plain(text.as_bytes()), Some(number), "{text}");
        }
    }

    #[test]
    fn any_other_form_is_left_to_the_library() {
        let others = [
            "",
            "-",
            ".",
            "12345678",
            "12345678.5",
            ".1234567",
            "1234.5e3",
            "12.34567e-3",
            "+12.345678",
            "--12.34567",
            "12.345.678",
            "12,345678",
            "12.34567 ",
            " 12.34567",
            "1234567.1234567890123",
            "0x12.345678",
            "12_345.678",
            "12.3456/8",
            "12.3456:8",
            "1/3.456789",
            "1:3.456789",
            "12.-456789",
            "\u{e9}12.3456789",
            "12.345678\u{ff10}",
            "infinity",
            "0.0000000000000000001",
            ".5",
            "-.5",
            "1e5",
            "nan",
            "1 ",
            " 1",
            "+1",
            "1,5",
        ];
        for text in others {
            assert_eq!(plain(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn whatever_is_taken_has_only_digits_a_sign_and_a_point() {
        const LETTERS: &[u8] = b"0123456789.-+e,/: \x00\x7f\x80\xff";
        let mut random_bits = Pcg64Mcg::new(7);
        for _ in 0..300_000 {
            let mut cell = *b"-12.345678901234567";
            for _ in 0..random_bits.next_u64() % 3 {
                let random = random_bits.next_u64();
                cell[random as usize % 19] = LETTERS[(random >> 32) as usize % LETTERS.len()];
            }
            let random = random_bits.next_u64() as usize;
            let cell = &cell[random % 2..19 - random / 2 % 18];
            if let Some(found) = plain(cell) {
                let text = std::str::from_utf8(cell).unwrap();
                assert!(!text.contains(['e', '+']), "{text}");
                assert_eq!(found.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{text}");
            }
        }
    }
}
