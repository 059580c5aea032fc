//! Measured pressures that lie outside of their guaranteed ranges.

use car::Car;

use super::check::Check;
use crate::score::within;
use crate::{ROUNDING_PA, ShiftScoreRow};

/// Rows of an element's measured pressure from which on, and fraction of them outside of the range above which, the log is doubted.
const MIN_ROWS: u64 = 50;
const DOUBTED: f64 = 0.1;

/// How often the measured pressures of each element lie outside of their guaranteed ranges.
pub(crate) struct DoubtedPressures<'c> {
    car: &'c Car,
    /// Rows with a measured pressure, and those of them that are outside, by the place of the element among those of the gearbox.
    rows: Vec<[u64; 2]>,
}

impl<'c> DoubtedPressures<'c> {
    pub(super) fn new(car: &'c Car) -> Self {
        Self { car, rows: vec![[0; 2]; car.gearbox.elements.len()] }
    }
}

impl Check for DoubtedPressures<'_> {
    fn shift_row(&mut self, elements: [Option<usize>; 2], row: &ShiftScoreRow) {
        for (element, clutch) in elements.into_iter().zip(row.clutches) {
            let [measured_pa, ..] = clutch.pressure_pa;
            let is_known = measured_pa.is_finite() && !clutch.torque_n_m[0].is_finite();
            let rows = element.filter(|_| is_known).and_then(|element| self.rows.get_mut(element));
            let Some([all, outside]) = rows else { continue };
            *all += 1;
            *outside += u64::from(!within(clutch.pressure_range_pa, measured_pa, ROUNDING_PA));
        }
    }

    fn warnings(&self) -> Vec<String> {
        let doubted = self.rows.iter().zip(&self.car.gearbox.elements).filter_map(|([all, outside], element)| {
            let fraction = *outside as f64 / *all as f64;
            (*all >= MIN_ROWS && fraction > DOUBTED).then(|| format!("{} ({:.0} %)", element.name, 100.0 * fraction))
        });
        let doubted: Vec<String> = doubted.collect();
        let warning = (!doubted.is_empty()).then(|| {
            format!(
                "warning: measured pressures are outside their guaranteed ranges in many rows of the shifts: {}\nhint: check unit, \
                 sign, offset, delay and element of these channels, else widen the error bounds of the valve in the vehicle file; `fit` uses these \
                 pressures as they are",
                doubted.join(", ")
            )
        });
        warning.into_iter().collect()
    }
}
