//! What can be wrong with a file.

use std::path::PathBuf;

/// Why a vehicle or experiment file was refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// Not TOML, or keys that do not belong there, or a value of the wrong type.
    #[error("{}:{line}: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What the parser said.
        message: String,
    },
    /// A number outside its range.
    #[error("{}:{line}: `{key}` is {value}, expected {allowed}{}", path.display(), hint_line(hint))]
    Range {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// The key with its tables.
        key: String,
        /// What the file says.
        value: f64,
        /// What would be allowed.
        allowed: String,
        /// A likely mistake.
        hint: Option<String>,
    },
    /// A value that does not fit the others.
    #[error("{}:{line}: `{key}`: {message}{}", path.display(), hint_line(hint))]
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
    /// What is wrong, without the place: for a text that stands in no file.
    pub fn what(&self) -> String {
        match self {
            Self::Read { source, .. } => source.to_string(),
            Self::Syntax { message, .. } => message.clone(),
            Self::Range { key, value, allowed, hint, .. } => {
                format!("`{key}` is {value}, expected {allowed}{}", hint_line(hint))
            }
            Self::Meaning { key, message, hint, .. } => format!("`{key}`: {message}{}", hint_line(hint)),
        }
    }
}

fn hint_line(hint: &Option<String>) -> String {
    hint.as_ref().map(|hint| format!("\nhint: {hint}")).unwrap_or_default()
}
