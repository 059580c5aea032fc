//! Opens a page with the program that the desktop has for pages.

use std::path::Path;
use std::process::{Command, Stdio};

use trace::ShownPath as _;

use crate::output;

/// Opens a page if that is wanted; where it cannot be done, says where it is.
pub(crate) fn open_if(is_wanted: bool, page: &Path) {
    if is_wanted {
        open(page);
    }
}

/// The same of a page with an address.
pub(crate) fn open_address_if(is_wanted: bool, address: &str) {
    if is_wanted {
        open_place(Path::new(address));
    }
}

fn open(page: &Path) {
    // The whole path: a name may begin with a dash.
    open_place(&std::fs::canonicalize(page).unwrap_or_else(|_| page.to_owned()));
}

fn open_place(place: &Path) {
    let opened =
        has_desktop() && opener(place).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().is_ok();
    if !opened {
        output::note(&format!(
            "--open: there is no desktop to open the page on\nhint: open {} in a browser",
            place.shown()
        ));
    }
}

fn has_desktop() -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    cfg!(any(windows, target_os = "macos")) || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY")
}

fn opener(page: &Path) -> Command {
    let mut command = if cfg!(windows) {
        // Unlike `cmd /C start` it does not read the path as a command.
        Command::new("explorer")
    } else if cfg!(target_os = "macos") {
        Command::new("open")
    } else {
        Command::new("xdg-open")
    };
    command.arg(page);
    command
}
