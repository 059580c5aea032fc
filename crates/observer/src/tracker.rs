//! What every observer does alike with a sample: checks, valve, phase.

use drivetrain::{LinearValve, Real, ReducedShift, Valve};

use crate::{Estimate, Health, Input, InputLimits, Phase, Supervisor, SupervisorState};

/// How the frozen dynamics are carried over a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Discretisation {
    /// By the matrix exponential: exact for coefficients that stand still over the sample.
    Exact,
    /// By forward Euler, as the chapter did.
    Euler,
}

/// Checks input, follows the valve model and the phase.
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// Longest time between two samples over which the speeds may correct the estimate, s: the model is
    /// frozen over it, and the gains are made for short ones. Over a longer gap the valve model serves alone.
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
    started: bool,
}

/// The time between two samples, with the valve under the command that was held over it:
/// `z+ = phi z + psi b2`, and `psi z + gam2 b2` is the integral of `z`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval<T> {
    /// Its length, s.
    pub dt_s: T,
    /// The valve.
    pub valve: LinearValve<T>,
    /// `e^(A22 T)`.
    pub phi: T,
    /// Integral of `e^(A22 s)`, s.
    pub psi: T,
    /// Integral of `psi`, s^2.
    pub gam2: T,
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

    /// Pressure at its end by the valve model, Pa, Eq. (2.17c).
    #[inline]
    pub fn pressure(&self, pressure_pa: T) -> T {
        self.phi * pressure_pa + self.psi * self.valve.b2_pa_s
    }

    /// Integral of that pressure over it, Pa s.
    #[inline]
    pub fn pressure_integral(&self, pressure_pa: T) -> T {
        self.psi * pressure_pa + self.gam2 * self.valve.b2_pa_s
    }
}

impl<T: Real> TrackerState<T> {
    /// An empty cylinder before the shift.
    pub fn new() -> Self {
        let zero = T::zero();
        Self { valve_pressure_pa: zero, supervisor: SupervisorState::new(), command: zero, started: false }
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
}

impl<T: Real, S> Track<T, S> {
    /// An empty cylinder before the shift.
    pub(crate) fn new() -> Self {
        let zero = T::zero();
        Self { tracker: TrackerState::new(), pressure_pa: zero, clutch_torque_n_m: zero, last: None }
    }

    /// Goes back to the valve model if the estimate is no number any more.
    #[inline]
    pub(crate) fn recover(&mut self) {
        if !self.pressure_pa.is_finite() {
            self.pressure_pa = self.tracker.valve_pressure_pa;
            self.last = None;
        }
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
            bounds: None,
        }
    }
}

impl<T: Real> Tracker<T> {
    /// Takes a sample: the interval that it ends, or `None` if its time step cannot be used.
    #[inline]
    pub fn begin(&self, state: &mut TrackerState<T>, input: &Input<T>) -> Option<Interval<T>> {
        let dt_s = if state.started { input.dt_s } else { T::zero() };
        if !(dt_s >= T::zero() && dt_s.is_finite()) {
            return None;
        }
        state.started = true;
        let (speeds_valid, command_valid) = (self.limits.speeds_valid(input), self.limits.command_valid(input));
        let health = match (speeds_valid, command_valid) {
            (false, _) => Health::SpeedsRejected,
            (true, false) => Health::CommandRejected,
            (true, true) => Health::Good,
        };
        let interval = self.interval(state.command, dt_s, health);
        state.valve_pressure_pa = interval.pressure(state.valve_pressure_pa);
        if command_valid {
            state.command = input.command;
        }
        Some(interval)
    }

    #[inline]
    fn interval(&self, command: T, dt_s: T, health: Health) -> Interval<T> {
        let valve = self.valve.linear(command);
        let a = valve.a22_per_s;
        let short = dt_s <= self.sample_max_s;
        let (phi, psi, gam2) = match self.discretisation {
            Discretisation::Euler if short => (T::one() + a * dt_s, dt_s, T::zero()),
            Discretisation::Exact | Discretisation::Euler => {
                let phi = (a * dt_s).exp();
                let psi = (phi - T::one()) / a;
                (phi, psi, (psi - dt_s) / a)
            }
        };
        Interval { dt_s, valve, phi, psi, gam2, health, short }
    }

    /// The phase at a sample whose speeds can be used, and the phase whose equations hold there.
    #[inline]
    pub fn phase(&self, state: &mut TrackerState<T>, dt_s: T, input: &Input<T>) -> (Phase, Phase) {
        let (turbine, slip) = (input.turbine_rad_s, input.slip_rad_s);
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
