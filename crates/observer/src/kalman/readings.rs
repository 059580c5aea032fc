//! The readings of turbine, output and wheel speed, each as a measurement of its own.

use drivetrain::Real;

use super::covariance::Measured;
use super::gate::Verdict;
use super::{DELAY, FRICTION, GAIN, KalmanFilter, N, OUTPUT, Running, SCALE, SHARE, SKEW, TURBINE, WHEEL};
use crate::{ChannelHealth, Phase, Reading};

/// Standard deviation of a uniform distribution, in its width.
const UNIFORM: f64 = 0.288_675_134_594_812_9;

/// A speed at the time of a reading: what of it the states at the end of the step and the earlier speeds make.
struct Line<T> {
    value: T,
    now: T,
    earlier: T,
    /// Its derivative by the age, rad/s^2.
    per_age: T,
    /// What a line leaves open.
    variance: T,
}

impl<T: Real> KalmanFilter<T> {
    /// Takes a reading of the speed `k`.
    #[inline]
    pub(super) fn correct(&self, running: &mut Running<T>, k: usize, reading: Reading<T>) -> ChannelHealth {
        let (zero, one, sensor) = (T::zero(), T::one(), &self.readings[k]);
        let skew = running.mean[SKEW];
        // The earlier one of turbine and output has no delay.
        let (late_turbine, late_output) = ((-skew).max(zero), skew.max(zero));
        let learnt_s = match k {
            TURBINE => late_turbine,
            OUTPUT => late_output,
            _ => running.mean[DELAY] + late_turbine,
        };
        let slowest = self.uncertainty.output_least_rad_s * if k == WHEEL { self.wheel_per_output() } else { one };
        let size = reading.value.abs().max(slowest);
        let age_s = (reading.age_s + sensor.delay_s + sensor.lag_rad / size + learnt_s).max(zero);
        let line = self.line(running, k, age_s, size);
        let scale = if k == WHEEL { one + running.mean[SCALE] } else { one };
        let by_delay = scale * line.per_age;
        let mut by = [zero; 3];
        // By scale, wheel delay, skew.
        if k == WHEEL {
            by[0] = line.value;
            by[1] = by_delay;
        }
        by[2] = match k {
            OUTPUT if skew >= zero => by_delay,
            OUTPUT => zero,
            _ if skew < zero => -by_delay,
            _ => zero,
        };
        let noise = sensor.deviation_rad_s * sensor.deviation_rad_s + line.variance;
        let innovation = reading.value - scale * line.value;
        let weights = [scale * line.now, scale * line.earlier];
        let mut measured = with_reading(running, k, weights, by, noise);
        let verdict = running.gates[k].judge(innovation, measured.variance);
        match verdict {
            Verdict::Refused => return ChannelHealth::Refused,
            Verdict::Jumped => {
                running.covariance.add(k, innovation * innovation);
                measured = with_reading(running, k, weights, by, noise);
            }
            Verdict::Taken => {}
        }
        running.silent_s[k] = zero;
        self.apply(running, &measured, innovation);
        ChannelHealth::Good
    }

    #[inline]
    fn wheel_per_output(&self) -> T {
        self.model.rigid.driveline.final_ratio.recip()
    }

    /// The speed `k` an age ago.
    #[inline]
    fn line(&self, running: &Running<T>, k: usize, age_s: T, size_rad_s: T) -> Line<T> {
        let (zero, one) = (T::zero(), T::one());
        let span_s = running.earlier.age_s;
        let (now, earlier) = (running.mean[k], running.earlier.mean[k]);
        let acceleration = if span_s > zero { (now - earlier) / span_s } else { running.accelerations[k] };
        let square = |x: T| x * x;
        let change = acceleration - running.accelerations_before[k];
        let pitch_s = self.readings[k].pitch_rad / size_rad_s;
        let mut variance = square(T::of(0.5) * age_s * change) + square(T::of(UNIFORM) * pitch_s * acceleration);
        if k == WHEEL {
            let u = &self.uncertainty;
            let shifting = matches!(running.acting, Phase::TorquePhase | Phase::InertiaPhase);
            let load = if shifting { u.load_shifting_n_m } else { u.load_in_gear_n_m };
            let line = &self.model.rigid.driveline;
            let inertia = self.model.rigid.road.inertia_at_wheel() + line.wheel_inertia_kg_m2;
            let beyond = (age_s - span_s).max(zero);
            variance = variance + square(load / inertia) * beyond * beyond * beyond / T::of(3.0);
        }
        // A line through both ends; over a short span it is noise, and the acceleration of before is carried on.
        let share = if span_s > zero { age_s / span_s } else { zero };
        if share <= one || span_s >= T::of(0.005) {
            let now_share = one - share;
            let value = now_share * now + share * earlier;
            return Line { value, now: now_share, earlier: share, per_age: -acceleration, variance };
        }
        let before = running.accelerations_before[k];
        let value = earlier - (age_s - span_s) * before;
        Line { value, now: zero, earlier: one, per_age: -before, variance }
    }

