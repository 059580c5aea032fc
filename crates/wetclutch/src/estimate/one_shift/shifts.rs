//! The shifts of a log, with their estimates.

use car::Vehicle;
use logs::Shift;
use report::log_page::MAX_DRAWN;
use study::shift_estimates::{is_of_vehicle, seen_by_observer_alone, thinned};
use study::{LogSample, Overview, RecentSamples, ShiftEstimate};

use crate::Error;
use crate::estimate::selection::{Selection, ShiftChoice};

/// Collects the shifts of a log while its estimates pass by.
pub(crate) struct Shifts<'a> {
    vehicle: &'a Vehicle,
    ratios: Vec<f64>,
    selection: Selection,
    recent: RecentSamples,
    /// When the last one ended, s, and its gears.
    ended_s: f64,
    gears: Option<[u32; 2]>,
    /// Those that are wanted.
    pub(crate) found: Vec<ShiftEstimate>,
    pub(crate) overview: Overview,
}

impl<'a> Shifts<'a> {
    pub(crate) fn new(wanted: &ShiftChoice, vehicle: &'a Vehicle, ratios: &[f64]) -> Self {
        Self {
            vehicle,
            ratios: ratios.to_vec(),
            selection: Selection::of(wanted),
            recent: RecentSamples::default(),
            ended_s: f64::NEG_INFINITY,
            gears: None,
            found: Vec::new(),
            overview: Overview::default(),
        }
    }

    /// Whether only some shifts are wanted, and only their estimates.
    pub(crate) fn is_selective(&self) -> bool {
        self.selection.is_selective()
    }

    /// Shifts of the whole log.
    pub(crate) fn seen(&self) -> usize {
        self.selection.seen
    }

    pub(crate) fn push(&mut self, sample: LogSample) {
        self.overview.push(&sample);
        self.recent.push(sample);
    }

    /// The shift at the end of the log that the observer alone has seen, if there is one.
    pub(crate) fn of_observer_alone(&self) -> Option<Shift> {
        let seen = seen_by_observer_alone(&self.recent, self.ended_s, &self.ratios, self.vehicle);
        // It is the last one again, if there was no other between them.
        seen.filter(|shift| self.gears != Some([shift.from, shift.to]))
    }

    /// Takes a shift that is known now; `write` gets its samples if only some shifts are wanted and this is one.
    pub(crate) fn take<E>(&mut self, shift: Shift, write: impl FnOnce(&[LogSample]) -> Result<(), E>) -> Result<(), E> {
        self.ended_s = self.ended_s.max(shift.end_s());
        self.gears = Some([shift.from, shift.to]);
        if !self.selection.begins(&format!("{}-{}", shift.from, shift.to)) {
            return Ok(());
        }
        let of_vehicle = is_of_vehicle(&shift, &self.ratios, self.vehicle);
        let mut found = ShiftEstimate::of(self.selection.seen, shift, of_vehicle, &self.recent, self.vehicle);
        let is_drawn = self.found.len() < MAX_DRAWN;
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

    /// Refuses a selection that no shift is in.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.selection.check("`wetclutch inspect --shifts` lists the shifts that it finds")
    }
}

/// Samples of a shift that are kept for its figure.
const KEPT: usize = 250;
