//! The proportional valve of the real car, measured.

use crate::{Real, Table1};

/// What is left of its way when a pressure at its furthest is taken to have arrived, Pa \[chosen\]: far below any reading. An
/// exponential never arrives, and what stands still need not be computed again.
const ARRIVED_PA: f64 = 1e-3;

/// The proportional valve of the real car, `tau_cv dp/dt = -p + K_cv i(t - L_cv)`, Eq. (2.4), with lag, gain and
/// delay that vary with the operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
        let missing_pa = settled_pa - pressure_pa;
        // Most of a drive a valve rests, where its lag does not matter.
        if missing_pa == T::zero() { missing_pa } else { missing_pa / self.time_constant_s.at(pressure_pa) }
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
        let root = (linear * linear + T::of(4.0) * slope * pressure_pa).at_least(T::zero()).sqrt();
        // This form of the solution has no difference of near numbers and holds for a zero slope.
        T::of(2.0) * pressure_pa / (linear + root)
    }

    /// Where a pressure is after `dt_s` on its way to `settled_pa`: at the furthest, with the shortest lag that it can
    /// meet times `lag_factor[0]`, or at the nearest, with the longest times `lag_factor[1]`.
    #[inline]
    pub fn moved(&self, pressure_pa: T, settled_pa: T, dt_s: T, lag_factor: [T; 2], furthest: bool) -> T {
        let arrived = furthest && (settled_pa - pressure_pa).abs() <= T::of(ARRIVED_PA);
        if arrived || pressure_pa == settled_pa {
            return settled_pa;
        }
        let here = self.time_constant_s.place(pressure_pa);
        let lags = |to: T| {
            let (shortest, longest) = self.time_constant_s.range_from(&here, to);
            [shortest * lag_factor[0], longest * lag_factor[1]]
        };
        // It cannot get further than at its first speed, which tells what lags it meets.
        let fraction = (dt_s / lags(settled_pa)[0]).at_most(T::one());
        let reach = pressure_pa + fraction * (settled_pa - pressure_pa);
        let [shortest, longest] = lags(reach);
        let lag_s = if furthest { shortest } else { longest };
        settled_pa + (pressure_pa - settled_pa) * (-dt_s / lag_s).exp()
    }

    /// The same maps in another precision.
    pub fn cast<U: Real>(&self) -> ValveMaps<U> {
        ValveMaps {
            time_constant_s: self.time_constant_s.cast(),
            gain_pa_a: self.gain_pa_a.cast(),
            delay_s: self.delay_s.cast(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_the_missing_pressure_over_the_lag_at_this_pressure() {
        let maps = ValveMaps {
            time_constant_s: Table1::new(&[0.0_f64, 1e6], &[0.1, 0.02]).unwrap(),
            gain_pa_a: Table1::new(&[0.0, 1.0], &[0.8e6, 1.2e6]).unwrap(),
            delay_s: Table1::constant(0.01),
        };
        // At 0.5 A the gain is 1 MPa/A; at 0.25 MPa the lag is 0.08 s.
        let settled = maps.settled_pressure(0.5);
        assert!((settled - 0.5e6).abs() < 1e-6);
        assert!((maps.pressure_rate(0.25e6, settled) - 0.25e6 / 0.08).abs() < 1e-6);
    }

    #[test]
    fn only_at_the_furthest_a_pressure_arrives() {
        let maps = ValveMaps {
            time_constant_s: Table1::constant(0.05),
            gain_pa_a: Table1::constant(1e6),
            delay_s: Table1::constant(0.01),
        };
        for (start, end) in [(0.5 * ARRIVED_PA, 0.0), (0.2e6 - 0.5 * ARRIVED_PA, 0.2e6)] {
            assert_eq!(maps.moved(start, end, 0.01, [0.5, 1.5], true), end);
            let nearest = maps.moved(start, end, 0.01, [0.5, 1.5], false);
            assert!((nearest - end).abs() > 0.3 * ARRIVED_PA && (nearest - end).abs() < (start - end).abs());
        }
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
