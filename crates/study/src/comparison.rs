//! Several observers on the same drive.

use car::{Experiment, ObserverEntry, ObserverKind, Vehicle};
use config::ConfigError;
use config::study::RECORD_BEFORE_S;
use design::{CompliantDesign, DesignError, RigidDesign, design_compliant, design_rigid};
use observer::{Bounds, Estimate, Phase};
use plant::PlantError;
use trace::{Trace, TraceError, signal};

use crate::gearbox::EvaluateError;
use crate::observers::{AnyObserver, ranges};
use crate::sampling::{sampled, through_sensors};
use crate::score::{score_ranges, size};
use crate::{PhaseScore, RangeScore, RunColumns, ShiftQuality, score, simulate_drive, simulate_shift, true_phases};

/// Fraction of the range within which a pressure error counts as settled.
const SETTLED_FRACTION: f64 = 0.05;
/// Clutch-torque error that counts as settled, N m.
const SETTLED_CLUTCH_N_M: f64 = 10.0;
/// Shaft-torque error that counts as settled, N m.
const SETTLED_SHAFT_N_M: f64 = 50.0;

/// Why a comparison could not be made.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// Values of a study's factors that do not go together.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A defect of this program.
    #[error("run {run}: {message}\nhint: this is an error in wetclutch; please report it with the files of the study")]
    Defect {
        /// The run in which it showed.
        run: u64,
        /// The message of the panic.
        message: String,
    },
    /// The system gives no thread to work on.
    #[error("no thread could be started: {0}")]
    Threads(#[source] std::io::Error),
    /// The search for a worst case failed.
    #[error("the search failed: {0}")]
    Search(String),
    /// The simulation failed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// There are no gains.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// A signal is missing.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// A shift of a car with any gearbox could not be scored.
    #[error(transparent)]
    AnyShift(#[from] EvaluateError),
}

/// One observer's part in a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverRun {
    /// What was run.
    pub entry: ObserverEntry,
    /// Times of its samples, s.
    pub time_s: Vec<f64>,
    /// True pressure of the oncoming clutch at these times, Pa.
    pub truth_pa: Vec<f64>,
    /// One estimate for each.
    pub estimates: Vec<Estimate<f64>>,
    /// Errors of the pressure by phase, Pa.
    pub pressure: Vec<PhaseScore>,
    /// Errors of the clutch torque by phase, N m.
    pub torque: Vec<PhaseScore>,
    /// Errors of the shaft torque by phase, N m, if it estimates that.
    pub shaft: Option<Vec<PhaseScore>>,
    /// The guaranteed ranges by phase, if there are any.
    pub ranges: Vec<RangeScore>,
}

/// Observers on one drive, with the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The experiment.
    pub experiment: Experiment,
    /// The drive.
    pub trace: Trace,
    /// The true phase at each sample of the drive.
    pub phases: Vec<Phase>,
    /// Certified gains of the rigid observer.
    pub rigid: RigidDesign,
    /// Certified gains of the compliant observer.
    pub compliant: CompliantDesign,
    /// The observers in the order of the experiment.
    pub runs: Vec<ObserverRun>,
    /// The shift, if it was completed.
    pub quality: Option<ShiftQuality>,
    /// Certified bound on the error of the first observer at each of its samples, Pa, where it is the rigid
    /// one with designed gains and corrects.
    pub bound_pa: Vec<Option<f64>>,
}

/// Simulates the experiment, designs gains for the nominal vehicle, and runs the experiment's observers
/// over the same drive.
///
/// # Errors
/// Simulation, design, or signals; see [`StudyError`].
pub fn compare(vehicle: &Vehicle, experiment: &Experiment) -> Result<Comparison, StudyError> {
    compare_on(simulate_drive(vehicle, experiment)?, vehicle, experiment)
}

