//! Why a fit is not possible.

use logs::LogError;

/// Why a fit is not possible.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The logs or the vehicle are not what a fit can use.
    #[error("{0}")]
    Input(String),
    /// The fit was ended from outside.
    #[error("interrupted")]
    Stopped,
    /// The fit found no minimum.
    #[error("{0}")]
    Work(String),
}

impl FitError {
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self::Input(message.into())
    }
}
