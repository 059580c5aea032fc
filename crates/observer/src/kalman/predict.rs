//! The prediction over a step, and the first state.

use drivetrain::{Converter, Real, clutch::direction};

use super::covariance::Covariance;
use super::engine::Engine;
use super::gate::Gate;
use super::past::Past;
use super::powertrain::Step;
use super::states::{
    DELAY, FIRST_S, FRACTION, FRICTION, GAIN, LEARNT, LOAD, N, OFFGOING, OUTPUT, PRESSURE, SCALE, SKEW, SPRING,
    TURBINE, WHEEL,
};
use super::{KalmanFilter, KalmanState, Running};
use crate::Phase;

/// Innovation beyond which a reading is refused, in its standard deviations.
const GATE: u8 = 4;
/// Standard deviations that the filter begins with \[chosen\]: of the wheel speed about the output's, rad/s; of shaft, offgoing and load
/// torque, as a fraction of the shaft or holding torque and beside it, N m; of the pressure of a clutch under command, as a fraction of it.
const WHEEL_START_RAD_S: f64 = 0.3;
const SHAFT_START: (f64, f64) = (0.3, 100.0);
pub(super) const OFFGOING_START: (f64, f64) = (0.5, 50.0);
const LOAD_START: (f64, f64) = (0.15, 400.0);
const PRESSURE_START: f64 = 0.3;
/// Time after which the fractions fade that do so in seconds, s: not at every step, and no multiple of a usual sample time, so that
/// rounding does not decide when.
const FADING_S: f64 = 0.0487;
/// After so long without a command the valve may have had any other, s \[chosen\]: rows of a slow log are 0.1 s apart.
pub(super) const UNHEARD_S: f64 = 0.12;
/// Standard deviation of the speeds' model over 10 ms, in standard deviations of a reading.
const MODEL_FRACTION: f64 = 0.1;

impl<T: Real> KalmanFilter<T> {
    /// The first state, once turbine, output and engine speed are known.
    pub(super) fn begin(&self, state: &KalmanState<T>) -> Option<Running<T>> {
        let (zero, u) = (T::zero(), &self.uncertainty);
        let first = |k: usize| state.newest[k].filter(|&(_, age_s)| age_s <= T::of(FIRST_S)).map(|(value, _)| value);
        let (turbine, output, engine) = (first(TURBINE)?, first(OUTPUT)?, state.engine.as_ref()?);
        if output <= u.output_least_rad_s {
            return None;
        }
        let (model, line) = (&self.model, &self.model.rigid.driveline);
        let acting = self.first_phase(state, turbine, output);
        let torque = model.rigid.converter.torques(engine.speed_before(zero), turbine).turbine_n_m;
        let ratio =
            if acting == Phase::AfterShift { model.shift.ratio_oncoming() } else { model.shift.ratio_offgoing() };
        let shaft = torque * ratio * line.final_ratio;
        let offgoing = if acting == Phase::AfterShift { zero } else { self.holding(torque, shaft) };
        let load = model.rigid.road.wheel_torque(output / line.final_ratio);
        // The readings are old; since then the car has gone on to accelerate, as the torques say.
        let wheel_rad_s2 = (shaft - load) / (model.rigid.road.inertia_at_wheel() + line.wheel_inertia_kg_m2);
        let output_rad_s2 = wheel_rad_s2 * line.final_ratio;
        let accelerations = [output_rad_s2 * ratio, output_rad_s2, wheel_rad_s2];
        let ages = [(TURBINE, turbine), (OUTPUT, output)].map(|(k, speed)| {
            let sensor = &self.readings[k];
            let read_s = state.newest[k].map_or(zero, |(_, age_s)| age_s);
            read_s + sensor.delay_s + sensor.lag_rad / speed.abs().at_least(u.output_least_rad_s)
        });
        let mut mean = [zero; N];
        mean[TURBINE] = turbine + ages[TURBINE] * accelerations[TURBINE];
        mean[OUTPUT] = output + ages[OUTPUT] * accelerations[OUTPUT];
        mean[WHEEL] = mean[OUTPUT] / line.final_ratio;
        mean[SPRING] = shaft;
        mean[PRESSURE] = state.valve_pa;
        mean[OFFGOING] = offgoing;
        mean[LOAD] = load;
        // In a shift, or on a hill, the acceleration is another one.
        let old = [TURBINE, OUTPUT].map(|k| (ages[k] + u.skew_s) * accelerations[k]);
        let mut covariance = self.first_covariance(&mean, old, acting);
        if let Some((learnt, block)) = &state.learnt {
            for (a, i) in LEARNT.into_iter().enumerate() {
                mean[i] = learnt[a];
                for (b, j) in LEARNT.into_iter().enumerate() {
                    covariance.set(i, j, block[a][b]);
                }
            }
        }
        let past = Past::steady([mean[TURBINE], mean[OUTPUT], mean[WHEEL]], accelerations);
        // On a hill, or in a shift, the acceleration is another one.
        covariance.steady_past(past.age_s(), accelerations.map(|acceleration| acceleration * acceleration));
        Some(Running {
            mean,
            covariance,
            past,
            kept: 0,
            unfaded_s: zero,
            motion_pa_s: zero,
            is_unheard: false,
            acting,
            direction: direction(model.shift.oncoming_slip(turbine, output)),
            turned_s: zero,
            flares_s: zero,
            gates: [Gate::new(GATE).ended_by_agreement(); 3],
            silent_s: [zero; 3],
            squared_innovations: [None; 3],
        })
    }

