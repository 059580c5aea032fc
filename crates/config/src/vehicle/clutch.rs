//! The shift clutches of a vehicle file.

use car::ShiftClutch;
use drivetrain::Clutch;

use super::raw::{RawClutch, RawVehicleFile};
use super::{fill, valves};
use crate::ConfigError;
use crate::check::{Check, Key};

/// Mean radii of plates, m.
pub(crate) const PLATE_RADII_M: std::ops::RangeInclusive<f64> = 0.02..=0.5;
/// Numbers of friction faces.
pub(crate) const FRICTION_FACES: std::ops::RangeInclusive<f64> = 1.0..=30.0;
/// Areas of pistons, m^2: of a small car's clutch to a heavy truck's.
pub(crate) const PISTON_AREAS_M2: std::ops::RangeInclusive<f64> = 0.0001..=0.2;
/// Forces of return springs, N.
pub(crate) const RETURN_SPRINGS_N: std::ops::RangeInclusive<f64> = 0.0..=20e3;
/// Half-widths of a valve's hysteresis, Pa.
pub(crate) const HYSTERESES_PA: std::ops::RangeInclusive<f64> = 0.0..=0.2e6;
/// The clutch of this name, with oil of this temperature.
pub(super) fn check(
    check: &Check<'_>,
    name: &str,
    file: &RawVehicleFile,
    oil_degc: f64,
) -> Result<ShiftClutch, ConfigError> {
    let raw: &RawClutch = &file.clutch[name];
    let table = format!("clutch.{name}");
    let key = |name: &'static str| Key { table: &table, name };
    let friction = check.table(
        (key("friction.slip_rad_s"), &raw.friction.slip_rad_s, 0.0..=2e3),
        (key("friction.coefficient"), &raw.friction.coefficient, 0.02..=0.5),
    )?;
    let clutch = Clutch {
        mean_radius_m: check.number(key("mean_radius_m"), &raw.mean_radius_m, PLATE_RADII_M)?,
        friction_faces: check.count(key("friction_faces"), &raw.friction_faces, FRICTION_FACES)?,
        piston_area_m2: check.number(key("piston_area_m2"), &raw.piston_area_m2, PISTON_AREAS_M2)?,
        return_spring_n: check.number(key("return_spring_n"), &raw.return_spring_n, RETURN_SPRINGS_N)?,
        static_friction: check.number(key("static_friction"), &raw.static_friction, 0.02..=0.5)?,
        friction,
    };
    let (holding, sliding) = (clutch.static_friction, clutch.friction.at(0.0));
    if holding < sliding {
        let message = format!("is {holding}, less than the value of `friction` at zero slip, {sliding}");
        let hint = "with a smaller static friction the clutch could neither stick nor slip".to_owned();
        return Err(check.meaning(key("static_friction"), raw.static_friction.span().start, message, Some(hint)));
    }
    let valve = &raw.valve;
    if let Some(zero) = &valve.get_ref().zero_pressure_a {
        let message = "is for cars with a gearbox file".to_owned();
        let hint = "the observers of one shift need a valve whose pressure rises with the current".to_owned();
        return Err(check.meaning(key("valve.zero_pressure_a"), zero.span().start, message, Some(hint)));
    }
    let (cylinder, has_stroke) = fill::cylinder(check, &format!("{table}.fill"), raw.fill.as_ref(), &clutch, oil_degc)?;
    Ok(ShiftClutch {
        clutch,
        valve: valves::clutch_valve(check, &format!("{table}.valve"), valve)?,
        hysteresis_pa: match &valve.get_ref().hysteresis_pa {
            Some(half_width) => check.number(key("valve.hysteresis_pa"), half_width, HYSTERESES_PA)?,
            None => 0.0,
        },
        cylinder,
        has_stroke,
        drag_n_m: 0.0,
        steel_mass_kg: None,
    })
}
