//! In what the simulated car and its driver differ from the nominal ones.

use drivetrain::{Driveline, Table1};

use crate::{Profile, Vehicle};

/// In what the simulated car differs from the one the observers were designed for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffNominal {
    /// Factor on the engine's torque.
    pub engine_torque_factor: f64,
    /// Factor on the converter's capacity.
    pub converter_capacity_factor: f64,
    /// Factor on the friction of the oncoming clutch.
    pub friction_factor: f64,
    /// Factor on the lag of both valves.
    pub valve_lag_factor: f64,
    /// Factor on the gain of both valves.
    pub valve_gain_factor: f64,
    /// Constant delay of both valves, s, if not the vehicle file's map.
    pub valve_delay_s: Option<f64>,
    /// Half-width of the hysteresis of both valves, Pa, if not the vehicle file's.
    pub valve_hysteresis_pa: Option<f64>,
    /// Whether the pistons have a stroke, if not as in the vehicle file. The shift controller is one for such a car.
    pub piston_stroke: Option<bool>,
    /// Factor on the volume of the oncoming clutch's stroke: the fill ends late or early.
    pub fill_volume_factor: f64,
    /// Factor on the flow into the oncoming clutch's cylinder at every pressure drop, and on the largest flow.
    pub starved_flow_factor: f64,
    /// Peak of the drag of each open clutch, N m.
    pub clutch_drag_n_m: f64,
    /// Temperature of the oil, degC, if not the vehicle file's. The shift controller measures it.
    pub oil_temperature_degc: Option<f64>,
    /// Factor on the stiffness of the drive shafts.
    pub shaft_stiffness_factor: f64,
    /// Backlash of the driveline, rad at the wheel, if not the vehicle file's.
    pub backlash_rad: Option<f64>,
    /// Mass, kg, if not the vehicle file's.
    pub mass_kg: Option<f64>,
    /// Grade, rad, if not the vehicle file's.
    pub grade_rad: Option<f64>,
    /// When the accelerator is released and when it is pressed again, s, if it is.
    pub tip_out_s: Option<[f64; 2]>,
}

impl OffNominal {
    /// Time in which the driver releases or presses the accelerator, s \[chosen\].
    pub const TIP_S: f64 = 0.1;
    /// Points that a tip-out adds to the throttle.
    pub const TIP_POINTS: usize = 4;

    /// The car that is simulated: the nominal one with the differences applied.
    pub fn applied_to(&self, nominal: &Vehicle) -> Vehicle {
        let mut vehicle = nominal.clone();
        vehicle.engine.torque_n_m = vehicle.engine.torque_n_m.scaled(self.engine_torque_factor);
        vehicle.converter.capacity_n_m_s2 = vehicle.converter.capacity_n_m_s2.scaled(self.converter_capacity_factor);
        vehicle.oil_temperature_degc = self.oil_temperature_degc.unwrap_or(vehicle.oil_temperature_degc);
        for clutch in [&mut vehicle.offgoing, &mut vehicle.oncoming] {
            clutch.valve = clutch.valve.changed(self.valve_lag_factor, self.valve_gain_factor, self.valve_delay_s);
            clutch.hysteresis_pa = self.valve_hysteresis_pa.unwrap_or(clutch.hysteresis_pa);
            clutch.cylinder = clutch.cylinder.with_oil(vehicle.oil_temperature_degc);
            clutch.has_stroke = self.piston_stroke.unwrap_or(clutch.has_stroke);
            clutch.drag_n_m = self.clutch_drag_n_m;
        }
        let oncoming = &mut vehicle.oncoming;
        oncoming.clutch.friction = oncoming.clutch.friction.scaled(self.friction_factor);
        oncoming.clutch.static_friction *= self.friction_factor;
        oncoming.cylinder.stroke_m3 *= self.fill_volume_factor;
        oncoming.cylinder.supply = oncoming.cylinder.supply.with_flow_factor(self.starved_flow_factor);
        oncoming.cylinder.flow_max_m3_s *= self.starved_flow_factor;
        let stiffness = vehicle.driveline.shaft_stiffness_n_m_rad * self.shaft_stiffness_factor;
        vehicle.driveline = Driveline { shaft_stiffness_n_m_rad: stiffness, ..vehicle.driveline };
        vehicle.backlash_rad = self.backlash_rad.unwrap_or(vehicle.backlash_rad);
        vehicle.road.mass_kg = self.mass_kg.unwrap_or(vehicle.road.mass_kg);
        vehicle.road.grade_rad = self.grade_rad.unwrap_or(vehicle.road.grade_rad);
        vehicle
    }

    /// The driver's throttle with the tip-out in it.
    pub fn throttle(&self, throttle: &Profile) -> Profile {
        let Some([from_s, until_s]) = self.tip_out_s else { return *throttle };
        let closed = [from_s, from_s + Self::TIP_S, until_s, until_s + Self::TIP_S];
        let outside = |time: f64| time < closed[0] || time > closed[3];
        let points = throttle.axis().iter().zip(throttle.values()).map(|(&time, &position)| (time, position));
        let (before, after): (Vec<_>, Vec<_>) =
            points.filter(|(time, _)| outside(*time)).partition(|(time, _)| *time < from_s);
        let tip = closed.map(|time| (time, if time < closed[1] || time > until_s { throttle.at(time) } else { 0.0 }));
        let (times, positions): (Vec<_>, Vec<_>) = before.into_iter().chain(tip).chain(after).unzip();
        // The number of points and the order of the times were checked.
        Table1::new(&times, &positions).unwrap_or(*throttle)
    }
}
