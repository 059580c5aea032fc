//! What goes into an observer and what comes out.

use drivetrain::Real;

use crate::{Bounds, Phase};

/// One sample of what a transmission controller measures and commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input<T> {
    /// Time since the sample before, s. Ignored in the first step.
    pub dt_s: T,
    /// Engine speed `w_e`, rad/s.
    pub engine_rad_s: T,
    /// Turbine speed `w_t`, rad/s.
    pub turbine_rad_s: T,
    /// Slip of the oncoming clutch `dw`, rad/s.
    pub slip_rad_s: T,
    /// Speed of the driven wheels `w_w`, rad/s; NaN where it is not measured.
    pub wheel_rad_s: T,
    /// Command of the oncoming clutch's valve: current in A, or duty cycle in %.
    pub command: T,
}

/// Ranges outside which an input cannot be a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputLimits<T> {
    /// Largest size of a speed, rad/s.
    pub speed_max_rad_s: T,
    /// Largest valve command, A or %; the smallest is zero.
    pub command_max: T,
}

impl<T: Real> InputLimits<T> {
    /// Whether the speeds can be used.
    #[inline]
    pub fn speeds_valid(&self, input: &Input<T>) -> bool {
        // A comparison with NaN is false, so this refuses non-finite values too.
        input.engine_rad_s.abs() <= self.speed_max_rad_s
            && input.turbine_rad_s.abs() <= self.speed_max_rad_s
            && input.slip_rad_s.abs() <= self.speed_max_rad_s + self.speed_max_rad_s
    }

    /// Whether the wheel speed can be used.
    #[inline]
    pub fn wheel_valid(&self, input: &Input<T>) -> bool {
        input.wheel_rad_s.abs() <= self.speed_max_rad_s
    }

    /// Whether the valve command can be used.
    #[inline]
    pub fn command_valid(&self, input: &Input<T>) -> bool {
        input.command >= T::zero() && input.command <= self.command_max
    }

    /// The same limits in another precision.
    pub fn cast<U: Real>(&self) -> InputLimits<U> {
        InputLimits {
            speed_max_rad_s: U::of(self.speed_max_rad_s.to_f64_exact()),
            command_max: U::of(self.command_max.to_f64_exact()),
        }
    }
}

/// How far an estimate can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Health {
    /// Every input was usable.
    Good,
    /// A speed was unusable: the valve model alone carried the estimate over this sample.
    SpeedsRejected,
    /// The valve command was unusable: the last usable one was taken in its place.
    CommandRejected,
    /// The time step was unusable: the estimate is the one before.
    TimeRejected,
}

impl Health {
    /// A word for logs and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::SpeedsRejected => "speeds_rejected",
            Self::CommandRejected => "command_rejected",
            Self::TimeRejected => "time_rejected",
        }
    }
}

/// What an observer knows after one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<T> {
    /// Cylinder pressure of the oncoming clutch, Pa.
    pub pressure_pa: T,
    /// Torque of the oncoming clutch, N m, positive when it drives its output side.
    pub clutch_torque_n_m: T,
    /// Drive-shaft torque, N m, where the observer estimates it.
    pub shaft_torque_n_m: Option<T>,
    /// Phase of the shift, as the supervisor sees it.
    pub phase: Phase,
    /// Whether the input could be used.
    pub health: Health,
    /// Ranges that hold the truth as long as every error is within its budget, where the observer was given one.
    pub bounds: Option<Bounds<T>>,
}

impl<T, O: Estimator<T>> Estimator<T> for &O {
    type State = O::State;

    fn start(&self) -> Self::State {
        (**self).start()
    }

    #[inline]
    fn step(&self, state: &mut Self::State, input: &Input<T>) -> Estimate<T> {
        (**self).step(state, input)
    }
}

/// An observer: tuning in `&self`, memory in its state, one estimate for each sample.
pub trait Estimator<T> {
    /// What it remembers from one sample to the next.
    type State;

    /// Its memory before the first sample.
    fn start(&self) -> Self::State;

    /// Takes one sample and returns the estimate at its time. Never panics; allocates nothing.
    fn step(&self, state: &mut Self::State, input: &Input<T>) -> Estimate<T>;
}
