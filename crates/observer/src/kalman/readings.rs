//! The readings of turbine, output and wheel speed, each as a measurement of its own.

use drivetrain::Real;

use super::covariance::{CONSIDERED, Measured, Row};
use super::gate::Verdict;
use super::past::SPEEDS;
use super::states::{DELAY, FRACTION, FRICTION, GAIN, OUTPUT, SCALE, SKEW, TURBINE, WHEEL};
use super::{KalmanFilter, Running};
use crate::{ChannelHealth, Phase, Reading};

/// Standard deviation of a uniform distribution, in its width.
const UNIFORM: f64 = 0.288_675_134_594_812_9;

/// Time over which the readings are averaged that tell what is known as well as it can be, at the least, s.
const SLOWLY_S: f64 = 0.2;

/// A speed at the time of a reading.
struct Line<T> {
    value: T,
    /// How much of its error is that of the speed now, and how much that of the earlier speed.
    fractions: [T; 2],
    /// Its derivative by the age, rad/s^2.
    per_age: T,
    /// What a line leaves open.
    variance: T,
}

impl<T: Real> KalmanFilter<T> {
    /// How old a reading of the speed `K` is, s, and the size of the speed, by which the time from tooth to tooth is found.
    #[inline]
    fn age_s<const K: usize>(&self, running: &Running<T>, reading: Reading<T>) -> (T, T) {
        let (zero, sensor) = (T::zero(), &self.readings[K]);
        // The earlier one of turbine and output has no delay.
        let skew = running.mean[SKEW];
        let learnt_s = match K {
            TURBINE => (-skew).at_least(zero),
            OUTPUT => skew.at_least(zero),
            _ => running.mean[DELAY] + (-skew).at_least(zero),
        };
        let per_output = if K == WHEEL { self.model.rigid.driveline.final_ratio.recip() } else { T::one() };
        let size = reading.value.abs().at_least(self.uncertainty.output_least_rad_s * per_output);
        ((reading.age_s + sensor.delay_s + sensor.lag_rad / size + learnt_s).at_least(zero), size)
    }

    /// Takes a reading of the speed `K`.
    #[inline]
    pub(super) fn correct<const K: usize>(&self, running: &mut Running<T>, reading: Reading<T>) -> ChannelHealth {
        let (zero, one, sensor) = (T::zero(), T::one(), &self.readings[K]);
        let (age_s, size_rad_s) = self.age_s::<K>(running, reading);
        let line = self.line::<K>(running, age_s, size_rad_s);
        let scale = if K == WHEEL { one + running.mean[SCALE] } else { one };
        // Readings that come more often than teeth tell no more than the teeth do.
        let since_s = core::mem::replace(&mut running.silent_s[K], zero);
        let repeated = if since_s > zero { (sensor.pitch_rad / (size_rad_s * since_s)).at_least(one) } else { one };
        let noise = repeated * (sensor.std_dev_rad_s * sensor.std_dev_rad_s + line.variance);
        let innovation = reading.value - scale * line.value;
        let learnt = by_learnt::<T, K>(running.mean[SKEW], line.value, scale * line.per_age);
        let row = Row { now: scale * line.fractions[0], earlier: scale * line.fractions[1], learnt };
        let mut measured = running.covariance.measured::<K>(&row, noise);
        match running.gates[K].judge(innovation, measured.variance) {
            Verdict::Refused => {
                running.silent_s[K] = since_s;
                return ChannelHealth::Refused;
            }
            Verdict::Jumped => {
                running.covariance.offset::<K>(innovation * innovation);
                measured = running.covariance.measured::<K>(&row, noise);
            }
            Verdict::Taken => {}
        }
        running.squared_innovations[K] = Some(innovation * innovation / measured.variance);
        self.apply(running, &measured, innovation, since_s, K + 1);
        ChannelHealth::Good
    }

