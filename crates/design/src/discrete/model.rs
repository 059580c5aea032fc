//! Which observer, and what its bound is on.

use serde::Serialize;

/// Which of the two reduced-order observers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Stiff shafts.
    Rigid,
    /// Elastic drive shafts.
    Compliant,
}

/// Quantity of a bound. The speeds give a torque; an error of the friction then gives an error of the pressure. The valve
/// model gives a pressure; the same error of the friction then gives an error of the torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// The clutch torque, as the pressure that gives this torque with the friction of the observer's model.
    ClutchTorque,
    /// The pressure.
    Pressure,
}
