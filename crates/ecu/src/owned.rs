//! An observer with memory of its own, on a PC.

use alloc::vec;
use alloc::vec::Vec;

use crate::memory::{self, Observer};
use crate::status;

/// Memory with an observer.
#[derive(Debug, Clone)]
pub struct OwnedObserver {
    memory: Vec<u64>,
}

impl OwnedObserver {
    /// The observer of an image, with nothing learnt.
    ///
    /// # Errors
    /// Bits of the [`status`].
    pub fn new(image: &[u32]) -> Result<Self, u32> {
        let bytes = memory::size(image)?;
        let mut memory = vec![0_u64; bytes.div_ceil(size_of::<u64>())];
        // SAFETY: the memory is aligned, as large as this, and this function's own.
        unsafe { Observer::init(memory.as_mut_ptr().cast(), bytes, image)? };
        Ok(Self { memory })
    }

    /// The observer in it.
    ///
    /// # Errors
    /// [`status::NOT_INITIALISED`], which does not happen after [`Self::new`].
    pub fn get(&mut self) -> Result<Observer<'_>, u32> {
        // SAFETY: `new` has called `init` with this memory, or with one that this is a copy of.
        unsafe { Observer::open(self.memory.as_mut_ptr().cast()) }.ok_or(status::NOT_INITIALISED)
    }

    /// Its memory.
    pub fn memory(&self) -> &[u64] {
        &self.memory
    }

    /// Takes the memory of an observer of the same image. Returns whether it has the same size.
    ///
    /// # Safety
    /// The memory is one that [`Self::memory`] gave, of an observer of the same image, from the same program.
    pub unsafe fn restore(&mut self, memory: &[u64]) -> bool {
        let fits = memory.len() == self.memory.len();
        if fits {
            self.memory.copy_from_slice(memory);
        }
        fits
    }
}
