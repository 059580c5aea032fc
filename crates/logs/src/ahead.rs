//! Work that other threads do before its result is asked for.
//!
//! A thread that asks never waits for work that nobody has begun: it does that itself. So one thread alone does all, in the order in which it
//! asks, and more threads change no result.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::thread::{self, JoinHandle};

type Work<T> = Box<dyn FnOnce() -> T + Send>;

/// A piece of work.
pub(crate) struct Job<T> {
    state: Mutex<State<T>>,
    changed: Condvar,
}

enum State<T> {
    Waiting(Work<T>),
    /// Somebody does it, or its result was taken.
    Begun,
    Done(thread::Result<T>),
}

/// What a thread of a [`Crew`] sees of a [`Job`].
trait Run: Send + Sync {
    /// Does the work, unless somebody has begun it; whether it did.
    fn run(&self) -> bool;
}

/// Work that waits for a thread, the oldest first.
#[derive(Default)]
struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    /// Those that nobody will ask for any more are gone.
    jobs: VecDeque<Weak<dyn Run>>,
    readers: usize,
    is_closed: bool,
}

/// Threads that do work ahead. They wait where there is none, and end with this.
pub(crate) struct Crew {
    queue: Arc<Queue>,
    /// How many threads there are at most, with the one that asks.
    size: usize,
    /// How many of them are started here, with the first job.
    own: usize,
    started: OnceLock<Vec<JoinHandle<()>>>,
}

/// A thread that asks for work, among several that do it for each other afterwards: see [`Crew::of_readers`].
pub(crate) struct Reader<'c>(&'c Crew);

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<T: Send> Job<T> {
    /// Its result; for the one that asks, once. While another thread does it, the one that asks does what `meanwhile` has, which returns
    /// false where it has nothing. A panic of the work goes on here.
    pub(crate) fn result(&self, mut meanwhile: impl FnMut() -> bool) -> T {
        self.run();
        loop {
            let mut state = locked(&self.state);
            if let State::Done(result) = std::mem::replace(&mut *state, State::Begun) {
                return result.unwrap_or_else(|panic| resume_unwind(panic));
            }
            drop(state);
            if !meanwhile() {
                let state = locked(&self.state);
                let is_begun = |state: &mut State<T>| matches!(state, State::Begun);
                drop(self.changed.wait_while(state, is_begun).unwrap_or_else(PoisonError::into_inner));
            }
        }
    }

    /// Does the work now, unless somebody has begun it; whether it did.
    pub(crate) fn run(&self) -> bool {
        let mut state = locked(&self.state);
        if !matches!(*state, State::Waiting(_)) {
            return false;
        }
        let State::Waiting(work) = std::mem::replace(&mut *state, State::Begun) else { return false };
        drop(state);
        // A job that did not end would be waited for without end.
        let result = catch_unwind(AssertUnwindSafe(work));
        *locked(&self.state) = State::Done(result);
        self.changed.notify_all();
        true
    }
}

impl<T: Send> Run for Job<T> {
    fn run(&self) -> bool {
        Job::run(self)
    }
}

impl Crew {
    /// So many threads with the one that asks. They are started with the first job; fewer where the system has no more.
    pub(crate) fn of(threads: usize) -> Self {
        Self { queue: Arc::default(), size: threads, own: threads.saturating_sub(1), started: OnceLock::new() }
    }

    /// So many threads that ask, each a [`Reader`].
    pub(crate) fn of_readers(threads: usize) -> Self {
        Self { queue: Arc::default(), size: threads, own: 0, started: OnceLock::new() }
    }

    /// How many jobs ahead keep all threads busy; none where there is only one.
    pub(crate) fn ahead(&self) -> usize {
        if self.size > 1 { self.size } else { 0 }
    }

    /// Lets a thread do this. Where nobody has begun it, it can still be dropped.
    pub(crate) fn order<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Arc<Job<T>> {
        let job = Arc::new(Job { state: Mutex::new(State::Waiting(Box::new(work))), changed: Condvar::new() });
        self.started.get_or_init(|| (0..self.own).map_while(|_| self.start()).collect());
        let run: Arc<dyn Run> = job.clone();
        locked(&self.queue.waiting).jobs.push_back(Arc::downgrade(&run));
        self.queue.changed.notify_one();
        job
    }

    fn start(&self) -> Option<JoinHandle<()>> {
        let queue = Arc::clone(&self.queue);
        thread::Builder::new().name("unpacking".to_owned()).spawn(move || queue.serve()).ok()
    }

