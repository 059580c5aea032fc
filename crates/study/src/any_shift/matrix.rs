//! All shifts between neighbouring gears of a car, in all four kinds, in cars that differ from the known one.
//!
//! A run is one shift of one such car. Runs are made in parallel and added in their order, so that the result does not
//! depend on the number of threads.

use car::ErrorBudget;
use car::{Car, Sensors};
use design::ShiftTables;
use drivetrain::ShiftKind;
use observer::Health;
use plant::car::CarShift;
use serde::Serialize;

use super::{AnyShiftError, ShiftDraw, ShiftScoreRow, SquaredErrors, TruePhase, score_shift};
use crate::StudyError;
use crate::campaign::{in_order, plan::mixed};

/// Throttle of the shifts with power, 0 to 1 \[chosen\]: a car in traffic.
const POWER_ON: f64 = 0.15;
/// Throttle of the shifts with power.
pub(super) fn power_throttle() -> f64 {
    POWER_ON
}

/// Turbine torque, over the throttle, at which a shift counts as one with power.
const KIND_FROM: f64 = 0.01;
/// Where the open loop errs by less than this over a shift there is nothing to gain, N m.
pub const NOTHING_N_M: f64 = 2.0;
/// A run is above the open loop if it errs by more than this beyond it, N m.
pub const ABOVE_N_M: f64 = 1.0;
/// Rows that a phase of a run needs to be compared.
const COMPARED_ROWS: f64 = 3.0;

/// Random numbers (SplitMix64).
#[derive(Debug, Clone, Copy)]
pub struct Random(pub u64);

impl Random {
    /// From 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The car of a draw of a shift, with other friction, valve gains, converter and strokes of pistons: the same whatever else is drawn.
pub fn drawn_car(known: &Car, from: usize, to: usize, seed: u64) -> Car {
    draw(known, from, to, seed, false).car(known)
}

fn draw(known: &Car, from: usize, to: usize, seed: u64, timing: bool) -> ShiftDraw {
    let mut random = Random(seed.wrapping_mul(1000).wrapping_add(from as u64 * 37 + to as u64));
    let budget = ErrorBudget::of_car(known);
    let mut draw = ShiftDraw::within(known, &budget, || random.uniform());
    if timing {
        draw = draw.with_timing(&budget, || random.uniform());
    }
    draw.with_strokes(known, || random.uniform())
}

/// A shift of the matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatrixShift {
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// Direction and power.
    pub kind: ShiftKind,
    /// `1/|i_off - i_on|`: by how much an error of the gearbox output torque shows in a clutch torque in the torque phase.
    pub gain: f64,
}

/// All shifts between neighbouring forward gears in both directions, with and without power; and those, as pairs of gears, for
/// which the filter has no tables.
pub fn neighbouring_shifts(car: &Car, tables: &ShiftTables<f64>) -> (Vec<MatrixShift>, Vec<[usize; 2]>) {
    let forward = car.gearbox.forward_gears();
    let pairs = forward.windows(2).flat_map(|pair| [[pair[0], pair[1]], [pair[1], pair[0]]]);
    let (known, unknown): (Vec<_>, Vec<_>) = pairs.partition(|[from, to]| tables.tables().shift(*from, *to).is_some());
    let shifts = known.into_iter().flat_map(|[from, to]| {
        let [i_off, i_on] = [from, to].map(|gear| car.gearbox.gears[gear].ratio);
        [POWER_ON, 0.0].into_iter().filter_map(move |throttle| {
            let kind = ShiftKind::of(throttle - KIND_FROM, i_off, i_on)?;
            Some(MatrixShift { from, to, kind, gain: (i_off - i_on).abs().recip() })
        })
    });
    (shifts.collect(), unknown)
}

impl MatrixShift {
    /// Throttle throughout, 0 to 1.
    pub fn throttle(&self) -> f64 {
        match self.kind {
            ShiftKind::PowerOnUp | ShiftKind::PowerOnDown => POWER_ON,
            ShiftKind::PowerOffUp | ShiftKind::CoastDown => 0.0,
        }
    }

    /// Seed of the sensors' noise of a draw: another in each shift of each gearbox. Shifts that share their noise err alike, and
    /// a mean over them is less certain than their number says.
    pub fn noise(&self, draw: u64) -> u64 {
        let of_shift = [self.gain.to_bits(), self.from as u64, self.to as u64, u64::from(self.throttle() > 0.0)];
        of_shift.into_iter().fold(draw, mixed)
    }
}

/// The clutch that drives the inertia phase: 0 offgoing, 1 oncoming.
pub fn controlling(kind: ShiftKind) -> usize {
    match kind {
        ShiftKind::PowerOnUp | ShiftKind::CoastDown => 1,
        ShiftKind::PowerOnDown | ShiftKind::PowerOffUp => 0,
    }
}

/// The same of the shift with these rows: the other one where that is a one-way clutch, which overruns then and drives nothing.
pub fn controlling_of(rows: &[ShiftScoreRow], kind: ShiftKind) -> usize {
    let by_kind = controlling(kind);
    if rows.first().is_some_and(|row| row.clutches[by_kind].is_one_way) { 1 - by_kind } else { by_kind }
}

/// The classes of `1/|i_off - i_on|`, by their lower ends.
pub const CLASSES: [f64; 3] = [0.0, 2.0, 5.0];

