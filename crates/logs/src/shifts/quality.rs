//! Load and quality of a shift.

use super::ratio::RatioWatch;
use super::track::Track;
use super::{Direction, Load, Shift, ShiftQuality};
use crate::Role;

/// The load is that of so long before the shift, s.
const LOAD_S: f64 = 0.3;
/// Slip of the converter that tells who drives: share of the turbine speed, and least size, rad/s.
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
    ShiftQuality { flare_rad_s: flare(shift, ratios, points), jerk_m_s3: jerk(shift, tracks, output_rad_per_m) }
}

fn flare(shift: &Shift, ratios: &[f64], points: &RatioWatch) -> Option<f64> {
    let [begin_s, end_s] = shift.inertia_s?;
    let (gear, from_s, to_s) = match shift.direction {
        Direction::Up => (shift.from, shift.start_s().min(begin_s - 0.3), 0.5 * (begin_s + end_s)),
        Direction::Down => (shift.to, 0.5 * (begin_s + end_s), end_s + 0.5),
    };
    let ratio = ratios.get(usize::try_from(gear).ok()?.checked_sub(1)?)?;
    let above = points.between(from_s, to_s).map(|point| (point.ratio - ratio) * point.output_rad_s);
    above.reduce(f64::max).map(|most| most.max(0.0))
}

/// The greatest size of the jerk around a shift.
fn jerk(shift: &Shift, tracks: &[Track], output_rad_per_m: Option<f64>) -> Option<f64> {
    /// Half the time over which a parabola is laid, s.
    const HALF_S: f64 = 0.15;
    /// Time around the shift, s.
    const AROUND_S: f64 = 0.3;
    let track = |role: Role| Some(&tracks[role as usize]).filter(|track| !track.is_empty());
    // What the derivatives are taken of, in m/s or m/s^2: its factor and which coefficient of the parabola is the jerk.
    let (track, factor, of_speed) =
        match (track(Role::VehicleAcceleration), track(Role::VehicleSpeed), track(Role::OutputSpeed)) {
            (Some(acceleration), ..) => (acceleration, 1.0, false),
            (_, Some(speed), _) => (speed, 1.0, true),
            (.., Some(output)) => (output, 1.0 / output_rad_per_m?, true),
            _ => return None,
        };
    let (from_s, to_s) = (shift.start_s() - AROUND_S, shift.end_s() + AROUND_S);
    let around: Vec<(f64, f64)> = track.between(from_s - HALF_S, to_s + HALF_S).collect();
    let (mut begin, mut end) = (0, 0);
    let mut most: Option<f64> = None;
    for &(centre_s, _) in around.iter().filter(|(time_s, _)| (from_s..=to_s).contains(time_s)) {
        // From one centre to the next, a few points leave and a few come.
        begin += around[begin..].iter().take_while(|(time_s, _)| *time_s < centre_s - HALF_S).count();
        end += around[end..].iter().take_while(|(time_s, _)| *time_s <= centre_s + HALF_S).count();
        let points = around.get(begin..end).unwrap_or_default();
        let ends = points.first().zip(points.last());
        let spread = ends.map_or(0.0, |(first, last)| (last.0 - centre_s) - (first.0 - centre_s));
        if points.len() < 7 || spread < 1.5 * HALF_S {
            continue;
        }
        let Some([_, linear, quadratic]) = parabola(points, centre_s) else { continue };
        let jerk = factor * if of_speed { 2.0 * quadratic } else { linear };
        most = Some(most.map_or(jerk.abs(), |most| most.max(jerk.abs())));
    }
    most
}

