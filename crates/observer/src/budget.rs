//! Largest errors of a clutch and its valve.

use drivetrain::{ClutchValve, Real};

use crate::fill_range::FillBudget;

/// Largest errors under which the ranges of pressure and clutch torque hold.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Budget<T> {
    /// The valve as measured: lag, gain and delay over the operating point.
    pub valve: ClutchValve<T>,
    /// Minimum and maximum factor on its lag.
    pub lag_factor: [T; 2],
    /// Minimum and maximum factor on its gain.
    pub gain_factor: [T; 2],
    /// Minimum and maximum delay, s.
    pub delay_s: [T; 2],
    /// Maximum half-width of its hysteresis, Pa: how far the settled pressure may be from that of the command.
    pub hysteresis_pa: T,
    /// Error of a reading of the command, A or %.
    pub command: T,
    /// Maximum time between a command and the sample that first shows it, s; it counts up to the time step.
    pub command_age_s: T,
    /// Minimum and maximum line pressure, Pa: what the supply gives at most at any time.
    pub line_pressure_pa: [T; 2],
    /// Highest pressure that the supply can give, Pa.
    pub pressure_max_pa: T,
    /// The piston's stroke; without one the cylinder has the pressure of the valve's outlet.
    pub fill: Option<FillBudget<T>>,
    /// Minimum and maximum factor on the clutch's friction.
    pub friction_factor: [T; 2],
    /// Maximum peak of the drag of its open plates, N m ([`drivetrain::clutch::drag_torque`]).
    pub drag_n_m: T,
    /// Error of a reading of the slip, rad/s.
    pub slip_rad_s: T,
}

impl<T: Real> Budget<T> {
    /// The same budget in another precision.
    pub fn cast<U: Real>(&self) -> Budget<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Budget {
            valve: self.valve.cast(),
            lag_factor: self.lag_factor.map(to),
            gain_factor: self.gain_factor.map(to),
            delay_s: self.delay_s.map(to),
            hysteresis_pa: to(self.hysteresis_pa),
            command: to(self.command),
            command_age_s: to(self.command_age_s),
            line_pressure_pa: self.line_pressure_pa.map(to),
            pressure_max_pa: to(self.pressure_max_pa),
            fill: self.fill.as_ref().map(FillBudget::cast),
            friction_factor: self.friction_factor.map(to),
            drag_n_m: to(self.drag_n_m),
            slip_rad_s: to(self.slip_rad_s),
        }
    }
}
