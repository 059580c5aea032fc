//! The shift clutches of a vehicle file.

use drivetrain::{Clutch, ClutchValve, Cylinder};
use observer::FillBudget;

use super::raw::{RawClutch, RawVehicleFile};
use super::{fill, fill_bounds, valves};
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
/// A shift clutch with the valve that fills it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftClutch {
    /// Geometry and friction.
    pub clutch: Clutch<f64>,
    /// The real valve.
    pub valve: ClutchValve<f64>,
    /// Half-width of the valve's hysteresis, Pa. Observers and shift controller do not know it.
    pub hysteresis_pa: f64,
    /// The cylinder.
    pub cylinder: Cylinder<f64>,
    /// Whether the piston has a stroke; if not, the pressure at the valve's outlet acts on the plates, as in the chapter.
    pub has_stroke: bool,
    /// Peak of the drag of the open clutch, N m.
    pub drag_n_m: f64,
}

impl ShiftClutch {
    /// Limits of the piston's stroke within the tolerances of an error budget that says nothing of it, with oil of this
    /// temperature; none without a stroke.
    pub fn standard_fill_budget(&self, oil_degc: f64) -> Option<FillBudget<f64>> {
        self.has_stroke.then(|| fill_bounds::standard(&self.cylinder, oil_degc))
    }

    /// Pressure on the plates, Pa, with this pressure at the valve's outlet and this oil in the cylinder.
    #[inline]
    pub fn pressure(&self, valve_pa: f64, volume_m3: f64) -> f64 {
        if self.has_stroke { self.cylinder.pressure(volume_m3) } else { valve_pa }
    }

    /// Rate of the oil in the cylinder, m^3/s; zero without a stroke.
    #[inline]
    pub fn volume_rate(&self, volume_m3: f64, valve_pa: f64) -> f64 {
        if self.has_stroke { self.cylinder.volume_rate(volume_m3, valve_pa) } else { 0.0 }
    }

    /// Derivatives of that rate by the oil, 1/s, and by the valve's pressure, m^3/(s Pa).
    #[inline]
    pub fn volume_rate_slopes(&self, volume_m3: f64, valve_pa: f64) -> (f64, f64) {
        if self.has_stroke { self.cylinder.volume_rate_slopes(volume_m3, valve_pa) } else { (0.0, 0.0) }
    }
}

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
        let hint = "the observers of a single shift know valves only whose pressure rises with the current".to_owned();
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
    })
}
