//! The reading of the longitudinal accelerometer.
//!
//! It measures the specific force, `a + g sin(grade)`: what the tyres give less rolling resistance, drag and brakes, whatever the grade. With the
//! torque of the drive shafts `q = T_s + C_s (w_o/i_df - w_w + r)`, the mass `m`, the radius `R_w` and the inertia `I_w` of the wheels
//!
//! ```text
//! m R_w a = q - I_w w_w' - (brakes, rolling resistance and drag)        w_w' = (q - T_L)/(m R_w^2 + I_w)
//! a = R_w/J q + I_w/(J m R_w) T_L + bias                                J = m R_w^2 + I_w
//! ```
//!
//! The bias is that of the sensor, the resistances and the brakes. It is apart from the states of the filter, of which a car without this sensor
//! has no more. While the car coasts the driver may brake, and the readings show little.
//!
//! What is learnt of the sensor in a drive:
//!
//! | quantity | from |
//! |---|---|
//! | scale, with the mass of the car | the changes of the readings over those by the torque at the gearbox input, in gear and with power |
//! | delay | the innovations while the acceleration changes |
//! | noise above the stated one | the squared innovations in gear |
//!
//! An error of the scale shows as one of the bias when the acceleration changes: the variance of the bias grows by the square of the change. A
//! sensor that is not stated is used once its readings have followed the torque; one that does not follow it, as with the other sign, or that
//! gives the same value all the time, is not used.

use car::Reading;
use drivetrain::Real;

use super::bias::Bias;
use super::correct::unused;
use super::covariance::{Gaussian, Innovation};
use super::powertrain::Rates;
use super::{
    ChannelHealth, GATE, Gate, GearboxFilter, GearboxState, LOAD, LOST_S, Measured, N, OUTPUT, RATE, Running, SPRING,
    ShiftInput, ShiftPhase, Verdict, WHEEL, square,
};

/// Largest specific force of a car on the road, m/s^2 \[chosen\].
const LARGEST_M_S2: f64 = 15.0;
/// Turbine torque from which on the driver does not brake, N m \[chosen\].
const DRIVES_N_M: f64 = 10.0;
/// Random walk of the bias, m/s^2 per root second, while the engine drives the car, whose body pitches, and while it coasts, and the driver may
/// brake \[chosen\].
const WALKS: [f64; 2] = [0.1, 1.0];
/// Time over which the acceleration is averaged; its changes are distances from this mean, s \[chosen\].
const USUAL_S: f64 = 1.0;
/// Time over which the noise is found, s, what counts of it at the start, and the largest noise, in standard deviations of the stated one
/// \[chosen\].
const NOISE_S: f64 = 2.0;
const NOISE_START_S: f64 = 0.1;
const NOISE_MAX: f64 = 10.0;
/// Standard deviation of the delay that is left of a larger one however much has been seen, and the longest one that is learnt, s \[chosen\].
const DELAY_LEFT_S: f64 = 0.003;
const LATEST_S: f64 = 0.15;
/// Time over which the readings are compared with the torque, and over which both are averaged: what is compared are the distances from
/// these means, s \[chosen\].
const COMPARED_S: f64 = 100.0;
const COMPARED_USUAL_S: f64 = 5.0;
/// Changes by the torque from which on the comparison counts, m^2/s^3: 0.5 m/s^2 for a second; and the slopes of the readings over
/// these changes between which they are those of this car \[chosen\].
const ENOUGH: f64 = 0.25;
const SLOPES: [f64; 2] = [0.5, 2.0];
/// Density of the changes of the readings that the torque does not explain, m^2/s^3: 0.2 m/s^2 that last half a second; and the standard deviation of the scale that
/// is left however much has been seen, as a fraction \[chosen\].
const BESIDE: f64 = 0.02;
const SCALE_LEFT: f64 = 0.04;
/// Time for which a sensor may give the same reading, s \[chosen\].
const STANDS_S: f64 = 1.0;
/// Longest time that a reading stands for in a comparison, s, and its largest distance from what the torque gives, m/s^2 \[chosen\]: a wrong one
/// counts little.
const COUNTS_S: f64 = 0.05;
const DISTANCE_M_S2: f64 = 2.0;

