//! Load and quality of a shift.

use drivetrain::Real;
use drivetrain::jerk::{PeakJerk, WINDOW_S};
use drivetrain::jerk_of_readings::{Holes, peak_jerk_m_s3};

use super::ratio::RatioWatch;
use super::track::Track;
use super::{Direction, Load, Shift, ShiftQuality};
use crate::Role;

/// The load is that of so long before the shift, s.
const LOAD_S: f64 = 0.3;
/// Slip of the converter that tells who drives: fraction of the turbine speed, and minimum size, rad/s.
const SLIP: f64 = 0.02;
const SLIP_RAD_S: f64 = 3.0;
/// Engine torque that tells who drives, N m.
const TORQUE_N_M: f64 = 5.0;
/// Throttle of a driver who accelerates.
const THROTTLE: f64 = 0.03;

/// Power-on or power-off: from the slip of the converter, else the engine torque, else the throttle.
pub(super) fn load(shift: &Shift, tracks: &[Track]) -> Load {
    let to_s = shift.start_s();
    let mean = |role: Role| tracks[role as usize].mean(to_s - LOAD_S, to_s);
    let sign = |value: f64| if value > 0.0 { Load::PowerOn } else { Load::PowerOff };
    if let (Some(engine), Some(turbine)) = (mean(Role::EngineSpeed), mean(Role::TurbineSpeed)) {
        let slip = engine - turbine;
        if slip.abs() > SLIP_RAD_S.max(SLIP * turbine) {
            return sign(slip);
        }
    }
    match (mean(Role::EngineTorque).filter(|torque| torque.abs() > TORQUE_N_M), mean(Role::Throttle)) {
        (Some(torque), _) => sign(torque),
        (None, Some(throttle)) => sign(throttle - THROTTLE),
        _ => Load::Unknown,
    }
}

pub(super) fn quality(
    shift: &Shift,
    ratios: &[f64],
    tracks: &[Track],
    points: &RatioWatch,
    output_rad_per_m: Option<f64>,
) -> ShiftQuality {
    let [inertia_half_s, flare_half_rad_s] = halves(shift, points);
    let flare_rad_s = flare(shift, ratios, points);
    let jerk_m_s3 = jerk(shift, tracks, output_rad_per_m, |_| true);
    ShiftQuality {
        flare_rad_s,
        flare_half_rad_s: flare_half_rad_s.filter(|_| flare_rad_s.is_some()),
        inertia_half_s,
        jerk_m_s3,
        jerk_half_m_s3: jerk_m_s3.and_then(|_| jerk_half(shift, tracks, output_rad_per_m)),
    }
}

/// Half of an interval of the jerk, m/s^3, by the jackknife: the jerk without each part of the readings. The largest of noisy values lies above the one
/// without noise by about as much as it scatters, so it is twice that of 95 % by the scatter.
fn jerk_half(shift: &Shift, tracks: &[Track], output_rad_per_m: Option<f64>) -> Option<f64> {
    const PARTS: usize = 6;
    /// Of Student's distribution with five degrees of freedom.
    const SIDES: f64 = 2.571;
    let without = |part: usize| jerk(shift, tracks, output_rad_per_m, move |at| at % PARTS != part);
    let jerks: Vec<f64> = (0..PARTS).map(without).collect::<Option<_>>()?;
    let mean = jerks.iter().sum::<f64>() / PARTS as f64;
    let squares: f64 = jerks.iter().map(|jerk| Real::powi(jerk - mean, 2)).sum();
    Some(2.0 * SIDES * (squares * (PARTS as f64 - 1.0) / PARTS as f64).sqrt())
}

