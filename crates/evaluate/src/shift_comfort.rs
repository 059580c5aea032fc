//! What the occupants feel of a shift: steps, holes and sign changes of the vehicle acceleration, its vibration dose, and a rating.
//!
//! All quantities come from the longitudinal acceleration of the vehicle, averaged over 50 ms around each time: a centred mean has no
//! delay, and takes an oscillation of 8.9 Hz to 0.7 of its amplitude. The acceleration *before* is the mean over the 0.2 s before the
//! request, the acceleration *after* that from 0.3 s to 0.5 s after the end of the shift. A change from one to the other is the purpose
//! of the shift: only what lies beyond both is an excursion.

use plant::car::CarShiftQuality;

use crate::weighting::Weighting;

/// The acceleration is averaged over this time, s.
pub const MEAN_S: f64 = 0.05;
/// The acceleration before the shift is the mean over this time before the request, s.
pub(crate) const BEFORE_S: f64 = 0.2;
/// The acceleration after the shift is the mean over this span after its end, s.
pub(crate) const AFTER_S: [f64; 2] = [0.3, 0.5];
/// A torque hole is this fraction of the acceleration before, and deeper.
const HOLE: f64 = 0.1;
/// The after-shock is sought so long after the synchronous speed, s.
const AFTER_SHOCK_S: f64 = 0.5;
/// A hole is compared with at least this acceleration, m/s^2: occupants do not feel that of a car that hardly accelerates.
const LEAST_M_S2: f64 = 0.5;
/// An acceleration below this has no sign, m/s^2.
const SIGN_M_S2: f64 = 0.1;
/// Slip from which on an element counts as slipping, rad/s at the turbine.
const SLIPS_RAD_S: f64 = 3.0;

/// What the rating compares with \[chosen\]: what a calibrator of a series transmission would accept. Vibration dose, m/s^1.75; jerk,
/// m/s^3; step, m/s^2; depth of the hole, a fraction; duration, s; flare, rad/s.
const ACCEPTED: [f64; 6] = [0.5, 5.0, 0.5, 0.35, 1.4, 3.0];
/// The best rating, the lowest one, and what is taken off where every quantity is just accepted.
const BEST: f64 = 10.0;
const LOWEST: f64 = 1.0;
const ACCEPTED_LOSS: f64 = 3.0;

/// What the acceleration is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AccelerationSource {
    /// The acceleration of the vehicle, as a simulation has it.
    Vehicle,
    /// The slope of the speed of the driven wheels: the tyres swing in it.
    WheelSpeed,
    /// The slope of the output speed of the gearbox: the drive shafts swing in it.
    OutputSpeed,
}

impl AccelerationSource {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vehicle => "vehicle",
            Self::WheelSpeed => "wheel_speed",
            Self::OutputSpeed => "output_speed",
        }
    }
}

/// A vehicle in a shift at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeltSample {
    /// Time, s.
    pub time_s: f64,
    /// Longitudinal acceleration, m/s^2.
    pub acceleration_m_s2: f64,
    /// Slip of the old and of the new gear, rad/s at the turbine: turbine speed less ratio times output speed.
    pub slips_rad_s: [f64; 2],
}

/// What the occupants feel of a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftComfort {
    /// Mean acceleration before and after, m/s^2.
    pub before_after_m_s2: [f64; 2],
    /// How far the acceleration falls below both, and rises above both, m/s^2.
    pub beyond_m_s2: [f64; 2],
    /// Largest depth of the torque hole over the acceleration before, or over 0.5 m/s^2 if that is more; zero without traction.
    pub hole: f64,
    /// How long the hole is deeper than a tenth of that, s.
    pub hole_s: f64,
    /// Smallest acceleration over that before; one without traction.
    pub traction: f64,
    /// Largest distance from the acceleration after, from 50 ms to 0.5 s after the synchronous speed, m/s^2.
    pub after_shock_m_s2: f64,
    /// How often the acceleration changes its sign.
    pub sign_changes: usize,
    /// Time from the first slip of the old gear to the synchronous speed of the new one, s; not a number if that is not reached.
    pub inertia_phase_s: f64,
    /// Time from the request to the first slip of the old gear, s; not a number if the synchronous speed is not reached.
    pub response_s: f64,
    /// Vibration dose value from the request to 0.5 s after the end, m/s^1.75: the fourth root of the integral of the fourth power of the
    /// acceleration, weighted by `W_d` of ISO 2631-1.
    pub vibration_dose_m_s1_75: f64,
    /// What the acceleration is taken from.
    pub source: AccelerationSource,
}

