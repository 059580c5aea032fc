//! What a vehicle file with a whole gearbox says of its own errors: what it leaves out is that of a car in series.

use serde::Deserialize;

use car::{CarErrorBounds, ElementErrorBounds, ShiftClutch};
use drivetrain::{ClutchValve, CommandKind};

use super::HYSTERESES_PA;
use super::valves::DUTY_CYCLES;
use crate::ConfigError;
use crate::check::{Check, Number, Numbers};

/// `[error_bounds]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawCarErrorBounds {
    converter_share: Option<Number>,
    engine_torque_share: Option<Number>,
    inertia_share: Option<Number>,
    shaft_stiffness_share: Option<Number>,
    wheel_scale_share: Option<Number>,
    mass_share: Option<Number>,
    valve_error_scale: Option<Number>,
}

/// `[clutch.NAME.error_bounds]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawElementErrorBounds {
    friction_factor: Option<Numbers>,
    valve_gain_factor: Option<Numbers>,
    valve_lag_factor: Option<Numbers>,
    valve_delay_s: Option<Numbers>,
    valve_hysteresis_pa: Option<Number>,
    current_a: Option<Number>,
    duty_percent: Option<Number>,
}

/// The bounds of a car whose elements have these.
pub(super) fn of_car(
    check: &Check<'_>,
    raw: &RawCarErrorBounds,
    elements: Vec<ElementErrorBounds>,
) -> Result<CarErrorBounds, ConfigError> {
    let fraction = |key: &str, value: &Option<Number>| {
        value.as_ref().map(|value| check.number(format_args!("error_bounds.{key}"), value, 0.0..=0.9)).transpose()
    };
    let scale = |value: &Number| check.number("error_bounds.valve_error_scale", value, 0.1..=10.0);
    Ok(CarErrorBounds {
        converter_share: fraction("converter_share", &raw.converter_share)?,
        engine_torque_share: fraction("engine_torque_share", &raw.engine_torque_share)?,
        inertia_share: fraction("inertia_share", &raw.inertia_share)?,
        shaft_stiffness_share: fraction("shaft_stiffness_share", &raw.shaft_stiffness_share)?,
        wheel_scale_share: fraction("wheel_scale_share", &raw.wheel_scale_share)?,
        mass_share: fraction("mass_share", &raw.mass_share)?,
        valve_error_scale: raw.valve_error_scale.as_ref().map(scale).transpose()?,
        elements,
    })
}

/// The bounds of an element in the table `table` with these plates and valve. The element of the file is within them.
pub(super) fn of_element(
    check: &Check<'_>,
    table: &str,
    raw: &RawElementErrorBounds,
    clutch: &ShiftClutch,
) -> Result<ElementErrorBounds, ConfigError> {
    let range = |key: &str, values: &Option<Numbers>, allowed| {
        values.as_ref().map(|values| check.pair(format_args!("{table}.{key}"), values, allowed)).transpose()
    };
    let factor = |key: &str, values: &Option<Numbers>| {
        let found = range(key, values, 0.1..=10.0)?;
        match (found, values) {
            (Some([minimum, maximum]), Some(values)) if !(minimum..=maximum).contains(&1.0) => {
                let message = format!(
                    "{minimum} to {maximum} does not contain 1: the car of this file would be outside its own error bounds"
                );
                let hint = Some("an error of 10 % is [0.9, 1.1]".to_owned());
                Err(check.meaning(format_args!("{table}.{key}"), values.span().start, message, hint))
            }
            _ => Ok(found),
        }
    };
    let hysteresis = |value: &Number| {
        check.number(format!("{table}.valve_hysteresis_pa"), value, clutch.hysteresis_pa..=*HYSTERESES_PA.end())
    };
    let valve_delay_s = range("valve_delay_s", &raw.valve_delay_s, 0.0..=0.5)?;
    if let (Some(bounds_s), Some(values)) = (valve_delay_s, &raw.valve_delay_s) {
        contain_delay(check, format_args!("{table}.valve_delay_s"), (bounds_s, values), &clutch.valve)?;
    }
    Ok(ElementErrorBounds {
        friction_factor: factor("friction_factor", &raw.friction_factor)?,
        valve_gain_factor: factor("valve_gain_factor", &raw.valve_gain_factor)?,
        valve_lag_factor: factor("valve_lag_factor", &raw.valve_lag_factor)?,
        valve_delay_s,
        valve_hysteresis_pa: raw.valve_hysteresis_pa.as_ref().map(hysteresis).transpose()?,
        command: command(check, table, raw, clutch.valve.command_kind())?,
    })
}

/// Maximum error of a reading of the command, A or %, if the file has one.
fn command(
    check: &Check<'_>,
    table: &str,
    raw: &RawElementErrorBounds,
    kind: CommandKind,
) -> Result<Option<f64>, ConfigError> {
    let (key, value, foreign, range) = match kind {
        CommandKind::Current => ("current_a", &raw.current_a, ("duty_percent", &raw.duty_percent), 0.0..=1.0),
        CommandKind::DutyCycle => ("duty_percent", &raw.duty_percent, ("current_a", &raw.current_a), DUTY_CYCLES),
    };
    if let (name, Some(given)) = foreign {
        let message = format!("the valve of this element has no such command; its bound is `{key}`");
        let hint = Some(format!("replace `{name}` by `{key}`"));
        return Err(check.meaning(format_args!("{table}.{name}"), given.span().start, message, hint));
    }
    value.as_ref().map(|value| check.number(format_args!("{table}.{key}"), value, range)).transpose()
}

/// Refuses bounds of the delay of a valve that do not contain the valve's own.
pub(super) fn contain_delay(
    check: &Check<'_>,
    key: impl std::fmt::Display,
    ([shortest_s, longest_s], values): ([f64; 2], &Numbers),
    valve: &ClutchValve<f64>,
) -> Result<(), ConfigError> {
    let [minimum_s, maximum_s] = valve.delay_range();
    if shortest_s <= minimum_s && maximum_s <= longest_s {
        return Ok(());
    }
    let own = if minimum_s == maximum_s {
        format!("{minimum_s} s")
    } else {
        format!("{minimum_s} s to {maximum_s} s by the command")
    };
    let message = format!(
        "{shortest_s} to {longest_s} does not contain the delay of the valve in this file, {own}: the car of this file would be outside its own error bounds"
    );
    let hint = format!("[{}, {}] contains it", shortest_s.min(minimum_s), longest_s.max(maximum_s));
    Err(check.meaning(key, values.span().start, message, Some(hint)))
}
