//! Super-twisting observer with implicit discretisation.
//!
//! One output, the combination of turbine and slip speed on which the clutch acts most, is estimated by
//!
//! ```text
//! ds^/dt = f + g p^ + k1 |e|^(1/2) sign(e),    dp^/dt = A22 p^ + B2 + k2/g sign(e),    e = s - s^
//! ```
//!
//! (A. Levant 1993). If the sign is evaluated at the end of the sample instead of its start, it is the solution of a
//! scalar inclusion with a closed form, and the estimate does not chatter at any sample time (B. Brogliato, A. Polyakov,
//! D. Efimov, The implicit discretization of the supertwisting sliding-mode control algorithm, IEEE TAC 65 (2020) 3707).

use drivetrain::Real;

use crate::{Estimate, Health, Phase, RigidModel, Sample, SampleEstimator, SpeedModel, Track, Tracker};

/// The observer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuperTwisting<T> {
    /// The powertrain.
    pub model: RigidModel<T>,
    /// Largest rate by which the model error of the acceleration changes, rad/s^3: torque phase, inertia phase. The
    /// gains are `k1 = 1.5 sqrt(rate)` and `k2 = 1.1 rate`.
    pub error_rate_rad_s3: [T; 2],
    /// Checks, valve and phase.
    pub tracker: Tracker<T>,
}

/// Memory of a [`SuperTwisting`] observer.
pub type SuperTwistingState<T> = Track<T, TwistingSample<T>>;

/// The last usable sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwistingSample<T> {
    phase: Phase,
    model: SpeedModel<T>,
    /// The estimated combination of speeds.
    estimated: T,
}

impl<T: Real> SuperTwisting<T> {
    /// Weights of turbine and slip speed in the output: along the clutch's influence.
    #[inline]
    fn output(model: &SpeedModel<T>, values: [T; 2]) -> T {
        let [a, b] = model.per_pressure_rad_s2_pa;
        let size = (a * a + b * b).sqrt();
        if size > T::zero() { (a * values[0] + b * values[1]) / size } else { T::zero() }
    }

    #[inline]
    fn error_rate(&self, phase: Phase) -> T {
        self.error_rate_rad_s3[usize::from(phase == Phase::InertiaPhase)]
    }

    /// The same observer in another precision.
    pub fn cast<U: Real>(&self) -> SuperTwisting<U> {
        SuperTwisting {
            model: self.model.cast(),
            error_rate_rad_s3: self.error_rate_rad_s3.map(|x| U::of(x.to_f64_exact())),
            tracker: self.tracker.cast(),
        }
    }
}

/// Solves `x + a |x|^(1/2) sign(x) + b sign(x) = y` for `x`; where `|y| <= b` the solution is zero and the sign is
/// `y / b`. Returns `(x, sign)`.
#[inline]
fn implicit<T: Real>(y: T, a: T, b: T) -> (T, T) {
    let size = y.abs() - b;
    if size <= T::zero() {
        return (T::zero(), if b > T::zero() { y / b } else { T::zero() });
    }
    let root = T::of(0.5) * ((a * a + T::of(4.0) * size).sqrt() - a);
    let sign = if y < T::zero() { -T::one() } else { T::one() };
    (sign * root * root, sign)
}

impl<T: Real> SampleEstimator<T> for SuperTwisting<T> {
    type SampleState = SuperTwistingState<T>;
    const READS_WHEEL: bool = false;

    fn tracker(&self) -> &Tracker<T> {
        &self.tracker
    }

    fn start_sample(&self) -> SuperTwistingState<T> {
        Track::new()
    }

    #[inline]
    fn step_sample(&self, state: &mut SuperTwistingState<T>, sample: &Sample<T>) -> Estimate<T> {
        let Some(interval) = self.tracker.begin(&mut state.tracker, sample) else {
            state.last = None;
            return state.estimate(None, Health::TimeRejected);
        };
        let usable = interval.speeds_valid() && interval.short;
        let integral = interval.pressure_integral(state.pressure_pa);
        let mut pressure = interval.pressure(state.pressure_pa);
        let mut estimated = None;
        if let (Some(last), true) = (state.last, usable) {
            let dt = interval.dt_s;
            let [a, b] = last.model.per_pressure_rad_s2_pa;
            let influence = (a * a + b * b).sqrt();
            let measured = Self::output(&last.model, [sample.turbine_rad_s, sample.slip_rad_s]);
            let predicted =
                last.estimated + dt * Self::output(&last.model, last.model.free_rad_s2) + influence * integral;
            let rate = self.error_rate(last.phase);
            let (k1, k2) = (T::of(1.5) * rate.sqrt(), T::of(1.1) * rate);
            // e+ = (measured - predicted) - dt k1 |e+|^(1/2) sign(e+) - dt^2 k2 sign(e+)
            let (error, sign) = implicit(measured - predicted, dt * k1, dt * dt * k2);
            if influence > T::zero() {
                pressure = pressure + dt * k2 / influence * sign;
            }
            estimated = Some((last, measured - error));
        }
        let settled = state.settle(&self.tracker.limits, pressure);
        if interval.speeds_valid() {
            self.observe(state, interval.dt_s, sample, estimated);
        } else {
            state.last = None;
        }
        state.estimate(None, interval.health.max(settled))
    }
}

impl<T: Real> SuperTwisting<T> {
    #[inline]
    fn observe(
        &self,
        state: &mut SuperTwistingState<T>,
        dt: T,
        sample: &Sample<T>,
        estimated: Option<(TwistingSample<T>, T)>,
    ) {
        let (engine, turbine, slip) = (sample.engine_rad_s, sample.turbine_rad_s, sample.slip_rad_s);
        let (_, acting) = self.tracker.phase(&mut state.tracker, dt, sample);
        state.last = matches!(acting, Phase::TorquePhase | Phase::InertiaPhase).then(|| {
            let model = self.model.speed_model(acting, engine, turbine, slip);
            // With the phase or the direction of the slip the output becomes another one.
            let same = |last: &TwistingSample<T>| last.phase == acting && last.model.direction == model.direction;
            let estimated = match estimated {
                Some((last, speed)) if same(&last) && speed.is_finite() => speed,
                _ => Self::output(&model, [turbine, slip]),
            };
            TwistingSample { phase: acting, model, estimated }
        });
        state.clutch_torque_n_m = self.model.clutch_torque(acting, state.pressure_pa, engine, turbine, slip);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_implicit_step_solves_its_inclusion() {
        for y in [-3.0_f64, -0.2, 0.0, 0.05, 0.11, 7.0] {
            let (a, b) = (0.4, 0.1);
            let (x, sign) = implicit(y, a, b);
            assert!((x + a * x.abs().sqrt() * x.signum() * f64::from(x != 0.0) + b * sign - y).abs() < 1e-12, "{y}");
            assert!(sign.abs() <= 1.0 && (x == 0.0 || sign == x.signum()));
        }
    }
}
