//! All shifts between neighbouring gears of a car, in all four kinds, in cars that differ from the known one.
//!
//! A run is one shift of one such car. Runs are made in parallel and added in their order, so that the result does not
//! depend on the number of threads.

use car::{Car, ErrorBudget, Sensors, ShiftCommand};
use drivetrain::ShiftKind;
use observer::ShiftTables;
use plant::car::CarShift;

pub use evaluate::errors::*;
use evaluate::mixed;

use super::drive::{ScoredDrive, ScoredShift};
use super::{EvaluateError, ShiftDraw, SquaredErrors, score_shift};
use crate::StudyError;
use crate::campaign::in_order;

/// Throttle of the shifts with power, 0 to 1 \[chosen\]: a car in traffic.
const POWER_ON: f64 = 0.15;
/// Throttle of the shifts with power.
pub(super) fn power_throttle() -> f64 {
    POWER_ON
}

/// Turbine torque, over the throttle, at which a shift counts as one with power.
const KIND_FROM: f64 = 0.01;
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

/// The classes of `1/|i_off - i_on|`, by their lower ends.
pub const CLASSES: [f64; 3] = [0.0, 2.0, 5.0];

/// The class of a shift.
pub fn class(gain: f64) -> usize {
    CLASSES.iter().rposition(|&from| gain >= from).unwrap_or(0)
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

impl Matrix {
    /// The shifts of a drive as rows of a matrix; those without a kind are left out.
    pub fn of_drive(drive: &ScoredDrive, car: &Car) -> Self {
        let row = |shift: &ScoredShift| {
            let ShiftCommand { from, to } = shift.gears;
            let [i_off, i_on] = [car.ratio(from)?, car.ratio(to)?];
            let (from, to, kind) = (from.place()?, to.place()?, shift.kind?);
            Some(MatrixRow {
                shift: MatrixShift { from, to, kind, gain: (i_off - i_on).abs().recip() },
                counts: shift.summary.counts,
                errors: shift.errors()?,
                failure: None,
            })
        };
        Self { rows: drive.shifts.iter().filter_map(row).collect(), without_tables: Vec::new(), draws: 1 }
    }
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

/// Makes all runs of the matrix of a car; `done` is called after each.
///
/// # Errors
/// The gearbox has more clutches than the filter has room for, or there are no threads.
pub fn matrix(known: &Car, plan: &MatrixPlan<'_>, mut done: impl FnMut()) -> Result<Matrix, StudyError> {
    let tables = ShiftTables::of_car(known, &ErrorBudget::of_car(known)).map_err(EvaluateError::TooManyElements)?;
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
    let tables = ShiftTables::of_car(known, &ErrorBudget::of_car(known)).map_err(EvaluateError::TooManyElements)?;
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
