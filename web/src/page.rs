//! A run: simulated, estimated, drawn.

use std::sync::Arc;

use config::{CarFile, DriveFile, Source};
use report::drive_page::drawn;
use serde_json::{Value, json};
use wetclutch::estimate::gearbox::{DriveEstimates, Setup, estimate};
use wetclutch::{Destination, Error, EstimateOptions, LogInput, Simulation, Table, simulate};

use crate::Settings;
use crate::cars::ShippedCar;
use crate::files::Files;

/// What messages call the readings of a run.
const LOG: &str = "live_measured.csv";

/// A simulated drive, and its files.
struct Run {
    files: Files,
    simulation: Simulation,
}

impl Run {
    fn of(settings: &Settings) -> Result<Self, Error> {
        let car = ShippedCar::named(&settings.car)?;
        let files = Files::of(settings, car)?;
        let driven = car.read("driven.toml", &files.driven)?;
        let drive = DriveFile::from_source(Source::built_in("drive.toml", &files.drive))?.drive;
        let simulation = simulate(&driven.car, &drive)?;
        Ok(Self { files, simulation })
    }
}

/// Figures, table and findings of a run, with its files.
pub(crate) fn of_run(settings: &Settings) -> Result<Value, Error> {
    let Run { files: Files { known, driven, drive }, simulation } = Run::of(settings)?;
    let (found, notes) = estimated(&known, with_truth(simulation))?;
    let mut page = page(&known, &found, notes);
    page["files"] = json!({
        "known.toml": known.source.text,
        "driven.toml": driven,
        "drive.toml": drive,
        "gearbox": known.gearbox_source.text,
    });
    Ok(page)
}

/// What the car measures, as `wetclutch simulate` writes it.
pub(crate) fn measured(settings: &Settings) -> Result<Table, Error> {
    Ok(Run::of(settings)?.simulation.measured)
}

/// The estimates of that, as `wetclutch estimate` writes them.
pub(crate) fn estimates(settings: &Settings) -> Result<Table, Error> {
    let Run { files, simulation } = Run::of(settings)?;
    let (found, _) = estimated(&files.known, simulation.measured)?;
    Ok(found.rows.unwrap_or_default())
}

/// The readings beside the true values: what is drawn, while the filter takes the readings alone.
fn with_truth(simulation: Simulation) -> Table {
    let Simulation { truth, mut measured, .. } = simulation;
    let read: Vec<String> = measured.columns.iter().map(|column| column.name.clone()).collect();
    measured.columns.extend(truth.columns.into_iter().filter(|column| !read.contains(&column.name)));
    measured
}

fn estimated(known: &CarFile, log: Table) -> Result<(DriveEstimates, Vec<String>), Error> {
    let options = EstimateOptions { with_page: true, ..EstimateOptions::default() };
    let setup = Setup::new(known, &options)?;
    let mut notes = Vec::new();
    let (log, mut say) = (Arc::new(log), |note: &str| notes.push(note.to_owned()));
    let found = estimate(&setup, LogInput::of_table(LOG, &log), Destination::Memory, &mut say)?;
    Ok((found.with_times_from_origin(), notes))
}

/// Figures, table and findings of a drive.
pub(crate) fn page(car: &CarFile, found: &DriveEstimates, mut notes: Vec<String>) -> Value {
    notes.extend(found.sentences());
    json!({ "drawn": drawn(&found.drive, car), "notes": notes })
}
