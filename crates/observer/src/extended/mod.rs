//! Extended Kalman filter on the powertrain with elastic shafts and unknown torques.
//!
//! States: turbine speed `w_t`, output speed `w_0`, torque `T_k` of the shafts' spring, pressure `p`, fraction `e` by which
//! the turbine torque differs from the converter's maps, torque `T_ca` of the offgoing clutch.
//!
//! ```text
//! dw_t/dt = C11 (1+e) T_t + C12 T_ca + C13 T_cb(p) + C14 T_s/i_df        dT_k/dt = K_s (w_0/i_df - w_w)
//! dw_0/dt =  the output row of the same                                  dp/dt = (-p + K_cv u)/tau_cv
//! T_s = T_k + C_s (w_0/i_df - w_w)                                       e, T_ca: random walks
//! ```
//!
//! It differs from the reduced-order observers in four points. The wheel speed is an sample of the twist and not an
//! output, so mass, grade and tyre slip are not needed. The offgoing clutch's torque is a state, so the same
//! equations hold in torque and inertia phase, and a late detection of the phase has no effect. Before the shift,
//! shaft torque and turbine torque are found together; an error that both share cancels in the clutch torque
//! afterwards. A reading of a toothed wheel is delayed by a few milliseconds: it is compared with the speed at the
//! time of the reading, not with the newest speed.

mod passage;

use drivetrain::{Engagement, Real, ShiftCoefficients, clutch::direction};

use passage::{Passage, spread};

use crate::{CompliantModel, Estimate, Health, Interval, Phase, Sample, SampleEstimator, Track, Tracker};

/// Time over which the acceleration of the wheels is averaged, s.
const WHEEL_AVERAGE_S: f64 = 0.05;

/// Standard deviation of the speeds' model over a sample, in standard deviations of a reading \[chosen\]: small beside it.
const MODEL_FRACTION: f64 = 0.1;

/// Standard deviations beside their own size that shaft and offgoing torque may begin with, N m \[chosen\].
const SHAFT_START_N_M: f64 = 100.0;
const OFFGOING_START_N_M: f64 = 50.0;

/// Age beyond which a reading is taken to be no older, in samples.
const OLDEST_SAMPLES: f64 = 20.0;

pub(crate) const N: usize = 6;
const TURBINE: usize = 0;
const OUTPUT: usize = 1;
const SPRING: usize = 2;
pub(crate) const PRESSURE: usize = 3;
const FRACTION: usize = 4;
const OFFGOING: usize = 5;

/// Standard deviations of what the filter does not know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterNoise<T> {
    /// Of a reading of the turbine speed, rad/s.
    pub turbine_rad_s: T,
    /// Of a reading of the output speed, rad/s.
    pub output_rad_s: T,
    /// Of a reading of the wheel speed, rad/s.
    pub wheel_rad_s: T,
    /// Of the turbine torque, as a fraction.
    pub turbine_share: T,
    /// Time after which that fraction is another during a shift, s.
    pub turbine_share_s: T,
    /// Of the rate of twist outside a shift, rad/s: with it the shaft torque follows the turbine torque.
    pub twist_rate_rad_s: T,
    /// Output speed below which readings of toothed wheels are too old to be used, rad/s.
    pub output_least_rad_s: T,
    /// Of the rate of the pressure while it moves, as a fraction of that rate: errors of lag and delay.
    pub valve_moving: T,
    /// The same at rest, as a fraction of the pressure, 1/s: an error of the gain.
    pub valve_resting_per_s: T,
    /// Time for which an error of the rate persists, s. The filter takes it as white noise of the same power.
    pub valve_rate_s: T,
    /// How fast the torque of the offgoing clutch changes while it holds, N m per root second.
    pub offgoing_n_m: T,
    /// Time constant with which it goes once the clutch has let go, s.
    pub offgoing_release_s: T,
}

