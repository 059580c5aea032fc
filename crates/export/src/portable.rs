//! `wetclutch.c`: the observer for compilers that Rust has no target for.

use ecu::image::FORMAT_VERSION;

use crate::Image;
use crate::error::ExportError;

/// The C of the observer, the same for all cars, as `embedded/portable` makes it.
pub(crate) struct Portable<'a> {
    pub(crate) source: &'a [u8],
    /// First address behind its stack and constants.
    heap: usize,
}

impl<'a> Portable<'a> {
    /// Checks that a file is this C, for the images of this version.
    ///
    /// # Errors
    /// [`ExportError::CSource`].
    pub(crate) fn new(source: &'a [u8]) -> Result<Self, ExportError> {
        let wrong = |message: &str| ExportError::CSource(message.to_owned());
        let text = std::str::from_utf8(source).map_err(|_| wrong("it is not text"))?;
        let number = |name: &str| {
            let line =
                text.lines().find_map(|line| line.strip_prefix("#define ")?.strip_prefix(name)?.strip_prefix(' '));
            line.and_then(|value| value.trim_end().strip_suffix('u')?.parse::<usize>().ok())
        };
        let (Some(heap), Some(version)) = (number("HEAP"), number("IMAGE_VERSION")) else {
            return Err(wrong("it defines neither HEAP nor IMAGE_VERSION"));
        };
        if version != FORMAT_VERSION as usize {
            return Err(ExportError::CSource(format!(
                "it takes images of version {version}, and this program writes version {FORMAT_VERSION}"
            )));
        }
        Ok(Self { source, heap })
    }

    /// Memory that is enough for a car, bytes: stack and constants, what is passed, the observer, and the image or what was learnt.
    pub(crate) fn memory_bytes(&self, image: &Image) -> usize {
        let passed = size_of::<ecu::Input>() + size_of::<ecu::Estimate>();
        let last = (4 * image.words.len()).max(size_of::<ecu::LearntWords>());
        // The observer needs more on a machine of 64 bits than in this C.
        (self.heap + passed + image.memory_bytes + last).next_multiple_of(8) + ecu::memory::ALIGNMENT
    }
}
