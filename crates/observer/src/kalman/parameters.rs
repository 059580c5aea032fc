//! What the filter is told of its sensors and of what it does not know.

use drivetrain::Real;

/// How a toothed wheel is read.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SpeedReading<T> {
    /// Standard deviation of a reading, rad/s.
    pub std_dev_rad_s: T,
    /// Angle by which a reading lags, rad: it spans several teeth, and its middle is half of them ago. Zero for a
    /// reading of the moment.
    pub lag_rad: T,
    /// Angle between two teeth, rad: the last one passed up to that long ago.
    pub pitch_rad: T,
    /// Delay that is known, s.
    pub delay_s: T,
}

/// What the filter does not know: standard deviations, and limits from the error budget.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Uncertainty<T> {
    /// Of the turbine torque, as a fraction.
    pub turbine_share: T,
    /// Time after which that fraction is another, s.
    pub turbine_share_s: T,
    /// Of the shafts' stiffness, as a fraction.
    pub stiffness_fraction: T,
    /// Torque that the shafts gain over the backlash, N m: while their torque is smaller they may carry none.
    pub backlash_n_m: T,
    /// Of the rate of the pressure, as a fraction of it: errors of lag and delay.
    pub valve_fraction: T,
    /// Of the valve's gain, as a fraction.
    pub valve_gain: T,
    /// Time for which an error of a rate persists, s. The filter takes it as white noise of the same power.
    pub rate_s: T,
    /// Of the friction, as a fraction.
    pub friction: T,
    /// Time after which friction and gain are others, s: errors of the model that shifts have in common would otherwise make
    /// the filter surer of both with every shift.
    pub clutch_s: T,
    /// How fast the torque of the offgoing clutch changes while it holds, N m per root second.
    pub offgoing_n_m: T,
    /// Time constant with which it goes once the clutch has let go, s.
    pub offgoing_release_s: T,
    /// How fast the load of the wheels changes in a shift, N m per root second.
    pub load_shifting_n_m: T,
    /// The same in a gear.
    pub load_in_gear_n_m: T,
    /// Of the scale of the wheel speed.
    pub wheel_scale: T,
    /// Minimum and maximum delay of the wheel speed against the earlier one of turbine and output, s.
    pub wheel_delay_s: [T; 2],
    /// Largest delay of output and turbine against each other, s.
    pub skew_s: T,
    /// How well a scale can be known at best: the standard deviation stays above it.
    pub scale_min: T,
    /// The same of a delay, s.
    pub delay_min_s: T,
    /// Output speed below which readings of toothed wheels are too old to be used, rad/s.
    pub output_least_rad_s: T,
}

impl<T: Real> SpeedReading<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> SpeedReading<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        SpeedReading {
            std_dev_rad_s: to(self.std_dev_rad_s),
            lag_rad: to(self.lag_rad),
            pitch_rad: to(self.pitch_rad),
            delay_s: to(self.delay_s),
        }
    }
}

impl<T: Real> Uncertainty<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> Uncertainty<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Uncertainty {
            turbine_share: to(self.turbine_share),
            turbine_share_s: to(self.turbine_share_s),
            stiffness_fraction: to(self.stiffness_fraction),
            backlash_n_m: to(self.backlash_n_m),
            valve_fraction: to(self.valve_fraction),
            valve_gain: to(self.valve_gain),
            rate_s: to(self.rate_s),
            friction: to(self.friction),
            clutch_s: to(self.clutch_s),
            offgoing_n_m: to(self.offgoing_n_m),
            offgoing_release_s: to(self.offgoing_release_s),
            load_shifting_n_m: to(self.load_shifting_n_m),
            load_in_gear_n_m: to(self.load_in_gear_n_m),
            wheel_scale: to(self.wheel_scale),
            wheel_delay_s: self.wheel_delay_s.map(to),
            skew_s: to(self.skew_s),
            scale_min: to(self.scale_min),
            delay_min_s: to(self.delay_min_s),
            output_least_rad_s: to(self.output_least_rad_s),
        }
    }
}
