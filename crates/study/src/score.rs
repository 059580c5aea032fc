//! Scores of an estimate and of a shift.
//!
//! An estimate that is not finite has an infinite error: an observer that diverged must not have a better score than one
//! that did not.

use std::collections::VecDeque;

use drivetrain::{PeakJerk, Real, ReducedShift};
use observer::{Bounds, Phase};
use trace::{Trace, signal};

use crate::true_phases;

/// The same number; infinity for one that is none.
fn or_infinite(number: f64) -> f64 {
    if number.is_nan() { f64::INFINITY } else { number }
}

/// The size of an error; infinite for one that is no number.
pub(crate) fn size(error: f64) -> f64 {
    or_infinite(error.abs())
}

/// Errors of one signal in one phase: truth minus estimate. All are infinite where an estimate diverged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseScore {
    /// The phase, by the truth.
    pub phase: Phase,
    /// Number of samples with a truth.
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

/// Phases that are scored.
const SCORED: [Phase; 3] = [Phase::TorquePhase, Phase::InertiaPhase, Phase::AfterShift];

/// Errors of one signal on their way to scores in the torque and inertia phase and after the shift.
#[derive(Debug, Clone)]
pub struct ErrorScore {
    /// An error up to this size counts as small.
    settled: f64,
    phases: [Errors; SCORED.len()],
}

/// Errors in one phase so far.
#[derive(Debug, Clone, Copy, Default)]
struct Errors {
    samples: usize,
    peak: f64,
    sum: f64,
    squares: f64,
    began_s: f64,
    small_since_s: Option<f64>,
    /// Truth and estimate of the sample before, and how much either has moved up and down.
    last: [f64; 2],
    moved: [f64; 2],
}

impl ErrorScore {
    /// No errors yet; one up to `settled` will count as small.
    pub fn new(settled: f64) -> Self {
        Self { settled, phases: [Errors::default(); SCORED.len()] }
    }

    /// Takes a sample; one before the shift, or without a truth (NaN), is not scored.
    pub fn push(&mut self, time_s: f64, phase: Phase, truth: f64, estimate: f64) {
        let Some(at) = SCORED.iter().position(|&scored| scored == phase).filter(|_| !truth.is_nan()) else { return };
        let errors = &mut self.phases[at];
        let error = size(truth - estimate);
        let now = [truth, estimate];
        if errors.samples == 0 {
            errors.began_s = time_s;
        } else {
            for (moved, (now, last)) in errors.moved.iter_mut().zip(now.into_iter().zip(errors.last)) {
                *moved += (now - last).abs();
            }
        }
        errors.last = now;
        errors.samples += 1;
        errors.peak = errors.peak.max(error);
        errors.sum += error;
        errors.squares += error * error;
        errors.small_since_s = if error <= self.settled { errors.small_since_s.or(Some(time_s)) } else { None };
    }

    /// The scores, phase by phase.
    pub fn finish(&self) -> Vec<PhaseScore> {
        let score = |(phase, errors): (Phase, &Errors)| {
            let count = errors.samples.max(1) as f64;
            PhaseScore {
                phase,
                samples: errors.samples,
                peak: errors.peak,
                rms: (errors.squares / count).sqrt(),
                mean: errors.sum / count,
                settling_s: match errors.samples {
                    0 => Some(0.0),
                    _ => errors.small_since_s.map(|since_s| since_s - errors.began_s),
                },
                chatter: or_infinite(errors.moved[1] - errors.moved[0]).max(0.0),
            }
        };
        SCORED.into_iter().zip(&self.phases).map(score).collect()
    }
}

/// Scores of `estimate` against `truth` in the torque and inertia phase and after the shift. An error up to `settled`
/// counts as small; a sample without a truth (NaN) does not count.
pub fn score(
    time_s: &[f64],
    phases: &[Phase],
    truth: &[f64],
    settled: f64,
    estimate: impl Fn(usize) -> f64,
) -> Vec<PhaseScore> {
    let mut errors = ErrorScore::new(settled);
    for (i, &phase) in phases.iter().enumerate() {
        errors.push(time_s[i], phase, truth[i], estimate(i));
    }
    errors.finish()
}

/// How well the guaranteed range around an estimate did in one phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeScore {
    /// The phase, by the truth.
    pub phase: Phase,
    /// Fraction of the samples with the true pressure in the range.
    pub pressure_inside: f64,
    /// Fraction of the samples with the true clutch torque in the range.
    pub torque_inside: f64,
    /// Fraction of the samples with the true shaft torque in the range, of those that have one.
    pub shaft_inside: f64,
    /// Mean width of the range of the pressure, Pa.
    pub width_pa: f64,
    /// Mean width of the range of the clutch torque, N m.
    pub torque_width_n_m: f64,
    /// Mean width of the range of the shaft torque, N m; NaN without one.
    pub shaft_width_n_m: f64,
}

