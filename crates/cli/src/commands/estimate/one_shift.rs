//! `wetclutch estimate` of the shift of a vehicle file of one shift.

use std::path::Path;

use config::VehicleFile;
use report::log_page::shift_rows;
use wetclutch::estimate::WITHOUT_SENSORS;
use wetclutch::estimate::one_shift::{self, ShiftEstimates};

use super::outputs::beside;
use super::{Messages, SHOWN, Setup, finish, shift_lines};
use crate::commands::{JsonObject, write_cells, write_json_list};
use crate::failure::Failure;

/// Estimates a log, and says what was found and where it is.
pub(super) fn estimate(
    setup: &Setup<'_>,
    file: &VehicleFile,
    path: &Path,
    output: Option<&Path>,
    say: &mut Messages,
) -> Result<(), Failure> {
    let options = setup.options_for(output);
    let prepared = one_shift::Setup::new(file, &options)?;
    let found = one_shift::estimate(&prepared, setup.log(path), setup.destination(output), &mut |note| say.note(note))?;
    let places = output.and_then(beside).filter(|_| !found.shifts.is_empty());
    let cells = found.shift_cells();
    say.result = setup.result((path, output), &cells);
    if let Some([csv, json, _]) = &places {
        write_cells(csv, &cells)?;
        write_json_list(json, cells.into_iter().map(JsonObject::of))?;
    }
    let found = found.with_times_from_origin();
    found.findings.iter().for_each(|sentence| say.note(sentence));
    report(&found, setup, output, say)?;
    if options.sensors.is_none() {
        say.note(WITHOUT_SENSORS);
    }
    say.note(&format!("observer: {}", found.observer));
    if !file.defaults_taken.is_empty() {
        say.note(
            "gear train: one with the two ratios of the short vehicle file, not that of the car. The clutch torque is that of its clutch; in the car's \
             train the torque of a clutch in another place differs by a constant factor",
        );
    }
    finish(setup, output, places.as_ref(), || found.page(file, path), say)
}

/// The shifts as a table, if there are any.
fn report(found: &ShiftEstimates, setup: &Setup<'_>, output: Option<&Path>, say: &mut Messages) -> Result<(), Failure> {
    if found.shifts.is_empty() {
        return Ok(());
    }
    if !setup.arguments.json {
        let (titles, rows) = shift_rows(&found.shifts, SHOWN);
        let lines = shift_lines(&titles, &rows, found.shifts.len() - rows.len());
        say.table(&lines, setup.is_output_free(output))?;
    }
    let others = || found.shifts.iter().filter(|shift| !shift.of_vehicle);
    if let Some(first) = others().next() {
        say.note(&format!(
            "{} shifts are not the one of the vehicle file, as {}-{}: of these no pressure is estimated",
            others().count(),
            first.shift.from,
            first.shift.to
        ));
    }
    match found.shifts.iter().filter(|shift| shift.of_vehicle && shift.estimated.is_none()).count() {
        0 => {}
        unseen => say.note(&format!(
            "warning: {unseen} shifts of the vehicle file are in the speeds and not in the estimate: the command of the valve stays below \
             the kiss point, or a speed is refused throughout the shift\nhint: check unit and scale of the command, and whether it is that of the \
             oncoming clutch"
        )),
    }
    Ok(())
}
