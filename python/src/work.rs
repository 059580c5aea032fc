//! Long work: on a thread of its own, without Python's lock, with progress, ended by Ctrl-C.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use wetclutch::{Error, grouped};

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
    rows: Arc<AtomicU64>,
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

    /// Counts rows of a log that are done.
    pub(crate) fn rows(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.rows)
    }

    /// Says how far the work is; Python gets the newest report.
    pub(crate) fn report(&self, report: Report) {
        *lock(&self.newest) = Some(report);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does the work. `progress` is called with words and a fraction or `None`, by this thread. A panic becomes an exception.
///
/// After Ctrl-C, or an exception of `progress`, the call ends at once, and the work soon after [`Work::stop`] is set: its result is dropped.
pub(crate) fn done<T: Send + 'static>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Work) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let shared = Arc::new(Work::default());
    let (sender, receiver) = channel();
    // For the lock of Python to be released around it; nobody else asks for it.
    let receiver = Mutex::new(receiver);
    let of_work = Arc::clone(&shared);
    Builder::new().spawn(move || {
        // Nothing of what it leaves half done is looked at afterwards.
        let result = catch_unwind(AssertUnwindSafe(|| work(&of_work)));
        // Nobody waits for it after Ctrl-C.
        let _ = sender.send(result);
    })?;
    let mut reported = Instant::now();
    loop {
        match py.detach(|| lock(&receiver).recv_timeout(LOOK)) {
            Ok(Ok(result)) => return result.map_err(|error| exception(py, &error)),
            Ok(Err(_)) => return Err(defect("it panicked; the message is on standard error")),
            Err(RecvTimeoutError::Disconnected) => return Err(defect("the work ended without a result")),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let looked = py.check_signals().and_then(|()| match progress {
            Some(progress) if reported.elapsed() >= REPORT => {
                reported = Instant::now();
                pass(progress, &shared)
            }
            _ => Ok(()),
        });
        if looked.is_err() {
            shared.stop.store(true, Ordering::Relaxed);
            looked?;
        }
    }
}

/// Passes the newest report to Python, or how many rows are done, if there is one.
fn pass(progress: &Bound<'_, PyAny>, work: &Work) -> PyResult<()> {
    let newest = lock(&work.newest).take().map(|report| (report.words, report.fraction));
    let counted = || match work.rows.load(Ordering::Relaxed) {
        0 => None,
        rows => Some((format!("{} rows", grouped(rows)), None)),
    };
    newest.or_else(counted).map_or(Ok(()), |report| progress.call1(report).map(drop))
}
