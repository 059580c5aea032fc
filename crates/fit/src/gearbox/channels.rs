//! The channels of output and engine speed against that of the turbine speed, and shifts with their readings at the right times.

use car::Car;
use observer::ShiftTables;

use super::shift_log::ShiftLog;
use crate::Known;
use crate::driving::{Driving, MIN_DELAY_S, SkewFit};

/// What the driving of the logs tells of the channels of the speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelFits {
    /// The output speed, by the ratios of the gears.
    pub output: Result<SkewFit, String>,
    /// The engine speed, with the lock-up clutch closed; none without a converter. A lock-up clutch that keeps a slip is applied, and the
    /// engine is faster than the turbine: such a car tells nothing here.
    pub engine: Option<Result<SkewFit, String>>,
}

impl ChannelFits {
    pub(crate) fn of(car: &Car, driving: &Driving) -> Self {
        let is_slip_controlled = car.lock_up.is_some_and(|lock_up| lock_up.slip_rad_s > 0.0);
        let with_lock_up = || {
            if is_slip_controlled {
                return Err("the lock-up clutch of the vehicle file is slip-controlled".to_owned());
            }
            SkewFit::of(&driving.engines, "with the lock-up clutch closed and the engine as fast as the turbine")
        };
        Self {
            output: SkewFit::of(
                &driving.outputs,
                "in a gear with a turbine speed and an output speed that fit its ratio",
            ),
            engine: car.converter.is_some().then(with_lock_up),
        }
    }

    /// By how much the readings of output and engine speed are late against those of the turbine speed where it is identified, s.
    pub(crate) fn late_s(&self) -> [f64; 2] {
        let late_s = |found: Option<&SkewFit>| found.and_then(SkewFit::identified_late_s).unwrap_or(0.0);
        [late_s(self.output.as_ref().ok()), late_s(self.engine.as_ref().and_then(|found| found.as_ref().ok()))]
    }

    /// By how much the readings of the output speed are late, s, where it is identified and not small.
    pub(crate) fn output_late_s(&self) -> Option<Known> {
        self.output.as_ref().ok().map(|found| found.late_s).filter(|late_s| late_s.is_off_by(MIN_DELAY_S))
    }

    /// By how much the engine speed is late by driving with the lock-up clutch closed, s.
    pub(crate) fn engine_late_s(&self) -> Option<Known> {
        self.engine.as_ref().and_then(|found| found.as_ref().ok()).map(|found| found.late_s)
    }

    /// The shifts with the readings of output and engine speed at the times of the turbine speed, where driving tells by how much they are late. A delay of 10 ms is 1 to 2 rad/s of slip while a car
    /// speeds up, and more of the torque of the converter. `engine_more_s` is by how much the engine speed is late besides.
    pub(crate) fn moved(&self, shifts: &[ShiftLog], tables: &ShiftTables<f64>, engine_more_s: f64) -> Vec<ShiftLog> {
        let [output_s, engine_s] = self.late_s();
        let engine_s = engine_s + engine_more_s;
        let rows = tables.tables();
        let moved = |log: &ShiftLog| {
            let mut other = log.clone();
            other.output.time_s.iter_mut().for_each(|time_s| *time_s -= output_s);
            other.engine.time_s.iter_mut().for_each(|time_s| *time_s -= engine_s);
            // The slip begins and ends elsewhere by these readings.
            if output_s != 0.0
                && let Some(row) = rows.shift(log.gears[0], log.gears[1])
                && other.find_slip(row).is_err()
            {
                other.slip_s = log.slip_s;
            }
            other
        };
        shifts.iter().map(moved).collect()
    }

    /// What a fit says of the channels.
    pub(crate) fn statements(&self) -> Vec<String> {
        let mut lines = vec![SkewFit::statement("output_speed", &self.output)];
        let engine = self.engine.as_ref().filter(|found| found.is_ok());
        lines.extend(engine.map(|found| SkewFit::statement("engine_speed with the lock-up clutch closed", found)));
        lines
    }
}
