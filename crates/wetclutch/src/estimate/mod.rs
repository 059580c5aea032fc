//! Estimates from a log.

pub mod gearbox;
mod input;
pub(crate) mod live;
mod log_checks;
mod no_column;
pub mod one_shift;
pub(crate) mod output;
pub mod selection;
#[cfg_attr(target_family = "wasm", path = "stages_in_browser.rs")]
mod stages;
pub(crate) mod watched;

use observer::gearbox::Learnt;
use report::drive_page::shift_cells;

pub use self::input::{EstimateOptions, InMemory, LogInput, shown_from_s};
pub use self::live::{LiveCell, LiveRows};
pub use self::log_checks::WITHOUT_SENSORS;
pub use self::output::Destination;
pub use self::selection::{GearPair, ShiftChoice};
use crate::{Error, Table, VehicleFile};

/// Estimates of a log in memory.
#[derive(Debug, Clone)]
pub struct Estimates {
    /// A row for each row of the log.
    pub rows: Table,
    /// A row for each shift.
    pub shifts: Table,
    /// What was found in the log, in sentences.
    pub notes: Vec<String>,
    /// What was learnt of the car, for the next log; `None` for a vehicle file of one shift, and where nothing was learnt.
    pub learnt: Option<Learnt<f64>>,
    /// The page of the drive, as HTML.
    pub page: Option<String>,
}

/// Estimates a log into tables in memory.
///
/// # Errors
/// The log cannot be read, is not of this car, or an option does not fit it.
pub fn estimate(vehicle: &VehicleFile, log: LogInput<'_>, options: &EstimateOptions) -> Result<Estimates, Error> {
    let mut notes = Vec::new();
    let mut say = |note: &str| notes.push(note.to_owned());
    let (rows, shifts, learnt, page) = match vehicle {
        VehicleFile::Gearbox(file) => {
            let setup = gearbox::Setup::new(file, options)?;
            let found = gearbox::estimate(&setup, log, Destination::Memory, &mut say)?;
            let shifts = Table::of_rows(found.drive.shifts.iter().map(|shift| shift_cells(shift, file)));
            let found = found.with_times_from_origin();
            found.sentences().iter().for_each(|sentence| say(sentence));
            let page = if options.with_page { found.page(file, log.path)? } else { None };
            (found.rows, shifts, found.learnt.learnt, page)
        }
        VehicleFile::OneShift(file) => {
            let setup = one_shift::Setup::new(file, options)?;
            let found = one_shift::estimate(&setup, log, Destination::Memory, &mut say)?;
            let shifts = Table::of_rows(found.shift_cells());
            let found = found.with_times_from_origin();
            found.findings.iter().for_each(|sentence| say(sentence));
            let page = if options.with_page { found.page(file, log.path)? } else { None };
            (found.rows, shifts, None, page)
        }
    };
    Ok(Estimates { rows: rows.unwrap_or_default(), shifts, notes, learnt, page })
}
