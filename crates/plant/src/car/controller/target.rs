//! Target of the oncoming slip in the inertia phase, by the kind of shift.

use drivetrain::{Real, ShiftKind};

/// How the slip goes to zero over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SlipCurve {
    /// Half a cosine.
    HalfCosine,
    /// A rate that rises, stays and falls linearly: `rise` and `fall` are fractions of the duration.
    Trapezoid {
        /// Fraction in which the rate rises.
        rise: f64,
        /// Fraction in which it falls: the longer, the softer the synchronous speed is reached.
        fall: f64,
    },
}

/// The target of a kind of shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipTarget {
    /// The slip over time.
    pub curve: SlipCurve,
    /// Duration at 120 rad/s of slip, s; it is proportional to the slip, ...
    pub duration_s: f64,
    /// ... and at least and at most this, s.
    pub within_s: [f64; 2],
    /// A shift lasts longer where the clutches would take more than this fraction of the turbine torque for the change of speed, ...
    pub inertia_fraction: f64,
    /// ... and more than the torque that changes the acceleration of the vehicle by this, m/s^2.
    pub inertia_m_s2: f64,
    /// Fraction of the torque for the change of speed, that of the engine's inertia included, that the engine is asked for: less torque in
    /// an upshift, more in a downshift.
    pub engine: f64,
}

/// The targets of all kinds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipTargets {
    /// Of power-on upshifts.
    pub power_on_up: SlipTarget,
    /// Of power-off upshifts.
    pub power_off_up: SlipTarget,
    /// Of power-on downshifts.
    pub power_on_down: SlipTarget,
    /// Of coast downshifts.
    pub coast_down: SlipTarget,
    /// From neutral to a gear at rest.
    pub from_neutral: SlipTarget,
}

impl SlipTarget {
    /// A duration alone, that changes with the slip by a factor from 0.55 to 1.3.
    pub(super) const fn lasting(duration_s: f64, curve: SlipCurve) -> Self {
        let (within_s, unlimited) = ([0.55 * duration_s, 1.3 * duration_s], f64::INFINITY);
        Self { curve, duration_s, within_s, inertia_fraction: unlimited, inertia_m_s2: unlimited, engine: 0.0 }
    }
}

impl SlipTargets {
    /// The target of a kind.
    pub(super) fn of(&self, kind: ShiftKind) -> &SlipTarget {
        match kind {
            ShiftKind::PowerOnUp => &self.power_on_up,
            ShiftKind::PowerOffUp => &self.power_off_up,
            ShiftKind::PowerOnDown => &self.power_on_down,
            ShiftKind::CoastDown => &self.coast_down,
        }
    }
}

impl SlipCurve {
    /// Between two values: value and rate after `elapsed_s` of `duration_s`.
    pub(super) fn at(self, from: f64, to: f64, elapsed_s: f64, duration_s: f64) -> (f64, f64) {
        let fraction = (elapsed_s / duration_s).clamp(0.0, 1.0);
        match self {
            Self::HalfCosine => {
                let angle = std::f64::consts::PI * fraction;
                let running = if fraction < 1.0 { 1.0 } else { 0.0 };
                let half = 0.5 * (from - to);
                let rate = -half * std::f64::consts::PI / duration_s * Real::sin(angle) * running;
                (to + half * (1.0 + Real::cos(angle)), rate)
            }
            Self::Trapezoid { rise, fall } => {
                let peak = self.peak();
                let left = 1.0 - fraction;
                let (way, rate) = if fraction < rise {
                    (0.5 * peak * fraction * fraction / rise, peak * fraction / rise)
                } else if left > fall {
                    (peak * (fraction - 0.5 * rise), peak)
                } else {
                    (1.0 - 0.5 * peak * left * left / fall, peak * left / fall)
                };
                (from + way * (to - from), rate * (to - from) / duration_s)
            }
        }
    }

    /// Largest rate over the mean rate.
    pub(super) fn peak(self) -> f64 {
        match self {
            Self::HalfCosine => std::f64::consts::FRAC_PI_2,
            Self::Trapezoid { rise, fall } => 1.0 / (1.0 - 0.5 * (rise + fall)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_goes_from_one_value_to_the_other_with_the_rate_of_its_change() {
        for curve in [SlipCurve::HalfCosine, SlipCurve::Trapezoid { rise: 0.2, fall: 0.4 }] {
            let at = |elapsed_s: f64| curve.at(80.0, -2.0, elapsed_s, 0.5);
            let values = [at(0.0).0, at(0.5).0, at(0.9).0];
            assert!(values.iter().zip([80.0, -2.0, -2.0]).all(|(value, is)| (value - is).abs() < 1e-12), "{values:?}");
            assert!(at(0.0).1.abs() < 1e-12 && at(0.5).1.abs() < 1e-12 && at(0.9).1.abs() < 1e-12, "{curve:?}");
            let largest = (1..500).fold(0.0, |largest: f64, i| {
                let time_s = 1e-3 * f64::from(i);
                let rate = (at(time_s + 1e-6).0 - at(time_s - 1e-6).0) / 2e-6;
                assert!((rate - at(time_s).1).abs() < 0.01, "{curve:?} {time_s}: {rate} {:?}", at(time_s));
                largest.max(-rate)
            });
            assert!((largest - curve.peak() * 82.0 / 0.5).abs() < 0.1, "{curve:?}: {largest}");
        }
    }
}