/// Coefficients of the parabola with the least squares of distances, over the time from a centre.
fn parabola(points: &[(f64, f64)], centre_s: f64) -> Option<[f64; 3]> {
    // Normal equations; times are within a fraction of a second, so they are scaled to 1.
    let scale = points.iter().map(|(time_s, _)| (time_s - centre_s).abs()).fold(0.0, f64::max);
    // Sums of the powers of the time, and of these times the value.
    let (mut powers, mut values) = ([0.0; 5], [0.0; 3]);
    for (time_s, value) in points {
        let time = (time_s - centre_s) / scale;
        let square = time * time;
        for (sum, power) in powers.iter_mut().zip([1.0, time, square, time * square, square * square]) {
            *sum += power;
        }
        for (sum, power) in values.iter_mut().zip([1.0, time, square]) {
            *sum += power * value;
        }
    }
    let mut sums: [[f64; 4]; 3] = std::array::from_fn(|i| [powers[i], powers[i + 1], powers[i + 2], values[i]]);
    // The matrix is symmetric and positive definite: no pivots are needed.
    for i in 0..3 {
        let pivot = sums[i];
        if pivot[i].abs() <= 1e-9 || pivot[i].is_nan() {
            return None;
        }
        for row in sums.iter_mut().skip(i + 1) {
            let factor = row[i] / pivot[i];
            for (cell, above) in row.iter_mut().zip(pivot) {
                *cell -= factor * above;
            }
        }
    }
    let quadratic = sums[2][3] / sums[2][2];
    let linear = (sums[1][3] - sums[1][2] * quadratic) / sums[1][1];
    let constant = (sums[0][3] - sums[0][1] * linear - sums[0][2] * quadratic) / sums[0][0];
    Some([constant, linear / scale, quadratic / (scale * scale)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_through_its_own_points_is_found() {
        let points: Vec<(f64, f64)> =
            (0_i32..11).map(|i| f64::from(i - 4) * 0.02).map(|t| (t, 3.0 - 2.0 * t + 7.0 * t * t)).collect();
        let found = parabola(&points, 0.0).unwrap();
        for (found, expected) in found.into_iter().zip([3.0, -2.0, 7.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        assert!(parabola(&[(0.0, 1.0); 9], 0.0).is_none());
    }

    #[test]
    fn the_jerk_is_the_greatest_of_the_parabolas_laid_one_by_one_whatever_is_missing() {
        let mut bits = 0x9e37_79b9_7f4a_7c15_u64;
        let mut random = move || {
            bits ^= bits << 13;
            bits ^= bits >> 7;
            bits ^= bits << 17;
            (bits >> 40) as f64 / f64::from(1 << 24)
        };
        for holes in [0.0, 0.05, 0.5, 0.9] {
            let mut tracks: [Track; Role::LockUpApplied as usize + 1] = std::array::from_fn(|_| Track::new(12.0));
            let mut readings = Vec::new();
            for step in 0..400 {
                if random() < holes || (holes > 0.0 && (150..200).contains(&step)) {
                    continue;
                }
                let (time_s, value) = (0.01 * f64::from(step) + 0.004 * random(), 20.0 + random());
                tracks[Role::VehicleSpeed as usize].push(time_s, value);
                readings.push((time_s, value));
            }
            let (begin_s, end_s) = (1.0, 2.5);
            let shift = Shift {
                from: 1,
                to: 2,
                direction: Direction::Up,
                load: Load::Unknown,
                command_s: None,
                inertia_s: Some([begin_s, end_s]),
                gear_s: None,
                quality: ShiftQuality::default(),
            };
            let of = |centre_s: f64| {
                let within = readings.iter().filter(|(time_s, _)| (centre_s - 0.15..=centre_s + 0.15).contains(time_s));
                let points: Vec<(f64, f64)> = within.copied().collect();
                let spread = points.last()?.0 - points.first()?.0;
                let is_laid = points.len() >= 7 && spread >= 0.225;
                is_laid.then(|| parabola(&points, centre_s)).flatten().map(|[.., quadratic]| (2.0 * quadratic).abs())
            };
            let centres = readings.iter().map(|(time_s, _)| *time_s);
            let around = centres.filter(|time_s| (begin_s - 0.3..=end_s + 0.3).contains(time_s));
            let expected = around.filter_map(of).reduce(f64::max);
            assert_eq!(jerk(&shift, &tracks, None), expected, "{holes}");
            assert_eq!(expected.is_some(), holes < 0.9);
        }
    }
}
