//! The continuous state of the plant.

/// Number of states.
pub const STATES: usize = 8;
/// Position of the wheel speed in the vector.
pub const WHEEL: usize = 4;

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
    /// Pressure of the offgoing clutch, Pa.
    pub offgoing_pa: f64,
    /// Pressure of the oncoming clutch, Pa.
    pub oncoming_pa: f64,
}

impl State {
    /// Size of each state that an absolute error is measured against.
    pub const SCALE: [f64; STATES] = [100.0, 100.0, 100.0, 0.1, 10.0, 10.0, 1e5, 1e5];

    /// The state as a vector, in the order of the fields.
    #[inline]
    pub fn to_array(self) -> [f64; STATES] {
        [
            self.engine_rad_s,
            self.turbine_rad_s,
            self.output_rad_s,
            self.twist_rad,
            self.wheel_rad_s,
            self.vehicle_m_s,
            self.offgoing_pa,
            self.oncoming_pa,
        ]
    }

    /// The state from a vector in the order of the fields.
    #[inline]
    pub fn from_array(x: [f64; STATES]) -> Self {
        Self {
            engine_rad_s: x[0],
            turbine_rad_s: x[1],
            output_rad_s: x[2],
            twist_rad: x[3],
            wheel_rad_s: x[4],
            vehicle_m_s: x[5],
            offgoing_pa: x[6],
            oncoming_pa: x[7],
        }
    }
}
