//! Estimates of logs.

use std::path::{Path, PathBuf};

use logs::ChannelMap;
use pyo3::prelude::*;
use wetclutch::estimate::{GearPair, ShiftChoice};
use wetclutch::{Error, EstimateOptions, InMemory, LogInput, VehicleFile};

use crate::car::parsed;
use crate::error::exception;
use crate::file::GivenFile;
use crate::table::Table;
use crate::work;

/// What Python gives of how a log is estimated.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Given {
    observer: Option<String>,
    method: Option<String>,
    sensors: Option<GivenFile>,
    columns: Vec<String>,
    shift: Option<usize>,
    shifts: Vec<String>,
    learnt: Option<String>,
    threads: Option<usize>,
    with_page: bool,
}

/// How the channels of a log are mapped.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Mapping {
    map: Option<PathBuf>,
    dbc: Option<PathBuf>,
    channels: Vec<String>,
}

impl Mapping {
    /// The map of a log, with the wheel radius of its car where that is known and the map has none.
    pub(crate) fn read(self, vehicle: Option<&VehicleFile>) -> Result<ChannelMap, Error> {
        let mut map = self.map.as_deref().map(ChannelMap::read).transpose()?.unwrap_or_default();
        self.channels.iter().try_for_each(|channel| map.set(channel))?;
        if self.dbc.is_some() {
            map.open.dbc = self.dbc;
        }
        map.gearbox.wheel_radius_m = map.gearbox.wheel_radius_m.or(vehicle.map(VehicleFile::wheel_radius_m));
        Ok(map)
    }
}

impl Given {
    fn options(self, vehicle: &VehicleFile) -> Result<EstimateOptions, Error> {
        let shifts = match (self.shift, self.shifts.as_slice()) {
            (Some(_), [_, ..]) => return Err(Error::Input("shift and shifts: give one of them".to_owned())),
            (Some(0), []) => return Err(Error::Input("shift is 0, expected 1 for the first".to_owned())),
            (Some(number), []) => ShiftChoice::Number(number),
            (None, []) => ShiftChoice::All,
            (None, pairs) => {
                let pair = |text: &String| {
                    text.parse::<GearPair>().map_err(|expected| Error::Input(format!("shifts: `{text}`: {expected}")))
                };
                ShiftChoice::Between(pairs.iter().map(pair).collect::<Result<_, _>>()?)
            }
        };
        Ok(EstimateOptions {
            observer: self.observer.as_deref().map(wetclutch::observer_named).transpose()?,
            method: self.method.as_deref().map(wetclutch::method_named).transpose()?,
            sensors: self.sensors.map(GivenFile::sensors).transpose()?,
            columns: self.columns,
            shifts,
            learnt: self.learnt.as_deref().map(|text| vehicle.learnt_of(text)).transpose()?,
            threads: self.threads.unwrap_or_else(wetclutch::available_threads),
            with_page: self.with_page,
            ..EstimateOptions::default()
        })
    }
}

/// Rows, shifts, notes, what was learnt as text, and the page.
type Estimated = (Table, Table, Vec<String>, Option<String>, Option<String>);

/// Estimates a log.
#[pyfunction]
#[pyo3(signature = (car, path, table, mapping, given, progress))]
pub(crate) fn estimate(
    py: Python<'_>,
    car: (String, String, Option<String>),
    path: PathBuf,
    table: Option<&Bound<'_, Table>>,
    mapping: Mapping,
    given: &Bound<'_, PyAny>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Estimated> {
    let (name, text, gearbox) = car;
    let vehicle = parsed(py, &name, &text, gearbox.as_deref())?;
    let given: Given = given.extract()?;
    let rows = table.map(|table| table.get().rows());
    let (vehicle, found) = work::done(py, progress.as_ref(), move |work| {
        let map = mapping.read(Some(&vehicle))?;
        let options =
            EstimateOptions { interrupt: Some(work.stop()), rows_done: Some(work.rows()), ..given.options(&vehicle)? };
        let path: &Path = &path;
        let memory = rows.as_ref().map(InMemory::Rows);
        let found = wetclutch::estimate(&vehicle, LogInput { path, memory, map: &map }, &options)?;
        Ok((vehicle, found))
    })?;
    let learnt = found.learnt.as_ref().map(|learnt| vehicle.text_of_learnt(learnt)).transpose();
    let learnt = learnt.map_err(|error| exception(py, &error))?;
    Ok((found.rows.into(), found.shifts.into(), found.notes, learnt, found.page))
}
