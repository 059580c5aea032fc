//! Faults of a simulated gearbox.

/// What is broken. Elements are given by their names.
#[derive(Debug, Clone, PartialEq)]
pub enum FaultKind {
    /// The friction of the plates of an element, or of all elements, is the vehicle file's times this factor: worn plates, or another oil.
    Friction {
        /// The element; all of them where there is none.
        element: Option<String>,
        /// The factor.
        factor: f64,
    },
    /// The valve of an element has a command of its own, whatever is sent.
    StuckSolenoid {
        /// The element.
        element: String,
        /// The command, A or %; without it that of the moment at which it sticks.
        command: Option<f64>,
    },
    /// The valves of two elements get the commands of each other.
    SwappedSolenoids([String; 2]),
    /// A piston of an element leaks: the pressure on its plates is this fraction of that of its valve.
    LeakingPiston {
        /// The element.
        element: String,
        /// The fraction.
        pressure_fraction: f64,
    },
    /// The line pressure is not more than this, Pa: a blocked filter, or a worn pump.
    LinePressure {
        /// Highest pressure of every valve, Pa.
        pressure_pa: f64,
    },
    /// Air in the oil: the lags of all valves are longer by this factor.
    Aeration {
        /// The factor.
        lag_factor: f64,
    },
    /// Glazed plates of an element: its friction falls with the slip, so that the clutch judders before it holds.
    GlazedPlates {
        /// The element.
        element: String,
        /// Factor on the friction of the file at [`GLAZED_RAD_S`] and above; without slip the friction is that of the file.
        friction_factor: f64,
    },
    /// A speed sensor has failed.
    SpeedSensor {
        /// The sensor.
        sensor: FailedSensor,
        /// What it reads.
        reading: FailedReading,
    },
}

/// Slip from which on the friction of glazed plates is lowest, rad/s \[chosen\].
pub const GLAZED_RAD_S: f64 = 40.0;

/// A speed sensor of a car.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailedSensor {
    /// Of the engine.
    Engine,
    /// Of the turbine.
    Turbine,
    /// Of the gearbox output.
    Output,
    /// Of the driven wheels.
    Wheel,
}

impl FailedSensor {
    /// All of them, in the order of a row.
    pub const ALL: [Self; 4] = [Self::Engine, Self::Turbine, Self::Output, Self::Wheel];
}

/// What a speed sensor reads that has failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailedReading {
    /// Zero.
    Zero,
    /// The last speed before it failed.
    Frozen,
    /// Nothing.
    None,
}

/// Something that breaks on a drive, and stays so.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// What.
    pub kind: FaultKind,
    /// From this time on, s.
    pub from_s: f64,
}
