//! Stages of an estimate on threads of their own: rows are read ahead of the observer, and written behind it.
//!
//! Items reach the next stage in their order, and what a stage fails with comes where it would come on one thread: results do not
//! depend on the threads.

use std::collections::VecDeque;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, Scope, ScopedJoinHandle};

use crate::Error;

/// Items that are handed on together, and how many times so many may wait \[chosen\]: a thread is woken seldom, and what waits is small.
const BATCH: usize = 32;
const WAITING: usize = 64;

/// Where stages run.
#[derive(Clone, Copy)]
pub(crate) enum Stages<'scope, 'env> {
    /// One after the other, for each item.
    InTurn,
    /// At the same time.
    Together(&'scope Scope<'scope, 'env>),
}

/// Runs work whose stages run at the same time where there is more than one thread.
pub(crate) fn with_stages<'env, R>(
    threads: usize,
    work: impl for<'scope> FnOnce(Stages<'scope, 'env>) -> Result<R, Error>,
) -> Result<R, Error> {
    if threads > 1 { std::thread::scope(|scope| work(Stages::Together(scope))) } else { work(Stages::InTurn) }
}

/// The items of a stage before this one. Ends behind the last item, or behind the first error.
pub(crate) enum ReadAhead<T, F> {
    Here(F),
    There(Taker<Result<T, Error>>),
}

impl<T: Send, F: FnMut() -> Result<Option<T>, Error>> ReadAhead<T, F> {
    /// `next` gives the next item, and none behind the last.
    pub(crate) fn new<'scope>(stages: Stages<'scope, '_>, next: F) -> Self
    where
        T: 'scope,
        F: Send + 'scope,
    {
        let Stages::Together(scope) = stages else { return Self::Here(next) };
        let (mut giver, taker) = handed();
        let read = move |mut next: F| {
            while let Some(item) = next().transpose() {
                let is_last = item.is_err();
                // No one takes it where the stage behind has failed.
                if !giver.give(item) || is_last {
                    return;
                }
            }
        };
        match spawned(Builder::new(), scope, next, read) {
            Ok(_) => Self::There(taker),
            Err(next) => Self::Here(next),
        }
    }
}

impl<T, F: FnMut() -> Result<Option<T>, Error>> Iterator for ReadAhead<T, F> {
    type Item = Result<T, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Here(next) => next().transpose(),
            Self::There(taker) => taker.next(),
        }
    }
}

/// A stage behind this one.
pub(crate) enum WriteBehind<'scope, T: Send, F> {
    Here(F),
    There(Giver<T>, ScopedJoinHandle<'scope, Option<Result<(), Error>>>),
    /// It has failed, and what with was returned.
    Failed,
}

impl<'scope, T: Send, F: FnMut(&mut T) -> Result<(), Error>> WriteBehind<'scope, T, F> {
    /// `write` takes each item.
    pub(crate) fn new(stages: Stages<'scope, '_>, write: F) -> Self
    where
        T: 'scope,
        F: Send + 'scope,
    {
        let Stages::Together(scope) = stages else { return Self::Here(write) };
        let (giver, taker) = handed();
        match spawned(Builder::new(), scope, write, move |write: F| taker.take_all(write)) {
            Ok(writer) => Self::There(giver, writer),
            Err(write) => Self::Here(write),
        }
    }

    /// Hands an item on.
    ///
    /// # Errors
    /// The stage has failed, with this item or one before it.
    pub(crate) fn push(&mut self, mut item: T) -> Result<(), Error> {
        let is_taken = match self {
            Self::Here(write) => return write(&mut item),
            Self::There(giver, _) => giver.give(item),
            Self::Failed => false,
        };
        if is_taken { Ok(()) } else { std::mem::replace(self, Self::Failed).finish() }
    }

    /// Waits until all items are taken: also where no further one can be read.
    ///
    /// # Errors
    /// The stage has failed.
    pub(crate) fn finish(self) -> Result<(), Error> {
        let Self::There(giver, writer) = self else { return Ok(()) };
        drop(giver);
        writer.join().unwrap_or_else(|panic| resume_unwind(panic)).unwrap_or(Ok(()))
    }
}

/// Runs work on a thread of its own. Where the system has no more threads, the work comes back.
fn spawned<'scope, W: Send + 'scope, R: Send + 'scope>(
    thread: Builder,
    scope: &'scope Scope<'scope, '_>,
    work: W,
    run: impl FnOnce(W) -> R + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, Option<R>>, W> {
    let take = |of: &Mutex<Option<W>>| of.lock().unwrap_or_else(PoisonError::into_inner).take();
    let here = Arc::new(Mutex::new(Some(work)));
    let there = Arc::clone(&here);
    match (thread.spawn_scoped(scope, move || take(&there).map(run)), &here) {
        (Ok(handle), _) => Ok(handle),
        (Err(error), here) => take(here).map_or_else(|| panic!("{error}"), Err),
    }
}

