//! The error budget of a vehicle file, and what it is where the file says nothing.

use std::ops::RangeInclusive;

use drivetrain::road::GRAVITY_M_S2;
use drivetrain::{CommandKind, RoadLoad};
use observer::FillBudget;
use toml::Spanned;

use super::car_bounds::contain_delay;
use super::error_budget::{ENGINE, HYSTERESIS_PA, STIFFNESS, WHEEL_SCALE, around};
use super::raw::RawErrorBounds;
use super::{HYSTERESES_PA, ShiftClutch, fill_bounds, valves};
use crate::check::{Check, Number, Numbers};
use crate::{ConfigError, Sensors};

/// Age of a command where the file says nothing, s [chosen]: one time step of any log at 20 Hz or more.
const COMMAND_AGE_S: f64 = 0.05;

/// The error budget: bounds on the errors of the observers' model of the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBounds {
    /// Turbine torque from the converter's maps, N m.
    pub turbine_torque_n_m: f64,
    /// The same as a share of the torque.
    pub turbine_torque_share: f64,
    /// Torque that an error of the turbine-side inertia is worth in the inertia phase, N m. Zero in a file with `[gear_train]`: its bound
    /// on the turbine torque is for both.
    pub inertia_torque_n_m: f64,
    /// Pressure from the valve model alone, Pa.
    pub pressure_pa: f64,
    /// Mass of the vehicle, kg.
    pub mass_kg: f64,
    /// Grade, rad.
    pub grade_rad: f64,
    /// Largest drive-shaft torque of a shift, N m: a mass error acts in its proportion.
    pub shaft_torque_n_m: f64,
    /// Torque at the gearbox output that the rigid model leaves out (torsion, tyre slip, grade), N m.
    pub output_torque_n_m: f64,
    /// Torque left in the offgoing clutch when it has let go, N m.
    pub offgoing_torque_n_m: f64,
    /// Time from its first slip until no more than that is left, s.
    pub offgoing_drain_s: f64,
    /// Error of the change of the turbine speed from one sample to the next, rad/s.
    pub turbine_quantum_rad_s: f64,
    /// Error of the change of the output speed from one sample to the next, rad/s.
    pub output_quantum_rad_s: f64,
    /// Error of the change of the slip from one sample to the next, rad/s.
    pub slip_quantum_rad_s: f64,
    /// Error of the change of the wheel speed from one sample to the next, rad/s.
    pub wheel_quantum_rad_s: f64,
    /// Greatest age of a reading, s.
    pub sampling_delay_s: f64,
    /// Rounding of one operation in single precision, as a share.
    pub float32_rounding: f64,
    /// Pressure above the kiss point in a shift, at which errors of gain and friction are weighed, Pa.
    pub shift_pressure_pa: f64,
    /// Rate of the pressure in a shift, at which errors of lag and delay are weighed, Pa/s.
    pub shift_ramp_pa_s: f64,
    /// Least and greatest factor on the lag of the oncoming clutch's valve.
    pub valve_lag_factor: [f64; 2],
    /// Least and greatest factor on its gain.
    pub valve_gain_factor: [f64; 2],
    /// Its least and greatest delay, s.
    pub valve_delay_s: [f64; 2],
    /// Greatest half-width of its hysteresis, Pa.
    pub valve_hysteresis_pa: f64,
    /// Greatest time between a command and the sample that first shows it, s.
    pub command_age_s: f64,
    /// Least and greatest line pressure, Pa.
    pub line_pressure_pa: [f64; 2],
    /// Limits of the oncoming clutch's piston stroke, if it is part of the budget.
    pub fill: Option<FillBudget<f64>>,
    /// Least and greatest factor on the friction of the oncoming clutch.
    pub friction_factor: [f64; 2],
    /// Error of a reading of the valve's command, A or %.
    pub command: f64,
    /// Error of a reading of the slip, rad/s, its age included.
    pub slip_rad_s: f64,
    /// Highest pressure that the supply can give, Pa.
    pub pressure_max_pa: f64,
    /// Error of the scale of the wheel speed, as a share: tyres that are worn, or of another size.
    pub wheel_scale: f64,
    /// Largest delay of the wheel speed, s.
    pub wheel_delay_s: f64,
    /// Largest delay of the turbine speed and of the output speed, each against the other, s.
    pub channel_skew_s: f64,
    /// Error of the torque that the engine controller reports, as a share.
    pub engine_torque_share: f64,
    /// Least and greatest factor on the stiffness of the drive shafts.
    pub shaft_stiffness_factor: [f64; 2],
    /// Twist over which the driveline carries no torque, rad at the wheels.
    pub backlash_rad: f64,
}

