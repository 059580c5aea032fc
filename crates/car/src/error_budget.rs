//! The error budget of a car with a gearbox: for every bound the one of its file, or the default.
//!
//! Filter, guaranteed ranges, checks of a log, sampled cars and fits all take their bounds from here, element by element.

use drivetrain::{ClutchValve, CommandKind};

use crate::{Car, ElementErrorBounds, Sensors, ShiftClutch};

/// Relative error of a clutch's friction where the file gives none \[chosen\]; so are the other defaults.
const FRICTION: f64 = 0.15;
/// Of the gain of a valve.
const VALVE_GAIN: f64 = 0.10;
/// Of the lag of a valve.
const VALVE_LAG: f64 = 0.5;
/// Of the converter's capacity.
const CONVERTER: f64 = 0.10;
/// Of the engine torque that the engine's controller reports.
pub const ENGINE: f64 = 0.08;
/// Of the turbine-side inertia `M11` of a shift.
const INERTIA: f64 = 0.20;
/// Of the stiffness of the drive shafts.
pub const STIFFNESS: f64 = 0.20;
/// Of the scale of the wheel speed: size, wear and pressure of the tyres.
pub const WHEEL_SCALE: f64 = 0.02;
/// Half-width of the hysteresis of a valve, Pa: trade data sheets of proportional pressure reducers give 2 to 4 % of full scale for the whole
/// width.
pub const HYSTERESIS_PA: f64 = 10e3;
/// Delay of a valve, s.
const VALVE_DELAY_S: [f64; 2] = [0.0, 0.03];
/// What the delay of a valve may differ from that of its file by, where that is outside [`VALVE_DELAY_S`], s.
const VALVE_DELAY_ERROR_S: f64 = 0.015;
/// Age of a command where the file says nothing, s \[chosen\]: one time step of any log at 20 Hz or more.
pub const COMMAND_AGE_S: f64 = 0.05;

/// Delay of the wheel speed, s: filter and bus of the brakes' controller.
pub const WHEEL_DELAY_S: f64 = 0.03;
/// Delay of turbine against output speed, s: one cycle of a bus.
pub const CHANNEL_SKEW_S: f64 = 0.01;
/// Factors on the stiffness of the drive shafts.
pub const STIFFNESS_FACTOR: [f64; 2] = around(STIFFNESS);
/// Twist without torque, rad at the wheels \[chosen\].
pub const BACKLASH_RAD: f64 = 0.03;
/// Error of a reading of a valve's command, relative to its maximum \[chosen\]: five standard deviations of a usual sensor.
const COMMAND: f64 = 0.01;
/// Room above the largest command that a valve needs for line pressure: controllers saturate their valves \[chosen\].
const COMMAND_ROOM: f64 = 1.2;
/// Largest duty cycle, %.
const FULL_DUTY: f64 = 100.0;
/// Maximum age of a command in a log, s. It counts up to the time between two readings of the command, however long that is.
const LOGGED_COMMAND_AGE_S: f64 = 10.0;

/// Bounds of the errors of a car's file, of its sensors and of its commands: the only place of such a bound.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorBudget {
    /// Relative error of the converter's capacity.
    pub converter: f64,
    /// Relative error of the engine torque that the engine's controller reports.
    pub engine: f64,
    /// Relative error of the turbine-side inertia `M11` of a shift, of the true one.
    pub inertia: f64,
    /// Relative error of the stiffness of the drive shafts.
    pub stiffness: f64,
    /// Relative error of the scale of the wheel speed.
    pub wheel_scale: f64,
    /// Standard deviations of the clutch torques in the filter, relative to those by the bounds of the elements.
    pub valve_error_scale: f64,
    /// Maximum time between a command and the reading that first shows it, s: of the guaranteed range.
    pub command_age_s: f64,
    /// Of each element of the gearbox, in its order; `None` where it has no plates.
    pub elements: Vec<Option<ElementErrors>>,
}

/// Bounds of the errors of an element and its valve, and of what its valve can be commanded and can give.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementErrors {
    /// Minimum and maximum factor on the friction.
    pub friction_factor: [f64; 2],
    /// The same on the gain of the valve.
    pub valve_gain_factor: [f64; 2],
    /// The same on its lag.
    pub valve_lag_factor: [f64; 2],
    /// Minimum and maximum delay, s.
    pub valve_delay_s: [f64; 2],
    /// The middle of the delays that the valve of the file can have without a stated bound, s.
    pub valve_delay_middle_s: f64,
    /// Maximum half-width of its hysteresis, Pa.
    pub valve_hysteresis_pa: f64,
    /// Maximum error of a reading of its command, A or %.
    pub command: f64,
    /// Largest command, A or %.
    pub command_max: f64,
    /// Highest pressure, Pa: line pressure by the strongest valve of the budget.
    pub pressure_max_pa: f64,
}

