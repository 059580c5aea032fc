//! Direct inversion: the pressure that follows from the last change of the speeds.
//!
//! The turbine's and the output's momentum over a sample give the clutch torque without any observer; the pressure
//! follows from the friction law. The only state is the twist of the shafts, so an error
//! does not last, but the noise of every reading is in the estimate. A first-order low pass reduces this noise.

use drivetrain::{Real, clutch::direction};

use crate::{CompliantModel, Estimate, Health, Interval, Phase, Sample, SampleEstimator, Track, Tracker};

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
    track: Track<T, Sample<T>>,
    shaft_torque_n_m: Option<T>,
}

impl<T: Real> Inversion<T> {
    /// Torque of the oncoming clutch over the interval between two samples, N m: what is left of the turbine's
    /// momentum when turbine torque and shaft torque have had their parts. The offgoing clutch's torque is taken out by
    /// combining both rows.
    #[inline]
    fn clutch_torque(&self, last: &Sample<T>, sample: &Sample<T>, shaft_n_m: T) -> T {
        let shift = &self.model.shift;
        let output = |x: &Sample<T>| shift.output_speed(x.turbine_rad_s, x.slip_rad_s);
        let rates =
            [(sample.turbine_rad_s - last.turbine_rad_s) / sample.dt_s, (output(sample) - output(last)) / sample.dt_s];
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

impl<T: Real> SampleEstimator<T> for Inversion<T> {
    type SampleState = InversionState<T>;
    const READS_WHEEL: bool = true;

    fn tracker(&self) -> &Tracker<T> {
        &self.tracker
    }

    fn start_sample(&self) -> InversionState<T> {
        InversionState { track: Track::new(), shaft_torque_n_m: None }
    }

    #[inline]
    fn step_sample(&self, state: &mut InversionState<T>, sample: &Sample<T>) -> Estimate<T> {
        let Some(mut interval) = self.tracker.begin(&mut state.track.tracker, sample) else {
            state.lose();
            return state.track.estimate(None, Health::TimeRejected);
        };
        if !self.tracker.limits.wheel_valid(sample) {
            interval.health = Health::SpeedsRejected;
        }
        if !interval.speeds_valid() || !interval.short {
            state.lose();
        }
        let predicted = interval.pressure(state.track.pressure_pa);
        let (pressure, acting) = if interval.speeds_valid() {
            let (pressure, acting) = self.take(state, &mut interval, sample, predicted);
            (pressure, Some(acting).filter(|_| interval.speeds_valid()))
        } else {
            (predicted, None)
        };
        let mut health = state.track.settle(&self.tracker.limits, pressure);
        match acting {
            Some(acting) => {
                let (engine, turbine, slip) = (sample.engine_rad_s, sample.turbine_rad_s, sample.slip_rad_s);
                let pressure = state.track.pressure_pa;
                state.track.clutch_torque_n_m = self.model.rigid.clutch_torque(acting, pressure, engine, turbine, slip);
                state.track.last = Some(*sample);
                health = health.max(state.track.restart());
            }
            None => state.lose(),
        }
        state.track.estimate(state.shaft_torque_n_m, interval.health.max(health))
    }
}

impl<T: Real> InversionState<T> {
    /// Forgets the twist and the sample before.
    fn lose(&mut self) {
        self.track.lost |= self.shaft_torque_n_m.is_some();
        self.track.last = None;
        self.shaft_torque_n_m = None;
    }
}

impl<T: Real> Inversion<T> {
    /// Pressure and phase at a sample whose speeds can be used; follows the twist.
    #[inline]
    fn take(
        &self,
        state: &mut InversionState<T>,
        interval: &mut Interval<T>,
        sample: &Sample<T>,
        mut pressure: T,
    ) -> (T, Phase) {
        let dt = interval.dt_s;
        let (_, acting) = self.tracker.phase(&mut state.track.tracker, dt, sample);
        let (engine, turbine, slip) = (sample.engine_rad_s, sample.turbine_rad_s, sample.slip_rad_s);
        let steady = self.model.steady_shaft_torque(acting, engine, turbine, sample.wheel_rad_s);
        let mut shaft = state.shaft_torque_n_m.unwrap_or(steady);
        let shifting = matches!(acting, Phase::TorquePhase | Phase::InertiaPhase);
        if let Some(last) = state.track.last.filter(|_| dt > T::zero()) {
            let before = self.model.shaft_rate(last.turbine_rad_s, last.slip_rad_s, last.wheel_rad_s);
            let after = self.model.shaft_rate(turbine, slip, sample.wheel_rad_s);
            let turned = T::of(0.5) * dt * (before + after);
            let mean = shaft + T::of(0.5) * turned;
            shaft = shaft + turned;
            if shifting {
                let torque = self.clutch_torque(&last, sample, mean);
                let fraction = T::one() - (-dt / self.smoothing_s).exp();
                let size = (direction(slip) * torque).at_least(T::zero());
                // Below the kiss point the clutch carries nothing, and the valve model is all there is.
                if size > T::zero() {
                    let found = self.model.rigid.clutch.pressure_for(size, slip);
                    pressure = interval.corrected(pressure, fraction * (found - pressure), &self.tracker.limits);
                }
            } else {
                let fraction = T::one() - (-dt / self.shaft_settling_s).exp();
                shaft = shaft + fraction * (steady - shaft);
            }
        }
        // A twist that cannot be is found anew.
        let possible = self.tracker.limits.shaft_torque_possible(shaft);
        state.track.lost |= !possible;
        state.shaft_torque_n_m = possible.then_some(shaft);
        (pressure, acting)
    }
}