/// How the longitudinal acceleration is read, and what it shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccelerationReading<T> {
    /// Standard deviation of a reading, m/s^2.
    pub std_dev_m_s2: T,
    /// Of the bias at the start, m/s^2: of the sensor, the resistances and the brakes.
    pub bias_m_s2: T,
    /// Of the scale, as a fraction: of the sensor, the mass of the car and the pitch of its body.
    pub scale_fraction: T,
    /// Time by which all readings are later than their age, s.
    pub delay_s: T,
    /// Its standard deviation, s.
    pub delay_std_dev_s: T,
    /// Whether the sensor is stated. One that is not is used once its readings have followed the torque.
    pub is_stated: bool,
    /// Acceleration per torque of the drive shafts, and per load at the wheels, m/s^2 per N m.
    pub per_torque: [T; 2],
}

/// What the filter knows of the readings.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Felt<T> {
    gate: Gate,
    /// Variance of a reading, m^2/s^4, and the time over which it was found, s.
    noise: (T, T),
    /// What the delay is beyond the stated one, s, and its variance.
    pub(super) late: [T; 2],
    /// By the torque of the shafts: its mean over [`USUAL_S`], and the largest distance from it of late, m/s^2.
    usual_m_s2: T,
    reach_m_s2: T,
    /// Rate of the acceleration at the reading before, m/s^3, and the time since it, s.
    rate: (T, T),
}

/// The changes of the readings against those by the torque at the gearbox input, in gear and with power.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ByTorque<T> {
    /// Time since a possible reading came, s.
    silent_s: T,
    /// The newest reading, m/s^2, and for how long it has been the same, s.
    same: (T, T),
    /// Means over [`COMPARED_USUAL_S`] of the readings and by the torque, m/s^2, and the time since the last ones were compared, s.
    usual_m_s2: Option<[T; 2]>,
    paused_s: T,
    /// Integrals of the product of both changes and of the square of those by the torque, m^2/s^3.
    product: T,
    square: T,
    /// Whether the readings have followed the torque.
    has_followed: bool,
}

/// A reading that can be taken, with the scale of the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Acceleration<T> {
    reading: Reading<T>,
    /// And what of its variance is left.
    scale: [T; 2],
}

impl<T: Real> AccelerationReading<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> AccelerationReading<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        AccelerationReading {
            std_dev_m_s2: to(self.std_dev_m_s2),
            bias_m_s2: to(self.bias_m_s2),
            scale_fraction: to(self.scale_fraction),
            delay_s: to(self.delay_s),
            delay_std_dev_s: to(self.delay_std_dev_s),
            is_stated: self.is_stated,
            per_torque: self.per_torque.map(to),
        }
    }

    /// Whether a reading can be one of a car.
    fn is_possible(reading: &Reading<T>) -> bool {
        reading.value.abs() <= T::of(LARGEST_M_S2) && reading.age_s >= T::zero() && reading.age_s <= T::of(LOST_S)
    }
}

impl<T: Real> Felt<T> {
    /// Nothing is known but what is stated.
    fn nothing(sensor: &AccelerationReading<T>) -> Self {
        let zero = T::zero();
        Self {
            gate: Gate::new(GATE),
            noise: (square(sensor.std_dev_m_s2), T::of(NOISE_START_S)),
            late: [zero, square(sensor.delay_std_dev_s)],
            usual_m_s2: zero,
            reach_m_s2: zero,
            rate: (zero, zero),
        }
    }

    /// Begins at this acceleration and rate; what is known of the sensor stays.
    fn begin(&mut self, felt_m_s2: T, rate: T) {
        (self.gate, self.usual_m_s2, self.reach_m_s2) = (Gate::new(GATE), felt_m_s2, T::zero());
        self.rate = (rate, T::zero());
    }

