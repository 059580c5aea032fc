//! `wetclutch estimate` of a drive of a car with a gearbox.

use std::path::Path;

use config::CarFile;
use report::drive_page::{findings, shift_cells, shift_rows, shift_words};
use trace::Cell;
use wetclutch::EstimateOptions;
use wetclutch::estimate::gearbox::{self, DriveEstimates};

use super::learnt::{self, Kept};
use super::outputs::beside;
use super::{Messages, SHOWN, Setup, finish, shift_lines};
use crate::commands::{JsonObject, write_cells, write_json_list};
use crate::failure::Failure;

/// Refuses options that cannot be used with such a car.
pub(super) fn check(learnt: Option<&Path>, file: &CarFile, options: &EstimateOptions) -> Result<(), Failure> {
    gearbox::Setup::new(file, options)?;
    learnt.map_or(Ok(()), |path| learnt::check(path, file))
}

/// Estimates a log, and says what was found and where it is.
pub(super) fn estimate(
    setup: &Setup<'_>,
    file: &CarFile,
    path: &Path,
    output: Option<&Path>,
    say: &mut Messages,
) -> Result<(), Failure> {
    let learnt_file = setup.learnt;
    let learnt = learnt_file.map(|path| learnt::read(path, file)).transpose()?.flatten();
    let options = EstimateOptions { learnt, ..setup.options_for(output) };
    let prepared = gearbox::Setup::new(file, &options)?;
    let found = gearbox::estimate(&prepared, setup.log(path), setup.destination(output), &mut |note| say.note(note))?;
    let places = output.and_then(beside).filter(|_| !found.drive.shifts.is_empty());
    let shifts = found.drive.shifts.iter();
    let cells: Vec<Vec<(String, Cell<'_>)>> = shifts.map(|shift| shift_cells(shift, file)).collect();
    say.result = setup.result((path, output), &cells);
    if let Some([csv, json, _]) = &places {
        write_cells(csv, &cells)?;
        write_json_list(json, cells.into_iter().map(JsonObject::of))?;
    }
    let found = found.with_times_from_origin();
    if !setup.arguments.json {
        table(&found, file, setup.is_output_free(output), say)?;
    }
    findings(&found.drive).iter().for_each(|sentence| say.note(sentence));
    found.said_of_sensors().into_iter().for_each(|sentence| say.note(sentence));
    finish(setup, output, places.as_ref(), || found.page(file, path), say)?;
    learnt_file.map_or(Ok(()), |path| Kept::of(path, file, &found.learnt).write(say))
}

/// The shifts as a table.
fn table(found: &DriveEstimates, file: &CarFile, is_output_free: bool, say: &mut Messages) -> Result<(), Failure> {
    let (titles, mut rows) = shift_rows(&found.drive, file);
    let more = rows.len().saturating_sub(SHOWN);
    rows.truncate(SHOWN);
    if !rows.is_empty() {
        say.table(&shift_lines(&titles, &rows, more), is_output_free)?;
    }
    shift_words(&found.drive, file).iter().for_each(|(word, meaning)| say.note(&format!("{word}: {meaning}")));
    Ok(())
}
