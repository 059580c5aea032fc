//! An expected range of the drive-shaft torque.
//!
//! The momentum balances of turbine and output give the gearbox output torque for any torque of the offgoing clutch:
//! of the two balances
//!
//! ```text
//! dw_t/dt = C11 T_t + C12 T_ca + C13 T_cb + C14 T_s/i        dw_0/dt = the output row of the same
//! ```
//!
//! one combination has no `T_ca`. With the turbine torque within its bound, the oncoming clutch's torque within its
//! own range and the accelerations within the uncertainty of the readings, the shaft torque is within a range too.
//! This range is for an instant in the past, by the largest delay of a reading; the change of the twist extends it,
//! and the range before, to the present.
//!
//! **It is expected, not guaranteed**, since the readings do not bound what the speeds did between them. It holds if
//!
//! - each reading is at most `age_s` old, and between the oldest instant that a reading may be of and now every speed
//!   stays within the span of its readings over that time, widened by the fraction that `age_s` has in it, at both ends;
//! - the age of a reading does not change from one sample to the next, so that the difference of two readings over the
//!   time step is the mean acceleration between them;
//! - the torques are within the rest of [`ShaftErrors`], and the supervisor's phase is right after a release.
//!
//! The first is wrong for a speed that turns sharply between two samples, as at lock-up, or oscillates faster than the samples
//! show. Bounds on the accelerations would make it a theorem, and useless: 300 rad/s^2 at the gearbox output are 9 rad/s
//! over 30 ms, and at a final ratio of 3 and 13,000 N m/rad twist the shafts by 1170 N m more or less than the readings say.

use drivetrain::{AccelerationRow, Converter, Driveline, Engagement, Real, ReducedShift};

use crate::{Phase, Sample};

/// What the range is made from.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShaftRange<T> {
    shift: ReducedShift<T>,
    /// The balance that holds for any torque of the offgoing clutch.
    any_offgoing: Balance<T>,
    /// The balance that holds for any torque of the oncoming clutch.
    any_oncoming: Balance<T>,
    converter: Converter<T>,
    driveline: Driveline<T>,
    errors: ShaftErrors<T>,
}

/// Largest errors for which the range is expected to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShaftErrors<T> {
    /// Of the turbine torque, as a fraction.
    pub turbine_torque_share: T,
    /// Of a change of the turbine speed from one sample to the next, rad/s.
    pub turbine_rad_s: T,
    /// Of a change of the output speed, rad/s.
    pub output_rad_s: T,
    /// Of a change of the wheel speed, rad/s.
    pub wheel_rad_s: T,
    /// Of the scale of the wheel speed, as a fraction.
    pub wheel_scale: T,
    /// Maximum age of a reading, s.
    pub age_s: T,
    /// Torque left in the offgoing clutch when it has let go and drained, N m.
    pub offgoing_n_m: T,
    /// Time from its first slip until no more than that is left, s.
    pub offgoing_drain_s: T,
}

impl<T: Real> ShaftErrors<T> {
    /// The same errors in another precision.
    fn cast<U: Real>(&self) -> ShaftErrors<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ShaftErrors {
            turbine_torque_share: to(self.turbine_torque_share),
            turbine_rad_s: to(self.turbine_rad_s),
            output_rad_s: to(self.output_rad_s),
            wheel_rad_s: to(self.wheel_rad_s),
            wheel_scale: to(self.wheel_scale),
            age_s: to(self.age_s),
            offgoing_n_m: to(self.offgoing_n_m),
            offgoing_drain_s: to(self.offgoing_drain_s),
        }
    }
}

/// The torque at the gearbox output from two accelerations, the turbine torque and the torque of one clutch.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Balance<T> {
    per_turbine_rad_s2: T,
    per_output_rad_s2: T,
    per_turbine_torque: T,
    per_clutch_torque: T,
}

/// Accelerations and turbine torque over an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seen<T> {
    turbine_rad_s2: [T; 2],
    output_rad_s2: [T; 2],
    turbine_n_m: [T; 2],
}

impl<T: Real> Balance<T> {
    /// Torque at the gearbox output over the interval, N m, with the clutch of the balance at this torque.
    fn output(&self, seen: &Seen<T>, clutch_n_m: [T; 2]) -> [T; 2] {
        let parts = [
            scaled(seen.turbine_rad_s2, self.per_turbine_rad_s2),
            scaled(seen.output_rad_s2, self.per_output_rad_s2),
            scaled(seen.turbine_n_m, self.per_turbine_torque),
            scaled(clutch_n_m, self.per_clutch_torque),
        ];
        parts.into_iter().fold([T::zero(); 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]])
    }
}

