//! The reduced-order sample-to-state-stable observer with constant gains, Eq. (2.43)-(2.45).

use drivetrain::Real;

use crate::schedule::{Mix, between};
use crate::{
    Estimate, Health, Interval, Phase, RigidModel, Sample, SampleEstimator, Schedule, SpeedModel, Track, Tracker,
};

/// Gains of the rigid observer, Pa per rad/s. A gain of zero is open loop: the valve model alone.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RigidGains<T> {
    /// Torque phase: `L` on `w_t`.
    pub torque_phase_pa_s_rad: T,
    /// Inertia phase: `L` on `(w_t, dw)`.
    pub inertia_phase_pa_s_rad: [T; 2],
}

impl<T: Real> RigidGains<T> {
    /// No correction in any phase.
    pub fn open_loop() -> Self {
        Self { torque_phase_pa_s_rad: T::zero(), inertia_phase_pa_s_rad: [T::zero(); 2] }
    }

    /// The gain in a phase. Before the shift and after lock-up the speeds do not depend on the pressure, and the
    /// estimate is the valve model alone, Eq. (2.17c).
    #[inline]
    pub fn of(&self, phase: Phase) -> [T; 2] {
        match phase {
            Phase::TorquePhase => [self.torque_phase_pa_s_rad, T::zero()],
            Phase::InertiaPhase => self.inertia_phase_pa_s_rad,
            Phase::BeforeShift | Phase::AfterShift => [T::zero(); 2],
        }
    }

    /// The same gains in another precision.
    pub fn cast<U: Real>(&self) -> RigidGains<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        RigidGains {
            torque_phase_pa_s_rad: to(self.torque_phase_pa_s_rad),
            inertia_phase_pa_s_rad: self.inertia_phase_pa_s_rad.map(to),
        }
    }
}

impl<T: Real> Mix<T> for RigidGains<T> {
    #[inline]
    fn mixed(&self, other: &Self, fraction: T) -> Self {
        let [turbine, slip] = self.inertia_phase_pa_s_rad;
        let [other_turbine, other_slip] = other.inertia_phase_pa_s_rad;
        Self {
            torque_phase_pa_s_rad: between(self.torque_phase_pa_s_rad, other.torque_phase_pa_s_rad, fraction),
            inertia_phase_pa_s_rad: [between(turbine, other_turbine, fraction), between(slip, other_slip, fraction)],
        }
    }
}

/// The rigid reduced-order observer.
///
/// Continuous form: `eta = z^ - L y`, `d eta/dt = (A22 - L G)(eta + L y) + B2 - L F`, Eq. (2.45). With `F`,
/// `G`, `A22` and `B2` frozen over one sample this integrates exactly, for `Phi = e^{A22 T}`, to
///
/// ```text
/// z^+ = Phi z^ + Psi B2 + L (y+ - y - T F - G (Psi z^ + Gam2 B2))
/// ```
///
/// where `Psi` is the integral of `e^{A22 s}` over the sample and `Gam2` the integral of `Psi`; forward Euler
/// is the same with `Phi = 1 + A22 T`, `Psi = T`, `Gam2 = 0`. No derivative of `y` is taken. `eta` is not
/// stored: written this way the estimate does not jump when the gain changes with the phase, because only
/// the change of `y` since the last sample enters, which is what setting `eta = z^ - L y` anew at a
/// handover does.
///
/// `L` is designed for forward slip. With backward slip `G` changes its sign, and `L` with it: `L G` and with it the
/// certificate do not change.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RigidObserver<T> {
    /// The powertrain.
    pub model: RigidModel<T>,
    /// The gains, which may follow the friction.
    pub gains: Schedule<T, RigidGains<T>>,
    /// Checks, valve and phase.
    pub tracker: Tracker<T>,
}

/// Memory of a [`RigidObserver`].
pub type RigidState<T> = Track<T, RigidSample<T>>;

/// The speeds of the last usable sample, and the model there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidSample<T> {
    phase: Phase,
    speeds: [T; 2],
    model: SpeedModel<T>,
}

impl<T: Real> SampleEstimator<T> for RigidObserver<T> {
    type SampleState = RigidState<T>;
    const READS_WHEEL: bool = false;

    /// The open loop does without.
    #[inline]
    fn needs_engine(&self) -> bool {
        let is_open_loop = |gains: &RigidGains<T>| *gains == RigidGains::open_loop();
        !self.gains.ends.iter().all(is_open_loop)
    }

    fn tracker(&self) -> &Tracker<T> {
        &self.tracker
    }

    fn start_sample(&self) -> RigidState<T> {
        Track::new()
    }

    #[inline]
    fn step_sample(&self, state: &mut RigidState<T>, sample: &Sample<T>) -> Estimate<T> {
        let Some(mut interval) = self.tracker.begin(&mut state.tracker, sample) else {
            // What lies between the last sample and the next is not known: no sample to correct by.
            state.last = None;
            return state.estimate(None, Health::TimeRejected);
        };
        let usable = interval.speeds_valid() && interval.short;
        let speeds = usable.then_some([sample.turbine_rad_s, sample.slip_rad_s]);
        let correction = self.correction(state, &interval, speeds);
        let limits = &self.tracker.limits;
        let pressure = interval.corrected(interval.pressure(state.pressure_pa), correction, limits);
        let settled = state.settle(limits, pressure);
        if interval.speeds_valid() {
            self.observe(state, interval.dt_s, sample);
        } else {
            state.last = None;
        }
        state.estimate(None, interval.health.max(settled))
    }
}

impl<T: Real> RigidObserver<T> {
    /// The correction of Eq. (2.28) over a sample, Pa: `L` times how far the speeds moved otherwise than
    /// predicted.
    #[inline]
    fn correction(&self, state: &RigidState<T>, interval: &Interval<T>, speeds: Option<[T; 2]>) -> T {
        let (Some(last), Some(speeds)) = (state.last, speeds) else { return T::zero() };
        let gain = self.gains.at(last.model.friction).of(last.phase);
        let pressure_integral = interval.pressure_integral(state.pressure_pa);
        let unpredicted = |i: usize| {
            let SpeedModel { free_rad_s2: f, per_pressure_rad_s2_pa: g, .. } = last.model;
            speeds[i] - last.speeds[i] - interval.dt_s * f[i] - g[i] * pressure_integral
        };
        last.model.direction * (gain[0] * unpredicted(0) + gain[1] * unpredicted(1))
    }

    /// Finds the phase and stores the model at this sample.
    #[inline]
    fn observe(&self, state: &mut RigidState<T>, dt: T, sample: &Sample<T>) {
        let (engine, turbine, slip) = (sample.engine_rad_s, sample.turbine_rad_s, sample.slip_rad_s);
        let (_, acting) = self.tracker.phase(&mut state.tracker, dt, sample);
        // Outside the shift the speeds say nothing about the pressure: no sample to correct by.
        state.last = matches!(acting, Phase::TorquePhase | Phase::InertiaPhase).then(|| RigidSample {
            phase: acting,
            speeds: [turbine, slip],
            model: self.model.speed_model(acting, engine, turbine, slip),
        });
        state.clutch_torque_n_m = self.model.clutch_torque(acting, state.pressure_pa, engine, turbine, slip);
    }

    /// The same observer in another precision.
    pub fn cast<U: Real>(&self) -> RigidObserver<U> {
        let gains = self.gains.cast(RigidGains::cast);
        RigidObserver { model: self.model.cast(), gains, tracker: self.tracker.cast() }
    }
}
