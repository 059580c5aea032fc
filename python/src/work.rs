//! Long work: on a thread of its own, without Python's lock, ended by Ctrl-C.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use wetclutch::Error;

use crate::error::{defect, exception};

/// Time between two looks for a signal.
const LOOK: Duration = Duration::from_millis(20);

/// Does the work; it has to end soon after the flag that it gets is set. A panic becomes an exception.
pub(crate) fn done<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(Arc<AtomicBool>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (sender, receiver) = channel();
    // For the lock of Python to be released around it; nobody else asks for it.
    let receiver = Mutex::new(receiver);
    std::thread::scope(|scope| {
        let flag = Arc::clone(&stop);
        scope.spawn(move || {
            // Nothing of what it leaves half done is looked at afterwards.
            let result = catch_unwind(AssertUnwindSafe(|| work(flag)));
            // The receiver waits until this comes.
            let _ = sender.send(result);
        });
        let mut interrupted = None;
        loop {
            let received = py.detach(|| receiver.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(LOOK));
            match received {
                Ok(result) => {
                    if let Some(signal) = interrupted {
                        return Err(signal);
                    }
                    return match result {
                        Ok(Ok(value)) => Ok(value),
                        Ok(Err(error)) => Err(exception(py, &error)),
                        Err(_) => Err(defect("it panicked; the message is on standard error")),
                    };
                }
                Err(RecvTimeoutError::Disconnected) => return Err(defect("the work ended without a result")),
                Err(RecvTimeoutError::Timeout) => {
                    if interrupted.is_none()
                        && let Err(signal) = py.check_signals()
                    {
                        stop.store(true, Ordering::Relaxed);
                        interrupted = Some(signal);
                    }
                }
            }
        }
    })
}