/// The balance that has no torque of a clutch, of turbine and output row.
fn without<T: Real>(rows: [&AccelerationRow<T>; 2], this: Pick<T>, other: Pick<T>) -> Balance<T> {
    let [turbine, output] = rows;
    let (a, b) = (this(output), -this(turbine));
    let combined = |of: Pick<T>| a * of(turbine) + b * of(output);
    let per_output = combined(|row| row.per_output_torque);
    Balance {
        per_turbine_rad_s2: a / per_output,
        per_output_rad_s2: b / per_output,
        per_turbine_torque: -combined(|row| row.per_turbine_torque) / per_output,
        per_clutch_torque: -combined(other) / per_output,
    }
}

type Pick<T> = fn(&AccelerationRow<T>) -> T;

/// Minimum and maximum values over some time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span<T> {
    engine: [T; 2],
    turbine: [T; 2],
    clutch: [T; 2],
    output: [T; 2],
    wheel: [T; 2],
    /// How far it reaches back, s.
    length_s: T,
}

/// Memory of the range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShaftMemory<T> {
    /// Turbine and output speed of the last sample, rad/s.
    last: Option<[T; 2]>,
    /// The newest samples, and those before; together they reach back far enough.
    recent: Option<Span<T>>,
    before: Option<Span<T>>,
    /// Range of the spring's part of the torque, N m.
    spring: Option<[T; 2]>,
    /// For how long the offgoing clutch has been seen to slip, s.
    released_s: T,
}

impl<T: Real> ShaftMemory<T> {
    /// Nothing is known.
    pub fn new() -> Self {
        Self { last: None, recent: None, before: None, spring: None, released_s: T::zero() }
    }

    /// Takes in a sample `dt` after the one before; all that was seen since `reach_s` ago, or a little longer.
    fn look_back(&mut self, now: Span<T>, dt: T, reach_s: T) -> Span<T> {
        let recent = self.recent.map_or(now, |recent| recent.joined(&now).lasting(recent.length_s + dt));
        let span = self.before.map_or(recent, |before| before.joined(&recent));
        if recent.length_s >= reach_s {
            (self.before, self.recent) = (Some(recent), Some(now));
        } else {
            self.recent = Some(recent);
        }
        span
    }
}

impl<T: Real> Default for ShaftMemory<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> ShaftRange<T> {
    /// The range for this powertrain; `shift` is the bare gear train.
    pub fn new(
        shift: ReducedShift<T>,
        converter: Converter<T>,
        driveline: Driveline<T>,
        errors: ShaftErrors<T>,
    ) -> Self {
        // A clutch that holds does so with the torque that this takes: the rows hold in every phase.
        let both = shift.coefficients(Engagement::BothSlipping);
        let rows = [&both.turbine, &both.output];
        let (offgoing, oncoming): (Pick<T>, Pick<T>) = (|row| row.per_offgoing_torque, |row| row.per_oncoming_torque);
        let (any_offgoing, any_oncoming) = (without(rows, offgoing, oncoming), without(rows, oncoming, offgoing));
        Self { shift, any_offgoing, any_oncoming, converter, driveline, errors }
    }

    /// The same range in another precision.
    pub fn cast<U: Real>(&self) -> ShaftRange<U> {
        ShaftRange::new(self.shift.cast(), self.converter.cast(), self.driveline.cast(), self.errors.cast())
    }

