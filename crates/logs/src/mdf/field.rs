//! Where a number is in a record, and its decoding for many records at once.

use half::f16;

use falcon_mdf::blocks::channel::{ChannelType, DataType};
use falcon_mdf::{Channel as MdfChannel, ChannelGroup, Conversion};

use super::conversion::{is_by_text, keeps_numbers, unreadable};
use super::records::Window;
use crate::columns::{Column, are_finite};
use crate::samples::Quality;

/// Records that are decoded at once: what is between the steps stays in the first cache.
const TILE: usize = 1024;

/// Memory for the words of so many records: four quarters, two halves, the whole.
pub(super) struct Tile {
    quarters: [[u16; TILE]; 4],
    halves: [[u32; TILE]; 2],
    whole: [u64; TILE],
}

impl Tile {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self { quarters: [[0; TILE]; 4], halves: [[0; TILE]; 2], whole: [0; TILE] })
    }
}

/// What the bits of a number mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// It is not in the record: the number of the record, from zero.
    Index,
    Unsigned,
    Signed,
    Float,
}

/// Which records have no valid number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Invalid {
    Never,
    Always,
    /// Those with this bit of this byte of the record.
    Bit(usize, u32),
}

/// A number in the records of a group.
#[derive(Debug)]
pub(super) struct Field<'a> {
    /// First byte in the record, and the bytes that it touches.
    at: usize,
    bytes: usize,
    big_endian: bool,
    /// Bits below it in the lowest byte, and its own.
    shift: u32,
    bits: u32,
    kind: Kind,
    invalid: Invalid,
    conversion: &'a Conversion,
    /// Whether no bits make another value than a finite one.
    is_always_finite: bool,
}

/// A call of [`Field::decode_tiles`], to be compiled for several kinds of processor.
struct Decode<'d> {
    field: &'d Field<'d>,
    records: &'d Window<'d>,
    tile: &'d mut Tile,
    values: &'d mut Vec<f64>,
}

impl pulp::WithSimd for Decode<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.field.decode_tiles(self.records, self.tile, self.values);
    }
}

impl<'a> Field<'a> {
    /// The number of a channel in the records of its group, which begin with `id_bytes` of an identifier. None where it is not a plain
    /// number at a fixed place: the library must decode it.
    pub(super) fn of(channel: &'a MdfChannel, group: &ChannelGroup, id_bytes: usize) -> Option<Self> {
        if channel.is_array() || channel.unreadable().is_some() {
            return None;
        }
        let kind = match (channel.channel_type, channel.data_type) {
            (ChannelType::VirtualMaster | ChannelType::VirtualData, _) => Kind::Index,
            (ChannelType::FixedLength | ChannelType::Master, DataType::UIntLe | DataType::UIntBe) => Kind::Unsigned,
            (ChannelType::FixedLength | ChannelType::Master, DataType::IntLe | DataType::IntBe) => Kind::Signed,
            (ChannelType::FixedLength | ChannelType::Master, DataType::FloatLe | DataType::FloatBe) => Kind::Float,
            _ => return None,
        };
        let (shift, bits) = (u32::from(channel.bit_offset), channel.bit_count);
        let has_place = shift < 8 && (1..=64).contains(&(shift + bits)) && bits > 0;
        let is_whole = kind != Kind::Float || (shift == 0 && matches!(bits, 16 | 32 | 64));
        if kind != Kind::Index && !(has_place && is_whole) {
            return None;
        }
        let bytes = if kind == Kind::Index { 0 } else { (shift + bits).div_ceil(8) as usize };
        let byte = usize::try_from(channel.byte_offset).ok()?;
        let is_inside = kind == Kind::Index || byte.checked_add(bytes)? <= group.payload_size();
        let is_known = is_inside && unreadable(&channel.conversion).is_none() && !is_by_text(&channel.conversion);
        let bit = channel.inval_bit_pos;
        let invalid = match (bit / 8) as usize {
            _ if channel.all_invalid => Invalid::Always,
            byte if channel.invalidation_bit && byte < group.inval_bytes_len() => {
                Invalid::Bit(id_bytes + group.data_bytes_len() + byte, bit % 8)
            }
            _ => Invalid::Never,
        };
        is_known.then_some(Self {
            at: id_bytes + byte,
            bytes,
            big_endian: !channel.is_little_endian(),
            shift,
            bits,
            kind,
            invalid,
            conversion: &channel.conversion,
            is_always_finite: kind != Kind::Float
                && match channel.conversion {
                    Conversion::None => true,
                    // Far from where a number of 64 bits makes too large a one.
                    Conversion::Linear { offset, factor } => offset.abs() < 1e100 && factor.abs() < 1e100,
                    _ => false,
                },
        })
    }