    /// The speed `K` an age ago.
    #[inline]
    fn line<const K: usize>(&self, running: &Running<T>, age_s: T, size_rad_s: T) -> Line<T> {
        let (past, now, square) = (&running.past, running.mean[K], |x: T| x * x);
        let then = past.then(K, now, age_s);
        let [newest, before] = past.accelerations(K, now);
        let pitch_s = self.readings[K].pitch_rad / size_rad_s;
        // Between two points a parabola differs from a line, and beyond the oldest by more and more.
        let mut variance =
            square(then.bend_s * (newest - before)) + square(T::of(UNIFORM) * pitch_s * then.acceleration);
        let on_line = past.on_line(age_s, K >= running.kept);
        if on_line.beyond > T::zero() {
            // The acceleration is carried on, as well as it is known.
            variance = variance + square(on_line.beyond) * running.covariance.changed::<K>();
        }
        if K == WHEEL && then.beyond_s > T::zero() {
            let u = &self.uncertainty;
            let shifting = matches!(running.acting, Phase::TorquePhase | Phase::InertiaPhase);
            let load = if shifting { u.load_shifting_n_m } else { u.load_in_gear_n_m };
            let line = &self.model.rigid.driveline;
            let inertia = self.model.rigid.road.inertia_at_wheel() + line.wheel_inertia_kg_m2;
            let beyond = then.beyond_s;
            variance = variance + square(load / inertia) * beyond * beyond * beyond / T::of(3.0);
        }
        Line { value: then.value, fractions: on_line.fractions, per_age: -then.acceleration, variance }
    }

    /// Ties turbine to output speed by the ratio of the gear before the shift.
    #[inline]
    pub(super) fn tie(&self, running: &mut Running<T>, dt_s: T) {
        let ratio = self.model.shift.ratio_offgoing();
        let mut measured = running.covariance.with_two::<TURBINE, OUTPUT>([T::one(), -ratio]);
        let std_dev = self.readings[TURBINE].std_dev_rad_s;
        let own = measured.with[TURBINE] - ratio * measured.with[OUTPUT];
        measured.variance = own.at_least(T::zero()) + std_dev * std_dev;
        let innovation = ratio * running.mean[OUTPUT] - running.mean[TURBINE];
        self.apply(running, &measured, innovation, dt_s, SPEEDS);
    }

    /// Corrects mean and covariance for a measurement, that comes `since_s` after the last of its kind; the readings of the speeds
    /// from `next` on are still to come in this step.
    #[inline]
    fn apply(&self, running: &mut Running<T>, measured: &Measured<T>, innovation: T, since_s: T, next: usize) {
        let mut fractions = [T::one(); CONSIDERED];
        // Before both clutches slip an error of the turbine torque cancels in the clutch torque, and a cylinder that fills late
        // looks like a clutch with less friction or a valve with less gain.
        if running.acting != Phase::InertiaPhase {
            for state in [FRACTION, FRICTION, GAIN] {
                fractions[state - FRACTION] = T::zero();
            }
        }
        // What is known as well as it can be is corrected slowly: the errors of many readings are alike, and the model would
        // claim more than is true.
        for (state, minimum) in self.known_at_best() {
            if running.covariance.at(state, state) <= minimum * minimum {
                fractions[state - FRACTION] = (since_s / T::of(SLOWLY_S)).at_most(T::one());
            }
        }
        running.correct(measured, innovation, &fractions, next);
    }

    /// How well scale and delays can be known at best: their minimum standard deviations.
    #[inline]
    fn known_at_best(&self) -> [(usize, T); 3] {
        let u = &self.uncertainty;
        [(SCALE, u.scale_min), (DELAY, u.delay_min_s), (SKEW, u.delay_min_s)]
    }

    /// Keeps delays within their budget, and what is known of them and of the scale above the minimum.
    #[inline]
    pub(super) fn limit_learnt(&self, running: &mut Running<T>) {
        for (state, minimum) in self.known_at_best() {
            running.covariance.hold_above(state, minimum * minimum);
        }
        let u = &self.uncertainty;
        let [minimum, maximum] = u.wheel_delay_s;
        let x = &mut running.mean;
        x[DELAY] = x[DELAY].at_least(minimum).at_most(maximum);
        x[SKEW] = x[SKEW].at_least(-u.skew_s).at_most(u.skew_s);
    }
}

/// What the speed `K` in a reading, of this value and with this derivative by its delay, depends on beside the speeds: scale,
/// wheel delay and skew.
#[inline(always)]
fn by_learnt<T: Real, const K: usize>(skew_s: T, value: T, by_delay: T) -> [T; 3] {
    let zero = T::zero();
    let by_skew = match K {
        OUTPUT if skew_s >= zero => by_delay,
        TURBINE | WHEEL if skew_s < zero => -by_delay,
        _ => zero,
    };
    if K == WHEEL { [value, by_delay, by_skew] } else { [zero, zero, by_skew] }
}
