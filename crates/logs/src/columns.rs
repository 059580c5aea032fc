//! The channels of a log in columns: what is decoded, before it is merged in time order.
//!
//! A stream is what shares one clock: a table, a bus, a channel group. It gives its records in the order of the file, as many at once
//! as fit into the caches of a processor.

use crate::LogError;
use crate::samples::{Quality, Sample};

/// Records that follow each other, of channels that share a clock.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Block {
    /// Time stamp of each record, s: finite, as it stands in the file.
    pub times_s: Vec<f64>,
    /// The channels.
    pub columns: Vec<Column>,
}

/// The values of one channel in the records of a [`Block`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Column {
    /// The channel, by its place in [`crate::Log::channels`].
    pub channel: usize,
    /// The value of each record, in the unit of the channel.
    pub values: Vec<f64>,
    /// What each is worth, as far as the format says it; none where a record has no value. Empty if all are good.
    pub qualities: Vec<Option<Quality>>,
}

impl Column {
    /// What the value of a record is worth; none if it has none.
    #[inline]
    pub fn quality(&self, record: usize) -> Option<Quality> {
        self.qualities.get(record).copied().unwrap_or(Some(Quality::Good))
    }

    /// Says that the values that were appended are good.
    pub(crate) fn all_good(&mut self) {
        if !self.qualities.is_empty() {
            self.qualities.resize(self.values.len(), Some(Quality::Good));
        }
    }

    /// Where to append what each of the values from `first` on is worth.
    pub(crate) fn qualities_from(&mut self, first: usize) -> &mut Vec<Option<Quality>> {
        self.qualities.resize(first, Some(Quality::Good));
        &mut self.qualities
    }
}

impl Block {
    /// Leaves out records from the given one on whose time is not finite; how many they were.
    pub(crate) fn leave_out_without_time(&mut self, first: usize) -> u64 {
        if are_finite(&self.times_s[first..]) {
            return 0;
        }
        let keep: Vec<bool> = self.times_s.iter().map(|time_s| time_s.is_finite()).collect();
        let before = self.times_s.len();
        kept(&mut self.times_s, &keep);
        for column in &mut self.columns {
            kept(&mut column.values, &keep);
            kept(&mut column.qualities, &keep);
        }
        (before - self.times_s.len()) as u64
    }

    /// Leaves out all records behind the first ones.
    pub(crate) fn truncate(&mut self, records: usize) {
        self.times_s.truncate(records);
        for column in &mut self.columns {
            column.values.truncate(records);
            column.qualities.truncate(records);
        }
    }

    /// Takes memory for so many records, where there is so much.
    fn reserve(&mut self, records: usize) {
        // Where there is not, the arrays grow as far as they can.
        let _ = self.times_s.try_reserve_exact(records);
        self.columns.iter_mut().for_each(|column| drop(column.values.try_reserve_exact(records)));
    }
}

/// Whether all values are finite.
pub(crate) fn are_finite(values: &[f64]) -> bool {
    // Zero times what is not finite is NaN, which stays in a sum; several sums go on side by side.
    let (groups, rest) = values.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for group in groups {
        sums.iter_mut().zip(group).for_each(|(sum, value)| *sum += 0.0 * value);
    }
    sums.iter().chain(rest).all(|value| value.is_finite())
}

/// Keeps the elements that are marked.
fn kept<T>(elements: &mut Vec<T>, keep: &[bool]) {
    let mut marks = keep.iter();
    elements.retain(|_| marks.next().copied().unwrap_or(true));
}

/// What a stream gives at once: samples one by one, or records in columns. One of them is empty.
#[derive(Debug, Default)]
pub(crate) struct Batch {
    pub(crate) samples: Vec<Sample>,
    pub(crate) block: Block,
    pub(crate) memory: Vec<Memory>,
}

/// What the stream that fills a batch has read and unpacked of one place, and not yet given. Another stream can use the memory after it.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    pub(crate) packed: Vec<u8>,
    pub(crate) unpacked: Vec<u8>,
}

impl Batch {
    /// The block with these channels, to be filled.
    pub(crate) fn block_of(&mut self, channels: &[usize]) -> &mut Block {
        self.block.columns.resize_with(channels.len(), Column::default);
        self.block.columns.iter_mut().zip(channels).for_each(|(column, channel)| column.channel = *channel);
        &mut self.block
    }

    fn clear(&mut self) {
        self.samples.clear();
        self.block.truncate(0);
    }

    /// How many records there are; a sample alone is one.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.samples.len().max(self.block.times_s.len())
    }

    /// The time stamp of a record, s.
    #[inline]
    pub(crate) fn stamp_s(&self, record: usize) -> Option<f64> {
        match self.block.times_s.get(record) {
            Some(stamp_s) => Some(*stamp_s),
            None => self.samples.get(record).map(|sample| sample.time_s),
        }
    }

    /// The samples of a record.
    #[inline]
    pub(crate) fn samples_of(&self, record: usize, mut each: impl FnMut(Sample)) {
        let Some(&time_s) = self.block.times_s.get(record) else {
            return self.samples.get(record).copied().into_iter().for_each(each);
        };
        for column in &self.block.columns {
            if let (Some(quality), Some(&value)) = (column.quality(record), column.values.get(record)) {
                each(Sample { channel: column.channel, time_s, value, quality });
            }
        }
    }
}

