//! What is fitted, and what is known of it before.

use car::{Shaft, Vehicle};
use drivetrain::Real;

use crate::driving::{AIR, ROLLING, WIND, rolling_floor};
use crate::shape::{Knots, Map};

/// Delays are fitted in units of this, s, so that every unknown is of the order of 0.1 to 1.
pub(crate) const DELAY_UNIT_S: f64 = 0.01;
/// The hysteresis is fitted in units of this, Pa.
pub(crate) const HYSTERESIS_UNIT_PA: f64 = 1e4;
/// The zero offset of a pressure sensor is fitted in units of this, Pa.
pub(crate) const OFFSET_UNIT_PA: f64 = 1e4;
/// Bound of that zero offset, Pa \[chosen: 1 % of a sensor for 3 MPa\].
pub(crate) const OFFSET_PA: f64 = 30e3;
/// The slip at which the shape of the friction changes nothing, rad/s.
pub(crate) const SHAPE_MIDDLE_RAD_S: f64 = 100.0;
/// The friction slope is the change over this slip above it, rad/s.
pub(crate) const SLOPE_SPAN_RAD_S: f64 = 200.0;

/// A quantity of the car or of its signals that is the same in all shifts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Parameter {
    /// Factor on the capacity of the converter.
    Capacity,
    /// Factor on what the torque ratio of the converter is above 1.
    TorqueRatio,
    /// Factor on the friction of the oncoming clutch.
    Friction,
    /// Relative change of its friction at zero slip; linear to none at 100 rad/s.
    FrictionAtRest,
    /// Relative change of its friction from 100 to 300 rad/s of slip.
    FrictionSlope,
    /// Factor on the force of its return spring.
    Spring,
    /// Factor on the gain of its valve.
    Gain,
    /// Factor on the lag of its valve.
    Lag,
    /// Delay added to that of the file from the reading of the command to the valve, s.
    CommandDelay,
    /// Factor on the inertia of a shaft of the gear train, by its place in the file.
    Inertia(usize),
    /// Factor on the stiffness of the drive shafts.
    Stiffness,
    /// Factor on their damping.
    Damping,
    /// Factor on the slip at which the tyres carry a force.
    Tyre,
    /// Factor on the mass of the vehicle.
    Mass,
    /// Factor on the rolling resistance, in driving between shifts; each shift has a load of its own.
    Rolling,
    /// Factor on the air drag, in driving between shifts.
    Air,
    /// Factor on the friction of the offgoing clutch.
    OffgoingFriction,
    /// Delay of the output speed against the turbine speed, s.
    OutputDelay,
    /// Delay of the wheel speed against the turbine speed, s.
    WheelDelay,
    /// Delay of the engine speed against the turbine speed, s.
    EngineDelay,
    /// Factor on the reading of the wheel speed.
    WheelScale,
    /// Factor on the inertia of the engine.
    EngineInertia,
    /// Factor on the engine torque signal.
    EngineTorqueScale,
    /// Delay of the engine torque signal against the turbine speed, s.
    EngineTorqueDelay,
    /// Factor on the reading of the pressure sensor.
    PressureScale,
    /// Zero offset of the pressure sensor: its reading without a pressure, Pa.
    PressureOffset,
    /// Delay of the reading of the pressure against the turbine speed, s.
    PressureDelay,
    /// Half-width of the hysteresis of the oncoming clutch's valve, Pa.
    Hysteresis,
    /// Relative change of a map at a point of its own: the first two where the map is freed.
    Shape(Map, usize),
}

impl Parameter {
    /// Whether it is a relative change of the shape of a map.
    pub fn is_shape(self) -> bool {
        matches!(self, Self::FrictionAtRest | Self::FrictionSlope | Self::Shape(..))
    }

    /// Whether it is a delay; all others but shapes, hysteresis and zero offset are factors.
    pub fn is_delay(self) -> bool {
        matches!(
            self,
            Self::CommandDelay
                | Self::OutputDelay
                | Self::WheelDelay
                | Self::EngineDelay
                | Self::EngineTorqueDelay
                | Self::PressureDelay
        )
    }

