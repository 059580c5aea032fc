//! Errors in measurement files.

use std::path::PathBuf;

use crate::{ShownPath as _, signal, units};

/// Why a trace cannot be read or used.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The file cannot be read.
    #[error("{}: {source}", path.shown())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a table.
    #[error("{}: {message}", path.shown())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A row that does not fit.
    #[error("{}:{line}: {message}", path.shown())]
    Row {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: u64,
        /// What is wrong.
        message: String,
    },
    /// A signal that is needed contains text that is not a number.
    #[error(
        "{}: column `{column}` contains `{text}` (row {row}), which is not a number\nhint: leave a lost sample empty",
        path.shown()
    )]
    NotNumbers {
        /// The file.
        path: PathBuf,
        /// The signal.
        column: String,
        /// Row of the first cell that is not a number, counted from 1 below the names.
        row: usize,
        /// The text of the cell.
        text: String,
    },
    /// The log has the other kind of valve command than the vehicle.
    #[error(
        "{}: the log has `{found}`, but the command of the vehicle's valve is `{wanted}`\n\
         hint: give the vehicle file of this log, or check `kind` in its [observer.valve] and [clutch.*.valve]",
        path.shown()
    )]
    OtherCommand {
        /// The file.
        path: PathBuf,
        /// The signal that the vehicle needs.
        wanted: String,
        /// The signal that the log has.
        found: String,
    },
    /// A signal that is needed is missing.
    #[error("{}: there is no column `{wanted}`\nhint: {}", path.shown(), column_hint(wanted, present))]
    MissingColumn {
        /// The file.
        path: PathBuf,
        /// The signal.
        wanted: String,
        /// The columns of the file.
        present: Vec<String>,
    },
}

impl TraceError {
    /// A text from a file as messages show it: what cannot be printed is escaped, and a long one cut.
    pub(crate) fn shown(text: &str) -> String {
        const LONGEST: usize = 40;
        let cut = if text.chars().nth(LONGEST).is_some() { "..." } else { "" };
        text.chars().take(LONGEST).flat_map(char::escape_debug).collect::<String>() + cut
    }
}

/// How times are read that are no numbers in s or ms.
pub(crate) const TIME_BY_MAP: &str = "a date and time, as `31.03.2024 01:59:30.000`, is read with a channel map: `wetclutch inspect LOG \
    --suggest > map.toml` writes one, for --map map.toml";

/// The endings of a name like this one, for the units that its signal may have.
fn endings_like(wanted: &str) -> &'static str {
    match wanted {
        _ if wanted.ends_with("_rad_s") => " (_rad_s or _rpm)",
        _ if wanted.ends_with("_a") => " (_a or _ma)",
        _ if wanted.ends_with("_pa") => " (_pa, _kpa, _bar or _mpa)",
        _ => "",
    }
}

/// Names a column with a similar name, or all columns.
fn column_hint(wanted: &str, present: &[String]) -> String {
    if wanted == signal::TIME
        && let Some(near) = present.iter().find(|name| name.contains("time") || name.contains("date"))
    {
        let near = TraceError::shown(near);
        return format!(
            "rename `{near}` to `time_s` or `time_ms` if it is in s or ms, and a time of a data frame to `time_s`; {TIME_BY_MAP}"
        );
    }
    let endings = endings_like(wanted);
    const MAXIMUM: usize = 20;
    // What a name is about: without its unit, and without a word that many names have.
    let about = |name: &str| -> Vec<String> {
        let (name, _) = units::to_si(name);
        const PLAIN: [&str; 11] = ["rad", "s", "a", "pa", "percent", "n", "m", "speed", "current", "duty", "element"];
        let plain = |word: &&str| !PLAIN.contains(word);
        name.split('_').filter(plain).map(str::to_owned).collect()
    };
    // Columns of a drive that are what they are called.
    const WORDS: [&str; 3] = ["gear", "target_gear", "engine_share"];
    let known = |name: &str| WORDS.contains(&name) || signal::MEASURABLE.contains(&units::to_si(name).0.as_str());
    let wanted = about(wanted);
    let near = |name: &&String| !known(name) && about(name).iter().any(|word| wanted.contains(word));
    if let Some(near) = present.iter().find(near) {
        let near = TraceError::shown(near);
        return format!("`{near}` has a similar name; rename it, with its unit at the end{endings}");
    }
    let names: Vec<String> = present.iter().take(MAXIMUM).map(|name| TraceError::shown(name)).collect();
    match present.len() {
        more if more > MAXIMUM => format!("the columns are {} and {} more", names.join(", "), more - MAXIMUM),
        _ => format!("the columns are {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_of_another_element_is_no_similar_name() {
        let present = ["time_s", "element_d_current_a", "turbine_n"].map(str::to_owned);
        assert!(column_hint("element_e_current_a", &present).starts_with("the columns are "));
        assert!(column_hint("turbine_speed_rad_s", &present).starts_with("`turbine_n` has a similar name"));
    }

    #[test]
    fn a_hint_has_units_of_the_quantity_alone() {
        let hint = |wanted: &str, name: &str| column_hint(wanted, &[name.to_owned()]);
        assert!(hint("turbine_speed_rad_s", "turbine_n").ends_with("at the end (_rad_s or _rpm)"));
        assert!(
            hint("element_e_current_a", "e_valve").starts_with("`e_valve` has")
                && !hint("x_current_a", "x_i").contains("rpm")
        );
        let time = hint(signal::TIME, "time");
        assert!(time.contains("`time_s` or `time_ms`") && time.contains("--map") && !time.contains("_rad_s"), "{time}");
    }

    #[test]
    fn another_column_of_a_drive_is_no_similar_name() {
        let present = ["time_s", "target_gear", "engine_share"].map(str::to_owned);
        for wanted in ["gear", "engine_speed_rad_s"] {
            assert!(column_hint(wanted, &present).starts_with("the columns are "), "{wanted}");
        }
    }
}