impl ShiftComfort {
    /// Of a shift from its request to its end, s. The samples begin 0.2 s before the request and end 0.5 s after the end, or the
    /// averages are those of the samples there are; `None` without samples before or after.
    pub fn of(samples: &[FeltSample], [request_s, end_s]: [f64; 2]) -> Option<Self> {
        let before = mean(samples, [request_s - BEFORE_S, request_s])?;
        let last_s = samples.last()?.time_s;
        let span = AFTER_S.map(|after_s| (end_s + after_s).min(last_s));
        let after = mean(samples, [span[0].min(last_s - BEFORE_S), span[1]])?;
        let felt = smooth(samples, [request_s, end_s + AFTER_S[1]]);
        let extreme = |pick: fn(f64, f64) -> f64| felt.iter().map(|(_, a)| *a).reduce(pick);
        let (lowest, highest) = (extreme(f64::min)?, extreme(f64::max)?);
        let beyond_m_s2 = [(before.min(after) - lowest).max(0.0), (highest - before.max(after)).max(0.0)];
        let has_traction = before > SIGN_M_S2;
        let depth = |a: f64| if has_traction { (before.min(after) - a) / before.max(LEAST_M_S2) } else { 0.0 };
        let phase_s = inertia_phase(samples, request_s);
        let after_shock = felt.iter().filter(|(time_s, _)| {
            phase_s.is_some_and(|[_, end_s]| *time_s > end_s + MEAN_S && *time_s <= end_s + AFTER_SHOCK_S)
        });
        Some(Self {
            before_after_m_s2: [before, after],
            beyond_m_s2,
            hole: depth(lowest).max(0.0),
            hole_s: lasting(&felt, |a| depth(a) > HOLE),
            traction: if has_traction { lowest / before } else { 1.0 },
            after_shock_m_s2: after_shock.map(|(_, a)| (a - after).abs()).fold(0.0, f64::max),
            sign_changes: sign_changes(&felt),
            inertia_phase_s: phase_s.map_or(f64::NAN, |[from_s, to_s]| to_s - from_s),
            response_s: phase_s.map_or(f64::NAN, |[from_s, _]| from_s - request_s),
            vibration_dose_m_s1_75: vibration_dose(samples, [request_s, end_s + AFTER_S[1]], before),
            source: AccelerationSource::Vehicle,
        })
    }

    /// How far the acceleration lies beyond those before and after, at most, m/s^2.
    pub fn step_m_s2(&self) -> f64 {
        let [below, above] = self.beyond_m_s2;
        below.max(above)
    }

    /// A rating from 10 to 1 of a shift that was completed: `10 - 3 r`, where `r` is the mean of fourth powers, and its fourth root, of
    /// vibration dose, jerk, step, depth of the hole, duration and flare over what is accepted of each. So the worst of them counts most, 7 is
    /// a shift that is just accepted in all of them, and what is not known is left out.
    pub fn rating(&self, quality: &CarShiftQuality) -> Option<f64> {
        let CarShiftQuality { jerk_m_s3, flare_rad_s, complete_s, .. } = *quality;
        let values = [self.vibration_dose_m_s1_75, jerk_m_s3, self.step_m_s2(), self.hole, complete_s?, flare_rad_s];
        let over =
            values.iter().zip(ACCEPTED).map(|(value, accepted)| value / accepted).filter(|over| over.is_finite());
        let (sum, count) = over.fold((0.0, 0.0), |(sum, count), over| (sum + over * over * over * over, count + 1.0));
        let mean: f64 = sum / count;
        (count > 0.0).then(|| (BEST - ACCEPTED_LOSS * mean.sqrt().sqrt()).max(LOWEST))
    }
}

/// The vibration dose value of a span of time, m/s^1.75, of a car that has accelerated evenly until then, m/s^2.
fn vibration_dose(samples: &[FeltSample], [from_s, to_s]: [f64; 2], before_m_s2: f64) -> f64 {
    let mut weighting = Weighting::at_rest(before_m_s2);
    let fourth = |weighted: f64| weighted * weighted * weighted * weighted;
    let (mut dose, mut last, mut last_s) = (0.0, 0.0, from_s);
    for sample in within(samples, [from_s, to_s]) {
        let step_s = sample.time_s - last_s;
        let weighted = fourth(weighting.step(step_s, sample.acceleration_m_s2));
        dose += 0.5 * step_s * (last + weighted);
        (last, last_s) = (weighted, sample.time_s);
    }
    let dose: f64 = dose;
    dose.sqrt().sqrt()
}