impl RangeScore {
    /// The minimum fraction of samples inside of the two guaranteed ranges, of pressure and clutch torque.
    pub fn inside(&self) -> f64 {
        self.pressure_inside.min(self.torque_inside)
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
    SCORED
        .into_iter()
        .filter_map(|phase| {
            let at = (0..phases.len()).filter(|&i| phases[i] == phase);
            let ranges: Vec<(usize, Bounds<f64>)> = at.filter_map(|i| Some((i, bounds(i)?))).collect();
            let mean = |value: &dyn Fn(usize, &Bounds<f64>) -> f64| {
                ranges.iter().map(|(i, bounds)| value(*i, bounds)).sum::<f64>() / ranges.len() as f64
            };
            let inside = |[low, high]: [f64; 2], truth: f64| f64::from(u8::from(low <= truth && truth <= high));
            let width = |[low, high]: [f64; 2]| or_infinite(high - low);
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
                torque_width_n_m: mean(&|_, bounds| width(bounds.clutch_torque_n_m)),
                shaft_width_n_m: mean_shaft(&|_, range| width(range)),
                width_pa: mean(&|_, bounds| width(bounds.pressure_pa)),
            })
        })
        .collect()
}

/// Shift quality.
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
    /// Tie-up: the minimum drive-shaft torque from the request to lock-up, N m. Negative brakes the car.
    pub least_shaft_torque_n_m: f64,
    /// Jerk of the car, m/s^3, as [`drivetrain::jerk`] defines it.
    pub jerk_peak_m_s3: f64,
    /// Vibration dose value of the longitudinal acceleration, m/s^1.75: the fourth root of the integral of
    /// its fourth power, above 0.4 Hz, the lower limit of the weighting of ISO 2631-1.
    pub vibration_dose_m_s1_75: f64,
    /// Work of friction in the oncoming clutch, J.
    pub friction_work_j: f64,
}

/// Lower limit of the band that the vibration dose counts, Hz.
const VIBRATION_FROM_HZ: f64 = 0.4;
/// How long before the load transfer and after lock-up a shift is felt, s.
const FELT_BEFORE_S: f64 = 0.3;
const FELT_AFTER_S: f64 = 0.5;

/// What a shift is rated by at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftSample {
    /// Time, s.
    pub time_s: f64,
    /// The true phase.
    pub phase: Phase,
    /// Turbine speed, rad/s.
    pub turbine_rad_s: f64,
    /// Gearbox output speed, rad/s.
    pub output_rad_s: f64,
    /// Slip of the oncoming clutch, rad/s.
    pub oncoming_slip_rad_s: f64,
    /// Torque of the oncoming clutch, N m.
    pub oncoming_n_m: f64,
    /// Drive-shaft torque, N m.
    pub shaft_n_m: f64,
    /// Acceleration of the vehicle, m/s^2.
    pub vehicle_m_s2: f64,
}

/// A shift on its way to be rated: remembers no more of the drive than is felt of it at a time.
#[derive(Debug, Clone)]
pub struct ShiftRating {
    ratio_offgoing: f64,
    torque_phase_start_s: Option<f64>,
    inertia_phase_start_s: Option<f64>,
    lock_up_s: Option<f64>,
    flare_rad_s: f64,
    least_shaft_torque_n_m: f64,
    friction_work_j: f64,
    /// Time and friction power of the sample before.
    last: Option<(f64, f64)>,
    /// Times and accelerations from which the shift may be felt, before it has begun.
    before: VecDeque<(f64, f64)>,
    jerk: PeakJerk,
    vibration: VibrationDose,
}

impl ShiftRating {
    /// Nothing seen yet.
    pub fn new(shift: &ReducedShift<f64>) -> Self {
        Self {
            ratio_offgoing: shift.ratio_offgoing(),
            torque_phase_start_s: None,
            inertia_phase_start_s: None,
            lock_up_s: None,
            flare_rad_s: 0.0,
            least_shaft_torque_n_m: f64::INFINITY,
            friction_work_j: 0.0,
            last: None,
            before: VecDeque::new(),
            jerk: PeakJerk::default(),
            vibration: VibrationDose::default(),
        }
    }

