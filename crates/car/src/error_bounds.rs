//! Bounds on the errors of a car's values, as a file states them.

use drivetrain::road::GRAVITY_M_S2;
use drivetrain::{CommandKind, Real, RoadLoad};

use crate::{FillBudget, Sensors};

/// The error budget: bounds on the errors of the observers' model of the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBounds {
    /// Turbine torque from the converter's maps, N m.
    pub turbine_torque_n_m: f64,
    /// The same as a fraction of the torque.
    pub turbine_torque_share: f64,
    /// Torque that an error of the turbine-side inertia is worth in the inertia phase, N m. Zero in a file with `[gear_train]`: its bound
    /// on the turbine torque is for both.
    pub inertia_torque_n_m: f64,
    /// Pressure from the valve model alone, Pa.
    pub pressure_pa: f64,
    /// Mass of the vehicle, kg.
    pub mass_kg: f64,
    /// Grade, rad.
    pub grade_rad: f64,
    /// Largest drive-shaft torque of a shift, N m: a mass error acts in its proportion.
    pub shaft_torque_n_m: f64,
    /// Torque at the gearbox output that the rigid model leaves out (torsion, tyre slip, grade), N m.
    pub output_torque_n_m: f64,
    /// Torque left in the offgoing clutch when it has let go, N m.
    pub offgoing_torque_n_m: f64,
    /// Time from its first slip until no more than that is left, s.
    pub offgoing_drain_s: f64,
    /// Error of the change of the turbine speed from one sample to the next, rad/s.
    pub turbine_quantum_rad_s: f64,
    /// Error of the change of the output speed from one sample to the next, rad/s.
    pub output_quantum_rad_s: f64,
    /// Error of the change of the slip from one sample to the next, rad/s.
    pub slip_quantum_rad_s: f64,
    /// Error of the change of the wheel speed from one sample to the next, rad/s.
    pub wheel_quantum_rad_s: f64,
    /// Maximum age of a reading, s.
    pub sampling_delay_s: f64,
    /// Rounding of one operation in single precision, as a fraction.
    pub float32_rounding: f64,
    /// Pressure above the kiss point in a shift, at which errors of gain and friction are weighed, Pa.
    pub shift_pressure_pa: f64,
    /// Rate of the pressure in a shift, at which errors of lag and delay are weighed, Pa/s.
    pub shift_ramp_pa_s: f64,
    /// Minimum and maximum factor on the lag of the oncoming clutch's valve.
    pub valve_lag_factor: [f64; 2],
    /// Minimum and maximum factor on its gain.
    pub valve_gain_factor: [f64; 2],
    /// Its minimum and maximum delay, s.
    pub valve_delay_s: [f64; 2],
    /// Maximum half-width of its hysteresis, Pa.
    pub valve_hysteresis_pa: f64,
    /// Maximum time between a command and the sample that first shows it, s.
    pub command_age_s: f64,
    /// Minimum and maximum line pressure, Pa.
    pub line_pressure_pa: [f64; 2],
    /// Limits of the oncoming clutch's piston stroke, if it is part of the budget.
    pub fill: Option<FillBudget<f64>>,
    /// Minimum and maximum factor on the friction of the oncoming clutch.
    pub friction_factor: [f64; 2],
    /// Error of a reading of the valve's command, A or %.
    pub command: f64,
    /// Error of a reading of the slip, rad/s, its age included.
    pub slip_rad_s: f64,
    /// Highest pressure that the supply can give, Pa.
    pub pressure_max_pa: f64,
    /// Error of the scale of the wheel speed, as a fraction: tyres that are worn, or of another size.
    pub wheel_scale: f64,
    /// Largest delay of the wheel speed, s.
    pub wheel_delay_s: f64,
    /// Largest delay of the turbine speed and of the output speed, each against the other, s.
    pub channel_skew_s: f64,
    /// Error of the torque that the engine controller reports, as a fraction.
    pub engine_torque_share: f64,
    /// Minimum and maximum factor on the stiffness of the drive shafts.
    pub shaft_stiffness_factor: [f64; 2],
    /// Twist over which the driveline carries no torque, rad at the wheels.
    pub backlash_rad: f64,
}

impl ErrorBounds {
    /// The same for readings by these sensors: a command of this kind errs at least by what its sensor does.
    #[must_use]
    pub fn read_by(mut self, kind: CommandKind, sensors: &Sensors) -> Self {
        if let (CommandKind::Current, Some(current)) = (kind, &sensors.current) {
            self.command = self.command.max(current.error_max_a());
        }
        self
    }

    /// What a grade at its bound does at the wheels of a car with this load, N m.
    pub fn grade_n_m(&self, road: &RoadLoad<f64>) -> f64 {
        road.mass_kg * GRAVITY_M_S2 * road.wheel_radius_m * Real::sin(self.grade_rad)
    }

    /// What a mass at its bound does at the wheels, N m: they answer the shaft torque wrongly by its relative error.
    pub fn mass_n_m(&self, road: &RoadLoad<f64>) -> f64 {
        self.mass_kg / road.mass_kg * self.shaft_torque_n_m
    }
}

/// Bounds on the errors of a car's file; none where the file says nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CarErrorBounds {
    /// Of the converter's capacity, as a fraction.
    pub converter_share: Option<f64>,
    /// Of the engine torque that the engine's controller reports, as a fraction.
    pub engine_torque_share: Option<f64>,
    /// Of the turbine-side inertia of a shift, as a fraction.
    pub inertia_share: Option<f64>,
    /// Of the stiffness of the drive shafts, as a fraction.
    pub shaft_stiffness_share: Option<f64>,
    /// Of the scale of the wheel speed, as a fraction.
    pub wheel_scale_share: Option<f64>,
    /// Of the mass of the car as it is driven, as a fraction.
    pub mass_share: Option<f64>,
    /// By how much the torques of the valve models err, over what the bounds of the elements say.
    pub valve_error_scale: Option<f64>,
    /// Of each element, in the order of the gearbox's elements.
    pub elements: Vec<ElementErrorBounds>,
}

/// Bounds on the errors of one friction element and its valve; none where the file says nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ElementErrorBounds {
    /// Minimum and maximum factor on the friction.
    pub friction_factor: Option<[f64; 2]>,
    /// Minimum and maximum factor on the gain of the valve.
    pub valve_gain_factor: Option<[f64; 2]>,
    /// Minimum and maximum factor on its lag.
    pub valve_lag_factor: Option<[f64; 2]>,
    /// Its minimum and maximum delay, s.
    pub valve_delay_s: Option<[f64; 2]>,
    /// Maximum half-width of its hysteresis, Pa.
    pub valve_hysteresis_pa: Option<f64>,
    /// Maximum error of a reading of its command, A or %.
    pub command: Option<f64>,
}
