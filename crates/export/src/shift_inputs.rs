//! A simulated shift as the controller reads it.

use car::{Car, Sensors};
use evaluate::EvaluateError;
use evaluate::score::{inputs, simulated};
use observer::ShiftTables;
use observer::gearbox::ShiftInput;
use plant::car::CarShift;

/// Throttle of a shift with power, 0 to 1 \[chosen\]: a car in traffic.
const POWER_ON: f64 = 0.15;

/// What is read of a shift, every 10 ms, in single precision; `truth` is the car that is driven, `known` the one of the controller.
///
/// # Errors
/// The gears have no shift between two clutches, or the simulation fails.
pub fn shift_inputs(
    [known, truth]: [&Car; 2],
    tables: &ShiftTables<f64>,
    [from, to]: [usize; 2],
    (sensors, seed): (&Sensors, u64),
) -> Result<Vec<ShiftInput<f32>>, EvaluateError> {
    let samples = simulated(known, truth, &CarShift::usual(known, from, to, POWER_ON))?;
    Ok(inputs(known, tables, &samples, sensors, seed).iter().map(|(_, input)| input.cast()).collect())
}
