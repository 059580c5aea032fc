//! The channels of a log as whole arrays.

use std::sync::{Mutex, PoisonError};

use crate::LogError;
use crate::ahead::Crew;
use crate::columns::{Block, Memory, Said, Source, Stream};

/// A log that was read as a whole.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Arrays {
    /// All records of each clock, in the order of the file.
    pub blocks: Vec<Block>,
    /// What is to be said about the log.
    pub notes: Vec<String>,
}

/// Records of which some are read in the time that a thread takes to start.
const WORTH_A_THREAD: usize = 1 << 15;

/// What came of a stream, and the place of the stream in the file.
type Whole = (usize, Said, Result<Vec<Block>, LogError>);

impl Arrays {
    /// Reads streams one after the other.
    pub(crate) fn of(streams: Vec<Box<dyn Stream + '_>>) -> Result<Self, LogError> {
        Self::put_together(wholes(streams.into_iter().enumerate()))
    }

    /// Reads streams side by side, on at most so many threads. Those that have no more to read work for the others.
    pub(crate) fn on_threads(
        streams: Vec<Box<dyn Stream + '_>>,
        threads: usize,
        crew: &Crew,
    ) -> Result<Self, LogError> {
        let records = streams.iter().fold(0_usize, |records, stream| records.saturating_add(stream.max_records()));
        let threads = threads.min(1 + records / WORTH_A_THREAD);
        let mut waiting: Vec<_> = streams.into_iter().enumerate().collect();
        // The longest is taken first, so that the others fill the time beside it.
        waiting.sort_by_key(|(_, stream)| stream.max_records());
        let waiting = Mutex::new(waiting);
        let next = || waiting.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let read = || {
            let reader = crew.reader();
            let wholes = wholes(std::iter::from_fn(next));
            reader.serve();
            wholes
        };
        let all = std::thread::scope(|scope| {
            // Fewer where the system has no more.
            let start = |_| std::thread::Builder::new().spawn_scoped(scope, read).ok();
            let others: Vec<_> = (1..threads).map_while(start).collect();
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
