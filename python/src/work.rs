//! Long work: on a thread of its own, without Python's lock, with progress, ended by Ctrl-C.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use wetclutch::Error;

use crate::error::{defect, exception};

/// Time between two looks for a signal.
const LOOK: Duration = Duration::from_millis(20);
/// Shortest time between two reports of progress to Python.
const REPORT: Duration = Duration::from_millis(100);

/// How far work is.
pub(crate) struct Report {
    /// In words.
    pub(crate) words: String,
    /// From 0 to 1; none where the end is not known.
    pub(crate) fraction: Option<f64>,
}

/// What work shares with the thread that waits for it.
#[derive(Default)]
pub(crate) struct Work {
    stop: Arc<AtomicBool>,
    newest: Mutex<Option<Report>>,
}

impl Work {
    /// Set when the work has to end soon.
    pub(crate) fn stop(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    /// Whether the work has to end soon.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Says how far the work is; Python gets the newest report.
    pub(crate) fn report(&self, report: Report) {
        *lock(&self.newest) = Some(report);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does the work; it has to end soon after [`Work::stop`] is set. `progress` is called with words and a fraction or `None`, by this thread. A panic
/// becomes an exception.
pub(crate) fn done<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Work) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let shared = Work::default();
    let (sender, receiver) = channel();
    // For the lock of Python to be released around it; nobody else asks for it.
    let receiver = Mutex::new(receiver);
    std::thread::scope(|scope| {
        let of_work = &shared;
        scope.spawn(move || {
            // Nothing of what it leaves half done is looked at afterwards.
            let result = catch_unwind(AssertUnwindSafe(|| work(of_work)));
            // The receiver waits until this comes.
            let _ = sender.send(result);
        });
        let mut ended_by = None;
        let mut reported = Instant::now();
        loop {
            let received = py.detach(|| lock(&receiver).recv_timeout(LOOK));
            match received {
                Ok(result) => {
                    if let Some(signal) = ended_by {
                        return Err(signal);
                    }
                    return match result {
                        Ok(Ok(value)) => Ok(value),
                        Ok(Err(error)) => Err(exception(py, &error)),
                        Err(_) => Err(defect("it panicked; the message is on standard error")),
                    };
                }
                Err(RecvTimeoutError::Disconnected) => return Err(defect("the work ended without a result")),
                Err(RecvTimeoutError::Timeout) if ended_by.is_some() => {}
                Err(RecvTimeoutError::Timeout) => {
                    let is_due = reported.elapsed() >= REPORT;
                    let looked = py.check_signals().and_then(|()| match progress {
                        Some(progress) if is_due => {
                            reported = Instant::now();
                            pass(progress, &shared)
                        }
                        _ => Ok(()),
                    });
                    if let Err(error) = looked {
                        shared.stop.store(true, Ordering::Relaxed);
                        ended_by = Some(error);
                    }
                }
            }
        }
    })
}

/// Passes the newest report to Python, if there is one.
fn pass(progress: &Bound<'_, PyAny>, work: &Work) -> PyResult<()> {
    let newest = lock(&work.newest).take();
    newest.map_or(Ok(()), |report| progress.call1((report.words, report.fraction)).map(drop))
}
