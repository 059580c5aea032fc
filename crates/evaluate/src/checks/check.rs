//! What a check of a log takes, and what it says.

use observer::gearbox::{ShiftElement, ShiftEstimate};

use super::in_gear::RowInGear;
use crate::scored_shift::ScoredShift;
use crate::{LogStep, ShiftScoreRow};

/// A rule that the readings of a log keep if they are of this car.
pub(crate) trait Check {
    /// Takes a row.
    fn row(&mut self, _row: &CheckedRow<'_>) {}

    /// A shift begins.
    fn begin(&mut self) {}

    /// Takes an estimate of a shift between these elements, by their places in the gearbox.
    fn shift_row(&mut self, _elements: [Option<usize>; 2], _row: &ShiftScoreRow) {}

    /// Takes a shift that has ended.
    fn end(&mut self, _shift: &EndedShift<'_>) {}

    /// What the log contradicts, each in a sentence.
    fn warnings(&self) -> Vec<String>;
}

/// A row of a log, and what the filter says of it.
pub(crate) struct CheckedRow<'a> {
    /// The row.
    pub(crate) step: &'a LogStep,
    /// Its estimate.
    pub(crate) estimate: &'a ShiftEstimate<f64>,
    /// Newest speeds of engine, turbine and output as they came, rad/s; not a number of one that comes no more.
    pub(crate) came_rad_s: [f64; 3],
    /// The newest of them that the filter did not refuse, rad/s.
    pub(crate) used_rad_s: [f64; 3],
    /// What it shows of a gear; `None` in a shift and in neutral.
    pub(crate) in_gear: Option<RowInGear>,
    /// Whether one of the speeds came before, and comes no more.
    pub(crate) has_ended: bool,
    /// Whether the recording has a hole before it.
    pub(crate) is_hole: bool,
}

/// A shift that has ended.
pub(crate) struct EndedShift<'a> {
    /// What is known of it.
    pub(crate) shift: &'a ScoredShift,
    /// Its elements, and its begin and end, s, if it was completed and the filter has tables of it.
    pub(crate) completed: Option<([ShiftElement; 2], [f64; 2])>,
}
