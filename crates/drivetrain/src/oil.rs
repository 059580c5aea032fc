//! The transmission oil.

use crate::Real;

/// Oil temperature of a warm gearbox, degC: what a file leaves out.
pub const WARM_OIL_DEGC: f64 = 80.0;

/// Kinematic viscosity of automatic transmission fluid, m^2/s, at a temperature in degC (Walther's equation):
/// `log10 log10(nu + 0.7) = 7.7635 - 3.0348 log10(T)`, `nu` in mm^2/s and `T` in kelvin.
///
/// Fitted to 34.5 mm^2/s at 40 degC and 7.4 mm^2/s at 100 degC, the fluid after Mercedes-Benz sheet 236.10. Valid from
/// -40 to 150 degC. Left out: ageing of the oil, and air in it.
pub fn viscosity_m2_s<T: Real>(temperature_degc: T) -> T {
    let ten = T::of(10.0);
    let kelvin = temperature_degc + T::of(273.15);
    let double_log = T::of(7.7635) - T::of(3.0348) * kelvin.log10();
    let mm2_s = ten.powf(ten.powf(double_log)) - T::of(0.7);
    mm2_s * T::of(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_viscosity_is_that_of_the_data_sheet() {
        // The data sheet's two values, and the cold ones that were computed from them, to the digits given.
        for (degc, mm2_s, digits) in
            [(40.0, 34.5, 0.05), (100.0, 7.4, 0.05), (60.0, 18.0, 0.5), (5.0, 164.0, 0.5), (-20.0, 889.0, 0.5)]
        {
            assert!((1e6 * viscosity_m2_s::<f64>(degc) - mm2_s).abs() < digits, "{degc}");
        }
    }
}
