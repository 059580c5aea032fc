//! Errors in files.

use std::fmt::{self, Display};
use std::path::{Path, PathBuf};

use trace::ShownPath as _;

use crate::Source;
use crate::check::Check;

/// Why a vehicle or experiment file was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: {source}", path.shown())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The text is not TOML, has an unknown key, or has a value of the wrong type.
    #[error("{}:{line}: {message}", path.shown())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// The message of the parser.
        message: String,
    },
    /// A number outside its range.
    #[error("{}:{line}: `{key}` is {}, expected {allowed}{}", path.shown(), Shown(*value), hint_line(hint))]
    Range {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// The key with its tables.
        key: String,
        /// The value in the file.
        value: f64,
        /// The allowed range.
        allowed: String,
        /// A likely mistake.
        hint: Option<String>,
    },
    /// A value that does not fit the others.
    #[error("{}:{line}: `{key}`: {message}{}", path.shown(), hint_line(hint))]
    Meaning {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// The key with its tables.
        key: String,
        /// What is wrong.
        message: String,
        /// A likely mistake.
        hint: Option<String>,
    },
}

impl ConfigError {
    /// The file.
    pub fn path(&self) -> &Path {
        match self {
            Self::Read { path, .. }
            | Self::Syntax { path, .. }
            | Self::Range { path, .. }
            | Self::Meaning { path, .. } => path,
        }
    }

    /// The line, counted from 1; none for a file that cannot be read.
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::Read { .. } => None,
            Self::Syntax { line, .. } | Self::Range { line, .. } | Self::Meaning { line, .. } => Some(*line),
        }
    }

    /// The same error at another line.
    pub(crate) fn with_line(mut self, at: usize) -> Self {
        if let Self::Syntax { line, .. } | Self::Range { line, .. } | Self::Meaning { line, .. } = &mut self {
            *line = at;
        }
        self
    }

    /// The error of a file that another file names at this place. If the file cannot be read, the error is at that place.
    pub(crate) fn named_by(self, by: &Source, key: &str, offset: usize) -> Self {
        match self {
            Self::Read { path, source } => {
                let text = source.to_string();
                let (what, hint) = match text.split_once("\nhint: ") {
                    Some((what, hint)) => (what, Some(hint.to_owned())),
                    None => (text.as_str(), None),
                };
                Check::of(by).meaning(key, offset, format!("{}: {what}", path.shown()), hint)
            }
            other => other,
        }
    }

    /// An error of the parser with what to do about it; another error as it is.
    pub(crate) fn with_hint(self, hint: &str) -> Self {
        match self {
            Self::Syntax { path, line, message } => {
                Self::Syntax { path, line, message: format!("{message}\nhint: {hint}") }
            }
            other => other,
        }
    }

    /// The message without the place, for a text that is not in a file.
    pub fn what(&self) -> String {
        match self {
            Self::Read { source, .. } => source.to_string(),
            Self::Syntax { message, .. } => message.clone(),
            Self::Range { key, value, allowed, hint, .. } => {
                format!("`{key}` is {}, expected {allowed}{}", Shown(*value), hint_line(hint))
            }
            Self::Meaning { key, message, hint, .. } => format!("`{key}`: {message}{}", hint_line(hint)),
        }
    }
}

/// A number as one writes it: with an exponent if it has very many digits.
pub(crate) struct Shown(pub(crate) f64);

impl Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        if size != 0.0 && !(1e-9..1e15).contains(&size) { write!(f, "{:e}", self.0) } else { write!(f, "{}", self.0) }
    }
}

fn hint_line(hint: &Option<String>) -> String {
    hint.as_ref().map(|hint| format!("\nhint: {hint}")).unwrap_or_default()
}
