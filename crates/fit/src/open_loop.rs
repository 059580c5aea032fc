//! Pressure and torque of the oncoming clutch from commands and measured slip alone.

use car::Vehicle;

use crate::car::Car;
use crate::pressure::{Grid, Hydraulics, pressures};
use crate::{ReadingAges, ShiftRecord};

/// Pressure and torque at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenLoop {
    /// Time in the record, s.
    pub time_s: f64,
    /// Pressure, Pa.
    pub pressure_pa: f64,
    /// Torque while the clutch slips, N m.
    pub torque_n_m: f64,
}

/// What the valve maps and the friction of a vehicle file say of a shift, at each reading of the turbine speed: the error of a file
/// without any observer.
pub fn open_loop(vehicle: &Vehicle, record: &ShiftRecord) -> Vec<OpenLoop> {
    const STEP_S: f64 = 0.002;
    let car = Car::of_file(vehicle, ReadingAges::default());
    let begin_s = record.oncoming.time_s.first().copied().unwrap_or(0.0);
    let end_s = record.oncoming.time_s.last().copied().unwrap_or(0.0);
    let points = ((end_s - begin_s) / STEP_S) as usize + 1;
    let grid = Grid { begin_s, step_s: STEP_S, points };
    let pressure = pressures(&Hydraulics::of(&vehicle.oncoming), 0.0, &record.oncoming, grid);
    let series = crate::Series { time_s: (0..points).map(|i| grid.time_s(i)).collect(), value: pressure };
    (record.turbine.between([begin_s, end_s]))
        .map(|(time_s, turbine_rad_s)| {
            let slip = car.shift.oncoming_slip(turbine_rad_s, record.output.at(time_s));
            let pressure_pa = series.at(time_s);
            OpenLoop { time_s, pressure_pa, torque_n_m: car.oncoming_torque(pressure_pa, slip) }
        })
        .collect()
}