/// The class of a shift.
pub fn class(gain: f64) -> usize {
    CLASSES.iter().rposition(|&from| gain >= from).unwrap_or(0)
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

/// A shift of the matrix with all of its draws.
#[derive(Debug, Clone, PartialEq)]
pub struct MatrixRow {
    /// The shift.
    pub shift: MatrixShift,
    /// Over all draws.
    pub errors: ErrorsByPhase,
    /// Over all draws.
    pub counts: MatrixCounts,
    /// Why runs failed: the first message.
    pub failure: Option<String>,
}

/// The matrix of a car.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix {
    /// Its shifts.
    pub rows: Vec<MatrixRow>,
    /// Pairs of neighbouring gears for which the filter has no tables.
    pub without_tables: Vec<[usize; 2]>,
    /// Cars drawn for each shift.
    pub draws: u64,
}

/// Which cars are drawn, and what their speeds are read with.
#[derive(Debug, Clone, Copy)]
pub struct MatrixPlan<'a> {
    /// Cars for each shift.
    pub draws: u64,
    /// Seed of the first; the next has the next.
    pub seed: u64,
    /// Toothed wheels and their noise.
    pub sensors: &'a Sensors,
    /// Whether lag, delay and hysteresis of the valves are drawn too.
    pub timing: bool,
    /// Changes every drawn car further.
    pub change: fn(&mut Car),
    /// Threads.
    pub threads: usize,
}

/// One run.
struct Run {
    errors: ErrorsByPhase,
    counts: MatrixCounts,
    failure: Option<String>,
}

fn run(known: &Car, shift: &MatrixShift, seed: u64, plan: &MatrixPlan<'_>) -> Run {
    let MatrixShift { from, to, kind, .. } = *shift;
    let mut truth = draw(known, from, to, seed, plan.timing).car(known);
    (plan.change)(&mut truth);
    let usual = CarShift::usual(known, from, to, shift.throttle());
    match score_shift(known, &truth, &usual, plan.sensors, shift.noise(seed)) {
        Ok(rows) => {
            let errors = errors_by_phase(&rows, kind);
            Run { counts: counts(&rows, &errors), errors, failure: None }
        }
        Err(error) => {
            let counts = MatrixCounts { failed: 1, ..MatrixCounts::default() };
            Run { errors: ErrorsByPhase::default(), counts, failure: Some(error.to_string()) }
        }
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

/// Makes all runs of the matrix of a car; `done` is called after each.
///
/// # Errors
/// The gearbox has more clutches than the filter has room for, or there are no threads.
pub fn matrix(known: &Car, plan: &MatrixPlan<'_>, mut done: impl FnMut()) -> Result<Matrix, StudyError> {
    let tables = ShiftTables::of_car(known, &ErrorBudget::of_car(known)).map_err(AnyShiftError::TooManyElements)?;
    let (shifts, without_tables) = neighbouring_shifts(known, &tables);
    let row = |shift: &MatrixShift| MatrixRow {
        shift: *shift,
        errors: ErrorsByPhase::default(),
        counts: MatrixCounts::default(),
        failure: None,
    };
    let mut rows: Vec<MatrixRow> = shifts.iter().map(row).collect();
    let work = |number: u64| {
        let (at, draw) = (number / plan.draws, number % plan.draws);
        #[expect(clippy::cast_possible_truncation, reason = "below the number of shifts")]
        let at = at as usize;
        (at, run(known, &shifts[at], plan.seed.wrapping_add(draw), plan))
    };
    let runs = shifts.len() as u64 * plan.draws;
    in_order::<_, StudyError>(0..runs, plan.threads, work, |(at, run)| {
        let row = &mut rows[at];
        row.counts.add(&run.counts);
        for (sums, more) in row.errors.iter_mut().flatten().zip(run.errors.iter().flatten()) {
            sums.add(more);
        }
        row.failure = row.failure.take().or(run.failure);
        done();
        Ok(())
    })?;
    Ok(Matrix { rows, without_tables, draws: plan.draws })
}

/// Number of runs of the matrix of a car.
///
/// # Errors
/// The gearbox has more clutches than the filter has room for.
pub fn runs(known: &Car, draws: u64) -> Result<u64, StudyError> {
    let tables = ShiftTables::of_car(known, &ErrorBudget::of_car(known)).map_err(AnyShiftError::TooManyElements)?;
    Ok(neighbouring_shifts(known, &tables).0.len() as u64 * draws)
}

/// The torque errors of some shifts together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pooled {
    /// In torque and inertia phase, of the controlling and the other clutch. Shifts in which the open loop errs by less than
    /// [`NOTHING_N_M`] are left out.
    pub torque: [[SquaredErrors; 2]; 2],
    /// All counts.
    pub counts: MatrixCounts,
}

impl Pooled {
    /// Of the rows that `which` chooses.
    pub fn of<'a>(rows: impl IntoIterator<Item = &'a MatrixRow>, which: impl Fn(&MatrixShift) -> bool) -> Self {
        let mut pooled = Self::default();
        for row in rows.into_iter().filter(|row| which(&row.shift)) {
            pooled.counts.add(&row.counts);
            for (sum, errors) in pooled.torque.iter_mut().flatten().zip(row.errors.iter().flatten()) {
                if errors.torque.rms_n_m()[1] > NOTHING_N_M {
                    sum.add(&errors.torque);
                }
            }
        }
        pooled
    }
}