impl<T: Real> FilterNoise<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> FilterNoise<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        FilterNoise {
            turbine_rad_s: to(self.turbine_rad_s),
            output_rad_s: to(self.output_rad_s),
            wheel_rad_s: to(self.wheel_rad_s),
            turbine_share: to(self.turbine_share),
            turbine_share_s: to(self.turbine_share_s),
            twist_rate_rad_s: to(self.twist_rate_rad_s),
            output_least_rad_s: to(self.output_least_rad_s),
            valve_moving: to(self.valve_moving),
            valve_resting_per_s: to(self.valve_resting_per_s),
            valve_rate_s: to(self.valve_rate_s),
            offgoing_n_m: to(self.offgoing_n_m),
            offgoing_release_s: to(self.offgoing_release_s),
        }
    }
}

/// How toothed wheels are read: the angle by which a reading lags, rad. It spans several teeth, and its middle is
/// half of them ago, as is the last tooth on average by half a pitch. Zero for a reading of the moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings<T> {
    /// Of the turbine.
    pub turbine_rad: T,
    /// Of the output.
    pub output_rad: T,
    /// Of the driven wheels.
    pub wheel_rad: T,
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtendedFilter<T> {
    /// The powertrain.
    pub model: CompliantModel<T>,
    /// Coefficients while both clutches slip; a clutch that holds does so with the torque that this takes.
    pub both: ShiftCoefficients<T>,
    /// Coefficients after lock-up.
    pub locked: ShiftCoefficients<T>,
    /// What it does not know.
    pub noise: FilterNoise<T>,
    /// How its speeds are read.
    pub readings: Readings<T>,
    /// Checks, valve and phase.
    pub tracker: Tracker<T>,
}

/// Memory of a [`ExtendedFilter`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtendedState<T> {
    track: Track<T, Running<T>>,
    shaft_torque_n_m: Option<T>,
}

/// The filter at its last usable sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Running<T> {
    pub(crate) mean: [T; N],
    pub(crate) covariance: [[T; N]; N],
    /// Low-pass filtered wheel speed, rad/s: its difference to the speed gives the acceleration.
    slow_wheel: T,
    /// How fast the pressure moves or moved a while ago, Pa/s.
    pub(crate) motion_pa_s: T,
    last: Sample<T>,
    acting: Phase,
    /// Whether it has taken a reading since it began.
    filters: bool,
}

impl<T: Real> ExtendedFilter<T> {
    /// The filter of this powertrain.
    pub fn new(model: CompliantModel<T>, noise: FilterNoise<T>, readings: Readings<T>, tracker: Tracker<T>) -> Self {
        let of = |engagement| model.shift.coefficients(engagement);
        let (both, locked) = (of(Engagement::BothSlipping), of(Engagement::OncomingStuck));
        Self { both, locked, model, noise, readings, tracker }
    }

    /// Age of a reading that lags by this angle at this speed, s.
    #[inline]
    fn age(&self, lag_rad: T, speed_rad_s: T) -> T {
        lag_rad / speed_rad_s.abs().at_least(self.noise.output_least_rad_s)
    }

