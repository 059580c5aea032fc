//! What the bounds of the vehicle file's error budget come to in the units of a design.

use config::Vehicle;
use drivetrain::Valve;
use drivetrain::road::GRAVITY_M_S2;

/// Steps of the search for the command of a shift; each halves its interval.
const HALVINGS: usize = 50;

/// Rates of the pressure that the observers' valve model leaves out in a shift, Pa/s, each at its largest.
///
/// With a true time constant `tau'` the model's rate is off by `(tau'/tau - 1) dp/dt`, with a true gain by its share of
/// `p/tau`, with a delay by `delay/tau dp/dt`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveErrors {
    /// By the lag.
    pub lag_pa_s: f64,
    /// By the gain.
    pub gain_pa_s: f64,
    /// By the delay.
    pub delay_pa_s: f64,
}

impl ValveErrors {
    /// Those of this vehicle, at the pressure and the ramp that its budget takes for a shift.
    pub fn of(vehicle: &Vehicle) -> Self {
        let (budget, real) = (&vehicle.error_bounds, &vehicle.oncoming.valve);
        let pressure_pa = shift_pressure(vehicle);
        let (told, gain) = match &vehicle.observer_valve {
            valve @ Valve::Proportional { .. } => {
                let (mut low, mut high) = (0.0, vehicle.limits.command_max);
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    if real.settled_pressure(middle) < pressure_pa { low = middle } else { high = middle }
                }
                let told = valve.linear(high);
                let settled_pa = -told.b2_pa_s / told.a22_per_s;
                (told, real.settled_pressure(high) / settled_pa)
            }
            // Its command is a duty cycle, and its gain is taken to be what the maps say.
            valve @ Valve::PulseWidth { .. } => {
                let (least, most) = vehicle.uncertainty.command.unwrap_or((50.0, 50.0));
                (valve.linear(0.5 * (least + most)), 1.0)
            }
        };
        let time_constant_s = -1.0 / told.a22_per_s;
        let lag = real.time_constant_s.at(pressure_pa) / time_constant_s;
        let furthest =
            |factors: [f64; 2], by: f64| factors.map(|f| (f * by - 1.0).abs()).into_iter().fold(0.0, f64::max);
        Self {
            lag_pa_s: furthest(budget.valve_lag_factor, lag) * budget.shift_ramp_pa_s,
            gain_pa_s: furthest(budget.valve_gain_factor, gain) * pressure_pa / time_constant_s,
            delay_pa_s: budget.valve_delay_s[1] * budget.shift_ramp_pa_s / time_constant_s,
        }
    }

    /// All of them at once, Pa/s.
    pub fn largest_pa_s(&self) -> f64 {
        self.lag_pa_s + self.gain_pa_s + self.delay_pa_s
    }
}

/// Pressure of a shift at which the budget weighs the errors, Pa.
pub fn shift_pressure(vehicle: &Vehicle) -> f64 {
    vehicle.oncoming.clutch.kiss_pressure() + vehicle.error_bounds.shift_pressure_pa
}

/// What a grade at its bound does at the wheels, N m.
pub fn grade_n_m(vehicle: &Vehicle) -> f64 {
    let road = &vehicle.road;
    road.mass_kg * GRAVITY_M_S2 * road.wheel_radius_m * vehicle.error_bounds.grade_rad.sin()
}

/// What a mass at its bound does at the wheels, N m: they answer the shaft torque wrongly by its share.
pub fn mass_n_m(vehicle: &Vehicle) -> f64 {
    vehicle.error_bounds.mass_kg / vehicle.road.mass_kg * vehicle.error_bounds.shaft_torque_n_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_valve_that_is_what_the_observers_are_told_has_no_error() {
        let mut vehicle = Vehicle::two_speed_at().unwrap();
        let Valve::Proportional { time_constant_s, gain_pa_a } = vehicle.observer_valve else { panic!() };
        vehicle.oncoming.valve.time_constant_s = drivetrain::Table1::constant(time_constant_s);
        vehicle.oncoming.valve.gain_pa_a = drivetrain::Table1::constant(gain_pa_a);
        let bounds = &mut vehicle.error_bounds;
        (bounds.valve_lag_factor, bounds.valve_gain_factor, bounds.valve_delay_s) = ([1.0; 2], [1.0; 2], [0.0; 2]);
        assert!(ValveErrors::of(&vehicle).largest_pa_s() < 1e-6);
        // Half the lag more, on the ramp; a tenth of the gain, at the pressure of 0.26 MPa over 0.04 s.
        vehicle.error_bounds.valve_lag_factor = [1.0, 1.5];
        vehicle.error_bounds.valve_gain_factor = [0.9, 1.0];
        let errors = ValveErrors::of(&vehicle);
        assert!((errors.lag_pa_s - 0.4e6).abs() < 1.0 && (errors.gain_pa_s - 0.65e6).abs() < 1.0, "{errors:?}");
    }
}