/// The same over the shift alone.
///
/// # Errors
/// As [`compare`].
pub fn compare_shift(vehicle: &Vehicle, experiment: &Experiment) -> Result<Comparison, StudyError> {
    compare_on(simulate_shift(vehicle, vehicle, experiment, RECORD_BEFORE_S)?, vehicle, experiment)
}

fn compare_on(trace: Trace, vehicle: &Vehicle, experiment: &Experiment) -> Result<Comparison, StudyError> {
    let (rigid, compliant) = (design_rigid(vehicle)?, design_compliant(vehicle)?);
    let observers = observers(vehicle, experiment)?;
    let runs = run_observers(vehicle, experiment, &observers, &trace)?;
    let bound_pa = match runs.first() {
        Some(run) if run.entry.kind == ObserverKind::Rigid && run.entry.gains.is_none() => certified_bound(run, &rigid),
        _ => Vec::new(),
    };
    Ok(Comparison {
        quality: ShiftQuality::of(&trace, &vehicle.shift),
        phases: true_phases(&trace).unwrap_or_default(),
        experiment: experiment.clone(),
        rigid,
        compliant,
        runs,
        bound_pa,
        trace,
    })
}

/// The experiment's observers, in its order.
///
/// # Errors
/// There are no gains for what the vehicle file requires.
pub fn observers(vehicle: &Vehicle, experiment: &Experiment) -> Result<Vec<AnyObserver>, DesignError> {
    let sensors = experiment.sensors_given.as_ref();
    experiment.observers.iter().map(|entry| AnyObserver::of(vehicle, entry, sensors)).collect()
}

/// The signals of observers with this sample time, behind sensors or not, and the ranges at every sample.
type Seen = ((f64, bool), Trace, Vec<Bounds<f64>>);

/// Runs the experiment's observers over a recorded drive, each behind its sensors and at its sample time.
///
/// # Errors
/// A signal is missing.
pub fn run_observers(
    vehicle: &Vehicle,
    experiment: &Experiment,
    observers: &[AnyObserver],
    whole: &Trace,
) -> Result<Vec<ObserverRun>, TraceError> {
    let mut seen: Vec<Seen> = Vec::new();
    (experiment.observers.iter().zip(observers))
        .map(|(entry, observer)| {
            // Observers of the same sample time see the same signals, and have the same ranges.
            let signals = (entry.sample_time_s, entry.real_sensors);
            let at = seen.iter().position(|(same, ..)| *same == signals);
            let at = match at {
                Some(at) => at,
                None => {
                    let trace = measured(vehicle, experiment, entry, whole);
                    let ranges = ranges(vehicle, &RunColumns::of(&trace, vehicle)?);
                    seen.push((signals, trace, ranges));
                    seen.len() - 1
                }
            };
            let (_, trace, ranges) = &seen[at];
            run_observer(vehicle, experiment, entry, observer, trace, ranges)
        })
        .collect()
}

/// What an observer sees of a drive: the signals at its sample time, behind the sensors if it is to.
pub(crate) fn measured(vehicle: &Vehicle, experiment: &Experiment, entry: &ObserverEntry, whole: &Trace) -> Trace {
    match &experiment.sensors {
        Some(sensors) if entry.real_sensors => through_sensors(whole, entry.sample_time_s, sensors, vehicle),
        _ => sampled(whole, entry.sample_time_s),
    }
}

