//! How good an estimate and a shift were.

use drivetrain::ReducedShift;
use observer::{Bounds, Phase};
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
    /// Time from the start of the phase after which the error stays small, s; `None` if it never does.
    pub settling_s: Option<f64>,
    /// Chatter: total variation of the estimate beyond that of the truth.
    pub chatter: f64,
}

/// Scores of `estimate` against `truth` in the torque and inertia phase and after the shift. An error below
/// `settled` counts as small.
pub fn score(
    time_s: &[f64],
    phases: &[Phase],
    truth: &[f64],
    settled: f64,
    estimate: impl Fn(usize) -> f64,
) -> Vec<PhaseScore> {
    let variation = |at: &[usize], value: &dyn Fn(usize) -> f64| -> f64 {
        at.windows(2).map(|pair| (value(pair[1]) - value(pair[0])).abs()).sum()
    };
    [Phase::TorquePhase, Phase::InertiaPhase, Phase::AfterShift]
        .into_iter()
        .map(|phase| {
            let at: Vec<usize> = (0..phases.len()).filter(|&i| phases[i] == phase).collect();
            let errors: Vec<f64> = at.iter().map(|&i| (truth[i] - estimate(i)).abs()).collect();
            #[expect(clippy::cast_precision_loss, reason = "a count of samples")]
            let count = errors.len().max(1) as f64;
            // NaN counts as large: an estimate that is none has not settled.
            let last_large = errors.iter().rposition(|&error| error.is_nan() || error > settled);
            PhaseScore {
                phase,
                samples: errors.len(),
                peak: errors.iter().copied().fold(0.0, f64::max),
                rms: (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt(),
                mean: errors.iter().sum::<f64>() / count,
                settling_s: match last_large {
                    None => Some(0.0),
                    Some(last) => at.get(last + 1).map(|&i| time_s[i] - time_s[at[0]]),
                },
                chatter: (variation(&at, &estimate) - variation(&at, &|i| truth[i])).max(0.0),
            }
        })
        .collect()
}

/// How well the guaranteed range around an estimate did in one phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeScore {
    /// The phase, by the truth.
    pub phase: Phase,
    /// Share of the samples with the true pressure in the range.
    pub pressure_inside: f64,
    /// Share of the samples with the true clutch torque in the range.
    pub torque_inside: f64,
    /// Share of the samples with the true shaft torque in the range, of those that have one.
    pub shaft_inside: f64,
    /// Mean width of the range of the pressure, Pa.
    pub width_pa: f64,
    /// Mean width of the range of the clutch torque, N m.
    pub torque_width_n_m: f64,
    /// Mean width of the range of the shaft torque, N m; NaN without one.
    pub shaft_width_n_m: f64,
}

impl RangeScore {
    /// The least share of samples inside of the three.
    pub fn inside(&self) -> f64 {
        self.pressure_inside.min(self.torque_inside).min(self.shaft_inside)
    }
}

