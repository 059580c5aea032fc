//! Runs on several threads, rows in their order.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Condvar, Mutex, PoisonError};

use super::row::{Campaign, Row};
use crate::StudyError;

/// Runs that a thread takes at once.
const BLOCK: u64 = 16;
/// Blocks that may be finished ahead of the one that is due, for each thread: memory does not grow with the
/// number of runs.
const AHEAD: u64 = 4;

struct Shared {
    next_block: u64,
    due_block: u64,
    finished: BTreeMap<u64, Result<Vec<Row>, StudyError>>,
    stopped: bool,
}

/// Makes the runs of a range on `threads` threads and shows their rows to `sink` in the order of their numbers.
///
/// # Errors
/// What a run or `sink` returns; the rows before have been shown.
pub fn execute<E: From<StudyError>>(
    campaign: &Campaign,
    runs: Range<u64>,
    threads: usize,
    mut sink: impl FnMut(&Row) -> Result<(), E>,
) -> Result<(), E> {
    let blocks = (runs.end - runs.start.min(runs.end)).div_ceil(BLOCK);
    let shared = Mutex::new(Shared { next_block: 0, due_block: 0, finished: BTreeMap::new(), stopped: false });
    let changed = Condvar::new();
    let lock = || shared.lock().unwrap_or_else(PoisonError::into_inner);
    let wait = |guard| changed.wait(guard).unwrap_or_else(PoisonError::into_inner);
    let ahead = AHEAD * threads.max(1) as u64;
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let block = {
                        let mut state = lock();
                        while !state.stopped && state.next_block < blocks && state.next_block >= state.due_block + ahead
                        {
                            state = wait(state);
                        }
                        if state.stopped || state.next_block >= blocks {
                            return;
                        }
                        state.next_block += 1;
                        state.next_block - 1
                    };
                    let first = runs.start + block * BLOCK;
                    let rows = (first..(first + BLOCK).min(runs.end)).map(|run| campaign.row(run)).collect();
                    lock().finished.insert(block, rows);
                    changed.notify_all();
                }
            });
        }
        let result = (0..blocks).try_for_each(|block| {
            let rows = {
                let mut state = lock();
                loop {
                    if let Some(rows) = state.finished.remove(&block) {
                        state.due_block = block + 1;
                        break rows;
                    }
                    state = wait(state);
                }
            };
            changed.notify_all();
            rows?.iter().try_for_each(&mut sink)
        });
        lock().stopped = true;
        changed.notify_all();
        result
    })
}
