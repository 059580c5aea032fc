//! The reduced-order observer with elastic drive shafts: pressure and shaft torque, Eq. (2.71)-(2.73).

use drivetrain::Real;

use crate::compliant_model::{CompliantSpeedModel, OUTPUTS};
use crate::schedule::{Mix, between};
use crate::{CompliantModel, Estimate, Estimator, Health, Input, Interval, Phase, Schedule, Track, Tracker};

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
    fn mixed(&self, other: &Self, share: T) -> Self {
        let mix = |a: &[[T; OUTPUTS]; 2], b: &[[T; OUTPUTS]; 2]| {
            let mut gain = *a;
            for (row, other) in gain.iter_mut().zip(b) {
                for (x, y) in row.iter_mut().zip(other) {
                    *x = between(*x, *y, share);
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
    track: Track<T, Sample<T>>,
    shaft_torque_n_m: Option<T>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample<T> {
    phase: Phase,
    speeds: [T; OUTPUTS],
    shaft_rate: T,
    steady_n_m: T,
    model: CompliantSpeedModel<T>,
}

impl<T: Real> Estimator<T> for CompliantObserver<T> {
    type State = CompliantState<T>;

    fn start(&self) -> CompliantState<T> {
        CompliantState { track: Track::new(), shaft_torque_n_m: None }
    }

    #[inline]
    fn step(&self, state: &mut CompliantState<T>, input: &Input<T>) -> Estimate<T> {
        let Some(mut interval) = self.tracker.begin(&mut state.track.tracker, input) else {
            state.track.last = None;
            return state.track.estimate(state.shaft_torque_n_m, Health::TimeRejected);
        };
        if !self.tracker.limits.wheel_valid(input) {
            interval.health = Health::SpeedsRejected;
        }
        let speeds = interval.speeds_valid().then_some([input.turbine_rad_s, input.slip_rad_s, input.wheel_rad_s]);
        if !interval.short {
            // The twist is lost over a long gap, as it is unknown at the start.
            state.shaft_torque_n_m = None;
        }
        self.advance(state, &interval, speeds);
        state.track.recover();
        state.shaft_torque_n_m = state.shaft_torque_n_m.filter(|torque| torque.is_finite());
        match speeds {
            Some(speeds) => self.observe(state, interval.dt_s, input, speeds),
            None => state.track.last = None,
        }
        state.track.estimate(state.shaft_torque_n_m, interval.health)
    }
}

impl<T: Real> CompliantObserver<T> {
    #[inline]
    fn gains_of(&self, last: &Sample<T>) -> Option<[[T; OUTPUTS]; 2]> {
        match last.phase {
            Phase::TorquePhase => Some(self.gains.at(last.model.friction).torque_phase),
            Phase::InertiaPhase => Some(self.gains.at(last.model.friction).inertia_phase),
            Phase::BeforeShift | Phase::AfterShift => None,
        }
    }

    /// Carries both estimates over the interval and corrects them by how far the speeds moved otherwise
    /// than predicted.
    #[inline]
    fn advance(&self, state: &mut CompliantState<T>, interval: &Interval<T>, speeds: Option<[T; OUTPUTS]>) {
        let dt = interval.dt_s;
        let pressure_integral = interval.pressure_integral(state.track.pressure_pa);
        state.track.pressure_pa = interval.pressure(state.track.pressure_pa);
        let (Some(last), Some(shaft)) = (state.track.last, state.shaft_torque_n_m) else { return };
        let mut predicted = shaft + dt * last.shaft_rate;
        match (self.gains_of(&last), speeds) {
            (Some(gain), Some(speeds)) => {
                let shaft_integral = dt * (shaft + T::of(0.5) * dt * last.shaft_rate);
                for i in 0..OUTPUTS {
                    let [per_shaft, per_pressure] = last.model.influence[i];
                    let unpredicted = speeds[i]
                        - last.speeds[i]
                        - dt * last.model.free_rad_s2[i]
                        - per_shaft * shaft_integral
                        - per_pressure * pressure_integral;
                    predicted = predicted + gain[0][i] * unpredicted;
                    state.track.pressure_pa = state.track.pressure_pa + gain[1][i] * unpredicted;
                }
            }
            (None, _) => {
                let share = T::one() - (-dt / self.shaft_settling_s).exp();
                predicted = predicted + share * (last.steady_n_m - predicted);
            }
            (Some(_), None) => {}
        }
        state.shaft_torque_n_m = Some(predicted);
    }

    /// Finds the phase and stores what the model says at this sample.
    #[inline]
    fn observe(&self, state: &mut CompliantState<T>, dt: T, input: &Input<T>, speeds: [T; OUTPUTS]) {
        let engine = input.engine_rad_s;
        let [turbine, slip, wheel] = speeds;
        let (_, acting) = self.tracker.phase(&mut state.track.tracker, dt, input);
        let steady_n_m = self.model.steady_shaft_torque(acting, engine, turbine, wheel);
        state.shaft_torque_n_m = state.shaft_torque_n_m.or(Some(steady_n_m));
        state.track.last = Some(Sample {
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
