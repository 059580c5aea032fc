//! Logs of the command line: files, and folders of them.

use std::path::{Path, PathBuf};

use trace::ShownPath as _;

use crate::failure::Failure;

/// Endings of files that may be logs.
const ENDINGS: [&str; 12] =
    ["csv", "tsv", "txt", "dat", "parquet", "mf4", "mdf", "blf", "asc", "log", "trc", "candump"];

/// The given logs, with the logs of a folder in its place, by their names.
///
/// # Errors
/// A folder cannot be read, or has no log.
pub(super) fn logs_of(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let all: Result<Vec<Vec<PathBuf>>, Failure> =
        given.iter().map(|path| if path.is_dir() { in_folder(path) } else { Ok(vec![path.clone()]) }).collect();
    Ok(all?.concat())
}

fn in_folder(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let listed = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| entry.map(|entry| entry.path())).collect::<std::io::Result<Vec<_>>>());
    let mut files = listed.map_err(|error| Failure::Input(format!("{}: {error}", folder.shown())))?;
    files.retain(|path| path.is_file() && has_ending_of_log(path));
    files.sort();
    if files.is_empty() {
        let message = format!(
            "{}: there is no log in this folder\nhint: its logs end in {}",
            folder.shown(),
            ENDINGS.map(|ending| format!(".{ending}")).join(", ")
        );
        return Err(Failure::Input(message));
    }
    Ok(files)
}

fn has_ending_of_log(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|own| ENDINGS.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
}
