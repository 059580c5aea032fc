//! The reduced-order observer with elastic drive shafts: pressure and shaft torque, Eq. (2.71)-(2.73).

use drivetrain::Real;

use crate::compliant_model::{CompliantSpeedModel, OUTPUTS};
use crate::schedule::{Mix, between};
use crate::{CompliantModel, Estimate, Health, Interval, Phase, Sample, SampleEstimator, Schedule, Track, Tracker};

/// Gains of the compliant observer on `(w_t, dw, w_w)`: first row for the shaft torque, N m per rad/s, second
/// row for the pressure, Pa per rad/s. In the torque phase the slip is no output and its column is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantGains<T> {
    /// Torque phase.
    pub torque_phase: [[T; OUTPUTS]; 2],
    /// Inertia phase.
    pub inertia_phase: [[T; OUTPUTS]; 2],
}

impl<T: Real> CompliantGains<T> {
    /// The same gains in another precision.
    pub fn cast<U: Real>(&self) -> CompliantGains<U> {
        let to = |gain: [[T; OUTPUTS]; 2]| gain.map(|row| row.map(|x| U::of(x.to_f64_exact())));
        CompliantGains { torque_phase: to(self.torque_phase), inertia_phase: to(self.inertia_phase) }
    }
}

impl<T: Real> Mix<T> for CompliantGains<T> {
    #[inline]
    fn mixed(&self, other: &Self, fraction: T) -> Self {
        let mix = |a: &[[T; OUTPUTS]; 2], b: &[[T; OUTPUTS]; 2]| {
            let mut gain = *a;
            for (row, other) in gain.iter_mut().zip(b) {
                for (x, y) in row.iter_mut().zip(other) {
                    *x = between(*x, *y, fraction);
                }
            }
            gain
        };
        Self {
            torque_phase: mix(&self.torque_phase, &other.torque_phase),
            inertia_phase: mix(&self.inertia_phase, &other.inertia_phase),
        }
    }
}

/// The compliant reduced-order observer.
///
/// As the rigid one, with `z = (T_s, p)`: `A22 = diag(0, -1/tau_cv)`, so that `Phi`, `Psi` and `Gam2` of the shaft
/// torque are `1`, `T` and `T^2/2`. Outside the shift the shaft torque follows the change of twist and leans
/// towards its steady value, because the speeds do not show its offset.
///
/// `L` is designed for forward slip. With backward slip the pressure's column of `G` changes its sign, and the
/// pressure's row of `L` with it: the error is that of forward slip with the sign of the pressure turned round, and
/// the certificate holds for both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantObserver<T> {
    /// The powertrain.
    pub model: CompliantModel<T>,
    /// The gains, which may follow the friction.
    pub gains: Schedule<T, CompliantGains<T>>,
    /// Checks, valve and phase.
    pub tracker: Tracker<T>,
    /// Time in which the shaft torque leans towards its steady value outside the shift, s.
    pub shaft_settling_s: T,
}

/// Memory of a [`CompliantObserver`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantState<T> {
    track: Track<T, SpeedSample<T>>,
    shaft_torque_n_m: Option<T>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct SpeedSample<T> {
    phase: Phase,
    speeds: [T; OUTPUTS],
    shaft_rate: T,
    steady_n_m: T,
    model: CompliantSpeedModel<T>,
}

impl<T: Real> SampleEstimator<T> for CompliantObserver<T> {
    type SampleState = CompliantState<T>;
    const READS_WHEEL: bool = true;

    fn tracker(&self) -> &Tracker<T> {
        &self.tracker
    }

    fn start_sample(&self) -> CompliantState<T> {
        CompliantState { track: Track::new(), shaft_torque_n_m: None }
    }

