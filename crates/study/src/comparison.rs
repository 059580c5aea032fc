//! Several observers on the same drive.

use config::{Experiment, Vehicle};
use design::{DesignError, RigidDesign, design_rigid, rigid_observer};
use observer::{Estimate, Phase, RigidGains};
use plant::PlantError;
use trace::{Trace, TraceError, signal};

use crate::score::pressure_scores;
use crate::{PhaseScore, RunColumns, ShiftQuality, run, simulate_drive};

/// Name of the observer that does not correct.
pub const OPEN_LOOP: &str = "open loop";

/// Why a comparison could not be made.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The simulation failed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// There are no gains.
    #[error(transparent)]
    Design(#[from] DesignError),
    /// A signal is missing.
    #[error(transparent)]
    Trace(#[from] TraceError),
}

/// One observer's part in a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverRun {
    /// Short name for tables.
    pub name: &'static str,
    /// One estimate for each sample.
    pub estimates: Vec<Estimate<f64>>,
    /// Errors of the pressure by phase.
    pub pressure: Vec<PhaseScore>,
    /// Errors of the clutch torque by phase.
    pub torque: Vec<PhaseScore>,
}

/// Observers on one drive, with the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The drive.
    pub trace: Trace,
    /// The true phase at each sample.
    pub phases: Vec<Phase>,
    /// The certified gains.
    pub design: RigidDesign,
    /// The observers; the open loop, which every result is held against, comes last.
    pub runs: Vec<ObserverRun>,
    /// The shift, if it was completed.
    pub quality: Option<ShiftQuality>,
    /// Certified bound on the error at each sample, Pa, where the observer corrects.
    pub bound_pa: Vec<Option<f64>>,
}

/// Simulates the experiment, designs the gains for the nominal vehicle, and runs the rigid observer and
/// the open loop over the same samples.
///
/// # Errors
/// Simulation, design, or signals; see [`StudyError`].
pub fn compare(vehicle: &Vehicle, experiment: &Experiment) -> Result<Comparison, StudyError> {
    let trace = simulate_drive(vehicle, experiment)?;
    let design = design_rigid(vehicle)?;
    let columns = RunColumns::of(&trace, vehicle)?;
    let phases = crate::true_phases(&trace).unwrap_or_default();
    let torque_truth = trace.require(signal::ONCOMING_TORQUE)?;
    let runs: Vec<ObserverRun> = [("ISS", design.gains()), (OPEN_LOOP, RigidGains::open_loop())]
        .into_iter()
        .map(|(name, gains)| {
            let estimates = run(&columns, &rigid_observer(vehicle, gains));
            ObserverRun {
                name,
                pressure: pressure_scores(&trace, &estimates).unwrap_or_default(),
                torque: crate::score(&phases, torque_truth, |i| estimates[i].clutch_torque_n_m),
                estimates,
            }
        })
        .collect();
    let bound_pa = certified_bound(&trace, &design, &runs[0].estimates)?;
    Ok(Comparison { quality: ShiftQuality::of(&trace, &vehicle.shift), phases, design, runs, bound_pa, trace })
}

/// The bound (2.40) along the drive: in each phase it starts from the error that the estimate has there.
fn certified_bound(
    trace: &Trace,
    design: &RigidDesign,
    estimates: &[Estimate<f64>],
) -> Result<Vec<Option<f64>>, TraceError> {
    let truth = trace.require(signal::ONCOMING_PRESSURE)?;
    let mut entered: Option<(Phase, f64, f64)> = None;
    Ok((0..trace.len())
        .map(|i| {
            let (phase, time_s) = (estimates[i].phase, trace.time_s[i]);
            let error = (truth[i] - estimates[i].pressure_pa).abs();
            let (_, since_s, initial) = match entered {
                Some(same) if same.0 == phase => same,
                _ => *entered.insert((phase, time_s, error)),
            };
            design.of(phase).map(|certificate| certificate.error_bound_pa(initial, time_s - since_s))
        })
        .collect())
}

impl Comparison {
    /// Share of the samples with a bound at which the error of the first observer lies within it, and
    /// the largest excess over it, Pa.
    pub fn bound_coverage(&self, phase: Phase) -> Option<(f64, f64)> {
        let truth = self.trace.get(signal::ONCOMING_PRESSURE)?;
        let excesses: Vec<f64> = (self.runs[0].estimates.iter().zip(truth).zip(&self.bound_pa))
            .filter(|((estimate, _), _)| estimate.phase == phase)
            .filter_map(|((estimate, truth), bound)| bound.map(|b| (truth - estimate.pressure_pa).abs() - b))
            .collect();
        let inside = excesses.iter().filter(|&&excess| excess <= 1e-9).count();
        #[expect(clippy::cast_precision_loss, reason = "counts of samples")]
        let share = inside as f64 / excesses.len().max(1) as f64;
        (!excesses.is_empty()).then(|| (share, excesses.iter().copied().fold(0.0, f64::max)))
    }
}
