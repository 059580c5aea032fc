//! The records of a channel group: its blocks of data, one after the other, unpacked.

use std::collections::VecDeque;
use std::sync::Arc;

use falcon_mdf::blocks::data_block::CompressionType;
use falcon_mdf::data_index::DataBlockInfo;
use falcon_mdf::{ChannelGroup, DataGroup};

use super::blocks::{Ahead, Blocks, Packed, can_unpack, in_rows};
use super::limits::ON_TRUST;
use crate::ahead::Crew;
use crate::columns::Memory;

/// Bytes of a block that is not packed that are read at once.
const READ_AT_ONCE: usize = 4 << 20;
/// Bytes of the head of a block.
const HEAD: u64 = 24;

/// Some records that follow each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window<'a> {
    bytes: &'a [u8],
    /// Bytes from one record to the next; with planes, from one byte of a record to the next.
    stride: usize,
    /// Whether the first bytes of all records stand together, then all second ones, and so on.
    is_planes: bool,
    /// The first of them in `bytes`.
    first: usize,
    /// How many they are.
    pub(super) count: usize,
    /// The number of the first of them in the group.
    pub(super) index: u64,
}

impl Window<'_> {
    /// One byte of one record.
    pub(super) fn byte(&self, record: usize, at: usize) -> u8 {
        let record = self.first + record;
        let place = if self.is_planes { at * self.stride + record } else { record * self.stride + at };
        self.bytes.get(place).copied().unwrap_or_default()
    }

    /// Takes a number of `N` bytes at `at` out of each record from `from` on; false where its bytes do not stand together.
    #[inline(always)]
    pub(super) fn gather<const N: usize, W>(
        &self,
        from: usize,
        at: usize,
        words: &mut [W],
        word: impl Fn([u8; N]) -> W,
    ) -> bool {
        if self.is_planes {
            return false;
        }
        let records = self.bytes[(self.first + from) * self.stride..].chunks_exact(self.stride);
        for (place, record) in words.iter_mut().zip(records) {
            if let Some(bytes) = record[at..].first_chunk::<N>() {
                *place = word(*bytes);
            }
        }
        true
    }

    /// Makes words of two bytes of each record from `from` on, the lower one first; zero for a byte that is not there.
    #[inline(always)]
    pub(super) fn pair(&self, from: usize, places: [Option<usize>; 2], words: &mut [u16]) {
        let from = self.first + from;
        let (start, step) = if self.is_planes { (from, 1) } else { (from * self.stride, self.stride) };
        let from_record = if self.is_planes { self.stride } else { 1 };
        let bytes = |at: usize| &self.bytes[start + at * from_record..];
        match places.map(|place| place.map(bytes)) {
            // Bytes that stand together are taken many at once.
            [Some(low), Some(high)] if step == 1 => of_pairs(words, low.iter().zip(high)),
            [Some(low), Some(high)] => of_pairs(words, low.iter().step_by(step).zip(high.iter().step_by(step))),
            [Some(low), None] if step == 1 => of_pairs(words, low.iter().zip(std::iter::repeat(&0))),
            [Some(low), None] => of_pairs(words, low.iter().step_by(step).zip(std::iter::repeat(&0))),
            _ => words.fill(0),
        }
    }
}

/// Makes words of low and high bytes.
#[inline(always)]
fn of_pairs<'b>(words: &mut [u16], pairs: impl Iterator<Item = (&'b u8, &'b u8)>) {
    words.iter_mut().zip(pairs).for_each(|(word, (low, high))| *word = u16::from_le_bytes([*low, *high]));
}

/// How the records of a group are found among the bytes.
enum Layout {
    /// One after the other.
    Sorted,
    /// Between those of other groups, each behind the identifier of its group.
    Unsorted(Mixed),
}

/// Records of several groups.
struct Mixed {
    id_bytes: usize,
    /// Identifier and bytes of the records of each group; none where each record says its length.
    groups: Vec<(u64, Option<usize>)>,
    wanted: u64,
}

/// The records of a group, read block by block.
pub(super) struct Records<'a> {
    file: &'a Arc<Blocks>,
    crew: &'a Crew,
    blocks: &'a [DataBlockInfo],
    /// Those of them that are unpacked ahead, each at its place.
    ahead: VecDeque<Option<Ahead>>,
    /// Bytes of the first of them that were read: it is not packed, and long.
    read: usize,
    layout: Layout,
    /// Bytes of a record.
    size: usize,
    /// Of what was unpacked: its bytes, the records in it, whether they stand in planes, and how many were given.
    length: usize,
    held: usize,
    is_planes: bool,
    given: usize,
    /// The beginning of a record whose end is in the next block.
    rest: Vec<u8>,
    index: u64,
    count: u64,
    /// Why the records end here.
    damage: Option<String>,
}

