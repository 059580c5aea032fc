//! The readings of turbine, output and wheel speed, each as a measurement of its own.

use drivetrain::Real;

use super::covariance::{ALL, CONSIDERED, Measured, speed_at};
use super::gate::Verdict;
use super::past::{PASTS, Place, SPEEDS};
use super::{DELAY, FRICTION, GAIN, KalmanFilter, N, OUTPUT, Running, SCALE, SHARE, SKEW, TURBINE, WHEEL};
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
    /// Takes a reading of the speed `k`.
    #[inline]
    pub(super) fn correct(&self, running: &mut Running<T>, k: usize, reading: Reading<T>) -> ChannelHealth {
        let (zero, one, sensor) = (T::zero(), T::one(), &self.readings[k]);
        let skew = running.mean[SKEW];
        // The earlier one of turbine and output has no delay.
        let (late_turbine, late_output) = ((-skew).at_least(zero), skew.at_least(zero));
        let learnt_s = match k {
            TURBINE => late_turbine,
            OUTPUT => late_output,
            _ => running.mean[DELAY] + late_turbine,
        };
        let slowest = self.uncertainty.output_least_rad_s * if k == WHEEL { self.wheel_per_output() } else { one };
        let size = reading.value.abs().at_least(slowest);
        let age_s = (reading.age_s + sensor.delay_s + sensor.lag_rad / size + learnt_s).at_least(zero);
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
        // Readings that come more often than teeth tell no more than the teeth do.
        let since_s = core::mem::replace(&mut running.silent_s[k], zero);
        let repeated = if since_s > zero { (sensor.pitch_rad / (size * since_s)).at_least(one) } else { one };
        let noise = repeated * (sensor.deviation_rad_s * sensor.deviation_rad_s + line.variance);
        let innovation = reading.value - scale * line.value;
        let place = Place { shares: line.place.shares.map(|share| scale * share), ..line.place };
        let with = with_reading(running, k, &place, by);
        let variance = variance_of(&with, k, &place, by, noise);
        match running.gates[k].judge(innovation, variance) {
            Verdict::Refused => {
                running.silent_s[k] = since_s;
                return ChannelHealth::Refused;
            }
            Verdict::Jumped => {
                running.covariance.add(k, innovation * innovation);
                let with = with_reading_again(running, k, &place, by);
                let variance = variance_of(&with, k, &place, by, noise);
                self.take(running, k, &Measured { with: &with, variance }, innovation, since_s);
            }
            Verdict::Taken => self.take(running, k, &Measured { with: &with, variance }, innovation, since_s),
        }
        ChannelHealth::Good
    }

    /// Corrects for a reading of the speed `k`.
    #[inline]
    fn take(&self, running: &mut Running<T>, k: usize, measured: &Measured<'_, T>, innovation: T, since_s: T) {
        running.squared_innovations[k] = Some(innovation * innovation / measured.variance);
        self.apply(running, measured, innovation, since_s);
    }

    #[inline]
    fn wheel_per_output(&self) -> T {
        self.model.rigid.driveline.final_ratio.recip()
    }

    /// The speed `k` an age ago.
    #[inline]
    fn line(&self, running: &Running<T>, k: usize, age_s: T, size_rad_s: T) -> Line<T> {
        let square = |x: T| x * x;
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
            variance = variance + square(place.beyond_s / place.width_s) * variance_between(running, k, place.between);
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
fn variance_between<T: Real>(running: &Running<T>, k: usize, points: [usize; 2]) -> T {
    let [late, early] = points.map(|point| speed_at(k, point));
    let p = &running.covariance;
    (p.at(late, late) - T::of(2.0) * p.at(late, early) + p.at(early, early)).at_least(T::zero())
}

/// The covariance of all with a reading of the speed `k` at a place in time, which also depends on scale, wheel delay and
/// skew as `by` says.
#[inline(always)]
fn with_reading<T: Real>(running: &Running<T>, k: usize, place: &Place<T>, by: [T; 3]) -> [T; ALL] {
    const { assert!(PASTS == 2, "a reading is between now and the newer of the past, or between both") };
    let (p, recent) = (&running.covariance, place.between[0] == 0);
    let [late, early] = place.shares;
    let wheel = [late, early, by[0], by[1]];
    let mut with = match (k, recent) {
        (TURBINE, true) => p.sum_of::<TURBINE, { N + TURBINE }>(place.shares),
        (TURBINE, false) => p.sum_of::<{ N + TURBINE }, { N + SPEEDS + TURBINE }>(place.shares),
        (OUTPUT, true) => p.sum_of::<OUTPUT, { N + OUTPUT }>(place.shares),
        (OUTPUT, false) => p.sum_of::<{ N + OUTPUT }, { N + SPEEDS + OUTPUT }>(place.shares),
        (_, true) => p.sum_of_four::<WHEEL, { N + WHEEL }, SCALE, DELAY>(wheel),
        (_, false) => p.sum_of_four::<{ N + WHEEL }, { N + SPEEDS + WHEEL }, SCALE, DELAY>(wheel),
    };
    p.add_row::<SKEW>(&mut with, by[2]);
    with
}

/// The same after the speed has jumped, which is rare.
#[cold]
#[inline(never)]
fn with_reading_again<T: Real>(running: &Running<T>, k: usize, place: &Place<T>, by: [T; 3]) -> [T; ALL] {
    with_reading(running, k, place, by)
}

/// The variance of that reading.
#[inline]
fn variance_of<T: Real>(with: &[T; ALL], k: usize, place: &Place<T>, by: [T; 3], noise: T) -> T {
    let [late, early] = place.between.map(|point| with[speed_at(k, point)]);
    let by_speed = place.shares[0] * late + place.shares[1] * early;
    let total = by_speed + by[0] * with[SCALE] + by[1] * with[DELAY] + by[2] * with[SKEW];
    noise + total.at_least(T::zero())
}
