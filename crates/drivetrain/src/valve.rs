//! Pressure valves: the equations of the real valve, and the valve model of the observers.
//!
//! There are two kinds. The command of a proportional valve is a current, A; that of a pulse-width-modulated valve is
//! a duty cycle, %.

mod clutch_valve;
mod maps;
mod play;
mod pulse_width;

pub use clutch_valve::ClutchValve;
pub use maps::ValveMaps;
pub use play::Play;
pub use pulse_width::PulseWidth;

use crate::Real;

/// Steps below this fraction of the time constant are taken by series: there the closed form cancels.
const SHORT: f64 = 1e-2;
/// From this fraction `x` on one less the exponential is used, which takes a third of the time: `psi` then loses a factor `1/x` of
/// its digits and its integral `2/x^2`, as the closed form does at [`SHORT`].
const LONG: f64 = 0.1;

/// Kind of a valve's command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommandKind {
    /// A current, A.
    Current,
    /// A duty cycle, %.
    DutyCycle,
}

/// The valve model of an observer: pressure dynamics with constant parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Valve<T> {
    /// Proportional valve, `tau_cv dp/dt = -p + K_cv i`, Eq. (2.15). The command is a current, A.
    Proportional {
        /// Time constant `tau_cv`, s.
        time_constant_s: T,
        /// Gain `K_cv`, Pa/A.
        gain_pa_a: T,
    },
    /// Pulse-width-modulated valve, Eq. (2.27). The command is a duty cycle, %.
    PulseWidth(PulseWidth<T>),
}

/// `dp/dt = a22 p + b2`, the form every observer uses, Eq. (2.24b).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearValve<T> {
    /// `A22`, 1/s, negative.
    pub a22_per_s: T,
    /// `B2(u)`, Pa/s.
    pub b2_pa_s: T,
}

/// A valve over a time under a constant command: `p+ = phi p + drift`, and the integral of `p` is
/// `psi p + drift_integral`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveStep<T> {
    /// Derivative of the pressure at the end by that at the start.
    pub phi: T,
    /// Derivative of the integral by the pressure at the start, s.
    pub psi: T,
    /// Pressure at the end from an empty cylinder, Pa.
    pub drift_pa: T,
    /// Its integral, Pa s.
    pub drift_integral_pa_s: T,
}

impl<T: Real> Valve<T> {
    /// What its command is.
    pub fn command_kind(&self) -> CommandKind {
        match self {
            Self::Proportional { .. } => CommandKind::Current,
            Self::PulseWidth(_) => CommandKind::DutyCycle,
        }
    }

    /// Pressure that a constant command ends at, Pa.
    #[inline]
    pub fn settled_pressure(&self, command: T) -> T {
        match self {
            Self::Proportional { gain_pa_a, .. } => *gain_pa_a * command,
            Self::PulseWidth(law) => law.settled_pressure(command),
        }
    }

    /// `A22(u)` and `B2(u)` of Eq. (2.24b) at this command; of a pulse-width valve linearised at `pressure_pa`
    /// (Remark 2.1).
    #[inline]
    pub fn linear(&self, command: T, pressure_pa: T) -> LinearValve<T> {
        match self {
            Self::Proportional { time_constant_s, gain_pa_a } => {
                LinearValve { a22_per_s: -time_constant_s.recip(), b2_pa_s: *gain_pa_a * command / *time_constant_s }
            }
            Self::PulseWidth(law) => law.linear(command, pressure_pa),
        }
    }

    /// Over `dt_s` under a constant command, exactly; of a pulse-width valve linearised along its own way from
    /// `pressure_pa`.
    #[inline]
    pub fn step(&self, command: T, pressure_pa: T, dt_s: T) -> ValveStep<T> {
        match self {
            Self::Proportional { .. } => self.linear(command, pressure_pa).step(dt_s),
            Self::PulseWidth(law) => law.step(command, pressure_pa, dt_s),
        }
    }

    /// The same valve in another precision.
    pub fn cast<U: Real>(&self) -> Valve<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        match self {
            Self::Proportional { time_constant_s, gain_pa_a } => {
                Valve::Proportional { time_constant_s: to(*time_constant_s), gain_pa_a: to(*gain_pa_a) }
            }
            Self::PulseWidth(law) => Valve::PulseWidth(law.cast()),
        }
    }
}

/// `dp/dt = a p + b` over a time, for any `b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag<T> {
    a22_per_s: T,
    dt_s: T,
    phi: T,
    psi: T,
    psi_integral: T,
}

impl<T: Real> Lag<T> {
    /// Over `dt_s` by the matrix exponential: exact.
    #[inline]
    pub fn over(a22_per_s: T, dt_s: T) -> Self {
        let (x, per_rate_s) = (a22_per_s * dt_s, a22_per_s.recip());
        // `phi - 1` and `psi - dt` cancel at short steps.
        let less_one = if x.abs() < T::of(LONG) { x.exp_m1() } else { x.exp() - T::one() };
        let psi = less_one * per_rate_s;
        let psi_integral = if x.abs() < T::of(SHORT) {
            dt_s * dt_s * (T::of(0.5) + x * (T::of(1.0 / 6.0) + x * (T::of(1.0 / 24.0) + x * T::of(1.0 / 120.0))))
        } else {
            (psi - dt_s) * per_rate_s
        };
        Self { a22_per_s, dt_s, phi: T::one() + less_one, psi, psi_integral }
    }

