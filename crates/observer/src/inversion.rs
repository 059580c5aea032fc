//! Direct inversion: the pressure that explains the last change of the speeds.
//!
//! The turbine's and the output's momentum over a sample give the clutch torque without any observer; the pressure
//! follows from the friction law. Nothing is carried over from sample to sample but the twist of the shafts, so an
//! error does not last, and every reading's noise is in the estimate. A low pass of one time constant is all that is
//! done about it.

use drivetrain::Real;

use crate::{CompliantModel, Estimate, Estimator, Health, Input, Phase, Track, Tracker};

/// The inversion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inversion<T> {
    /// The powertrain.
    pub model: CompliantModel<T>,
    /// Time constant of the low pass on the clutch torque, s.
    pub smoothing_s: T,
    /// Time in which the shaft torque leans towards its steady value outside the shift, s.
    pub shaft_settling_s: T,
    /// Checks, valve and phase.
    pub tracker: Tracker<T>,
}

/// Memory of an [`Inversion`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InversionState<T> {
    track: Track<T, Input<T>>,
    shaft_torque_n_m: Option<T>,
}

impl<T: Real> Inversion<T> {
    /// Torque of the oncoming clutch over the interval between two samples, N m: what is left of the turbine's
    /// momentum when turbine torque and shaft torque have had their parts. The offgoing clutch's torque is taken out by
    /// combining both rows.
    #[inline]
    fn clutch_torque(&self, last: &Input<T>, input: &Input<T>, shaft_n_m: T) -> T {
        let shift = &self.model.shift;
        let output = |x: &Input<T>| shift.output_speed(x.turbine_rad_s, x.slip_rad_s);
        let rates =
            [(input.turbine_rad_s - last.turbine_rad_s) / input.dt_s, (output(input) - output(last)) / input.dt_s];
        let rows = &self.model.inertia_phase;
        let turbine_n_m = self.model.rigid.converter.torques(last.engine_rad_s, last.turbine_rad_s).turbine_n_m;
        let output_n_m = shaft_n_m / self.model.rigid.driveline.final_ratio;
        let (t, o) = (&rows.turbine, &rows.output);
        let left = |row: &drivetrain::AccelerationRow<T>, rate: T| {
            rate - row.per_turbine_torque * turbine_n_m - row.per_output_torque * output_n_m
        };
        let combined = left(t, rates[0]) * o.per_offgoing_torque - left(o, rates[1]) * t.per_offgoing_torque;
        combined / (t.per_oncoming_torque * o.per_offgoing_torque - o.per_oncoming_torque * t.per_offgoing_torque)
    }

    /// The same inversion in another precision.
    pub fn cast<U: Real>(&self) -> Inversion<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Inversion {
            model: self.model.cast(),
            smoothing_s: to(self.smoothing_s),
            shaft_settling_s: to(self.shaft_settling_s),
            tracker: self.tracker.cast(),
        }
    }
}

impl<T: Real> Estimator<T> for Inversion<T> {
    type State = InversionState<T>;

    fn start(&self) -> InversionState<T> {
        InversionState { track: Track::new(), shaft_torque_n_m: None }
    }

    #[inline]
    fn step(&self, state: &mut InversionState<T>, input: &Input<T>) -> Estimate<T> {
        let Some(mut interval) = self.tracker.begin(&mut state.track.tracker, input) else {
            state.track.last = None;
            state.shaft_torque_n_m = None;
            return state.track.estimate(None, Health::TimeRejected);
        };
        if !self.tracker.limits.wheel_valid(input) {
            interval.health = Health::SpeedsRejected;
        }
        if !interval.speeds_valid() || !interval.short {
            state.track.last = None;
            state.shaft_torque_n_m = None;
        }
        state.track.pressure_pa = interval.pressure(state.track.pressure_pa);
        if interval.speeds_valid() {
            self.take(state, input);
        }
        state.track.estimate(state.shaft_torque_n_m, interval.health)
    }
}

impl<T: Real> Inversion<T> {
    #[inline]
    fn take(&self, state: &mut InversionState<T>, input: &Input<T>) {
        let (_, acting) = self.tracker.phase(&mut state.track.tracker, input.dt_s.max(T::zero()), input);
        let (engine, turbine, slip) = (input.engine_rad_s, input.turbine_rad_s, input.slip_rad_s);
        let steady = self.model.steady_shaft_torque(acting, engine, turbine, input.wheel_rad_s);
        let mut shaft = state.shaft_torque_n_m.unwrap_or(steady);
        let shifting = matches!(acting, Phase::TorquePhase | Phase::InertiaPhase);
        if let Some(last) = state.track.last.filter(|_| input.dt_s > T::zero()) {
            let before = self.model.shaft_rate(last.turbine_rad_s, last.slip_rad_s, last.wheel_rad_s);
            let after = self.model.shaft_rate(turbine, slip, input.wheel_rad_s);
            let turned = T::of(0.5) * input.dt_s * (before + after);
            let mean = shaft + T::of(0.5) * turned;
            shaft = shaft + turned;
            if shifting {
                let torque = self.clutch_torque(&last, input, mean);
                let share = T::one() - (-input.dt_s / self.smoothing_s).exp();
                let direction = if slip < T::zero() { -T::one() } else { T::one() };
                let size = (direction * torque).max(T::zero());
                let clutch = &self.model.rigid.clutch;
                let found = clutch.pressure_for(size, slip);
                // Below the kiss point the clutch carries nothing, and the valve model is all there is.
                if size > T::zero() {
                    state.track.pressure_pa = state.track.pressure_pa + share * (found - state.track.pressure_pa);
                }
            } else {
                let share = T::one() - (-input.dt_s / self.shaft_settling_s).exp();
                shaft = shaft + share * (steady - shaft);
            }
        }
        if !(state.track.pressure_pa.is_finite() && shaft.is_finite()) {
            state.track.pressure_pa = state.track.tracker.valve_pressure_pa;
            shaft = steady;
        }
        state.shaft_torque_n_m = shaft.is_finite().then_some(shaft);
        state.track.clutch_torque_n_m =
            self.model.rigid.clutch_torque(acting, state.track.pressure_pa, engine, turbine, slip);
        state.track.last = Some(*input);
    }
}
