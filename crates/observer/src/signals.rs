//! Inputs and outputs of an observer.

pub use car::{Input, LOST_S, Reading};
use drivetrain::{Real, ReducedShift};

use crate::{Bounds, Phase};

/// All signals at one time, as an observer with a fixed sample time needs them. A value that is not a number is not
/// known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<T> {
    /// Time since the sample before, s. Ignored in the first step.
    pub dt_s: T,
    /// Engine speed `w_e`, rad/s.
    pub engine_rad_s: T,
    /// Turbine speed `w_t`, rad/s.
    pub turbine_rad_s: T,
    /// Slip of the oncoming clutch `dw`, rad/s.
    pub slip_rad_s: T,
    /// Speed of the driven wheels `w_w`, rad/s.
    pub wheel_rad_s: T,
    /// Command of the oncoming clutch's valve: current in A, or duty cycle in %.
    pub command: T,
}

impl<T: Real> Sample<T> {
    /// The same as readings of every channel at the moment of the step.
    pub fn input(&self, shift: &ReducedShift<T>) -> Input<T> {
        let now = |value: T| Some(Reading::now(value));
        Input {
            engine_rad_s: now(self.engine_rad_s),
            turbine_rad_s: now(self.turbine_rad_s),
            output_rad_s: now(shift.output_speed(self.turbine_rad_s, self.slip_rad_s)),
            wheel_rad_s: now(self.wheel_rad_s),
            command: now(self.command),
            ..Input::none(self.dt_s)
        }
    }
}

/// All signals at the time of a step, and what became of each channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aligned<T> {
    /// The signals; NaN where there is none.
    pub sample: Sample<T>,
    /// What became of each channel.
    pub channels: Channels<ChannelHealth>,
}

/// Ranges outside which an input cannot be a measurement, and an estimate cannot be a pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InputLimits<T> {
    /// Largest size of a speed, rad/s.
    pub speed_max_rad_s: T,
    /// Largest valve command, A or %; the smallest is zero.
    pub command_max: T,
    /// Error of a reading of a valve command, A or %: one that is so far outside the range of the commands is its end.
    pub command_error: T,
    /// Highest pressure that the supply can give, Pa; the lowest is zero.
    pub pressure_max_pa: T,
    /// Largest size of a drive-shaft torque, N m.
    pub shaft_torque_max_n_m: T,
}

impl<T: Real> InputLimits<T> {
    /// Whether the speeds can be used.
    #[inline]
    pub fn speeds_valid(&self, sample: &Sample<T>) -> bool {
        self.speed_valid(sample.engine_rad_s) && self.slip_valid(sample)
    }

    /// Whether turbine speed and slip can be used.
    #[inline]
    pub fn slip_valid(&self, sample: &Sample<T>) -> bool {
        self.speed_valid(sample.turbine_rad_s) && sample.slip_rad_s.abs() <= self.speed_max_rad_s + self.speed_max_rad_s
    }

    /// Whether a speed can be one of this gearbox.
    #[inline]
    pub fn speed_valid(&self, speed_rad_s: T) -> bool {
        // A comparison with NaN is false, so this refuses non-finite values too.
        speed_rad_s.abs() <= self.speed_max_rad_s
    }

    /// Whether the wheel speed can be used.
    #[inline]
    pub fn wheel_valid(&self, sample: &Sample<T>) -> bool {
        self.speed_valid(sample.wheel_rad_s)
    }

    /// The valve command of a reading; none if it cannot be one. The current of a valve that is off is measured a little above or below
    /// zero.
    #[inline]
    pub fn possible_command(&self, command: T) -> Option<T> {
        let possible = command.at_least(T::zero()).at_most(self.command_max);
        // A comparison with NaN is false, so this refuses non-finite values too.
        ((command - possible).abs() <= self.command_error).then_some(possible)
    }

    /// A reading of a valve command as far as it can be used.
    #[inline]
    pub(crate) fn read_command(&self, reading: &Reading<T>) -> Option<Reading<T>> {
        let value = self.possible_command(reading.value)?;
        (reading.age_s >= T::zero() && reading.age_s.is_finite()).then_some(Reading { value, ..*reading })
    }

    /// Whether a drive-shaft torque is a number within its limit.
    #[inline]
    pub fn shaft_torque_possible(&self, torque_n_m: T) -> bool {
        torque_n_m.abs() <= self.shaft_torque_max_n_m
    }

    /// The nearest pressure that the supply can give, Pa.
    #[inline]
    pub fn possible_pressure(&self, pressure_pa: T) -> T {
        pressure_pa.at_least(T::zero()).at_most(self.pressure_max_pa)
    }

