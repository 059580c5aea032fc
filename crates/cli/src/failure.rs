//! Failures of a command, and their exit codes.

use std::fmt;
use std::io;
use std::path::Path;
use std::process::ExitCode;

use car::OneShiftError;
use config::ConfigError;
use design::DesignError;
use fit::FitError;
use logs::LogError;
use plant::PlantError;
use report::PageError;
use study::StudyError;
use study::any_shift::AnyShiftError;
use trace::{ShownPath as _, TraceError};

/// Why a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Wrong usage or input: exit code 2.
    Input(String),
    /// The work itself failed: exit code 1.
    Work(String),
    /// The reader of standard output has closed it: exit code 0.
    BrokenPipe,
}

impl Failure {
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::BrokenPipe => ExitCode::SUCCESS,
            Self::Work(_) => ExitCode::from(1),
            Self::Input(_) => ExitCode::from(2),
        }
    }

    /// A file that could not be written.
    pub(crate) fn writing(path: &Path, error: &io::Error) -> Self {
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

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input(message) | Self::Work(message) => f.write_str(message),
            Self::BrokenPipe => f.write_str("the reader of standard output has closed it"),
        }
    }
}

/// An error of standard output: those of files are [`Failure::writing`] with their path.
impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::BrokenPipe,
            _ => Self::Work(format!("standard output: {error}")),
        }
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<OneShiftError> for Failure {
    fn from(error: OneShiftError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<TraceError> for Failure {
    fn from(error: TraceError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<LogError> for Failure {
    fn from(error: LogError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<PlantError> for Failure {
    fn from(error: PlantError) -> Self {
        Self::Work(error.to_string())
    }
}

impl From<DesignError> for Failure {
    fn from(error: DesignError) -> Self {
        Self::Work(error.to_string())
    }
}

impl From<PageError> for Failure {
    fn from(error: PageError) -> Self {
        Self::Work(error.to_string())
    }
}

impl From<StudyError> for Failure {
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

impl From<AnyShiftError> for Failure {
    fn from(error: AnyShiftError) -> Self {
        match error {
            AnyShiftError::Car(error) => error.into(),
            AnyShiftError::Train(_) | AnyShiftError::TooManyElements(_) | AnyShiftError::NoTables(_) => {
                Self::Input(error.to_string())
            }
        }
    }
}

impl From<FitError> for Failure {
    fn from(error: FitError) -> Self {
        match error {
            FitError::Work(message) => Self::Work(message),
            error => Self::Input(error.to_string()),
        }
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Self::Work(error.to_string())
    }
}
