//! Work on several threads, results in their order.
//!
//! A panic in one piece of work becomes an error: the results before it are returned, and all threads end.

use std::any::Any;
use std::collections::BTreeMap;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;

use super::row::{Campaign, Row};
use crate::StudyError;

/// Runs that a thread takes at once.
pub const BLOCK: u64 = 16;
/// Blocks that may be finished ahead of the one that is due, for each thread: memory does not grow with the
/// number of runs.
const AHEAD: u64 = 4;

/// Makes the runs of a range on `threads` threads and shows their rows to `sink` in the order of their numbers.
///
/// # Errors
/// What a run or `sink` returns, or a defect of theirs; the rows before have been shown.
pub fn execute<E: From<StudyError>>(
    campaign: &Campaign,
    runs: Range<u64>,
    threads: usize,
    mut sink: impl FnMut(&Row) -> Result<(), E>,
) -> Result<(), E> {
    in_order(runs, threads, |run| campaign.row(run), |row| sink(&row?))
}

/// A result, or the message of the panic in its place.
type Outcome<T> = Result<T, String>;

struct State<T> {
    next_block: u64,
    due_block: u64,
    finished: BTreeMap<u64, Vec<Outcome<T>>>,
    stopped: bool,
}

/// The blocks of a range, shared by the threads that work on them and the one that shows their results.
struct Blocks<T> {
    runs: Range<u64>,
    size: u64,
    count: u64,
    /// Blocks that may be finished ahead of the one that is due.
    ahead: u64,
    state: Mutex<State<T>>,
    changed: Condvar,
}

impl<T> Blocks<T> {
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, guard: MutexGuard<'a, State<T>>) -> MutexGuard<'a, State<T>> {
        self.changed.wait(guard).unwrap_or_else(PoisonError::into_inner)
    }

    /// The numbers of a block.
    fn numbers(&self, block: u64) -> Range<u64> {
        let first = self.runs.start + block * self.size;
        first..(first + self.size).min(self.runs.end)
    }

    /// The next block that nobody works on, when there is room for its results.
    fn next(&self) -> Option<u64> {
        let mut state = self.lock();
        while !state.stopped && state.next_block < self.count && state.next_block >= state.due_block + self.ahead {
            state = self.wait(state);
        }
        let block = state.next_block;
        state.next_block += 1;
        (!state.stopped && block < self.count).then_some(block)
    }

    /// Works on blocks until there are no more.
    fn work_through(&self, work: impl Fn(u64) -> T) {
        while let Some(block) = self.next() {
            let results = self.numbers(block).map(|run| catch(|| work(run))).collect();
            self.lock().finished.insert(block, results);
            self.changed.notify_all();
        }
    }

    /// The results of a block, when they are there.
    fn results(&self, block: u64) -> Vec<Outcome<T>> {
        let mut state = self.lock();
        loop {
            if let Some(results) = state.finished.remove(&block) {
                state.due_block = block + 1;
                self.changed.notify_all();
                return results;
            }
            state = self.wait(state);
        }
    }

    /// Ends the work after the blocks that are under way.
    fn stop(&self) {
        self.lock().stopped = true;
        self.changed.notify_all();
    }
}

/// Does `work` for every number of a range on `threads` threads and shows the results to `sink` in their order.
///
/// # Errors
/// What `sink` returns, or [`StudyError::Defect`] where `work` or `sink` panics; the results before have been shown.
pub fn in_order<T: Send, E: From<StudyError>>(
    runs: Range<u64>,
    threads: usize,
    work: impl Fn(u64) -> T + Sync,
    sink: impl FnMut(T) -> Result<(), E>,
) -> Result<(), E> {
    in_blocks(BLOCK, runs, threads, work, sink)
}

/// The same, where a thread takes so many numbers at once: one where the work for each takes long.
///
/// # Errors
/// As [`in_order`].
pub fn in_blocks<T: Send, E: From<StudyError>>(
    block_size: u64,
    runs: Range<u64>,
    threads: usize,
    work: impl Fn(u64) -> T + Sync,
    mut sink: impl FnMut(T) -> Result<(), E>,
) -> Result<(), E> {
    let size = block_size.max(1);
    let count = runs.end.saturating_sub(runs.start).div_ceil(size);
    let threads = count.min(threads.max(1) as u64);
    let state = State { next_block: 0, due_block: 0, finished: BTreeMap::new(), stopped: false };
    let blocks =
        Blocks { runs, size, count, ahead: AHEAD * threads, state: Mutex::new(state), changed: Condvar::new() };
    let mut show = |(run, outcome): (u64, Outcome<T>)| {
        let defect = |message| E::from(StudyError::Defect { run, message });
        catch(|| sink(outcome.map_err(defect)?)).map_err(defect)?
    };
    std::thread::scope(|scope| {
        for started in 0..threads {
            match Builder::new().spawn_scoped(scope, || blocks.work_through(&work)) {
                Ok(_) => {}
                Err(error) if started == 0 => return Err(StudyError::Threads(error).into()),
                // The system has no more of them; fewer threads give the same results.
                Err(_) => break,
            }
        }
        let result =
            (0..count).try_for_each(|block| blocks.numbers(block).zip(blocks.results(block)).try_for_each(&mut show));
        blocks.stop();
        result
    })
}

/// Does something, and gives the message of a panic in it.
fn catch<T>(work: impl FnOnce() -> T) -> Outcome<T> {
    // What the work was at is not looked at after a panic.
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| message(panic.as_ref()))
}

/// The message of a panic.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("no message").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq)]
    struct Ended(String);

    impl From<StudyError> for Ended {
        fn from(error: StudyError) -> Self {
            Self(error.to_string())
        }
    }

    /// Ends of the work over 4000 runs, as many as no thread can have ahead, with the results before.
    fn end_of(work: impl Fn(u64) -> u64 + Sync, end: u64, threads: usize) -> (Vec<u64>, Result<(), Ended>) {
        let mut seen = Vec::new();
        let sink = |result| {
            assert!(result != end, "the sink is broken");
            seen.push(result);
            Ok(())
        };
        let result = in_order(0..4000, threads, work, sink);
        (seen, result)
    }

    #[test]
    fn a_defect_in_the_work_or_after_it_is_an_error_and_the_results_before_it_are_kept() {
        for threads in [1, 2, 7] {
            for broken in [0, 100, 3999] {
                let (seen, result) = end_of(
                    |run| {
                        assert!(run != broken, "run {run} is broken");
                        run
                    },
                    u64::MAX,
                    threads,
                );
                assert!(seen.iter().copied().eq(0..broken));
                let error = result.unwrap_err().0;
                assert!(error.starts_with(&format!("run {broken}: run {broken} is broken")), "{error}");
            }
            let (seen, result) = end_of(|run| run, 100, threads);
            assert!(seen.iter().copied().eq(0..100));
            assert!(result.unwrap_err().0.starts_with("run 100: the sink is broken"));
        }
    }

    #[test]
    fn more_threads_than_a_system_has_do_the_same_work() {
        let (seen, result) = end_of(|run| run, u64::MAX, usize::from(u16::MAX));
        assert!(result.is_ok() && seen.iter().copied().eq(0..4000));
    }

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
                    Ok::<(), Ended>(())
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
                    if run == 500 { Err(Ended("enough".to_owned())) } else { Ok(()) }
                },
            );
            assert_eq!((stopped, count), (Err(Ended("enough".to_owned())), 501));
        }
    }
}
