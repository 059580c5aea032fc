//! The bits of a signal, and the number in them.

/// Where a signal stands in a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bits {
    pub(super) start: usize,
    pub(super) size: usize,
    pub(super) big_endian: bool,
}

/// What the bits of a signal are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    Unsigned,
    Signed,
    Float,
    Double,
}

impl Number {
    /// The number in so many bits.
    // A double keeps 53 bits; a float has 32.
    pub(super) fn of(self, raw: u64, size: usize) -> f64 {
        match self {
            Self::Unsigned => raw as f64,
            Self::Signed => ((raw << (64 - size)).cast_signed() >> (64 - size)) as f64,
            Self::Float => f64::from(f32::from_bits(raw as u32)),
            Self::Double => f64::from_bits(raw),
        }
    }
}

impl Bits {
    /// The raw value; none if the frame ends before.
    pub(super) fn of(self, data: &[u8]) -> Option<u64> {
        let mut raw = 0_u64;
        let mut at = self.start;
        for i in 0..self.size {
            let bit = u64::from(data.get(at / 8)? >> (at % 8) & 1);
            if self.big_endian {
                raw = raw << 1 | bit;
                // To the next lower bit; from the lowest of a byte to the highest of the next byte.
                at = if at.is_multiple_of(8) { at + 15 } else { at - 1 };
            } else {
                raw |= bit << i;
                at += 1;
            }
        }
        Some(raw)
    }

    /// Whether a raw value has all of them.
    pub(super) fn all_set(self, raw: u64) -> bool {
        raw == u64::MAX >> (64 - self.size)
    }
}
