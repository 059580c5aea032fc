//! Which files are read and written, for who wants to know.

use std::path::Path;
use std::sync::OnceLock;

/// What was done with a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileUse {
    /// It was opened for reading.
    Read,
    /// It is complete and has its name.
    Written,
}

/// Takes each use of a file.
pub type Watcher = fn(FileUse, &Path);

static WATCHER: OnceLock<Watcher> = OnceLock::new();

/// Gives each use of a file to a function from now on; the first one stays.
pub fn watch_files(watcher: Watcher) {
    let _ = WATCHER.set(watcher);
}

/// Reports a use of a file.
pub fn file_used(how: FileUse, path: &Path) {
    if let Some(watcher) = WATCHER.get() {
        watcher(how, path);
    }
}
