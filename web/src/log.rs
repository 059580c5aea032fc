//! A log of the reader's own: mapped, estimated, drawn.

use std::path::Path;
use std::sync::Arc;

use config::CarFile;
use logs::{ChannelMap, Log, OpenOptions};
use serde_json::{Value, json};
use wetclutch::estimate::gearbox::{DriveEstimates, Setup, estimate};
use wetclutch::{Destination, Error, EstimateOptions, InMemory, LogInput, Table};

use crate::Dbc;
use crate::cars::ShippedCar;
use crate::page::page;

/// What a page asks of a log.
pub(crate) struct Asked<'a> {
    /// The vehicle file, by its name.
    pub(crate) car: &'a str,
    /// What messages call the log.
    pub(crate) name: &'a str,
    /// The channel map; none for a log with the names of the program.
    pub(crate) map: Option<&'a str>,
    /// The DBC of a CAN log.
    pub(crate) dbc: Option<&'a Dbc>,
    /// The log.
    pub(crate) bytes: Arc<[u8]>,
}

impl Asked<'_> {
    /// What is needed to open the log.
    fn options(&self) -> OpenOptions {
        let dbc = self.dbc.map(|dbc| dbc.name.clone().into());
        OpenOptions { dbc, dbc_text: self.dbc.map(|dbc| dbc.text.as_bytes().into()), time: None }
    }
}

/// The log of a page, ready to be estimated.
struct Given<'a> {
    car: CarFile,
    name: &'a Path,
    map: ChannelMap,
    bytes: Arc<[u8]>,
}

impl<'a> Given<'a> {
    fn of(asked: &Asked<'a>) -> Result<Self, Error> {
        let car = ShippedCar::named(asked.car)?;
        let mut map = match asked.map {
            Some(map) => ChannelMap::of_text(Path::new("map.toml"), map)?,
            None => ChannelMap::default(),
        };
        map.open = OpenOptions { time: map.open.time, ..asked.options() };
        let file = car.read(&car.file(), car.text)?;
        Ok(Self { car: file, name: Path::new(asked.name), map, bytes: asked.bytes.clone() })
    }

    fn estimated(&self, columns: &[&str]) -> Result<(DriveEstimates, Vec<String>), Error> {
        let columns = columns.iter().map(|&column| column.to_owned()).collect();
        let options = EstimateOptions { with_page: true, columns, ..EstimateOptions::default() };
        let setup = Setup::new(&self.car, &options)?;
        let mut notes = Vec::new();
        let log = LogInput { path: self.name, memory: Some(InMemory::Bytes(&self.bytes)), map: &self.map };
        let found = estimate(&setup, log, Destination::Memory, &mut |note| notes.push(note.to_owned()))?;
        Ok((found.with_times_from_origin(), notes))
    }
}

/// Figures, table and findings of a log.
pub(crate) fn drawn(asked: &Asked<'_>) -> Result<Value, Error> {
    let given = Given::of(asked)?;
    // A million rows of all columns would not fit into the memory of a page.
    let (found, notes) = given.estimated(&["health"])?;
    Ok(page(&given.car, &found, notes))
}

/// The estimates of a log, as `wetclutch estimate` writes them.
pub(crate) fn estimates(asked: &Asked<'_>) -> Result<Table, Error> {
    let (found, _) = Given::of(asked)?.estimated(&[])?;
    Ok(found.rows.unwrap_or_default())
}

/// A first channel map for a log, as `wetclutch inspect --suggest` writes it.
pub(crate) fn suggested(asked: &Asked<'_>) -> Result<Value, Error> {
    let mut log = Log::of_bytes(Path::new(asked.name), &asked.options(), asked.bytes.clone())?;
    let ranges = logs::inspect(&mut log)?.ranges();
    Ok(json!({ "map": logs::suggest(log.channels(), &ranges, None).trim_end() }))
}