    /// Follows the acceleration; by how much the square of its largest distance from its mean has grown, m^2/s^4.
    fn reach_out(&mut self, felt_m_s2: T, dt_s: T) -> T {
        let distance = (felt_m_s2 - self.usual_m_s2).abs();
        let grown = (square(distance) - square(self.reach_m_s2)).at_least(T::zero());
        let fraction = dt_s / (dt_s + T::of(USUAL_S));
        self.usual_m_s2 = self.usual_m_s2 + fraction * (felt_m_s2 - self.usual_m_s2);
        self.reach_m_s2 = self.reach_m_s2.at_least(distance) * (T::one() - fraction);
        grown
    }

    /// Learns the noise from an innovation after this time, s.
    fn learn_noise(&mut self, innovation: &Innovation<T>, sensor: &AccelerationReading<T>, learning_s: T) {
        let gate = T::of(f64::from(GATE));
        let squared = square(innovation.value).at_most(square(gate) * innovation.variance);
        let (noise, time_s) = &mut self.noise;
        *time_s = (*time_s + learning_s).at_most(T::of(NOISE_S));
        let stated = square(sensor.std_dev_m_s2);
        let found = *noise + (learning_s / *time_s).at_most(T::one()) * (squared - innovation.variance);
        *noise = found.at_least(stated).at_most(T::of(NOISE_MAX * NOISE_MAX) * stated);
    }

    /// Learns the delay from an innovation, at this rate of the readings, m/s^3.
    fn learn_delay(&mut self, innovation: &Innovation<T>, rate: T, sensor: &AccelerationReading<T>) {
        let [late_s, variance] = &mut self.late;
        // A reading that is later by `d` is lower by the rate times `d`.
        let gain = -*variance * rate / innovation.variance;
        // No reading comes before it was measured.
        *late_s = (*late_s + gain * innovation.value).at_least(-sensor.delay_s).at_most(T::of(LATEST_S));
        let left = square(T::of(DELAY_LEFT_S).at_most(sensor.delay_std_dev_s));
        *variance = (*variance + gain * rate * *variance).at_least(left);
    }
}

impl<T: Real> ByTorque<T> {
    fn nothing() -> Self {
        let zero = T::zero();
        Self {
            silent_s: zero,
            same: (zero, zero),
            usual_m_s2: None,
            paused_s: zero,
            product: zero,
            square: zero,
            has_followed: false,
        }
    }

    /// Takes a reading and the acceleration by the torque, m/s^2, where they can be compared; and the time since the reading before, s.
    fn take(&mut self, both: Option<[T; 2]>, dt_s: T) {
        self.paused_s = self.paused_s + dt_s;
        let Some([reading, torque]) = both else { return };
        if self.paused_s > T::of(COMPARED_S) {
            // Resistances and the bias may be others.
            self.usual_m_s2 = None;
        }
        self.paused_s = T::zero();
        let dt_s = dt_s.at_most(T::of(COUNTS_S));
        let usual = self.usual_m_s2.get_or_insert([reading, torque]);
        let by_torque = torque - usual[1];
        let distance = T::of(DISTANCE_M_S2);
        let by_reading = (reading - usual[0]).at_least(by_torque - distance).at_most(by_torque + distance);
        let left = T::one() - dt_s / T::of(COMPARED_S);
        self.product = left * self.product + dt_s * by_reading * by_torque;
        self.square = left * self.square + dt_s * by_torque * by_torque;
        let fraction = dt_s / (dt_s + T::of(COMPARED_USUAL_S));
        (usual[0], usual[1]) = (usual[0] + fraction * by_reading, usual[1] + fraction * by_torque);
        self.has_followed |= self.square >= T::of(ENOUGH) && self.follows();
    }

