//! The shifts of a log, with their estimates.

use std::io;
use std::path::Path;

use car::Vehicle;
use logs::Shift;
use report::log_page::MOST_DRAWN;
use study::shift_estimates::{self, is_of_vehicle, thinned};
use study::{LogSample, Overview, RecentSamples, ShiftEstimate};
use trace::{Cell, CsvWriter, WholeFile};

use super::selection::Selection;
use crate::args::Estimate;
use crate::commands::{JsonObject, write_json_list};
use crate::failure::Failure;

/// Collects the shifts of a log while its estimates pass by.
pub(super) struct Shifts<'a> {
    vehicle: &'a Vehicle,
    ratios: Vec<f64>,
    selection: Selection,
    recent: RecentSamples,
    /// Those that are wanted.
    pub(super) found: Vec<ShiftEstimate>,
    pub(super) overview: Overview,
}

impl<'a> Shifts<'a> {
    pub(super) fn new(options: &Estimate, vehicle: &'a Vehicle, ratios: &[f64]) -> Self {
        Self {
            vehicle,
            ratios: ratios.to_vec(),
            selection: Selection::of(options),
            recent: RecentSamples::default(),
            found: Vec::new(),
            overview: Overview::default(),
        }
    }

    /// Whether only some shifts are wanted, and only their estimates.
    pub(super) fn is_selective(&self) -> bool {
        self.selection.is_selective()
    }

    /// Shifts of the whole log.
    pub(super) fn seen(&self) -> usize {
        self.selection.seen
    }

    pub(super) fn push(&mut self, sample: LogSample) {
        self.overview.push(&sample);
        self.recent.push(sample);
    }

    /// Takes a shift that is known now; `write` gets its samples if only some shifts are wanted and this is one.
    pub(super) fn take<E>(&mut self, shift: Shift, write: impl FnOnce(&[LogSample]) -> Result<(), E>) -> Result<(), E> {
        if !self.selection.begins(&format!("{}-{}", shift.from, shift.to)) {
            return Ok(());
        }
        let of_vehicle = is_of_vehicle(&shift, &self.ratios, self.vehicle);
        let mut found = ShiftEstimate::of(self.selection.seen, shift, of_vehicle, &self.recent, self.vehicle);
        let is_drawn = self.found.len() < MOST_DRAWN;
        let samples = self.recent.between(found.window_s);
        if self.is_selective() {
            write(samples)?;
        }
        if is_drawn {
            found.samples = thinned(samples, KEPT);
        }
        self.found.push(found);
        Ok(())
    }

    /// The same on a clock that began at this time of the log's, s.
    pub(super) fn earlier_by(self, origin_s: f64) -> Self {
        let found = self.found.into_iter().map(|shift| shift.earlier_by(origin_s)).collect();
        Self { found, overview: self.overview.earlier_by(origin_s), ..self }
    }

    /// Refuses a selection that no shift is in.
    pub(super) fn check(&self) -> Result<(), Failure> {
        self.selection.check("`wetclutch inspect --shifts` says what tells a shift")
    }
}

/// Samples of a shift that are kept for its figure.
const KEPT: usize = 250;

/// Writes the shifts as CSV and JSON.
pub(super) fn write(shifts: &[ShiftEstimate], csv: &Path, json: &Path) -> Result<(), Failure> {
    let writing = |path: &Path| {
        let path = path.to_owned();
        move |error: io::Error| Failure::writing(&path, &error)
    };
    let columns = shift_estimates::COLUMNS;
    let table = || -> io::Result<()> {
        let mut table = CsvWriter::new(WholeFile::create(csv)?, columns.iter().map(|(name, _)| *name))?;
        for shift in shifts {
            table.row(shift.begin_s(), columns.iter().map(|(_, cell)| cell(shift)))?;
        }
        table.finish()?.finish()
    };
    table().map_err(writing(csv))?;
    let object = |shift: &ShiftEstimate| {
        let time = std::iter::once((trace::signal::TIME, Cell::Number(shift.begin_s())));
        let cells = time.chain(columns.iter().map(|(name, cell)| (*name, cell(shift))));
        JsonObject::of(cells)
    };
    write_json_list(json, shifts.iter().map(object))
}
