//! What may be replaced: an output replaces a file of its own kind, and no measurement.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use trace::ShownPath as _;

use crate::failure::Failure;

/// Bytes at the beginning of a file that tell its kind.
const HEAD: u64 = 64 << 10;

/// Refuses an output that is there and is not of the kind that the command writes, such as `vehicle file`: it may be a measurement.
pub(super) fn replaces_only(kind: &str, output: &Path, is_kind: impl FnOnce(&Path) -> bool) -> Result<(), Failure> {
    if !holds_something(output) || is_kind(output) {
        return Ok(());
    }
    Err(Failure::Input(format!(
        "{}: exists and is no {kind}\nhint: choose another name after -o, or move the file",
        output.shown()
    )))
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
