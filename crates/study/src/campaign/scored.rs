//! The shift of a run as its row needs it: rated while it is simulated, and of its signals only those that observers read and
//! scores are held against.

use car::{Experiment, Vehicle};
use observer::Phase;
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::{Moment, PlantError};
use trace::{Trace, signal};

use super::layout::PHASES;
use crate::drive::{Recording, over_shift, phase};
use crate::run::command_signals;
use crate::{ShiftQuality, ShiftRating, ShiftSample};

/// Signals of the trace.
const COLUMNS: usize = 9;

/// A shift that was simulated for a row.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoredShift {
    /// What observers read and scores are held against, up to the end of the last of the phases that a row scores. The
    /// torque of the oncoming clutch is NaN where it is locked after the shift: there it is not scored.
    pub trace: Trace,
    /// The shift, if it was completed.
    pub quality: Option<ShiftQuality>,
}

/// Simulates a shift as [`crate::simulate_shift`] does, in the memory of a trace that is no longer needed.
///
/// # Errors
/// See [`PlantError`].
pub fn scored_shift(
    spare: Trace,
    car: &Vehicle,
    nominal: &Vehicle,
    experiment: &Experiment,
    before_s: f64,
) -> Result<ScoredShift, PlantError> {
    let mut recording = Recording::of(names(car), spare);
    let mut rating = ShiftRating::new(&nominal.shift);
    let mut scored = 0;
    let felt_from_s = ShiftRating::felt_from_s(experiment.shift.request_s);
    over_shift([car, nominal], experiment, before_s, RELATIVE_TOLERANCE, |moment| {
        let phase = phase(moment.stage, moment.mode);
        let sample = shift_sample(moment, phase, moment.time_s >= felt_from_s, rating.is_locked());
        rating.push(&sample);
        recording.push(moment.time_s, phase, values(moment, &sample));
        if PHASES.contains(&phase) {
            scored = recording.len();
        }
    })?;
    let mut trace = recording.finish();
    trace.truncate(scored);
    Ok(ScoredShift { trace, quality: rating.finish() })
}

/// What the shift is rated by: no acceleration where the shift is not `felt`, and no torque of a clutch that is `locked` after
/// its shift.
fn shift_sample(moment: &Moment<'_>, phase: Phase, felt: bool, locked: bool) -> ShiftSample {
    ShiftSample {
        time_s: moment.time_s,
        phase,
        turbine_rad_s: moment.state.turbine_rad_s,
        output_rad_s: moment.state.output_rad_s,
        oncoming_slip_rad_s: moment.oncoming_slip_rad_s(),
        oncoming_n_m: if locked && phase == Phase::AfterShift { f64::NAN } else { moment.oncoming_n_m() },
        shaft_n_m: moment.shaft_n_m(),
        vehicle_m_s2: if felt { moment.vehicle_m_s2() } else { f64::NAN },
    }
}

/// The names of the columns in the order of [`values`].
fn names(vehicle: &Vehicle) -> [&'static str; COLUMNS] {
    [
        signal::ENGINE_SPEED,
        signal::TURBINE_SPEED,
        signal::OUTPUT_SPEED,
        signal::WHEEL_SPEED,
        command_signals(vehicle.oncoming.valve.command_kind()).0,
        command_signals(vehicle.offgoing.valve.command_kind()).1,
        signal::ONCOMING_PRESSURE,
        signal::ONCOMING_TORQUE,
        signal::SHAFT_TORQUE,
    ]
}

fn values(moment: &Moment<'_>, sample: &ShiftSample) -> [f64; COLUMNS] {
    [
        moment.state.engine_rad_s,
        moment.state.turbine_rad_s,
        moment.state.output_rad_s,
        moment.state.wheel_rad_s,
        moment.commands.oncoming,
        moment.commands.offgoing,
        moment.oncoming_pa(),
        sample.oncoming_n_m,
        sample.shaft_n_m,
    ]
}
