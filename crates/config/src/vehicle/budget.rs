//! The error budget of a vehicle file, and what it is where the file says nothing.

use std::ops::RangeInclusive;

use car::error_budget::{
    BACKLASH_RAD, CHANNEL_SKEW_S, COMMAND_AGE_S, ENGINE, HYSTERESIS_PA, STIFFNESS_FACTOR, WHEEL_DELAY_S, WHEEL_SCALE,
};
use car::{ErrorBounds, ShiftClutch, Vehicle};
use drivetrain::ClutchValve;
use toml::Spanned;

use super::car_bounds::contain_delay;
use super::raw::RawErrorBounds;
use super::{HYSTERESES_PA, fill_bounds, plausible, valves};
use crate::ConfigError;
use crate::check::{Check, Number, Numbers};

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

/// Refuses bounds that do not contain the delay and the pressures of the oncoming clutch's valve. The other bounds are checked where they are read;
/// these are not, so that a study may change the true car beyond them.
pub(super) fn contain_vehicle(check: &Check<'_>, raw: &RawErrorBounds, vehicle: &Vehicle) -> Result<(), ConfigError> {
    let Vehicle { error_bounds: bounds, oncoming, settings, .. } = vehicle;
    let stated = (bounds.valve_delay_s, &raw.valve_delay_s);
    contain_delay(check, "design.error_bounds.valve_delay_s", stated, &oncoming.valve)?;
    let outside = |key: &str, at: usize, (message, hint): (String, String)| {
        Err(check.meaning(format_args!("design.error_bounds.{key}"), at, message, Some(hint)))
    };
    let full = plausible::full_command(&oncoming.valve).min(settings.command_max);
    let highest_pa = oncoming.valve.settled_pressure(full);
    let pressure_max_pa = bounds.pressure_max_pa;
    if pressure_max_pa < highest_pa {
        let message = format!(
            "{pressure_max_pa} Pa is less than the {highest_pa:.0} Pa that the valve of this file gives at its largest command: the car of this file would be outside its own error bounds"
        );
        let hint = format!("{:.0} with the largest gain of the bounds", highest_pa * bounds.valve_gain_factor[1]);
        return outside("pressure_max_pa", raw.pressure_max_pa.span().start, (message, hint));
    }
    match (&oncoming.valve, &raw.line_pressure_pa) {
        (ClutchValve::PulseWidth { law, .. }, Some(given)) => {
            let ([least_pa, greatest_pa], own_pa) = (bounds.line_pressure_pa, law.line_pressure_pa);
            if (least_pa..=greatest_pa).contains(&own_pa) {
                return Ok(());
            }
            let message = format!(
                "{least_pa} to {greatest_pa} does not contain the line pressure of the valve in this file, {own_pa} Pa: the car of this file would be outside its own error bounds"
            );
            let hint = format!("[{}, {}] contains it", least_pa.min(own_pa), greatest_pa.max(own_pa));
            outside("line_pressure_pa", given.span().start, (message, hint))
        }
        _ => Ok(()),
    }
}

/// Minimum and maximum of a factor on a value of the file.
fn factors(
    check: &Check<'_>,
    key: &str,
    values: &Numbers,
    allowed: RangeInclusive<f64>,
) -> Result<[f64; 2], ConfigError> {
    let key = format!("design.error_bounds.{key}");
    let [minimum, maximum] = check.pair(&key, values, allowed)?;
    if (minimum..=maximum).contains(&1.0) {
        return Ok([minimum, maximum]);
    }
    let message = format!(
        "{minimum} to {maximum} does not contain 1: the car of this file would be outside its own error budget"
    );
    Err(check.meaning(&key, values.span().start, message, Some("an error of 10 % is [0.9, 1.1]".to_owned())))
}