    /// The range at a sample whose speeds are usable, N m; `clutch` is that of the oncoming clutch's torque.
    pub fn step(
        &self,
        memory: &mut ShaftMemory<T>,
        phase: Phase,
        sample: &Sample<T>,
        clutch: [T; 2],
    ) -> Option<[T; 2]> {
        let (zero, errors, line) = (T::zero(), &self.errors, &self.driveline);
        let speeds = [sample.turbine_rad_s, self.shift.output_speed(sample.turbine_rad_s, sample.slip_rad_s)];
        let now = Span {
            engine: [sample.engine_rad_s; 2],
            turbine: [speeds[0]; 2],
            clutch,
            output: [speeds[1]; 2],
            wheel: [sample.wheel_rad_s; 2],
            length_s: zero,
        };
        let Some(last) = memory.last.replace(speeds).filter(|_| sample.dt_s > zero) else {
            *memory = ShaftMemory { last: Some(speeds), recent: Some(now), ..ShaftMemory::new() };
            return None;
        };
        let dt = sample.dt_s;
        let reach_s = dt + errors.age_s;
        let span = memory.look_back(now, dt, reach_s);
        let twist = self.twist_rates(&span, reach_s, sample.wheel_rad_s);
        let ratio = line.final_ratio;
        let turned = twist.map(|rate| line.shaft_stiffness_n_m_rad * rate);
        let damping = twist.map(|rate| line.shaft_damping_n_m_s_rad * rate);

        memory.released_s = match phase {
            Phase::InertiaPhase | Phase::AfterShift => memory.released_s + dt,
            Phase::BeforeShift | Phase::TorquePhase => zero,
        };
        let changes = [speeds[0] - last[0], speeds[1] - last[1]];
        let seen = self.seen(changes, dt, &span);
        let mut mean = scaled(self.any_offgoing.output(&seen, span.clutch), ratio);
        // A clutch that has let go carries next to nothing, as soon as it has drained and all that is looked back on lies
        // after that.
        if memory.released_s > reach_s + errors.offgoing_drain_s {
            let offgoing = [-errors.offgoing_n_m, errors.offgoing_n_m];
            mean = common(mean, scaled(self.any_oncoming.output(&seen, offgoing), ratio));
        }
        let balanced = [
            mean[0] - damping[1] + (reach_s * turned[0]).at_most(zero),
            mean[1] - damping[0] + (reach_s * turned[1]).at_least(zero),
        ];
        let spring = match memory.spring {
            None => balanced,
            Some(before) => common(balanced, [before[0] + dt * turned[0], before[1] + dt * turned[1]]),
        };
        if !(spring[0].is_finite() && spring[1].is_finite()) {
            memory.spring = None;
            return None;
        }
        memory.spring = Some(spring);
        Some([spring[0] + damping[0], spring[1] + damping[1]])
    }

    /// Minimum and maximum rate of the shafts' twist, rad/s at the wheels. Readings may be old: what they have not shown yet is taken
    /// to be as much again as they showed.
    fn twist_rates(&self, span: &Span<T>, reach_s: T, wheel_rad_s: T) -> [T; 2] {
        let (errors, line) = (&self.errors, &self.driveline);
        let ahead = errors.age_s / reach_s;
        let output = widened(span.output, ahead, errors.output_rad_s);
        let scale = errors.wheel_scale * wheel_rad_s.abs();
        let wheel = widened(span.wheel, ahead, errors.wheel_rad_s + scale);
        [line.twist_rate(output[0], wheel[1]), line.twist_rate(output[1], wheel[0])]
    }

    /// What the readings leave open between two of them, between which turbine and output speed changed by these.
    fn seen(&self, [turbine, output]: [T; 2], dt_s: T, span: &Span<T>) -> Seen<T> {
        let errors = &self.errors;
        let rate = |change: T, error: T| [(change - error) / dt_s, (change + error) / dt_s];
        let [minimum, maximum] = self.converter.turbine_range(span.engine, span.turbine);
        let fraction = errors.turbine_torque_share;
        Seen {
            turbine_rad_s2: rate(turbine, errors.turbine_rad_s),
            output_rad_s2: rate(output, errors.output_rad_s),
            turbine_n_m: [minimum - fraction * minimum.abs(), maximum + fraction * maximum.abs()],
        }
    }
}

impl<T: Real> Span<T> {
    /// Both together, as long as this one.
    fn joined(&self, other: &Self) -> Self {
        let join = |a: [T; 2], b: [T; 2]| [a[0].at_most(b[0]), a[1].at_least(b[1])];
        Self {
            engine: join(self.engine, other.engine),
            turbine: join(self.turbine, other.turbine),
            clutch: join(self.clutch, other.clutch),
            output: join(self.output, other.output),
            wheel: join(self.wheel, other.wheel),
            length_s: self.length_s,
        }
    }

    fn lasting(self, length_s: T) -> Self {
        Self { length_s, ..self }
    }
}

/// What is in both; of ranges that exclude each other something is beyond its bound, and the wider one is the safer.
fn common<T: Real>(a: [T; 2], b: [T; 2]) -> [T; 2] {
    let both = [a[0].at_least(b[0]), a[1].at_most(b[1])];
    if both[0] <= both[1] { both } else { [a[0].at_most(b[0]), a[1].at_least(b[1])] }
}

/// A range made wider by a fraction of its width and an error at both ends.
fn widened<T: Real>([low, high]: [T; 2], fraction: T, error: T) -> [T; 2] {
    let more = fraction * (high - low) + error;
    [low - more, high + more]
}