    /// Appends the numbers of some records, and what they are worth.
    pub(super) fn fill(&self, records: &Window<'_>, tile: &mut Tile, column: &mut Column) {
        let first = column.values.len();
        self.decode(records, tile, &mut column.values);
        let is_finite = self.is_always_finite || are_finite(&column.values[first..]);
        let invalid = match self.invalid {
            Invalid::Bit(at, bit) => Some((at, bit)),
            Invalid::Never => None,
            Invalid::Always => {
                column.qualities_from(first).resize(first + records.count, Some(Quality::Invalid));
                return;
            }
        };
        if is_finite && invalid.is_none() {
            column.all_good();
            return;
        }
        // A reading that did not come, as in a table: one without a value in its table of conversion is missing.
        let is_table = self.kind == Kind::Float && matches!(self.conversion, Conversion::None);
        let of = |value: &f64| match value.is_finite() {
            true => Some(Quality::Good),
            false => (!(is_table && value.is_nan())).then_some(Quality::Missing),
        };
        let worth: Vec<_> = column.values[first..].iter().map(of).collect();
        let qualities = column.qualities_from(first);
        qualities.extend(worth);
        if let Some((at, bit)) = invalid {
            for (i, quality) in qualities[first..].iter_mut().enumerate() {
                if records.byte(i, at) >> bit & 1 == 1 {
                    *quality = Some(Quality::Invalid);
                }
            }
        }
    }

    /// Appends the numbers of some records, with the widest words of the processor.
    pub(super) fn decode(&self, records: &Window<'_>, tile: &mut Tile, values: &mut Vec<f64>) {
        pulp::Arch::new().dispatch(Decode { field: self, records, tile, values });
    }

    // All that this calls is compiled for several kinds of processor, and therefore always inlined.
    #[inline(always)]
    fn decode_tiles(&self, records: &Window<'_>, tile: &mut Tile, values: &mut Vec<f64>) {
        values.reserve(records.count);
        for from in (0..records.count).step_by(TILE) {
            let count = TILE.min(records.count - from);
            match (self.kind, self.bytes) {
                (Kind::Index, _) => {
                    let first = records.index + from as u64;
                    self.convert((first..).take(count).map(|index| index as f64), values);
                }
                (_, 0..=2) => self.short(self.quarter(records, from, 0, &mut tile.quarters[0][..count]), values),
                (_, 3..=4) => {
                    let [low, high, ..] = &mut tile.quarters;
                    self.middle(self.half(records, from, 0, [low, high], &mut tile.halves[0][..count]), values);
                }
                _ => self.long(self.whole(records, from, count, tile), values),
            }
        }
    }

    /// Its bytes of this weight and the next one, of the records from `from` on.
    #[inline(always)]
    fn quarter<'w>(&self, records: &Window<'_>, from: usize, weight: usize, words: &'w mut [u16]) -> &'w [u16] {
        let place = |weight: usize| {
            let is_there = weight < self.bytes;
            is_there.then(|| self.at + if self.big_endian { self.bytes - 1 - weight } else { weight })
        };
        records.pair(from, [weight, weight + 1].map(place), words);
        words
    }

