//! What a channel can be for the program.

use trace::Quantity;

/// A signal of the car that a channel of a log can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Role {
    /// Engine speed, rad/s.
    EngineSpeed,
    /// Turbine (gearbox input) speed, rad/s.
    TurbineSpeed,
    /// Gearbox output speed, rad/s.
    OutputSpeed,
    /// Speed of the driven wheels, rad/s.
    WheelSpeed,
    /// Speed of the car, m/s.
    VehicleSpeed,
    /// Acceleration of the car, m/s^2: the rate of its speed.
    VehicleAcceleration,
    /// Longitudinal acceleration by an accelerometer, m/s^2: with the part of gravity along the road.
    LongitudinalAcceleration,
    /// Current of the oncoming clutch's valve, A.
    OncomingCurrent,
    /// Current of the offgoing clutch's valve, A.
    OffgoingCurrent,
    /// Duty cycle of the oncoming clutch's valve, %.
    OncomingDuty,
    /// Duty cycle of the offgoing clutch's valve, %.
    OffgoingDuty,
    /// Commanded pressure of the oncoming clutch, Pa.
    OncomingPressureCommand,
    /// Measured pressure of the oncoming clutch, Pa.
    OncomingPressure,
    /// Measured torque of the oncoming clutch, N m.
    OncomingTorque,
    /// Engine torque, N m; at the flywheel, if its friction is taken off or mapped.
    EngineTorque,
    /// Friction torque of the engine, N m: it is taken off the engine torque.
    EngineFrictionTorque,
    /// Engine torque that the gearbox asks for in a shift, N m, friction included.
    TorqueReductionRequest,
    /// Throttle, 0 to 1.
    Throttle,
    /// Engaged gear; below 1 it is not a forward gear.
    Gear,
    /// Commanded gear.
    TargetGear,
    /// Whether a shift is in progress: 0 or 1.
    ShiftActive,
    /// Position of the selector, as the log has it.
    Selector,
    /// Oil temperature, degC.
    OilTemperature,
    /// Whether the lock-up clutch of the converter carries torque: 0 or 1.
    LockUpApplied,
    /// Current of the valve of an element of the gearbox, A. Its name in a map has that of the element: `element_a_current`.
    ElementCurrent,
    /// Duty cycle of the valve of an element of the gearbox, %: `element_a_duty`.
    ElementDuty,
    /// Measured pressure of an element of the gearbox, Pa: `element_a_pressure`.
    ElementPressure,
    /// Commanded pressure of an element of the gearbox, Pa: `element_a_pressure_command`.
    ElementPressureCommand,
}

/// Role, its name in maps, what it measures, and its unit in readings.
const TABLE: &[(Role, &str, Option<Quantity>, &str)] = &[
    (Role::EngineSpeed, "engine_speed", Some(Quantity::Rotation), "rad/s"),
    (Role::TurbineSpeed, "turbine_speed", Some(Quantity::Rotation), "rad/s"),
    (Role::OutputSpeed, "output_speed", Some(Quantity::Rotation), "rad/s"),
    (Role::WheelSpeed, "wheel_speed", Some(Quantity::Rotation), "rad/s"),
    (Role::VehicleSpeed, "vehicle_speed", Some(Quantity::Velocity), "m/s"),
    (Role::VehicleAcceleration, "vehicle_acceleration", Some(Quantity::Acceleration), "m/s^2"),
    (Role::LongitudinalAcceleration, "longitudinal_acceleration", Some(Quantity::Acceleration), "m/s^2"),
    (Role::OncomingCurrent, "oncoming_current", Some(Quantity::Current), "A"),
    (Role::OffgoingCurrent, "offgoing_current", Some(Quantity::Current), "A"),
    (Role::OncomingDuty, "oncoming_duty", Some(Quantity::Fraction), "%"),
    (Role::OffgoingDuty, "offgoing_duty", Some(Quantity::Fraction), "%"),
    (Role::OncomingPressureCommand, "oncoming_pressure_command", Some(Quantity::Pressure), "Pa"),
    (Role::OncomingPressure, "oncoming_pressure", Some(Quantity::Pressure), "Pa"),
    (Role::OncomingTorque, "oncoming_torque", Some(Quantity::Torque), "N m"),
    (Role::EngineTorque, "engine_torque", Some(Quantity::Torque), "N m"),
    (Role::EngineFrictionTorque, "engine_friction_torque", Some(Quantity::Torque), "N m"),
    (Role::TorqueReductionRequest, "torque_reduction_request", Some(Quantity::Torque), "N m"),
    (Role::Throttle, "throttle", Some(Quantity::Fraction), "1"),
    (Role::Gear, "gear", None, ""),
    (Role::TargetGear, "target_gear", None, ""),
    (Role::ShiftActive, "shift_active", None, ""),
    (Role::Selector, "selector", None, ""),
    (Role::OilTemperature, "oil_temperature", Some(Quantity::Temperature), "degC"),
    (Role::LockUpApplied, "lock_up_applied", None, ""),
    (Role::ElementCurrent, "element_NAME_current", Some(Quantity::Current), "A"),
    (Role::ElementDuty, "element_NAME_duty", Some(Quantity::Fraction), "%"),
    (Role::ElementPressure, "element_NAME_pressure", Some(Quantity::Pressure), "Pa"),
    (Role::ElementPressureCommand, "element_NAME_pressure_command", Some(Quantity::Pressure), "Pa"),
];

