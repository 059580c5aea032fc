//! Errors of a command, and their exit codes.

use std::fmt;
use std::io;
use std::path::Path;

use car::OneShiftError;
use config::ConfigError;
use design::DesignError;
use fit::FitError;
use logs::LogError;
use plant::PlantError;
use plant::car::CarError;
use report::PageError;
use study::StudyError;
use study::gearbox::EvaluateError;
use trace::{ShownPath as _, TraceError};

/// Why a call failed. A message has one line or more; a line that begins with `hint: ` says what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Error {
    /// Wrong usage or input.
    Input(String),
    /// The work itself failed: a simulation diverged, a design has no solution, a file could not be written.
    Work(String),
    /// The reader of standard output has closed it.
    BrokenPipe,
}

/// How the lines with hints begin.
const HINT: &str = "hint: ";

impl Error {
    /// The message without its hints.
    pub fn message(&self) -> String {
        let text = self.to_string();
        text.lines().filter(|line| !line.starts_with(HINT)).collect::<Vec<_>>().join("\n")
    }

    /// What to do about it, if that is known.
    pub fn hint(&self) -> Option<String> {
        let text = self.to_string();
        let hints: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix(HINT)).collect();
        (!hints.is_empty()).then(|| hints.join("\n"))
    }

    /// The file and the line in which the error is, from 1, where the message begins with them.
    pub fn place(&self) -> Option<(String, Option<u32>)> {
        place_of(&self.to_string())
    }

    /// The key in question, where the message names one in backticks.
    pub fn key(&self) -> Option<String> {
        let message = self.message();
        let key = message.split('`').nth(1)?;
        let is_key = !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || "_.[]".contains(c));
        is_key.then(|| key.to_owned())
    }

    /// Of work that was ended from outside.
    pub(crate) fn interrupted() -> Self {
        Self::Work("interrupted".to_owned())
    }

    /// A file that could not be written.
    pub fn writing(path: &Path, error: &io::Error) -> Self {
        let mut message = format!("{}: {error}", path.shown());
        if let Some(hint) = hint_for(error.kind()).filter(|_| !message.contains("\nhint: ")) {
            message += &format!("\nhint: {hint}");
        }
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::BrokenPipe,
            io::ErrorKind::IsADirectory => Self::Input(message),
            _ => Self::Work(message),
        }
    }
}

/// What to do about a file that cannot be written.
fn hint_for(kind: io::ErrorKind) -> Option<&'static str> {
    match kind {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            Some("make room on the disk, or choose another place after -o")
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            Some("choose a folder after -o that can be written to")
        }
        io::ErrorKind::InvalidFilename => Some("choose a shorter name after -o"),
        _ => None,
    }
}

/// The file and the line that a message begins with: `car.toml:14: ...` or `car.toml: ...`.
fn place_of(text: &str) -> Option<(String, Option<u32>)> {
    let first = text.lines().next()?;
    let mut parts = first.split(": ");
    let place = parts.next()?;
    parts.next()?;
    if place.contains(char::is_whitespace) {
        return None;
    }
    match place.rsplit_once(':').map(|(file, line)| (file, line.parse())) {
        Some((file, Ok(line))) => Some((file.to_owned(), Some(line))),
        _ => Some((place.to_owned(), None)).filter(|(file, _)| file.contains('.')),
    }
}

impl std::error::Error for Error {}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(message) | Self::Work(message) => f.write_str(message),
            Self::BrokenPipe => f.write_str("the reader of standard output has closed it"),
        }
    }
}

/// An error of standard output: those of files are [`Error::writing`] with their path.
impl From<io::Error> for Error {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::BrokenPipe,
            _ => Self::Work(format!("standard output: {error}")),
        }
    }
}

impl From<ConfigError> for Error {
    fn from(error: ConfigError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<OneShiftError> for Error {
    fn from(error: OneShiftError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<TraceError> for Error {
    fn from(error: TraceError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<LogError> for Error {
    fn from(error: LogError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<CarError> for Error {
    fn from(error: CarError) -> Self {
        match error {
            CarError::Request(message) => Self::Input(message),
            other => Self::Work(other.to_string()),
        }
    }
}

impl From<PlantError> for Error {
    fn from(error: PlantError) -> Self {
        Self::Work(error.to_string())
    }
}

impl From<DesignError> for Error {
    fn from(error: DesignError) -> Self {
        Self::Work(error.to_string())
    }
}

impl From<PageError> for Error {
    fn from(error: PageError) -> Self {
        Self::Work(error.to_string())
    }
}

impl From<StudyError> for Error {
    fn from(error: StudyError) -> Self {
        match error {
            StudyError::Config(error) => error.into(),
            StudyError::Search(_) | StudyError::Defect { .. } | StudyError::Threads(_) => Self::Work(error.to_string()),
            StudyError::Plant(error) => error.into(),
            StudyError::Design(error) => error.into(),
            StudyError::Trace(error) => error.into(),
            StudyError::AnyShift(error) => error.into(),
        }
    }
}

impl From<EvaluateError> for Error {
    fn from(error: EvaluateError) -> Self {
        match error {
            EvaluateError::Car(error) => error.into(),
            EvaluateError::Train(_)
            | EvaluateError::TooManyElements(_)
            | EvaluateError::NoTables(_)
            | EvaluateError::Memory(_) => Self::Input(error.to_string()),
        }
    }
}

impl From<FitError> for Error {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Work(message) => Self::Work(message),
            FitError::Stopped => Self::interrupted(),
            error => Self::Input(error.to_string()),
        }
    }
}

impl From<serde_json::Error> for Error {
    fn from(error: serde_json::Error) -> Self {
        Self::Work(error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_a_message_are_found() {
        let error = Error::Input("car.toml:14: `mass_kg` is -1, expected 200 to 60000\nhint: in kg".to_owned());
        assert_eq!(error.place(), Some(("car.toml".to_owned(), Some(14))));
        assert_eq!(error.key().as_deref(), Some("mass_kg"));
        assert_eq!(error.hint().as_deref(), Some("in kg"));
        assert_eq!(error.message(), "car.toml:14: `mass_kg` is -1, expected 200 to 60000");
        let plain = Error::Work("the simulation diverged".to_owned());
        assert_eq!((plain.place(), plain.key(), plain.hint()), (None, None, None));
    }
}