    /// The power of the factor with which it grows where all torques of the car grow alike and the speeds stay as they are.
    pub(crate) fn power_of_torque(self) -> f64 {
        match self {
            Self::Capacity | Self::Friction | Self::Inertia(_) | Self::Stiffness | Self::Damping | Self::Mass => 1.0,
            Self::OffgoingFriction | Self::EngineInertia => 1.0,
            // A softer tyre for a greater force, and a signal that shows less of it.
            Self::Tyre | Self::EngineTorqueScale => -1.0,
            // Nor do rolling resistance and air drag, whose ratios to the torques driving hardly tells: they would seem to tell the common factor.
            _ => 0.0,
        }
    }

    /// Whether it acts on the signals and not on the car: it is not part of a vehicle file.
    pub fn is_of_signals(self) -> bool {
        matches!(
            self,
            Self::OutputDelay
                | Self::WheelDelay
                | Self::EngineDelay
                | Self::WheelScale
                | Self::EngineTorqueScale
                | Self::EngineTorqueDelay
                | Self::PressureScale
                | Self::PressureOffset
                | Self::PressureDelay
        )
    }

    /// Whether it acts on readings alone, or between shifts: the motion of the car in a shift stays as it is.
    pub(crate) fn leaves_motion(self) -> bool {
        let is_of_pressure = matches!(self, Self::PressureScale | Self::PressureOffset | Self::PressureDelay);
        let is_of_road = matches!(self, Self::Rolling | Self::Air);
        is_of_pressure || is_of_road || matches!(self, Self::OutputDelay | Self::WheelDelay | Self::WheelScale)
    }

    /// The value in its own unit of the unknown `x`: a factor, s, Pa, or a relative change.
    pub fn value(self, x: f64) -> f64 {
        match self {
            _ if self.is_delay() => DELAY_UNIT_S * x,
            _ if self.is_shape() => x,
            Self::Hysteresis => HYSTERESIS_UNIT_PA * x.max(0.0),
            Self::PressureOffset => OFFSET_UNIT_PA * x,
            _ => Real::exp(x),
        }
    }
}

/// A parameter with what is known of it before the fit: mean and standard deviation of its unknown, which is the logarithm
/// of a factor, a delay in units of 10 ms, a half-width or an offset in units of 10 kPa, or a relative change.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// What it is.
    pub parameter: Parameter,
    /// A name for tables.
    pub name: String,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Minimum one that is stated after a fit: what the model leaves out does not shrink with more logs.
    pub floor: f64,
}

/// Standard deviations from the mean that a value may be away \[chosen: a value that lies anywhere in a range is at most 1.7 away\].
pub(crate) const POSSIBLE: f64 = 4.0;

impl Prior {
    /// Minimum and maximum value that is held possible.
    pub(crate) fn limits(&self) -> [f64; 2] {
        let minimum = self.mean - POSSIBLE * self.sd;
        [
            if self.parameter == Parameter::Hysteresis { minimum.max(0.0) } else { minimum },
            self.mean + POSSIBLE * self.sd,
        ]
    }

    /// Whether a value is at its limit.
    pub(crate) fn is_at_limit(&self, x: f64) -> bool {
        (x - self.mean).abs() >= 0.999 * POSSIBLE * self.sd
    }
}

/// What the logs have besides speeds and commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Available {
    /// Speed of the driven wheels.
    pub wheel: bool,
    /// Pressure of the oncoming clutch, in some shift.
    pub pressure: bool,
    /// Engine torque signal.
    pub engine_torque: bool,
    /// Command of the offgoing clutch's valve.
    pub offgoing: bool,
    /// Driving between shifts.
    pub driving: bool,
}

/// A parameter that is held near the value of the file, with the standard deviation of what is known of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Held {
    pub(crate) parameter: Parameter,
    pub(crate) sd: f64,
}