    fn follows(&self) -> bool {
        let [lowest, highest] = SLOPES.map(|slope| T::of(slope) * self.square);
        self.product >= lowest && self.product <= highest
    }

    /// Goes on after a time that is not known.
    pub(super) fn pause(&mut self) {
        self.usual_m_s2 = None;
    }

    /// Whether the sensor still gives new values.
    fn is_new(&mut self, value: T, dt_s: T) -> bool {
        let dt_s = dt_s.at_most(T::of(COUNTS_S));
        let same_s = if self.same.0 == value { self.same.1 + dt_s } else { T::zero() };
        self.same = (value, same_s);
        same_s <= T::of(STANDS_S)
    }

    /// Scale of the readings and the part of its variance that is left, which is this one unseen; none where they do not follow the
    /// torque.
    fn scale(&self, sensor: &AccelerationReading<T>) -> Option<[T; 2]> {
        let is_used = if self.square < T::of(ENOUGH) { sensor.is_stated || self.has_followed } else { self.follows() };
        if !is_used {
            return None;
        }
        let unseen = square(sensor.scale_fraction);
        // `s - 1` has the variance `unseen`, and each change of the readings is `s` times that by the torque.
        let gain = unseen / (unseen * self.square + T::of(BESIDE));
        let scale = T::one() + gain * (self.product - self.square);
        let left = (T::of(BESIDE) * gain).at_least(square(T::of(SCALE_LEFT)).at_most(unseen));
        Some([scale, left])
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Judges the reading of the longitudinal acceleration before the filter takes it.
    pub(super) fn judge_acceleration(
        &self,
        state: &mut GearboxState<T>,
        input: &ShiftInput<T>,
        dt_s: T,
    ) -> ChannelHealth {
        let given = input.acceleration_m_s2;
        if given.is_none() && state.by_torque.is_none() {
            return ChannelHealth::Unused;
        }
        let by_torque = state.by_torque.get_or_insert(ByTorque::nothing());
        by_torque.silent_s = by_torque.silent_s + dt_s;
        let Some(reading) = given.filter(AccelerationReading::is_possible) else {
            return match given {
                Some(_) => ChannelHealth::Refused,
                None if by_torque.silent_s > T::of(LOST_S) => ChannelHealth::Lost,
                None => ChannelHealth::Absent,
            };
        };
        let since_s = core::mem::replace(&mut by_torque.silent_s, T::zero());
        if !by_torque.is_new(reading.value, since_s) {
            return ChannelHealth::Refused;
        }
        let running = state.running.as_ref().filter(|running| running.shift.is_none());
        let by_power = running.filter(|running| running.slow_n_m > T::of(DRIVES_N_M)).and_then(|running| {
            let gear = self.tables.gear(running.gear)?;
            // What the inertia of the gearbox takes does not reach the wheels.
            let of_gearbox = gear.inertia_kg_m2 * square(self.driveline.final_ratio);
            let left = self.wheels_kg_m2 / (self.wheels_kg_m2 + of_gearbox);
            let shaft_n_m = left * gear.ratio * self.driveline.final_ratio * running.slow_n_m;
            Some(self.acceleration.per_torque[0] * shaft_n_m)
        });
        by_torque.take(by_power.map(|by_power| [reading.value, by_power]), since_s);
        match by_torque.scale(&self.acceleration) {
            Some(_) => ChannelHealth::Good,
            None if by_torque.square < T::of(ENOUGH) => ChannelHealth::Absent,
            None => ChannelHealth::Refused,
        }
    }

    /// The reading of the longitudinal acceleration, if it was found good.
    pub(super) fn acceleration(
        &self,
        state: &GearboxState<T>,
        input: &ShiftInput<T>,
        health: ChannelHealth,
    ) -> Option<Acceleration<T>> {
        let reading = input.acceleration_m_s2.filter(|_| health == ChannelHealth::Good)?;
        let scale = state.by_torque.as_ref()?.scale(&self.acceleration)?;
        Some(Acceleration { reading, scale })
    }

    /// Takes a reading of the longitudinal acceleration against what the states give at its time. The health is that of the channel without it.
    pub(super) fn take_acceleration(
        &self,
        running: &mut Running<T>,
        (acceleration, health): (Option<&Acceleration<T>>, ChannelHealth),
        rates: &Rates<T>,
        dt_s: T,
    ) -> ChannelHealth {
        if acceleration.is_none() && running.x.bias.is_none() {
            return health;
        }
        let sensor = &self.acceleration;
        let (now, rate) = self.specific_force(rates);
        let felt_m_s2 = running.x.value(&now);
        let in_gear = running.shift.is_none();
        let felt = running.felt.get_or_insert(Felt::nothing(sensor));
        if running.x.bias.is_none() {
            felt.begin(felt_m_s2, running.x.value(&rate.0) + rate.1);
            let unseen = square(sensor.scale_fraction * felt_m_s2);
            running.x.bias = Some(Bias::independent(square(sensor.bias_m_s2) + unseen));
        }
        let [drives, coasts] = WALKS.map(T::of);
        let walk = if running.slow_n_m < T::of(DRIVES_N_M) { coasts } else { drives };
        let grown = felt.reach_out(felt_m_s2, dt_s);
        if let Some(bias) = &mut running.x.bias {
            let unseen = acceleration.map_or(square(sensor.scale_fraction), |of| of.scale[1]);
            bias.walk(square(walk) * dt_s + unseen * grown);
        }
        felt.rate.1 = felt.rate.1 + dt_s;
        // While both clutches slip the speeds show the torques.
        let both_slip = running.phase.phase == ShiftPhase::BothSlip;
        let Some(acceleration) = acceleration.filter(|_| !both_slip) else {
            return if both_slip { unused(health) } else { health };
        };
        // In a shift and while the driver may brake, an innovation has other causes.
        let is_learnt = in_gear && running.slow_n_m > T::of(DRIVES_N_M);
        self.correct_by_acceleration((&mut running.x, felt), acceleration, (&now, &rate), is_learnt)
    }

    /// The acceleration but for its bias, and its rate with the part of it that depends on no state.
    fn specific_force(&self, rates: &Rates<T>) -> ([T; N], ([T; N], T)) {
        let [per_torque, per_load] = self.acceleration.per_torque;
        let line = &self.driveline;
        let (per_twist, damped) =
            (per_torque * line.shaft_stiffness_n_m_rad, per_torque * line.shaft_damping_n_m_s_rad);
        let per_output = line.final_ratio.recip();
        let twist = |row: &mut [T; N], per: T| {
            row[OUTPUT] = row[OUTPUT] + per * per_output;
            row[WHEEL] = row[WHEEL] - per;
            row[RATE] = row[RATE] + per;
        };
        let mut now = [T::zero(); N];
        (now[SPRING], now[LOAD]) = (per_torque, per_load);
        twist(&mut now, damped);
        let mut rate = [T::zero(); N];
        for (k, per) in [(OUTPUT, damped * per_output), (WHEEL, -damped)] {
            for (rate, of) in rate.iter_mut().zip(&rates.rows[k]) {
                *rate = *rate + per * *of;
            }
        }
        twist(&mut rate, per_twist);
        (now, (rate, damped * (per_output * rates.rest[OUTPUT] - rates.rest[WHEEL])))
    }

    /// Corrects by a reading, and finds noise and delay of the sensor.
    fn correct_by_acceleration(
        &self,
        (x, felt): (&mut Gaussian<T>, &mut Felt<T>),
        Acceleration { reading, scale: [scale, _] }: &Acceleration<T>,
        (now, (by_states, rest)): (&[T; N], &([T; N], T)),
        is_learnt: bool,
    ) -> ChannelHealth {
        let sensor = &self.acceleration;
        let [late_s, late_variance] = felt.late;
        let age_s = (reading.age_s + sensor.delay_s + late_s).at_least(T::zero());
        let rate = x.value(by_states) + *rest;
        let mut row = *now;
        for (row, rate) in row.iter_mut().zip(by_states) {
            *row = *scale * (*row - age_s * *rate);
        }
        // The rate changes over the age as since the reading before.
        let (before, since_s) = core::mem::replace(&mut felt.rate, (rate, T::zero()));
        let spans = if since_s > T::zero() { (age_s / since_s).at_least(T::one()) } else { T::one() };
        let bent = T::of(0.5) * age_s * spans * (rate - before);
        let noise = felt.noise.0 + square(*scale) * (late_variance * square(rate) + square(bent));
        let bias = x.bias.as_ref().map_or(T::zero(), Bias::mean);
        let expected = *scale * (x.value(now) - age_s * rate) + bias;
        let measured = Measured { row, innovation: reading.value - expected, noise };
        let mut innovation = x.innovation_with_bias(&measured);
        let verdict = felt.gate.judge(innovation.value, innovation.variance);
        if verdict == Verdict::Refused {
            return ChannelHealth::Refused;
        }
        if is_learnt {
            felt.learn_noise(&innovation, sensor, since_s.at_most(T::of(LOST_S)));
        }
        match (verdict, &mut x.bias) {
            (Verdict::Jumped, Some(bias)) => {
                bias.walk(square(innovation.value));
                innovation = x.innovation_with_bias(&measured);
            }
            _ if is_learnt => felt.learn_delay(&innovation, *scale * rate, sensor),
            _ => {}
        }
        x.correct(&innovation);
        ChannelHealth::Good
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor(is_stated: bool) -> AccelerationReading<f64> {
        AccelerationReading {
            std_dev_m_s2: 0.1,
            bias_m_s2: 0.5,
            scale_fraction: 0.1,
            delay_s: 0.0,
            delay_std_dev_s: 0.02,
            is_stated,
            per_torque: [6e-4, 1e-5],
        }
    }

    /// A minute in which the acceleration by the torque swings by 1 m/s^2, read so at each time, s.
    fn compared(read: impl Fn(f64, f64) -> f64) -> ByTorque<f64> {
        let mut by_torque = ByTorque::nothing();
        for step in 0..6000 {
            let time_s = 0.01 * f64::from(step);
            let torque = 1.5 + time_s.sin();
            by_torque.take(Some([read(time_s, torque), torque]), 0.01);
        }
        by_torque
    }

    #[test]
    fn the_scale_is_the_slope_of_the_readings_over_the_torque() {
        for scale in [0.8, 1.0, 1.2] {
            let [found, variance] = compared(|_, torque| scale * torque + 0.3).scale(&sensor(false)).unwrap();
            assert!((found - scale).abs() < 0.02 && variance <= SCALE_LEFT * SCALE_LEFT, "{scale}: {found} {variance}");
        }
        for wrong in [-1.0, 0.0, 0.1, 3.0] {
            assert_eq!(compared(|_, torque| wrong * torque).scale(&sensor(true)), None, "{wrong}");
        }
    }

    #[test]
    fn one_wrong_reading_after_a_pause_counts_little() {
        let mut by_torque = compared(|_, torque| torque);
        by_torque.take(Some([14.0, 2.0]), 25.0);
        assert!(by_torque.scale(&sensor(false)).is_some_and(|[scale, _]| (scale - 1.0).abs() < 0.05));
    }

    #[test]
    fn a_sensor_is_used_once_it_is_stated_or_has_followed_and_goes_on_in_steady_driving() {
        let nothing = ByTorque::nothing();
        assert!(nothing.scale(&sensor(false)).is_none() && nothing.scale(&sensor(true)).is_some());
        let mut by_torque = compared(|_, torque| torque);
        (0..100_000).for_each(|_| by_torque.take(Some([1.5, 1.5]), 0.01));
        assert!(by_torque.square < ENOUGH && by_torque.scale(&sensor(false)).is_some());
    }
}