    /// The first covariance; the readings of turbine and output speed are old by this, rad/s.
    fn first_covariance(&self, mean: &[T; N], old_rad_s: [T; 2], acting: Phase) -> Covariance<T> {
        let (u, shaft) = (&self.uncertainty, mean[SPRING]);
        let mut std_devs = [T::zero(); N];
        for k in [TURBINE, OUTPUT] {
            std_devs[k] = hypot(self.readings[k].std_dev_rad_s, old_rad_s[k]);
        }
        // Out of balance the shafts swing, at the start of a log as much as the torque itself.
        std_devs[WHEEL] = T::of(WHEEL_START_RAD_S);
        std_devs[SPRING] = at_start(SHAFT_START, shaft);
        std_devs[PRESSURE] = self.first_pressure_std_dev(acting, mean[PRESSURE]);
        std_devs[FRACTION] = u.turbine_share;
        std_devs[OFFGOING] = at_start(OFFGOING_START, mean[OFFGOING]);
        std_devs[LOAD] = at_start(LOAD_START, shaft);
        std_devs[FRICTION] = u.friction;
        std_devs[GAIN] = u.valve_gain;
        std_devs[SCALE] = u.wheel_scale;
        // A uniform distribution between its limits, about zero.
        let [minimum, maximum] = u.wheel_delay_s;
        std_devs[DELAY] =
            ((maximum * maximum * maximum - minimum * minimum * minimum) / (T::of(3.0) * (maximum - minimum))).sqrt();
        std_devs[SKEW] = u.skew_s / T::of(3.0).sqrt();
        let mut covariance = Covariance::of(std_devs);
        // An error of the turbine torque is one of the shaft torque in balance with it.
        let shared = u.turbine_share * u.turbine_share * shaft;
        covariance.set(SPRING, FRACTION, shared);
        covariance.add(SPRING, shared * shaft);
        covariance
    }

    /// Torque by which the offgoing clutch holds the gear before the shift, N m.
    pub(super) fn holding(&self, turbine_n_m: T, shaft_n_m: T) -> T {
        let held = &self.model.torque_phase.holding_offgoing;
        held.per_turbine_torque * turbine_n_m
            + held.per_output_torque * shaft_n_m / self.model.rigid.driveline.final_ratio
    }

    /// An open cylinder is empty; of one under pressure the command before the log is not known.
    fn first_pressure_std_dev(&self, acting: Phase, pressure_pa: T) -> T {
        let known = T::of(1e3);
        if acting == Phase::BeforeShift { known } else { known + T::of(PRESSURE_START) * pressure_pa }
    }

    /// Carries mean and covariance over a step, under commands that end at `settled_pa`. Where the slip of the oncoming
    /// clutch ends within the step, it is locked from there on.
    #[inline]
    pub(super) fn predict(&self, running: &mut Running<T>, engine: &Engine<T>, settled_pa: T, dt_s: T) {
        let shift = &self.model.shift;
        if running.acting == Phase::InertiaPhase {
            let slip = shift.oncoming_slip(running.mean[TURBINE], running.mean[OUTPUT]);
            let [turbine, output] = [TURBINE, OUTPUT].map(|k| running.past.accelerations(k, running.mean[k])[0]);
            let rate = shift.oncoming_slip(turbine, output);
            let until_s = -slip / rate;
            if until_s > T::zero() && until_s < dt_s {
                self.advance(running, engine, settled_pa, [until_s, dt_s - until_s]);
                running.acting = Phase::AfterShift;
                self.advance(running, engine, settled_pa, [dt_s - until_s, T::zero()]);
                return;
            }
        }
        self.advance(running, engine, settled_pa, [dt_s, T::zero()]);
    }

