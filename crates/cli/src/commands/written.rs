//! What may be replaced: an output replaces a file of its own kind, and no measurement.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use trace::ShownPath as _;

use crate::failure::Failure;

/// Whether any file is replaced.
static IS_FORCED: AtomicBool = AtomicBool::new(false);

/// Any file may be replaced from now on (`--force`).
pub(crate) fn replace_any() {
    IS_FORCED.store(true, Ordering::Relaxed);
}

/// Whether any file may be replaced.
pub(super) fn is_forced() -> bool {
    IS_FORCED.load(Ordering::Relaxed)
}

/// Bytes at the beginning of a file that tell its kind.
const HEAD: u64 = 64 << 10;

/// Refuses an output that is there and is not of the kind that the command writes, such as `vehicle file`: it may be a measurement.
pub(super) fn replaces_only(kind: &str, output: &Path, is_kind: impl FnOnce(&Path) -> bool) -> Result<(), Failure> {
    if is_forced() || !holds_something(output) || is_kind(output) {
        return Ok(());
    }
    Err(Failure::Input(format!(
        "{}: exists and is no {kind}\nhint: choose another name after -o, or move the file; --force replaces it",
        output.shown()
    )))
}

/// Refuses files with these names in a folder that this program did not write. A table, which may be a measurement, is of this program where the page
/// among the names is.
pub(super) fn replaces_only_ours(folder: &Path, names: &[&str]) -> Result<(), Failure> {
    let paths: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    let has_page = paths.iter().any(|path| is_of(path, "html") && is_ours(path));
    let is_kept = |path: &Path| has_page || !is_of(path, "csv") && is_ours(path);
    paths.iter().try_for_each(|path| replaces_only("file of this program", path, is_kept))
}

/// Whether a file has this ending.
fn is_of(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|own| own == ending)
}

/// Whether a page or a text names this program, or a file is a figure or no text.
fn is_ours(path: &Path) -> bool {
    const WITHOUT_NAME: [&str; 3] = ["svg", "bin", "fmu"];
    let head = head(path);
    if is_of(path, "html") {
        head.contains("| wetclutch</title>")
    } else {
        WITHOUT_NAME.iter().any(|ending| is_of(path, ending)) || head.contains("wetclutch")
    }
}

/// Whether there is a file that is not empty.
pub(super) fn holds_something(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|there| there.is_file() && there.len() > 0)
}

/// The beginning of a file as text; empty where it cannot be read.
pub(super) fn head(path: &Path) -> String {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    read.map_or(String::new(), |_| String::from_utf8_lossy(&head).into_owned())
}

/// Whether a file is a page in HTML, of any program.
pub(super) fn is_page(path: &Path) -> bool {
    let head = head(path).to_lowercase();
    let begin = head.trim_start_matches('\u{feff}').trim_start();
    begin.starts_with("<!doctype html") || begin.starts_with("<html")
}
