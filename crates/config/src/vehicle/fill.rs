//! The cylinders of a vehicle file.

use drivetrain::{Clutch, Cylinder};
use serde::Deserialize;

use crate::ConfigError;
use crate::check::{Check, Number};

/// Hydraulic capacities, m^3/Pa: from less than that of the oil alone to an accumulator's.
const CAPACITIES_M3_PA: std::ops::RangeInclusive<f64> = 1e-14..=1e-9;

/// How a cylinder fills. What is left out has the values of [`Cylinder::of_clutch`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawFill {
    enabled: Option<bool>,
    stroke_m: Option<Number>,
    preload_n: Option<Number>,
    home_capacity_m3_pa: Option<Number>,
    capacity_m3_pa: Option<Number>,
    laminar_pa_s2_m5: Option<Number>,
    orifice_pa_s2_m6: Option<Number>,
    exhaust_factor: Option<Number>,
    flow_max_m3_s: Option<Number>,
    leak_m3_s_pa: Option<Number>,
}

/// The cylinder of a clutch with oil of this temperature, and whether its piston has a stroke. `table` is the name of the
/// table that says how it fills.
pub(super) fn cylinder(
    check: &Check<'_>,
    table: &str,
    raw: Option<&RawFill>,
    clutch: &Clutch<f64>,
    oil_degc: f64,
) -> Result<(Cylinder<f64>, bool), ConfigError> {
    let mut cylinder = Cylinder::of_clutch(clutch).with_oil(oil_degc);
    let Some(raw) = raw else { return Ok((cylinder, true)) };
    let number = |field: &str, value: &Option<Number>, default: f64, range| match value {
        Some(value) => check.number(format_args!("{table}.{field}"), value, range),
        None => Ok(default),
    };
    let stroke_m = cylinder.stroke_m3 / clutch.piston_area_m2;
    cylinder.stroke_m3 = clutch.piston_area_m2 * number("stroke_m", &raw.stroke_m, stroke_m, 1e-5..=0.02)?;
    let preload_n = cylinder.preload_pa * clutch.piston_area_m2;
    let preload_n = number("preload_n", &raw.preload_n, preload_n, 0.0..=clutch.return_spring_n)?;
    cylinder.preload_pa = preload_n / clutch.piston_area_m2;
    cylinder.home_capacity_m3_pa =
        number("home_capacity_m3_pa", &raw.home_capacity_m3_pa, cylinder.home_capacity_m3_pa, CAPACITIES_M3_PA)?;
    cylinder.capacity_m3_pa = number("capacity_m3_pa", &raw.capacity_m3_pa, cylinder.capacity_m3_pa, CAPACITIES_M3_PA)?;
    let supply = &mut cylinder.supply;
    supply.laminar_pa_s2_m5 = number("laminar_pa_s2_m5", &raw.laminar_pa_s2_m5, supply.laminar_pa_s2_m5, 1e11..=1e16)?;
    supply.orifice_pa_s2_m6 = number("orifice_pa_s2_m6", &raw.orifice_pa_s2_m6, supply.orifice_pa_s2_m6, 1e10..=1e17)?;
    cylinder.exhaust =
        cylinder.supply.with_resistance_factor(number("exhaust_factor", &raw.exhaust_factor, 1.0, 0.1..=10.0)?);
    cylinder.flow_max_m3_s = number("flow_max_m3_s", &raw.flow_max_m3_s, cylinder.flow_max_m3_s, 1e-6..=0.01)?;
    cylinder.leak_m3_s_pa = number("leak_m3_s_pa", &raw.leak_m3_s_pa, cylinder.leak_m3_s_pa, 0.0..=1e-10)?;
    Ok((cylinder, raw.enabled.unwrap_or(true)))
}
