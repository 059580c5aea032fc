//! In what the simulated car and its driver differ from the nominal ones.

use car::{OIL_TEMPERATURES_DEGC, OffNominal};
use drivetrain::table::MAX_POINTS;
use serde::Deserialize;

use crate::ConfigError;
use crate::check::{Check, Number, Numbers};
use crate::vehicle::{BACKLASHES_RAD, HYSTERESES_PA};

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawOffNominal {
    engine_torque_factor: Option<Number>,
    converter_capacity_factor: Option<Number>,
    friction_factor: Option<Number>,
    valve_lag_factor: Option<Number>,
    valve_gain_factor: Option<Number>,
    valve_delay_s: Option<Number>,
    valve_hysteresis_pa: Option<Number>,
    piston_stroke: Option<bool>,
    fill_volume_factor: Option<Number>,
    starved_flow_factor: Option<Number>,
    clutch_drag_n_m: Option<Number>,
    oil_temperature_degc: Option<Number>,
    shaft_stiffness_factor: Option<Number>,
    backlash_rad: Option<Number>,
    mass_kg: Option<Number>,
    grade_rad: Option<Number>,
    tip_out_s: Option<Numbers>,
}

/// Checks the differences; `throttle_points` is the number of points of the throttle that a tip-out changes.
pub(super) fn off_nominal(
    check: &Check<'_>,
    raw: &RawOffNominal,
    throttle_points: usize,
) -> Result<OffNominal, ConfigError> {
    let optional = |key: &str, value: &Option<Number>, range| {
        value.as_ref().map(|value| check.number(format_args!("off_nominal.{key}"), value, range)).transpose()
    };
    let factor = |key: &str, value| Ok(optional(key, value, 0.1..=10.0)?.unwrap_or(1.0));
    Ok(OffNominal {
        engine_torque_factor: factor("engine_torque_factor", &raw.engine_torque_factor)?,
        converter_capacity_factor: factor("converter_capacity_factor", &raw.converter_capacity_factor)?,
        friction_factor: factor("friction_factor", &raw.friction_factor)?,
        valve_lag_factor: factor("valve_lag_factor", &raw.valve_lag_factor)?,
        valve_gain_factor: factor("valve_gain_factor", &raw.valve_gain_factor)?,
        valve_delay_s: optional("valve_delay_s", &raw.valve_delay_s, 0.0..=0.5)?,
        valve_hysteresis_pa: optional("valve_hysteresis_pa", &raw.valve_hysteresis_pa, HYSTERESES_PA)?,
        piston_stroke: raw.piston_stroke,
        fill_volume_factor: factor("fill_volume_factor", &raw.fill_volume_factor)?,
        starved_flow_factor: factor("starved_flow_factor", &raw.starved_flow_factor)?,
        clutch_drag_n_m: optional("clutch_drag_n_m", &raw.clutch_drag_n_m, 0.0..=100.0)?.unwrap_or(0.0),
        oil_temperature_degc: optional("oil_temperature_degc", &raw.oil_temperature_degc, OIL_TEMPERATURES_DEGC)?,
        shaft_stiffness_factor: factor("shaft_stiffness_factor", &raw.shaft_stiffness_factor)?,
        backlash_rad: optional("backlash_rad", &raw.backlash_rad, BACKLASHES_RAD)?,
        mass_kg: optional("mass_kg", &raw.mass_kg, 200.0..=60e3)?,
        grade_rad: optional("grade_rad", &raw.grade_rad, -0.4..=0.4)?,
        tip_out_s: raw.tip_out_s.as_ref().map(|times| tip_out(check, times, throttle_points)).transpose()?,
    })
}

fn tip_out(check: &Check<'_>, times: &Numbers, throttle_points: usize) -> Result<[f64; 2], ConfigError> {
    const TIP_S: f64 = OffNominal::TIP_S;
    const TIP_POINTS: usize = OffNominal::TIP_POINTS;
    let key = "off_nominal.tip_out_s";
    let wrong =
        |message: String, hint: &str| Err(check.meaning(key, times.span().start, message, Some(hint.to_owned())));
    let [from_s, until_s] = check.array(key, times, 0.0..=600.0)?;
    if until_s - from_s < 2.0 * TIP_S {
        let message = format!("the accelerator is released at {from_s} s and pressed at {until_s} s");
        let hint = format!("expected [release, press] at least {} s apart: each takes {TIP_S} s", 2.0 * TIP_S);
        return wrong(message, &hint);
    }
    if throttle_points + TIP_POINTS > MAX_POINTS {
        let message = format!("adds {TIP_POINTS} points to the {throttle_points} of the throttle");
        return wrong(message, &format!("a profile has at most {MAX_POINTS} points: give the throttle fewer points"));
    }
    Ok([from_s, until_s])
}