fn run_observer(
    vehicle: &Vehicle,
    experiment: &Experiment,
    entry: &ObserverEntry,
    observer: &AnyObserver,
    trace: &Trace,
    ranges: &[Bounds<f64>],
) -> Result<ObserverRun, TraceError> {
    let mut estimates = observer.run_alone(&RunColumns::of(trace, vehicle)?);
    for (estimate, range) in estimates.iter_mut().zip(ranges) {
        // Observers are compared as they are: limited to the ranges, those with large errors would look better.
        *estimate = range.around(*estimate);
    }
    let phases = true_phases(trace).unwrap_or_default();
    let time = &trace.time_s;
    let truth_pa = trace.require(signal::ONCOMING_PRESSURE)?;
    let settled_pa = SETTLED_FRACTION * experiment.shift.line_pressure_pa;
    let clutch = trace.require(signal::ONCOMING_TORQUE)?;
    let shaft = trace.require(signal::SHAFT_TORQUE)?;
    // Where an observer gives no shaft torque there is nothing to hold against the truth.
    let shaft_estimates: Vec<f64> =
        estimates.iter().map(|estimate| estimate.shaft_torque_n_m.unwrap_or_default()).collect();
    let shaft_known: Vec<f64> = (estimates.iter().zip(shaft))
        .map(|(estimate, &truth)| if estimate.shaft_torque_n_m.is_some() { truth } else { f64::NAN })
        .collect();
    let has_shaft = shaft_known.iter().any(|truth| !truth.is_nan());
    Ok(ObserverRun {
        entry: entry.clone(),
        pressure: score(time, &phases, truth_pa, settled_pa, |i| estimates[i].pressure_pa),
        torque: score(time, &phases, clutch, SETTLED_CLUTCH_N_M, |i| estimates[i].clutch_torque_n_m),
        shaft: has_shaft.then(|| score(time, &phases, &shaft_known, SETTLED_SHAFT_N_M, |i| shaft_estimates[i])),
        ranges: score_ranges(&phases, truth_pa, clutch, shaft, |i| estimates[i].bounds),
        truth_pa: truth_pa.to_vec(),
        time_s: trace.time_s.clone(),
        estimates,
    })
}

/// The bound (2.40) along the drive: in each phase it starts from the error that the estimate has there.
fn certified_bound(run: &ObserverRun, design: &RigidDesign) -> Vec<Option<f64>> {
    let mut entered: Option<(Phase, f64, f64)> = None;
    (0..run.time_s.len())
        .map(|i| {
            let (phase, time_s) = (run.estimates[i].phase, run.time_s[i]);
            let error = (run.truth_pa[i] - run.estimates[i].pressure_pa).abs();
            let (_, since_s, initial) = match entered {
                Some(same) if same.0 == phase => same,
                _ => *entered.insert((phase, time_s, error)),
            };
            design.of(phase).map(|certificate| certificate.error_bound_pa(initial, time_s - since_s))
        })
        .collect()
}

impl ObserverRun {
    /// Score of the pressure in a phase.
    pub fn pressure_in(&self, phase: Phase) -> Option<&PhaseScore> {
        self.pressure.iter().find(|score| score.phase == phase && score.samples > 0)
    }
}

impl Comparison {
    /// The run of this name.
    pub fn run(&self, name: &str) -> Option<&ObserverRun> {
        self.runs.iter().find(|run| run.entry.name == name)
    }

    /// The open loop, with which every result is compared.
    pub fn open_loop(&self) -> Option<&ObserverRun> {
        self.runs.iter().find(|run| run.entry.kind == ObserverKind::OpenLoop)
    }

    /// Fraction of the samples with a bound at which the error of the first observer lies within it, and
    /// the largest excess over it, Pa.
    pub fn bound_coverage(&self, phase: Phase) -> Option<(f64, f64)> {
        let run = self.runs.first()?;
        let excesses: Vec<f64> = (run.estimates.iter().zip(&run.truth_pa).zip(&self.bound_pa))
            .filter(|((estimate, _), _)| estimate.phase == phase)
            .filter_map(|((estimate, truth), bound)| bound.map(|b| size(truth - estimate.pressure_pa) - b))
            .collect();
        let inside = excesses.iter().filter(|&&excess| excess <= 1e-9).count();
        let fraction = inside as f64 / excesses.len().max(1) as f64;
        (!excesses.is_empty()).then(|| (fraction, excesses.iter().copied().fold(0.0, f64::max)))
    }
}
