//! A channel of a log, and which one is the time.

/// A channel of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Its name.
    pub name: String,
    /// Its unit as the log writes it; may be empty.
    pub unit: String,
    /// What it shares a clock with: the message of a bus signal, the channel group of an MDF file. Empty for tables.
    pub group: String,
}

/// Which column of a table is the time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TimeColumn {
    /// Its name.
    pub name: String,
    /// Its unit, if the log does not say it.
    pub unit: Option<String>,
}
