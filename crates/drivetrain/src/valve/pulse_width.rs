//! The pulse-width-modulated valve.

use crate::Real;
use crate::valve::{LinearValve, ValveStep};

/// A pulse-width-modulated valve, `dp/dt = C_z sqrt(0.01 P_l u - p)`, Eq. (2.27). The duty cycle `u` is in %.
///
/// The square root is taken of the size of the pressure drop, with its sign, so that the cylinder also empties.
/// Below [`Self::LAMINAR_DROP_PA`] the flow is in proportion to the drop, as laminar flow is: the slope of the root
/// is infinite where the drop is zero. Left out: the ripple of the pulses and the supply's own dynamics.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PulseWidth<T> {
    /// Flow constant `C_z`, sqrt(Pa)/s.
    pub flow_sqrt_pa_s: T,
    /// Line pressure `P_l`, Pa.
    pub line_pressure_pa: T,
}

impl<T: Real> PulseWidth<T> {
    /// Pressure drop, Pa, below which the flow is in proportion to it.
    pub const LAMINAR_DROP_PA: f64 = 1.0e3;

    /// Pressure that a constant duty cycle ends at, Pa: `0.01 P_l u`.
    #[inline]
    pub fn settled_pressure(&self, duty_percent: T) -> T {
        T::of(0.01) * self.line_pressure_pa * duty_percent
    }

    /// Duty cycle that ends at `pressure_pa`, %.
    #[inline]
    pub fn duty_for(&self, pressure_pa: T) -> T {
        T::of(100.0) * pressure_pa / self.line_pressure_pa
    }

    /// Rate of the cylinder pressure, Pa/s, Eq. (2.27), where `settled_pa` is the [`Self::settled_pressure`] of the duty
    /// cycle that has arrived.
    #[inline]
    pub fn pressure_rate(&self, pressure_pa: T, settled_pa: T) -> T {
        let drop = settled_pa - pressure_pa;
        self.flow_sqrt_pa_s * drop / drop.abs().at_least(T::of(Self::LAMINAR_DROP_PA)).sqrt()
    }

    /// How much faster the pressure rises for each pascal more of pressure drop, 1/s: `-A22` of Remark 2.1.
    #[inline]
    pub fn rate_per_drop(&self, drop_pa: T) -> T {
        let laminar = T::of(Self::LAMINAR_DROP_PA);
        let root = drop_pa.abs().at_least(laminar).sqrt();
        let fraction = if drop_pa.abs() < laminar { T::one() } else { T::of(0.5) };
        fraction * self.flow_sqrt_pa_s / root
    }

    /// The same valve, this many times as slow.
    #[must_use]
    pub fn slowed(self, factor: T) -> Self {
        Self { flow_sqrt_pa_s: self.flow_sqrt_pa_s / factor, ..self }
    }

    /// Where a pressure is after `dt_s` on its way to `settled_pa`, exactly.
    #[inline]
    pub fn moved(&self, pressure_pa: T, settled_pa: T, dt_s: T) -> T {
        let drop = settled_pa - pressure_pa;
        settled_pa - self.fall(drop, dt_s).drop_fraction * drop
    }

    /// Time by which the pressure lags behind its settled value while it moves at this rate, s.
    pub fn lag(&self, rate_pa_s: T) -> T {
        let root = (rate_pa_s / self.flow_sqrt_pa_s).abs();
        root.at_least(T::of(Self::LAMINAR_DROP_PA).sqrt()) / self.flow_sqrt_pa_s
    }

    /// Pressure drop at which the pressure moves at this rate, Pa.
    pub fn drop_for(&self, rate_pa_s: T) -> T {
        self.lag(rate_pa_s) * rate_pa_s
    }

    /// `A22` and `B2` linearised at `pressure_pa`, Remark 2.1.
    #[inline]
    pub fn linear(&self, duty_percent: T, pressure_pa: T) -> LinearValve<T> {
        let settled_pa = self.settled_pressure(duty_percent);
        let slope = self.rate_per_drop(settled_pa - pressure_pa);
        LinearValve { a22_per_s: -slope, b2_pa_s: self.pressure_rate(pressure_pa, settled_pa) + slope * pressure_pa }
    }

    /// Over `dt_s` under a constant duty cycle, linearised along the way from `pressure_pa`.
    #[inline]
    pub fn step(&self, duty_percent: T, pressure_pa: T, dt_s: T) -> ValveStep<T> {
        let settled_pa = self.settled_pressure(duty_percent);
        let drop = settled_pa - pressure_pa;
        let Fall { drop_fraction, drop_integral_s, phi, psi } = self.fall(drop, dt_s);
        let (end_pa, integral_pa_s) = (settled_pa - drop_fraction * drop, settled_pa * dt_s - drop_integral_s * drop);
        ValveStep {
            phi,
            psi,
            drift_pa: end_pa - phi * pressure_pa,
            drift_integral_pa_s: integral_pa_s - psi * pressure_pa,
        }
    }