    /// Whether it is that of this `a` over this time.
    #[inline]
    pub fn is_over(&self, a22_per_s: T, dt_s: T) -> bool {
        self.a22_per_s == a22_per_s && self.dt_s == dt_s
    }

    /// With this `b`.
    #[inline]
    pub fn driven(&self, b2_pa_s: T) -> ValveStep<T> {
        ValveStep {
            phi: self.phi,
            psi: self.psi,
            drift_pa: self.psi * b2_pa_s,
            drift_integral_pa_s: self.psi_integral * b2_pa_s,
        }
    }
}

impl<T: Real> LinearValve<T> {
    /// Pressure after `dt_s` under a constant command, exactly: `p e^{a22 dt} + b2 (e^{a22 dt} - 1)/a22`.
    #[inline]
    pub fn advance(&self, pressure_pa: T, dt_s: T) -> T {
        let settled = -self.b2_pa_s / self.a22_per_s;
        settled + (pressure_pa - settled) * (self.a22_per_s * dt_s).exp()
    }

    /// Over `dt_s` by the matrix exponential: exact.
    #[inline]
    pub fn step(&self, dt_s: T) -> ValveStep<T> {
        Lag::over(self.a22_per_s, dt_s).driven(self.b2_pa_s)
    }

    /// Over `dt_s` by forward Euler, as the chapter did.
    #[inline]
    pub fn euler_step(&self, dt_s: T) -> ValveStep<T> {
        ValveStep {
            phi: T::one() + self.a22_per_s * dt_s,
            psi: dt_s,
            drift_pa: dt_s * self.b2_pa_s,
            drift_integral_pa_s: T::zero(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_proportional_valve_settles_at_gain_times_current() {
        let valve = Valve::Proportional { time_constant_s: 0.04_f64, gain_pa_a: 1e6 };
        let linear = valve.linear(0.3, 0.0);
        assert!((linear.advance(0.0, 10.0) - 0.3e6).abs() < 1e-6);
        assert!((linear.advance(0.0, 0.04) - 0.3e6 * (1.0 - (-1.0f64).exp())).abs() < 1e-6);
    }

    /// Asserts that the integrals of a lag over `x` of its time constant are exact but for rounding, which cancels by at most
    /// `2/0.1^2`, and for the first term that the series leaves out, `x^4/6!` of a half.
    fn assert_lag_is_exact<T: Real>(x: f64) {
        let tau = 0.04;
        let lag = Lag::over(T::of(-1.0 / tau), T::of(x * tau));
        // By series as long as they converge fast, in double precision: sums of (-x)^k/(k+1)! and (-x)^k/(k+2)!.
        let series = |offset: i32| {
            let (mut term, mut sum) = ((1..=offset).fold(1.0, |product, k| product / f64::from(k)), 0.0);
            for k in 0..40 {
                sum += term;
                term *= -x / f64::from(k + offset + 1);
            }
            sum
        };
        let (psi, psi_integral) = (x * tau * series(1), x * x * tau * tau * series(2));
        let left_out = if x < SHORT { x.powi(4) / 360.0 * (1.0 + x) } else { 0.0 };
        let tolerance = 200.0 * T::epsilon().to_f64_exact() + left_out;
        let near = |found: T, expected: f64| (found.to_f64_exact() / expected - 1.0).abs() < tolerance;
        assert!(near(lag.phi, (-x).exp()) && near(lag.psi, psi), "{x}: {lag:?}");
        assert!(near(lag.psi_integral, psi_integral), "{x}: {lag:?} {psi_integral}");
    }

    #[test]
    fn a_lag_keeps_its_digits_over_short_and_long_steps() {
        for x in [1e-5, 1e-3, 0.0099, 0.0101, 0.0203, 0.05, 0.099, 0.0999, 0.1001, 0.101, 0.3, 1.0, 3.0] {
            assert_lag_is_exact::<f64>(x);
            assert_lag_is_exact::<f32>(x);
        }
    }

    #[test]
    fn a_step_of_the_proportional_valve_is_its_solution_and_its_integral() {
        let valve = Valve::Proportional { time_constant_s: 0.04_f64, gain_pa_a: 1e6 };
        let (command, start, dt) = (0.3, 0.1e6, 0.01);
        let step = valve.step(command, start, dt);
        let linear = valve.linear(command, start);
        assert!((step.phi * start + step.drift_pa - linear.advance(start, dt)).abs() < 1e-6);
        // dp/dt = a22 p + b2, so the change over the step is a22 times the integral plus b2 dt.
        let integral = step.psi * start + step.drift_integral_pa_s;
        let change = linear.advance(start, dt) - start;
        assert!((linear.a22_per_s * integral + linear.b2_pa_s * dt - change).abs() < 1e-6);
    }
}