/// Minimum standard deviation of the zero offset of a pressure sensor, Pa \[chosen: what a valve at rest may leave in an open clutch\].
pub(crate) const OFFSET_FLOOR_PA: f64 = 500.0;
/// The same of one that is fitted with the valve, Pa \[chosen\]: the noise of a current at zero, of which no reading is negative, opens the valve of the
/// model.
const OFFSET_BY_FIT_PA: f64 = 1e3;

/// Minimum standard deviation of a parameter: what the model leaves out does not shrink with more shifts.
pub(crate) fn floor(parameter: Parameter) -> f64 {
    match parameter {
        Parameter::Inertia(_) | Parameter::Stiffness => 0.015,
        Parameter::Damping | Parameter::Tyre | Parameter::Lag | Parameter::Shape(Map::Lag, _) => 0.02,
        Parameter::Hysteresis => 300.0 / HYSTERESIS_UNIT_PA,
        Parameter::Air => WIND,
        Parameter::WheelScale => 1e-4,
        Parameter::PressureScale => 1e-3,
        Parameter::PressureOffset => OFFSET_BY_FIT_PA / OFFSET_UNIT_PA,
        _ if parameter.is_delay() => 0.3e-3 / DELAY_UNIT_S,
        _ => 0.005,
    }
}

/// The standard deviation of a factor that lies anywhere within this fraction of 1.
fn uniform(fraction: f64) -> f64 {
    fraction / 3.0_f64.sqrt()
}

/// The standard deviation of the logarithm of a factor that lies anywhere between these.
pub(crate) fn between([minimum, maximum]: [f64; 2]) -> f64 {
    (Real::ln(maximum / minimum) / 12.0_f64.sqrt()).max(1e-3)
}

/// The parameters of a fit with their priors, from the error budget of the vehicle file; what it does not have is \[chosen\].
pub(crate) fn priors(vehicle: &Vehicle, shafts: &[Shaft], has: Available) -> Vec<Prior> {
    use Parameter as P;
    let budget = &vehicle.error_bounds;
    let delay = |seconds: f64| (seconds / DELAY_UNIT_S).max(0.05);
    let [min_s, max_s] = budget.valve_delay_s;
    let mut list = vec![
        (P::Capacity, "converter capacity", 0.0, uniform(budget.turbine_torque_share)),
        (P::TorqueRatio, "converter torque ratio above 1", 0.0, uniform(0.1)),
        (P::Friction, "friction of the oncoming clutch", 0.0, between(budget.friction_factor)),
        (P::FrictionAtRest, "friction near zero slip", 0.0, uniform(0.1)),
        (P::FrictionSlope, "friction slope, 100 to 300 rad/s", 0.0, uniform(0.1)),
        (P::Spring, "return spring", 0.0, uniform(0.2)),
        (P::Gain, "valve gain", 0.0, between(budget.valve_gain_factor)),
        (P::Lag, "valve lag", 0.0, between(budget.valve_lag_factor)),
        (P::CommandDelay, "delay of the command", 0.0, delay((max_s - min_s) / 12.0_f64.sqrt())),
    ];
    let mut names: Vec<String> = list.iter().map(|(_, name, ..)| (*name).to_owned()).collect();
    for (i, shaft) in shafts.iter().enumerate() {
        list.push((P::Inertia(i), "", 0.0, uniform(0.2)));
        names.push(format!("inertia of shaft `{}`", shaft.name));
    }
    let mut more = vec![
        (P::Stiffness, "shaft stiffness", 0.0, between(budget.shaft_stiffness_factor)),
        (P::Damping, "shaft damping", 0.0, between([0.6, 1.65])),
        (P::Tyre, "tyre slip", 0.0, uniform(0.25)),
        (P::Mass, "vehicle mass", 0.0, uniform(budget.mass_kg / vehicle.road.mass_kg)),
    ];
    let [file, maximum] =
        [vehicle.oncoming.hysteresis_pa, budget.valve_hysteresis_pa].map(|pa| pa / HYSTERESIS_UNIT_PA);
    more.push((P::Hysteresis, "valve hysteresis, half-width", file, uniform(maximum).max(0.02)));
    if has.offgoing {
        more.push((P::OffgoingFriction, "friction of the offgoing clutch", 0.0, between(budget.friction_factor)));
    }
    more.push((P::OutputDelay, "delay of the output speed", 0.0, delay(uniform(budget.channel_skew_s))));
    more.push((P::EngineDelay, "delay of the engine speed", 0.0, delay(uniform(budget.channel_skew_s))));
    if has.wheel {
        let middle_s = 0.5 * budget.wheel_delay_s;
        more.push((P::WheelDelay, "delay of the wheel speed", middle_s / DELAY_UNIT_S, delay(uniform(middle_s))));
        more.push((P::WheelScale, "wheel speed scale", 0.0, uniform(budget.wheel_scale).max(1e-4)));
    }
    if has.engine_torque {
        more.push((P::EngineInertia, "engine inertia", 0.0, uniform(0.1)));
        more.push((P::EngineTorqueScale, "engine torque signal, scale", 0.0, uniform(0.05)));
        more.push((P::EngineTorqueDelay, "engine torque signal, delay", 0.0, delay(uniform(budget.channel_skew_s))));
    }
    if has.pressure {
        more.push((P::PressureScale, "pressure sensor, scale", 0.0, 0.005));
        more.push((P::PressureOffset, "pressure sensor, zero offset", 0.0, uniform(OFFSET_PA / OFFSET_UNIT_PA)));
        more.push((P::PressureDelay, "pressure sensor, delay", 0.0, delay(uniform(budget.channel_skew_s))));
    }
    let road = [(P::Rolling, "rolling resistance", 0.0, uniform(ROLLING)), (P::Air, "air drag", 0.0, uniform(AIR))];
    more.extend(road.into_iter().filter(|_| has.driving));
    names.extend(more.iter().map(|(_, name, ..)| (*name).to_owned()));
    list.extend(more);
    (list.into_iter().zip(names))
        .map(|((parameter, _, mean, sd), name)| {
            let floor = if parameter == P::Rolling { rolling_floor(&vehicle.road) } else { floor(parameter) };
            Prior { parameter, name, mean, sd: sd.max(1e-4), floor }
        })
        .collect()
}