    /// Ties turbine to output speed by the ratio of the gear before the shift.
    #[inline]
    pub(super) fn tie(&self, running: &mut Running<T>) {
        let ratio = self.model.shift.ratio_offgoing();
        let p = &running.covariance;
        let of = |row: &[T; N]| row[TURBINE] - ratio * row[OUTPUT];
        let states: [T; N] = core::array::from_fn(|i| of(&p.states[i]));
        let earlier: [T; 3] = core::array::from_fn(|m| p.across[TURBINE][m] - ratio * p.across[OUTPUT][m]);
        let deviation = self.readings[TURBINE].deviation_rad_s;
        let variance = (states[TURBINE] - ratio * states[OUTPUT]).max(T::zero()) + deviation * deviation;
        let innovation = ratio * running.mean[OUTPUT] - running.mean[TURBINE];
        self.apply(running, &Measured { states, earlier, variance }, innovation);
    }

    /// Corrects mean and covariance for a measurement.
    #[inline]
    fn apply(&self, running: &mut Running<T>, measured: &Measured<T>, innovation: T) {
        let u = &self.uncertainty;
        let mut considered = [false; N];
        // Before both clutches slip an error of the turbine torque cancels in the clutch torque, and a cylinder that fills late
        // looks like a clutch with less friction or a valve with less gain.
        for state in [SHARE, FRICTION, GAIN] {
            considered[state] = running.acting != Phase::InertiaPhase;
        }
        // What is known as well as it can be is not corrected any more: the model would claim more than is true.
        for (state, least) in [(SCALE, u.scale_least), (DELAY, u.delay_least_s), (SKEW, u.delay_least_s)] {
            considered[state] = running.covariance.states[state][state] <= least * least;
        }
        let (gain, earlier) = running.covariance.correct(measured, considered);
        for (x, gain) in running.mean.iter_mut().zip(gain) {
            *x = *x + gain * innovation;
        }
        for (x, gain) in running.earlier.mean.iter_mut().zip(earlier) {
            *x = *x + gain * innovation;
        }
        let [least, most] = u.wheel_delay_s;
        let x = &mut running.mean;
        x[DELAY] = x[DELAY].max(least).min(most);
        x[SKEW] = x[SKEW].max(-u.skew_s).min(u.skew_s);
        if running.earlier.age_s > T::zero() {
            for k in [TURBINE, OUTPUT, WHEEL] {
                running.accelerations[k] = (running.mean[k] - running.earlier.mean[k]) / running.earlier.age_s;
            }
        }
    }
}

/// What a reading has to do with the states: it is `weights[0]` of the speed now and `weights[1]` of the earlier one, and
/// depends on scale, wheel delay and skew as `by` says.
#[inline]
fn with_reading<T: Real>(running: &Running<T>, k: usize, weights: [T; 2], by: [T; 3], noise: T) -> Measured<T> {
    let p = &running.covariance;
    let [now, earlier] = weights;
    let states: [T; N] = core::array::from_fn(|i| {
        let row = &p.states[i];
        now * row[k] + earlier * p.across[i][k] + by[0] * row[SCALE] + by[1] * row[DELAY] + by[2] * row[SKEW]
    });
    let before: [T; 3] = core::array::from_fn(|m| {
        now * p.across[k][m]
            + earlier * p.within[k][m]
            + by[0] * p.across[SCALE][m]
            + by[1] * p.across[DELAY][m]
            + by[2] * p.across[SKEW][m]
    });
    let total =
        now * states[k] + earlier * before[k] + by[0] * states[SCALE] + by[1] * states[DELAY] + by[2] * states[SKEW];
    Measured { states, earlier: before, variance: total.max(T::zero()) + noise }
}