    /// The same filter in another precision.
    pub fn cast<U: Real>(&self) -> ExtendedFilter<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        let Readings { turbine_rad, output_rad, wheel_rad } = self.readings;
        let readings = Readings { turbine_rad: to(turbine_rad), output_rad: to(output_rad), wheel_rad: to(wheel_rad) };
        ExtendedFilter::new(self.model.cast(), self.noise.cast(), readings, self.tracker.cast())
    }

    /// Shaft torque in balance with a turbine torque in the gear before the shift, N m.
    #[inline]
    fn shaft_before(&self, turbine_n_m: T) -> T {
        turbine_n_m * self.model.shift.ratio_offgoing() * self.model.rigid.driveline.final_ratio
    }

    /// The first estimate: the gear before the shift in balance, an empty cylinder.
    fn begin(&self, pressure_pa: T, sample: &Sample<T>) -> Running<T> {
        let (zero, noise) = (T::zero(), &self.noise);
        let output = self.model.shift.output_speed(sample.turbine_rad_s, sample.slip_rad_s);
        let torque = self.model.rigid.converter.torques(sample.engine_rad_s, sample.turbine_rad_s).turbine_n_m;
        let line = &self.model.rigid.driveline;
        let held = &self.model.torque_phase.holding_offgoing;
        let shaft = self.shaft_before(torque);
        let holding = held.per_turbine_torque * torque + held.per_output_torque * shaft / line.final_ratio;
        let mut covariance = [[zero; N]; N];
        // Starting out of balance costs a few swings of the shafts: as much as the torque itself is allowed.
        let std_devs = [
            noise.turbine_rad_s,
            noise.output_rad_s,
            shaft.abs() + T::of(SHAFT_START_N_M),
            T::of(1e3),
            zero,
            holding.abs() + T::of(OFFGOING_START_N_M),
        ];
        for (i, std_dev) in std_devs.into_iter().enumerate() {
            covariance[i][i] = std_dev * std_dev;
        }
        let mean = [sample.turbine_rad_s, output, shaft, pressure_pa, zero, holding];
        // Whatever phase it begins in is entered from here.
        let acting = Phase::BeforeShift;
        let slow_wheel = sample.wheel_rad_s;
        Running { mean, covariance, slow_wheel, motion_pa_s: zero, last: *sample, acting, filters: false }
    }

    /// Follows the wheel speed and the motion of the pressure over the interval that ends with `sample`.
    #[inline]
    pub(crate) fn follow(&self, running: &mut Running<T>, interval: &Interval<T>, sample: &Sample<T>) {
        let wheel = T::of(0.5) * (running.last.wheel_rad_s + sample.wheel_rad_s);
        let fraction = (interval.dt_s / T::of(WHEEL_AVERAGE_S)).at_most(T::one());
        running.slow_wheel = running.slow_wheel + fraction * (wheel - running.slow_wheel);
        let rate = interval.start_rate(running.mean[PRESSURE]).abs();
        running.motion_pa_s = rate.at_least(running.motion_pa_s * lasting(interval.dt_s, self.noise.valve_rate_s));
    }

    /// What the powertrain does over the interval that ends with `sample`.
    #[inline]
    pub(crate) fn passage(&self, running: &Running<T>, interval: &Interval<T>, sample: &Sample<T>) -> Passage<T> {
        let (one, half) = (T::one(), T::of(0.5));
        let (dt, last, noise) = (interval.dt_s, running.last, &self.noise);
        let locked = running.acting == Phase::AfterShift;
        let rigid = &self.model.rigid;
        let (line, clutch) = (&rigid.driveline, &rigid.clutch);

        // The wheel's readings are as old as its teeth are apart; over that time it went on as it does on average.
        let wheel = half * (last.wheel_rad_s + sample.wheel_rad_s);
        let wheel_rate = (wheel - running.slow_wheel) / T::of(WHEEL_AVERAGE_S);
        let wheel_rad_s = wheel + self.age(self.readings.wheel_rad, wheel) * wheel_rate;

        // Shaft torque over the interval: T_k + h (w_0 + w_0+) - u w_w.
        let (ratio, stiffness) = (line.final_ratio, line.shaft_stiffness_n_m_rad);
        let h = (T::of(0.25) * stiffness * dt + half * line.shaft_damping_n_m_s_rad) / ratio;
        let mut rows =
            if locked { [self.locked.turbine, self.locked.output] } else { [self.both.turbine, self.both.output] };
        if locked {
            rows[0].per_offgoing_torque = T::zero();
            rows[1].per_offgoing_torque = T::zero();
        }
        let shaft = [rows[0].per_output_torque / ratio, rows[1].per_output_torque / ratio];
        let shifting = matches!(running.acting, Phase::TorquePhase | Phase::InertiaPhase);
        let released = matches!(running.acting, Phase::InertiaPhase | Phase::AfterShift);
        Passage {
            interval: *interval,
            rows,
            shaft,
            turbine_n_m: rigid.converter.torques(last.engine_rad_s, last.turbine_rad_s).turbine_n_m,
            per_pressure: if locked {
                T::zero()
            } else {
                direction(last.slip_rad_s) * clutch.torque_per_force(last.slip_rad_s) * clutch.piston_area_m2
            },
            kiss_pa: clutch.kiss_pressure(),
            wheel_rad_s,
            h,
            u: half * stiffness * dt + line.shaft_damping_n_m_s_rad,
            turn: half * stiffness * dt / ratio,
            twist: stiffness * dt,
            solve: one / (one - dt * shaft[1] * h),
            stay: if running.acting == Phase::InertiaPhase { lasting(dt, noise.turbine_share_s) } else { one },
            keep: if released { lasting(dt, noise.offgoing_release_s) } else { one },
            released,
            shifting,
        }
    }

    /// Carries mean and covariance over the interval.
    #[inline]
    fn predict(&self, running: &mut Running<T>, interval: &Interval<T>, sample: &Sample<T>) -> Start<T> {
        self.follow(running, interval, sample);
        let c = self.passage(running, interval, sample);
        let x = running.mean;
        let (above, slope) = c.tangent(x[PRESSURE]);
        let next = c.propagate(&x, above);
        let f = c.derivative(slope);
        running.mean = next;
        let p = &running.covariance;
        let within = [[p[TURBINE][TURBINE], p[TURBINE][OUTPUT]], [p[OUTPUT][TURBINE], p[OUTPUT][OUTPUT]]];
        let across = spread(&mut running.covariance, &f, &[interval.valve.phi, c.stay, c.keep]);
        for (i, variance) in self.added(&c, &x, running.motion_pa_s).into_iter().enumerate() {
            running.covariance[i][i] = running.covariance[i][i] + variance;
        }
        Start { mean: [x[TURBINE], x[OUTPUT]], within, across }
    }

    /// Variances that an interval adds.
    #[inline]
    pub(crate) fn added(&self, c: &Passage<T>, x: &[T; N], motion_pa_s: T) -> [T; N] {
        let (zero, one, noise) = (T::zero(), T::one(), &self.noise);
        let square = |x: T| x * x;
        let dt = c.interval.dt_s;
        [
            square(T::of(MODEL_FRACTION) * noise.turbine_rad_s),
            square(T::of(MODEL_FRACTION) * noise.output_rad_s),
            square(c.twist)
                * (square(noise.wheel_rad_s) + if c.shifting { zero } else { square(noise.twist_rate_rad_s) }),
            T::of(2.0)
                * dt
                * noise.valve_rate_s
                * (square(noise.valve_moving * motion_pa_s) + square(noise.valve_resting_per_s * x[PRESSURE])),
            square(noise.turbine_share) * (one - square(c.stay)),
            // How fast it drains is not known: the rate may be wrong by its own size for as long as it lasts.
            if c.released {
                T::of(2.0) * dt / noise.offgoing_release_s * square(x[OFFGOING])
            } else {
                dt * square(noise.offgoing_n_m)
            },
        ]
    }

    /// Before the inertia phase the turbine torque is what the maps say, and the shaft torque follows from it: an
    /// error of the one is an error of the other, cancels in the clutch torque, and no speed tells it. Once both
    /// clutches slip it shows: it is let in as what it is, one error of both.
    #[inline]
    fn change_phase(&self, running: &mut Running<T>, acting: Phase) {
        let (before, now) = (running.acting == Phase::InertiaPhase, acting == Phase::InertiaPhase);
        running.acting = acting;
        let zero = T::zero();
        if before && !now {
            running.mean[FRACTION] = zero;
            for i in 0..N {
                running.covariance[FRACTION][i] = zero;
                running.covariance[i][FRACTION] = zero;
            }
        }
        if now && !before {
            let last = &running.last;
            let turbine_n_m = self.model.rigid.converter.torques(last.engine_rad_s, last.turbine_rad_s).turbine_n_m;
            let shaft = self.shaft_before(turbine_n_m);
            let together = [zero, zero, shaft, zero, T::one(), zero].map(|x| x * self.noise.turbine_share);
            for (row, a) in running.covariance.iter_mut().zip(together) {
                for (p, b) in row.iter_mut().zip(together) {
                    *p = *p + a * b;
                }
            }
        }
    }

    /// Takes the readings of turbine and output speed. They are as old as their teeth are apart, so each is a mean of
    /// the speeds at both ends of the interval, and what the speeds at its start have to do with the states at its
    /// end matters.
    ///
    /// One after the other: the inverse of their joint covariance cancels in single precision.
    #[inline]
    fn correct(&self, running: &mut Running<T>, start: &mut Start<T>, interval: &Interval<T>, sample: &Sample<T>) {
        let one = T::one();
        let output = self.model.shift.output_speed(sample.turbine_rad_s, sample.slip_rad_s);
        let readings = [
            (sample.turbine_rad_s, self.readings.turbine_rad, self.noise.turbine_rad_s),
            (output, self.readings.output_rad, self.noise.output_rad_s),
        ];
        for (k, (reading, lag_rad, std_dev)) in readings.into_iter().enumerate() {
            let p = &mut running.covariance;
            // An age of many samples is cut: so far back the line through both ends does not reach.
            let old = (self.age(lag_rad, reading) / interval.dt_s).at_most(T::of(OLDEST_SAMPLES));
            let new = one - old;
            // Covariance of the states at the end with the reading.
            let with_reading: [T; N] = core::array::from_fn(|i| new * p[k][i] + old * start.across[i][k]);
            let start_with_reading = |m: usize| new * start.across[k][m] + old * start.within[m][k];
            let variance = new * with_reading[k] + old * start_with_reading(k) + std_dev * std_dev;
            let per_surprise = variance.recip();
            let surprise = (reading - new * running.mean[k] - old * start.mean[k]) * per_surprise;
            let gain = with_reading.map(|x| x * per_surprise);
            if k == TURBINE {
                // What the output's reading needs of the speeds at the start.
                let other = start_with_reading(OUTPUT);
                start.mean[OUTPUT] = start.mean[OUTPUT] + other * surprise;
                start.within[OUTPUT][OUTPUT] = start.within[OUTPUT][OUTPUT] - other * per_surprise * other;
                for (across, gain) in start.across.iter_mut().zip(gain) {
                    across[OUTPUT] = across[OUTPUT] - gain * other;
                }
            }
            for i in 0..N {
                running.mean[i] = running.mean[i] + with_reading[i] * surprise;
                for j in i..N {
                    let value = p[i][j] - gain[i] * with_reading[j];
                    p[i][j] = value;
                    p[j][i] = value;
                }
            }
        }
    }
}

