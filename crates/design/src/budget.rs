//! What the bounds of the vehicle file's error budget come to in the units of a design.

use car::Vehicle;
use drivetrain::{ClutchValve, Valve};
use observer::Phase;

/// Rates of the pressure that the observers' valve model leaves out in a shift, Pa/s, each at its largest.
///
/// With a true time constant `tau'` the model's rate is off by `(tau'/tau - 1) dp/dt`, with a true gain by its fraction of
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
        let (pressure_pa, time_constant_s) = (shift_pressure(vehicle), shift_time_constant(vehicle));
        let lag = match (&vehicle.settings.valve, real) {
            (Valve::PulseWidth(stated), ClutchValve::PulseWidth { law, .. }) => {
                stated.flow_sqrt_pa_s / law.flow_sqrt_pa_s
            }
            (_, real) => real.maps().map_or(1.0, |maps| maps.time_constant_s.at(pressure_pa) / time_constant_s),
        };
        let command = real.command_for(pressure_pa);
        let gain = pressure_pa / vehicle.settings.valve.settled_pressure(command);
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

/// Time constant of the observers' valve model in a shift, s; of a pulse-width valve, at the pressure drop that moves the
/// pressure as fast as the budget takes for a shift.
pub fn shift_time_constant(vehicle: &Vehicle) -> f64 {
    match &vehicle.settings.valve {
        Valve::Proportional { time_constant_s, .. } => *time_constant_s,
        Valve::PulseWidth(law) => 1.0 / law.rate_per_drop(law.drop_for(vehicle.error_bounds.shift_ramp_pa_s)),
    }
}

/// Pressure of a shift at which the budget weighs the errors, Pa.
pub fn shift_pressure(vehicle: &Vehicle) -> f64 {
    vehicle.oncoming.clutch.kiss_pressure() + vehicle.error_bounds.shift_pressure_pa
}

/// Bound on the error of the turbine torque, N m; in the inertia phase with that of the torque that accelerates the turbine.
pub fn turbine_n_m(vehicle: &Vehicle, phase: Phase) -> f64 {
    let bounds = &vehicle.error_bounds;
    match phase {
        Phase::InertiaPhase => bounds.turbine_torque_n_m + bounds.inertia_torque_n_m,
        _ => bounds.turbine_torque_n_m,
    }
}

/// What a grade at its bound does at the wheels, N m.
pub fn grade_n_m(vehicle: &Vehicle) -> f64 {
    vehicle.error_bounds.grade_n_m(&vehicle.road)
}

/// What a mass at its bound does at the wheels, N m.
pub fn mass_n_m(vehicle: &Vehicle) -> f64 {
    vehicle.error_bounds.mass_n_m(&vehicle.road)
}

#[cfg(test)]
mod tests {
    use config::VehicleFile;

    use super::*;
    use drivetrain::{Table1, ValveMaps};

    #[test]
    fn a_valve_that_is_what_the_observers_are_told_has_no_error() {
        let mut vehicle = VehicleFile::built_in().unwrap().vehicle;
        let Valve::Proportional { time_constant_s, gain_pa_a } = vehicle.settings.valve else { panic!() };
        vehicle.oncoming.valve = ClutchValve::Proportional(ValveMaps {
            time_constant_s: Table1::constant(time_constant_s),
            gain_pa_a: Table1::constant(gain_pa_a),
            delay_s: Table1::constant(0.0),
        });
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
