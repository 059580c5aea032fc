//! Errors of the rows of a shift by phase and clutch, and what is counted over them.

use drivetrain::ShiftKind;
use observer::Health;
use serde::Serialize;

use crate::score::{ShiftScoreRow, SquaredErrors, TruePhase};

/// Where the open loop errs by less than this over a shift there is nothing to gain, N m.
pub const NOTHING_N_M: f64 = 2.0;
/// A run is above the open loop if it errs by more than this beyond it, N m.
pub const ABOVE_N_M: f64 = 1.0;
/// Rows that a phase of a run needs to be compared.
const COMPARED_ROWS: f64 = 3.0;

/// The clutch that drives the inertia phase: 0 offgoing, 1 oncoming.
pub fn controlling(kind: ShiftKind) -> usize {
    match kind {
        ShiftKind::PowerOnUp | ShiftKind::CoastDown => 1,
        ShiftKind::PowerOnDown | ShiftKind::PowerOffUp => 0,
    }
}

/// The same of the shift with these rows: the other one where that is a one-way clutch or a dog, which drives nothing while it slips.
pub fn controlling_of(rows: &[ShiftScoreRow], kind: ShiftKind) -> usize {
    let by_kind = controlling(kind);
    if rows.first().is_some_and(|row| !row.clutches[by_kind].has_pressure) { 1 - by_kind } else { by_kind }
}

/// Errors over the rows of a phase.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PhaseErrors {
    /// Of the torque, N m.
    pub torque: SquaredErrors,
    /// Of the pressure, Pa.
    pub pressure: SquaredErrors,
}

impl PhaseErrors {
    /// Those of one clutch in one phase.
    pub fn of(rows: &[ShiftScoreRow], phase: TruePhase, clutch: usize) -> Self {
        let (torque, pressure) =
            (SquaredErrors::of(rows, phase, clutch), SquaredErrors::of_pressure(rows, phase, clutch));
        Self { torque, pressure }
    }

    /// Adds those of more rows.
    pub fn add(&mut self, more: &Self) {
        self.torque.add(&more.torque);
        self.pressure.add(&more.pressure);
    }
}

/// Errors of the controlling and of the other clutch in torque and inertia phase.
pub type ErrorsByPhase = [[PhaseErrors; 2]; 2];

/// Errors by phase and clutch of a shift of this kind.
pub fn errors_by_phase(rows: &[ShiftScoreRow], kind: ShiftKind) -> ErrorsByPhase {
    let main = controlling_of(rows, kind);
    [TruePhase::Torque, TruePhase::Inertia]
        .map(|phase| [main, 1 - main].map(|clutch| PhaseErrors::of(rows, phase, clutch)))
}

/// Counts over the runs of a shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MatrixCounts {
    /// Runs whose simulation failed.
    pub failed: u64,
    /// Phases of runs in which the controlling clutch is compared with the open loop.
    pub compared: u64,
    /// Those in which the filter is above the open loop by more than [`ABOVE_N_M`].
    pub above: u64,
    /// Runs in which it is compared over both phases together.
    pub compared_runs: u64,
    /// Those in which the filter is above the open loop by more than [`ABOVE_N_M`].
    pub runs_above: u64,
    /// Pressures and torques of both clutches that were compared with their guaranteed ranges.
    pub values: u64,
    /// Those outside.
    pub outside: u64,
    /// Those without a range.
    pub unranged: u64,
    /// Rows of the shifts.
    pub rows: u64,
    /// Those that say that a held element slips.
    pub slips_said: u64,
}

impl MatrixCounts {
    /// Adds those of more runs.
    pub fn add(&mut self, more: &Self) {
        self.failed += more.failed;
        self.compared += more.compared;
        self.above += more.above;
        self.compared_runs += more.compared_runs;
        self.runs_above += more.runs_above;
        self.values += more.values;
        self.outside += more.outside;
        self.unranged += more.unranged;
        self.rows += more.rows;
        self.slips_said += more.slips_said;
    }
}

/// Counts over the rows of one run.
pub fn counts(rows: &[ShiftScoreRow], errors: &ErrorsByPhase) -> MatrixCounts {
    let clutches = || rows.iter().flat_map(|row| row.clutches);
    let main = errors.map(|phase| phase[0].torque);
    let whole = main.iter().copied().reduce(|mut sum, more| {
        sum.add(&more);
        sum
    });
    // How many sums are compared, and in how many of them the filter is above the open loop.
    let compared = |sums: &[SquaredErrors]| {
        let compared = sums.iter().filter(|sum| sum.rows >= COMPARED_ROWS);
        let above = compared.clone().filter(|sum| {
            let [estimate, open_loop] = sum.rms_n_m();
            estimate > open_loop + ABOVE_N_M
        });
        (compared.count() as u64, above.count() as u64)
    };
    let (phases, runs) = (compared(&main), compared(whole.as_slice()));
    MatrixCounts {
        failed: 0,
        compared: phases.0,
        above: phases.1,
        compared_runs: runs.0,
        runs_above: runs.1,
        values: 2 * clutches().count() as u64,
        unranged: clutches()
            .map(|clutch| u64::from(clutch.pressure_range_pa.is_none()) + u64::from(clutch.torque_range_n_m.is_none()))
            .sum(),
        outside: clutches().map(|clutch| u64::from(!clutch.in_range)).sum(),
        rows: rows.len() as u64,
        slips_said: rows.iter().filter(|row| row.health == Health::HeldClutchSlips).count() as u64,
    }
}
