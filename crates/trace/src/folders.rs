//! Folders that are made for an output, and go away again where the output fails.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::ShownPath as _;

/// The folders that this program made.
static MADE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Makes a folder and those above it.
pub(crate) fn create_folder(folder: &Path) -> io::Result<()> {
    let missing = folder.ancestors().take_while(|part| !part.as_os_str().is_empty() && !part.exists());
    let missing: Vec<PathBuf> = missing.map(Path::to_owned).collect();
    fs::create_dir_all(folder).map_err(|error| match folder.ancestors().find(|part| part.exists()) {
        Some(part) => check_folder(part).err().unwrap_or(error),
        None => error,
    })?;
    MADE.lock().unwrap_or_else(PoisonError::into_inner).extend(missing);
    Ok(())
}

/// Removes a file that was not completed, and the folders that were made for it, if nothing else is in them.
pub(crate) fn remove_with_folders(file: &Path) {
    // What cannot be removed is left: the caller already reports the error that ended the writing.
    let _ = fs::remove_file(file);
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    for folder in file.ancestors().skip(1) {
        if !made.contains(folder) || fs::remove_dir(folder).is_err() {
            return;
        }
        made.remove(folder);
    }
}

/// Refuses a file where a folder is expected.
pub(crate) fn check_folder(folder: &Path) -> io::Result<()> {
    if folder.is_dir() {
        return Ok(());
    }
    let message = format!("{} is a file, expected a folder\nhint: choose another name after -o", folder.shown());
    Err(io::Error::new(ErrorKind::NotADirectory, message))
}