/// A range times a factor of either sign.
fn scaled<T: Real>([low, high]: [T; 2], factor: T) -> [T; 2] {
    let (a, b) = (low * factor, high * factor);
    if factor >= T::zero() { [a, b] } else { [b, a] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drivetrain::Table1;

    const DT_S: f64 = 0.01;

    fn range(turbine_torque_share: f64) -> ShaftRange<f64> {
        let shift = ReducedShift {
            mass_kg_m2: [[0.1, 0.0], [0.0, 0.2]],
            slip_offgoing: [1.0, -2.5],
            slip_oncoming: [1.0, -1.0],
        };
        let converter = Converter {
            capacity_n_m_s2: Table1::new(&[0.0, 0.9, 1.0, 1.5], &[2e-3, 1e-3, 0.0, -2e-3]).unwrap(),
            torque_ratio: Table1::new(&[0.0, 0.9, 1.0], &[2.0, 1.0, 1.0]).unwrap(),
        };
        let driveline = Driveline {
            final_ratio: 3.0,
            shaft_stiffness_n_m_rad: 13_000.0,
            shaft_damping_n_m_s_rad: 20.0,
            wheel_inertia_kg_m2: 2.0,
        };
        let errors = ShaftErrors {
            turbine_torque_share,
            turbine_rad_s: 0.0,
            output_rad_s: 0.0,
            wheel_rad_s: 0.0,
            wheel_scale: 0.0,
            age_s: 0.0,
            offgoing_n_m: 0.0,
            offgoing_drain_s: 0.0,
        };
        ShaftRange::new(shift, converter, driveline, errors)
    }

    /// Speeds of a car that rolls in first gear without any acceleration; the offgoing clutch holds.
    fn rolling(range: &ShaftRange<f64>, turbine_rad_s: f64) -> Sample<f64> {
        let output = turbine_rad_s / 2.5;
        Sample {
            dt_s: DT_S,
            engine_rad_s: 250.0,
            turbine_rad_s,
            slip_rad_s: range.shift.oncoming_slip(turbine_rad_s, output),
            wheel_rad_s: output / 3.0,
            command: 0.0,
        }
    }

    #[test]
    fn exact_readings_of_a_steady_gear_leave_the_turbine_torque_and_the_clutch() {
        let exact = range(0.0);
        let sample = rolling(&exact, 200.0);
        let turbine = exact.converter.torques(250.0, 200.0).turbine_n_m;
        let run = |range: &ShaftRange<f64>, clutch| {
            let mut memory = ShaftMemory::new();
            assert!(range.step(&mut memory, Phase::BeforeShift, &sample, clutch).is_none());
            range.step(&mut memory, Phase::BeforeShift, &sample, clutch).unwrap()
        };
        let [low, high] = run(&exact, [0.0; 2]);
        let expected = 2.5 * 3.0 * turbine;
        assert!((low - expected).abs() < 1e-6 && (high - expected).abs() < 1e-6, "{low} {high} {expected}");
        let [low, high] = run(&range(0.15), [0.0; 2]);
        assert!((low - 0.85 * expected).abs() < 1e-6 && (high - 1.15 * expected).abs() < 1e-6);
        // 1 N m through the oncoming clutch, past the first gear's ratio, is 7.5 - 3 less at the wheels.
        let [low, high] = run(&exact, [0.0, 10.0]);
        assert!((high - expected).abs() < 1e-6 && (high - low - 45.0).abs() < 1e-6, "{low} {high}");
    }

    #[test]
    fn twist_carries_the_range_on() {
        let exact = range(0.15);
        let mut memory = ShaftMemory::new();
        let still = rolling(&exact, 200.0);
        exact.step(&mut memory, Phase::BeforeShift, &still, [0.0; 2]);
        let before = exact.step(&mut memory, Phase::BeforeShift, &still, [0.0; 2]).unwrap();
        // With nothing known of the clutch the balance says nothing, and the twist of 0.01 rad/s is all.
        let twisting = Sample { wheel_rad_s: still.wheel_rad_s - 0.01, ..still };
        exact.step(&mut memory, Phase::TorquePhase, &twisting, [-1e6, 1e6]);
        let after = exact.step(&mut memory, Phase::TorquePhase, &twisting, [-1e6, 1e6]).unwrap();
        let (maximum, damping) = (2.0 * DT_S * 13_000.0 * 0.01, 0.2);
        assert!(
            after[0] >= before[0] - 1e-9 && after[1] <= before[1] + maximum + damping + 1e-9,
            "{before:?} {after:?}"
        );
    }

    #[test]
    fn readings_that_are_lost_end_it() {
        let exact = range(0.15);
        let mut memory = ShaftMemory::new();
        let still = rolling(&exact, 200.0);
        exact.step(&mut memory, Phase::BeforeShift, &still, [0.0; 2]);
        assert!(exact.step(&mut memory, Phase::BeforeShift, &Sample { dt_s: 0.0, ..still }, [0.0; 2]).is_none());
    }
}
