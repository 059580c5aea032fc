//! A car of whose gearbox the ratios alone are known: what is assumed of its inertia.

use drivetrain::{Engine, ReducedShift};
use geartrain::Gearbox;

/// Minimum and maximum inertia `M11` of the turbine's side of a shift, kg m^2 \[chosen\]: those of all shifts between neighbouring gears
/// of the planetary gearboxes that ship lie between. It differs from shift to shift of one gearbox, by the drums that turn with the
/// turbine.
pub const TURBINE_SIDE_INERTIA_KG_M2: [f64; 2] = [0.078, 0.382];
/// Maximum engine torque of a car with these gearboxes, N m: that of `vehicles/eight_speed.toml`.
pub const ASSUMED_OF_N_M: f64 = 190.0;
/// `M12` and `M22` beside it, kg m^2 \[chosen\]: in the middle of those of these gearboxes, 0.01 to -0.48 and 0.09 to 0.95.
const COUPLING_KG_M2: f64 = -0.2;
const OUTPUT_KG_M2: f64 = 0.4;

/// Gives shifts of which nothing but the ratios is known a mass, by the size of the engine. Returns the fraction of the true
/// inertia by which it may be off, where one was given.
pub fn assume_masses(gearbox: &mut Gearbox, engine: &Engine<f64>) -> Option<f64> {
    let size = engine.largest_torque() / ASSUMED_OF_N_M;
    // The one that is off by the same fraction of either end.
    let [minimum, maximum] = TURBINE_SIDE_INERTIA_KG_M2;
    let middle = 2.0 * minimum * maximum / (minimum + maximum);
    let mass_kg_m2 =
        [[middle, COUPLING_KG_M2], [COUPLING_KG_M2, OUTPUT_KG_M2]].map(|row| row.map(|entry| size * entry));
    let ratios = gearbox.ratios();
    let slip = |gear: usize| [1.0, -ratios[gear]];
    let mut is_assumed = false;
    for shift in gearbox.shifts.iter_mut().filter(|shift| shift.reduced.is_none()) {
        is_assumed = true;
        let (slip_offgoing, slip_oncoming) = (slip(shift.from), slip(shift.to));
        shift.reduced = Some(ReducedShift { mass_kg_m2, slip_offgoing, slip_oncoming });
    }
    is_assumed.then(|| (maximum - minimum) / (maximum + minimum))
}