/// Numbers of the shape of a map. The map is taken as a random walk: its change along the map has the range of the map in the error budget,
/// and a point between others is as free as they leave it.
pub(crate) fn shape_priors(vehicle: &Vehicle, knots: &Knots, map: Map, numbers: &[usize]) -> Vec<Prior> {
    let budget = &vehicle.error_bounds;
    let whole = match map {
        Map::Friction => between(budget.friction_factor),
        Map::Lag => between(budget.valve_lag_factor),
        Map::Gain => between(budget.valve_gain_factor),
        Map::Capacity => uniform(budget.turbine_torque_share),
    };
    let prior = |i: &usize| Prior {
        parameter: Parameter::Shape(map, *i),
        name: knots.name(map, *i),
        mean: 0.0,
        sd: (whole * knots.sd_fraction(map, *i)).max(1e-4),
        floor: floor(Parameter::Shape(map, *i)),
    };
    numbers.iter().map(prior).collect()
}

/// The parameters of a fit that frees the shapes of these maps. Of a freed friction the changes at rest and above the middle
/// have the whole range of the error budget.
pub(crate) fn with_shapes(vehicle: &Vehicle, knots: &Knots, bound: &[Prior], freed: &[Map]) -> Vec<Prior> {
    let mut priors = bound.to_vec();
    if freed.contains(&Map::Friction) {
        let sd = between(vehicle.error_bounds.friction_factor);
        for prior in &mut priors {
            if matches!(prior.parameter, Parameter::FrictionAtRest | Parameter::FrictionSlope) {
                prior.sd = prior.sd.max(sd);
            }
        }
    }
    priors.extend(freed.iter().flat_map(|map| shape_priors(vehicle, knots, *map, &[0, 1])));
    priors
}
