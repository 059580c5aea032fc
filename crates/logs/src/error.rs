//! Errors in logs and channel maps.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use trace::ShownPath as _;

/// Why a log cannot be read or used.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error("{}: {source}", path.shown())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file as a whole is not what it should be.
    #[error("{}: {message}", path.shown())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        message: String,
    },
    /// The file is damaged at one place.
    #[error("{}: {position}: {message}", path.shown())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where: a line, byte, row or group.
        position: String,
        /// What is wrong there.
        message: String,
    },
    /// The channel map does not fit the log, or is wrong in itself.
    #[error("{message}")]
    Map {
        /// What is wrong, and what to do.
        message: String,
    },
}

impl LogError {
    pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        |source| match source.kind() {
            std::io::ErrorKind::IsADirectory => {
                Self::file(path, "this is a folder and no log\nhint: give the log itself, one of the files in it")
            }
            _ => Self::Io { path: path.to_owned(), source },
        }
    }

    pub(crate) fn file(path: &Path, message: impl Into<String>) -> Self {
        Self::File { path: path.to_owned(), message: message.into() }
    }

    pub(crate) fn damaged(path: &Path, position: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Damaged { path: path.to_owned(), position: position.into(), message: message.into() }
    }

    /// What a binary file holds at this place contradicts itself, or ends too early.
    pub(crate) fn cut_or_damaged(path: &Path, position: impl Into<String>, message: impl Display) -> Self {
        let message = message.to_string();
        // What says itself what to do is no damage.
        let hint = match message.contains("\nhint: ") {
            true => "",
            false => "\nhint: the file is cut or damaged: copy it again from the recorder",
        };
        Self::damaged(path, position, format!("{message}{hint}"))
    }

    /// Something in a channel map is wrong, or does not fit the log.
    pub fn map(message: impl Into<String>) -> Self {
        Self::Map { message: message.into() }
    }
}

/// A text from a file as messages show it: what cannot be printed is escaped, and a long one cut.
pub(crate) fn shown(text: &str) -> String {
    const LONGEST: usize = 60;
    let cut = if text.chars().nth(LONGEST).is_some() { "..." } else { "" };
    text.chars().take(LONGEST).flat_map(char::escape_debug).collect::<String>() + cut
}

/// The first of some names.
pub(crate) fn some(names: &[String]) -> String {
    const SHOWN: usize = 4;
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    names[..names.len().min(SHOWN)].join(", ") + more
}
