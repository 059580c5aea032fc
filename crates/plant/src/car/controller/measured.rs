//! What the shift controller measures.

/// Readings of the controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarMeasured {
    /// Engine speed, rad/s.
    pub engine_rad_s: f64,
    /// Turbine speed, rad/s; without a converter that of the gearbox input.
    pub turbine_rad_s: f64,
    /// Gearbox output speed, rad/s.
    pub output_rad_s: f64,
    /// Driven wheel speed, rad/s.
    pub wheel_rad_s: f64,
    /// Brake, 0 to 1.
    pub brake: f64,
}
