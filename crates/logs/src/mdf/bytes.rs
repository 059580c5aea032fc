//! The bytes of an MDF file: in a file, or in memory.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use falcon_mdf::Mf4Error;
use falcon_mdf::io::{ByteSlice, ByteSource, IoBackend};

use crate::LogError;

/// The bytes of an MDF file, by their places.
pub(super) enum Bytes {
    File(Mutex<File>),
    Memory(Arc<[u8]>),
}

impl Bytes {
    /// Those in memory, or else those of the file.
    pub(super) fn open(path: &Path, memory: Option<&Arc<[u8]>>) -> Result<Self, LogError> {
        Ok(match memory {
            Some(bytes) => Self::Memory(bytes.clone()),
            None => Self::File(Mutex::new(File::open(path).map_err(LogError::io(path))?)),
        })
    }

    /// How many there are.
    pub(super) fn len(&self) -> Result<u64, String> {
        match self {
            Self::File(file) => {
                let file = file.lock().unwrap_or_else(PoisonError::into_inner);
                Ok(file.metadata().map_err(|error| error.to_string())?.len())
            }
            Self::Memory(bytes) => Ok(bytes.len() as u64),
        }
    }

    /// Reads those from a place on, as many as there is room for.
    pub(super) fn read(&self, at: u64, room: &mut [u8]) -> Result<(), String> {
        match self {
            Self::File(file) => {
                let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(room)).map_err(|error| error.to_string())
            }
            Self::Memory(bytes) => {
                let found = part(bytes, at, room.len()).ok_or("it ends beyond the end of the file")?;
                room.copy_from_slice(found);
                Ok(())
            }
        }
    }
}

/// The same for `falcon_mdf`.
pub(super) fn backend(path: &Path, memory: Option<&Arc<[u8]>>) -> Result<IoBackend, Mf4Error> {
    match memory {
        Some(bytes) => Ok(IoBackend::Custom(Arc::new(Shared(bytes.clone())))),
        None => IoBackend::open(path),
    }
}

/// Bytes that are shared and not copied.
struct Shared(Arc<[u8]>);

impl ByteSource for Shared {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }

    fn read_bytes(&self, offset: u64, len: usize) -> Result<ByteSlice<'_>, Mf4Error> {
        part(&self.0, offset, len).map(ByteSlice::borrowed).ok_or_else(|| {
            let available = usize::try_from(offset).map_or(0, |offset| self.0.len().saturating_sub(offset));
            Mf4Error::truncated(offset, len, available)
        })
    }
}

fn part(bytes: &[u8], at: u64, length: usize) -> Option<&[u8]> {
    let at = usize::try_from(at).ok()?;
    bytes.get(at..at.checked_add(length)?)
}
