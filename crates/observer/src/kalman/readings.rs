//! The readings of turbine, output and wheel speed, each as a measurement of its own.

use drivetrain::Real;

use super::covariance::{ALL, CONSIDERED, Covariance, Measured, speed_at};
use super::gate::Verdict;
use super::past::{PASTS, Place};
use super::{DELAY, FRICTION, GAIN, KalmanFilter, OUTPUT, Running, SCALE, SHARE, SKEW, TURBINE, WHEEL};
use crate::{ChannelHealth, Phase, Reading};

/// Standard deviation of a uniform distribution, in its width.
const UNIFORM: f64 = 0.288_675_134_594_812_9;

/// Time over which the readings are averaged that tell what is known as well as it can be, at the least, s.
const SLOWLY_S: f64 = 0.2;

/// A speed at the time of a reading.
struct Line<T> {
    value: T,
    place: Place<T>,
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
        if K != WHEEL && !line.place.is_recent() {
            running.late_s = zero;
        }
        let scale = if K == WHEEL { one + running.mean[SCALE] } else { one };
        // Readings that come more often than teeth tell no more than the teeth do.
        let since_s = core::mem::replace(&mut running.silent_s[K], zero);
        let repeated = if since_s > zero { (sensor.pitch_rad / (size_rad_s * since_s)).at_least(one) } else { one };
        let noise = repeated * (sensor.deviation_rad_s * sensor.deviation_rad_s + line.variance);
        let innovation = reading.value - scale * line.value;
        let parts = Parts {
            place: Place { shares: line.place.shares.map(|share| scale * share), ..line.place },
            learnt: by_learnt::<T, K>(running.mean[SKEW], line.value, scale * line.per_age),
        };
        let points = parts.place.points::<K>(&running.covariance);
        let mut with = parts.with::<K>(&running.covariance, points);
        let mut variance = parts.variance(&with, points, noise);
        match running.gates[K].judge(innovation, variance) {
            Verdict::Refused => {
                running.silent_s[K] = since_s;
                return ChannelHealth::Refused;
            }
            Verdict::Jumped => {
                running.covariance.add(K, innovation * innovation);
                with = parts.with_any(&running.covariance, points);
                variance = parts.variance(&with, points, noise);
            }
            Verdict::Taken => {}
        }
        running.squared_innovations[K] = Some(innovation * innovation / variance);
        self.apply(running, &Measured { with: &with, variance }, innovation, since_s);
        ChannelHealth::Good
    }

    /// The speed `K` an age ago.
    #[inline]
    fn line<const K: usize>(&self, running: &Running<T>, age_s: T, size_rad_s: T) -> Line<T> {
        let (k, square) = (K, |x: T| x * x);
        let (past, now) = (&running.past, running.mean[k]);
        let place = past.place(age_s);
        let [late, early] = place.between.map(|point| past.speed(k, now, point));
        let acceleration = if place.width_s > T::zero() { (late - early) / place.width_s } else { T::zero() };
        let [newest, before] = past.accelerations(k, now);
        // Between two points a parabola differs from a line by this, and beyond the oldest by more and more.
        let bend_s = T::of(0.5) * (place.shares[0] * place.shares[1] * place.width_s + place.beyond_s);
        let pitch_s = self.readings[k].pitch_rad / size_rad_s;
        let mut variance = square(bend_s * (newest - before)) + square(T::of(UNIFORM) * pitch_s * acceleration);
        if place.beyond_s > T::zero() && place.width_s > T::zero() {
            // The acceleration of before is carried on, as well as it is known.
            let points = place.points::<K>(&running.covariance);
            variance = variance + square(place.beyond_s / place.width_s) * variance_between(running, points);
        }
        if k == WHEEL {
            let u = &self.uncertainty;
            let shifting = matches!(running.acting, Phase::TorquePhase | Phase::InertiaPhase);
            let load = if shifting { u.load_shifting_n_m } else { u.load_in_gear_n_m };
            let line = &self.model.rigid.driveline;
            let inertia = self.model.rigid.road.inertia_at_wheel() + line.wheel_inertia_kg_m2;
            let beyond = place.beyond_s;
            variance = variance + square(load / inertia) * beyond * beyond * beyond / T::of(3.0);
        }
        let value = place.shares[0] * late + place.shares[1] * early - place.beyond_s * acceleration;
        Line { value, place, per_age: -acceleration, variance }
    }

    /// Ties turbine to output speed by the ratio of the gear before the shift.
    #[inline]
    pub(super) fn tie(&self, running: &mut Running<T>, dt_s: T) {
        let ratio = self.model.shift.ratio_offgoing();
        let with = running.covariance.sum_of::<TURBINE, OUTPUT>([T::one(), -ratio]);
        let deviation = self.readings[TURBINE].deviation_rad_s;
        let variance = (with[TURBINE] - ratio * with[OUTPUT]).at_least(T::zero()) + deviation * deviation;
        let innovation = ratio * running.mean[OUTPUT] - running.mean[TURBINE];
        self.apply(running, &Measured { with: &with, variance }, innovation, dt_s);
    }

    /// Corrects mean and covariance for a measurement, that comes `since_s` after the last of its kind.
    #[inline]
    fn apply(&self, running: &mut Running<T>, measured: &Measured<'_, T>, innovation: T, since_s: T) {
        let u = &self.uncertainty;
        let mut shares = [T::one(); CONSIDERED];
        // Before both clutches slip an error of the turbine torque cancels in the clutch torque, and a cylinder that fills late
        // looks like a clutch with less friction or a valve with less gain.
        if running.acting != Phase::InertiaPhase {
            for state in [SHARE, FRICTION, GAIN] {
                shares[state - SHARE] = T::zero();
            }
        }
        // What is known as well as it can be is corrected slowly: the errors of many readings are alike, and the model would
        // claim more than is true.
        let least = [(SCALE, u.scale_least), (DELAY, u.delay_least_s), (SKEW, u.delay_least_s)];
        for (state, least) in least {
            if running.covariance.at(state, state) <= least * least {
                shares[state - SHARE] = (since_s / T::of(SLOWLY_S)).at_most(T::one());
            }
        }
        running.correct(measured, innovation, &shares);
        for (state, least) in least {
            running.covariance.hold_above(state, least * least);
        }
        let [least, most] = u.wheel_delay_s;
        let x = &mut running.mean;
        x[DELAY] = x[DELAY].at_least(least).at_most(most);
        x[SKEW] = x[SKEW].at_least(-u.skew_s).at_most(u.skew_s);
    }
}

