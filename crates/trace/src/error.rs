//! What can be wrong with a measurement file.

use std::path::PathBuf;

/// Why a trace cannot be read, written or used.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file is not a table.
    #[error("{}: {message}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A row that does not fit.
    #[error("{}:{line}: {message}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: u64,
        /// What is wrong.
        message: String,
    },
    /// A signal that is needed holds something else than numbers.
    #[error("{}: column `{column}` holds `{text}` (row {row}), which is no number\nhint: leave a lost sample empty", path.display())]
    NotNumbers {
        /// The file.
        path: PathBuf,
        /// The signal.
        column: String,
        /// Row of the first cell that is no number, counted from 1 below the names.
        row: usize,
        /// What stands there.
        text: String,
    },
    /// A signal that is needed is not there.
    #[error("{}: there is no column `{wanted}`\nhint: {}", path.display(), column_hint(wanted, present))]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// The signal.
        wanted: String,
        /// The columns that are there.
        present: Vec<String>,
    },
}

/// Names the column that was probably meant, or all that are there.
fn column_hint(wanted: &str, present: &[String]) -> String {
    let words = |name: &str| name.split('_').map(str::to_owned).collect::<Vec<_>>();
    let shared = |name: &str| words(name).iter().filter(|word| words(wanted).contains(word)).count();
    match present.iter().max_by_key(|name| shared(name)).filter(|name| shared(name) >= 2) {
        Some(near) => format!("`{near}` looks near; rename it, with its unit as ending (_rad_s or _rpm, _a or _ma)"),
        None => format!("the columns are {}", present.join(", ")),
    }
}