    /// The same limits in another precision.
    pub fn cast<U: Real>(&self) -> InputLimits<U> {
        InputLimits {
            speed_max_rad_s: U::of(self.speed_max_rad_s.to_f64_exact()),
            command_max: U::of(self.command_max.to_f64_exact()),
            command_error: U::of(self.command_error.to_f64_exact()),
            pressure_max_pa: U::of(self.pressure_max_pa.to_f64_exact()),
            shaft_torque_max_n_m: U::of(self.shaft_torque_max_n_m.to_f64_exact()),
        }
    }
}

/// Health of an estimate, from best to worst. If several apply, the worst one is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Health {
    /// Every reading is usable, and the estimate is within its limits.
    Good,
    /// A reading was refused: it is impossible, or it contradicts all the others.
    ReadingRefused,
    /// A channel has given no usable reading for long: the estimate is less certain.
    ChannelLost,
    /// Both clutches slip and the turbine runs away from the old gear in the direction of its torque: the oncoming clutch
    /// carries too little. It fills late, is starved or has too little friction, or the offgoing one let go too early.
    Flare,
    /// The estimate is outside its range: the observer has a large error, or the car is outside its error budget.
    OutsideRange,
    /// The estimate was outside its guaranteed range, and is the nearest end of it.
    LimitedToRange,
    /// The shifts so far show a quantity of the car beyond the bound of its error: the guaranteed ranges do not hold.
    BeyondBounds,
    /// Over many shifts the valve commands have come late or early against the speeds: the guaranteed ranges do not hold. No observer says
    /// this, which needs the time after a shift; what reads a whole log does.
    CommandsMistimed,
    /// The valve command is unusable: the last usable command is used.
    CommandRejected,
    /// The pressure of the observer is below zero or above the highest pressure of the supply: the estimate is that
    /// limit.
    PressureLimited,
    /// The gearbox output turns too slowly for its readings to be used: the estimate is from the valve model alone; that of the gearbox filter also
    /// from the load of a clutch that does not slip.
    TooSlow,
    /// No gear drives the car, and none has to: neutral, or the clutch of a car without a converter is open, or slips at a launch. The
    /// estimate is from the valve model alone.
    ClutchOpen,
    /// The one-way clutch of the gear overruns: the turbine turns slower than the wheels would turn it, as in coasting. In a gear the
    /// estimate is from the valve model alone.
    OneWayOverruns,
    /// The filter has no equations for this change of gear: two shifts at once, from or to neutral, between gears of the same ratio, or past a
    /// gear where the ratios alone are known. Only the valve models, if there are any, give an estimate.
    ShiftNotModelled,
    /// The speeds cannot be used: the estimate is from the valve model alone.
    SpeedsRejected,
    /// The speeds fit no phase of the gear or shift: an element slips that has to hold.
    HeldClutchSlips,
    /// The observer lost its state and starts again.
    Restarted,
    /// The time step is unusable: the estimate is that of the sample before.
    TimeRejected,
}

impl Health {
    /// All of them, in their order.
    pub const ALL: [Self; 18] = [
        Self::Good,
        Self::ReadingRefused,
        Self::ChannelLost,
        Self::Flare,
        Self::OutsideRange,
        Self::LimitedToRange,
        Self::BeyondBounds,
        Self::CommandsMistimed,
        Self::CommandRejected,
        Self::PressureLimited,
        Self::TooSlow,
        Self::ClutchOpen,
        Self::OneWayOverruns,
        Self::ShiftNotModelled,
        Self::SpeedsRejected,
        Self::HeldClutchSlips,
        Self::Restarted,
        Self::TimeRejected,
    ];

    /// A word for logs and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::ReadingRefused => "reading_refused",
            Self::ChannelLost => "channel_lost",
            Self::Flare => "flare",
            Self::OutsideRange => "outside_range",
            Self::LimitedToRange => "limited_to_range",
            Self::BeyondBounds => "beyond_bounds",
            Self::CommandsMistimed => "commands_mistimed",
            Self::CommandRejected => "command_rejected",
            Self::PressureLimited => "pressure_limited",
            Self::HeldClutchSlips => "held_clutch_slips",
            Self::TooSlow => "too_slow",
            Self::ClutchOpen => "clutch_open",
            Self::OneWayOverruns => "one_way_overruns",
            Self::ShiftNotModelled => "shift_not_modelled",
            Self::SpeedsRejected => "speeds_rejected",
            Self::Restarted => "restarted",
            Self::TimeRejected => "time_rejected",
        }
    }
}

/// What became of a channel in one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ChannelHealth {
    /// The log has no such channel, or the observer does without it.
    Unused,
    /// Its reading was taken.
    Good,
    /// No reading came, or none that can be compared now; the channel goes on as before.
    Absent,
    /// Its reading was refused.
    Refused,
    /// It has given no usable reading for long.
    Lost,
}

impl ChannelHealth {
    /// Whether readings of the channel are not used: refused, or lost for long.
    pub fn is_refused(self) -> bool {
        matches!(self, Self::Refused | Self::Lost)
    }

    /// A word for logs and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unused => "unused",
            Self::Good => "good",
            Self::Absent => "absent",
            Self::Refused => "refused",
            Self::Lost => "lost",
        }
    }
}

