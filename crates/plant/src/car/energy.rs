//! Energy audit of the car.

use drivetrain::{Driveline, Real};

use super::contacts::Contacts;
use super::model::{CarInputs, CarModel, CarState};

/// Powers at one instant, W. What comes in is stored or dissipated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarPowers {
    /// From combustion into the crank.
    pub engine_w: f64,
    /// Each sink by name. Of the elements all are one sink, dogs and lock-up clutch included.
    pub sinks: [(&'static str, f64); 9],
}

impl CarPowers {
    /// The balance at this state.
    pub fn of(model: &CarModel, contacts: &Contacts, x: &CarState, u: &CarInputs) -> Self {
        let (car, t) = (&model.car, model.torques(contacts, x, u));
        let twist_rate = car.driveline.twist_rate(t.output_rad_s, x.wheel_rad_s);
        let rim = car.road.wheel_radius_m * x.wheel_rad_s;
        let spring_n_m = car.driveline.shaft_stiffness_n_m_rad * spring_twist(model, x);
        let elements = (0..=model.lock_up()).map(|element| t.elements_n_m[element] * model.slip(x, element));
        let grade_n = car.road.mass_kg * drivetrain::road::GRAVITY_M_S2 * Real::sin(u.grade_rad);
        Self {
            engine_w: t.engine_n_m * t.engine_rad_s,
            sinks: [
                ("engine drag", car.engine.drag_n_m_s * t.engine_rad_s * t.engine_rad_s),
                ("converter", t.pump_n_m * t.engine_rad_s - t.converter_n_m * t.turbine_rad_s),
                ("elements", elements.sum()),
                ("shaft damping", (t.shaft_n_m - spring_n_m) * twist_rate),
                ("tyre slip", t.tyre_n * (rim - x.vehicle_m_s)),
                ("rolling", car.road.rolling_moment(x.wheel_rad_s) * x.wheel_rad_s),
                ("brake", t.brake_n_m * x.wheel_rad_s),
                ("air", car.road.drag_force(x.vehicle_m_s) * x.vehicle_m_s),
                ("grade", grade_n * x.vehicle_m_s),
            ],
        }
    }
}

/// Kinetic energy and energy of the twisted shafts, J. Height is counted as the sink "grade".
pub fn stored_car_energy(model: &CarModel, x: &CarState) -> f64 {
    let car = &model.car;
    let half = |coefficient: f64, value: f64| 0.5 * coefficient * value * value;
    model.rotating_energy(x)
        + half(car.driveline.shaft_stiffness_n_m_rad, spring_twist(model, x))
        + half(car.driveline.wheel_inertia_kg_m2, x.wheel_rad_s)
        + half(car.road.mass_kg, x.vehicle_m_s)
}

/// Twist of the springs of the shafts, rad: none in the backlash.
fn spring_twist(model: &CarModel, x: &CarState) -> f64 {
    Driveline::spring_twist(x.twist_rad, model.car.backlash_rad).unwrap_or(0.0)
}
