//! What a filter has learnt, as words that a controller keeps while the ignition is off.

use observer::gearbox::{LEARNT, Learnt};

use crate::crc::crc32;
use crate::image::{FORMAT_VERSION, Header};
use crate::words::{Layout as _, Words};

/// The first word: "WCLL", the lowest byte first.
const MAGIC: u32 = u32::from_le_bytes(*b"WCLL");
/// Magic, version, checksum, elements, gears, shifts.
const HEADER_WORDS: usize = 6;
const CHECKSUM_AT: usize = 2;
/// Words of what is learnt: means, one half of the covariance with its diagonal, two counts, odds, and the temperature of the oil.
pub const LEARNT_WORDS: usize = HEADER_WORDS + LEARNT + LEARNT * (LEARNT + 1) / 2 + 5;

/// What is learnt, as words.
pub type LearntWords = [u32; LEARNT_WORDS];

/// What is learnt of the gearbox of an image.
pub(crate) fn write(learnt: &Learnt<f32>, header: &Header, into: &mut LearntWords) {
    let of_header = [MAGIC, FORMAT_VERSION, 0, header.elements, header.gears, header.shifts];
    let halves = learnt.covariance.iter().enumerate().flat_map(|(i, row)| row.iter().take(i + 1));
    let oil = [u32::from(learnt.oil_degc.is_some()), learnt.oil_degc.unwrap_or_default().to_bits()];
    let words = (of_header.into_iter())
        .chain(learnt.mean.iter().chain(halves).map(|value| value.to_bits()))
        .chain([learnt.shifts, u32::from(learnt.refused), learnt.odds.to_bits()])
        .chain(oil);
    into.iter_mut().zip(words).for_each(|(place, word)| *place = word);
    into[CHECKSUM_AT] = checksum(into);
}

fn checksum(words: &LearntWords) -> u32 {
    crc32(words.iter().enumerate().filter(|(at, _)| *at != CHECKSUM_AT).map(|(_, word)| *word))
}

/// Reads it again; `None` if it is of another version or gearbox, damaged, or none that a filter can have.
#[expect(clippy::needless_range_loop, reason = "a matrix and its transpose")]
pub(crate) fn read(from: &LearntWords, header: &Header) -> Option<Learnt<f32>> {
    let mut words = Words::new(from);
    for expected in [MAGIC, FORMAT_VERSION, checksum(from), header.elements, header.gears, header.shifts] {
        (words.whole()? == expected).then_some(())?;
    }
    let mean = <[f32; LEARNT]>::take(&mut words)?;
    let mut covariance = [[0.0; LEARNT]; LEARNT];
    for i in 0..LEARNT {
        for j in 0..=i {
            let value = words.real()?;
            (covariance[i][j], covariance[j][i]) = (value, value);
        }
    }
    let (shifts, refused) = (words.whole()?, u8::try_from(words.whole()?).ok()?);
    let (odds, has_oil, oil_degc) = (words.real()?, bool::take(&mut words)?, words.real()?);
    Learnt { mean, covariance, shifts, refused, odds, oil_degc: has_oil.then_some(oil_degc) }.checked()
}