/// One of something for each channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Channels<V> {
    /// Engine speed.
    pub engine: V,
    /// Turbine speed.
    pub turbine: V,
    /// Speed of the gearbox output.
    pub output: V,
    /// Speed of the driven wheels.
    pub wheel: V,
    /// Command of the oncoming clutch's valve.
    pub command: V,
    /// Command of the offgoing clutch's valve.
    pub offgoing_command: V,
    /// Reported engine torque.
    pub engine_torque: V,
    /// Longitudinal acceleration.
    pub acceleration: V,
}

impl<V: Copy> Channels<V> {
    /// The same for every channel.
    pub fn all(value: V) -> Self {
        Self {
            engine: value,
            turbine: value,
            output: value,
            wheel: value,
            command: value,
            offgoing_command: value,
            engine_torque: value,
            acceleration: value,
        }
    }

    /// In the order of the fields.
    pub fn each(&self) -> [V; 8] {
        [
            self.engine,
            self.turbine,
            self.output,
            self.wheel,
            self.command,
            self.offgoing_command,
            self.engine_torque,
            self.acceleration,
        ]
    }
}

/// Output of an observer after one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate<T> {
    /// Cylinder pressure of the oncoming clutch, Pa.
    pub pressure_pa: T,
    /// Torque of the oncoming clutch, N m, positive when it drives its output side.
    pub clutch_torque_n_m: T,
    /// Drive-shaft torque, N m, where the observer estimates it.
    pub shaft_torque_n_m: Option<T>,
    /// Phase of the shift according to the supervisor.
    pub phase: Phase,
    /// Whether the input could be used, and whether the estimate can be believed.
    pub health: Health,
    /// What became of the reading of each channel.
    pub channels: Channels<ChannelHealth>,
    /// Ranges that hold the truth as long as every error is within its budget, where the observer was given one.
    /// Guaranteed ranges of pressure and clutch torque and the expected one of the shaft torque, where they are computed.
    pub bounds: Option<Bounds<T>>,
}

/// An observer: tuning in `&self`, memory in its state, one estimate for each step.
pub trait Estimator<T> {
    /// What it remembers from one step to the next.
    type State;

    /// Its memory before the first step.
    fn start(&self) -> Self::State;

    /// Takes what came since the step before and returns the estimate for now. Never panics; allocates nothing.
    fn step(&self, state: &mut Self::State, input: &Input<T>) -> Estimate<T>;

    /// The same where another part has brought the signals to the time of the step by an [`crate::Alignment`] of this
    /// powertrain: an observer that needs them so does not do it again. In a run either all steps are of this kind or none.
    #[inline]
    fn step_aligned(&self, state: &mut Self::State, input: &Input<T>, _aligned: &Aligned<T>) -> Estimate<T> {
        self.step(state, input)
    }
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

    #[inline]
    fn step_aligned(&self, state: &mut Self::State, input: &Input<T>, aligned: &Aligned<T>) -> Estimate<T> {
        (**self).step_aligned(state, input, aligned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limits<T: Real>() -> InputLimits<T> {
        let [speed_max_rad_s, command_max, command_error] = [800.0, 1.2, 0.01].map(T::of);
        let (pressure_max_pa, shaft_torque_max_n_m) = (T::of(1.1e6), T::of(5e3));
        InputLimits { speed_max_rad_s, command_max, command_error, pressure_max_pa, shaft_torque_max_n_m }
    }

    fn a_command_within_its_error_of_the_range_is_its_end<T: Real>() {
        let limits = limits::<T>();
        let of = |command: f64| limits.possible_command(T::of(command)).map(|command| command.to_f64_exact());
        assert_eq!([-0.003, -0.0099, 0.0].map(of), [Some(0.0); 3]);
        let maximum = T::of(1.2).to_f64_exact();
        assert_eq!([1.2, 1.209].map(of), [Some(maximum); 2]);
        assert_eq!([-0.011, 1.211, f64::NAN, f64::NEG_INFINITY, f64::INFINITY].map(of), [None; 5]);
        assert_eq!(of(0.5), Some(0.5));
        let read = |value: f64, age_s: f64| limits.read_command(&Reading { value: T::of(value), age_s: T::of(age_s) });
        assert_eq!(read(-0.003, 0.02), Some(Reading { value: T::zero(), age_s: T::of(0.02) }));
        assert_eq!([read(0.3, -0.01), read(0.3, f64::INFINITY), read(-1.0, 0.0)], [None; 3]);
    }

    #[test]
    fn a_command_within_its_error_of_the_range_is_its_end_in_both_precisions() {
        a_command_within_its_error_of_the_range_is_its_end::<f64>();
        a_command_within_its_error_of_the_range_is_its_end::<f32>();
        let cast = limits::<f64>().cast::<f32>();
        assert_eq!(cast.command_error, 0.01);
    }
}