    /// From when on the acceleration of a shift may count that is requested at this time, s.
    pub fn felt_from_s(request_s: f64) -> f64 {
        // The load transfer begins after the request; times are sums of periods and differ in their last bits.
        request_s - FELT_BEFORE_S - 1e-6
    }

    /// Whether the oncoming clutch has locked; from then on its torque counts no more.
    pub fn is_locked(&self) -> bool {
        self.lock_up_s.is_some()
    }

    /// Takes the next sample.
    pub fn push(&mut self, sample: &ShiftSample) {
        let (time_s, friction_w) = (sample.time_s, sample.oncoming_n_m * sample.oncoming_slip_rad_s);
        if let Some((last_s, last_w)) = self.last.filter(|_| self.lock_up_s.is_none()) {
            self.friction_work_j += 0.5 * (last_w + friction_w) * (time_s - last_s);
        }
        self.last = Some((time_s, friction_w));
        let start = match sample.phase {
            Phase::BeforeShift => &mut None,
            Phase::TorquePhase => &mut self.torque_phase_start_s,
            Phase::InertiaPhase => &mut self.inertia_phase_start_s,
            Phase::AfterShift => &mut self.lock_up_s,
        };
        start.get_or_insert(time_s);
        if self.torque_phase_start_s.is_some() && self.lock_up_s.is_none() {
            self.flare_rad_s = self.flare_rad_s.max(sample.turbine_rad_s - self.ratio_offgoing * sample.output_rad_s);
            self.least_shaft_torque_n_m = self.least_shaft_torque_n_m.min(sample.shaft_n_m);
        }
        self.feel(time_s, sample.vehicle_m_s2);
    }

    /// Takes an acceleration, if it is felt as part of the shift.
    fn feel(&mut self, time_s: f64, acceleration: f64) {
        if self.torque_phase_start_s.is_some() && self.before.is_empty() {
            return self.felt(time_s, acceleration);
        }
        self.before.push_back((time_s, acceleration));
        let from_s = self.torque_phase_start_s.unwrap_or(time_s) - FELT_BEFORE_S;
        if self.jerk.is_unused() {
            while self.before.front().is_some_and(|&(time_s, _)| time_s < from_s) {
                self.before.pop_front();
            }
        }
        if self.torque_phase_start_s.is_none() {
            return;
        }
        for (time_s, acceleration) in std::mem::take(&mut self.before) {
            self.felt(time_s, acceleration);
        }
    }

    fn felt(&mut self, time_s: f64, acceleration: f64) {
        if self.lock_up_s.is_none_or(|lock_up_s| time_s <= lock_up_s + FELT_AFTER_S) {
            self.jerk.acceleration(time_s, acceleration);
            self.vibration.push(time_s, acceleration);
        }
    }

    /// How the shift was; `None` if it did not pass all its phases.
    pub fn finish(&self) -> Option<ShiftQuality> {
        let lock_up_s = self.lock_up_s?;
        Some(ShiftQuality {
            torque_phase_start_s: self.torque_phase_start_s.filter(|&start_s| start_s < lock_up_s)?,
            inertia_phase_start_s: self.inertia_phase_start_s?,
            lock_up_s,
            flare_rad_s: self.flare_rad_s,
            least_shaft_torque_n_m: self.least_shaft_torque_n_m,
            jerk_peak_m_s3: self.jerk.peak_m_s3().unwrap_or(0.0),
            vibration_dose_m_s1_75: Real::powf(self.vibration.dose, 0.25),
            friction_work_j: self.friction_work_j,
        })
    }
}

impl ShiftQuality {
    /// Rates the shift of a simulated trace; `None` if it did not pass all its phases.
    pub fn of(trace: &Trace, shift: &ReducedShift<f64>) -> Option<Self> {
        let phases = true_phases(trace)?;
        let (turbine, output) = (trace.get(signal::TURBINE_SPEED)?, trace.get(signal::OUTPUT_SPEED)?);
        let (shaft, acceleration) = (trace.get(signal::SHAFT_TORQUE)?, trace.get(signal::VEHICLE_ACCELERATION)?);
        let (clutch, slip) = (trace.get(signal::ONCOMING_TORQUE)?, trace.get(signal::ONCOMING_SLIP)?);
        let mut rating = ShiftRating::new(shift);
        for (i, (&time_s, &phase)) in trace.time_s.iter().zip(&phases).enumerate() {
            rating.push(&ShiftSample {
                time_s,
                phase,
                turbine_rad_s: turbine[i],
                output_rad_s: output[i],
                oncoming_slip_rad_s: slip[i],
                oncoming_n_m: clutch[i],
                shaft_n_m: shaft[i],
                vehicle_m_s2: acceleration[i],
            });
        }
        rating.finish()
    }
}

