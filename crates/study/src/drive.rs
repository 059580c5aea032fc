//! A simulated drive as a trace.

use car::{Experiment, Vehicle};
use observer::Phase;
use plant::hybrid::RELATIVE_TOLERANCE;
use plant::{Contact, Mode, Moment, PlantError, Powertrain, Sample, Simulation, Stage, simulate};
use trace::{Cell, Column, Trace, Values, Word, signal};

use crate::ShiftSample;
use crate::run::command_signals;

/// Columns of a simulated trace.
const COLUMNS: usize = 18;

/// Their names, measurable ones first.
fn column_names(vehicle: &Vehicle) -> [&'static str; COLUMNS] {
    let (oncoming_command, _) = command_signals(vehicle.oncoming.valve.command_kind());
    let (_, offgoing_command) = command_signals(vehicle.offgoing.valve.command_kind());
    [
        signal::ENGINE_SPEED,
        signal::TURBINE_SPEED,
        signal::OUTPUT_SPEED,
        signal::WHEEL_SPEED,
        signal::ONCOMING_SLIP,
        oncoming_command,
        offgoing_command,
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
    ]
}

/// Simulates the experiment and returns what was recorded, with the true phase of the shift as words.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate_drive(vehicle: &Vehicle, experiment: &Experiment) -> Result<Trace, PlantError> {
    let mut recording = Recording::new(vehicle, Trace::default());
    simulate(vehicle, experiment, |sample| recording.take(sample))?;
    Ok(recording.finish())
}

/// How long after lock-up a shift is recorded, s.
const AFTER_LOCK_UP_S: f64 = 0.6;
/// How often a shift is looked at whether it has ended, s.
const LOOK_S: f64 = 0.05;

/// As [`simulate_drive`], but simulates `car`, while the shift controller's model is `nominal`, and keeps only the
/// shift: from `before_s` seconds before its request until it has ended.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate_shift(
    car: &Vehicle,
    nominal: &Vehicle,
    experiment: &Experiment,
    before_s: f64,
) -> Result<Trace, PlantError> {
    simulate_shift_within(car, nominal, experiment, before_s, RELATIVE_TOLERANCE)
}

/// As [`simulate_shift`], with a relative tolerance of the integration of its own.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate_shift_within(
    car: &Vehicle,
    nominal: &Vehicle,
    experiment: &Experiment,
    before_s: f64,
    relative_tolerance: f64,
) -> Result<Trace, PlantError> {
    let mut recording = Recording::new(car, Trace::default());
    over_shift([car, nominal], experiment, before_s, relative_tolerance, |moment| recording.take(&moment.sample()))?;
    Ok(recording.finish())
}

