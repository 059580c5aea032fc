//! A shift clutch with its valve and cylinder.

use drivetrain::{Clutch, ClutchValve, Cylinder};

use crate::{FillBudget, stroke};

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
    /// Mass of all steel plates, kg, where it is given: they take the heat of a shift.
    pub steel_mass_kg: Option<f64>,
}

/// Density of steel, kg/m^3, and thickness of a steel plate, m \[chosen: 1.6 to 2 mm are usual\].
const STEEL_KG_M3: f64 = 7850.0;
const STEEL_PLATE_M: f64 = 1.8e-3;

impl ShiftClutch {
    /// Limits of the piston's stroke within the tolerances of an error budget that says nothing of it, with oil of this
    /// temperature; none without a stroke.
    pub fn standard_fill_budget(&self, oil_degc: f64) -> Option<FillBudget<f64>> {
        self.has_stroke.then(|| stroke::standard(&self.cylinder, oil_degc))
    }

    /// Mass of all steel plates, kg: where it is not given, one plate of 1.8 mm with the area of the piston for two friction faces.
    pub fn steel_kg(&self) -> f64 {
        let Clutch { friction_faces, piston_area_m2, .. } = self.clutch;
        self.steel_mass_kg.unwrap_or(0.5 * friction_faces * piston_area_m2 * STEEL_PLATE_M * STEEL_KG_M3)
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