    #[inline]
    fn step_sample(&self, state: &mut CompliantState<T>, sample: &Sample<T>) -> Estimate<T> {
        let Some(mut interval) = self.tracker.begin(&mut state.track.tracker, sample) else {
            state.track.last = None;
            return state.track.estimate(state.shaft_torque_n_m, Health::TimeRejected);
        };
        if !self.tracker.limits.wheel_valid(sample) {
            interval.health = Health::SpeedsRejected;
        }
        let speeds = interval.speeds_valid().then_some([sample.turbine_rad_s, sample.slip_rad_s, sample.wheel_rad_s]);
        let known = state.shaft_torque_n_m.is_some();
        if !interval.short {
            // The twist is lost over a long gap, as it is unknown at the start.
            state.shaft_torque_n_m = None;
        }
        let pressure = self.advance(state, &mut interval, speeds);
        let mut health = state.track.settle(&self.tracker.limits, pressure);
        // A correction that cannot be may come from a wrong reading or from a wrong twist.
        let sound = speeds.is_none() || interval.speeds_valid();
        state.shaft_torque_n_m =
            state.shaft_torque_n_m.filter(|&torque| sound && self.tracker.limits.shaft_torque_possible(torque));
        state.track.lost |= known && state.shaft_torque_n_m.is_none();
        match speeds.filter(|_| interval.speeds_valid()) {
            Some(speeds) => {
                self.observe(state, interval.dt_s, sample, speeds);
                health = health.max(state.track.restart());
            }
            None => state.track.last = None,
        }
        state.track.estimate(state.shaft_torque_n_m, interval.health.max(health))
    }
}

impl<T: Real> CompliantObserver<T> {
    #[inline]
    fn gains_of(&self, last: &SpeedSample<T>) -> Option<[[T; OUTPUTS]; 2]> {
        match last.phase {
            Phase::TorquePhase => Some(self.gains.at(last.model.friction).torque_phase),
            Phase::InertiaPhase => Some(self.gains.at(last.model.friction).inertia_phase),
            Phase::BeforeShift | Phase::AfterShift => None,
        }
    }

    /// Carries both estimates over the interval and corrects them by how far the speeds moved otherwise
    /// than predicted. Returns the pressure.
    #[inline]
    fn advance(&self, state: &mut CompliantState<T>, interval: &mut Interval<T>, speeds: Option<[T; OUTPUTS]>) -> T {
        let dt = interval.dt_s;
        let before = state.track.pressure_pa;
        let mut pressure = interval.pressure(before);
        let (Some(last), Some(shaft)) = (state.track.last, state.shaft_torque_n_m) else { return pressure };
        let mut predicted = shaft + dt * last.shaft_rate;
        match (self.gains_of(&last), speeds) {
            (Some(gain), Some(speeds)) => {
                let shaft_integral = dt * (shaft + T::of(0.5) * dt * last.shaft_rate);
                let pressure_integral = interval.pressure_integral(before);
                let mut correction = [T::zero(); 2];
                for i in 0..OUTPUTS {
                    let [per_shaft, per_pressure] = last.model.influence[i];
                    let unpredicted = speeds[i]
                        - last.speeds[i]
                        - dt * last.model.free_rad_s2[i]
                        - per_shaft * shaft_integral
                        - per_pressure * pressure_integral;
                    correction[0] = correction[0] + gain[0][i] * unpredicted;
                    correction[1] = correction[1] + gain[1][i] * unpredicted;
                }
                pressure = interval.corrected(pressure, last.model.direction * correction[1], &self.tracker.limits);
                if interval.speeds_valid() {
                    predicted = predicted + correction[0];
                }
            }
            (None, _) => {
                let fraction = T::one() - (-dt / self.shaft_settling_s).exp();
                predicted = predicted + fraction * (last.steady_n_m - predicted);
            }
            (Some(_), None) => {}
        }
        state.shaft_torque_n_m = Some(predicted);
        pressure
    }

    /// Finds the phase and stores the model at this sample.
    #[inline]
    fn observe(&self, state: &mut CompliantState<T>, dt: T, sample: &Sample<T>, speeds: [T; OUTPUTS]) {
        let engine = sample.engine_rad_s;
        let [turbine, slip, wheel] = speeds;
        let (_, acting) = self.tracker.phase(&mut state.track.tracker, dt, sample);
        let steady_n_m = self.model.steady_shaft_torque(acting, engine, turbine, wheel);
        state.shaft_torque_n_m = state.shaft_torque_n_m.or(Some(steady_n_m));
        state.track.last = Some(SpeedSample {
            phase: acting,
            speeds,
            shaft_rate: self.model.shaft_rate(turbine, slip, wheel),
            steady_n_m,
            model: self.model.speed_model(acting, engine, turbine, slip, wheel),
        });
        state.track.clutch_torque_n_m =
            self.model.rigid.clutch_torque(acting, state.track.pressure_pa, engine, turbine, slip);
    }

    /// The same observer in another precision.
    pub fn cast<U: Real>(&self) -> CompliantObserver<U> {
        CompliantObserver {
            model: self.model.cast(),
            gains: self.gains.cast(CompliantGains::cast),
            tracker: self.tracker.cast(),
            shaft_settling_s: U::of(self.shaft_settling_s.to_f64_exact()),
        }
    }
}