/// Both ends of what one thread hands to another.
fn handed<T>() -> (Giver<T>, Taker<T>) {
    let ((full, filled), (empty, emptied)) = (sync_channel(WAITING), channel());
    let giver = Giver { batch: VecDeque::with_capacity(BATCH), full, emptied };
    (giver, Taker { batch: VecDeque::new(), filled, empty })
}

/// Gives items to a thread. Where it is dropped, those that wait are given.
pub(crate) struct Giver<T> {
    batch: VecDeque<T>,
    full: SyncSender<VecDeque<T>>,
    /// Room that comes back.
    emptied: Receiver<VecDeque<T>>,
}

impl<T> Giver<T> {
    /// Gives an item; false where no one takes items any more.
    fn give(&mut self, item: T) -> bool {
        self.batch.push_back(item);
        self.batch.len() < BATCH || {
            let room = self.emptied.try_recv().unwrap_or_else(|_| VecDeque::with_capacity(BATCH));
            self.full.send(std::mem::replace(&mut self.batch, room)).is_ok()
        }
    }
}

impl<T> Drop for Giver<T> {
    fn drop(&mut self) {
        // No one takes them where the other thread has failed.
        let _ = self.full.send(std::mem::take(&mut self.batch));
    }
}

/// Takes the items of a thread, until that ends.
pub(crate) struct Taker<T> {
    batch: VecDeque<T>,
    filled: Receiver<VecDeque<T>>,
    empty: Sender<VecDeque<T>>,
}

impl<T> Taker<T> {
    /// Takes all items where they stand.
    fn take_all(self, mut take: impl FnMut(&mut T) -> Result<(), Error>) -> Result<(), Error> {
        for mut batch in self.filled {
            batch.iter_mut().try_for_each(&mut take)?;
            batch.clear();
            // None is needed where the other thread has ended.
            let _ = self.empty.send(batch);
        }
        Ok(())
    }
}

impl<T> Iterator for Taker<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        self.batch.pop_front().or_else(|| {
            let room = std::mem::replace(&mut self.batch, self.filled.recv().ok()?);
            // None is needed where the other thread has ended.
            let _ = self.empty.send(room);
            self.batch.pop_front()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What comes of numbers up to a last one, of which one cannot be read and one not written.
    fn through(
        threads: usize,
        last: u32,
        unread: Option<u32>,
        unwritten: Option<u32>,
    ) -> (Vec<u32>, Result<(), String>) {
        let failed = |what: &str, at: u32| Error::Input(format!("{what} {at}"));
        let (mut at, mut written) = (0, Vec::new());
        let result = with_stages(threads, |stages| {
            let read = || {
                at += 1;
                if Some(at) == unread { Err(failed("unread", at)) } else { Ok((at <= last).then_some(at)) }
            };
            let mut rows = WriteBehind::new(stages, |row: &mut u32| {
                written.push(*row);
                if Some(*row) == unwritten { Err(failed("unwritten", *row)) } else { Ok(()) }
            });
            let all = ReadAhead::new(stages, read).try_for_each(|row| rows.push(row?));
            rows.finish()?;
            all
        });
        (written, result.map_err(|error| error.to_string()))
    }

    #[test]
    fn stages_at_the_same_time_do_what_they_do_in_turn() {
        for last in [0, 1, 127, 128, 129, 256, 1000] {
            for unread in [None, Some(1), Some(128), Some(129), Some(900)] {
                let one = through(1, last, unread, None);
                assert_eq!(one.1.is_err(), unread.is_some_and(|at| at <= last + 1), "{last} {unread:?}");
                assert_eq!(through(3, last, unread, None), one, "{last} {unread:?}");
            }
        }
        let (written, result) = through(3, 1000, None, None);
        assert_eq!((written, result), ((1..=1000).collect(), Ok(())));
    }

    #[test]
    fn what_cannot_be_written_ends_the_reading() {
        for unwritten in [1, 128, 129, 500, 1000] {
            for threads in [1, 3] {
                let (written, result) = through(threads, 1000, None, Some(unwritten));
                assert_eq!(result, Err(format!("unwritten {unwritten}")));
                assert_eq!(written, (1..=unwritten).collect::<Vec<_>>());
            }
        }
        // A log without an end.
        assert!(through(3, u32::MAX, None, Some(7)).1.is_err());
    }

    #[test]
    fn work_comes_back_where_the_system_has_no_thread() {
        std::thread::scope(|scope| {
            let huge = Builder::new().stack_size(1 << 48);
            assert_eq!(spawned(huge, scope, 7, |work| work + 1).map(|_| ()), Err(7));
            assert_eq!(spawned(Builder::new(), scope, 7, |work| work + 1).unwrap().join().unwrap(), Some(8));
        });
    }

    #[test]
    #[should_panic(expected = "in the writer")]
    fn a_panic_of_a_stage_is_one_of_all() {
        let _ = with_stages(2, |stages| {
            let mut rows =
                WriteBehind::new(stages, |row: &mut u32| if *row > 0 { panic!("in the writer") } else { Ok(()) });
            (0..10_000).try_for_each(|row| rows.push(row))?;
            rows.finish()
        });
    }
}
