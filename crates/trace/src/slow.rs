//! A reader for tests.

use std::io::{self, Read};

/// Gives a few of its bytes at a time.
pub(crate) struct Slow(pub(crate) Vec<u8>, pub(crate) usize);

impl Read for Slow {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.1.min(self.0.len()).min(buffer.len());
        buffer[..count].copy_from_slice(&self.0[..count]);
        self.0.drain(..count);
        Ok(count)
    }
}