    /// A step in one phase, that ends `left_s` before now.
    #[inline]
    fn advance(&self, running: &mut Running<T>, engine: &Engine<T>, settled_pa: T, [dt_s, left_s]: [T; 2]) {
        let x = running.mean;
        let remembered = running.past.is_due();
        if remembered {
            running.past.remember([x[TURBINE], x[OUTPUT], x[WHEEL]]);
            running.kept = 0;
        }
        running.unfaded_s = running.unfaded_s + dt_s;
        let step = self.step_of(running, engine, settled_pa, dt_s, left_s);
        if running.unfaded_s >= T::of(FADING_S) {
            running.unfaded_s = T::zero();
        }
        running.mean = step.propagate(&x);
        running.covariance.spread(&step.tangent(&x, &running.mean), remembered);
        self.add_noise(running, engine, &step, &x, settled_pa);
        running.past.pass(dt_s);
        for silent_s in &mut running.silent_s {
            *silent_s = *silent_s + dt_s;
        }
    }

    /// The step with coefficients frozen at its start.
    #[inline]
    fn step_of(&self, running: &Running<T>, engine: &Engine<T>, settled_pa: T, dt_s: T, left_s: T) -> Step<T> {
        let (zero, one, half, u) = (T::zero(), T::one(), T::of(0.5), &self.uncertainty);
        let x = &running.mean;
        let locked = running.acting == Phase::AfterShift;
        let rigid = &self.model.rigid;
        let (line, clutch) = (&rigid.driveline, &rigid.clutch);
        let mut rows =
            if locked { [self.locked.turbine, self.locked.output] } else { [self.both.turbine, self.both.output] };
        if locked {
            rows[0].per_offgoing_torque = zero;
            rows[1].per_offgoing_torque = zero;
        }
        let released = matches!(running.acting, Phase::InertiaPhase | Phase::AfterShift);
        let fading_s = if running.unfaded_s >= T::of(FADING_S) { running.unfaded_s } else { zero };
        let slip = self.model.shift.oncoming_slip(x[TURBINE], x[OUTPUT]);
        let valve = self.valve.step(settled_pa, x[PRESSURE], dt_s);
        let per_start = valve.psi / dt_s;
        let mean_pa = per_start * x[PRESSURE] + valve.drift_integral_pa_s / dt_s;
        let variance = running.covariance.at(PRESSURE, PRESSURE).at_least(zero);
        let (above_pa, slope) = above(mean_pa - clutch.kiss_pressure(), variance);
        let (turbine_n_m, slope_n_m_s) =
            rigid.converter.turbine_with_slope(engine.speed_before(left_s + half * dt_s), x[TURBINE]);
        Step {
            dt_s,
            rows,
            // A torque that rises with the turbine speed is taken as it is at the start: implicit it might have no solution.
            turbine: [turbine_n_m, slope_n_m_s.at_most(zero)],
            held: !released,
            // One that does not touch carries nothing.
            per_pressure: if locked || above_pa <= zero {
                zero
            } else {
                running.direction * clutch.torque_per_force(slip) * clutch.piston_area_m2
            },
            above_kiss: [above_pa, slope * per_start],
            settled_pa,
            valve,
            per_ratio: line.final_ratio.recip(),
            stiffness: line.shaft_stiffness_n_m_rad,
            damping: line.shaft_damping_n_m_s_rad,
            per_inertia: dt_s / (rigid.road.inertia_at_wheel() + line.wheel_inertia_kg_m2),
            stay: lasting(fading_s, u.turbine_share_s),
            keep: if released { lasting(dt_s, u.offgoing_release_s) } else { one },
            last: lasting(fading_s, u.clutch_s),
        }
    }

