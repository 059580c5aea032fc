//! Logs of the command line: files, and folders of them.

use std::path::{Path, PathBuf};

use trace::ShownPath as _;

use crate::commands::is_same_file;
use crate::commands::written::head;
use crate::failure::Failure;

/// Endings of files that may be logs.
const ENDINGS: [&str; 12] =
    ["csv", "tsv", "txt", "dat", "parquet", "mf4", "mdf", "blf", "asc", "log", "trc", "candump"];

/// The given logs, with the logs of a folder in its place, by their names: no output of this command, and of this program's simulations what was
/// measured.
///
/// # Errors
/// A folder cannot be read, or has no log.
pub(super) fn logs_of(given: &[PathBuf], outputs: &[&PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let all: Result<Vec<Vec<PathBuf>>, Failure> = given
        .iter()
        .map(|path| if path.is_dir() { in_folder(path, outputs) } else { Ok(vec![path.clone()]) })
        .collect();
    Ok(all?.concat())
}

fn in_folder(folder: &Path, outputs: &[&PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let listed = std::fs::read_dir(folder)
        .and_then(|entries| entries.map(|entry| entry.map(|entry| entry.path())).collect::<std::io::Result<Vec<_>>>());
    let mut files = listed.map_err(|error| Failure::Input(format!("{}: {error}", folder.shown())))?;
    files.retain(|path| path.is_file() && has_ending_of_log(path));
    files.retain(|path| !outputs.iter().any(|output| is_same_file(output, path)));
    files.sort();
    let all = files.clone();
    let measured = |stem: &str| all.contains(&folder.join(format!("{stem}_measured.csv")));
    files.retain(|path| {
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        !measured(stem.strip_suffix("_shifts").unwrap_or(stem)) && !is_table_of_shifts(path)
    });
    if files.is_empty() {
        let message = format!(
            "{}: there is no log in this folder\nhint: its logs end in {}; folders in it are not read",
            folder.shown(),
            ENDINGS.map(|ending| format!(".{ending}")).join(", ")
        );
        return Err(Failure::Input(message));
    }
    Ok(files)
}

/// Whether a file is a table of shifts of this program.
fn is_table_of_shifts(path: &Path) -> bool {
    head(path).lines().next().is_some_and(|titles| titles.starts_with("number,time_s,from_gear,to_gear,"))
}

fn has_ending_of_log(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|own| ENDINGS.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
}
