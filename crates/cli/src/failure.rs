//! Exit codes of failures.

use std::process::ExitCode;

pub(crate) use wetclutch::Error as Failure;

/// The exit code of a command that failed so.
pub(crate) fn exit_code(failure: &Failure) -> ExitCode {
    match failure {
        Failure::BrokenPipe => ExitCode::SUCCESS,
        Failure::Work(_) => ExitCode::from(1),
        Failure::Input(_) => ExitCode::from(2),
    }
}