/// Scores of the ranges in the torque and inertia phase and after the shift; none where there is no range.
pub fn score_ranges(
    phases: &[Phase],
    pressure_pa: &[f64],
    torque_n_m: &[f64],
    shaft_n_m: &[f64],
    bounds: impl Fn(usize) -> Option<Bounds<f64>>,
) -> Vec<RangeScore> {
    [Phase::TorquePhase, Phase::InertiaPhase, Phase::AfterShift]
        .into_iter()
        .filter_map(|phase| {
            let at = (0..phases.len()).filter(|&i| phases[i] == phase);
            let ranges: Vec<(usize, Bounds<f64>)> = at.filter_map(|i| Some((i, bounds(i)?))).collect();
            #[expect(clippy::cast_precision_loss, reason = "a count of samples")]
            let mean = |value: &dyn Fn(usize, &Bounds<f64>) -> f64| {
                ranges.iter().map(|(i, bounds)| value(*i, bounds)).sum::<f64>() / ranges.len() as f64
            };
            let inside = |[low, high]: [f64; 2], truth: f64| f64::from(u8::from(low <= truth && truth <= high));
            let shafts = || ranges.iter().filter_map(|(i, bounds)| Some((*i, bounds.shaft_torque_n_m?)));
            let mean_shaft = |value: &dyn Fn(usize, [f64; 2]) -> f64| {
                shafts().map(|(i, range)| value(i, range)).sum::<f64>() / shafts().count() as f64
            };
            (!ranges.is_empty()).then(|| RangeScore {
                phase,
                pressure_inside: mean(&|i, bounds| inside(bounds.pressure_pa, pressure_pa[i])),
                torque_inside: mean(&|i, bounds| inside(bounds.clutch_torque_n_m, torque_n_m[i])),
                shaft_inside: if shafts().count() > 0 {
                    mean_shaft(&|i, range| inside(range, shaft_n_m[i]))
                } else {
                    1.0
                },
                torque_width_n_m: mean(&|_, bounds| bounds.clutch_torque_n_m[1] - bounds.clutch_torque_n_m[0]),
                shaft_width_n_m: mean_shaft(&|_, range| range[1] - range[0]),
                width_pa: mean(&|_, bounds| bounds.pressure_pa[1] - bounds.pressure_pa[0]),
            })
        })
        .collect()
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
    /// Vibration dose value of the longitudinal acceleration, m/s^1.75: the fourth root of the integral of
    /// its fourth power, above 0.4 Hz, the lower limit of the weighting of ISO 2631-1.
    pub vibration_dose_m_s175: f64,
    /// Work of friction in the oncoming clutch, J.
    pub friction_work_j: f64,
}

/// Window over which the acceleration is averaged before it is differentiated, s: what a seated person
/// can still feel, and what accelerometers for shift rating are filtered to.
const JERK_WINDOW_S: f64 = 0.02;
/// Lower limit of the band that the vibration dose counts, Hz.
const VIBRATION_FROM_HZ: f64 = 0.4;
/// How long before the load transfer and after lock-up a shift is felt, s.
const FELT_BEFORE_S: f64 = 0.3;
const FELT_AFTER_S: f64 = 0.5;

impl ShiftQuality {
    /// Rates the shift of a simulated trace; `None` if it did not pass all its phases.
    pub fn of(trace: &Trace, shift: &ReducedShift<f64>) -> Option<Self> {
        let phases = true_phases(trace)?;
        let start = |phase| phases.iter().position(|&at| at == phase);
        let torque = start(Phase::TorquePhase)?;
        let (inertia, locked) = (start(Phase::InertiaPhase)?, start(Phase::AfterShift)?);
        let t = &trace.time_s;
        let (turbine, output) = (trace.get(signal::TURBINE_SPEED)?, trace.get(signal::OUTPUT_SPEED)?);
        let shaft = trace.get(signal::SHAFT_TORQUE)?;
        let ratio = shift.ratio_offgoing();
        let acceleration = trace.get(signal::VEHICLE_ACCELERATION)?;
        let (clutch, slip) = (trace.get(signal::ONCOMING_TORQUE)?, trace.get(signal::ONCOMING_SLIP)?);
        let friction_w = |i: usize| clutch[i] * slip[i];
        let felt = (t[torque] - FELT_BEFORE_S, t[locked] + FELT_AFTER_S);
        Some(Self {
            torque_phase_start_s: t[torque],
            inertia_phase_start_s: t[inertia],
            lock_up_s: t[locked],
            flare_rad_s: (torque..locked).map(|i| turbine[i] - ratio * output[i]).fold(0.0, f64::max),
            least_shaft_torque_n_m: shaft[torque..locked].iter().copied().fold(f64::INFINITY, f64::min),
            jerk_peak_m_s3: peak_jerk(t, acceleration, felt),
            vibration_dose_m_s175: vibration_dose(t, acceleration, felt),
            friction_work_j: (1..=locked).map(|i| 0.5 * (friction_w(i - 1) + friction_w(i)) * (t[i] - t[i - 1])).sum(),
        })
    }
}

