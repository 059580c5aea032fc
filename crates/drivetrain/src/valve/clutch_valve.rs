//! The valve of the real car, of either kind.

use crate::valve::{CommandKind, LinearValve, PulseWidth, ValveMaps, ValveStep};
use crate::{Real, Table1};

/// The valve that fills a clutch of the real car: what the plant simulates, the shift controller is calibrated for, and the
/// range of an estimate is made from.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ClutchValve<T> {
    /// Commanded by a current, A; its maps as measured.
    Proportional(ValveMaps<T>),
    /// Commanded by a current, A, with full pressure at none: its maps are over `zero_pressure_a` less the current.
    NormallyHigh {
        /// The maps of the mirrored current.
        maps: ValveMaps<T>,
        /// Current at which it gives no pressure, A.
        zero_pressure_a: T,
    },
    /// Commanded by a duty cycle, %.
    PulseWidth {
        /// How the pressure follows the duty cycle.
        law: PulseWidth<T>,
        /// Delay over the commanded duty cycle: s over %.
        delay_s: Table1<T>,
    },
}

impl<T: Real> ClutchValve<T> {
    /// What its command is.
    pub fn command_kind(&self) -> CommandKind {
        match self {
            Self::Proportional(_) | Self::NormallyHigh { .. } => CommandKind::Current,
            Self::PulseWidth { .. } => CommandKind::DutyCycle,
        }
    }

    /// Maps of a valve that is commanded by a current.
    pub fn maps(&self) -> Option<&ValveMaps<T>> {
        match self {
            Self::Proportional(maps) | Self::NormallyHigh { maps, .. } => Some(maps),
            Self::PulseWidth { .. } => None,
        }
    }

    /// Whether its pressure falls while the command rises.
    #[inline]
    pub fn falls(&self) -> bool {
        matches!(self, Self::NormallyHigh { .. })
    }

    /// Rate of the cylinder pressure, Pa/s, where `settled_pa` is the [`Self::settled_pressure`] of the command that has
    /// arrived.
    #[inline]
    pub fn pressure_rate(&self, pressure_pa: T, settled_pa: T) -> T {
        match self {
            Self::Proportional(maps) | Self::NormallyHigh { maps, .. } => maps.pressure_rate(pressure_pa, settled_pa),
            Self::PulseWidth { law, .. } => law.pressure_rate(pressure_pa, settled_pa),
        }
    }

    /// Pressure that a constant command ends at, Pa.
    #[inline]
    pub fn settled_pressure(&self, command: T) -> T {
        match self {
            Self::Proportional(maps) => maps.settled_pressure(command),
            Self::NormallyHigh { maps, zero_pressure_a } => {
                maps.settled_pressure((*zero_pressure_a - command).at_least(T::zero()))
            }
            Self::PulseWidth { law, .. } => law.settled_pressure(command),
        }
    }

    /// Command that ends at `pressure_pa`: the inverse of [`Self::settled_pressure`].
    pub fn command_for(&self, pressure_pa: T) -> T {
        match self {
            Self::Proportional(maps) => maps.current_for(pressure_pa),
            Self::NormallyHigh { maps, zero_pressure_a } => {
                (*zero_pressure_a - maps.current_for(pressure_pa)).at_least(T::zero())
            }
            Self::PulseWidth { law, .. } => law.duty_for(pressure_pa),
        }
    }

    /// Time by which a pressure that moves at `rate_pa_s` lags behind its settled value, s.
    pub fn lag(&self, pressure_pa: T, rate_pa_s: T) -> T {
        match self {
            Self::Proportional(maps) | Self::NormallyHigh { maps, .. } => maps.time_constant_s.at(pressure_pa),
            Self::PulseWidth { law, .. } => law.lag(rate_pa_s),
        }
    }

    /// Delay of a command, s.
    #[inline]
    pub fn delay(&self, command: T) -> T {
        match self {
            Self::Proportional(maps) => maps.delay_s.at(command),
            Self::NormallyHigh { maps, zero_pressure_a } => maps.delay_s.at(*zero_pressure_a - command),
            Self::PulseWidth { delay_s, .. } => delay_s.at(command),
        }
    }

    /// Minimum and maximum delay over all commands, s.
    pub fn delay_range(&self) -> [T; 2] {
        let (minimum, maximum) = match self {
            Self::Proportional(maps) | Self::NormallyHigh { maps, .. } => maps.delay_s.range(),
            Self::PulseWidth { delay_s, .. } => delay_s.range(),
        };
        [minimum, maximum]
    }

    /// Over `dt_s` on the way from `pressure_pa` to `settled_pa`, with the lag at `pressure_pa`; of a pulse-width valve
    /// linearised along its own way.
    #[inline]
    pub fn step(&self, settled_pa: T, pressure_pa: T, dt_s: T) -> ValveStep<T> {
        match self {
            Self::Proportional(maps) | Self::NormallyHigh { maps, .. } => {
                let a22_per_s = -maps.time_constant_s.at(pressure_pa).recip();
                LinearValve { a22_per_s, b2_pa_s: -a22_per_s * settled_pa }.step(dt_s)
            }
            Self::PulseWidth { law, .. } => law.step(law.duty_for(settled_pa), pressure_pa, dt_s),
        }
    }

