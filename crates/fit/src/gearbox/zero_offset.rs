//! The zero offset of the pressure sensor of an element, from readings while its valve is at rest and its clutch empty.
//!
//! Without an offset of its own the sensor would give another valve gain: 10 kPa are 7 % of it at a pressure of 150 kPa. Where a log has no such
//! readings, the offset is a quantity of the fit ([`Quantity::PressureOffset`](super::Quantity)).

use car::Car;
use drivetrain::Real;
use observer::ShiftTables;

use super::quantities::std_dev_of;
use super::shift_log::ShiftLog;
use crate::parameters::OFFSET_FLOOR_PA;
use crate::parameters::{OFFSET_PA, POSSIBLE};
use crate::pressure::{Grid, Hydraulics, pressures};
use crate::weights::FACTOR;
use crate::{Known, Series};

/// Highest pressure, by the commands, of a clutch at rest, Pa \[chosen: the noise of a current reading near zero\].
const REST_PA: f64 = 2e3;
/// How long it has been so low, s, by a valve whose lag is this factor longer and whose delay is so much later, s \[chosen: the error bounds of valves\].
const REST_S: f64 = 0.05;
const SLOWER: f64 = 2.0;
const LATER_S: f64 = 0.03;
/// Fewest readings at rest of an element, over all shifts.
const READINGS_MIN: usize = 5;
const STEP_S: f64 = 0.002;

/// Zero offsets of the elements, Pa, by their places in the tables; none where no reading is of a valve at rest, or where no sensor has such an offset.
pub(super) fn zero_offsets(car: &Car, tables: &ShiftTables<f64>, shifts: &[ShiftLog]) -> Vec<Option<Known>> {
    let rows = tables.tables();
    let mut readings: Vec<Vec<Vec<f64>>> = vec![Vec::new(); rows.elements.len()];
    for log in shifts {
        let Some(row) = rows.shift(log.gears[0], log.gears[1]) else { continue };
        for ((clutch, commands), pressure) in row.clutches.iter().zip(&log.commands).zip(&log.pressure) {
            let Some(place) = clutch.element.place() else { continue };
            let known = tables.element_at(place).and_then(|at| car.clutches[at].as_ref());
            let at_rest = known.map_or_else(Vec::new, |known| at_rest(&Hydraulics::of(known), commands, pressure));
            readings[place].extend((!at_rest.is_empty()).then_some(at_rest));
        }
    }
    readings.into_iter().map(|shifts| zero_offset(&shifts)).collect()
}

/// The shifts with the zero offsets taken off their measured pressures.
pub(super) fn without_offsets(
    shifts: &[ShiftLog],
    tables: &ShiftTables<f64>,
    offsets: &[Option<Known>],
) -> Vec<ShiftLog> {
    let mut shifts = shifts.to_vec();
    for log in &mut shifts {
        let Some(row) = tables.tables().shift(log.gears[0], log.gears[1]).copied() else { continue };
        for (pressure, clutch) in log.pressure.iter_mut().zip(row.clutches) {
            let offset = clutch.element.place().and_then(|place| offsets.get(place).copied().flatten());
            if let Some(offset) = offset {
                pressure.value.iter_mut().for_each(|value_pa| *value_pa -= offset.value);
            }
        }
    }
    shifts
}

/// Standard deviation of a zero offset of which nothing is known, Pa.
pub(super) fn sd_before_pa() -> f64 {
    std_dev_of(OFFSET_PA)
}

/// The readings of a pressure while its valve is surely at rest.
fn at_rest(hydraulics: &Hydraulics, commands: &Series, pressure: &Series) -> Vec<f64> {
    let (Some(first_s), Some(last_s)) = (pressure.time_s.first(), pressure.time_s.last()) else { return Vec::new() };
    // What the valve did before its first command is not known.
    let Some(known_s) = commands.time_s.first() else { return Vec::new() };
    let points = ((last_s - known_s) / STEP_S).clamp(0.0, 1e5) as usize + 2;
    let grid = Grid { begin_s: *known_s, step_s: STEP_S, points };
    let early = pressures(hydraulics, -LATER_S, commands, grid);
    let late = pressures(&hydraulics.with_valve(Real::ln(SLOWER), 0.0), LATER_S, commands, grid);
    let is_pressed = |i: usize| early[i].max(late[i]) > REST_PA;
    let mut pressed_s = *known_s;
    let mut at_rest = Vec::new();
    let mut point = 0;
    for (time_s, value) in pressure.between([*first_s, *last_s]) {
        while point < points && grid.time_s(point) <= time_s + LATER_S {
            if is_pressed(point) {
                pressed_s = grid.time_s(point);
            }
            point += 1;
        }
        if time_s - pressed_s >= REST_S {
            at_rest.push(value);
        }
    }
    at_rest
}

/// The offset by the readings at rest of each shift.
fn zero_offset(shifts: &[Vec<f64>]) -> Option<Known> {
    let count: usize = shifts.iter().map(Vec::len).sum();
    if count < READINGS_MIN {
        return None;
    }
    let mut middles: Vec<f64> = shifts.iter().map(|readings| median(readings.clone())).collect();
    let variance = match middles.as_slice() {
        [only] => spread(&shifts[0], *only) / shifts[0].len() as f64,
        several => spread(several, median(several.to_vec())) / several.len() as f64,
    };
    let value = median(std::mem::take(&mut middles));
    let before = sd_before_pa();
    let sd = Real::hypot(FACTOR * variance.sqrt(), OFFSET_FLOOR_PA).min(before);
    // A sensor that reads more at rest is none of this pressure, or in another unit.
    (value.abs() < POSSIBLE * before).then_some(Known { value, sd, before })
}

/// Variance about a middle.
fn spread(values: &[f64], middle: f64) -> f64 {
    let squares: f64 = values.iter().map(|value| Real::powi(value - middle, 2)).sum();
    squares / values.len().saturating_sub(1).max(1) as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
