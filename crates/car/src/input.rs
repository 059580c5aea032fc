//! What came from the car since the step before, of one shift.

use drivetrain::Real;

use crate::Reading;

/// What came since the step before: of each channel the newest reading, or none. Channels may come at any rate, in any
/// phase and in any order.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Input<T> {
    /// Time since the step before, s. Ignored in the first step.
    pub dt_s: T,
    /// Engine speed `w_e`, rad/s.
    pub engine_rad_s: Option<Reading<T>>,
    /// Turbine speed `w_t`, rad/s.
    pub turbine_rad_s: Option<Reading<T>>,
    /// Speed of the gearbox output `w_0`, rad/s.
    pub output_rad_s: Option<Reading<T>>,
    /// Speed of the driven wheels `w_w`, rad/s.
    pub wheel_rad_s: Option<Reading<T>>,
    /// Command of the oncoming clutch's valve: current in A, or duty cycle in %.
    pub command: Option<Reading<T>>,
    /// Command of the offgoing clutch's valve, in the same unit. A log may do without.
    pub offgoing_command: Option<Reading<T>>,
    /// Torque of the engine as its controller reports it, N m: that of combustion less its friction, before the inertia. A log
    /// may do without.
    pub engine_torque_n_m: Option<Reading<T>>,
}

impl<T: Real> Input<T> {
    /// A step of this time, s, in which nothing came.
    pub const fn none(dt_s: T) -> Self {
        Self {
            dt_s,
            engine_rad_s: None,
            turbine_rad_s: None,
            output_rad_s: None,
            wheel_rad_s: None,
            command: None,
            offgoing_command: None,
            engine_torque_n_m: None,
        }
    }

    /// The same input in another precision.
    pub fn cast<U: Real>(&self) -> Input<U> {
        let to = |reading: Option<Reading<T>>| reading.map(|reading| reading.cast());
        Input {
            dt_s: U::of(self.dt_s.to_f64_exact()),
            engine_rad_s: to(self.engine_rad_s),
            turbine_rad_s: to(self.turbine_rad_s),
            output_rad_s: to(self.output_rad_s),
            wheel_rad_s: to(self.wheel_rad_s),
            command: to(self.command),
            offgoing_command: to(self.offgoing_command),
            engine_torque_n_m: to(self.engine_torque_n_m),
        }
    }
}
