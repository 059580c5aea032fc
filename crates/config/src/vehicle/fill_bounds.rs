//! Limits of a piston stroke in the error budget.

use std::ops::RangeInclusive;

use car::stroke::{PLATEAU_FACTOR, RESISTANCE_FACTOR, VOLUME_FACTOR, capacity, oil_temperatures, standard};
use car::{FillBudget, OIL_TEMPERATURES_DEGC, ShiftClutch};
use drivetrain::Cylinder;
use drivetrain::oil::viscosity_m2_s;
use serde::Deserialize;

use crate::ConfigError;
use crate::check::{Check, Number, Numbers};

/// Limits of the oncoming clutch's stroke. What is left out is within the usual tolerances of the car's own cylinder.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawFillBounds {
    volume_factor: Option<Numbers>,
    preload_pressure_pa: Option<Numbers>,
    kiss_pressure_pa: Option<Numbers>,
    resistance_factor: Option<Numbers>,
    oil_temperature_degc: Option<Numbers>,
    flow_max_m3_s: Option<Number>,
    leak_m3_s_pa: Option<Number>,
    capacity_m3_pa: Option<Number>,
}

/// The limits of the oncoming clutch's stroke; none for a clutch without a stroke, unless the budget has a table for it.
pub(super) fn bounds(
    check: &Check<'_>,
    raw: Option<&RawFillBounds>,
    oncoming: &ShiftClutch,
    oil_degc: f64,
) -> Result<Option<FillBudget<f64>>, ConfigError> {
    if raw.is_none() && !oncoming.has_stroke {
        return Ok(None);
    }
    let none = RawFillBounds::default();
    let raw = raw.unwrap_or(&none);
    let cylinder = &oncoming.cylinder;
    let [preload_pressure_pa, kiss_pressure_pa] = plateau(check, raw, cylinder)?;
    let factors =
        |key: &str, given: &Option<Numbers>, default| interval(check, key, given.as_ref(), 1.0, default, 0.05..=20.0);
    let volume = factors("volume_factor", &raw.volume_factor, VOLUME_FACTOR)?;
    let resistance = factors("resistance_factor", &raw.resistance_factor, RESISTANCE_FACTOR)?;
    let oil = oil_temperatures(oil_degc);
    let given = raw.oil_temperature_degc.as_ref();
    let [cold, hot] = interval(check, "oil_temperature_degc", given, oil_degc, oil, OIL_TEMPERATURES_DEGC)?;
    let number = |key: &str, given: &Option<Number>, default: f64, allowed| match given {
        Some(given) => check.number(key_of(key), given, allowed),
        None => Ok(default),
    };
    let (flow, leak, capacity) = (cylinder.flow_max_m3_s, cylinder.leak_m3_s_pa, capacity(cylinder));
    let standard = standard(cylinder, oil_degc);
    Ok(Some(FillBudget {
        volume_m3: volume.map(|factor| factor * cylinder.stroke_m3),
        preload_pressure_pa,
        kiss_pressure_pa,
        supply: resistance.map(|factor| cylinder.supply.with_resistance_factor(factor)),
        exhaust: resistance.map(|factor| cylinder.exhaust.with_resistance_factor(factor)),
        viscosity_m2_s: [viscosity_m2_s(hot), viscosity_m2_s(cold)],
        flow_max_m3_s: number("flow_max_m3_s", &raw.flow_max_m3_s, standard.flow_max_m3_s, 1e-7..=flow)?,
        leak_m3_s_pa: number("leak_m3_s_pa", &raw.leak_m3_s_pa, standard.leak_m3_s_pa, leak..=1e-9)?,
        capacity_m3_pa: number("capacity_m3_pa", &raw.capacity_m3_pa, standard.capacity_m3_pa, capacity..=1e-8)?,
    }))
}

fn key_of(key: &str) -> String {
    format!("design.error_bounds.fill.{key}")
}

/// An interval of a quantity whose value in the car of this file is known.
fn interval(
    check: &Check<'_>,
    key: &str,
    given: Option<&Numbers>,
    value: f64,
    default: [f64; 2],
    allowed: RangeInclusive<f64>,
) -> Result<[f64; 2], ConfigError> {
    let Some(given) = given else { return Ok(default) };
    let [minimum, maximum] = check.pair(key_of(key), given, allowed)?;
    if (minimum..=maximum).contains(&value) {
        return Ok([minimum, maximum]);
    }
    let message = format!(
        "{minimum} to {maximum} does not contain {value}: the car of this file would be outside its own error budget"
    );
    let hint = Some(format!("[{}, {}] contains it", minimum.min(value), maximum.max(value)));
    Err(check.meaning(key_of(key), given.span().start, message, hint))
}

/// Preload and kiss pressure.
fn plateau(check: &Check<'_>, raw: &RawFillBounds, cylinder: &Cylinder<f64>) -> Result<[[f64; 2]; 2], ConfigError> {
    let limits = |key: &str, given: Option<&Numbers>, value: f64| {
        interval(check, key, given, value, PLATEAU_FACTOR.map(|factor| factor * value), 0.0..=2e6)
    };
    let (preload_given, kiss_given) = (raw.preload_pressure_pa.as_ref(), raw.kiss_pressure_pa.as_ref());
    let preload = limits("preload_pressure_pa", preload_given, cylinder.preload_pa)?;
    let kiss = limits("kiss_pressure_pa", kiss_given, cylinder.kiss_pa)?;
    match preload_given.or(kiss_given) {
        Some(place) if preload[0] > kiss[0] || preload[1] > kiss[1] => {
            let message = format!("{preload:?} Pa is above `kiss_pressure_pa`, {kiss:?} Pa");
            let hint = "the return spring is longer with the piston on its stop than at the kiss point".to_owned();
            Err(check.meaning(key_of("preload_pressure_pa"), place.span().start, message, Some(hint)))
        }
        _ => Ok([preload, kiss]),
    }
}
