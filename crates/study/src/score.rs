//! How good an estimate and a shift were.

use observer::{Estimate, Phase};
use trace::{Trace, signal};

use crate::true_phases;

/// Errors of one signal in one phase: truth minus estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseScore {
    /// The phase, by the truth.
    pub phase: Phase,
    /// Number of samples.
    pub samples: usize,
    /// Largest size.
    pub peak: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Mean size.
    pub mean: f64,
}

/// Scores of `estimate` against `truth` in the torque and inertia phase and after the shift.
pub fn score(phases: &[Phase], truth: &[f64], estimate: impl Fn(usize) -> f64) -> Vec<PhaseScore> {
    [Phase::TorquePhase, Phase::InertiaPhase, Phase::AfterShift]
        .into_iter()
        .map(|phase| {
            let errors: Vec<f64> = (phases.iter().enumerate())
                .filter(|&(_, &at)| at == phase)
                .map(|(i, _)| (truth[i] - estimate(i)).abs())
                .collect();
            #[expect(clippy::cast_precision_loss, reason = "a count of samples")]
            let count = errors.len().max(1) as f64;
            PhaseScore {
                phase,
                samples: errors.len(),
                peak: errors.iter().copied().fold(0.0, f64::max),
                rms: (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt(),
                mean: errors.iter().sum::<f64>() / count,
            }
        })
        .collect()
}

/// Scores of the estimated pressure in a simulated trace.
pub fn pressure_scores(trace: &Trace, estimates: &[Estimate<f64>]) -> Option<Vec<PhaseScore>> {
    let (phases, truth) = (true_phases(trace)?, trace.get(signal::ONCOMING_PRESSURE)?);
    Some(score(&phases, truth, |i| estimates[i].pressure_pa))
}

/// What a calibrator asks of a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftQuality {
    /// Start of the load transfer, s.
    pub torque_phase_start_s: f64,
    /// When the offgoing clutch let go, s.
    pub inertia_phase_start_s: f64,
    /// When the oncoming clutch locked, s.
    pub lock_up_s: f64,
    /// Flare: how far the turbine rose above the speed of the gear before the shift, rad/s.
    pub flare_rad_s: f64,
    /// Tie-up: the least drive-shaft torque from the request to lock-up, N m. Negative brakes the car.
    pub least_shaft_torque_n_m: f64,
    /// Largest size of the jerk, averaged over 20 ms, m/s^3.
    pub jerk_peak_m_s3: f64,
}

/// Window over which the acceleration is averaged before it is differentiated, s: what a seated person
/// can still feel, and what accelerometers for shift rating are filtered to.
const JERK_WINDOW_S: f64 = 0.02;

impl ShiftQuality {
    /// Rates the shift of a simulated trace; `None` if it did not pass all its phases.
    pub fn of(trace: &Trace, shift: &drivetrain::ReducedShift<f64>) -> Option<Self> {
        let phases = true_phases(trace)?;
        let start = |phase| phases.iter().position(|&at| at == phase);
        let torque = start(Phase::TorquePhase)?;
        let (inertia, locked) = (start(Phase::InertiaPhase)?, start(Phase::AfterShift)?);
        let t = &trace.time_s;
        let (turbine, output) = (trace.get(signal::TURBINE_SPEED)?, trace.get(signal::OUTPUT_SPEED)?);
        let shaft = trace.get(signal::SHAFT_TORQUE)?;
        let ratio = shift.ratio_offgoing();
        let acceleration = trace.get(signal::VEHICLE_ACCELERATION)?;
        Some(Self {
            torque_phase_start_s: t[torque],
            inertia_phase_start_s: t[inertia],
            lock_up_s: t[locked],
            flare_rad_s: (torque..locked).map(|i| turbine[i] - ratio * output[i]).fold(0.0, f64::max),
            least_shaft_torque_n_m: shaft[torque..locked].iter().copied().fold(f64::INFINITY, f64::min),
            jerk_peak_m_s3: peak_jerk(t, acceleration, t[torque] - 0.3, t[locked] + 0.5),
        })
    }
}

/// Largest change of the acceleration over a window, per time.
fn peak_jerk(time_s: &[f64], acceleration: &[f64], from_s: f64, to_s: f64) -> f64 {
    let first = time_s.partition_point(|&t| t < from_s);
    let mut end = first;
    let mut peak = 0.0_f64;
    for i in first..time_s.len() {
        while end < time_s.len() && time_s[end] < time_s[i] + JERK_WINDOW_S - 1e-9 {
            end += 1;
        }
        if end == time_s.len() || time_s[end] > to_s {
            break;
        }
        peak = peak.max(((acceleration[end] - acceleration[i]) / (time_s[end] - time_s[i])).abs());
    }
    peak
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_those_of_the_errors_in_each_phase() {
        let phases = [Phase::BeforeShift, Phase::TorquePhase, Phase::TorquePhase, Phase::InertiaPhase];
        let truth = [9.0, 3.0, -4.0, 1.0];
        let scores = score(&phases, &truth, |_| 0.0);
        assert_eq!((scores[0].peak, scores[0].mean, scores[0].samples), (4.0, 3.5, 2));
        assert!((scores[0].rms - 12.5_f64.sqrt()).abs() < 1e-15);
        assert_eq!((scores[1].peak, scores[2].samples), (1.0, 0));
    }

    #[test]
    fn the_jerk_of_a_ramp_is_its_slope() {
        let time: Vec<f64> = (0..200).map(|i| f64::from(i) * 1e-3).collect();
        let ramp: Vec<f64> = time.iter().map(|t| 5.0 * t).collect();
        assert!((peak_jerk(&time, &ramp, 0.0, 1.0) - 5.0).abs() < 1e-9);
    }
}
