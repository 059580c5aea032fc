//! What a reader of the page sets.

use serde::Deserialize;

/// The settings of a run. In what they differ from the vehicle file, the filter does not know.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The vehicle file, by its name without ending.
    pub car: String,
    /// The gears of the shift, such as `1-2`; `all`: up through the gears and down again.
    pub shift: String,
    /// Throttle, 0 to 1.
    pub throttle: f64,
    /// Speed of the turbine, without a converter of the gearbox input, at the start of a single shift, rad/s.
    pub turbine_rad_s: f64,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
    /// Mass of the driven car, kg; that of the vehicle file if none is given.
    pub mass_kg: Option<f64>,
    /// Factor on the friction of every clutch of the driven car.
    pub friction_factor: f64,
    /// Factor on the gain of every valve of the driven car.
    pub valve_gain_factor: f64,
    /// What is added to the delay of every valve of the driven car, s.
    pub valve_delay_s: f64,
    /// Whether the pistons have a stroke, so that a clutch has to be filled. The filter knows it.
    pub has_stroke: bool,
    /// Temperature of the oil, degC. The filter knows it.
    pub oil_degc: Option<f64>,
    /// Standard deviation of the readings of engine, turbine and output speed, rad/s.
    pub noise_rad_s: f64,
    /// Age of the readings of all speeds when they arrive, s.
    pub delay_s: f64,
    /// What goes wrong with a sensor.
    pub fault: Fault,
    /// Seed of the readings.
    pub seed: u64,
}

/// What goes wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// Nothing.
    None,
    /// The turbine speed is lost for 0.2 s.
    TurbineLost,
    /// The turbine speed repeats a reading for 0.2 s.
    TurbineFrozen,
    /// Six single readings of the turbine speed are wrong by 30 rad/s.
    TurbineOutliers,
    /// Three of ten readings of all speeds are lost.
    ReadingsLost,
    /// The wheel speed reads 3 % too much, as with worn tyres.
    WheelScale,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            car: "eight_speed".to_owned(),
            shift: "1-2".to_owned(),
            throttle: 0.3,
            turbine_rad_s: 250.0,
            grade_rad: 0.0,
            mass_kg: None,
            friction_factor: 1.0,
            valve_gain_factor: 1.0,
            valve_delay_s: 0.0,
            has_stroke: false,
            oil_degc: None,
            noise_rad_s: 0.1,
            delay_s: 0.0,
            fault: Fault::None,
            seed: 2014,
        }
    }
}