impl<'a> Records<'a> {
    /// Bytes before the numbers of a record: of a sorted group, its identifier stands in it.
    pub(super) fn id_bytes(data: &DataGroup) -> usize {
        if data.is_unsorted() { 0 } else { usize::from(data.rec_id_size()) }
    }

    /// The records of a group; none where its blocks are in a form that the library must read.
    pub(super) fn of(file: &'a Arc<Blocks>, crew: &'a Crew, data: &'a DataGroup, group: &ChannelGroup) -> Option<Self> {
        let blocks = data.block_index().blocks();
        let id_bytes = data.rec_id_size();
        let (layout, size) = if data.is_unsorted() {
            let of =
                |other: &ChannelGroup| (other.record_id(), (!other.is_vlsd()).then(|| other.record_size(id_bytes)));
            let groups = data.channel_groups.iter().map(of).collect();
            let mixed = Mixed { id_bytes: usize::from(id_bytes), groups, wanted: group.record_id() };
            (Layout::Unsorted(mixed), group.payload_size())
        } else {
            (Layout::Sorted, group.record_size(id_bytes))
        };
        (size > 0 && blocks.iter().all(can_unpack)).then(|| Self {
            file,
            crew,
            blocks,
            ahead: VecDeque::new(),
            read: 0,
            layout,
            size,
            length: 0,
            held: 0,
            is_planes: false,
            given: 0,
            rest: Vec::new(),
            index: 0,
            // Of mixed records the library has not counted those that lie over the end of a block.
            count: if data.is_unsorted() { u64::MAX } else { group.sample_count },
            damage: None,
        })
    }

    /// How many records there are at most, as far as the file says it.
    pub(super) fn maximum(&self) -> usize {
        let bytes = self.blocks.iter().fold(0_u64, |bytes, block| bytes.saturating_add(block.original_size));
        usize::try_from(self.count.min(bytes / self.size as u64)).unwrap_or(usize::MAX)
    }

    /// How many records can be taken now, at least one; zero at the end. The memory is that of the calls before.
    pub(super) fn ready(&mut self, memory: &mut Memory) -> Result<usize, String> {
        while self.given == self.held {
            if let Some(damage) = self.damage.take() {
                self.blocks = &[];
                return Err(damage);
            }
            if self.index == self.count || !self.next_block(memory)? {
                return Ok(0);
            }
        }
        let left = usize::try_from(self.count - self.index).unwrap_or(usize::MAX);
        Ok(left.min(self.held - self.given))
    }