impl Role {
    /// The speeds of shafts, and that of the car.
    pub const SPEEDS: [Self; 5] =
        [Self::EngineSpeed, Self::TurbineSpeed, Self::OutputSpeed, Self::WheelSpeed, Self::VehicleSpeed];

    /// All of them, in their order.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|(role, ..)| *role)
    }

    fn row(self) -> &'static (Self, &'static str, Option<Quantity>, &'static str) {
        // The table has every role, in the order of the enumeration; a test checks it.
        &TABLE[self as usize]
    }

    /// Its name in a channel map.
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// What it measures; none for gears and states.
    pub fn quantity(self) -> Option<Quantity> {
        self.row().2
    }

    /// The unit of its readings.
    pub fn unit(self) -> &'static str {
        self.row().3
    }

    /// The role of this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::all().find(|role| role.name() == name)
    }

    /// The element of the gearbox that a name in a map is about, and its role: `element_a_current` is the current of `a`.
    pub fn of_element(name: &str) -> Option<(Self, &str)> {
        let rest = name.strip_prefix("element_")?;
        let endings = [
            ("_current", Self::ElementCurrent),
            ("_duty", Self::ElementDuty),
            ("_pressure", Self::ElementPressure),
            ("_pressure_command", Self::ElementPressureCommand),
        ];
        let found = endings.into_iter().find_map(|(ending, role)| Some((role, rest.strip_suffix(ending)?)));
        found.filter(|(_, element)| !element.is_empty())
    }

    /// Whether it is the command of a valve.
    pub fn is_command(self) -> bool {
        matches!(
            self,
            Self::OncomingCurrent
                | Self::OffgoingCurrent
                | Self::OncomingDuty
                | Self::OffgoingDuty
                | Self::ElementCurrent
                | Self::ElementDuty
                | Self::ElementPressureCommand
        )
    }

    /// Whether it is the speed of a shaft.
    pub fn is_shaft_speed(self) -> bool {
        matches!(self, Self::EngineSpeed | Self::TurbineSpeed | Self::OutputSpeed | Self::WheelSpeed)
    }

    /// Whether it is the speed of a shaft or of the car.
    pub fn is_speed(self) -> bool {
        self.is_shaft_speed() || self == Self::VehicleSpeed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_role_is_in_its_row() {
        for (i, role) in Role::all().enumerate() {
            assert_eq!(role as usize, i);
            assert_eq!(Role::parse(role.name()), Some(role));
        }
        assert_eq!(Role::ElementPressureCommand as usize, TABLE.len() - 1);
        assert_eq!(Role::of_element("element_k1_duty"), Some((Role::ElementDuty, "k1")));
        assert_eq!(Role::of_element("element_b_pressure_command"), Some((Role::ElementPressureCommand, "b")));
        assert_eq!(Role::of_element("element__current"), None);
    }
}