    /// A pressure drop after `dt_s`.
    ///
    /// While the flow is turbulent the root of the drop falls in a straight line, `r = r_0 - C_z t/2`, so that
    /// `dp+/dp = r/r_0`; in laminar flow the drop decays exponentially.
    #[inline]
    fn fall(&self, drop_pa: T, dt_s: T) -> Fall<T> {
        let (zero, one, two) = (T::zero(), T::one(), T::of(2.0));
        let (root, laminar_root) = (drop_pa.abs().sqrt(), T::of(Self::LAMINAR_DROP_PA).sqrt());
        let flow = self.flow_sqrt_pa_s;
        let turbulent_s = (two * (root - laminar_root) / flow).at_least(zero).at_most(dt_s);
        let r = if turbulent_s > zero { one - flow * turbulent_s / (two * root) } else { one };
        // Integrals of r/r_0 and of its square.
        let psi = turbulent_s * (one + r) / two;
        let drop_integral_s = turbulent_s * (one + r + r * r) / T::of(3.0);

        let decay_per_s = flow / laminar_root;
        let stays = (-decay_per_s * (dt_s - turbulent_s)).exp();
        let lasts_s = (one - stays) / decay_per_s;
        Fall {
            drop_fraction: r * r * stays,
            drop_integral_s: drop_integral_s + r * r * lasts_s,
            phi: r * stays,
            psi: psi + r * lasts_s,
        }
    }

    /// The same valve in another precision.
    pub fn cast<U: Real>(&self) -> PulseWidth<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        PulseWidth { flow_sqrt_pa_s: to(self.flow_sqrt_pa_s), line_pressure_pa: to(self.line_pressure_pa) }
    }
}

/// A pressure drop after some time.
struct Fall<T> {
    /// Fraction of it that is left.
    drop_fraction: T,
    /// Integral of that fraction, s.
    drop_integral_s: T,
    /// Derivative of the pressure at the end by that at the start.
    phi: T,
    /// Integral of that derivative, s.
    psi: T,
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALVE: PulseWidth<f64> = PulseWidth { flow_sqrt_pa_s: 12_000.0, line_pressure_pa: 1e6 };

    #[test]
    fn the_rate_is_the_square_root_of_the_pressure_drop_with_its_sign() {
        // 0.6 of 1 MPa over 0.2 MPa: a drop of 0.4 MPa.
        let rate = VALVE.pressure_rate(0.2e6, VALVE.settled_pressure(60.0));
        assert!((rate - 12_000.0 * 0.4e6_f64.sqrt()).abs() < 1e-6 * rate);
        assert_eq!(VALVE.pressure_rate(0.6e6, 0.2e6), -rate);
        assert_eq!(VALVE.pressure_rate(0.2e6, 0.2e6), 0.0);
    }

    #[test]
    fn the_pulse_width_linearisation_is_tangent_to_its_law() {
        for (duty, at) in [(60.0, 0.2e6), (0.0, 0.2e6), (20.02, 0.2e6)] {
            let rate = |p: f64| VALVE.pressure_rate(p, VALVE.settled_pressure(duty));
            let linear = VALVE.linear(duty, at);
            let tangent = |p: f64| linear.a22_per_s * p + linear.b2_pa_s;
            assert!((tangent(at) - rate(at)).abs() < 1e-6 * rate(at).abs());
            let h = 10.0;
            let slope = (rate(at + h) - rate(at - h)) / (2.0 * h);
            assert!((linear.a22_per_s - slope).abs() < 1e-6 * slope.abs(), "{duty}");
        }
    }

    #[test]
    fn a_step_is_the_solution_of_the_law_with_its_derivative_and_integral() {
        for (duty, start, dt) in
            [(60.0, 0.2e6, 0.01), (60.0, 0.2e6, 0.3), (0.0, 0.3e6, 0.02), (30.05, 0.3e6, 0.005), (30.0, 0.3e6, 0.01)]
        {
            let settled = VALVE.settled_pressure(duty);
            let solve = |start: f64| {
                // Rectangles at the middle: their error falls with the square of the step.
                let (n, mut p, mut integral) = (200_000_u32, start, 0.0);
                let h = dt / f64::from(n);
                for _ in 0..n {
                    let middle = p + 0.5 * h * VALVE.pressure_rate(p, settled);
                    integral += h * middle;
                    p += h * VALVE.pressure_rate(middle, settled);
                }
                (p, integral)
            };
            let step = VALVE.step(duty, start, dt);
            let (end, integral) = solve(start);
            assert!((step.phi * start + step.drift_pa - end).abs() < 1.0, "{duty} {start} {dt}");
            assert!((step.psi * start + step.drift_integral_pa_s - integral).abs() < 1.0 * dt);
            let h = 20.0;
            let ((above, more), (below, less)) = (solve(start + h), solve(start - h));
            assert!((step.phi - (above - below) / (2.0 * h)).abs() < 1e-3, "{duty} {start} {dt}");
            assert!((step.psi - (more - less) / (2.0 * h)).abs() < 1e-3 * dt);
        }
    }

    #[test]
    fn the_drop_for_a_rate_gives_that_rate() {
        for rate in [0.0, 100.0, 0.3e6, -0.3e6, 2e6, -8e6] {
            let found = VALVE.pressure_rate(0.2e6, 0.2e6 + VALVE.drop_for(rate));
            assert!((found - rate).abs() <= 1e-6 * rate.abs(), "{rate} {found}");
        }
    }
}
