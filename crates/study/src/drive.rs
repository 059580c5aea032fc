//! A simulated drive as a trace.

use config::{Experiment, Vehicle};
use observer::Phase;
use plant::{Contact, Mode, PlantError, Powertrain, Sample, Simulation, Stage, simulate};
use trace::{Trace, Word, signal};

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
    let mut recording = Recording::new();
    simulate(vehicle, experiment, |sample| recording.take(sample))?;
    Ok(recording.finish())
}

/// How long before the shift request a shift is recorded, s: observers find the state of the driveline in it.
const BEFORE_REQUEST_S: f64 = 1.2;
/// How long after lock-up a shift is recorded, s.
const AFTER_LOCK_UP_S: f64 = 0.6;
/// How often a shift is looked at whether it has ended, s.
const LOOK_S: f64 = 0.05;

/// As [`simulate_drive`], but simulates `car`, while the shift controller knows `nominal`, and keeps only the
/// shift: from a second before its request until it has ended.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate_shift(car: &Vehicle, nominal: &Vehicle, experiment: &Experiment) -> Result<Trace, PlantError> {
    let powertrain = Powertrain::new(experiment.simulated_vehicle(car));
    let mut drive = Simulation::new(&powertrain, nominal, experiment)?;
    drive.record_from(experiment.shift.request_s - BEFORE_REQUEST_S);
    let mut recording = Recording::new();
    let mut until_s = experiment.shift.request_s;
    loop {
        drive.advance(until_s, |sample| recording.take(sample))?;
        let ended = matches!(drive.stage(), Stage::Locked(since_s) if drive.time_s() > since_s + AFTER_LOCK_UP_S);
        if ended || until_s >= experiment.duration_s {
            return Ok(recording.finish());
        }
        until_s += LOOK_S;
    }
}

/// Samples for which room is made at once: a shift at a millisecond.
const EXPECTED_SAMPLES: usize = 4096;

/// Samples on their way to a trace.
struct Recording {
    trace: Trace,
    phases: Vec<Word>,
}

impl Recording {
    fn new() -> Self {
        let mut trace = Trace::with_columns(COLUMNS);
        trace.reserve(EXPECTED_SAMPLES);
        Self { trace, phases: Vec::with_capacity(EXPECTED_SAMPLES) }
    }

    fn take(&mut self, sample: &Sample) {
        self.trace.push(sample.time_s, &row(sample));
        self.phases.push(phase(sample).name().into());
    }

    fn finish(mut self) -> Trace {
        self.trace.add_words(signal::TRUE_PHASE, self.phases);
        self.trace
    }
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