/// Largest change of the acceleration over a window, per time.
fn peak_jerk(time_s: &[f64], acceleration: &[f64], (from_s, to_s): (f64, f64)) -> f64 {
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

/// Fourth root of the integral of the fourth power of the acceleration after a first-order high pass.
fn vibration_dose(time_s: &[f64], acceleration: &[f64], (from_s, to_s): (f64, f64)) -> f64 {
    let first = time_s.partition_point(|&t| t < from_s);
    let Some(&begin) = acceleration.get(first) else { return 0.0 };
    let (mut slow, mut dose) = (begin, 0.0);
    for i in first + 1..time_s.len().min(time_s.partition_point(|&t| t <= to_s)) {
        let dt = time_s[i] - time_s[i - 1];
        slow += (1.0 - (-std::f64::consts::TAU * VIBRATION_FROM_HZ * dt).exp()) * (acceleration[i] - slow);
        dose += (acceleration[i] - slow).powi(4) * dt;
    }
    dose.powf(0.25)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scores_are_those_of_the_errors_in_each_phase() {
        let phases = [Phase::BeforeShift, Phase::TorquePhase, Phase::TorquePhase, Phase::InertiaPhase];
        let truth = [9.0, 3.0, -4.0, 1.0];
        let scores = score(&[0.0, 0.1, 0.2, 0.3], &phases, &truth, 1.5, |_| 0.0);
        assert_eq!((scores[0].peak, scores[0].mean, scores[0].samples), (4.0, 3.5, 2));
        assert!((scores[0].rms - 12.5_f64.sqrt()).abs() < 1e-15);
        assert_eq!((scores[1].peak, scores[2].samples), (1.0, 0));
        assert_eq!((scores[0].settling_s, scores[1].settling_s), (None, Some(0.0)));
    }

    #[test]
    fn settling_counts_from_the_start_of_the_phase_to_the_last_large_error() {
        let phases = [Phase::InertiaPhase; 5];
        let estimate = [5.0, 0.1, 5.0, 0.1, 0.2];
        let time = [1.0, 1.1, 1.2, 1.3, 1.4];
        let settling = score(&time, &phases, &[0.0; 5], 1.0, |i| estimate[i])[1].settling_s.unwrap();
        assert!((settling - 0.3).abs() < 1e-12);
    }

    #[test]
    fn chatter_is_the_variation_that_the_truth_does_not_have() {
        let phases = [Phase::InertiaPhase; 5];
        let (truth, noisy) = ([0.0, 1.0, 2.0, 3.0, 4.0], [0.5, 0.5, 2.5, 2.5, 4.5]);
        let chatter = |estimate: [f64; 5]| score(&[0.0; 5], &phases, &truth, 1.0, |i| estimate[i])[1].chatter;
        assert_eq!(chatter(noisy), 0.0);
        assert_eq!(chatter([0.0, 2.0, 1.0, 4.0, 3.0]), 3.0);
    }

    #[test]
    fn the_jerk_of_a_ramp_is_its_slope() {
        let time: Vec<f64> = (0..200).map(|i| f64::from(i) * 1e-3).collect();
        let ramp: Vec<f64> = time.iter().map(|t| 5.0 * t).collect();
        assert!((peak_jerk(&time, &ramp, (0.0, 1.0)) - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_steady_acceleration_gives_no_vibration_dose() {
        let time: Vec<f64> = (0..1000).map(|i| f64::from(i) * 1e-3).collect();
        assert_eq!(vibration_dose(&time, &vec![2.0; 1000], (0.0, 1.0)), 0.0);
        // One second of a 20 Hz sine of amplitude 1: the mean of its fourth power is 3/8.
        let sine: Vec<f64> = time.iter().map(|t| (std::f64::consts::TAU * 20.0 * t).sin()).collect();
        assert!((vibration_dose(&time, &sine, (0.0, 1.0)) - 0.375_f64.powf(0.25)).abs() < 0.01);
    }
}
