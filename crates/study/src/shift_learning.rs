//! How well the gearbox filter learns a car from shift to shift.
//!
//! A car that is not the one that filter and controller know makes shifts between neighbouring gears, up and down, with and
//! without power, in a random order. After them each of its shifts is scored with what was learnt up to then.

use car::ErrorBudget;
use car::{Car, Sensors};
use observer::gearbox::{GearboxFilter, Learnt, ShiftInput};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarSample, CarShift};

use crate::gearbox::{EvaluateError, ShiftScoreRow, inputs, score_from, simulated};

/// A shift of the true car with what the filter is shown of it.
#[derive(Debug, Clone)]
pub struct RecordedShift {
    /// The shift.
    pub shift: CarShift,
    samples: Vec<CarSample>,
    inputs: Vec<(usize, ShiftInput<f64>)>,
}

impl RecordedShift {
    /// Simulates a shift of the car `known` that truly is `truth`.
    ///
    /// # Errors
    /// The gears have no shift between two clutches, or the simulation fails.
    pub fn new(
        known: &Car,
        truth: &Car,
        tables: &ShiftTables<f64>,
        shift: CarShift,
        sensors: &Sensors,
        seed: u64,
    ) -> Result<Self, EvaluateError> {
        let samples = simulated(known, truth, &shift)?;
        let inputs = inputs(known, tables, &samples, sensors, seed);
        Ok(Self { shift, samples, inputs })
    }

    /// What the filter is shown, which a test may change.
    pub fn inputs_mut(&mut self) -> impl Iterator<Item = &mut ShiftInput<f64>> {
        self.inputs.iter_mut().map(|(_, input)| input)
    }

    /// Truth and estimates while the shift is under way, by a filter that has learnt this.
    pub fn rows(
        &self,
        tables: &ShiftTables<f64>,
        filter: &GearboxFilter<'_, f64>,
        learnt: &Learnt<f64>,
    ) -> Vec<ShiftScoreRow> {
        score_from(tables, filter, &mut filter.go_on_with(learnt), &self.samples, &self.inputs)
    }

    /// What a filter has learnt after it, if it had learnt this before.
    pub fn learnt(&self, filter: &GearboxFilter<'_, f64>, before: &Learnt<f64>) -> Learnt<f64> {
        let mut state = filter.go_on_with(before);
        for (_, input) in &self.inputs {
            filter.step(&mut state, input);
        }
        *state.learnt()
    }
}

/// The filter's tables of a car, with `M11` of all shifts times a factor.
///
/// # Errors
/// The gearbox has more clutches than the filter has room for.
pub fn tables_with_inertia(car: &Car, factor: f64) -> Result<ShiftTables<f64>, EvaluateError> {
    let mut tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).map_err(EvaluateError::TooManyElements)?;
    tables.scale_inertia(factor);
    Ok(tables)
}

/// The filter of a car with these tables behind these sensors.
pub fn filter<'a>(car: &Car, tables: &'a ShiftTables<f64>, sensors: &Sensors) -> GearboxFilter<'a, f64> {
    gearbox_filter(car, tables, &ErrorBudget::of_car(car).read_by(car, Some(sensors)), Some(sensors))
}