    /// Adds what the step leaves open.
    #[inline]
    fn add_noise(&self, running: &mut Running<T>, engine: &Engine<T>, step: &Step<T>, x: &[T; N], settled_pa: T) {
        let (one, two, u) = (T::one(), T::of(2.0), &self.uncertainty);
        let square = |x: T| x * x;
        let dt = step.dt_s;
        let per_10_ms = dt / T::of(0.01);
        // How the pressure moves or moved a while ago.
        let rate = ((one - step.valve.phi) * (settled_pa - x[PRESSURE]) / dt).abs();
        running.motion_pa_s = rate.at_least(running.motion_pa_s * lasting(dt, u.rate_s));
        let shifting = matches!(running.acting, Phase::TorquePhase | Phase::InertiaPhase);
        let released = matches!(running.acting, Phase::InertiaPhase | Phase::AfterShift);
        let twist_rate = x[OUTPUT] * step.per_ratio - x[WHEEL];
        let p = &mut running.covariance;
        for k in [TURBINE, OUTPUT] {
            p.add(k, per_10_ms * square(T::of(MODEL_FRACTION) * self.readings[k].std_dev_rad_s));
        }
        // Within the backlash the shafts twist without torque.
        let stiffness_fraction = if x[SPRING].abs() < u.backlash_n_m { one } else { u.stiffness_fraction };
        p.add(SPRING, two * dt * u.rate_s * square(stiffness_fraction * step.stiffness * twist_rate));
        p.add(PRESSURE, two * dt * u.rate_s * square(u.valve_fraction * running.motion_pa_s));
        if running.is_unheard {
            // Where the pressure goes is not known: what the speeds show is no error of the gain.
            p.add(PRESSURE, square((one - step.valve.phi) * T::of(0.5) * self.limits.pressure_max_pa));
        }
        if step.last < one {
            p.add(FRACTION, square(u.turbine_share) * (one - square(step.stay)));
            for (state, std_dev) in [(FRICTION, u.friction), (GAIN, u.valve_gain)] {
                p.add(state, square(std_dev) * (one - square(step.last)));
            }
        }
        // How fast it drains is not known: the rate may be wrong by its own size for as long as it lasts.
        let offgoing =
            if released { two * dt / u.offgoing_release_s * square(x[OFFGOING]) } else { dt * square(u.offgoing_n_m) };
        p.add(OFFGOING, offgoing);
        p.add(LOAD, dt * square(if shifting { u.load_shifting_n_m } else { u.load_in_gear_n_m }));
        if let Some(same_s) = engine.same_error_s() {
            // A missing engine speed leaves the turbine torque open.
            let variance = two * dt * same_s * square(self.open_torque(engine, x[TURBINE]));
            for (k, row) in [(TURBINE, &step.rows[0]), (OUTPUT, &step.rows[1])] {
                p.add(k, square(row.per_turbine_torque) * variance);
            }
        }
    }

    /// Standard deviation of the turbine torque by that of the engine speed, N m. Near the coupling point the torque is small and
    /// changes most.
    #[cold]
    fn open_torque(&self, engine: &Engine<T>, turbine_rad_s: T) -> T {
        let speed = engine.speed_before(T::zero());
        let torque = self.model.rigid.converter.turbine_with_slope(speed, turbine_rad_s);
        Converter::engine_slope(torque, speed, turbine_rad_s) * engine.variance().sqrt()
    }
}

/// A standard deviation that is a fraction of a torque and something beside it.
#[inline]
pub(super) fn at_start<T: Real>((fraction, beside): (f64, f64), torque_n_m: T) -> T {
    T::of(fraction) * torque_n_m.abs() + T::of(beside)
}

/// Length of the hypotenuse. That of the mathematical library computes in double precision.
#[inline]
pub(super) fn hypot<T: Real>(a: T, b: T) -> T {
    (a * a + b * b).sqrt()
}

/// What is left after `dt_s` of a random number that lasts for a time, as implicit Euler has it.
#[inline]
fn lasting<T: Real>(dt_s: T, time_s: T) -> T {
    time_s / (time_s + dt_s)
}

/// Mean of `max(x, 0)` and its derivative, of a normal distribution about `x` with this variance.
#[inline]
pub(super) fn above<T: Real>(x: T, variance: T) -> (T, T) {
    let near = x * x <= T::of(36.0) * variance;
    if !near {
        return if x > T::zero() { (x, T::one()) } else { (T::zero(), T::zero()) };
    }
    let std_dev = variance.sqrt();
    let z = x / std_dev.at_least(T::min_positive_value());
    let density = (T::of(-0.5) * z * z).exp() * T::of(0.398_942_280_401_432_7);
    // Abramowitz and Stegun, Handbook of Mathematical Functions (1964), 26.2.17: error below 7.5e-8.
    let t = (T::one() + T::of(0.231_641_9) * z.abs()).recip();
    let series = [1.330_274_429, -1.821_255_978, 1.781_477_937, -0.356_563_782, 0.319_381_530];
    let tail = density * series.into_iter().fold(T::zero(), |sum, c| (sum + T::of(c)) * t);
    let below = if z > T::zero() { T::one() - tail } else { tail };
    (std_dev * density + x * below, below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_above_zero_is_that_of_the_distribution() {
        // At zero: standard deviation/sqrt(2 pi), and half of the samples.
        let (mean, fraction) = above(0.0_f64, 4.0);
        assert!((mean - 2.0 * 0.398_942_28).abs() < 1e-6 && (fraction - 0.5).abs() < 1e-6);
        // One standard deviation above: 1.0833, 84.13 %.
        let (mean, fraction) = above(1.0_f64, 1.0);
        assert!((mean - 1.083_315_47).abs() < 1e-6 && (fraction - 0.841_344_75).abs() < 1e-6);
        assert_eq!(above(5.0_f64, 0.0), (5.0, 1.0));
        assert_eq!(above(-5.0_f32, 0.0), (0.0, 0.0));
        let (mean, _) = above(-3.0_f64, 1.0);
        assert!((mean - 3.821_5e-4).abs() < 1e-6);
    }
}
