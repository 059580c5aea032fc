//! A configuration file as it was read.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::ConfigError;

/// What a configuration file describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A vehicle.
    Vehicle,
    /// A simulated drive.
    Experiment,
    /// Drives with varied parameters.
    Study,
}

/// Text of a file with its name and fingerprint.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Where the text came from; for a built-in file, the name it has in the repository.
    pub path: PathBuf,
    /// The text.
    pub text: String,
}

impl Source {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read as UTF-8 text.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), text })
    }

    /// A text that is part of the program.
    pub fn built_in(path: &str, text: &str) -> Self {
        Self { path: PathBuf::from(path), text: text.to_owned() }
    }

    /// SHA-256 of the text, as hexadecimal digits.
    pub fn sha256(&self) -> String {
        Sha256::digest(self.text.as_bytes()).iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Line, counted from 1, of a byte offset.
    pub fn line(&self, offset: usize) -> usize {
        1 + self.text.bytes().take(offset).filter(|&byte| byte == b'\n').count()
    }

    /// What the file describes, by its tables.
    ///
    /// # Errors
    /// The text is not TOML, or neither a vehicle nor an experiment nor a study.
    pub fn kind(&self) -> Result<Kind, ConfigError> {
        let tables: toml::Table = self.parse()?;
        let has = |key| tables.contains_key(key);
        match (has("gear_train"), has("shift"), has("factor")) {
            (true, false, false) => Ok(Kind::Vehicle),
            (false, true, false) => Ok(Kind::Experiment),
            (false, false, true) => Ok(Kind::Study),
            _ => Err(ConfigError::Syntax {
                path: self.path.clone(),
                line: 1,
                message: "no vehicle file (with [gear_train]), experiment file (with [shift]) or study file (with [[factor]])".to_owned(),
            }),
        }
    }

    /// Reads the text into raw types.
    pub(crate) fn parse<T: DeserializeOwned>(&self) -> Result<T, ConfigError> {
        toml::from_str(&self.text).map_err(|error| ConfigError::Syntax {
            path: self.path.clone(),
            line: error.span().map_or(1, |span| self.line(span.start)),
            message: error.message().to_owned(),
        })
    }
}
