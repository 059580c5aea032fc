//! The part of a step that all observers share: checks, valve, phase.

pub use car::Discretisation;
use drivetrain::{Lag, LinearValve, Real, ReducedShift, Valve, ValveStep};

use crate::{ChannelHealth, Channels, Estimate, Health, InputLimits, Phase, Sample, Supervisor, SupervisorState};

/// Checks sample, follows the valve model and the phase.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Tracker<T> {
    /// The oncoming clutch's valve.
    pub valve: Valve<T>,
    /// Kinematics of the shift.
    pub shift: ReducedShift<T>,
    /// The phase supervisor.
    pub supervisor: Supervisor<T>,
    /// What counts as a measurement.
    pub limits: InputLimits<T>,
    /// How the valve and the pressure are carried over a sample.
    pub discretisation: Discretisation,
    /// Longest time between two samples over which the speeds may correct the estimate, s: the model is frozen over
    /// it, and the gains are made for short ones. Over a longer gap the estimate is from the valve model alone.
    pub sample_max_s: T,
}

/// Memory of a [`Tracker`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerState<T> {
    /// Pressure by the valve model alone, Pa.
    pub valve_pressure_pa: T,
    /// The phase.
    pub supervisor: SupervisorState<T>,
    command: T,
    /// A proportional valve over the last time step: most steps are as long as the one before.
    lag: Lag<T>,
    started: bool,
}

/// The time between two samples, with the valve under the command that was held over it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval<T> {
    /// Its length, s.
    pub dt_s: T,
    /// The valve over it: `Phi`, `Psi` and what the command adds.
    pub valve: ValveStep<T>,
    /// The valve at its start.
    pub start: LinearValve<T>,
    /// What could be used of the sample at its end.
    pub health: Health,
    /// Whether it is short enough to correct the estimate by the speeds at its ends.
    pub short: bool,
}

impl<T: Real> Interval<T> {
    /// Whether the speeds at its end can be used.
    #[inline]
    pub fn speeds_valid(&self) -> bool {
        self.health != Health::SpeedsRejected
    }

    /// The pressure that a correction leads to; one of more than all that the supply can give comes from a wrong reading,
    /// and the speeds are rejected.
    #[inline]
    pub(crate) fn corrected(&mut self, predicted_pa: T, correction_pa: T, limits: &InputLimits<T>) -> T {
        if correction_pa.abs() <= limits.pressure_max_pa {
            predicted_pa + correction_pa
        } else {
            self.health = self.health.max(Health::SpeedsRejected);
            predicted_pa
        }
    }

    /// Pressure at its end by the valve model, Pa, Eq. (2.17c).
    #[inline]
    pub fn pressure(&self, pressure_pa: T) -> T {
        self.valve.phi * pressure_pa + self.valve.drift_pa
    }

    /// Rate of the pressure at its start by the valve model, Pa/s.
    #[inline]
    pub fn start_rate(&self, pressure_pa: T) -> T {
        self.start.a22_per_s * pressure_pa + self.start.b2_pa_s
    }

    /// Integral of that pressure over it, Pa s.
    #[inline]
    pub fn pressure_integral(&self, pressure_pa: T) -> T {
        self.valve.psi * pressure_pa + self.valve.drift_integral_pa_s
    }
}

impl<T: Real> TrackerState<T> {
    /// An empty cylinder before the shift.
    pub fn new() -> Self {
        let zero = T::zero();
        Self {
            valve_pressure_pa: zero,
            supervisor: SupervisorState::new(),
            command: zero,
            lag: Lag::over(-T::one(), zero),
            started: false,
        }
    }
}

impl<T: Real> TrackerState<T> {
    /// The time step of a sample: none of the first one, and `None` if it cannot be used.
    #[inline]
    pub(crate) fn time_step(&mut self, sample: &Sample<T>) -> Option<T> {
        let dt_s = if self.started { sample.dt_s } else { T::zero() };
        let usable = dt_s >= T::zero() && dt_s.is_finite();
        self.started |= usable;
        usable.then_some(dt_s)
    }
}

impl<T: Real> Default for TrackerState<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// What the reduced-order and the sliding-mode observers remember alike: the pressure, and the last sample
/// they can correct by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track<T, S> {
    pub(crate) tracker: TrackerState<T>,
    pub(crate) pressure_pa: T,
    pub(crate) clutch_torque_n_m: T,
    pub(crate) last: Option<S>,
    /// Whether the state was lost, so that the next usable sample starts again.
    pub(crate) lost: bool,
}

