//! A gear train with two given ratios: one planetary set for each clutch.

use drivetrain::Real;

/// A clutch of the train, and what it needs.
pub(super) struct Element {
    /// Its set and the shaft that it brakes; nothing for a ratio of 1.
    pub(super) text: String,
    /// What it connects.
    pub(super) sides: String,
    /// Its torque in its gear over that of the turbine.
    pub(super) torque_fraction: f64,
}

/// Teeth of a sun, and the most of a ring.
const SUNS: std::ops::RangeInclusive<u32> = 20..=480;
const RING_MAX: f64 = 500.0;
/// A ratio as near to 1 is 1.
const DIRECT: f64 = 2e-3;
/// Minimum fraction of the turbine torque that a clutch is made for: in a shift it carries more than in its gear.
const FRACTION_MIN: f64 = 0.3;
/// Inertia of a braked shaft, as it counts at the turbine, kg m^2, of the car that is scaled.
const BRAKED_KG_M2: f64 = 0.0044;
const INERTIA_MIN_KG_M2: f64 = 1e-4;

/// The elements of the gears before and after the shift, with inertias for a torque over that of the car that is scaled.
pub(super) fn elements(ratios: [f64; 2], torque: f64) -> Result<[Element; 2], String> {
    let [before, after] = ratios;
    Ok([element(before, "brake_a", torque)?, element(after, "brake_b", torque)?])
}

fn element(ratio: f64, shaft: &str, torque: f64) -> Result<Element, String> {
    if (ratio - 1.0).abs() < DIRECT {
        let sides = "input = \"turbine\"\noutput = \"output\"".to_owned();
        return Ok(Element { text: String::new(), sides, torque_fraction: 1.0 });
    }
    // Teeth of the sun over those of the ring, which must be more; the members in the order sun, ring, carrier.
    let (teeth, [sun, ring, carrier]) = match ratio {
        _ if ratio > 2.0 => (1.0 / (ratio - 1.0), ["turbine", shaft, "output"]),
        _ if ratio > 1.0 => (ratio - 1.0, [shaft, "turbine", "output"]),
        _ => (1.0 / ratio - 1.0, [shaft, "output", "turbine"]),
    };
    let (sun_teeth, ring_teeth) =
        numbers_of_teeth(teeth).ok_or_else(|| format!("no planetary set has the ratio {ratio}"))?;
    let inertia = (torque * BRAKED_KG_M2 * Real::powi(ratio - 1.0, 2)).max(INERTIA_MIN_KG_M2);
    let text = format!(
        "[[gear_train.shaft]]\nname = \"{shaft}\"\ninertia_kg_m2 = {inertia:.5}\n\n\
         [[gear_train.planetary_set]]\nsun = \"{sun}\"\nring = \"{ring}\"\ncarrier = \"{carrier}\"\n\
         sun_teeth = {sun_teeth}\nring_teeth = {ring_teeth}\n\n"
    );
    let sides = format!("input = \"housing\"\noutput = \"{shaft}\"");
    Ok(Element { text, sides, torque_fraction: (ratio - 1.0).abs().max(FRACTION_MIN) })
}

/// Whole numbers of teeth of sun and ring with about this quotient, the ring with more.
fn numbers_of_teeth(quotient: f64) -> Option<(u32, u32)> {
    let ring = |sun: u32| {
        let exact = f64::from(sun) / quotient;
        let ring = exact.round().max(f64::from(sun) + 1.0);
        (ring <= RING_MAX).then(|| (sun, ring as u32, Real::ln(ring / exact).abs()))
    };
    let best = SUNS.filter_map(ring).min_by(|one, other| one.2.total_cmp(&other.2))?;
    (best.2 < 5e-3).then_some((best.0, best.1))
}
