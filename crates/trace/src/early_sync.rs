//! The way of a file to the disk while it is still written: at the end of a large file little is left to wait for.

use std::fs::File;
use std::io;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};

/// Bytes from one request to the next.
const EVERY: usize = 16 << 20;

/// Asks the system to bring a growing file to the disk, on a thread of its own. A file that is smaller than [`EVERY`] gets none.
#[derive(Debug, Default)]
pub(crate) struct EarlySync {
    /// Bytes since the last request.
    written: usize,
    thread: Option<(SyncSender<()>, JoinHandle<io::Result<()>>)>,
}

impl EarlySync {
    /// So many more bytes were written to the file.
    pub(crate) fn wrote(&mut self, bytes: usize, file: &File) {
        self.written += bytes;
        if self.written < EVERY {
            return;
        }
        self.written = 0;
        if self.thread.is_none() {
            self.thread = begin(file).ok();
        }
        if let Some((requests, _)) = &self.thread {
            // One that waits already serves for this one too.
            let _ = requests.try_send(());
        }
    }

    /// Waits for the requests so far.
    ///
    /// # Errors
    /// The disk has not taken the bytes. The system says so once, to whom asks first.
    pub(crate) fn end(&mut self) -> io::Result<()> {
        let Some((requests, thread)) = self.thread.take() else { return Ok(()) };
        drop(requests);
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the thread that brings the file to the disk has ended")))
    }
}

fn begin(file: &File) -> io::Result<(SyncSender<()>, JoinHandle<io::Result<()>>)> {
    let file = file.try_clone()?;
    let (requests, asked) = sync_channel(1);
    let thread =
        Builder::new().name("sync".to_owned()).spawn(move || asked.iter().try_for_each(|()| file.sync_data()))?;
    Ok((requests, thread))
}