    /// Where a pressure is after `dt_s` on its way to `settled_pa`, with the lag at the start.
    #[inline]
    pub fn carried(&self, settled_pa: T, pressure_pa: T, dt_s: T) -> T {
        match self {
            Self::Proportional(maps) | Self::NormallyHigh { maps, .. } => {
                settled_pa + (pressure_pa - settled_pa) * (-dt_s / maps.time_constant_s.at(pressure_pa)).exp()
            }
            Self::PulseWidth { law, .. } => law.moved(pressure_pa, settled_pa, dt_s),
        }
    }

    /// Where a pressure is after `dt_s` on its way to `settled_pa`, at the furthest or at the nearest that a factor on its
    /// lag between the two of `lag_factor` allows.
    #[inline]
    pub fn moved(&self, pressure_pa: T, settled_pa: T, dt_s: T, lag_factor: [T; 2], furthest: bool) -> T {
        match self {
            Self::Proportional(maps) | Self::NormallyHigh { maps, .. } => {
                maps.moved(pressure_pa, settled_pa, dt_s, lag_factor, furthest)
            }
            Self::PulseWidth { law, .. } => {
                let factor = if furthest { lag_factor[0] } else { lag_factor[1] };
                law.slowed(factor).moved(pressure_pa, settled_pa, dt_s)
            }
        }
    }

    /// The valve with its lag, its gain multiplied by these factors, and a constant delay in place of its own if there
    /// is one.
    #[must_use]
    pub fn changed(self, lag_factor: T, gain_factor: T, delay_s: Option<T>) -> Self {
        let delay = |own: Table1<T>| delay_s.map_or(own, Table1::constant);
        let changed = |maps: ValveMaps<T>| ValveMaps {
            time_constant_s: maps.time_constant_s.scaled(lag_factor),
            gain_pa_a: maps.gain_pa_a.scaled(gain_factor),
            delay_s: delay(maps.delay_s),
        };
        match self {
            Self::Proportional(maps) => Self::Proportional(changed(maps)),
            Self::NormallyHigh { maps, zero_pressure_a } => Self::NormallyHigh { maps: changed(maps), zero_pressure_a },
            Self::PulseWidth { law, delay_s } => {
                let mut law = law.slowed(lag_factor);
                law.line_pressure_pa = law.line_pressure_pa * gain_factor;
                Self::PulseWidth { law, delay_s: delay(delay_s) }
            }
        }
    }

    /// The same valve in another precision.
    pub fn cast<U: Real>(&self) -> ClutchValve<U> {
        match self {
            Self::Proportional(maps) => ClutchValve::Proportional(maps.cast()),
            Self::NormallyHigh { maps, zero_pressure_a } => {
                ClutchValve::NormallyHigh { maps: maps.cast(), zero_pressure_a: U::of(zero_pressure_a.to_f64_exact()) }
            }
            Self::PulseWidth { law, delay_s } => ClutchValve::PulseWidth { law: law.cast(), delay_s: delay_s.cast() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maps() -> ValveMaps<f64> {
        ValveMaps {
            time_constant_s: Table1::constant(0.04),
            gain_pa_a: Table1::new(&[0.0, 0.5, 1.0], &[1.0e6, 1.4e6, 1.6e6]).unwrap(),
            delay_s: Table1::new(&[0.0, 1.0], &[0.03, 0.01]).unwrap(),
        }
    }

    #[test]
    fn a_pressure_is_carried_to_where_the_step_ends() {
        let law = PulseWidth { flow_sqrt_pa_s: 12e3, line_pressure_pa: 1e6 };
        let pulse_width = ClutchValve::PulseWidth { law, delay_s: Table1::constant(0.01) };
        let high = ClutchValve::NormallyHigh { maps: maps(), zero_pressure_a: 1.1 };
        for valve in [ClutchValve::Proportional(maps()), high, pulse_width] {
            for (settled, pressure) in [(0.8e6, 0.1e6), (0.0, 0.6e6), (0.3e6, 0.3e6)] {
                let step = valve.step(settled, pressure, 0.01);
                let end = valve.carried(settled, pressure, 0.01);
                assert!((end - (step.phi * pressure + step.drift_pa)).abs() < 1e-6, "{valve:?}: {end} {step:?}");
            }
        }
    }

    #[test]
    fn a_normally_high_valve_mirrors_the_current() {
        let (low, high) =
            (ClutchValve::Proportional(maps()), ClutchValve::NormallyHigh { maps: maps(), zero_pressure_a: 1.1 });
        assert!(high.falls() && !low.falls());
        assert_eq!(high.settled_pressure(1.1), 0.0);
        assert_eq!(high.settled_pressure(1.3), 0.0);
        for pressure in [0.0, 0.05e6, 0.4e6, 1.6e6] {
            let command = high.command_for(pressure);
            assert!((high.settled_pressure(command) - pressure).abs() < 1e-6);
            assert!((command + low.command_for(pressure) - 1.1).abs() < 1e-12);
            assert!((high.delay(command) - low.delay(low.command_for(pressure))).abs() < 1e-12);
        }
        // No current is negative.
        assert_eq!(high.command_for(9e6), 0.0);
        let stronger = high.changed(1.0, 1.1, None);
        assert!((stronger.settled_pressure(0.4) / high.settled_pressure(0.4) - 1.1).abs() < 1e-12);
        assert_eq!(high.cast::<f32>().cast::<f64>().command_for(0.0), f64::from(1.1_f32));
    }
}
