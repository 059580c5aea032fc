//! Energy audit of the plant.

use car::Vehicle;
use drivetrain::Driveline;

use crate::{Inputs, Mode, Powertrain, State};

/// Powers at one instant, W. What comes in is stored or dissipated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerBalance {
    /// From combustion into the crank.
    pub engine_w: f64,
    /// Each sink by name.
    pub sinks: [(&'static str, f64); 9],
}

impl PowerBalance {
    /// The balance at this state.
    pub fn of(powertrain: &Powertrain, mode: Mode, x: &State, inputs: &Inputs) -> Self {
        let v = &powertrain.vehicle;
        let t = powertrain.torques(mode, x, inputs);
        let twist_rate = v.driveline.twist_rate(x.output_rad_s, x.wheel_rad_s);
        let rim = v.road.wheel_radius_m * x.wheel_rad_s;
        Self {
            engine_w: t.engine_n_m * x.engine_rad_s,
            sinks: [
                ("engine drag", v.engine.drag_n_m_s * x.engine_rad_s * x.engine_rad_s),
                ("converter", t.pump_n_m * x.engine_rad_s - t.shift.turbine_n_m * x.turbine_rad_s),
                ("offgoing clutch", t.shift.offgoing_n_m * v.shift.offgoing_slip(x.turbine_rad_s, x.output_rad_s)),
                ("oncoming clutch", t.shift.oncoming_n_m * v.shift.oncoming_slip(x.turbine_rad_s, x.output_rad_s)),
                (
                    "shaft damping",
                    (t.shaft_n_m - v.driveline.shaft_stiffness_n_m_rad * spring_twist(v, x)) * twist_rate,
                ),
                ("tyre slip", t.tyre_n * (rim - x.vehicle_m_s)),
                ("rolling", v.road.rolling_moment(x.wheel_rad_s) * x.wheel_rad_s),
                ("air", v.road.drag_force(x.vehicle_m_s) * x.vehicle_m_s),
                ("grade", v.road.grade_force() * x.vehicle_m_s),
            ],
        }
    }
}

/// Kinetic energy and energy of the twisted shafts, J. Height is counted as the sink "grade".
pub fn stored_energy(powertrain: &Powertrain, x: &State) -> f64 {
    let v = &powertrain.vehicle;
    let half = |coefficient: f64, value: f64| 0.5 * coefficient * value * value;
    half(v.engine.inertia_kg_m2, x.engine_rad_s)
        + v.shift.kinetic_energy(x.turbine_rad_s, x.output_rad_s)
        + half(v.driveline.shaft_stiffness_n_m_rad, spring_twist(v, x))
        + half(v.driveline.wheel_inertia_kg_m2, x.wheel_rad_s)
        + half(v.road.mass_kg, x.vehicle_m_s)
}

/// Twist of the springs of the shafts, rad: none in the backlash.
fn spring_twist(vehicle: &Vehicle, x: &State) -> f64 {
    Driveline::spring_twist(x.twist_rad, vehicle.backlash_rad).unwrap_or(0.0)
}
