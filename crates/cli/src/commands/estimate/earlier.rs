//! What an earlier estimate wrote, which a new one may replace.

use std::path::Path;

use logs::{Log, OpenOptions};
use study::EstimateColumns;
use trace::{ShownPath as _, signal};
use wetclutch::estimate::gearbox::{is_car_column, is_measured_column};

use super::outputs::beside;
use crate::commands::written::{head, holds_something, is_forced, replaces_only};
use crate::failure::Failure;

/// Refuses an output that would replace what no estimate wrote, itself or with the files beside it.
pub(super) fn replaces_only_estimates(output: &Path) -> Result<(), Failure> {
    replaces_only("estimate of this program", output, is_estimate)?;
    let foreign = |place: &std::path::PathBuf| !is_forced() && holds_something(place) && !is_beside_an_estimate(place);
    match beside(output).into_iter().flatten().find(foreign) {
        None => Ok(()),
        Some(foreign) => Err(Failure::Input(format!(
            "{}: no estimate wrote this file, and one into {} would replace it\nhint: choose another name after -o, or move the file; --force replaces it",
            foreign.shown(),
            output.shown()
        ))),
    }
}

/// Whether a file begins as the table of shifts or the page of an estimate does.
fn is_beside_an_estimate(path: &Path) -> bool {
    let head = head(path);
    ["| wetclutch</title>", "from_gear"].iter().any(|mark| head.contains(mark))
}

/// Whether all columns of a table are those of estimates. One that cannot be read is none.
fn is_estimate(path: &Path) -> bool {
    let head = head(path);
    let names: Vec<String> = if head.starts_with("MDF") || head.starts_with("PAR1") {
        let log = Log::open(path, &OpenOptions::default());
        log.map_or(Vec::new(), |log| log.channels().iter().map(|channel| channel.name.clone()).collect())
    } else {
        let mut names = head.lines().next().unwrap_or_default().split(',');
        if names.next() != Some(signal::TIME) {
            return false;
        }
        names.map(str::to_owned).collect()
    };
    // A log may have both gears and the readings, and nothing else.
    let gears = [signal::GEAR, signal::TARGET_GEAR, signal::GEAR_NUMBER, signal::TARGET_GEAR_NUMBER];
    let is_of_log = |name: &str| gears.contains(&name) || is_measured_column(name);
    names.iter().all(|name| is_estimate_column(name) || is_of_log(name)) && names.iter().any(|name| !is_of_log(name))
}

/// Whether an estimate of any observer and of any car may have a column of this name.
fn is_estimate_column(name: &str) -> bool {
    let all = EstimateColumns { shaft: true, range: true, shaft_range: true };
    all.columns().iter().any(|column| column.name == name) || is_car_column(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_estimates_are_told_from_those_of_logs() {
        let estimates =
            ["oncoming_pressure_estimate_pa", "offgoing_torque_least_n_m", "element_k1_valve_model_pressure_pa"];
        assert!(
            estimates
                .iter()
                .chain(&[
                    "phase",
                    "health",
                    "turbine_torque_estimate_n_m",
                    "offgoing_hidden",
                    "target_gear_number",
                    "oncoming_command_reading",
                    "element_k1_command_reading",
                    "element_e_pressure_least_pa"
                ])
                .all(|name| is_estimate_column(name))
        );
        let logs = ["element_k1_current_a", "turbine_speed_rad_s", "oncoming_pressure_pa", "N_Eng"];
        assert!(!signal::MEASURABLE.iter().chain(&logs).any(|name| is_estimate_column(name)));
    }
}