/// What shares one clock.
pub(crate) trait Stream: Send {
    /// Appends the next samples in the order of the file, with finite times and the quality as far as the format says it: one by one, or
    /// to the block. False at the end.
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError>;

    /// How many records it has at most, as far as the file says it.
    fn max_records(&self) -> usize {
        0
    }

    /// What else is to be said about the stream, at its end.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

/// A stream with what it gave last.
pub(crate) struct Source<'a> {
    stream: Box<dyn Stream + 'a>,
    pub(crate) batch: Batch,
}

/// What is to be said about a log while it is read.
#[derive(Debug, Default)]
pub(crate) struct Said {
    pub(crate) notes: Vec<String>,
    /// The first damage; an error if nothing could be read.
    pub(crate) damage: Option<LogError>,
}

impl<'a> Source<'a> {
    pub(crate) fn new(stream: Box<dyn Stream + 'a>) -> Self {
        Self { stream, batch: Batch::default() }
    }

    /// Reads the next batch in place of the last; false at the end. A damaged place is the end, and is noted.
    pub(crate) fn read(&mut self, said: &mut Said) -> Result<bool, LogError> {
        self.batch.clear();
        self.read_on(said)
    }

    /// Reads the next batch behind what there is.
    fn read_on(&mut self, said: &mut Said) -> Result<bool, LogError> {
        let before = self.batch.len();
        while self.batch.len() == before {
            let damage = match self.stream.next_batch(&mut self.batch) {
                Ok(true) => continue,
                Ok(false) => None,
                Err(error @ LogError::Damaged { .. }) => Some(error),
                Err(error) => return Err(error),
            };
            said.notes.append(&mut self.stream.notes());
            if let Some(error) = damage {
                said.notes.push(format!("{error}\nhint: the log is read up to this place"));
                said.damage.get_or_insert(error);
            }
            // What came with the end or before the damage is given first.
            self.stream = Box::new(Ended);
            if self.batch.len() == before {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads a stream to its end: its records as one block, or samples as one for each channel. The memory is that of the stream before.
    pub(crate) fn whole(mut self, memory: &mut Vec<Memory>, said: &mut Said) -> Result<Vec<Block>, LogError> {
        std::mem::swap(&mut self.batch.memory, memory);
        let maximum = self.stream.max_records();
        while self.read_on(said)? {
            // The first batch has made the columns.
            self.batch.block.reserve(maximum.saturating_sub(self.batch.block.times_s.len()));
        }
        std::mem::swap(&mut self.batch.memory, memory);
        match self.batch.samples.is_empty() {
            true => Ok(vec![self.batch.block]),
            false => Ok(by_channel(&self.batch.samples)),
        }
    }
}

/// What is left of a stream after its end.
struct Ended;

impl Stream for Ended {
    fn next_batch(&mut self, _: &mut Batch) -> Result<bool, LogError> {
        Ok(false)
    }
}

/// The channels of a log in columns, one stream after the other.
///
/// Time stamps and values are those of the file: nothing is merged, and no stamp is judged (that is what [`crate::Samples`] does). A stream that
/// ends in a damaged place gives what was read before it and a note; where nothing could be read it is an error.
pub struct Columns<'a> {
    streams: std::vec::IntoIter<Box<dyn Stream + 'a>>,
    source: Source<'a>,
    said: Said,
    is_empty: bool,
    /// Channels of a batch of samples that are still to be given.
    blocks: Vec<Block>,
}

impl<'a> Columns<'a> {
    pub(crate) fn new(streams: Vec<Box<dyn Stream + 'a>>) -> Self {
        let (streams, source) = (streams.into_iter(), Source::new(Box::new(Ended)));
        Self { streams, source, said: Said::default(), is_empty: true, blocks: Vec::new() }
    }

    /// What is to be said about the log, complete after the last block.
    pub fn notes(&self) -> &[String] {
        &self.said.notes
    }

    /// The next records; none at the end.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn next_block(&mut self) -> Result<Option<&Block>, LogError> {
        self.blocks.pop();
        if !self.blocks.is_empty() {
            return Ok(self.blocks.last());
        }
        while !self.source.read(&mut self.said)? {
            let Some(stream) = self.streams.next() else {
                return self.said.damage.take().filter(|_| self.is_empty).map_or(Ok(None), Err);
            };
            self.source.stream = stream;
        }
        self.is_empty = false;
        if self.source.batch.samples.is_empty() {
            return Ok(Some(&self.source.batch.block));
        }
        self.blocks = by_channel(&self.source.batch.samples);
        Ok(self.blocks.last())
    }
}

/// Samples one by one as a block for each channel.
fn by_channel(samples: &[Sample]) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut places = std::collections::HashMap::new();
    for sample in samples {
        let place = *places.entry(sample.channel).or_insert_with(|| {
            let column = Column { channel: sample.channel, ..Column::default() };
            blocks.push(Block { times_s: Vec::new(), columns: vec![column] });
            blocks.len() - 1
        });
        let block = &mut blocks[place];
        block.times_s.push(sample.time_s);
        block.columns[0].values.push(sample.value);
        block.columns[0].qualities.push(Some(sample.quality));
    }
    blocks
}
