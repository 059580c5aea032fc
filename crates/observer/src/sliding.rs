//! The full-order sliding-mode observer, for comparison: Eq. (2.55) in the inertia phase, (2.59) in
//! the torque phase.

use drivetrain::{Real, clutch::direction};

use crate::{Estimate, Health, Phase, RigidModel, Sample, SampleEstimator, SpeedModel, Track, Tracker};

/// Gains of the sliding-mode observer. The pressure gains are negative where the speed falls with the
/// pressure: in sliding the pressure error decays with `mu R N A (ks3 C13/ks1 + ...)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlidingGains<T> {
    /// Torque phase: `kst1`, rad/s^2.
    pub torque_speed_rad_s2: T,
    /// Torque phase: `kst2`, Pa/s.
    pub torque_pressure_pa_s: T,
    /// Inertia phase: `ks1` on `w_t` and `ks2` on `dw`, rad/s^2.
    pub inertia_speed_rad_s2: [T; 2],
    /// Inertia phase: `ks3` and `ks4`, Pa/s.
    pub inertia_pressure_pa_s: [T; 2],
}

impl<T: Real> SlidingGains<T> {
    /// The same gains in another precision.
    pub fn cast<U: Real>(&self) -> SlidingGains<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        SlidingGains {
            torque_speed_rad_s2: to(self.torque_speed_rad_s2),
            torque_pressure_pa_s: to(self.torque_pressure_pa_s),
            inertia_speed_rad_s2: self.inertia_speed_rad_s2.map(to),
            inertia_pressure_pa_s: self.inertia_pressure_pa_s.map(to),
        }
    }
}

/// The sliding-mode observer on the rigid model.
///
/// Discretised by forward Euler, as in the chapter: the sign of the speed error is constant over the sample,
/// which causes chatter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlidingObserver<T> {
    /// The powertrain.
    pub model: RigidModel<T>,
    /// The gains.
    pub gains: SlidingGains<T>,
    /// Checks, valve and phase.
    pub tracker: Tracker<T>,
}

/// Memory of a [`SlidingObserver`].
pub type SlidingState<T> = Track<T, SlidingSample<T>>;

/// The estimated speeds at the last usable sample, their errors' signs, and the model there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlidingSample<T> {
    phase: Phase,
    /// Estimated speeds `y^`, rad/s.
    estimated: [T; 2],
    /// Signs of the speed errors.
    signs: [T; 2],
    model: SpeedModel<T>,
}

impl<T: Real> SampleEstimator<T> for SlidingObserver<T> {
    type SampleState = SlidingState<T>;
    const READS_WHEEL: bool = false;

    fn tracker(&self) -> &Tracker<T> {
        &self.tracker
    }

    fn start_sample(&self) -> SlidingState<T> {
        Track::new()
    }

    #[inline]
    fn step_sample(&self, state: &mut SlidingState<T>, sample: &Sample<T>) -> Estimate<T> {
        let Some(interval) = self.tracker.begin(&mut state.tracker, sample) else {
            state.last = None;
            return state.estimate(None, Health::TimeRejected);
        };
        let dt = interval.dt_s;
        let before = state.pressure_pa;
        let mut after = interval.pressure(before);
        let mut estimated = None;
        if let Some(last) = state.last.filter(|_| interval.short) {
            let (speed, pressure) = self.gains_of(last.phase);
            // The pressure moves the speeds the other way with backward slip.
            let switched = pressure[0] * last.signs[0] + pressure[1] * last.signs[1];
            after = after + dt * last.model.direction * switched;
            let advanced = |i: usize| {
                let rate = last.model.free_rad_s2[i] + last.model.per_pressure_rad_s2_pa[i] * before;
                last.estimated[i] + dt * (rate + speed[i] * last.signs[i])
            };
            estimated = Some((last.phase, [advanced(0), advanced(1)]));
        }
        let settled = state.settle(&self.tracker.limits, after);
        if interval.speeds_valid() {
            self.observe(state, dt, sample, estimated);
        } else {
            state.last = None;
        }
        state.estimate(None, interval.health.max(settled))
    }
}

impl<T: Real> SlidingObserver<T> {
    /// Speed gains and pressure gains of a phase, on `(w_t, dw)`.
    #[inline]
    fn gains_of(&self, phase: Phase) -> ([T; 2], [T; 2]) {
        let (g, zero) = (&self.gains, T::zero());
        match phase {
            Phase::InertiaPhase => (g.inertia_speed_rad_s2, g.inertia_pressure_pa_s),
            _ => ([g.torque_speed_rad_s2, zero], [g.torque_pressure_pa_s, zero]),
        }
    }

    /// Finds the phase and the signs of the speed errors. Where a phase begins, the estimated speeds
    /// begin at the measured ones.
    #[inline]
    fn observe(&self, state: &mut SlidingState<T>, dt: T, sample: &Sample<T>, estimated: Option<(Phase, [T; 2])>) {
        let (engine, turbine, slip) = (sample.engine_rad_s, sample.turbine_rad_s, sample.slip_rad_s);
        let (_, acting) = self.tracker.phase(&mut state.tracker, dt, sample);
        let measured = [turbine, slip];
        state.last = matches!(acting, Phase::TorquePhase | Phase::InertiaPhase).then(|| {
            let estimated = match estimated {
                Some((phase, speeds)) if phase == acting && speeds.iter().all(|speed| speed.is_finite()) => speeds,
                _ => measured,
            };
            // The friction is taken at the estimated slip, as in Eq. (2.55), but in the direction of the measured one; in
            // the torque phase the slip is measured.
            let slip = if acting == Phase::InertiaPhase { direction(slip) * estimated[1].abs() } else { slip };
            let sign = |i: usize| match measured[i] - estimated[i] {
                error if error > T::zero() => T::one(),
                error if error < T::zero() => -T::one(),
                _ => T::zero(),
            };
            SlidingSample {
                phase: acting,
                estimated,
                signs: [sign(0), sign(1)],
                model: self.model.speed_model(acting, engine, turbine, slip),
            }
        });
        state.clutch_torque_n_m = self.model.clutch_torque(acting, state.pressure_pa, engine, turbine, slip);
    }

    /// The same observer in another precision.
    pub fn cast<U: Real>(&self) -> SlidingObserver<U> {
        SlidingObserver { model: self.model.cast(), gains: self.gains.cast(), tracker: self.tracker.cast() }
    }
}