/// Turbine and output speed at the start of an interval, as the states at its end have to do with them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Start<T> {
    pub(crate) mean: [T; 2],
    /// Their covariance.
    pub(crate) within: [[T; 2]; 2],
    /// Covariance of the states at the end with them.
    pub(crate) across: [[T; 2]; N],
}

/// What is left after `dt_s` of a random number that lasts for a time, as implicit Euler has it.
#[inline]
fn lasting<T: Real>(dt_s: T, time_s: T) -> T {
    time_s / (time_s + dt_s)
}

impl<T: Real> SampleEstimator<T> for ExtendedFilter<T> {
    type SampleState = ExtendedState<T>;
    const READS_WHEEL: bool = true;

    fn tracker(&self) -> &Tracker<T> {
        &self.tracker
    }

    fn start_sample(&self) -> ExtendedState<T> {
        ExtendedState::new()
    }

    #[inline]
    fn step_sample(&self, state: &mut ExtendedState<T>, sample: &Sample<T>) -> Estimate<T> {
        self.step_by(state, sample, Self::predict)
    }
}

impl<T: Real> ExtendedFilter<T> {
    /// One sample, with the prediction of choice.
    #[inline]
    pub(crate) fn step_by(
        &self,
        state: &mut ExtendedState<T>,
        sample: &Sample<T>,
        predict: impl Fn(&Self, &mut Running<T>, &Interval<T>, &Sample<T>) -> Start<T>,
    ) -> Estimate<T> {
        let Some(mut interval) = self.tracker.begin(&mut state.track.tracker, sample) else {
            state.lose();
            return state.estimate(Health::TimeRejected);
        };
        if !self.tracker.limits.wheel_valid(sample) {
            interval.health = Health::SpeedsRejected;
        }
        let limits = &self.tracker.limits;
        let mut health = state.track.settle(limits, interval.pressure(state.track.pressure_pa));
        let output = self.model.shift.output_speed(sample.turbine_rad_s, sample.slip_rad_s);
        let usable = interval.speeds_valid() && interval.short && output > self.noise.output_least_rad_s;
        if !usable {
            // The twist is lost over a gap; the pressure goes on by the valve model.
            state.lose();
        }
        if interval.speeds_valid() {
            health = self.take(state, &mut interval, sample, predict);
        }
        state.estimate(interval.health.max(health))
    }