/// As [`simulate_shift_within`] of a car and the model of its controller, where `take` gets every sample and records what it needs.
///
/// # Errors
/// See [`PlantError`].
pub(crate) fn over_shift(
    [car, nominal]: [&Vehicle; 2],
    experiment: &Experiment,
    before_s: f64,
    relative_tolerance: f64,
    mut take: impl FnMut(&Moment<'_>),
) -> Result<(), PlantError> {
    let powertrain = Powertrain::new(experiment.simulated_vehicle(car));
    let mut drive = Simulation::with_tolerance(&powertrain, nominal, experiment, relative_tolerance)?;
    drive.record_from(experiment.shift.request_s - before_s);
    let mut until_s = experiment.shift.request_s;
    loop {
        drive.advance_to(until_s, &mut take)?;
        let ended = matches!(drive.stage(), Stage::Locked(since_s) if drive.time_s() > since_s + AFTER_LOCK_UP_S);
        if ended || until_s >= experiment.duration_s {
            return Ok(());
        }
        until_s += LOOK_S;
    }
}

/// Samples for which room is made at once: a shift at a millisecond.
const EXPECTED_SAMPLES: usize = 4096;

/// Samples on their way to a trace, with this number of columns beside the time and the phase.
pub struct Recording<const N: usize = COLUMNS> {
    names: [&'static str; N],
    time_s: Vec<f64>,
    columns: [Vec<f64>; N],
    phases: Vec<Word>,
}

impl Recording {
    /// Every signal of a vehicle; nothing recorded yet, in the memory of a spare trace.
    pub fn new(vehicle: &Vehicle, spare: Trace) -> Self {
        Self::of(column_names(vehicle), spare)
    }

    /// Takes the next sample.
    pub fn take(&mut self, sample: &Sample) {
        let row = DriveRow::of(sample);
        self.push(row.time_s, row.phase, row.values);
    }
}

impl<const N: usize> Recording<N> {
    /// Columns of these names; nothing recorded yet, in the memory of a spare trace.
    pub(crate) fn of(names: [&'static str; N], spare: Trace) -> Self {
        let (mut numbers, mut phases) = (vec![spare.time_s], Vec::new());
        for column in spare.columns {
            match column.values {
                Values::Numbers(values) => numbers.push(values),
                Values::Words(words) => phases = words,
            }
        }
        phases.clear();
        let mut column = || {
            let mut column = numbers.pop().unwrap_or_default();
            column.clear();
            column.reserve(EXPECTED_SAMPLES);
            column
        };
        Self { names, time_s: column(), columns: std::array::from_fn(|_| column()), phases }
    }

    /// Number of the samples so far.
    pub(crate) fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Appends a row.
    #[inline]
    pub(crate) fn push(&mut self, time_s: f64, phase: Phase, values: [f64; N]) {
        self.time_s.push(time_s);
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.push(value);
        }
        self.phases.push(phase.name().into());
    }

    /// The trace, with the true phase of the shift as words.
    pub fn finish(self) -> Trace {
        let column = |(name, values): (&str, _)| Column { name: name.to_owned(), values: Values::Numbers(values) };
        let mut columns = Vec::with_capacity(N + 1);
        columns.extend(self.names.into_iter().zip(self.columns).map(column));
        let mut trace = Trace { path: None, time_s: self.time_s, columns };
        trace.add_words(signal::TRUE_PHASE, self.phases);
        trace
    }
}

/// A row of a simulated trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveRow {
    /// Time, s.
    pub time_s: f64,
    values: [f64; COLUMNS],
    /// The true phase.
    pub phase: Phase,
}

impl DriveRow {
    /// The row of a sample.
    pub fn of(sample: &Sample) -> Self {
        Self { time_s: sample.time_s, values: values(sample), phase: phase(sample.stage, sample.mode) }
    }
}

/// Columns of a simulated trace, as rows are written into them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DriveColumns {
    columns: Vec<(usize, &'static str)>,
    phase: bool,
}

impl DriveColumns {
    /// Those of this vehicle that `keep` names.
    pub fn those(vehicle: &Vehicle, keep: impl Fn(&str) -> bool) -> Self {
        let columns = column_names(vehicle).into_iter().enumerate().filter(|(_, name)| keep(name)).collect();
        Self { columns, phase: keep(signal::TRUE_PHASE) }
    }

    /// Their names, without the time.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.columns.iter().map(|&(_, name)| name).chain(self.phase.then_some(signal::TRUE_PHASE))
    }

    /// What a row holds in them.
    pub fn cells(&self, row: &DriveRow) -> impl Iterator<Item = Cell<'static>> {
        let numbers = self.columns.iter().map(|&(i, _)| Cell::Number(row.values[i]));
        numbers.chain(self.phase.then(|| Cell::Word(row.phase.name())))
    }
}

impl ShiftSample {
    /// What a shift is rated by.
    pub fn of(sample: &Sample) -> Self {
        Self {
            time_s: sample.time_s,
            phase: phase(sample.stage, sample.mode),
            turbine_rad_s: sample.state.turbine_rad_s,
            output_rad_s: sample.state.output_rad_s,
            oncoming_slip_rad_s: sample.oncoming_slip_rad_s,
            oncoming_n_m: sample.torques.shift.oncoming_n_m,
            shaft_n_m: sample.torques.shaft_n_m,
            vehicle_m_s2: sample.vehicle_m_s2,
        }
    }
}

/// The values of a sample in the order of [`column_names`].
fn values(sample: &Sample) -> [f64; COLUMNS] {
    let (state, torques) = (&sample.state, &sample.torques);
    [
        state.engine_rad_s,
        state.turbine_rad_s,
        state.output_rad_s,
        state.wheel_rad_s,
        sample.oncoming_slip_rad_s,
        sample.commands.oncoming,
        sample.commands.offgoing,
        sample.commands.throttle,
        sample.oncoming_pa,
        sample.offgoing_pa,
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
pub(crate) fn phase(stage: Stage, mode: Mode) -> Phase {
    let begun = matches!(stage, Stage::TorquePhase(_) | Stage::InertiaPhase { .. } | Stage::Locked(_));
    match mode {
        _ if !begun => Phase::BeforeShift,
        Mode { offgoing: Contact::Stuck, .. } => Phase::TorquePhase,
        Mode { oncoming: Contact::Slipping(_), .. } => Phase::InertiaPhase,
        Mode { oncoming: Contact::Stuck, .. } => Phase::AfterShift,
    }
}

/// The true phases of a simulated trace, if it has them.
pub fn true_phases(trace: &Trace) -> Option<Vec<Phase>> {
    let column = trace.columns.iter().find(|column| column.name == signal::TRUE_PHASE)?;
    let Values::Words(words) = &column.values else { return None };
    let named = |word: &Word| Phase::ALL.into_iter().find(|phase| phase.name() == word);
    // Nearly every sample is in the phase of the one before, and most often has the very same word.
    let mut before: Option<(&Word, Phase)> = None;
    let same = |a: &str, b: &str| std::ptr::eq(a, b) || a == b;
    (words.iter())
        .map(|word| {
            if let Some((_, phase)) = before.filter(|(other, _)| same(other, word)) {
                return Some(phase);
            }
            before = Some((word, named(word)?));
            before.map(|(_, phase)| phase)
        })
        .collect()
}
