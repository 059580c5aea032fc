//! Commanded pressures of elements in place of the commands of their valves.
//!
//! Many gearbox controllers log the pressure that they ask of a clutch. It counts as the command at which the valve of the vehicle file ends at
//! this pressure. Where the map of the controller is another one, the difference is an error of the valve's gain.

use car::Car;
use drivetrain::ClutchValve;

/// Line pressures up to which a command means the line pressure: a clutch that holds is often commanded more. Beyond it is no pressure of
/// this car.
const MAX_LINE_PRESSURES: f64 = 3.0;

/// Fraction of the line pressure below zero down to which a commanded pressure is none; below it is a wrong sign or offset.
const MIN_LINE_PRESSURES: f64 = -0.05;
/// A command that no valve takes.
const REFUSED: f64 = -1e3;

/// The command, A or %, at which the valve of an element ends at a commanded pressure, Pa; not a number where it has no valve, and none that
/// a valve takes where the pressure is negative.
pub(super) fn command_for(car: &Car, element: usize, pressure_pa: f64) -> f64 {
    let clutch = car.clutches.get(element).and_then(Option::as_ref);
    clutch.map_or(f64::NAN, |clutch| command_of_valve(&clutch.valve, car.line_pressure_pa, pressure_pa))
}

/// The same of a valve whose maximum pressure this is, Pa.
pub fn command_of_valve(valve: &ClutchValve<f64>, max_pa: f64, pressure_pa: f64) -> f64 {
    if pressure_pa < MIN_LINE_PRESSURES * max_pa {
        return REFUSED;
    }
    let limited_pa = if pressure_pa <= MAX_LINE_PRESSURES * max_pa { pressure_pa.min(max_pa) } else { pressure_pa };
    valve.command_for(limited_pa.clamp(0.0, f64::INFINITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::CarFile;

    #[test]
    fn the_command_ends_at_the_pressure_that_is_asked_for() {
        let car = CarFile::eight_speed().unwrap();
        let valve = &car.clutches[0].as_ref().unwrap().valve;
        let max_pa = car.line_pressure_pa;
        for (asked_pa, pressure_pa) in [(-1e4, 0.0), (0.0, 0.0), (2e5, 2e5), (max_pa, max_pa), (1.5 * max_pa, max_pa)] {
            let settled_pa = valve.settled_pressure(command_for(&car, 0, asked_pa));
            assert!((settled_pa - pressure_pa).abs() < 1.0, "{asked_pa}: {settled_pa}");
        }
        assert!(command_for(&car, 0, -2e5) < -1.0);
        // A hundred times too much stays too much.
        assert!(valve.settled_pressure(command_for(&car, 0, 1e7)) > 0.9e7);
        assert!(command_for(&car, 0, f64::NAN).is_nan() && command_for(&car, 99, 1e5).is_nan());
    }
}
