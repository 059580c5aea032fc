//! The continuous state of the plant.

use std::ops::Range;

/// Number of states of a car whose pistons have no stroke.
pub const STATES: usize = 8;
/// Number of states of a car whose pistons have one: the oil in both cylinders is added.
pub const STATES_WITH_STROKE: usize = 10;
/// Position of the wheel speed in the vector.
pub const WHEEL: usize = 4;
/// Positions of the oil in the cylinders in the vector.
pub const CYLINDERS: [usize; 2] = [8, 9];
/// Positions of output speed, twist, wheel speed and vehicle speed in the vector: what the wheel's equation depends on.
pub(crate) const AT_THE_WHEEL: Range<usize> = 2..6;
/// Positions from the pressure of each valve to the oil in its cylinder.
pub(crate) const VALVE_TO_CYLINDER: [Range<usize>; 2] = [6..9, 7..10];

/// The continuous state. Pressures are gauge; twist is gearbox side minus wheel side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Engine speed, rad/s.
    pub engine_rad_s: f64,
    /// Turbine speed, rad/s.
    pub turbine_rad_s: f64,
    /// Gearbox output speed, rad/s.
    pub output_rad_s: f64,
    /// Twist of the drive shafts, rad at the wheel.
    pub twist_rad: f64,
    /// Driven wheel speed, rad/s.
    pub wheel_rad_s: f64,
    /// Vehicle speed, m/s.
    pub vehicle_m_s: f64,
    /// Pressure at the outlet of the offgoing clutch's valve, Pa; that of the clutch, if its piston has no stroke.
    pub offgoing_valve_pa: f64,
    /// Pressure at the outlet of the oncoming clutch's valve, Pa; that of the clutch, if its piston has no stroke.
    pub oncoming_valve_pa: f64,
    /// Oil in the offgoing clutch's cylinder beyond that of a piston on its stop, m^3; unused without a stroke.
    pub offgoing_m3: f64,
    /// Oil in the oncoming clutch's cylinder beyond that of a piston on its stop, m^3; unused without a stroke.
    pub oncoming_m3: f64,
}

impl State {
    /// Everything at rest and without pressure.
    pub const ZERO: Self = Self {
        engine_rad_s: 0.0,
        turbine_rad_s: 0.0,
        output_rad_s: 0.0,
        twist_rad: 0.0,
        wheel_rad_s: 0.0,
        vehicle_m_s: 0.0,
        offgoing_valve_pa: 0.0,
        oncoming_valve_pa: 0.0,
        offgoing_m3: 0.0,
        oncoming_m3: 0.0,
    };

    /// Size of each state that an absolute error is measured against.
    pub const SCALE: Self = Self {
        engine_rad_s: 100.0,
        turbine_rad_s: 100.0,
        output_rad_s: 100.0,
        twist_rad: 0.1,
        wheel_rad_s: 10.0,
        vehicle_m_s: 10.0,
        offgoing_valve_pa: 1e5,
        oncoming_valve_pa: 1e5,
        offgoing_m3: 1e-6,
        oncoming_m3: 1e-6,
    };

    /// The state without the cylinders as a vector, in the order of the fields.
    pub fn to_array(self) -> [f64; STATES] {
        self.to_vector()
    }

    /// The first states as a vector, in the order of the fields.
    #[inline]
    pub(crate) fn to_vector<const N: usize>(self) -> [f64; N] {
        let all: [f64; STATES_WITH_STROKE] = [
            self.engine_rad_s,
            self.turbine_rad_s,
            self.output_rad_s,
            self.twist_rad,
            self.wheel_rad_s,
            self.vehicle_m_s,
            self.offgoing_valve_pa,
            self.oncoming_valve_pa,
            self.offgoing_m3,
            self.oncoming_m3,
        ];
        std::array::from_fn(|i| all[i])
    }

    /// The state from a vector in the order of the fields; what the vector does not reach is zero.
    #[inline]
    pub fn from_array<const N: usize>(x: [f64; N]) -> Self {
        let at = |i: usize| if i < N { x[i] } else { 0.0 };
        Self {
            engine_rad_s: at(0),
            turbine_rad_s: at(1),
            output_rad_s: at(2),
            twist_rad: at(3),
            wheel_rad_s: at(4),
            vehicle_m_s: at(5),
            offgoing_valve_pa: at(6),
            oncoming_valve_pa: at(7),
            offgoing_m3: at(8),
            oncoming_m3: at(9),
        }
    }
}
