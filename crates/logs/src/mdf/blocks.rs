//! The blocks of data of an MDF file: read and unpacked, also ahead on other threads.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use falcon_mdf::blocks::data_block::CompressionType;
use falcon_mdf::data_index::DataBlockInfo;

use super::bytes::Bytes;
use super::inflate::{NotInflated, inflate};
use super::limits::LARGEST_BLOCK;
use crate::ahead::{Crew, Job};
use crate::columns::Memory;

/// Deflate makes at most so many bytes of one.
const MAX_FROM_A_BYTE: u64 = 1032;
/// Bytes that the blocks of a file that are unpacked ahead have at most, with what they are unpacked from.
const MAX_AHEAD: u64 = 32 << 20;
/// Memory that is kept for later blocks: so many at most.
const MAX_SPARE: usize = 8;

/// The blocks of a file.
pub(super) struct Blocks {
    file: Bytes,
    /// Bytes of the blocks that are unpacked ahead.
    ahead: AtomicU64,
    /// Memory of blocks that were used.
    spare: Mutex<Vec<Memory>>,
}

/// Where a deflated block is, and its sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Packed {
    at: u64,
    packed_bytes: u64,
    bytes: u64,
}

/// A block that is unpacked ahead.
pub(super) struct Ahead {
    job: Arc<Job<Result<(Memory, usize), String>>>,
    /// Given back at its end.
    bytes: u64,
    blocks: Arc<Blocks>,
}

impl Drop for Ahead {
    fn drop(&mut self) {
        self.blocks.ahead.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

impl Packed {
    /// None where the block is not packed.
    pub(super) fn of(block: &DataBlockInfo) -> Option<Self> {
        let with = block.compression.as_ref()?;
        Some(Self { at: with.data_offset, packed_bytes: block.compressed_size, bytes: block.original_size })
    }

    /// Bytes that its unpacking takes; an error if they cannot be as it says.
    fn memory(self) -> Result<u64, String> {
        let maximum = LARGEST_BLOCK.min(self.packed_bytes.saturating_mul(MAX_FROM_A_BYTE));
        if self.bytes > maximum {
            return Err(format!("its stated unpacked size is {} bytes, expected at most {maximum}", self.bytes));
        }
        Ok(self.bytes + self.packed_bytes.min(LARGEST_BLOCK))
    }
}

impl Ahead {
    /// Lets the crew unpack a block; none if too much is unpacked ahead already, or it cannot be unpacked.
    pub(super) fn order(blocks: &Arc<Blocks>, crew: &Crew, block: Packed) -> Option<Self> {
        let bytes = block.memory().ok()?;
        let with_it = |ahead: u64| Some(ahead + bytes).filter(|ahead| *ahead <= MAX_AHEAD);
        blocks.ahead.fetch_update(Ordering::Relaxed, Ordering::Relaxed, with_it).ok()?;
        let own = Arc::clone(blocks);
        let unpack = move || {
            let mut memory = own.take_spare(block.bytes);
            let length = own.unpack(block, &mut memory)?;
            Ok((memory, length))
        };
        Some(Self { job: crew.order(unpack), bytes, blocks: Arc::clone(blocks) })
    }

    /// Unpacks it now, if nobody has begun to; whether it did.
    pub(super) fn run(&self) -> bool {
        self.job.run()
    }

    /// Puts the block in place of what is in the memory; its bytes. Does what `meanwhile` has while another thread unpacks it.
    pub(super) fn result(self, memory: &mut Memory, meanwhile: impl FnMut() -> bool) -> Result<usize, String> {
        let (unpacked, length) = self.job.result(meanwhile)?;
        self.blocks.keep(std::mem::replace(memory, unpacked));
        Ok(length)
    }
}

impl Blocks {
    pub(super) fn new(file: Bytes) -> Self {
        Self { file, ahead: AtomicU64::new(0), spare: Mutex::default() }
    }

    /// Reads bytes of the file, in place of what is in `bytes`.
    pub(super) fn read(&self, at: u64, length: u64, bytes: &mut Vec<u8>) -> Result<(), String> {
        let of_file = self.file.len()?;
        let end = at.checked_add(length).filter(|end| *end <= of_file);
        end.ok_or_else(|| format!("it ends beyond the end of the file, byte {of_file}"))?;
        if length > LARGEST_BLOCK {
            return Err(format!("it has {length} packed bytes, expected at most {LARGEST_BLOCK}"));
        }
        let length = usize::try_from(length).map_err(|error| error.to_string())?;
        bytes.resize(length, 0);
        self.file.read(at, bytes)
    }

    /// Reads a block, and unpacks it to the beginning of the memory; its bytes.
    pub(super) fn unpack(&self, block: Packed, memory: &mut Memory) -> Result<usize, String> {
        self.read(block.at, block.packed_bytes, &mut memory.packed)?;
        block.memory()?;
        let size = usize::try_from(block.bytes).map_err(|error| error.to_string())?;
        if memory.unpacked.len() < size {
            // Fresh memory is zero already.
            memory.unpacked = vec![0; size];
        }
        match inflate(&memory.packed, &mut memory.unpacked[..size]) {
            Ok(unpacked) if unpacked == size => Ok(size),
            Ok(unpacked) => Err(format!("it unpacks to {unpacked} bytes, and its stated size is {size}")),
            Err(NotInflated::Damaged) => Err("what is packed in it is damaged".to_owned()),
            Err(NotInflated::TooLong) => Err(format!("it unpacks to more than its stated size, {size} bytes")),
        }
    }

    /// Memory for a block of so many bytes: that of another one, unless much of it would lie idle.
    fn take_spare(&self, bytes: u64) -> Memory {
        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        let fits = |memory: &Memory| (bytes..=bytes.saturating_mul(4)).contains(&(memory.unpacked.len() as u64));
        spare.iter().position(fits).map(|at| spare.swap_remove(at)).unwrap_or_default()
    }

    /// Keeps memory for another block.
    fn keep(&self, memory: Memory) {
        let mut spare = self.spare.lock().unwrap_or_else(PoisonError::into_inner);
        if !memory.unpacked.is_empty() && memory.unpacked.len() as u64 <= MAX_AHEAD / MAX_SPARE as u64 {
            if spare.len() == MAX_SPARE {
                spare.remove(0);
            }
            spare.push(memory);
        }
    }
}

/// Whether a block is not packed, or deflated.
pub(super) fn can_unpack(block: &DataBlockInfo) -> bool {
    let is_known = |algorithm| matches!(algorithm, CompressionType::Deflate | CompressionType::TransposedDeflate);
    block.compression.is_none_or(|with| is_known(with.algorithm))
        && block.invalidation_block.as_deref().is_none_or(can_unpack)
}

/// The bytes of a transposed block row by row; what is less than a row stands behind them.
pub(super) fn in_rows(transposed: &[u8], columns: usize) -> Result<Vec<u8>, String> {
    let rows = transposed.len().checked_div(columns).ok_or("it has no columns")?;
    let (planes, tail) = transposed.split_at(rows * columns);
    let mut bytes = vec![0; planes.len()];
    if rows > 0 {
        // Rows that stay in the cache while all their columns are filled.
        let at_once = (16_usize << 10).div_ceil(columns);
        for (part, rows_of_part) in bytes.chunks_mut(at_once * columns).enumerate() {
            for (column, plane) in planes.chunks_exact(rows).enumerate() {
                let places = rows_of_part[column..].iter_mut().step_by(columns);
                places.zip(&plane[part * at_once..]).for_each(|(place, byte)| *place = *byte);
            }
        }
    }
    bytes.extend_from_slice(tail);
    Ok(bytes)
}
