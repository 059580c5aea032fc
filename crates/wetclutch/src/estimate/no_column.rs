//! A column that is asked for and is not there.

use std::cmp::Reverse;

use crate::Error;

/// Columns that a message lists.
const LISTED: usize = 12;

/// Letters that two names have in common at their beginning when one is meant for the other.
const COMMON: usize = 5;

/// The error of a name that is none of these columns, or that was given before.
pub(super) fn no_column(name: &str, known: &[&str], is_twice: bool) -> Error {
    let shown = name.escape_debug();
    if is_twice {
        return Error::Input(format!("--columns: `{shown}` is given twice\nhint: name each column once"));
    }
    let hint = match meant(name, known) {
        Some(meant) => format!("did you mean `{meant}`?"),
        None if known.len() > LISTED => {
            let (first, more) = (&known[..LISTED], known.len() - LISTED);
            format!("the columns are {} and {more} more (docs/reference/columns.md)", first.join(", "))
        }
        None => format!("the columns are {}", known.join(", ")),
    };
    Error::Input(format!("--columns: there is no column `{shown}`\nhint: {hint}"))
}

/// The shortest column that contains the name, or is contained in it; else the one with the longest beginning in common.
fn meant<'k>(name: &str, known: &[&'k str]) -> Option<&'k str> {
    let contains = |known: &&&str| !name.is_empty() && (known.contains(name) || name.contains(**known));
    let common = |known: &str| known.chars().zip(name.chars()).take_while(|(one, other)| one == other).count();
    let shortest = known.iter().filter(contains).min_by_key(|known| known.len());
    let alike = || {
        known.iter().filter(|known| common(known) >= COMMON).max_by_key(|known| (common(known), Reverse(known.len())))
    };
    shortest.or_else(alike).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_column_that_is_meant_is_named_and_a_repeated_one_too() {
        let known = ["health", "turbine_speed_rad_s", "oncoming_pressure_pa", "oncoming_pressure_range_max_pa"];
        let hint = |name: &str| no_column(name, &known, false).to_string();
        assert!(
            hint("turbine_speed")
                .ends_with("there is no column `turbine_speed`\nhint: did you mean `turbine_speed_rad_s`?")
        );
        assert!(hint("oncoming_pressure").ends_with("`oncoming_pressure_pa`?"));
        assert!(hint("oncoming_presure_pa").ends_with("`oncoming_pressure_pa`?"), "{}", hint("oncoming_presure_pa"));
        assert!(hint("q").contains("hint: the columns are health, turbine_speed_rad_s"));
        assert!(no_column("health", &known, true).to_string().contains("`health` is given twice"));
        let many: Vec<&str> = ["a"; 20].to_vec();
        assert!(no_column("q", &many, false).to_string().contains(" and 8 more"));
    }
}
