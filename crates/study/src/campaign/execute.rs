//! Work on several threads, results in their order.

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
    in_order(runs, threads, |run| campaign.row(run), |row| sink(&row?))
}

struct Shared<T> {
    next_block: u64,
    due_block: u64,
    finished: BTreeMap<u64, Vec<T>>,
    stopped: bool,
}

/// Does `work` for every number of a range on `threads` threads and shows the results to `sink` in their order.
/// `work` must not panic.
///
/// # Errors
/// What `sink` returns; the results before have been shown.
pub fn in_order<T: Send, E>(
    runs: Range<u64>,
    threads: usize,
    work: impl Fn(u64) -> T + Sync,
    mut sink: impl FnMut(T) -> Result<(), E>,
) -> Result<(), E> {
    let blocks = runs.end.saturating_sub(runs.start).div_ceil(BLOCK);
    let shared = Mutex::new(Shared { next_block: 0, due_block: 0, finished: BTreeMap::new(), stopped: false });
    let changed = Condvar::new();
    let lock = || shared.lock().unwrap_or_else(PoisonError::into_inner);
    let wait = |guard| changed.wait(guard).unwrap_or_else(PoisonError::into_inner);
    let ahead = AHEAD * threads.max(1) as u64;
    let next_block = || {
        let mut state = lock();
        while !state.stopped && state.next_block < blocks && state.next_block >= state.due_block + ahead {
            state = wait(state);
        }
        let block = state.next_block;
        state.next_block += 1;
        (!state.stopped && block < blocks).then_some(block)
    };
    let due = |block| {
        let mut state = lock();
        loop {
            if let Some(results) = state.finished.remove(&block) {
                state.due_block = block + 1;
                changed.notify_all();
                return results;
            }
            state = wait(state);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                while let Some(block) = next_block() {
                    let first = runs.start + block * BLOCK;
                    let results = (first..(first + BLOCK).min(runs.end)).map(&work).collect();
                    lock().finished.insert(block, results);
                    changed.notify_all();
                }
            });
        }
        let result = (0..blocks).try_for_each(|block| due(block).into_iter().try_for_each(&mut sink));
        lock().stopped = true;
        changed.notify_all();
        result
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_and_an_error_stops_the_work() {
        for threads in [1, 4] {
            let mut seen = Vec::new();
            let all = in_order(
                3..1003,
                threads,
                |run| run * run,
                |square| {
                    seen.push(square);
                    Ok::<(), ()>(())
                },
            );
            assert!(all.is_ok() && seen == (3..1003).map(|run| run * run).collect::<Vec<u64>>());
            let mut count = 0;
            let stopped = in_order(
                0..1_000_000_000,
                threads,
                |run| run,
                |run| {
                    count += 1;
                    if run == 500 { Err("enough") } else { Ok(()) }
                },
            );
            assert_eq!((stopped, count), (Err("enough"), 501));
        }
    }
}
