//! Measured pressures that contradict the commands of their valves: no valve of the file's bounds makes them.

use car::Car;
use drivetrain::Real;
use observer::ShiftTables;

use super::quantities::Quantities;
use super::shift::ShiftModel;
use super::shift_log::ShiftLog;

/// RMS difference from the pressures by the vehicle file above which a measured pressure contradicts them: a fraction of these \[chosen: several times
/// what gain, lag and hysteresis make together\], and minimum, Pa.
const FRACTION: f64 = 0.5;
const MIN_PA: f64 = 30e3;

/// Places of the elements whose measured pressures, over all shifts, cannot be those of their commands.
pub(super) fn contradicted(car: &Car, tables: &ShiftTables<f64>, shifts: &[ShiftLog]) -> Vec<usize> {
    let quantities = Quantities::of(car, tables, shifts, [false; 2]);
    // Readings, squared differences and squared pressures by the file.
    let mut sums = vec![[0.0; 3]; quantities.elements.len()];
    for model in shifts.iter().filter_map(|log| ShiftModel::new(car, tables, &quantities, log)) {
        for (place, [measured_pa, modelled_pa]) in model.pressures_beside() {
            if let Some([rows, differences, pressures]) = sums.get_mut(place) {
                *rows += 1.0;
                *differences += Real::powi(measured_pa - modelled_pa, 2);
                *pressures += Real::powi(modelled_pa, 2);
            }
        }
    }
    let contradicts = |[rows, differences, pressures]: &[f64; 3]| {
        let [difference, pressure] = [differences, pressures].map(|sum| (sum / rows).sqrt());
        difference > FRACTION * pressure + MIN_PA
    };
    sums.iter().enumerate().filter(|(_, sums)| contradicts(sums)).map(|(place, _)| place).collect()
}

/// The shifts without the measured pressures of these elements.
pub(super) fn without_pressures(shifts: &[ShiftLog], tables: &ShiftTables<f64>, places: &[usize]) -> Vec<ShiftLog> {
    let mut shifts = shifts.to_vec();
    for log in &mut shifts {
        let [from, to] = log.gears;
        let Some(row) = tables.tables().shift(from, to).copied() else { continue };
        for (pressure, clutch) in log.pressure.iter_mut().zip(row.clutches) {
            if clutch.element.place().is_some_and(|place| places.contains(&place)) {
                *pressure = Default::default();
            }
        }
    }
    shifts
}
