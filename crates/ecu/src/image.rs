//! The image of a car: a header, then its parameters in the order of `layout.rs`.

use observer::GearboxFilter;
use observer::gearbox::{FrictionElement, GearRow, MAX_ELEMENTS, ShiftRow};

use crate::crc::crc32;
use crate::layout::Parameters;
use crate::status;
use crate::words::{Layout, Sink, Words};

/// The first word: "WCLT", the lowest byte first.
pub const MAGIC: u32 = u32::from_le_bytes(*b"WCLT");
/// Version of the layout.
pub const FORMAT_VERSION: u32 = 5;
/// Most gears and shifts of an image.
pub const MAX_GEARS: u32 = 32;
/// See [`MAX_GEARS`].
pub const MAX_SHIFTS: u32 = 512;

/// Place of the size and of the checksum among the words.
const SIZE_AT: usize = 2;
const CHECKSUM_AT: usize = 3;

/// The first words of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: u32,
    /// [`FORMAT_VERSION`].
    pub format_version: u32,
    /// Of the whole image.
    pub size_bytes: u32,
    /// CRC-32 of all other words.
    pub checksum: u32,
    /// Clutches and brakes with plates and valve.
    pub elements: u32,
    /// Gears.
    pub gears: u32,
    /// Shifts between two elements.
    pub shifts: u32,
    /// SHA-256 of the vehicle file, the first byte highest.
    pub vehicle_sha256: [u32; 8],
}

impl Header {
    fn put(&self, sink: &mut impl Sink) {
        sink.begin("header");
        self.magic.put("magic", sink);
        self.format_version.put("format_version", sink);
        self.size_bytes.put("size_bytes", sink);
        self.checksum.put("checksum", sink);
        self.elements.put("elements", sink);
        self.gears.put("gears", sink);
        self.shifts.put("shifts", sink);
        self.vehicle_sha256.put("vehicle_sha256", sink);
        sink.end();
    }

    /// Reads the header of an image and checks the whole image.
    ///
    /// # Errors
    /// A bit of the [`status`].
    pub fn of(image: &[u32]) -> Result<(Self, Words<'_>), u32> {
        let mut words = Words::new(image);
        let header = Self::take(&mut words).ok_or(status::IMAGE_SIZE)?;
        header.check(size_of_val(image), |of| of == checksum(image))?;
        Ok((header, words))
    }

    /// Checks the header of an image of so many bytes, whose checksum the caller knows.
    ///
    /// # Errors
    /// A bit of the [`status`].
    #[inline]
    pub fn check(&self, image_bytes: usize, is_checksum: impl FnOnce(u32) -> bool) -> Result<(), u32> {
        if self.magic != MAGIC {
            return Err(status::IMAGE_MAGIC);
        }
        if self.format_version != FORMAT_VERSION {
            return Err(status::IMAGE_VERSION);
        }
        if self.size_bytes as usize != image_bytes {
            return Err(status::IMAGE_SIZE);
        }
        if !is_checksum(self.checksum) {
            return Err(status::IMAGE_CHECKSUM);
        }
        let is_possible = self.elements <= MAX_ELEMENTS as u32 && self.gears <= MAX_GEARS;
        if !is_possible || self.shifts > MAX_SHIFTS {
            return Err(status::IMAGE_CONTENT);
        }
        Ok(())
    }

    fn take(words: &mut Words<'_>) -> Option<Self> {
        Some(Self {
            magic: words.whole()?,
            format_version: words.whole()?,
            size_bytes: words.whole()?,
            checksum: words.whole()?,
            elements: words.whole()?,
            gears: words.whole()?,
            shifts: words.whole()?,
            vehicle_sha256: Layout::take(words)?,
        })
    }
}

/// The checksum of an image: of all words but that of the checksum itself.
fn checksum(image: &[u32]) -> u32 {
    crc32(image.iter().enumerate().filter(|(at, _)| *at != CHECKSUM_AT).map(|(_, word)| *word))
}

/// Writes size and checksum into an image. Returns whether it is long enough to be one.
pub fn seal(image: &mut [u32]) -> bool {
    let (bytes, Some(size)) = (size_of_val(image), image.get_mut(SIZE_AT)) else { return false };
    *size = bytes as u32;
    let checksum = checksum(image);
    image.get_mut(CHECKSUM_AT).map(|word| *word = checksum).is_some()
}

/// Gives the words of a filter's image, which is still to be sealed.
pub fn put(filter: &GearboxFilter<'_, f32>, vehicle_sha256: [u32; 8], sink: &mut impl Sink) {
    let tables = &filter.tables;
    let header = Header {
        magic: MAGIC,
        format_version: FORMAT_VERSION,
        size_bytes: 0,
        checksum: 0,
        elements: tables.elements.len() as u32,
        gears: tables.gears.len() as u32,
        shifts: tables.shifts.len() as u32,
        vehicle_sha256,
    };
    header.put(sink);
    Parameters::of(filter).put("", sink);
    FrictionElement::put_all(tables.elements, "elements", sink);
    GearRow::put_all(tables.gears, "gears", sink);
    ShiftRow::put_all(tables.shifts, "shifts", sink);
}