/// Mean acceleration in a span of time, m/s^2.
fn mean(samples: &[FeltSample], span_s: [f64; 2]) -> Option<f64> {
    let inside = within(samples, span_s);
    let sum: f64 = inside.iter().map(|sample| sample.acceleration_m_s2).sum();
    (!inside.is_empty()).then(|| sum / inside.len() as f64)
}

/// The samples of a span of time.
fn within(samples: &[FeltSample], [from_s, to_s]: [f64; 2]) -> &[FeltSample] {
    let from = samples.partition_point(|sample| sample.time_s < from_s);
    let to = samples.partition_point(|sample| sample.time_s <= to_s);
    samples.get(from..to).unwrap_or_default()
}

/// Times, s, and accelerations averaged over [`MEAN_S`] around them, m/s^2.
fn smooth(samples: &[FeltSample], span_s: [f64; 2]) -> Vec<(f64, f64)> {
    let around = |time_s: f64| mean(samples, [time_s - 0.5 * MEAN_S, time_s + 0.5 * MEAN_S]);
    within(samples, span_s).iter().filter_map(|sample| Some((sample.time_s, around(sample.time_s)?))).collect()
}

/// How long a condition holds in all, s.
fn lasting(felt: &[(f64, f64)], holds: impl Fn(f64) -> bool) -> f64 {
    felt.windows(2).filter(|pair| holds(pair[0].1)).fold(0.0, |length_s, pair| length_s + (pair[1].0 - pair[0].0))
}