    /// The next records: at most as many as are ready, out of the same memory.
    pub(super) fn take<'m>(&mut self, count: usize, memory: &'m Memory) -> Window<'m> {
        let window = Window {
            bytes: &memory.unpacked[..self.length],
            stride: if self.is_planes { self.held } else { self.size },
            is_planes: self.is_planes,
            first: self.given,
            count,
            index: self.index,
        };
        self.given += count;
        self.index += count as u64;
        window
    }

    /// Reads the next bytes and finds the records in them; false at the end.
    fn next_block(&mut self, memory: &mut Memory) -> Result<bool, String> {
        let Some(block) = self.blocks.first() else { return Ok(false) };
        (self.given, self.held, self.is_planes) = (0, 0, false);
        let place = |message: String| format!("block at byte {}: {message}", block.offset);
        if let Some(invalid) = block.invalidation_block.as_deref() {
            let data = self.whole(block).map_err(place)?;
            let invalid =
                self.whole(invalid).map_err(|message| format!("block at byte {}: {message}", invalid.offset))?;
            self.go_on();
            self.divide(&side_by_side(block, &data, &invalid), &mut memory.unpacked);
            return Ok(true);
        }
        match Packed::of(block) {
            Some(packed) => {
                self.length = self.unpack(packed, memory).map_err(place)?;
                self.go_on();
                self.find_in(block, memory).map_err(place)?;
            }
            None => {
                let size = usize::try_from(block.original_size).unwrap_or(usize::MAX);
                let length = (size - self.read).min(READ_AT_ONCE);
                let at = block.offset + HEAD + self.read as u64;
                self.file.read(at, length as u64, &mut memory.packed).map_err(place)?;
                self.read += length;
                if self.read == size {
                    self.read = 0;
                    self.go_on();
                }
                self.divide(&memory.packed, &mut memory.unpacked);
            }
        }
        Ok(true)
    }

    /// Goes on to the next block.
    fn go_on(&mut self) {
        self.blocks = self.blocks.get(1..).unwrap_or_default();
        self.ahead.pop_front();
    }

    /// Unpacks the first block, here or from where it was unpacked ahead, and lets others unpack the next ones; its bytes.
    fn unpack(&mut self, block: Packed, memory: &mut Memory) -> Result<usize, String> {
        if self.ahead.is_empty() {
            self.ahead.push_back(None);
        }
        while self.ahead.len() <= self.crew.ahead()
            && let Some(next) = self.blocks.get(self.ahead.len())
        {
            let next = Packed::of(next).filter(|_| next.invalidation_block.is_none());
            self.ahead.push_back(next.and_then(|next| Ahead::order(self.file, self.crew, next)));
        }
        match self.ahead.pop_front().flatten() {
            Some(own) => {
                let others = || self.ahead.iter().flatten().any(Ahead::run);
                let length = own.result(memory, others);
                self.ahead.push_front(None);
                length
            }
            None => {
                self.ahead.push_front(None);
                self.file.unpack(block, memory)
            }
        }
    }

    /// Finds the records in a block that was unpacked.
    fn find_in(&mut self, block: &DataBlockInfo, Memory { packed, unpacked }: &mut Memory) -> Result<(), String> {
        let with = block.compression;
        let is_transposed = with.is_some_and(|with| with.algorithm == CompressionType::TransposedDeflate);
        let columns = with.map_or(0, |with| with.parameter as usize);
        let is_as_it_stands = self.rest.is_empty() && matches!(self.layout, Layout::Sorted);
        let bytes = &unpacked[..self.length];
        if is_as_it_stands && (!is_transposed || columns == self.size) {
            (self.is_planes, self.held) = (is_transposed, self.length / self.size);
            self.rest.extend_from_slice(&bytes[self.held * self.size..]);
        } else if is_transposed {
            self.divide(&in_rows(bytes, columns)?, unpacked);
        } else {
            packed.clear();
            packed.extend_from_slice(bytes);
            self.divide(packed, unpacked);
        }
        Ok(())
    }

    /// The bytes of a block, unpacked and row by row.
    fn whole(&self, block: &DataBlockInfo) -> Result<Vec<u8>, String> {
        let mut memory = Memory::default();
        let Some(packed) = Packed::of(block) else {
            self.file.read(block.offset + HEAD, block.original_size, &mut memory.unpacked)?;
            return Ok(memory.unpacked);
        };
        let length = self.file.unpack(packed, &mut memory)?;
        memory.unpacked.truncate(length);
        match block.compression {
            Some(with) if with.algorithm == CompressionType::TransposedDeflate => {
                in_rows(&memory.unpacked, with.parameter as usize)
            }
            _ => Ok(memory.unpacked),
        }
    }

    /// Finds the records in these bytes, behind what was left of those before, and keeps what is less than one.
    fn divide(&mut self, bytes: &[u8], unpacked: &mut Vec<u8>) {
        unpacked.clear();
        match &self.layout {
            Layout::Sorted => {
                unpacked.append(&mut self.rest);
                unpacked.extend_from_slice(bytes);
                self.rest.extend_from_slice(&unpacked[unpacked.len() / self.size * self.size..]);
            }
            Layout::Unsorted(mixed) => {
                let mut all = std::mem::take(&mut self.rest);
                all.extend_from_slice(bytes);
                let (used, damage) = mixed.take_own(&all, unpacked);
                self.damage = damage;
                self.rest.extend_from_slice(&all[used..]);
            }
        }
        (self.length, self.held) = (unpacked.len(), unpacked.len() / self.size);
    }
}

impl Mixed {
    /// Copies the records of the wanted group, without their identifiers. How many bytes were gone through: the rest is the beginning of
    /// a record, or cannot be read.
    fn take_own(&self, bytes: &[u8], own: &mut Vec<u8>) -> (usize, Option<String>) {
        let mut at = 0;
        while let Some(id) = bytes.get(at..at + self.id_bytes) {
            let id = id.iter().rev().fold(0, |id, byte| id << 8 | u64::from(*byte));
            let Some((_, size)) = self.groups.iter().find(|(other, _)| *other == id) else {
                return (at, Some(format!("a record has the identifier {id}, which no group has")));
            };
            let (head, size) = match size {
                Some(size) => (self.id_bytes, *size),
                None => {
                    let Some(length) = bytes[at + self.id_bytes..].first_chunk() else { break };
                    let head = self.id_bytes + size_of::<u32>();
                    (head, head.saturating_add(u32::from_le_bytes(*length) as usize))
                }
            };
            if size > ON_TRUST || size == 0 {
                return (at, Some(format!("a record has {size} bytes, expected 1 to {ON_TRUST}")));
            }
            let Some(record) = bytes.get(at + head..at + size) else { break };
            if id == self.wanted {
                own.extend_from_slice(record);
            }
            at += size;
        }
        (at, None)
    }
}

/// Records of which a block and the one with its invalidation bits hold a part each.
fn side_by_side(block: &DataBlockInfo, data: &[u8], invalid: &[u8]) -> Vec<u8> {
    let (data_bytes, invalid_bytes) = (block.data_bytes.max(1) as usize, block.inval_bytes.max(1) as usize);
    let both = data.chunks_exact(data_bytes).zip(invalid.chunks_exact(invalid_bytes));
    both.flat_map(|(data, invalid)| data.iter().chain(invalid)).copied().collect()
}