    /// Says that this thread asks from now on.
    pub(crate) fn reader(&self) -> Reader<'_> {
        locked(&self.queue.waiting).readers += 1;
        Reader(self)
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        self.queue.close();
        for thread in self.started.take().into_iter().flatten() {
            // The panic of a job is with the job.
            let _ = thread.join();
        }
    }
}

impl Reader<'_> {
    /// Says that this thread has asked for all that it wants; it works for the others until they have, too.
    pub(crate) fn serve(self) {
        let queue = Arc::clone(&self.0.queue);
        drop(self);
        queue.serve();
    }
}

impl Drop for Reader<'_> {
    fn drop(&mut self) {
        let mut waiting = locked(&self.0.queue.waiting);
        waiting.readers -= 1;
        if waiting.readers == 0 {
            drop(waiting);
            self.0.queue.close();
        }
    }
}

impl Queue {
    fn close(&self) {
        locked(&self.waiting).is_closed = true;
        self.changed.notify_all();
    }

    /// Does jobs until the queue is closed; those that wait then are left.
    fn serve(&self) {
        let mut waiting = locked(&self.waiting);
        while !waiting.is_closed {
            let Some(job) = waiting.jobs.pop_front() else {
                waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            drop(waiting);
            if let Some(job) = job.upgrade() {
                job.run();
            }
            waiting = locked(&self.waiting);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    use std::sync::mpsc;

    use super::*;

    #[test]
    fn results_are_the_same_on_any_number_of_threads() {
        for threads in [0, 1, 2, 5] {
            let crew = Crew::of(threads);
            let jobs: Vec<_> = (0..100).map(|i| crew.order(move || i * i)).collect();
            let others = |i: usize| jobs[i + 1..].iter().any(|job| job.run());
            for (i, job) in jobs.iter().enumerate() {
                assert_eq!(job.result(|| others(i)), i * i, "{threads} threads");
            }
        }
    }

    #[test]
    fn another_thread_does_a_job_before_it_is_asked_for() {
        let crew = Crew::of(2);
        let (began, begins) = mpsc::channel();
        let job = crew.order(move || {
            began.send(thread::current().id()).unwrap();
            7
        });
        assert_ne!(begins.recv().unwrap(), thread::current().id());
        assert_eq!(job.result(|| false), 7);
    }

    #[test]
    fn a_panic_of_a_job_reaches_the_one_that_asks_and_no_other() {
        for threads in [1, 2] {
            let crew = Crew::of(threads);
            let [bad, good] = [true, false].map(|is_bad| crew.order(move || assert!(!is_bad, "a bad job")));
            let panic = catch_unwind(AssertUnwindSafe(|| bad.result(|| false))).unwrap_err();
            assert_eq!(panic.downcast_ref::<&str>(), Some(&"a bad job"));
            good.result(|| false);
        }
    }

    #[test]
    fn threads_end_with_the_crew_and_leave_what_nobody_asks_for() {
        let crew = Crew::of(2);
        let (ended, begun) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
        let (go, goes) = mpsc::channel::<()>();
        let (began, begins) = mpsc::channel();
        let end = Arc::clone(&ended);
        let first = crew.order(move || {
            began.send(()).unwrap();
            let _ = goes.recv();
            end.store(true, Ordering::SeqCst);
        });
        let count = Arc::clone(&begun);
        drop(crew.order(move || count.fetch_add(1, Ordering::SeqCst)));
        begins.recv().unwrap();
        drop((first, go));
        // Waits for the job that was begun.
        drop(crew);
        assert!(ended.load(Ordering::SeqCst));
        assert_eq!(begun.load(Ordering::SeqCst), 0);
    }

    #[test]
    fn readers_work_for_each_other_and_end_when_one_panics() {
        let crew = Crew::of_readers(3);
        let (began, begins) = mpsc::channel();
        let failed = catch_unwind(AssertUnwindSafe(|| {
            thread::scope(|scope| {
                let reader = crew.reader();
                for _ in 0..2 {
                    scope.spawn(|| crew.reader().serve());
                }
                let job = crew.order(move || began.send(thread::current().id()).unwrap());
                assert_ne!(begins.recv().unwrap(), thread::current().id());
                job.result(|| false);
                let _reader = reader;
                panic!("this one");
            })
        }));
        assert!(failed.is_err());
    }
}
