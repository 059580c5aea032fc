//! The shifts of a log, with their estimates.

use std::io;
use std::path::Path;

use config::Vehicle;
use logs::Shift;
use report::log_page::MOST_DRAWN;
use study::shift_estimates::{self, is_of_vehicle};
use study::{LogSample, Overview, RecentSamples, ShiftEstimate};
use trace::{Cell, CsvWriter, WholeFile};

use crate::args::{Estimate, GearPair};
use crate::commands::json_object;
use crate::failure::Failure;

/// Which shifts are wanted.
enum Selection {
    All,
    Number(usize),
    Between(Vec<GearPair>),
}

/// Collects the shifts of a log while its estimates pass by.
pub(super) struct Shifts<'a> {
    vehicle: &'a Vehicle,
    ratios: Vec<f64>,
    selection: Selection,
    recent: RecentSamples,
    /// Those of the whole log.
    pub(super) seen: usize,
    /// Gears of the first shifts of the log, for messages.
    gears: Vec<String>,
    /// Those that are wanted.
    pub(super) found: Vec<ShiftEstimate>,
    pub(super) overview: Overview,
}

impl<'a> Shifts<'a> {
    pub(super) fn new(options: &Estimate, vehicle: &'a Vehicle, ratios: &[f64]) -> Self {
        let selection = match options.shift {
            Some(number) => Selection::Number(number as usize),
            None if options.shifts.is_empty() => Selection::All,
            None => Selection::Between(options.shifts.clone()),
        };
        Self {
            vehicle,
            ratios: ratios.to_vec(),
            selection,
            recent: RecentSamples::default(),
            seen: 0,
            gears: Vec::new(),
            found: Vec::new(),
            overview: Overview::default(),
        }
    }

    /// Whether only some shifts are wanted, and only their estimates.
    pub(super) fn is_selective(&self) -> bool {
        !matches!(self.selection, Selection::All)
    }

    pub(super) fn push(&mut self, sample: LogSample) {
        self.overview.push(&sample);
        self.recent.push(sample);
    }

    /// Takes a shift that is known now; `write` gets its samples if it is wanted.
    pub(super) fn take<E>(&mut self, shift: Shift, write: impl FnOnce(&[LogSample]) -> Result<(), E>) -> Result<(), E> {
        self.seen += 1;
        if self.gears.len() < 20 {
            self.gears.push(format!("{}-{}", shift.from, shift.to));
        }
        let is_wanted = match &self.selection {
            Selection::All => true,
            Selection::Number(number) => *number == self.seen,
            Selection::Between(pairs) => pairs.iter().any(|pair| (pair.from, pair.to) == (shift.from, shift.to)),
        };
        if !is_wanted {
            return Ok(());
        }
        let of_vehicle = is_of_vehicle(&shift, &self.ratios, self.vehicle);
        let mut found = ShiftEstimate::of(self.seen, shift, of_vehicle, &self.recent, self.vehicle);
        write(&found.samples)?;
        found.thin(if self.found.len() < MOST_DRAWN { KEPT } else { 0 });
        self.found.push(found);
        Ok(())
    }

    /// Refuses a selection that no shift is in.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let what = match &self.selection {
            Selection::All => return Ok(()),
            _ if !self.found.is_empty() => return Ok(()),
            Selection::Number(number) => format!("--shift {number}"),
            Selection::Between(pairs) => {
                let pairs: Vec<String> = pairs.iter().map(GearPair::to_string).collect();
                format!("--shifts {}", pairs.join(","))
            }
        };
        let more = if self.seen > self.gears.len() { ", ..." } else { "" };
        Err(Failure::Input(match self.seen {
            0 => format!(
                "{what}: no shift was found in the log\nhint: `wetclutch inspect --shifts` says what tells a shift"
            ),
            seen => format!(
                "{what}: the log has no such shift\nhint: it has {seen}, in this order: {}{more}",
                self.gears.join(", ")
            ),
        }))
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
        json_object(cells.map(|(name, cell)| (name.to_owned(), cell)))
    };
    let objects: Vec<_> = shifts.iter().map(object).collect();
    let text = serde_json::to_string_pretty(&objects)? + "\n";
    trace::write_whole(json, |writer| writer.write_all(text.as_bytes())).map_err(writing(json))
}