impl ErrorBudget {
    /// The bounds of a car whose commands are read at the moment when they are sent.
    pub fn of_car(car: &Car) -> Self {
        let own = &car.error_bounds;
        let elements = car.clutches.iter().enumerate().map(|(element, clutch)| {
            let bounds = own.elements.get(element).copied().unwrap_or_default();
            clutch.as_ref().map(|clutch| ElementErrors::of(clutch, &bounds, car.line_pressure_pa))
        });
        Self {
            converter: own.converter_share.unwrap_or(CONVERTER),
            engine: own.engine_torque_share.unwrap_or(ENGINE),
            inertia: own.inertia_share.unwrap_or(INERTIA),
            stiffness: own.shaft_stiffness_share.unwrap_or(STIFFNESS),
            wheel_scale: own.wheel_scale_share.unwrap_or(WHEEL_SCALE),
            valve_error_scale: own.valve_error_scale.unwrap_or(1.0),
            command_age_s: 0.0,
            elements: elements.collect(),
        }
    }

    /// The same where the commands stand in a log, whose rows may come less often than commands are sent.
    pub fn of_logged_car(car: &Car) -> Self {
        Self { command_age_s: LOGGED_COMMAND_AGE_S, ..Self::of_car(car) }
    }

    /// The same for readings by these sensors: a command errs at least by what its sensor does.
    #[must_use]
    pub fn read_by(mut self, car: &Car, sensors: Option<&Sensors>) -> Self {
        let Some(current) = sensors.and_then(|sensors| sensors.current) else { return self };
        let error_a = current.error_max_a();
        for (element, clutch) in self.elements.iter_mut().zip(&car.clutches) {
            if let (Some(element), Some(clutch)) = (element, clutch)
                && clutch.valve.command_kind() == CommandKind::Current
            {
                element.command = element.command.max(error_a);
            }
        }
        self
    }

    /// The bounds of an element by its place in the gearbox; `None` if it has no plates.
    pub fn element(&self, element: usize) -> Option<&ElementErrors> {
        self.elements.get(element)?.as_ref()
    }

    /// The largest of a value over all elements with plates; that of the defaults in a gearbox by its ratios alone, which has none.
    pub fn widest(&self, of: impl Fn(&ElementErrors) -> f64) -> f64 {
        self.elements.iter().flatten().map(&of).reduce(f64::max).unwrap_or_else(|| of(&ElementErrors::NO_ELEMENT))
    }
}

impl ElementErrors {
    /// The defaults of what no valve has a part in; no command and no pressure.
    const NO_ELEMENT: Self = Self {
        friction_factor: around(FRICTION),
        valve_gain_factor: around(VALVE_GAIN),
        valve_lag_factor: around(VALVE_LAG),
        valve_delay_s: VALVE_DELAY_S,
        valve_delay_middle_s: 0.5 * (VALVE_DELAY_S[0] + VALVE_DELAY_S[1]),
        valve_hysteresis_pa: HYSTERESIS_PA,
        command: 0.0,
        command_max: 0.0,
        pressure_max_pa: 0.0,
    };

    fn of(clutch: &ShiftClutch, own: &ElementErrorBounds, line_pressure_pa: f64) -> Self {
        let valve_gain_factor = own.valve_gain_factor.unwrap_or(around(VALVE_GAIN));
        let [needed, command_max] = command_limits(&clutch.valve, line_pressure_pa, valve_gain_factor);
        Self {
            friction_factor: own.friction_factor.unwrap_or(around(FRICTION)),
            valve_gain_factor,
            valve_lag_factor: own.valve_lag_factor.unwrap_or(around(VALVE_LAG)),
            valve_delay_s: own.valve_delay_s.unwrap_or_else(|| default_delay_s(&clutch.valve)),
            valve_delay_middle_s: 0.5 * default_delay_s(&clutch.valve).iter().sum::<f64>(),
            valve_hysteresis_pa: own.valve_hysteresis_pa.unwrap_or(HYSTERESIS_PA.max(clutch.hysteresis_pa)),
            command: own.command.unwrap_or(COMMAND * needed),
            command_max,
            pressure_max_pa: line_pressure_pa * valve_gain_factor[1],
        }
    }