/// Variance of the change of a speed between two points in time.
#[inline]
fn variance_between<T: Real>(running: &Running<T>, [late, early]: [usize; 2]) -> T {
    let p = &running.covariance;
    (p.at(late, late) - T::of(2.0) * p.at(late, early) + p.at(early, early)).at_least(T::zero())
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

/// The parts of a reading: the speeds around its place in time, and scale, wheel delay and skew, each with its factor.
struct Parts<T> {
    place: Place<T>,
    learnt: [T; 3],
}

impl<T: Real> Place<T> {
    /// The places of the speed `K` around it in the covariance. For a time that is left out there the speed now stands in.
    #[inline]
    fn points<const K: usize>(&self, p: &Covariance<T>) -> [usize; 2] {
        match self.is_recent() {
            true => [K, speed_at(K, 1)],
            false if p.keeps(K, 2) => [speed_at(K, 1), speed_at(K, 2)],
            false => [K; 2],
        }
    }
}

impl<T: Real> Parts<T> {
    /// The covariance of all with a reading of the speed `K`.
    #[inline(always)]
    fn with<const K: usize>(&self, p: &Covariance<T>, points: [usize; 2]) -> [T; ALL] {
        const { assert!(PASTS == 2, "a reading is between now and the newer of the past, or between both") };
        let ([scale, delay, skew], [late, early]) = (self.learnt, self.place.shares);
        let wheel = [late, early, scale, delay];
        let recent = points == [K, speed_at(K, 1)];
        if !recent && points != [speed_at(K, 1), speed_at(K, 2)] {
            return self.with_any(p, points);
        }
        let mut with = match (K, recent) {
            (TURBINE, true) => p.sum_of::<TURBINE, { speed_at(TURBINE, 1) }>([late, early]),
            (TURBINE, false) => p.sum_of::<{ speed_at(TURBINE, 1) }, { speed_at(TURBINE, 2) }>([late, early]),
            (OUTPUT, true) => p.sum_of::<OUTPUT, { speed_at(OUTPUT, 1) }>([late, early]),
            (OUTPUT, false) => p.sum_of::<{ speed_at(OUTPUT, 1) }, { speed_at(OUTPUT, 2) }>([late, early]),
            (_, true) => p.sum_of_four::<WHEEL, { speed_at(WHEEL, 1) }, SCALE, DELAY>(wheel),
            (_, false) => p.sum_of_four::<{ speed_at(WHEEL, 1) }, { speed_at(WHEEL, 2) }, SCALE, DELAY>(wheel),
        };
        p.add_row::<SKEW>(&mut with, skew);
        with
    }

    /// The same of a speed at any of the points.
    #[inline(never)]
    fn with_any(&self, p: &Covariance<T>, points: [usize; 2]) -> [T; ALL] {
        let ([scale, delay, skew], [late, early]) = (self.learnt, self.place.shares);
        core::array::from_fn(|i| {
            let by_learnt = scale * p.at(i, SCALE) + delay * p.at(i, DELAY) + skew * p.at(i, SKEW);
            late * p.at(i, points[0]) + early * p.at(i, points[1]) + by_learnt
        })
    }

    /// The variance of that reading.
    #[inline]
    fn variance(&self, with: &[T; ALL], points: [usize; 2], noise: T) -> T {
        let ([scale, delay, skew], [late, early]) = (self.learnt, self.place.shares);
        let [at_late, at_early] = points.map(|point| with[point.min(ALL - 1)]);
        let by_learnt = scale * with[SCALE] + delay * with[DELAY] + skew * with[SKEW];
        noise + (late * at_late + early * at_early + by_learnt).at_least(T::zero())
    }
}