impl<T: Real, S> Track<T, S> {
    /// An empty cylinder before the shift.
    pub(crate) fn new() -> Self {
        let zero = T::zero();
        Self { tracker: TrackerState::new(), pressure_pa: zero, clutch_torque_n_m: zero, last: None, lost: false }
    }

    /// Takes a pressure as the estimate, as far as the supply can give it. A pressure that is not finite is replaced
    /// by that of the valve model, and the observer starts again.
    #[inline]
    pub(crate) fn settle(&mut self, limits: &InputLimits<T>, pressure_pa: T) -> Health {
        if !pressure_pa.is_finite() {
            self.pressure_pa = self.tracker.valve_pressure_pa;
            self.last = None;
            return Health::Restarted;
        }
        self.pressure_pa = limits.possible_pressure(pressure_pa);
        if self.pressure_pa == pressure_pa { Health::Good } else { Health::PressureLimited }
    }

    /// Reports once that the observer starts again, if it lost its state.
    #[inline]
    pub(crate) fn restart(&mut self) -> Health {
        if core::mem::take(&mut self.lost) { Health::Restarted } else { Health::Good }
    }

    /// The estimate as it stands.
    #[inline]
    pub(crate) fn estimate(&self, shaft_torque_n_m: Option<T>, health: Health) -> Estimate<T> {
        Estimate {
            pressure_pa: self.pressure_pa,
            clutch_torque_n_m: self.clutch_torque_n_m,
            shaft_torque_n_m,
            phase: self.tracker.supervisor.phase,
            health,
            channels: Channels::all(ChannelHealth::Good),
            bounds: None,
        }
    }
}

impl<T: Real> Tracker<T> {
    /// Takes a sample: the interval that it ends, or `None` if its time step cannot be used.
    #[inline]
    pub fn begin(&self, state: &mut TrackerState<T>, sample: &Sample<T>) -> Option<Interval<T>> {
        let dt_s = state.time_step(sample)?;
        let (speeds_valid, command) = (self.limits.speeds_valid(sample), self.limits.possible_command(sample.command));
        let health = match (speeds_valid, command.is_some()) {
            (false, _) => Health::SpeedsRejected,
            (true, false) => Health::CommandRejected,
            (true, true) => Health::Good,
        };
        let interval = self.interval(state, dt_s, health);
        state.valve_pressure_pa = self.limits.possible_pressure(interval.pressure(state.valve_pressure_pa));
        if let Some(command) = command {
            state.command = command;
        }
        Some(interval)
    }

    #[inline]
    fn interval(&self, state: &mut TrackerState<T>, dt_s: T, health: Health) -> Interval<T> {
        // A valve that is not linear is linearised along the way of the valve model alone: the error dynamics of an
        // observer then depend on the command and not on its own estimate.
        let start = self.valve.linear(state.command, state.valve_pressure_pa);
        let short = dt_s <= self.sample_max_s;
        let valve = match self.discretisation {
            Discretisation::Euler if short => start.euler_step(dt_s),
            Discretisation::Exact | Discretisation::Euler => match self.valve {
                Valve::Proportional { .. } => {
                    if !state.lag.is_over(start.a22_per_s, dt_s) {
                        state.lag = Lag::over(start.a22_per_s, dt_s);
                    }
                    state.lag.driven(start.b2_pa_s)
                }
                Valve::PulseWidth(_) => self.valve.step(state.command, state.valve_pressure_pa, dt_s),
            },
        };
        Interval { dt_s, valve, start, health, short }
    }

    /// The phase at a sample whose speeds can be used, and the phase whose equations hold there.
    #[inline]
    pub fn phase(&self, state: &mut TrackerState<T>, dt_s: T, sample: &Sample<T>) -> (Phase, Phase) {
        let (turbine, slip) = (sample.turbine_rad_s, sample.slip_rad_s);
        let output = self.shift.output_speed(turbine, slip);
        let offgoing_slip = self.shift.offgoing_slip(turbine, output);
        let phase = self.supervisor.step(&mut state.supervisor, dt_s, state.valve_pressure_pa, offgoing_slip, slip);
        (phase, self.supervisor.acting_phase(phase, slip))
    }

    /// The same tracker in another precision.
    pub fn cast<U: Real>(&self) -> Tracker<U> {
        Tracker {
            valve: self.valve.cast(),
            shift: self.shift.cast(),
            supervisor: self.supervisor.cast(),
            limits: self.limits.cast(),
            discretisation: self.discretisation,
            sample_max_s: U::of(self.sample_max_s.to_f64_exact()),
        }
    }
}