    /// The relative error of the friction: half of its range, and more where the range lies to one side of the value of the file.
    pub fn friction(&self) -> f64 {
        off_by(self.friction_factor, 1.0)
    }

    /// The same of the gain of the valve.
    pub fn valve_gain(&self) -> f64 {
        off_by(self.valve_gain_factor, 1.0)
    }

    /// The same of its lag.
    pub fn valve_lag(&self) -> f64 {
        off_by(self.valve_lag_factor, 1.0)
    }

    /// How many times as wide as the default its bounds are, at least one: the wider of friction and gain, of hysteresis and command, and of lag and
    /// delay.
    pub fn widths(&self) -> [f64; 3] {
        let usual = Self::NO_ELEMENT;
        // The largest factor by which a value may be off, in either direction.
        let off = |[minimum, maximum]: [f64; 2]| maximum.max(minimum.recip()) - 1.0;
        let room = if self.command_max == FULL_DUTY { 1.0 } else { COMMAND_ROOM };
        let of_torque = [
            off(self.friction_factor) / off(usual.friction_factor),
            off(self.valve_gain_factor) / off(usual.valve_gain_factor),
        ];
        let of_offset =
            [self.valve_hysteresis_pa / usual.valve_hysteresis_pa, room * self.command / (COMMAND * self.command_max)];
        let of_timing =
            [off(self.valve_lag_factor) / off(usual.valve_lag_factor), self.valve_delay() / usual.valve_delay()];
        [of_torque, of_offset, of_timing]
            .map(|widths| widths.into_iter().filter(|width| width.is_finite()).fold(1.0, f64::max))
    }

    /// What an error of the reading of the command does to the pressure of the valve at this pressure, Pa.
    pub fn by_command_pa(&self, valve: &ClutchValve<f64>, pressure_pa: f64) -> f64 {
        let at = valve.command_for(pressure_pa);
        let off_pa = |command: f64| (valve.settled_pressure(command) - valve.settled_pressure(at)).abs();
        off_pa(at + self.command).max(off_pa((at - self.command).max(0.0)))
    }

    /// The error of its delay, s, as that of the friction.
    pub fn valve_delay(&self) -> f64 {
        off_by(self.valve_delay_s, self.valve_delay_middle_s)
    }
}

/// The largest command that a valve needs, A or %, with this line pressure and these factors on its gain, and the largest that it may get.
pub fn command_limits(valve: &ClutchValve<f64>, line_pressure_pa: f64, gain_factor: [f64; 2]) -> [f64; 2] {
    match valve.command_kind() {
        // The controller of the weakest valve commands what that one needs. A normally-high valve has its largest command without pressure.
        CommandKind::Current => {
            let highest_pa = line_pressure_pa * gain_factor[1].max(gain_factor[0].recip());
            let needed = valve.command_for(0.0).max(valve.command_for(highest_pa));
            [needed, COMMAND_ROOM * needed]
        }
        CommandKind::DutyCycle => [FULL_DUTY; 2],
    }
}

/// Factors up to a relative error.
pub const fn around(relative: f64) -> [f64; 2] {
    [1.0 - relative, 1.0 + relative]
}

/// How far values of a range are from this value: half of the range's width where the value is in the middle of it. Another range has the same root
/// mean square as the range of this half-width about the value.
fn off_by([minimum, maximum]: [f64; 2], value: f64) -> f64 {
    let (low, high) = (minimum - value, maximum - value);
    (low * low + low * high + high * high).sqrt()
}

/// Half of the width of a range.
pub(crate) fn half_width([minimum, maximum]: [f64; 2]) -> f64 {
    0.5 * (maximum - minimum)
}

/// The default bounds of the delay of a valve, s. They contain its own.
fn default_delay_s(valve: &ClutchValve<f64>) -> [f64; 2] {
    let [minimum_s, maximum_s] = valve.delay_range();
    let [shortest_s, longest_s] = VALVE_DELAY_S;
    if maximum_s <= longest_s {
        return [shortest_s, longest_s];
    }
    [(minimum_s - VALVE_DELAY_ERROR_S).max(shortest_s), maximum_s + VALVE_DELAY_ERROR_S]
}