    #[inline]
    fn take(
        &self,
        state: &mut ExtendedState<T>,
        interval: &mut Interval<T>,
        sample: &Sample<T>,
        predict: impl Fn(&Self, &mut Running<T>, &Interval<T>, &Sample<T>) -> Start<T>,
    ) -> Health {
        let (_, acting) = self.tracker.phase(&mut state.track.tracker, interval.dt_s, sample);
        let limits = &self.tracker.limits;
        let mut running = match state.track.last {
            Some(mut running) if interval.dt_s > T::zero() => {
                let mut start = predict(self, &mut running, interval, sample);
                let predicted = running.mean[PRESSURE];
                self.correct(&mut running, &mut start, interval, sample);
                running.filters = true;
                interval.corrected(predicted, running.mean[PRESSURE] - predicted, limits);
                if !interval.speeds_valid() {
                    state.lose();
                    return Health::Good;
                }
                running
            }
            _ => self.begin(state.track.pressure_pa, sample),
        };
        if !(running.is_sound() && limits.shaft_torque_possible(running.mean[SPRING])) {
            state.track.lost = true;
            running = self.begin(state.track.tracker.valve_pressure_pa, sample);
        }
        let health = state.track.settle(limits, running.mean[PRESSURE]).max(state.track.restart());
        running.mean[PRESSURE] = state.track.pressure_pa;
        running.last = *sample;
        self.change_phase(&mut running, acting);
        let line = &self.model.rigid.driveline;
        let rate = line.twist_rate(running.mean[OUTPUT], sample.wheel_rad_s);
        let shaft = running.mean[SPRING] + line.shaft_damping_n_m_s_rad * rate;
        state.shaft_torque_n_m =
            Some(shaft.at_least(-limits.shaft_torque_max_n_m).at_most(limits.shaft_torque_max_n_m));
        state.track.clutch_torque_n_m = self.model.rigid.clutch_torque(
            acting,
            running.mean[PRESSURE],
            sample.engine_rad_s,
            sample.turbine_rad_s,
            sample.slip_rad_s,
        );
        state.track.last = Some(running);
        health
    }
}

impl<T: Real> Running<T> {
    /// Whether mean and covariance are numbers, and no variance is negative.
    #[inline]
    fn is_sound(&self) -> bool {
        let variances = self.covariance.iter().enumerate().map(|(i, row)| row[i]);
        self.mean.iter().all(|x| x.is_finite()) && variances.into_iter().all(|v| v >= T::zero() && v.is_finite())
    }
}

impl<T: Real> ExtendedState<T> {
    pub(crate) fn new() -> Self {
        Self { track: Track::new(), shaft_torque_n_m: None }
    }

    /// Resets the twist and all other states from readings, except the pressure.
    fn lose(&mut self) {
        // At low speed every sample starts again, so no state is lost.
        self.track.lost |= self.track.last.is_some_and(|running| running.filters);
        self.track.last = None;
        self.shaft_torque_n_m = None;
    }

    fn estimate(&self, health: Health) -> Estimate<T> {
        self.track.estimate(self.shaft_torque_n_m, health)
    }
}
