//! The shifts between neighbouring gears of a car as its file has it, read by sensors: what a changed file is tried on.

use car::ErrorBudget;
use car::{Car, Sensors};
use observer::gearbox::ShiftInput;
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarSample, CarShift};

use super::matrix::{MatrixShift, neighbouring_shifts};
use super::{EvaluateError, ShiftScoreRow, inputs, score_samples, simulated};

/// A shift of the car, and what the filter is shown of it.
pub(super) struct NominalShift {
    pub(super) shift: MatrixShift,
    samples: Vec<CarSample>,
    pub(super) inputs: Vec<(usize, ShiftInput<f64>)>,
}

/// Every shift between neighbouring gears in every kind; none if the filter has no tables for them.
pub(super) fn nominal_shifts(car: &Car, sensors: &Sensors) -> Result<Vec<NominalShift>, EvaluateError> {
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).map_err(EvaluateError::TooManyElements)?;
    let (shifts, _) = neighbouring_shifts(car, &tables);
    let nominal = |(seed, shift): (u64, MatrixShift)| {
        let samples = simulated(car, car, &CarShift::usual(car, shift.from, shift.to, shift.throttle()))?;
        let inputs = inputs(car, &tables, &samples, sensors, seed);
        Ok(NominalShift { shift, samples, inputs })
    };
    (1..).zip(shifts).map(nominal).collect()
}

impl NominalShift {
    /// The offgoing and the oncoming element, by their places in the gearbox; `None` if the shift never began.
    pub(super) fn elements(&self) -> Option<[usize; 2]> {
        let shift = self.samples.iter().find_map(|sample| sample.shift.as_ref())?;
        Some([shift.offgoing.element, shift.oncoming.element])
    }

    /// The estimates by a filter of this file with these bounds of its errors.
    pub(super) fn estimated(
        &self,
        file: &Car,
        sensors: &Sensors,
        budget: &ErrorBudget,
        inputs: &[(usize, ShiftInput<f64>)],
    ) -> Result<Vec<ShiftScoreRow>, EvaluateError> {
        let tables = ShiftTables::of_car(file, budget).map_err(EvaluateError::TooManyElements)?;
        let filter = gearbox_filter(file, &tables, budget, Some(sensors));
        Ok(score_samples(&tables, &filter, &self.samples, inputs))
    }
}
