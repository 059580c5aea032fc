//! A simulated drive as a trace.

use config::{Experiment, Vehicle};
use observer::Phase;
use plant::{Contact, Mode, PlantError, Sample, Stage, simulate};
use trace::{Trace, signal};

/// Columns of a simulated trace, measurable ones first.
const COLUMNS: &[&str] = &[
    signal::ENGINE_SPEED,
    signal::TURBINE_SPEED,
    signal::OUTPUT_SPEED,
    signal::WHEEL_SPEED,
    signal::ONCOMING_SLIP,
    signal::ONCOMING_CURRENT,
    signal::OFFGOING_CURRENT,
    signal::THROTTLE,
    signal::ONCOMING_PRESSURE,
    signal::OFFGOING_PRESSURE,
    signal::ONCOMING_TORQUE,
    signal::OFFGOING_TORQUE,
    signal::OFFGOING_SLIP,
    signal::ENGINE_TORQUE,
    signal::TURBINE_TORQUE,
    signal::SHAFT_TORQUE,
    signal::VEHICLE_SPEED,
    signal::VEHICLE_ACCELERATION,
];

/// Simulates the experiment and returns what was recorded, with the true phase of the shift as words.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate_drive(vehicle: &Vehicle, experiment: &Experiment) -> Result<Trace, PlantError> {
    let mut trace = Trace::with_columns(COLUMNS);
    let mut phases = Vec::new();
    simulate(vehicle, experiment, |sample| {
        trace.push(sample.time_s, &row(sample));
        phases.push(phase(sample).name().to_owned());
    })?;
    trace.add_words(signal::TRUE_PHASE, phases);
    Ok(trace)
}

/// The values of a sample in the order of [`COLUMNS`].
fn row(sample: &Sample) -> [f64; COLUMNS.len()] {
    let (state, torques) = (&sample.state, &sample.torques);
    [
        state.engine_rad_s,
        state.turbine_rad_s,
        state.output_rad_s,
        state.wheel_rad_s,
        sample.oncoming_slip_rad_s,
        sample.commands.oncoming_a,
        sample.commands.offgoing_a,
        sample.commands.throttle,
        sample.oncoming_pa,
        state.offgoing_pa,
        torques.shift.oncoming_n_m,
        torques.shift.offgoing_n_m,
        sample.offgoing_slip_rad_s,
        torques.engine_n_m,
        torques.shift.turbine_n_m,
        torques.shaft_n_m,
        state.vehicle_m_s,
        sample.vehicle_m_s2,
    ]
}

/// The true phase: the torque phase begins when the controller starts the load transfer, the inertia
/// phase when the offgoing clutch lets go, and the shift ends when the oncoming clutch sticks.
fn phase(sample: &Sample) -> Phase {
    let begun = matches!(sample.stage, Stage::TorquePhase(_) | Stage::InertiaPhase { .. } | Stage::Locked(_));
    match sample.mode {
        _ if !begun => Phase::BeforeShift,
        Mode { offgoing: Contact::Stuck, .. } => Phase::TorquePhase,
        Mode { oncoming: Contact::Slipping(_), .. } => Phase::InertiaPhase,
        Mode { oncoming: Contact::Stuck, .. } => Phase::AfterShift,
    }
}

/// The true phases of a simulated trace, if it has them.
pub fn true_phases(trace: &Trace) -> Option<Vec<Phase>> {
    let column = trace.columns.iter().find(|column| column.name == signal::TRUE_PHASE)?;
    let trace::Values::Words(words) = &column.values else { return None };
    words.iter().map(|word| Phase::ALL.into_iter().find(|phase| phase.name() == word)).collect()
}
