//! `wetclutch.c`: the observer for compilers that Rust has no target for.

use ecu::image::FORMAT_VERSION;

use crate::Image;
use crate::error::ExportError;

/// Its last line.
const END: &str = "/* The end of wetclutch.c. */";
/// The largest stack with constants, bytes: more than any controller has.
const MOST_BYTES: usize = 1 << 24;

/// The C of the observer, `wetclutch.c`, the same for all cars, as `embedded/portable` makes it.
#[derive(Debug, Clone)]
pub struct CSource {
    pub(crate) text: String,
    /// First address behind its stack and constants.
    heap: usize,
    /// Where its stack begins, bytes.
    pub(crate) stack: usize,
}

impl CSource {
    /// Checks that a file is this C, whole, and for the images of this version.
    ///
    /// # Errors
    /// [`ExportError::CSource`].
    pub fn new(source: Vec<u8>) -> Result<Self, ExportError> {
        let wrong = |message: &str| ExportError::CSource(message.to_owned());
        let text = String::from_utf8(source).map_err(|_| wrong("it is not text"))?;
        let number = |name: &str| {
            let line =
                text.lines().find_map(|line| line.strip_prefix("#define ")?.strip_prefix(name)?.strip_prefix(' '));
            line.and_then(|value| value.trim_end().strip_suffix('u')?.parse::<usize>().ok())
        };
        let [heap, stack, version] = ["HEAP", "STACK_BYTES", "IMAGE_VERSION"].map(number);
        let (Some(heap), Some(stack), Some(version)) = (heap, stack, version) else {
            return Err(wrong("it does not define HEAP, STACK_BYTES and IMAGE_VERSION"));
        };
        if text.trim_end().lines().last() != Some(END) || stack > heap || heap > MOST_BYTES {
            return Err(wrong("it is not whole"));
        }
        if version != FORMAT_VERSION as usize {
            return Err(ExportError::CSource(format!(
                "it takes images of version {version}, and this program writes version {FORMAT_VERSION}"
            )));
        }
        Ok(Self { text, heap, stack })
    }

    /// Memory that is enough for a car, bytes: stack and constants, what is passed, the observer, and the image or what was learnt.
    pub(crate) fn memory_bytes(&self, image: &Image) -> usize {
        let passed = size_of::<ecu::Input>() + size_of::<ecu::Estimate>();
        let last = (4 * image.words.len()).max(size_of::<ecu::LearntWords>());
        // The observer needs more on a machine of 64 bits than in this C.
        (self.heap + passed + image.memory_bytes + last).next_multiple_of(8) + ecu::memory::ALIGNMENT
    }
}
