//! Usual tolerances of the stroke of a piston.

use drivetrain::Cylinder;
use drivetrain::oil::viscosity_m2_s;

use crate::{FillBudget, OIL_TEMPERATURES_DEGC};

/// Factors on the stroke's volume \[chosen\]: clearance of the pack, and what drained from a parked clutch.
pub const VOLUME_FACTOR: [f64; 2] = [0.75, 1.25];
/// Factors on the pressures at both ends of the plateau \[chosen\]: spring, seal friction, centrifugal pressure.
pub const PLATEAU_FACTOR: [f64; 2] = [0.9, 1.1];
/// Factors on the resistance of the passages \[chosen\]: 10 % of an orifice's area.
pub const RESISTANCE_FACTOR: [f64; 2] = [0.8, 1.25];
/// How far the oil may be from the temperature of the file, K \[chosen\].
const OIL_K: f64 = 15.0;
/// Fraction of the pump's flow that is left at least \[chosen\]: another clutch fills at the same time.
const FLOW_FRACTION: f64 = 0.5;
/// Factors on leak and hydraulic capacity \[chosen\].
const LEAK_FACTOR: f64 = 2.0;
/// The same of the capacity.
const CAPACITY_FACTOR: f64 = 1.5;

/// The limits of a cylinder's stroke within the tolerances above.
pub fn standard(cylinder: &Cylinder<f64>, oil_degc: f64) -> FillBudget<f64> {
    let [cold, hot] = oil_temperatures(oil_degc);
    FillBudget {
        volume_m3: VOLUME_FACTOR.map(|factor| factor * cylinder.stroke_m3),
        preload_pressure_pa: PLATEAU_FACTOR.map(|factor| factor * cylinder.preload_pa),
        kiss_pressure_pa: PLATEAU_FACTOR.map(|factor| factor * cylinder.kiss_pa),
        supply: RESISTANCE_FACTOR.map(|factor| cylinder.supply.with_resistance_factor(factor)),
        exhaust: RESISTANCE_FACTOR.map(|factor| cylinder.exhaust.with_resistance_factor(factor)),
        viscosity_m2_s: [viscosity_m2_s(hot), viscosity_m2_s(cold)],
        flow_max_m3_s: FLOW_FRACTION * cylinder.flow_max_m3_s,
        leak_m3_s_pa: LEAK_FACTOR * cylinder.leak_m3_s_pa,
        capacity_m3_pa: CAPACITY_FACTOR * capacity(cylinder),
    }
}

/// Usual bounds of the temperature of the oil, degC, about that of the file.
pub fn oil_temperatures(oil_degc: f64) -> [f64; 2] {
    [oil_degc - OIL_K, oil_degc + OIL_K]
        .map(|degc| degc.clamp(*OIL_TEMPERATURES_DEGC.start(), *OIL_TEMPERATURES_DEGC.end()))
}

/// The greater of the capacities with the piston on its stop and at the plates, m^3/Pa.
pub fn capacity(cylinder: &Cylinder<f64>) -> f64 {
    cylinder.capacity_m3_pa.max(cylinder.home_capacity_m3_pa)
}
