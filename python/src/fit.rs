//! Fits of cars to logs.

use std::path::PathBuf;

use logs::ChannelMap;
use pyo3::prelude::*;
use wetclutch::{Error, FitOptions, Fitted, InMemory, LogInput};

use crate::car::{Described, described, parsed};
use crate::estimate::Mapping;
use crate::file::GivenFile;
use crate::table::Table;
use crate::work::{self, Report};

/// A log as Python gives it: its name, its table if it is one in memory, and how its channels are mapped.
type Given = (PathBuf, Option<Py<Table>>, Mapping);

/// The fitted car, its quantities, the changes of the channel map and the adaptations, those that are not identifiable, statements, notes, how many shifts were fitted, why the given values are kept, and
/// the page.
type Found = (
    Described,
    (Table, Table, Option<Table>),
    Vec<String>,
    Vec<String>,
    Vec<String>,
    usize,
    Option<String>,
    Option<String>,
);

/// Fits a car to logs.
#[pyfunction]
#[pyo3(signature = (car, logs, sensors, with_page, oil_step_k, progress))]
pub(crate) fn fit(
    py: Python<'_>,
    car: (String, String, Option<String>),
    logs: Vec<Given>,
    sensors: Option<GivenFile>,
    with_page: bool,
    oil_step_k: Option<f64>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Found> {
    let (name, text, gearbox) = car;
    let vehicle = parsed(py, &name, &text, gearbox.as_deref())?;
    let logs = logs.into_iter().map(|(path, table, mapping)| {
        let rows = table.map(|table| table.get().rows());
        (path, rows, mapping)
    });
    let logs: Vec<_> = logs.collect();
    let (found, notes) = work::done(py, progress.as_ref(), move |work| {
        let mapped = logs.into_iter().map(|(path, rows, mapping)| Ok((path, rows, mapping.read(Some(&vehicle))?)));
        let mapped: Vec<(PathBuf, _, ChannelMap)> = mapped.collect::<Result<_, Error>>()?;
        let inputs =
            mapped.iter().map(|(path, rows, map)| LogInput { path, memory: rows.as_ref().map(InMemory::Rows), map });
        let inputs: Vec<LogInput<'_>> = inputs.collect();
        let sensors = sensors.map(GivenFile::sensors).transpose()?;
        let options = FitOptions { sensors, output: None, with_page, oil_step_k, interrupt: Some(work.stop()) };
        let mut notes = Vec::new();
        let found = wetclutch::fit(
            &vehicle,
            &inputs,
            &options,
            &mut |at| work.report(Report { words: at.to_string(), fraction: None }),
            &mut |note| {
                notes.push(note.to_owned());
            },
        )?;
        Ok((found, notes))
    })?;
    let adaptations = found.adaptations.is_some().then(|| found.adaptation_table().into());
    let tables = (found.intervals().into(), found.channel_map().into(), adaptations);
    let open = found.not_identifiable().map(str::to_owned).collect();
    let Fitted { vehicle, channels, statements, shifts, kept, page, .. } = found;
    Ok((described(&vehicle), tables, open, [channels, statements].concat(), notes, shifts, kept, page))
}
