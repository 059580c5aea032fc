//! The channels of a log as whole arrays.

use std::sync::{Mutex, PoisonError};

use crate::LogError;
use crate::columns::{Block, Memory, Said, Source, Stream};

/// A log that was read as a whole.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Arrays {
    /// All records of each clock, in the order of the file.
    pub blocks: Vec<Block>,
    /// What is to be said about the log.
    pub notes: Vec<String>,
}

/// What came of a stream, and the place of the stream in the file.
type Whole = (usize, Said, Result<Vec<Block>, LogError>);

impl Arrays {
    /// Reads streams one after the other.
    pub(crate) fn of(streams: Vec<Box<dyn Stream + '_>>) -> Result<Self, LogError> {
        Self::put_together(wholes(streams.into_iter().enumerate()))
    }

    /// Reads streams side by side, on at most so many threads.
    pub(crate) fn on_threads(streams: Vec<Box<dyn Stream + Send + '_>>, threads: usize) -> Result<Self, LogError> {
        let threads = threads.min(streams.len());
        let mut waiting: Vec<_> = streams.into_iter().enumerate().collect();
        // The longest is taken first, so that the others fill the time beside it.
        waiting.sort_by_key(|(_, stream)| stream.most_records());
        let waiting = Mutex::new(waiting);
        let next = || waiting.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let read = || wholes(std::iter::from_fn(next).map(|(at, stream)| (at, stream as Box<dyn Stream>)));
        let all = std::thread::scope(|scope| {
            let others: Vec<_> = (1..threads).map(|_| scope.spawn(read)).collect();
            let mut all = read();
            for other in others {
                all.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            }
            all
        });
        Self::put_together(all)
    }

    /// All streams in the order of the file; an error if nothing could be read because of damage.
    fn put_together(mut wholes: Vec<Whole>) -> Result<Self, LogError> {
        wholes.sort_by_key(|(at, ..)| *at);
        let (mut arrays, mut damage) = (Self::default(), None);
        for (_, said, blocks) in wholes {
            arrays.blocks.extend(blocks?.into_iter().filter(|block| !block.times_s.is_empty()));
            arrays.notes.extend(said.notes);
            damage = damage.or(said.damage);
        }
        match damage {
            Some(damage) if arrays.blocks.is_empty() => Err(damage),
            _ => Ok(arrays),
        }
    }
}

/// What comes of streams, one after the other.
fn wholes<'a>(streams: impl Iterator<Item = (usize, Box<dyn Stream + 'a>)>) -> Vec<Whole> {
    let mut memory: Vec<Memory> = Vec::new();
    let whole = |(at, stream)| {
        let mut said = Said::default();
        let blocks = Source::new(stream).whole(&mut memory, &mut said);
        (at, said, blocks)
    };
    streams.map(whole).collect()
}