/// Delay of the wheel speed, s: filter and bus of the brakes' controller.
const WHEEL_DELAY_S: f64 = 0.03;
/// Delay of turbine against output speed, s: one cycle of a bus.
const CHANNEL_SKEW_S: f64 = 0.01;
/// Factors on the stiffness of the drive shafts.
const STIFFNESS_FACTOR: [f64; 2] = around(STIFFNESS);
/// Twist without torque, rad at the wheels [chosen].
const BACKLASH_RAD: f64 = 0.03;

/// The keys of the error budget that any file may leave out, with the values that they then have.
pub(super) const OPTIONAL: [(&str, &[f64]); 8] = [
    ("valve_hysteresis_pa", &[HYSTERESIS_PA]),
    ("command_age_s", &[COMMAND_AGE_S]),
    ("wheel_scale", &[WHEEL_SCALE]),
    ("wheel_delay_s", &[WHEEL_DELAY_S]),
    ("channel_skew_s", &[CHANNEL_SKEW_S]),
    ("engine_torque_share", &[ENGINE]),
    ("shaft_stiffness_factor", &STIFFNESS_FACTOR),
    ("backlash_rad", &[BACKLASH_RAD]),
];

/// The error budget of a file.
pub(super) fn error_bounds(
    check: &Check<'_>,
    spanned: &Spanned<RawErrorBounds>,
    oncoming: &ShiftClutch,
    oil_degc: f64,
) -> Result<ErrorBounds, ConfigError> {
    let (at, raw) = (spanned.span().start, spanned.get_ref());
    let number =
        |key: &str, value: &Number, range| check.number(format_args!("design.error_bounds.{key}"), value, range);
    let range =
        |key: &str, values: &Numbers, allowed| check.pair(format_args!("design.error_bounds.{key}"), values, allowed);
    let factor = |key: &str, values: &Numbers, allowed| factors(check, key, values, allowed);
    let optional = |key: &str, value: &Option<Number>, range: RangeInclusive<f64>, default: f64| match value {
        Some(value) => number(key, value, range),
        None => Ok(default),
    };
    let pressure_max_pa = number("pressure_max_pa", &raw.pressure_max_pa, 1e5..=10e6)?;
    let line = raw.line_pressure_pa.as_ref();
    let line_pressure_pa = line.map(|line| range("line_pressure_pa", line, 0.0..=pressure_max_pa)).transpose()?;
    let stiffness =
        raw.shaft_stiffness_factor.as_ref().map(|factors| factor("shaft_stiffness_factor", factors, 0.2..=5.0));
    Ok(ErrorBounds {
        wheel_scale: optional("wheel_scale", &raw.wheel_scale, 0.0..=0.2, WHEEL_SCALE)?,
        wheel_delay_s: optional("wheel_delay_s", &raw.wheel_delay_s, 0.0..=0.2, WHEEL_DELAY_S)?,
        channel_skew_s: optional("channel_skew_s", &raw.channel_skew_s, 0.0..=0.1, CHANNEL_SKEW_S)?,
        engine_torque_share: optional("engine_torque_share", &raw.engine_torque_share, 0.0..=1.0, ENGINE)?,
        shaft_stiffness_factor: stiffness.transpose()?.unwrap_or(STIFFNESS_FACTOR),
        backlash_rad: optional("backlash_rad", &raw.backlash_rad, 0.0..=0.2, BACKLASH_RAD)?,
        turbine_torque_n_m: number("turbine_torque_n_m", &raw.turbine_torque_n_m, 0.0..=1e3)?,
        inertia_torque_n_m: 0.0,
        pressure_pa: number("pressure_pa", &raw.pressure_pa, 0.0..=2e6)?,
        mass_kg: number("mass_kg", &raw.mass_kg, 0.0..=20e3)?,
        grade_rad: number("grade_rad", &raw.grade_rad, 0.0..=0.4)?,
        shaft_torque_n_m: number("shaft_torque_n_m", &raw.shaft_torque_n_m, 0.0..=200e3)?,
        output_torque_n_m: number("output_torque_n_m", &raw.output_torque_n_m, 0.0..=50e3)?,
        offgoing_torque_n_m: number("offgoing_torque_n_m", &raw.offgoing_torque_n_m, 0.0..=1e4)?,
        offgoing_drain_s: number("offgoing_drain_s", &raw.offgoing_drain_s, 0.0..=2.0)?,
        turbine_torque_share: number("turbine_torque_share", &raw.turbine_torque_share, 0.0..=0.9)?,
        turbine_quantum_rad_s: number("turbine_quantum_rad_s", &raw.turbine_quantum_rad_s, 0.0..=50.0)?,
        output_quantum_rad_s: number("output_quantum_rad_s", &raw.output_quantum_rad_s, 0.0..=50.0)?,
        slip_quantum_rad_s: number("slip_quantum_rad_s", &raw.slip_quantum_rad_s, 0.0..=50.0)?,
        wheel_quantum_rad_s: number("wheel_quantum_rad_s", &raw.wheel_quantum_rad_s, 0.0..=50.0)?,
        sampling_delay_s: number("sampling_delay_s", &raw.sampling_delay_s, 0.0..=0.2)?,
        float32_rounding: number("float32_rounding", &raw.float32_rounding, 0.0..=1e-3)?,
        shift_pressure_pa: number("shift_pressure_pa", &raw.shift_pressure_pa, 0.0..=2e6)?,
        shift_ramp_pa_s: number("shift_ramp_pa_s", &raw.shift_ramp_pa_s, 0.0..=1e8)?,
        valve_lag_factor: factor("valve_lag_factor", &raw.valve_lag_factor, 0.01..=100.0)?,
        valve_gain_factor: factor("valve_gain_factor", &raw.valve_gain_factor, 0.1..=10.0)?,
        valve_delay_s: range("valve_delay_s", &raw.valve_delay_s, 0.0..=0.5)?,
        valve_hysteresis_pa: optional(
            "valve_hysteresis_pa",
            &raw.valve_hysteresis_pa,
            oncoming.hysteresis_pa..=*HYSTERESES_PA.end(),
            HYSTERESIS_PA.max(oncoming.hysteresis_pa),
        )?,
        command_age_s: optional("command_age_s", &raw.command_age_s, 0.0..=1.0, COMMAND_AGE_S)?,
        line_pressure_pa: line_pressure_pa.unwrap_or([pressure_max_pa; 2]),
        fill: fill_bounds::bounds(check, raw.fill.as_ref(), oncoming, oil_degc)?,
        friction_factor: factor("friction_factor", &raw.friction_factor, 0.1..=10.0)?,
        command: valves::command_error(check, at, raw, oncoming.valve.command_kind())?,
        slip_rad_s: number("slip_rad_s", &raw.slip_rad_s, 0.0..=200.0)?,
        pressure_max_pa,
    })
}