/// Integral of the fourth power of the acceleration after a first-order high pass.
#[derive(Debug, Clone, Default)]
struct VibrationDose {
    dose: f64,
    /// Time of the sample before, and what the high pass takes away.
    last: Option<(f64, f64)>,
}

impl VibrationDose {
    fn push(&mut self, time_s: f64, acceleration: f64) {
        let (last_s, mut slow) = self.last.unwrap_or((time_s, acceleration));
        let dt = time_s - last_s;
        slow += (1.0 - Real::exp(-std::f64::consts::TAU * VIBRATION_FROM_HZ * dt)) * (acceleration - slow);
        self.dose += Real::powi(acceleration - slow, 4) * dt;
        self.last = Some((time_s, slow));
    }
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
    fn an_estimate_that_diverged_has_infinite_scores() {
        let phases = [Phase::InertiaPhase; 3];
        for diverged in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let estimate = [0.0, diverged, 0.0];
            let score = score(&[0.0, 0.1, 0.2], &phases, &[0.0; 3], 1.0, |i| estimate[i])[1];
            let scores = [score.peak, score.rms, score.mean, score.chatter];
            assert!(scores.iter().all(|score| *score == f64::INFINITY), "{score:?}");
        }
        // A truth that was not measured is nobody's fault.
        let measured = score(&[0.0, 0.1, 0.2], &phases, &[1.0, f64::NAN, 1.0], 1.0, |_| 0.0)[1];
        assert_eq!((measured.samples, measured.rms, measured.chatter), (2, 1.0, 0.0));
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
    fn a_steady_acceleration_gives_no_vibration_dose() {
        let dose = |acceleration: &dyn Fn(f64) -> f64| {
            let mut dose = VibrationDose::default();
            (0..1000).map(|i| f64::from(i) * 1e-3).for_each(|t| dose.push(t, acceleration(t)));
            dose.dose.powf(0.25)
        };
        assert_eq!(dose(&|_| 2.0), 0.0);
        // One second of a 20 Hz sine of amplitude 1: the mean of its fourth power is 3/8.
        assert!((dose(&|t| (std::f64::consts::TAU * 20.0 * t).sin()) - 0.375_f64.powf(0.25)).abs() < 0.01);
    }

    const SHIFT: ReducedShift<f64> =
        ReducedShift { mass_kg_m2: [[1.0, 0.0], [0.0, 1.0]], slip_offgoing: [1.0, -2.0], slip_oncoming: [1.0, -1.0] };

    fn sample(time_s: f64, phase: Phase) -> ShiftSample {
        ShiftSample {
            time_s,
            phase,
            turbine_rad_s: 200.0,
            output_rad_s: 99.0,
            oncoming_slip_rad_s: 101.0,
            oncoming_n_m: 10.0,
            shaft_n_m: 50.0,
            vehicle_m_s2: 1.0,
        }
    }

    #[test]
    fn a_shift_is_rated_only_if_it_passed_its_phases_in_order() {
        use Phase::{AfterShift, BeforeShift, InertiaPhase, TorquePhase};
        let rated = |phases: &[Phase]| {
            let mut rating = ShiftRating::new(&SHIFT);
            (0..).map(f64::from).zip(phases).for_each(|(time_s, &phase)| rating.push(&sample(time_s, phase)));
            rating.finish()
        };
        let quality = rated(&[BeforeShift, TorquePhase, InertiaPhase, AfterShift, AfterShift]).unwrap();
        assert_eq!((quality.torque_phase_start_s, quality.inertia_phase_start_s, quality.lock_up_s), (1.0, 2.0, 3.0));
        assert_eq!((quality.flare_rad_s, quality.least_shaft_torque_n_m), (2.0, 50.0));
        // Up to lock-up, three seconds of 1010 W.
        assert_eq!(quality.friction_work_j, 3030.0);
        assert_eq!(rated(&[BeforeShift, TorquePhase, InertiaPhase]), None);
        assert_eq!(rated(&[BeforeShift, InertiaPhase, AfterShift, TorquePhase]), None);
    }

    #[test]
    fn of_a_long_drive_a_rating_remembers_what_is_felt_at_a_time() {
        let mut rating = ShiftRating::new(&SHIFT);
        for i in 0..10_000 {
            let phase = if i < 5000 { Phase::BeforeShift } else { Phase::TorquePhase };
            rating.push(&sample(f64::from(i) * 1e-3, phase));
            // 0.3 s before the shift at a millisecond; and one more, as times are rounded.
            assert!(rating.before.len() <= 302);
        }
    }
}
