//! A car of one shift, with what the design of its observers needs.

use drivetrain::{Converter, Driveline, Engine, ReducedShift, RoadLoad, Tyre, Valve};

use crate::{ErrorBounds, ShiftClutch};

/// Largest drive-shaft torque over what the tyres can pass to the road \[chosen\]: wheels that spin up take more for a moment.
const SHAFT_OVER_TYRES: f64 = 2.0;

/// Ranges of what varies in the observer's model; their corners span the polytope of Eq. (2.46).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertainty {
    /// Friction coefficient of the oncoming clutch, minimum and maximum.
    pub friction: (f64, f64),
    /// What varies in the valve.
    pub valve: ValveUncertainty,
}

/// What varies in the observers' valve model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ValveUncertainty {
    /// Nothing.
    None,
    /// The time constant of a proportional valve, s, minimum and maximum.
    TimeConstant((f64, f64)),
    /// The operating points of a pulse-width valve, at which it is linearised: size of the pressure drop between its
    /// settled pressure and the cylinder, Pa, lower and upper limit.
    PressureDrop((f64, f64)),
}

/// What the gain design must reach in one phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DesignRequirement {
    /// Time in which an initial error must be gone, s: `4 / kappa2`.
    pub settling_time_s: f64,
    /// `kappa1`, 1/s, if it is given and not to be found by the design.
    pub kappa1_per_s: Option<f64>,
    /// Bound on the model error `|w|`, rad/s^2.
    pub model_error_max_rad_s2: f64,
    /// Largest acceptable offset of the pressure estimate, Pa.
    pub offset_max_pa: f64,
}

/// What the gain design of the compliant observer must reach in one phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantRequirement {
    /// Time in which an initial error must be gone, s: `4 / kappa2`.
    pub settling_time_s: f64,
    /// `kappa1`, 1/s, if it is given and not to be found by the design.
    pub kappa1_per_s: Option<f64>,
    /// Largest acceptable offset of the pressure estimate, Pa.
    pub offset_max_pa: f64,
    /// `H` for `|w| <= 1`, normalised, if it is given and not to follow from the error bounds: a row for each output
    /// of the phase; what is beyond them is zero.
    pub error_matrix: Option<[[f64; 3]; 3]>,
}

/// The Kalman filter's model of the unknown torques, in addition to the error bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterSettings {
    /// Standard deviation of the turbine torque, as a fraction.
    pub turbine_share: f64,
    /// Time after which that fraction is another during a shift, s.
    pub turbine_share_s: f64,
    /// Standard deviation of the rate of twist outside a shift, rad/s: how far the readings of output and wheel disagree.
    pub twist_rate_rad_s: f64,
    /// Time for which an error of the valve model persists, s.
    pub valve_rate_s: f64,
    /// How fast the torque of the offgoing clutch changes while it holds, N m per root second: about 0.7 of what it holds at the
    /// maximum engine torque.
    pub offgoing_n_m: f64,
    /// Time constant with which it goes once the clutch has let go, s.
    pub offgoing_release_s: f64,
    /// Output speed below which readings of toothed wheels are too old to be used, rad/s.
    pub output_least_rad_s: f64,
}

/// Slips that decide on the phase of a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseSlips {
    /// Slip of the offgoing clutch above which it counts as released, rad/s.
    pub release_slip_rad_s: f64,
    /// Slip of the oncoming clutch below which it may have locked, rad/s.
    pub lock_slip_rad_s: f64,
    /// Time that the slip must stay below it, s.
    pub lock_hold_s: f64,
}

/// What the gain designs of one shift must reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Requirements {
    /// In the torque phase.
    pub torque_phase: DesignRequirement,
    /// In the inertia phase.
    pub inertia_phase: DesignRequirement,
    /// On the compliant observer in the torque phase.
    pub compliant_torque_phase: CompliantRequirement,
    /// On the compliant observer in the inertia phase.
    pub compliant_inertia_phase: CompliantRequirement,
}

/// What the observers of one shift assume, beside the car and its error budget.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObserverSettings {
    /// Their model of the oncoming clutch's valve.
    pub valve: Valve<f64>,
    /// What varies in their model.
    pub uncertainty: Uncertainty,
    /// Slips that decide on the phase.
    pub phase_slips: PhaseSlips,
    /// Highest speed that is taken for a measurement, rad/s.
    pub speed_max_rad_s: f64,
    /// Largest command of the valve that is taken for a measurement, A or %.
    pub command_max: f64,
    /// The Kalman filter's model of the unknown torques.
    pub filter: FilterSettings,
    /// Time in which the estimated shaft torque leans towards its steady value outside the shift, s.
    pub shaft_settling_s: f64,
}

/// A shaft of the gear train with what it adds to the mass matrix of the shift.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaft {
    /// Its name.
    pub name: String,
    /// Mass matrix, kg m^2, by turbine and output speed.
    pub mass_kg_m2: [[f64; 2]; 2],
}

/// A vehicle: everything the plant, the observers and the design need to know.
#[derive(Debug, Clone, PartialEq)]
pub struct Vehicle {
    /// Its name for people.
    pub name: String,
    /// The engine.
    pub engine: Engine<f64>,
    /// The torque converter.
    pub converter: Converter<f64>,
    /// The bare gear train, reduced to the shift.
    pub shift: ReducedShift<f64>,
    /// Inertia `I_o` of the output shaft in [`Self::shift`], kg m^2.
    pub output_inertia_kg_m2: f64,
    /// The clutch that lets go.
    pub offgoing: ShiftClutch,
    /// The clutch that engages, whose pressure is estimated.
    pub oncoming: ShiftClutch,
    /// Differential, drive shafts, wheels.
    pub driveline: Driveline<f64>,
    /// Backlash between gearbox and wheels, rad at the wheel. Observers do not know it.
    pub backlash_rad: f64,
    /// Temperature of the oil, degC.
    pub oil_temperature_degc: f64,
    /// The driven tyres.
    pub tyre: Tyre<f64>,
    /// Vehicle body and road.
    pub road: RoadLoad<f64>,
    /// What the observers assume.
    pub settings: ObserverSettings,
    /// What the gain design must reach.
    pub requirements: Requirements,
    /// The error budget.
    pub error_bounds: ErrorBounds,
}

impl Vehicle {
    /// Largest drive-shaft torque that is taken for possible, N m.
    pub fn shaft_torque_max_n_m(&self) -> f64 {
        SHAFT_OVER_TYRES * self.tyre.max_force_n * self.road.wheel_radius_m
    }
}