    /// Its four bytes from this weight on.
    #[inline(always)]
    fn half<'w>(
        &self,
        records: &Window<'_>,
        from: usize,
        weight: usize,
        [low, high]: [&mut [u16; TILE]; 2],
        words: &'w mut [u32],
    ) -> &'w [u32] {
        match (self.bytes, self.big_endian) {
            (4, false) if records.gather(from, self.at, words, u32::from_le_bytes) => {}
            (4, true) if records.gather(from, self.at, words, u32::from_be_bytes) => {}
            _ => {
                let low = self.quarter(records, from, weight, &mut low[..words.len()]);
                let high = self.quarter(records, from, weight + 2, &mut high[..words.len()]);
                for (word, (low, high)) in words.iter_mut().zip(low.iter().zip(high)) {
                    *word = u32::from(*high) << 16 | u32::from(*low);
                }
            }
        }
        words
    }

    /// All its bytes.
    #[inline(always)]
    fn whole<'w>(&self, records: &Window<'_>, from: usize, count: usize, tile: &'w mut Tile) -> &'w [u64] {
        let words = &mut tile.whole[..count];
        match (self.bytes, self.big_endian) {
            (8, false) if records.gather(from, self.at, words, u64::from_le_bytes) => {}
            (8, true) if records.gather(from, self.at, words, u64::from_be_bytes) => {}
            _ => {
                let [one, two, three, four] = &mut tile.quarters;
                let [low, high] = &mut tile.halves;
                let low = self.half(records, from, 0, [one, two], &mut low[..count]);
                let high = self.half(records, from, 4, [three, four], &mut high[..count]);
                for (word, (low, high)) in words.iter_mut().zip(low.iter().zip(high)) {
                    *word = u64::from(*high) << 32 | u64::from(*low);
                }
            }
        }
        words
    }

    /// Numbers of at most 16 bits.
    #[inline(always)]
    fn short(&self, words: &[u16], values: &mut Vec<f64>) {
        let (up, down) = (16 - self.bits - self.shift, 16 - self.bits);
        match self.kind {
            Kind::Float => self.convert(words.iter().map(|word| f16::from_bits(*word).to_f64()), values),
            Kind::Signed => {
                self.convert(words.iter().map(|word| f64::from((word << up).cast_signed() >> down)), values)
            }
            _ => self.convert(words.iter().map(|word| f64::from((word << up) >> down)), values),
        }
    }

    /// Numbers of at most 32 bits.
    #[inline(always)]
    fn middle(&self, words: &[u32], values: &mut Vec<f64>) {
        let (up, down) = (32 - self.bits - self.shift, 32 - self.bits);
        match self.kind {
            Kind::Float => self.convert(words.iter().map(|word| f64::from(f32::from_bits(*word))), values),
            Kind::Signed => {
                self.convert(words.iter().map(|word| f64::from((word << up).cast_signed() >> down)), values)
            }
            // A number below 2^31 is the same with a sign, which the processor converts many at once.
            _ if self.bits < 32 => {
                self.convert(words.iter().map(|word| f64::from(((word << up) >> down).cast_signed())), values);
            }
            _ => self.convert(words.iter().map(|word| f64::from(*word)), values),
        }
    }

    /// Numbers of at most 64 bits.
    #[inline(always)]
    fn long(&self, words: &[u64], values: &mut Vec<f64>) {
        let (up, down) = (64 - self.bits - self.shift, 64 - self.bits);
        match self.kind {
            Kind::Float => self.convert(words.iter().map(|word| f64::from_bits(*word)), values),
            Kind::Signed => self.convert(words.iter().map(|word| ((word << up).cast_signed() >> down) as f64), values),
            _ => self.convert(words.iter().map(|word| ((word << up) >> down) as f64), values),
        }
    }

    /// Applies the conversion; where it makes only text, the numbers before it.
    #[inline(always)]
    fn convert(&self, numbers: impl Iterator<Item = f64>, values: &mut Vec<f64>) {
        match self.conversion {
            Conversion::None => values.extend(numbers),
            Conversion::Linear { offset, factor } => values.extend(numbers.map(|number| factor * number + offset)),
            other if keeps_numbers(other) => values.extend(numbers),
            other => {
                let is_float = self.kind == Kind::Float;
                values.extend(numbers.map(|number| other.convert(number, is_float)));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use falcon_mdf::write::WriteCodec;
    use falcon_mdf::{Mf4File, Mf4Writer, SignalValues};
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::{Rng, SeedableRng};

    use super::super::blocks::Blocks;
    use super::super::bytes::Bytes;
    use super::super::group::numbers;
    use super::super::records::Records;
    use super::*;
    use crate::ahead::Crew;
    use crate::columns::Memory;

    /// Records of a time and sixteen random bytes.
    fn random(codec: Option<WriteCodec>) -> (Mf4File, Arc<Blocks>) {
        let mut generator = Pcg64Mcg::seed_from_u64(7);
        let times: Vec<f64> = (0..3 * TILE + 5).map(|i| i as f64).collect();
        let mut writer = Mf4Writer::new();
        writer.set_compression(codec.is_some());
        writer.set_codec(codec.unwrap_or_default());
        let group = writer.add_group(&times).unwrap();
        for name in ["one", "two"] {
            let words = SignalValues::U64(times.iter().map(|_| generator.next_u64()).collect());
            group.add_channel_typed_with(name, "", words, None, None).unwrap();
        }
        let path = std::env::temp_dir().join(format!("wetclutch-fields-{}.mf4", std::process::id()));
        writer.write_to_file(&path).unwrap();
        let open = (Mf4File::open(&path).unwrap(), Arc::new(Blocks::new(Bytes::open(&path, None).unwrap())));
        let _ = std::fs::remove_file(path);
        open
    }

    #[test]
    fn numbers_of_every_kind_and_place_are_those_of_the_library() {
        use DataType::{FloatBe, FloatLe, IntBe, IntLe, UIntBe, UIntLe};
        let conversions = [
            Conversion::None,
            Conversion::Linear { offset: -3.0, factor: 0.25 },
            Conversion::Rational { coefficients: [0.0, 2.0, 6.0, 0.0, 0.0, 4.0] },
        ];
        let mut generator = Pcg64Mcg::seed_from_u64(8);
        let mut tile = Tile::new();
        let crew = Crew::of(1);
        for codec in [None, Some(WriteCodec::Deflate), Some(WriteCodec::TransposedDeflate)] {
            let (file, blocks) = random(codec);
            let data = &file.data_groups()[0];
            let group = &data.channel_groups[0];
            let mut compared = 0;
            for case in 0..600 {
                let mut channel = group.channels[1].clone();
                channel.data_type = [UIntLe, UIntBe, IntLe, IntBe, FloatLe, FloatBe][case % 6];
                let is_float = channel.is_float();
                channel.bit_count =
                    if is_float { 32 + 32 * (generator.next_u32() % 2) } else { 1 + generator.next_u32() % 64 };
                channel.bit_offset = if is_float { 0 } else { (generator.next_u32() % 8) as u8 };
                channel.byte_offset = generator.next_u32() % 24;
                channel.conversion = conversions[case / 6 % 3].clone();
                let Some(field) = Field::of(&channel, group, 0) else { continue };
                let mut records = Records::of(&blocks, &crew, data, group).unwrap();
                let (mut memory, mut found) = (Memory::default(), Vec::new());
                // Some records at once, of which the last are fewer.
                loop {
                    let count = records.ready(&mut memory).unwrap().min(TILE + 3);
                    if count == 0 {
                        break;
                    }
                    field.decode(&records.take(count, &memory), &mut tile, &mut found);
                }
                let expected = numbers(&file.signal(&channel).unwrap()).unwrap();
                let is_same =
                    |(one, other): (&f64, &f64)| one.to_bits() == other.to_bits() || one.is_nan() && other.is_nan();
                assert_eq!(found.len(), expected.len());
                assert!(found.iter().zip(&expected).all(is_same), "{codec:?} {field:?}");
                compared += 1;
            }
            assert!(compared > 300, "{compared}");
        }
    }
}