fn sign_changes(felt: &[(f64, f64)]) -> usize {
    let signs: Vec<bool> = felt.iter().filter(|(_, a)| a.abs() > SIGN_M_S2).map(|(_, a)| *a > 0.0).collect();
    signs.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

/// Begin and end of the inertia phase, s: the slip of the new gear falls to [`SLIPS_RAD_S`], after the last time at which the old gear
/// had none.
fn inertia_phase(samples: &[FeltSample], request_s: f64) -> Option<[f64; 2]> {
    let shift = within(samples, [request_s, f64::INFINITY]);
    let slips = |slip: f64| slip.abs() > SLIPS_RAD_S;
    let side = shift.first()?.slips_rad_s[1].signum();
    let end = shift.iter().position(|sample| sample.slips_rad_s[1] * side <= SLIPS_RAD_S)?;
    let begin = shift[..end].iter().rposition(|sample| !slips(sample.slips_rad_s[0]))?;
    Some([shift[begin].time_s, shift[end].time_s])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shift of one second from 1 s on: an acceleration over time, and slips that change between 1.4 s and 1.9 s.
    fn shift(acceleration: impl Fn(f64) -> f64) -> ShiftComfort {
        let sample = |i: i32| {
            let time_s = 0.005 * f64::from(i);
            let way = ((time_s - 1.4) / 0.5).clamp(0.0, 1.0);
            let slips_rad_s = [-100.0 * way, 100.0 * (1.0 - way)];
            FeltSample { time_s, acceleration_m_s2: acceleration(time_s), slips_rad_s }
        };
        let samples: Vec<FeltSample> = (0..600).map(sample).collect();
        ShiftComfort::of(&samples, [1.0, 2.0]).unwrap()
    }

    #[test]
    fn a_change_from_one_acceleration_to_the_other_is_no_excursion() {
        let comfort = shift(|t| 2.0 - ((t - 1.2) / 0.5).clamp(0.0, 1.0));
        let [before, after] = comfort.before_after_m_s2;
        assert!((before - 2.0).abs() < 1e-9 && (after - 1.0).abs() < 1e-9, "{comfort:?}");
        assert!(comfort.beyond_m_s2.iter().all(|beyond| *beyond < 1e-9) && comfort.hole < 1e-9, "{comfort:?}");
        assert_eq!((comfort.hole_s, comfort.sign_changes), (0.0, 0));
        assert!((comfort.traction - 0.5).abs() < 1e-9 && comfort.after_shock_m_s2 < 1e-9, "{comfort:?}");
        // From 3 rad/s of the old gear to 3 rad/s of the new one.
        assert!((comfort.inertia_phase_s - 0.47).abs() < 0.011, "{comfort:?}");
    }

    #[test]
    fn a_hole_has_depth_and_length_and_an_after_shock_its_size() {
        // A hole of 0.8 m/s^2 for 0.2 s, and a step of 1.5 m/s^2 for 0.1 s behind the synchronous speed.
        let hole = |t: f64| if (1.2..1.4).contains(&t) { 0.8 } else { 0.0 };
        let shock = |t: f64| if (2.0..2.1).contains(&t) { 1.5 } else { 0.0 };
        let comfort = shift(|t| 2.0 - hole(t) + shock(t));
        assert!((comfort.hole - 0.4).abs() < 1e-9 && (comfort.hole_s - 0.2).abs() < 0.03, "{comfort:?}");
        let [below, above] = comfort.beyond_m_s2;
        assert!((below - 0.8).abs() < 1e-9 && (above - 1.5).abs() < 1e-9, "{comfort:?}");
        assert!((comfort.after_shock_m_s2 - 1.5).abs() < 1e-9 && (comfort.traction - 0.6).abs() < 1e-9, "{comfort:?}");
    }

    #[test]
    fn the_sign_counts_where_there_is_one() {
        let comfort = shift(|t| match t {
            t if t < 1.3 => -0.8,
            t if t < 1.5 => 0.4,
            t if t < 1.6 => 0.05,
            _ => -1.0,
        });
        assert_eq!((comfort.sign_changes, comfort.hole, comfort.traction), (2, 0.0, 1.0));
    }

    /// The first half of a swing that the weighting passes, against the integral of the fourth power of a sine.
    #[test]
    fn the_vibration_dose_of_a_swing_is_that_of_its_weighted_fourth_power() {
        use std::f64::consts::TAU;
        let comfort = shift(|t| if (1.0..2.5).contains(&t) { (TAU * 4.0 * (t - 1.0)).sin() } else { 0.0 });
        // Amplitude 0.512 at 4 Hz, for 1.5 s.
        let expected = 0.512 * (1.5 * 3.0 / 8.0_f64).sqrt().sqrt();
        let dose = comfort.vibration_dose_m_s1_75;
        assert!((dose / expected - 1.0).abs() < 0.05, "{dose} {expected}");
        // A change from one acceleration to the other is felt, the more the faster it is.
        let change = |length_s: f64| shift(|t| 2.0 - ((t - 1.2) / length_s).clamp(0.0, 1.0)).vibration_dose_m_s1_75;
        assert!(shift(|_| 2.0).vibration_dose_m_s1_75 < 1e-9);
        assert!(change(0.05) > 1.2 * change(0.5) && change(0.5) > 0.1, "{} {}", change(0.05), change(0.5));
    }

    #[test]
    fn the_rating_is_7_where_all_is_just_accepted_and_the_worst_quantity_counts_most() {
        let of = |factors: [f64; 6]| {
            let [dose, jerk, step, hole, complete, flare] = [0, 1, 2, 3, 4, 5].map(|at| factors[at] * ACCEPTED[at]);
            let comfort = ShiftComfort {
                vibration_dose_m_s1_75: dose,
                beyond_m_s2: [0.0, step],
                hole,
                ..shift(|t| 2.0 - ((t - 1.2) / 0.5).clamp(0.0, 1.0))
            };
            let quality = CarShiftQuality {
                jerk_m_s3: jerk,
                complete_s: Some(complete),
                flare_rad_s: flare,
                ..CarShiftQuality::default()
            };
            comfort.rating(&quality).unwrap()
        };
        assert!((of([1.0; 6]) - 7.0).abs() < 1e-12 && (of([0.5; 6]) - 8.5).abs() < 1e-12 && of([0.0; 6]) == 10.0);
        assert_eq!(of([9.0; 6]), 1.0);
        // One at twice what is accepted costs more than all of them at what is accepted.
        assert!(of([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]) < 6.5, "{}", of([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
        // What is not known is left out.
        assert!((of([1.0, f64::NAN, 1.0, 1.0, 1.0, f64::NAN]) - 7.0).abs() < 1e-12);
        let comfort = shift(|_| 2.0);
        assert_eq!(comfort.rating(&CarShiftQuality::default()), None, "not completed");
    }

    #[test]
    fn without_samples_on_both_sides_there_is_nothing_to_feel() {
        assert_eq!(ShiftComfort::of(&[], [0.0, 1.0]), None);
        let one = [FeltSample { time_s: 2.0, acceleration_m_s2: 1.0, slips_rad_s: [0.0; 2] }];
        assert_eq!(ShiftComfort::of(&one, [1.0, 1.5]), None);
        // The synchronous speed is never reached, and nothing is a number.
        let lost = |i: i32| FeltSample {
            time_s: 0.1 * f64::from(i),
            acceleration_m_s2: f64::NAN,
            slips_rad_s: [0.0, f64::NAN],
        };
        let comfort = ShiftComfort::of(&(0..30).map(lost).collect::<Vec<_>>(), [1.0, 2.0]).unwrap();
        assert!(comfort.inertia_phase_s.is_nan() && comfort.sign_changes == 0);
    }
}