/// Half of the intervals of 95 % of the times of the inertia phase, s, and of the flare, rad/s: by the scatter of the ratio before and after the
/// inertia phase, and by the time between its points. None where too few points show the scatter.
fn halves(shift: &Shift, points: &RatioWatch) -> [Option<f64>; 2] {
    /// Points are looked at for so long before and after, s, but for so long next to the inertia phase.
    const LOOK_S: f64 = 0.5;
    const NEXT_S: f64 = 0.05;
    /// Fewest points of one side.
    const POINTS: usize = 5;
    /// Part of the way of the ratio within the inertia phase.
    const WAY: f64 = 0.9;
    const SIDES: f64 = 1.96;
    let Some([begin_s, end_s]) = shift.inertia_s else { return [None; 2] };
    let spans = [[begin_s - LOOK_S, begin_s - NEXT_S], [end_s + NEXT_S, end_s + LOOK_S]];
    let (mut variance, mut logs, mut output, mut step_s) = (f64::INFINITY, [0.0; 2], 0.0_f64, 0.0_f64);
    for ([from_s, to_s], log) in spans.into_iter().zip(&mut logs) {
        let found: Vec<(f64, f64)> =
            points.between(from_s, to_s).map(|point| (point.time_s, Real::ln(point.ratio))).collect();
        if found.len() < POINTS {
            return [None; 2];
        }
        let number = found.len() as f64;
        let mean = found.iter().map(|(_, log)| log).sum::<f64>() / number;
        // A flare on one side is no scatter.
        let squares = found.iter().map(|(_, log)| Real::powi(log - mean, 2)).sum::<f64>();
        variance = variance.min(squares / (number - 1.0));
        *log = mean;
        output = points.between(from_s, to_s).map(|point| point.output_rad_s).fold(output, f64::max);
        step_s = step_s.max((found[found.len() - 1].0 - found[0].0) / (number - 1.0));
    }
    let scatter = variance.sqrt();
    let rate = WAY * (logs[1] - logs[0]).abs() / (end_s - begin_s);
    let time_s = SIDES * Real::hypot(scatter / rate, step_s / 12.0_f64.sqrt());
    let flare = SIDES * scatter * Real::exp(logs[0].max(logs[1])) * output;
    [time_s, flare].map(|half| Some(half).filter(|half| half.is_finite()))
}

fn flare(shift: &Shift, ratios: &[f64], points: &RatioWatch) -> Option<f64> {
    let [begin_s, end_s] = shift.inertia_s?;
    let (gear, from_s, to_s) = match shift.direction {
        Direction::Up => (shift.from, shift.start_s().min(begin_s - 0.3), 0.5 * (begin_s + end_s)),
        Direction::Down => (shift.to, 0.5 * (begin_s + end_s), end_s + 0.5),
    };
    let ratio = ratios.get(usize::try_from(gear).ok()?.checked_sub(1)?)?;
    let above = points.between(from_s, to_s).map(|point| (point.ratio - ratio) * point.output_rad_s);
    above.reduce(f64::max).map(|maximum| maximum.max(0.0))
}

/// The jerk of a shift, by the definition of [`drivetrain::jerk`], from the readings whose number in their order is taken.
fn jerk(shift: &Shift, tracks: &[Track], output_rad_per_m: Option<f64>, takes: impl Fn(usize) -> bool) -> Option<f64> {
    /// Time around the shift, s.
    const AROUND_S: f64 = 0.3;
    let track = |role: Role| Some(&tracks[role as usize]).filter(|track| !track.is_empty());
    let acceleration = track(Role::VehicleAcceleration).or_else(|| track(Role::LongitudinalAcceleration));
    let (track, factor) = match (acceleration, track(Role::VehicleSpeed), track(Role::OutputSpeed)) {
        (Some(acceleration), ..) => (acceleration, 1.0),
        (_, Some(speed), _) => (speed, 1.0),
        (.., Some(output)) => (output, 1.0 / output_rad_per_m?),
        _ => return None,
    };
    let around_s = AROUND_S + 0.5 * WINDOW_S;
    let points = || {
        let all = track.between(shift.start_s() - around_s, shift.end_s() + around_s).enumerate();
        all.filter(|(at, _)| takes(*at)).map(|(_, point)| point)
    };
    if acceleration.is_none() {
        return peak_jerk_m_s3(points().map(|(time_s, value)| (time_s, factor * value)));
    }
    let (mut jerk, mut holes) = (PeakJerk::default(), Holes::default());
    for (time_s, value) in points() {
        if holes.is_behind_one(time_s) {
            return None;
        }
        jerk.acceleration(time_s, value);
    }
    jerk.peak_m_s3()
}
