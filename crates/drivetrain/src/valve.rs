//! Proportional and pulse-width-modulated pressure valves.

use crate::{Real, Table1};

/// The valve law an observer carries: pressure dynamics with constant parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Valve<T> {
    /// Proportional valve, `tau_cv dp/dt = -p + K_cv i`, Eq. (2.15). The command is a current, A.
    Proportional {
        /// Time constant `tau_cv`, s.
        time_constant_s: T,
        /// Gain `K_cv`, Pa/A.
        gain_pa_a: T,
    },
    /// Pulse-width-modulated valve, `dp/dt = C_z sqrt(0.01 P_l u - p)`, Eq. (2.27), linearised at
    /// `p = P_s` (Remark 2.1). The command is a duty cycle, %.
    PulseWidth {
        /// Flow constant `C_z`, sqrt(Pa)/s.
        flow_sqrt_pa_s: T,
        /// Line pressure `P_l`, Pa.
        line_pressure_pa: T,
        /// Pressure `P_s` of the linearisation, Pa.
        operating_pressure_pa: T,
    },
}

/// `dp/dt = a22 p + b2`, the form every observer uses, Eq. (2.24b).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearValve<T> {
    /// `A22`, 1/s, negative.
    pub a22_per_s: T,
    /// `B2(u)`, Pa/s.
    pub b2_pa_s: T,
}

impl<T: Real> Valve<T> {
    /// Smallest pressure drop, Pa, at which the pulse-width law is linearised: its slope is infinite
    /// at zero drop, where the valve is closed and the pressure stands still.
    pub const SMALLEST_DROP_PA: f64 = 1.0e3;

    /// `A22(u)` and `B2(u)` of Eq. (2.24b) at this command.
    #[inline]
    pub fn linear(&self, command: T) -> LinearValve<T> {
        match *self {
            Self::Proportional { time_constant_s, gain_pa_a } => {
                LinearValve { a22_per_s: -time_constant_s.recip(), b2_pa_s: gain_pa_a * command / time_constant_s }
            }
            Self::PulseWidth { flow_sqrt_pa_s, line_pressure_pa, operating_pressure_pa } => {
                let drop = T::of(0.01) * line_pressure_pa * command - operating_pressure_pa;
                let root = drop.max(T::of(Self::SMALLEST_DROP_PA)).sqrt();
                let slope = flow_sqrt_pa_s / (T::of(2.0) * root);
                LinearValve { a22_per_s: -slope, b2_pa_s: flow_sqrt_pa_s * root + slope * operating_pressure_pa }
            }
        }
    }

    /// The same valve in another precision.
    pub fn cast<U: Real>(&self) -> Valve<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        match *self {
            Self::Proportional { time_constant_s, gain_pa_a } => {
                Valve::Proportional { time_constant_s: to(time_constant_s), gain_pa_a: to(gain_pa_a) }
            }
            Self::PulseWidth { flow_sqrt_pa_s, line_pressure_pa, operating_pressure_pa } => Valve::PulseWidth {
                flow_sqrt_pa_s: to(flow_sqrt_pa_s),
                line_pressure_pa: to(line_pressure_pa),
                operating_pressure_pa: to(operating_pressure_pa),
            },
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
}

/// The valve of the real car, `tau_cv dp/dt = -p + K_cv i(t - L_cv)`, Eq. (2.4), with lag, gain and
/// delay that vary with the operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveMaps<T> {
    /// `tau_cv` over pressure: s over Pa.
    pub time_constant_s: Table1<T>,
    /// `K_cv` over current: Pa/A over A.
    pub gain_pa_a: Table1<T>,
    /// `L_cv` over the commanded current: s over A.
    pub delay_s: Table1<T>,
}

impl<T: Real> ValveMaps<T> {
    /// Rate of the cylinder pressure, Pa/s, Eq. (2.4), where `settled_pa` is the
    /// [`Self::settled_pressure`] of the current that has arrived.
    #[inline]
    pub fn pressure_rate(&self, pressure_pa: T, settled_pa: T) -> T {
        (settled_pa - pressure_pa) / self.time_constant_s.at(pressure_pa)
    }

    /// Pressure that a constant current ends at, Pa: `K_cv(i) i`.
    #[inline]
    pub fn settled_pressure(&self, current_a: T) -> T {
        self.gain_pa_a.at(current_a) * current_a
    }

    /// Current that ends at `pressure_pa`, A: the inverse of [`Self::settled_pressure`], which must rise.
    ///
    /// Between two breakpoints the gain is `K0 + s (i - i0)`, so `K(i) i = p` is a quadratic equation.
    pub fn current_for(&self, pressure_pa: T) -> T {
        let (currents, gains) = (self.gain_pa_a.axis(), self.gain_pa_a.values());
        let beyond = currents.iter().zip(gains).position(|(&i, &k)| k * i > pressure_pa);
        let (first, last) = match beyond {
            Some(0) => return pressure_pa / gains[0],
            Some(next) => (next - 1, next),
            None => return pressure_pa / gains[gains.len() - 1],
        };
        let slope = (gains[last] - gains[first]) / (currents[last] - currents[first]);
        let linear = gains[first] - slope * currents[first];
        let root = (linear * linear + T::of(4.0) * slope * pressure_pa).max(T::zero()).sqrt();
        // This form of the solution has no difference of near numbers and holds for a zero slope.
        T::of(2.0) * pressure_pa / (linear + root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_proportional_valve_settles_at_gain_times_current() {
        let valve = Valve::Proportional { time_constant_s: 0.04_f64, gain_pa_a: 1e6 };
        let linear = valve.linear(0.3);
        assert!((linear.advance(0.0, 10.0) - 0.3e6).abs() < 1e-6);
        assert!((linear.advance(0.0, 0.04) - 0.3e6 * (1.0 - (-1.0f64).exp())).abs() < 1e-6);
    }

    #[test]
    fn the_pulse_width_linearisation_is_tangent_to_its_law() {
        let (flow, line, at) = (2000.0, 1e6, 0.2e6);
        let valve = Valve::PulseWidth { flow_sqrt_pa_s: flow, line_pressure_pa: line, operating_pressure_pa: at };
        let rate = |p: f64| flow * (0.01 * line * 60.0 - p).sqrt();
        let linear = valve.linear(60.0);
        let tangent = |p: f64| linear.a22_per_s * p + linear.b2_pa_s;
        assert!((tangent(at) - rate(at)).abs() < 1e-6 * rate(at));
        let h = 10.0;
        let slope = (rate(at + h) - rate(at - h)) / (2.0 * h);
        assert!((linear.a22_per_s - slope).abs() < 1e-6 * slope.abs());
    }

    #[test]
    fn a_closed_pulse_width_valve_stays_finite() {
        let valve =
            Valve::PulseWidth { flow_sqrt_pa_s: 2000.0_f64, line_pressure_pa: 1e6, operating_pressure_pa: 0.2e6 };
        let linear = valve.linear(0.0);
        assert!(linear.a22_per_s.is_finite() && linear.b2_pa_s.is_finite());
    }

    #[test]
    fn current_for_inverts_the_settled_pressure() {
        let maps = ValveMaps {
            time_constant_s: Table1::constant(0.05),
            gain_pa_a: Table1::new(&[0.0, 0.5, 1.0], &[0.7e6, 0.9e6, 1.1e6]).unwrap(),
            delay_s: Table1::constant(0.01),
        };
        for pressure in [0.0_f64, 0.05e6, 0.3e6, 0.9e6, 1.5e6] {
            let current = maps.current_for(pressure);
            assert!((maps.settled_pressure(current) - pressure).abs() < 1e-6);
        }
    }
}