/// Refuses bounds that do not contain the delay of the oncoming clutch's valve. The other bounds are checked where they are read; this one is
/// not, so that a study may change the delay of the true car beyond it.
pub(super) fn contain_vehicle(
    check: &Check<'_>,
    raw: &RawErrorBounds,
    bounds: &ErrorBounds,
    oncoming: &ShiftClutch,
) -> Result<(), ConfigError> {
    let stated = (bounds.valve_delay_s, &raw.valve_delay_s);
    contain_delay(check, "design.error_bounds.valve_delay_s", stated, &oncoming.valve)
}

impl ErrorBounds {
    /// The same for readings by these sensors: a command of this kind errs at least by what its sensor does.
    #[must_use]
    pub fn read_by(mut self, kind: CommandKind, sensors: &Sensors) -> Self {
        if let (CommandKind::Current, Some(current)) = (kind, &sensors.current) {
            self.command = self.command.max(current.error_max_a());
        }
        self
    }

    /// What a grade at its bound does at the wheels of a car with this load, N m.
    pub fn grade_n_m(&self, road: &RoadLoad<f64>) -> f64 {
        road.mass_kg * GRAVITY_M_S2 * road.wheel_radius_m * self.grade_rad.sin()
    }

    /// What a mass at its bound does at the wheels, N m: they answer the shaft torque wrongly by its share.
    pub fn mass_n_m(&self, road: &RoadLoad<f64>) -> f64 {
        self.mass_kg / road.mass_kg * self.shaft_torque_n_m
    }
}

/// Least and greatest of a factor on a value of the file.
fn factors(
    check: &Check<'_>,
    key: &str,
    values: &Numbers,
    allowed: RangeInclusive<f64>,
) -> Result<[f64; 2], ConfigError> {
    let key = format!("design.error_bounds.{key}");
    let [least, greatest] = check.pair(&key, values, allowed)?;
    if (least..=greatest).contains(&1.0) {
        return Ok([least, greatest]);
    }
    let message =
        format!("{least} to {greatest} does not contain 1: the car of this file would be outside its own error budget");
    Err(check.meaning(&key, values.span().start, message, Some("an error of 10 % is [0.9, 1.1]".to_owned())))
}
